//! Pictures of a character in a pose, without a window.

use std::path::Path;

use armature_render::{MeshView, Picture, RenderError};
use armature_rig::Pose;
use glam::Affine3A;

use super::scene::{DrawnBy, View, draw_mesh};
use crate::characters::shapes::{ShapeWeight, weights_with};
use crate::characters::{LoadedCharacter, Shape};
use crate::failure::Failure;
use crate::files::Overwrite;

/// Draws a character with these skinned positions and normals and writes a PNG.
pub fn write_picture(
    overwrite: Overwrite,
    path: &Path,
    character: &LoadedCharacter,
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
) -> Result<DrawnBy, Failure> {
    let Some(shape) = &character.shape else {
        let what = format!("{} has no mesh, so there is nothing to draw", character.name);
        return Err(Failure::usage(what, "choose a character with a mesh, such as human"));
    };
    let failed = |error: RenderError| Failure::not_converged(format!("{}: {error}", path.display()), "");
    let (picture, by) = draw(shape, positions, normals, &View::default()).map_err(failed)?;
    overwrite.write(path, &armature_render::encode_png(&picture).map_err(failed)?)?;
    Ok(by)
}

/// Positions and unit normals, n×3 each.
pub type Skinned = (Vec<[f32; 3]>, Vec<[f32; 3]>);

/// Skins a character in one pose, blended towards these shapes.
pub fn skin_once(character: &LoadedCharacter, pose: &Pose, shapes: &[ShapeWeight]) -> Result<Skinned, Failure> {
    let weights = weights_with(character, shapes)?;
    let (Some(shape), Some(mut skin)) = (&character.shape, character.precompute_skin()?) else {
        return Ok(Skinned::default());
    };
    if let Some(mut morphs) = character.precompute_morphs()? {
        let blended = morphs.solve(&weights).and_then(|_| skin.set_rest(&morphs));
        blended.map_err(|e| Failure::input(e.to_string(), "choose weights between 0 and 1"))?;
    }
    let mut model_from_bone = vec![Affine3A::IDENTITY; character.skeleton.len()];
    pose.forward_kinematics(&character.skeleton, &mut model_from_bone);
    let (mut positions, mut normals) = (shape.positions.clone(), shape.normals().to_vec());
    skin.solve(&model_from_bone, &mut positions, &mut normals)
        .map_err(|e| Failure::input(e.to_string(), "choose another moment of the take"))?;
    Ok((positions, normals))
}

/// Draws a mesh with these positions and normals.
pub fn draw(
    shape: &Shape,
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
    view: &View,
) -> Result<(Picture, DrawnBy), RenderError> {
    let mesh = MeshView {
        positions,
        normals,
        triangles: shape.triangles(),
        uv: shape.texture_coordinates(),
        parts: &shape.parts,
        materials: &shape.materials,
        colors: shape.vertex_colors(),
        ..MeshView::default()
    };
    draw_mesh(&mesh, view)
}
