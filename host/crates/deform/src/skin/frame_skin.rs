//! What linear blending and dual quaternions share: a character at rest, posed by one frame per bone.

use armature_geometry::Influences;
use glam::Affine3A;

use super::blocks::{Blend, Block, SkinBlocks, skin_blocks};
use super::bones::{BoneBinding, RestFrames};
use super::error::{SkinError, expect_length};

/// Vertices and bones at rest.
#[derive(Clone, Debug)]
pub(super) struct RestSkin {
    pub(super) blocks: SkinBlocks,
    pub(super) frames: RestFrames,
}

impl RestSkin {
    pub(super) fn new(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        rest_model_from_bone: &[Affine3A],
    ) -> Result<Self, SkinError> {
        let frames = RestFrames::new(rest_positions, rest_normals, influences, rest_model_from_bone)?;
        Ok(Self { blocks: SkinBlocks::new(rest_positions, rest_normals, influences), frames })
    }

    pub(super) fn bound(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        bindings: &[BoneBinding],
        bone_count: usize,
    ) -> Result<Self, SkinError> {
        let frames = RestFrames::bound(rest_positions, rest_normals, influences, bindings, bone_count)?;
        Ok(Self { blocks: SkinBlocks::new(rest_positions, rest_normals, influences), frames })
    }
}

/// A way to blend frames.
pub(super) trait FrameSkin: Blend<Block = Block> {
    /// The character at rest.
    fn rest(&self) -> &RestSkin;

    /// Prepares one frame per bone.
    fn set_pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError>;
}

/// Writes the posed positions and normals.
pub(super) fn solve_frames<S: FrameSkin>(
    skin: &mut S,
    model_from_bone: &[Affine3A],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) -> Result<(), SkinError> {
    let rest = skin.rest();
    expect_length("posed bones", model_from_bone.len(), rest.frames.bone_count())?;
    rest.blocks.check_room(positions, normals)?;
    skin.set_pose(model_from_bone)?;
    skin_blocks(skin, &skin.rest().blocks.blocks, positions, normals);
    Ok(())
}
