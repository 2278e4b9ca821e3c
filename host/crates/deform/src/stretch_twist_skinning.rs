//! Stretchable, twistable bones over linear or dual quaternion blending (thesis eqs. 6.4 to 6.6).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DMat3, DQuat, DVec3, Quat, Vec3};

use crate::eight::Eight;
use crate::linear_blend_skinning::{SkinError, check_rest, expect_length};
use crate::nearest_rotation::{LANES, Lane};
use crate::skin_blocks::{
    Block, Layer, Map, Pivots, SkinBlocks, load, made_unit, move_by_map, move_by_motion, turn, turn_by_map, write,
};
use crate::widest::{EightKernel, with_eight};

/// How the bones' motions are blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneBlend {
    /// As matrices (linear blend skinning).
    Linear,
    /// As dual quaternions.
    DualQuaternion,
}

/// A bone at rest, a line segment (mesh units, model space).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneSegment {
    /// Where it starts.
    pub start: Vec3,
    /// Where it ends.
    pub end: Vec3,
}

/// A posed bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchTwist {
    /// Where the start goes.
    pub start: Vec3,
    /// The rotation since rest, which takes the rest direction to the posed one.
    pub turn: Quat,
    /// Posed length over rest length; 1 does not stretch.
    pub stretch: f32,
    /// Twists about the bone at its start and end (radians); 0 does not twist.
    pub twist: [f32; 2],
}

/// A character whose bones may stretch and twist along their length.
#[derive(Clone, Debug)]
pub struct StretchTwistSkin {
    blocks: SkinBlocks,
    /// How far towards its bone's end each influence sits.
    ends: Vec<Lane>,
    rest: Vec<BoneSegment>,
    /// Half the twist at each bone's start, and how much it grows to the end.
    half_twists: Vec<[f32; 2]>,
    bones: Bones,
}

#[derive(Clone, Debug)]
enum Bones {
    Linear(Vec<Turned>),
    Dual { motions: Vec<Motion>, pivots: Pivots, along: Vec<[f32; 4]> },
}

/// With `θ` the twist where a vertex sits and `e` its end weight, its bone's map (thesis eq. 6.5) is
/// `turn + (1 − cos θ) · fold + sin θ · cross + e · stretch`, in rows of `(x, y, z, translation)`: for a rotation `R`
/// and a unit axis `a`, `fold = R (a aᵀ − 1)` and `cross = R [a]×`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Turned {
    /// The upper two rows of turn, fold and cross.
    upper: [Lane; 3],
    /// The third rows of turn and fold.
    turn_fold: Lane,
    /// The third row of cross, and the stretch.
    cross_stretch: Lane,
}

/// With `φ` half the twist, a bone's dual quaternion is `cos φ · still + sin φ · twisted`, and in its dual part
/// `e cos φ · stretch[..4] + e sin φ · stretch[4..]` more.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Motion {
    still: Lane,
    twisted: Lane,
    stretch: Lane,
}

impl StretchTwistSkin {
    /// Takes a character at rest. `end_weights`: as long as `influences.bones()` and in its order, how far towards
    /// the end of that bone the vertex sits, 0 at the start and 1 at the end (`e_i` of the thesis); they are clamped.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        end_weights: &[f32],
        rest: &[BoneSegment],
        blend: BoneBlend,
    ) -> Result<Self, SkinError> {
        let frames: Vec<Affine3A> = rest.iter().map(|bone| Affine3A::from_translation(bone.start)).collect();
        check_rest(rest_positions, rest_normals, influences, &frames)?;
        if let Some(bone) = rest.iter().position(|bone| !bone.end.is_finite()) {
            return Err(SkinError::RestNotInvertible { bone });
        }
        expect_length("end weights", end_weights.len(), influences.bones().len())?;
        if let Some(slot) = end_weights.iter().position(|e| !e.is_finite()) {
            return Err(SkinError::VertexNotFinite { vertex: slot / influences.per_vertex() });
        }
        let blocks = SkinBlocks::new(rest_positions, rest_normals, influences);
        let clamped: Vec<f32> = end_weights.iter().map(|e| e.clamp(0.0, 1.0)).collect();
        let bones = match blend {
            BoneBlend::Linear => Bones::Linear(vec![Turned::default(); rest.len()]),
            BoneBlend::DualQuaternion => {
                let pivots = Pivots::new(&blocks);
                let along = vec![[0.0; 4]; pivots.pairs.len()];
                Bones::Dual { motions: vec![Motion::default(); rest.len()], pivots, along }
            }
        };
        let ends = blocks.by_layer(influences, &clamped);
        Ok(Self { blocks, ends, rest: rest.to_vec(), half_twists: vec![[0.0; 2]; rest.len()], bones })
    }

    /// Writes the posed positions and unit normals, n×3 each.
    ///
    /// Bones that neither stretch nor twist give the underlying method. Normals turn with the blended rotation (its
    /// cofactors, for linear blending) of the bones and their twists at the vertex; what the weights' own slopes add
    /// is left out. Allocates nothing, under the same terms as
    /// [`LinearBlendSkin::solve`](crate::LinearBlendSkin::solve).
    pub fn solve(
        &mut self,
        pose: &[StretchTwist],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", pose.len(), self.rest.len())?;
        expect_length("room for positions", positions.len(), self.blocks.vertex_count)?;
        expect_length("room for normals", normals.len(), self.blocks.vertex_count)?;
        for (bone, (pose, rest)) in pose.iter().zip(&self.rest).enumerate() {
            let posed = Posed::new(pose, rest).ok_or(SkinError::PoseNotFinite { bone })?;
            self.half_twists[bone] = posed.half_twist;
            let finite = match &mut self.bones {
                Bones::Linear(bones) => bones[bone].set(&posed),
                Bones::Dual { motions, .. } => motions[bone].set(&posed),
            };
            if !finite {
                return Err(SkinError::PoseNotFinite { bone });
            }
        }
        if let Bones::Dual { motions, pivots, along } = &mut self.bones {
            for (along, [pivot, other]) in along.iter_mut().zip(&pivots.pairs) {
                let [pivot, other] = [pivot, other].map(|bone| &motions[usize::from(*bone)]);
                let dot = |a: &Lane, b: &Lane| a[0] * b[0] + a[1] * b[1] + (a[2] * b[2] + a[3] * b[3]);
                let (p, o) = ([&pivot.still, &pivot.twisted], [&other.still, &other.twisted]);
                *along = [dot(p[0], o[0]), dot(p[0], o[1]), dot(p[1], o[0]), dot(p[1], o[1])];
            }
        }
        let skin = &*self;
        let skin_chunk = |blocks: &[Block], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]| match &skin.bones {
            Bones::Linear(bones) => with_eight(SkinLinear { skin, bones, blocks, positions, normals }),
            Bones::Dual { motions, pivots, along } => {
                let pairs = &pivots.of_layers;
                with_eight(SkinDual { skin, motions, pairs, along, blocks, positions, normals });
            }
        };
        self.blocks.in_chunks(positions, normals, skin_chunk);
        Ok(())
    }
}

/// A bone's pose in `f64`.
struct Posed {
    turn: DQuat,
    /// Unit at rest, or zero for a bone without length, which has no axis to twist about.
    axis: DVec3,
    rest_start: DVec3,
    start: DVec3,
    /// What stretching adds to where the end goes.
    longer: DVec3,
    half_twist: [f32; 2],
}

impl Posed {
    fn new(pose: &StretchTwist, rest: &BoneSegment) -> Option<Self> {
        let turn = DQuat::from_array(pose.turn.to_array().map(f64::from));
        let length = turn.length();
        let half_twist = [0.5 * pose.twist[0], 0.5 * (pose.twist[1] - pose.twist[0])];
        if !(length > 1e-12 && length.is_finite() && half_twist.iter().all(|t| t.is_finite())) {
            return None;
        }
        let turn = turn * (1.0 / length);
        let along = (rest.end - rest.start).as_dvec3();
        let axis = along.normalize_or_zero();
        Some(Self {
            turn,
            axis,
            rest_start: rest.start.as_dvec3(),
            start: pose.start.as_dvec3(),
            longer: turn * (along * (f64::from(pose.stretch) - 1.0)),
            half_twist: if axis == DVec3::ZERO { [0.0; 2] } else { half_twist },
        })
    }
}

impl Turned {
    /// Whether the result is finite.
    fn set(&mut self, posed: &Posed) -> bool {
        let turn = DMat3::from_quat(posed.turn);
        let (a, forward) = (posed.axis, turn * posed.axis);
        let fold = DMat3::from_cols(forward * a.x, forward * a.y, forward * a.z) - turn;
        let cross = turn * DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z));
        let shifts = [posed.start - turn * posed.rest_start, -(fold * posed.rest_start), -(cross * posed.rest_start)];
        let row = |part: usize, row: usize| {
            let linear = [turn, fold, cross][part].row(row);
            linear.extend(shifts[part][row]).as_vec4().to_array()
        };
        let halves = |low: [f32; 4], high: [f32; 4]| std::array::from_fn(|i| if i < 4 { low[i] } else { high[i - 4] });
        self.upper = [0, 1, 2].map(|part| halves(row(part, 0), row(part, 1)));
        self.turn_fold = halves(row(0, 2), row(1, 2));
        self.cross_stretch = halves(row(2, 2), posed.longer.extend(0.0).as_vec4().to_array());
        let lanes = [self.upper[0], self.upper[1], self.upper[2], self.turn_fold, self.cross_stretch];
        lanes.as_flattened().iter().all(|c| c.is_finite())
    }
}

impl Motion {
    /// Whether the result is finite.
    fn set(&mut self, posed: &Posed) -> bool {
        let pure = |v: DVec3| DQuat::from_xyzw(v.x, v.y, v.z, 0.0);
        let (start, rest, longer) = (pure(posed.start), pure(posed.rest_start), pure(posed.longer));
        let halves =
            |low: DQuat, high: DQuat| [low.w, low.x, low.y, low.z, high.w, high.x, high.y, high.z].map(|c| c as f32);
        // From rest to the bone's own frame, turned, and to where the bone starts now.
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

struct SkinLinear<'a> {
    skin: &'a StretchTwistSkin,
    bones: &'a [Turned],
    blocks: &'a [Block],
    positions: &'a mut [[f32; 3]],
    normals: &'a mut [[f32; 3]],
}

impl EightKernel for SkinLinear<'_> {
    type Output = ();

    #[inline(always)]
    fn run<E: Eight>(self) {
        let Self { skin, bones, .. } = self;
        let outputs = self.positions.chunks_mut(LANES).zip(self.normals.chunks_mut(LANES));
        for (block, (positions, normals)) in self.blocks.iter().zip(outputs) {
            let layers = block.layers();
            let map =
                blend_maps::<E>(&skin.blocks.layers[layers.clone()], &skin.ends[layers], &skin.half_twists, bones);
            write(move_by_map(&map, load(&block.position)), positions);
            write(turn_by_map(&map, load(&block.normal)), normals);
        }
    }
}

#[inline(always)]
fn blend_maps<E: Eight>(layers: &[Layer], ends: &[Lane], half_twists: &[[f32; 2]], bones: &[Turned]) -> Map<E> {
    let mut sums = [[E::zero(); 3]; LANES];
    let (fours, rest) = layers.as_chunks();
    let (fours_ends, rest_ends) = ends.as_chunks();
    for (layers, ends) in fours.iter().zip(fours_ends) {
        add_maps::<E, LAYERS>(layers, ends, half_twists, bones, &mut sums);
    }
    for (layer, ends) in rest.iter().zip(rest_ends) {
        add_maps(std::array::from_ref(layer), std::array::from_ref(ends), half_twists, bones, &mut sums);
    }
    let (mut upper, mut lower, mut longer) = ([E::zero(); LANES], [E::zero(); 4], [E::zero(); 4]);
    for lane in 0..LANES {
        upper[lane] = sums[lane][0];
    }
    for lane in 0..4 {
        let (near, far) = (sums[lane], sums[lane + 4]);
        lower[lane] = E::fold(near[1], far[1]) + E::lows(near[2], far[2]);
        longer[lane] = E::highs(near[2], far[2]);
    }
    let [a, b, c, d, e, f, g, h] = E::transpose(upper);
    let ([i, j, k, l], [x, y, z, _]) = (E::transpose_halves(lower), E::transpose_halves(longer));
    [[a, b, c, d + x], [e, f, g, h + y], [i, j, k, l + z]]
}

/// Upper rows, third rows of turn and fold, third row of cross and the stretch, lane by lane.
#[inline(always)]
fn add_maps<E: Eight, const N: usize>(
    layers: &[Layer; N],
    ends: &[Lane; N],
    half_twists: &[[f32; 2]],
    bones: &[Turned],
    sums: &mut [[E; 3]; LANES],
) {
    let mut factors = [[[0.0; LANES]; 3]; N];
    for number in 0..N {
        let (weight, end) = (E::load(&layers[number].weights), E::load(&ends[number]));
        let [first, slope] = E::gather_twos(half_twists, &layers[number].bones);
        let (sine, cosine) = sine_and_cosine(first.plus_product(end, slope));
        let twice = (weight + weight) * sine;
        (twice * sine).store(&mut factors[number][0]);
        (twice * cosine).store(&mut factors[number][1]);
        (weight * end).store(&mut factors[number][2]);
    }
    for lane in 0..LANES {
        let [mut turn, mut turn_fold, mut cross_stretch] = sums[lane];
        let (mut fold, mut cross) = (E::zero(), E::zero());
        for number in 0..N {
            let bone = &bones[usize::from(layers[number].bones[lane])];
            let (of_turn, of_fold) = (E::splat(layers[number].weights[lane]), E::splat(factors[number][0][lane]));
            let (of_cross, of_stretch) = (E::splat(factors[number][1][lane]), E::splat(factors[number][2][lane]));
            turn = turn.plus_product(E::load(&bone.upper[0]), of_turn);
            fold = fold.plus_product(E::load(&bone.upper[1]), of_fold);
            cross = cross.plus_product(E::load(&bone.upper[2]), of_cross);
            turn_fold = turn_fold.plus_product(E::load(&bone.turn_fold), E::joined(of_turn, of_fold));
            let factor = E::joined(of_cross, of_stretch);
            cross_stretch = cross_stretch.plus_product(E::load(&bone.cross_stretch), factor);
        }
        sums[lane] = [turn + (fold + cross), turn_fold, cross_stretch];
    }
}

struct SkinDual<'a> {
    skin: &'a StretchTwistSkin,
    motions: &'a [Motion],
    pairs: &'a [[u32; LANES]],
    along: &'a [[f32; 4]],
    blocks: &'a [Block],
    positions: &'a mut [[f32; 3]],
    normals: &'a mut [[f32; 3]],
}

impl EightKernel for SkinDual<'_> {
    type Output = ();

    #[inline(always)]
    fn run<E: Eight>(mut self) {
        let outputs = std::mem::take(&mut self.positions).chunks_mut(LANES);
        let outputs = outputs.zip(std::mem::take(&mut self.normals).chunks_mut(LANES));
        for (block, (positions, normals)) in self.blocks.iter().zip(outputs) {
            let motion = self.blend::<E>(block);
            write(move_by_motion(&motion, load(&block.position)), positions);
            write(turn(&motion, load(&block.normal)), normals);
        }
    }
}

impl SkinDual<'_> {
    /// The weighted sum of dual quaternions, each on the side of the vertex's heaviest bone, made unit.
    #[inline(always)]
    fn blend<E: Eight>(&self, block: &Block) -> [E; 8] {
        let range = block.layers();
        let (layers, rest) = self.skin.blocks.layers[range.clone()].as_chunks();
        let (ends, rest_ends) = self.skin.ends[range.clone()].as_chunks();
        let (pairs, rest_pairs) = self.pairs[range].as_chunks();
        let (mut sums, pivot) = ([[E::zero(); 2]; LANES], self.pivot(block));
        for ((layers, ends), pairs) in layers.iter().zip(ends).zip(pairs) {
            self.add::<E, LAYERS>(layers, ends, pairs, pivot, &mut sums);
        }
        for ((layer, ends), pairs) in rest.iter().zip(rest_ends).zip(rest_pairs) {
            let (layer, ends) = (std::array::from_ref(layer), std::array::from_ref(ends));
            self.add(layer, ends, std::array::from_ref(pairs), pivot, &mut sums);
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

    /// Cosine and sine of half the twist of a block's first layer.
    #[inline(always)]
    fn pivot<E: Eight>(&self, block: &Block) -> [E; 2] {
        let Some(first) = block.layers().next() else { return [E::zero(); 2] };
        let (sine, cosine) = self.half_twist(&self.skin.blocks.layers[first], &self.skin.ends[first]);
        [cosine, sine]
    }

    #[inline(always)]
    fn half_twist<E: Eight>(&self, layer: &Layer, ends: &Lane) -> (E, E) {
        let [first, slope] = E::gather_twos(&self.skin.half_twists, &layer.bones);
        sine_and_cosine(first.plus_product(E::load(ends), slope))
    }

    /// Dual quaternions, and both parts of what stretching adds, lane by lane.
    #[inline(always)]
    fn add<E: Eight, const N: usize>(
        &self,
        layers: &[Layer; N],
        ends: &[Lane; N],
        pairs: &[[u32; LANES]; N],
        pivot: [E; 2],
        sums: &mut [[E; 2]; LANES],
    ) {
        let mut factors = [[[0.0; LANES]; 4]; N];
        for number in 0..N {
            let (sine, cosine) = self.half_twist::<E>(&layers[number], &ends[number]);
            let [cc, cs, sc, ss] = self.gather_along::<E>(&pairs[number]);
            let along = pivot[0] * (cosine * cc).plus_product(sine, cs);
            let along = along.plus_product(pivot[1], (cosine * sc).plus_product(sine, ss));
            let end = E::load(&ends[number]);
            let weight = E::load(&layers[number].weights).turned_by_sign_of(along);
            let (by_cosine, by_sine) = (weight * cosine, weight * sine);
            by_cosine.store(&mut factors[number][0]);
            by_sine.store(&mut factors[number][1]);
            (by_cosine * end).store(&mut factors[number][2]);
            (by_sine * end).store(&mut factors[number][3]);
        }
        for lane in 0..LANES {
            let ([mut still, mut longer], mut twisted) = (sums[lane], E::zero());
            for number in 0..N {
                let bone = &self.motions[usize::from(layers[number].bones[lane])];
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
            rows[lane] = E::halves(&self.along[pairs[lane] as usize], &self.along[pairs[lane + 4] as usize]);
        }
        E::transpose_halves(rows)
    }
}

/// Sine and cosine, or both with the other sign: the same rotation where the angle is half of one. Errors below 4e-7
/// for some tens of turns, and exactly 0 and 1 at 0.
#[inline(always)]
fn sine_and_cosine<E: Eight>(angle: E) -> (E, E) {
    let halves = (angle * E::splat(std::f32::consts::FRAC_1_PI)).round();
    // π in two parts, the first with so few bits that its product is exact.
    let x = (angle - halves * E::splat(3.140_625)) - halves * E::splat(9.676_536e-4);
    let s = x * x;
    // The polynomials nearest to both within a quarter turn to either side.
    let sine = E::splat(-1.981_829e-4).plus_product(s, E::splat(2.622_532e-6));
    let sine = E::splat(-1.666_666_7e-1).plus_product(s, E::splat(8.333_206e-3).plus_product(s, sine));
    let cosine = E::splat(-1.385_414_2e-3).plus_product(s, E::splat(2.315_384_2e-5));
    let cosine = E::splat(-4.999_992_8e-1).plus_product(s, E::splat(4.166_377_7e-2).plus_product(s, cosine));
    (x.plus_product(x, s * sine), E::splat(1.0).plus_product(s, cosine))
}

#[cfg(test)]
#[path = "stretch_twist_skinning_tests.rs"]
mod tests;
