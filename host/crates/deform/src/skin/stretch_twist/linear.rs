//! Stretchable, twistable bones over linear blending (thesis eq. 6.5).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use glam::{Affine3A, DMat3, DVec3};

use super::blocks::{OneBone, TwistBlock, TwistBlocks, Way};
use super::half_twist::{half_twist, half_twist_of};
use crate::lanes::{Eight, LANES, Lane};
use crate::skin::blocks::{Blend, Layer, Map, SkinBlocks};
use crate::skin::bones::PosedBone;
use crate::skin::error::SkinError;
use crate::skin::frame_skin::FrameSkin;
use crate::skin::linear_blend::LinearBlendSkin;

#[derive(Clone, Debug)]
pub(super) struct TwistLinear {
    base: LinearBlendSkin,
    bones: Vec<Turned>,
}

/// With `θ` the twist at a vertex's place and `e` its end weight, its bone's map (thesis eq. 6.5) is
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

impl TwistLinear {
    pub(super) fn new(base: LinearBlendSkin) -> Self {
        Self { bones: vec![Turned::default(); base.bone_count()], base }
    }

    pub(super) fn blocks(&self) -> &SkinBlocks {
        &self.base.rest().blocks
    }

    /// Whether the result is finite.
    pub(super) fn set_bone(&mut self, bone: usize, posed: &PosedBone) -> bool {
        self.bones[bone].set(posed)
    }

    pub(super) fn set_base(&mut self, frames: &[Affine3A]) -> Result<(), SkinError> {
        self.base.set_pose(frames)
    }
}

impl Turned {
    /// Whether the result is finite.
    fn set(&mut self, posed: &PosedBone) -> bool {
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

/// Layers whose factors are computed before any of them is added up, as many as most vertices have.
const LAYERS: usize = 4;

/// A pose to blend.
pub(super) struct OverLinear<'a> {
    pub(super) skin: &'a TwistLinear,
    pub(super) twist: &'a TwistBlocks,
    pub(super) half_twists: &'a [[f32; 2]],
}

impl Blend for OverLinear<'_> {
    type Block = TwistBlock;
    type Motion<E: Eight> = Map<E>;

    #[inline(always)]
    fn blend<E: Eight>(&self, of_twist: &TwistBlock) -> Map<E> {
        let Self { skin, twist, half_twists } = self;
        let block = &of_twist.block;
        match twist.way(of_twist) {
            Way::Plain => skin.base.blend::<E>(block),
            Way::ByBone(range) => blend_by_bone::<E>(&twist.by_bone[range], half_twists, &skin.bones),
            Way::Mixed => {
                let layers = &skin.base.rest().blocks.layers[block.layers()];
                blend_maps::<E>(layers, &twist.ends[block.layers()], half_twists, &skin.bones)
            }
        }
    }
}

/// Eight vertices follow one bone after the other: no numbers change their layout.
#[inline(always)]
fn blend_by_bone<E: Eight>(by_bone: &[OneBone], half_twists: &[[f32; 2]], bones: &[Turned]) -> Map<E> {
    let mut map = [[E::zero(); 4]; 3];
    for of in by_bone {
        let bone = &bones[usize::from(of.bone)];
        let (weight, end) = (E::load(&of.weights), E::load(&of.ends));
        let (sine, cosine) = half_twist_of(half_twists[usize::from(of.bone)], end);
        let twice = (weight + weight) * sine;
        let (fold, cross, stretch) = (twice * sine, twice * cosine, weight * end);
        let [turn_0, fold_0, cross_0] = &bone.upper;
        for column in 0..4 {
            let row_0 = map[0][column].plus_product(E::splat(turn_0[column]), weight);
            let row_0 = row_0.plus_product(E::splat(fold_0[column]), fold);
            map[0][column] = row_0.plus_product(E::splat(cross_0[column]), cross);
            let row_1 = map[1][column].plus_product(E::splat(turn_0[4 + column]), weight);
            let row_1 = row_1.plus_product(E::splat(fold_0[4 + column]), fold);
            map[1][column] = row_1.plus_product(E::splat(cross_0[4 + column]), cross);
            let row_2 = map[2][column].plus_product(E::splat(bone.turn_fold[column]), weight);
            let row_2 = row_2.plus_product(E::splat(bone.turn_fold[4 + column]), fold);
            map[2][column] = row_2.plus_product(E::splat(bone.cross_stretch[column]), cross);
        }
        for row in 0..3 {
            map[row][3] = map[row][3].plus_product(E::splat(bone.cross_stretch[4 + row]), stretch);
        }
    }
    map
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
        let (sine, cosine) = half_twist(half_twists, &layers[number], end);
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
