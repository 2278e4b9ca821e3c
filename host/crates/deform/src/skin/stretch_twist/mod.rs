//! Stretchable, twistable bones over linear or dual quaternion blending (thesis eqs. 6.4 to 6.6).

mod blocks;
mod dual;
mod half_twist;
mod linear;

use armature_geometry::Influences;
use glam::Affine3A;

use self::blocks::TwistBlocks;
use self::dual::{OverDual, TwistDual};
use self::linear::{OverLinear, TwistLinear};
use super::blocks::{SkinBlocks, set_rest, skin_blocks};
use super::bones::{BoneSegment, RestSegments, StretchTwist};
use super::dual_quaternion::DualQuaternionSkin;
use super::error::{SkinError, expect_length};
use super::linear_blend::LinearBlendSkin;
use super::morphs::Morphs;

/// How the bones' motions are blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneBlend {
    /// As matrices (linear blend skinning).
    Linear,
    /// As dual quaternions.
    DualQuaternion,
}

/// A character whose bones may stretch and twist along their length.
#[derive(Clone, Debug)]
pub struct StretchTwistSkin {
    blocks: TwistBlocks,
    rest: RestSegments,
    /// Half the twist at each bone's start, and how much it grows to the end.
    half_twists: Vec<[f32; 2]>,
    /// Neither stretched nor twisted.
    plain: Vec<bool>,
    /// The bones' own motions.
    frames: Vec<Affine3A>,
    bones: Bones,
}

#[derive(Clone, Debug)]
enum Bones {
    Linear(TwistLinear),
    Dual(TwistDual),
}

impl StretchTwistSkin {
    /// Takes a character at rest. `end_weights`: as long as `influences.bones()` and in the same order, how far towards
    /// the end of that bone the vertex is, 0 at the start and 1 at the end (`e_i` in the thesis); they are clamped.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        end_weights: &[f32],
        rest: &[BoneSegment],
        blend: BoneBlend,
    ) -> Result<Self, SkinError> {
        let segments = RestSegments::new(rest_positions, rest_normals, influences, end_weights, rest)?;
        let frames = segments.frames();
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
        Ok(Self {
            blocks: TwistBlocks::new(bones.blocks(), influences, end_weights),
            rest: segments,
            half_twists: vec![[0.0; 2]; rest.len()],
            plain: vec![true; rest.len()],
            frames,
            bones,
        })
    }

    /// Moves the rest shape to where morph targets have it; its vertices stay where they are along their bones.
    /// Allocates nothing.
    pub fn set_rest(&mut self, morphs: &Morphs) -> Result<(), SkinError> {
        set_rest(&mut self.blocks.blocks, self.bones.blocks().vertex_count, morphs)
    }

    /// Writes the posed positions and unit normals, n×3 each.
    ///
    /// Where none of a vertex's bones stretches or twists (nor any of those of its neighbours in memory, in blocks of
    /// eight), the result is bit for bit that of the underlying method for the frames
    /// `Affine3A::from_rotation_translation(turn, start)`, over rest frames that are translated to the bones' starts.
    /// Normals turn with the blended rotation (its cofactors, for linear blending) of the bones and their twists at the
    /// vertex; the effect of the weights' own gradients is ignored. A `turn` that is not of unit length is normalised.
    /// Allocates nothing, under the same terms as [`LinearBlendSkin::solve`](super::LinearBlendSkin::solve).
    pub fn solve(
        &mut self,
        pose: &[StretchTwist],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", pose.len(), self.rest.bone_count())?;
        self.bones.blocks().check_room(positions, normals)?;
        self.rest.posed(pose, |bone, posed| {
            self.half_twists[bone] = posed.half_twist;
            self.plain[bone] = posed.is_plain();
            self.frames[bone] = posed.frame;
            let finite = match &mut self.bones {
                Bones::Linear(bones) => bones.set_bone(bone, posed),
                Bones::Dual(bones) => bones.set_bone(bone, posed),
            };
            if finite { Ok(()) } else { Err(SkinError::PoseNotFinite { bone }) }
        })?;
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
