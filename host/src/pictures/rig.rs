//! Pictures of a skeleton in a mesh that it was fitted into.

use std::path::Path;

use armature_character::rigging::Fit;
use armature_geometry::TriangleMesh;
use armature_geometry::surface::{NormalWeighting, vertex_normals};
use armature_render::{BoneMark, Bounds, Ground, MeshView, RenderError, Scene};

use super::scene::{DrawnBy, View, camera_of, draw_scene};
use crate::failure::Failure;
use crate::files::Overwrite;

/// Colours of bones that are sure and of bones that are not, sRGB and opacity.
const SURE: [f32; 4] = [0.10, 0.72, 0.28, 0.9];
const UNSURE: [f32; 4] = [0.92, 0.12, 0.10, 0.9];

/// Draws the bones through the mesh, coloured by how sure they are, and writes a PNG. The figure is seen from its front
/// if it stands along +Y.
pub fn write_rig_picture(
    overwrite: Overwrite,
    path: &Path,
    mesh: &TriangleMesh,
    fit: &Fit,
) -> Result<DrawnBy, Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::not_converged(format!("{}: {error}", path.display()), "");
    let single = |list: &[[f64; 3]]| list.iter().map(|v| v.map(|c| c as f32)).collect::<Vec<[f32; 3]>>();
    let positions = single(&mesh.vertices);
    let normals = single(&vertex_normals(mesh, NormalWeighting::Angle).map_err(|e| failed(&e))?);
    let bones: Vec<BoneMark> = fit
        .skeleton
        .rest_segments()
        .iter()
        .zip(&fit.certainty)
        .map(|((head, tail), &sure)| {
            let color = std::array::from_fn(|k| UNSURE[k] + sure as f32 * (SURE[k] - UNSURE[k]));
            BoneMark { head: head.to_array(), tail: tail.to_array(), color }
        })
        .collect();
    let view = View { yaw: View::default().yaw + (fit.front[0] as f32).atan2(fit.front[2] as f32), ..View::default() };
    let bounds = Bounds::of(&positions).unwrap_or(Bounds { min: glam::Vec3::ZERO, max: glam::Vec3::ONE });
    let shown =
        MeshView { positions: &positions, normals: &normals, triangles: &mesh.triangles, ..MeshView::default() };
    let scene = Scene { mesh: shown, bones: &bones, ground: Ground::under(&bounds), ..Scene::default() };
    let drawn = draw_scene(&scene, &camera_of(&positions, &view), view.size);
    let (picture, by) = drawn.map_err(|e: RenderError| failed(&e))?;
    overwrite.write(path, &armature_render::encode_png(&picture).map_err(|e| failed(&e))?)?;
    Ok(by)
}
