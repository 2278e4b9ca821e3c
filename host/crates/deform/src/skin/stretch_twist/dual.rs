//! Stretchable, twistable bones over dual quaternion blending (thesis eq. 6.6).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use glam::{Affine3A, DQuat, DVec3};

use super::blocks::{OneBone, TwistBlock, TwistBlocks, Way};
use super::half_twist::{half_twist, half_twist_of};
use crate::lanes::{Eight, LANES, Lane};
use crate::skin::blocks::{Blend, Block, Layer, SkinBlocks, made_unit};
use crate::skin::bones::PosedBone;
use crate::skin::dual_quaternion::DualQuaternionSkin;
use crate::skin::error::SkinError;
use crate::skin::frame_skin::FrameSkin;

#[derive(Clone, Debug)]
pub(super) struct TwistDual {
    base: DualQuaternionSkin,
    motions: Vec<Motion>,
    /// For each pair of bones that meet, the products of the real parts of still and twisted motions.
    along: Vec<[f32; 4]>,
}

/// With `φ` half the twist, a bone's dual quaternion is `cos φ · still + sin φ · twisted`, plus
/// `e cos φ · stretch[..4] + e sin φ · stretch[4..]` in its dual part.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Motion {
    still: Lane,
    twisted: Lane,
    stretch: Lane,
}

impl TwistDual {
    pub(super) fn new(base: DualQuaternionSkin) -> Self {
        let (motions, along) = (vec![Motion::default(); base.bone_count()], vec![[0.0; 4]; base.pivots.pairs.len()]);
        Self { base, motions, along }
    }

    pub(super) fn blocks(&self) -> &SkinBlocks {
        &self.base.rest().blocks
    }

    /// Whether the result is finite.
    pub(super) fn set_bone(&mut self, bone: usize, posed: &PosedBone) -> bool {
        self.motions[bone].set(posed)
    }

    /// After all bones are set.
    pub(super) fn set_base(&mut self, frames: &[Affine3A]) -> Result<(), SkinError> {
        for (along, [pivot, other]) in self.along.iter_mut().zip(&self.base.pivots.pairs) {
            let [pivot, other] = [pivot, other].map(|bone| &self.motions[usize::from(*bone)]);
            let dot = |a: &Lane, b: &Lane| a[0] * b[0] + a[1] * b[1] + (a[2] * b[2] + a[3] * b[3]);
            let (p, o) = ([&pivot.still, &pivot.twisted], [&other.still, &other.twisted]);
            *along = [dot(p[0], o[0]), dot(p[0], o[1]), dot(p[1], o[0]), dot(p[1], o[1])];
        }
        self.base.set_pose(frames)
    }
}

impl Motion {
    /// Whether the result is finite.
    fn set(&mut self, posed: &PosedBone) -> bool {
        let pure = |v: DVec3| DQuat::from_xyzw(v.x, v.y, v.z, 0.0);
        let (start, rest, longer) = (pure(posed.start), pure(posed.rest_start), pure(posed.longer));
        let halves =
            |low: DQuat, high: DQuat| [low.w, low.x, low.y, low.z, high.w, high.x, high.y, high.z].map(|c| c as f32);
        // From rest to the bone's own frame, rotated, and to the bone's current start.
        let motion = |turn: DQuat| halves(turn, (start * turn - turn * rest) * 0.5);
        let twisted = posed.turn * pure(posed.axis);
        self.still = motion(posed.turn);
        self.twisted = motion(twisted);
        self.stretch = halves(longer * posed.turn * 0.5, longer * twisted * 0.5);
        [self.still, self.twisted, self.stretch].as_flattened().iter().all(|c| c.is_finite())
    }
}

/// Layers whose factors are computed before any of them is added up, as many as most vertices have.
const LAYERS: usize = 4;

/// A pose to blend.
pub(super) struct OverDual<'a> {
    pub(super) skin: &'a TwistDual,
    pub(super) twist: &'a TwistBlocks,
    pub(super) half_twists: &'a [[f32; 2]],
}

impl Blend for OverDual<'_> {
    type Block = TwistBlock;
    type Motion<E: Eight> = [E; 8];

    #[inline(always)]
    fn blend<E: Eight>(&self, block: &TwistBlock) -> [E; 8] {
        match self.twist.way(block) {
            Way::Plain => self.skin.base.blend::<E>(&block.block),
            Way::ByBone(range) => self.blend_by_bone::<E>(&self.twist.by_bone[range], block),
            Way::Mixed => self.blend_mixed::<E>(&block.block),
        }
    }
}

impl OverDual<'_> {
    /// Eight vertices follow one bone after the other. The weighted sum of dual quaternions, each on the side of the
    /// vertex's heaviest bone, normalised.
    #[inline(always)]
    fn blend_by_bone<E: Eight>(&self, by_bone: &[OneBone], block: &TwistBlock) -> [E; 8] {
        let mut pivot = if block.one_pivot { None } else { Some(self.pivot::<E>(&block.pivot)) };
        let mut sum = [E::zero(); 8];
        for of in by_bone {
            let bone = &self.skin.motions[usize::from(of.bone)];
            let end = E::load(&of.ends);
            let (sine, cosine) = half_twist_of(self.half_twists[usize::from(of.bone)], end);
            let mut real = [E::zero(); 4];
            for part in 0..4 {
                real[part] = (cosine * E::splat(bone.still[part])).plus_product(sine, E::splat(bone.twisted[part]));
            }
            let [a, b, c, d] = *pivot.get_or_insert(real);
            let along = (a * real[0]).plus_product(b, real[1]) + (c * real[2]).plus_product(d, real[3]);
            let weight = E::load(&of.weights).turned_by_sign_of(along);
            let (by_cosine, by_sine) = (weight * cosine, weight * sine);
            let (end_cosine, end_sine) = (by_cosine * end, by_sine * end);
            for part in 0..4 {
                sum[part] = sum[part].plus_product(weight, real[part]);
                let moved = sum[4 + part].plus_product(by_cosine, E::splat(bone.still[4 + part]));
                let moved = moved.plus_product(by_sine, E::splat(bone.twisted[4 + part]));
                let moved = moved.plus_product(end_cosine, E::splat(bone.stretch[part]));
                sum[4 + part] = moved.plus_product(end_sine, E::splat(bone.stretch[4 + part]));
            }
        }
        made_unit(sum)
    }

    /// The rotation of each lane's heaviest bone at its vertex's place.
    #[inline(always)]
    fn pivot<E: Eight>(&self, pivot: &Layer) -> [E; 4] {
        let (sine, cosine) = half_twist::<E>(self.half_twists, pivot, E::load(&pivot.weights));
        let (mut still, mut twisted) = ([E::zero(); 4], [E::zero(); 4]);
        for lane in 0..4 {
            let near = &self.skin.motions[usize::from(pivot.bones[lane])];
            let far = &self.skin.motions[usize::from(pivot.bones[lane + 4])];
            still[lane] = E::lows(E::load(&near.still), E::load(&far.still));
            twisted[lane] = E::lows(E::load(&near.twisted), E::load(&far.twisted));
        }
        let (mut real, twisted) = (E::transpose_halves(still), E::transpose_halves(twisted));
        for part in 0..4 {
            real[part] = (cosine * real[part]).plus_product(sine, twisted[part]);
        }
        real
    }

    /// The same for eight vertices that follow different bones, influence by influence.
    #[inline(always)]
    fn blend_mixed<E: Eight>(&self, block: &Block) -> [E; 8] {
        let range = block.layers();
        let (layers, rest) = self.skin.base.rest().blocks.layers[range.clone()].as_chunks();
        let (ends, rest_ends) = self.twist.ends[range.clone()].as_chunks();
        let (pairs, rest_pairs) = self.skin.base.pivots.of_layers[range].as_chunks();
        let (mut sums, mut pivot) = ([[E::zero(); 2]; LANES], None);
        for ((layers, ends), pairs) in layers.iter().zip(ends).zip(pairs) {
            self.add::<E, LAYERS>(layers, ends, pairs, &mut pivot, &mut sums);
        }
        for ((layer, ends), pairs) in rest.iter().zip(rest_ends).zip(rest_pairs) {
            let (layer, ends) = (std::array::from_ref(layer), std::array::from_ref(ends));
            self.add(layer, ends, std::array::from_ref(pairs), &mut pivot, &mut sums);
        }
        let (mut whole, mut longer) = ([E::zero(); LANES], [E::zero(); 4]);
        for lane in 0..LANES {
            whole[lane] = sums[lane][0];
        }
        for lane in 0..4 {
            longer[lane] = E::fold(sums[lane][1], sums[lane + 4][1]);
        }
        let [a, b, c, d, e, f, g, h] = E::transpose(whole);
        let [w, x, y, z] = E::transpose_halves(longer);
        made_unit([a, b, c, d, e + w, f + x, g + y, h + z])
    }

    /// Dual quaternions, and both parts of what stretching adds, lane by lane. `pivot`: cosine and sine of half the
    /// twist in the block's first layer, once known.
    #[inline(always)]
    fn add<E: Eight, const N: usize>(
        &self,
        layers: &[Layer; N],
        ends: &[Lane; N],
        pairs: &[[u32; LANES]; N],
        pivot: &mut Option<[E; 2]>,
        sums: &mut [[E; 2]; LANES],
    ) {
        let mut factors = [[[0.0; LANES]; 4]; N];
        for number in 0..N {
            let (mut weight, end) = (E::load(&layers[number].weights), E::load(&ends[number]));
            let (sine, cosine) = half_twist(self.half_twists, &layers[number], end);
            if let Some(pivot) = pivot {
                let [cc, cs, sc, ss] = self.gather_along::<E>(&pairs[number]);
                let along = pivot[0] * (cosine * cc).plus_product(sine, cs);
                let along = along.plus_product(pivot[1], (cosine * sc).plus_product(sine, ss));
                weight = weight.turned_by_sign_of(along);
            } else {
                *pivot = Some([cosine, sine]);
            }
            let (by_cosine, by_sine) = (weight * cosine, weight * sine);
            by_cosine.store(&mut factors[number][0]);
            by_sine.store(&mut factors[number][1]);
            (by_cosine * end).store(&mut factors[number][2]);
            (by_sine * end).store(&mut factors[number][3]);
        }
        for lane in 0..LANES {
            let ([mut still, mut longer], mut twisted) = (sums[lane], E::zero());
            for number in 0..N {
                let bone = &self.skin.motions[usize::from(layers[number].bones[lane])];
                let [cosine, sine, end_cosine, end_sine] = &factors[number];
                let ends = E::joined(E::splat(end_cosine[lane]), E::splat(end_sine[lane]));
                still = still.plus_product(E::load(&bone.still), E::splat(cosine[lane]));
                twisted = twisted.plus_product(E::load(&bone.twisted), E::splat(sine[lane]));
                longer = longer.plus_product(E::load(&bone.stretch), ends);
            }
            sums[lane] = [still + twisted, longer];
        }
    }

    #[inline(always)]
    fn gather_along<E: Eight>(&self, pairs: &[u32; LANES]) -> [E; 4] {
        let mut rows = [E::zero(); 4];
        for lane in 0..4 {
            rows[lane] = E::halves(&self.skin.along[pairs[lane] as usize], &self.skin.along[pairs[lane + 4] as usize]);
        }
        E::transpose_halves(rows)
    }
}
