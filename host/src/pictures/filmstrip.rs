//! Moments of a motion side by side on one floor.

use std::f32::consts::FRAC_PI_2;
use std::path::Path;

use armature_render::{MeshPart, MeshView, RenderError};
use glam::Vec3;

use super::character::Skinned;
use super::scene::{DrawnBy, View, draw_mesh};
use crate::characters::LoadedCharacter;
use crate::failure::Failure;
use crate::files::Overwrite;

/// Pixels of one moment, and the widest strip.
const MOMENT: [u32; 2] = [230, 460];
const WIDEST: u32 = 4096;
/// From its right side, so that it walks to the right, and a little from above and the front.
const YAW: f32 = -FRAC_PI_2 + 0.25;
const PITCH: f32 = 0.1;
/// Between the widest of two moments, as a share of its width.
const GAP: f32 = 0.06;

/// Draws a character at these moments, the first on the left, and writes a PNG. Each is where it is in the motion, moved to
/// the right by what keeps it clear of the one before. `floor`: where the floor is, if not under the lowest.
pub fn write_filmstrip(
    overwrite: Overwrite,
    path: &Path,
    character: &LoadedCharacter,
    moments: &[Skinned],
    floor: Option<f32>,
) -> Result<DrawnBy, Failure> {
    let Some(shape) = &character.shape else {
        let what = format!("{} has no mesh, so there is nothing to draw", character.name);
        return Err(Failure::usage(what, "choose a character with a mesh, such as human"));
    };
    let failed = |error: RenderError| Failure::not_converged(format!("{}: {error}", path.display()), "");
    let right = Vec3::new(YAW.cos(), 0.0, -YAW.sin());
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let mut normals: Vec<[f32; 3]> = Vec::new();
    let (mut triangles, mut parts): (Vec<[u32; 3]>, Vec<MeshPart>) = Default::default();
    for ((moment, facing), shift) in moments.iter().zip(shifts(moments, right)) {
        let (vertices, faces) = (positions.len() as u32, triangles.len() as u32);
        positions.extend(moment.iter().map(|&place| (Vec3::from(place) + right * shift).to_array()));
        normals.extend_from_slice(facing);
        triangles.extend(shape.triangles().iter().map(|triangle| triangle.map(|vertex| vertices + vertex)));
        parts.extend(shape.parts.iter().map(|part| MeshPart {
            triangles: faces + part.triangles.start..faces + part.triangles.end,
            material: part.material,
        }));
    }
    let uv = shape.texture_coordinates().map(|uv| uv.repeat(moments.len()));
    let colors = shape.vertex_colors().map(|colors| colors.repeat(moments.len()));
    let mesh = MeshView {
        positions: &positions,
        normals: &normals,
        triangles: &triangles,
        uv: uv.as_deref(),
        parts: &parts,
        materials: &shape.materials,
        colors: colors.as_deref(),
        ..MeshView::default()
    };
    let width = (MOMENT[0] * moments.len().max(1) as u32).min(WIDEST);
    let view = View { size: [width, MOMENT[1]], yaw: YAW, pitch: PITCH, closer: 0.0, floor };
    let (picture, by) = draw_mesh(&mesh, &view).map_err(failed)?;
    overwrite.write(path, &armature_render::encode_png(&picture).map_err(failed)?)?;
    Ok(by)
}

/// How far each moment is moved to the right, mesh units: evenly, and as little as keeps all clear of their neighbours.
fn shifts(moments: &[Skinned], right: Vec3) -> Vec<f32> {
    let spans: Vec<(f32, f32)> = moments
        .iter()
        .map(|(positions, _)| {
            let along = positions.iter().map(|&place| Vec3::from(place).dot(right)).filter(|along| along.is_finite());
            along.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), along| (low.min(along), high.max(along)))
        })
        .collect();
    let widest = spans.iter().fold(0.0_f32, |widest, (low, high)| widest.max(high - low));
    let overlap = |pair: &[(f32, f32)]| pair[0].1 - pair[1].0 + GAP * widest;
    let step = spans.windows(2).map(overlap).fold(0.0_f32, f32::max);
    let step = if step.is_finite() { step } else { 0.0 };
    (0..moments.len()).map(|moment| moment as f32 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_that_walk_away_are_moved_less() {
        let at = |x: f32| -> Skinned { (vec![[x, 0.0, 0.0], [x + 1.0, 1.0, 0.0]], Vec::new()) };
        let still = shifts(&[at(0.0), at(0.0), at(0.0)], Vec3::X);
        assert!(still[0].abs() < 1e-9 && (still[1] - 1.06).abs() < 1e-6 && (still[2] - 2.12).abs() < 1e-6, "{still:?}");
        let away = shifts(&[at(0.0), at(0.5), at(1.0)], Vec3::X);
        assert!((away[1] - 0.56).abs() < 1e-6, "{away:?}");
        assert!(shifts(&[at(0.0), at(3.0)], Vec3::X)[1].abs() < 1e-9);
        assert!(shifts(&[at(f32::NAN), at(3.0)], Vec3::X)[1].abs() < 1e-9);
    }
}
