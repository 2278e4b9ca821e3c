//! Stretchable, twistable bones over linear or dual quaternion blending (thesis eqs. 6.4 to 6.6).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DQuat, DVec3, Quat, Vec3};

use crate::dual_quaternion_skinning::DualQuaternionSkin;
use crate::eight::Eight;
use crate::linear_blend_skinning::{LinearBlendSkin, SkinError, expect_length};
use crate::skin_blocks::{Layer, SkinBlocks, skin_blocks};
use crate::stretch_twist_blocks::TwistBlocks;
use crate::stretch_twist_dual::{OverDual, TwistDual};
use crate::stretch_twist_linear::{OverLinear, TwistLinear};

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
    blocks: TwistBlocks,
    rest: Vec<BoneSegment>,
    /// Half the twist at each bone's start, and how much it grows to the end.
    half_twists: Vec<[f32; 2]>,
    /// Neither stretched nor twisted.
    plain: Vec<bool>,
    /// The motions of the bones as such.
    frames: Vec<Affine3A>,
    bones: Bones,
}

#[derive(Clone, Debug)]
enum Bones {
    Linear(TwistLinear),
    Dual(TwistDual),
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
        let bones = match blend {
            BoneBlend::Linear => {
                let base = LinearBlendSkin::precompute(rest_positions, rest_normals, influences, &frames)?;
                Bones::Linear(TwistLinear::new(base))
            }
            BoneBlend::DualQuaternion => {
                let base = DualQuaternionSkin::precompute(rest_positions, rest_normals, influences, &frames)?;
                Bones::Dual(TwistDual::new(base))
            }
        };
        if let Some(bone) = rest.iter().position(|bone| !bone.end.is_finite()) {
            return Err(SkinError::RestNotInvertible { bone });
        }
        expect_length("end weights", end_weights.len(), influences.bones().len())?;
        if let Some(slot) = end_weights.iter().position(|e| !e.is_finite()) {
            return Err(SkinError::VertexNotFinite { vertex: slot / influences.per_vertex() });
        }
        Ok(Self {
            blocks: TwistBlocks::new(bones.blocks(), influences, end_weights),
            rest: rest.to_vec(),
            half_twists: vec![[0.0; 2]; rest.len()],
            plain: vec![true; rest.len()],
            frames,
            bones,
        })
    }

    /// Writes the posed positions and unit normals, n×3 each.
    ///
    /// Where none of a vertex's bones stretches or twists (nor any of those of its neighbours in memory, eight by
    /// eight) the result is bit for bit that of the underlying method for the frames
    /// `Affine3A::from_rotation_translation(turn, start)`, over rest frames that are translated to the bones' starts.
    /// Normals turn with the blended rotation (its cofactors, for linear blending) of the bones and their twists at
    /// the vertex; what the weights' own slopes add is left out. A `turn` that is not of unit length is made so.
    /// Allocates nothing, under the same terms as [`LinearBlendSkin::solve`](crate::LinearBlendSkin::solve).
    pub fn solve(
        &mut self,
        pose: &[StretchTwist],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", pose.len(), self.rest.len())?;
        self.bones.blocks().check_room(positions, normals)?;
        for (bone, (pose, rest)) in pose.iter().zip(&self.rest).enumerate() {
            let posed = Posed::new(pose, rest).ok_or(SkinError::PoseNotFinite { bone })?;
            self.half_twists[bone] = posed.half_twist;
            self.plain[bone] = posed.is_plain();
            self.frames[bone] = posed.frame;
            let finite = match &mut self.bones {
                Bones::Linear(bones) => bones.set_bone(bone, &posed),
                Bones::Dual(bones) => bones.set_bone(bone, &posed),
            };
            if !finite {
                return Err(SkinError::PoseNotFinite { bone });
            }
        }
        match &mut self.bones {
            Bones::Linear(bones) => bones.set_base(&self.frames)?,
            Bones::Dual(bones) => bones.set_base(&self.frames)?,
        }
        self.blocks.set_plain(|bone| self.plain[usize::from(bone)]);
        let (twist, half_twists) = (&self.blocks, self.half_twists.as_slice());
        match &self.bones {
            Bones::Linear(skin) => {
                skin_blocks(&OverLinear { skin, twist, half_twists }, &twist.blocks, positions, normals);
            }
            Bones::Dual(skin) => {
                skin_blocks(&OverDual { skin, twist, half_twists }, &twist.blocks, positions, normals);
            }
        }
        Ok(())
    }
}

impl Bones {
    fn blocks(&self) -> &SkinBlocks {
        match self {
            Self::Linear(bones) => bones.blocks(),
            Self::Dual(bones) => bones.blocks(),
        }
    }
}

/// A bone's pose in `f64`.
pub(crate) struct Posed {
    pub(crate) turn: DQuat,
    /// Unit at rest, or zero for a bone without length, which has no axis to twist about.
    pub(crate) axis: DVec3,
    pub(crate) rest_start: DVec3,
    pub(crate) start: DVec3,
    /// What stretching adds to where the end goes.
    pub(crate) longer: DVec3,
    half_twist: [f32; 2],
    /// Where the bone is, in the underlying method's terms.
    frame: Affine3A,
}

/// How far the squared length of a quaternion that has been made unit in `f32` may be from one.
const UNIT: f64 = 1e-6;

impl Posed {
    fn new(pose: &StretchTwist, rest: &BoneSegment) -> Option<Self> {
        let turn = DQuat::from_array(pose.turn.to_array().map(f64::from));
        let length = turn.length();
        let half_twist = [0.5 * pose.twist[0], 0.5 * (pose.twist[1] - pose.twist[0])];
        if !(length > 1e-12 && length.is_finite() && half_twist.iter().all(|t| t.is_finite())) {
            return None;
        }
        let unit = if (length * length - 1.0).abs() < UNIT { pose.turn } else { (turn * (1.0 / length)).as_quat() };
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
            frame: Affine3A::from_rotation_translation(unit, pose.start),
        })
    }

    fn is_plain(&self) -> bool {
        self.half_twist.iter().all(|t| *t == 0.0) && self.longer == DVec3::ZERO
    }
}

/// Sine and cosine of half the twist where the vertices of a layer sit, `ends` along its bones.
#[inline(always)]
pub(crate) fn half_twist<E: Eight>(half_twists: &[[f32; 2]], layer: &Layer, ends: E) -> (E, E) {
    let [first, slope] = E::gather_twos(half_twists, &layer.bones);
    sine_and_cosine(first.plus_product(ends, slope))
}

/// The same on one bone.
#[inline(always)]
pub(crate) fn half_twist_of<E: Eight>(half_twist: [f32; 2], ends: E) -> (E, E) {
    let [first, slope] = half_twist;
    let angle = E::splat(first).plus_product(ends, E::splat(slope));
    if first.abs().max((first + slope).abs()) < QUARTER_TURN {
        sine_and_cosine_within_a_quarter(angle)
    } else {
        sine_and_cosine(angle)
    }
}

/// A little less than one: what rounds to nothing in [`sine_and_cosine`].
const QUARTER_TURN: f32 = 1.57;

/// Sine and cosine, or both with the other sign: the same rotation where the angle is half of one. Errors below 4e-7
/// for some tens of turns, and exactly 0 and 1 at 0.
#[inline(always)]
fn sine_and_cosine<E: Eight>(angle: E) -> (E, E) {
    let halves = (angle * E::splat(std::f32::consts::FRAC_1_PI)).round();
    // π in two parts, the first with so few bits that its product is exact.
    sine_and_cosine_within_a_quarter((angle - halves * E::splat(3.140_625)) - halves * E::splat(9.676_536e-4))
}

#[inline(always)]
fn sine_and_cosine_within_a_quarter<E: Eight>(x: E) -> (E, E) {
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
