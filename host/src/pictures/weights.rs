//! Pictures of weights on a mesh: of one handle with lines of equal weight, or of all handles in colours.

use std::path::Path;
use std::sync::Arc;

use armature_geometry::surface::{NormalWeighting, vertex_normals};
use armature_geometry::{MeshError, TriangleMesh};
use armature_render::{Material, MeshView, Picture, RenderError};
use armature_weights::WeightMatrix;
use tiny_skia::{Pixmap, PremultipliedColorU8, Rect, Transform};

use super::ink::{mix, paint};
use super::scene::{DrawnBy, View, draw_mesh};
use super::text::{Hold, draw_text};
use crate::failure::Failure;
use crate::files::Overwrite;

/// Weights to show.
#[derive(Clone, Copy, Debug)]
pub struct WeightPicture<'a> {
    /// The surface; vertices in no triangle do not matter.
    pub mesh: &'a TriangleMesh,
    /// Vertices × handles.
    pub weights: &'a WeightMatrix,
    /// The handles' names.
    pub names: &'a [String],
    /// The handle to show; `None` for all.
    pub of: Option<usize>,
}

/// A weight and its colour, sRGB: clay where a handle moves nothing, then warmer and darker.
const STOPS: [(f64, [u8; 3]); 6] = [
    (0.0, [0xc9, 0xc4, 0xbd]),
    (0.02, [0xe4, 0xdc, 0xb4]),
    (0.25, [0xf3, 0xc7, 0x5f]),
    (0.5, [0xee, 0x8a, 0x3a]),
    (0.75, [0xc9, 0x3a, 0x36]),
    (1.0, [0x76, 0x0f, 0x3c]),
];
/// Lines of equal weight are this far apart ...
const LINE_EVERY: f64 = 0.1;
/// ... and are this wide, in weight.
const LINE_WIDTH: f64 = 0.009;
const LINE: [u8; 3] = [0x2a, 0x1c, 0x1c];
/// A mesh this flat relative to its height is shown from the front.
const FLAT: f64 = 0.01;
/// Texels along the scale.
const TEXELS: u32 = 2048;
const WORDS: [u8; 3] = [0xe9, 0xec, 0xf0];
/// No more names than this fit beside a picture.
const MOST_NAMES: usize = 40;

/// Draws weights on their mesh and writes a PNG.
pub fn write_weight_picture(overwrite: Overwrite, path: &Path, picture: &WeightPicture) -> Result<DrawnBy, Failure> {
    let unusable = |e: MeshError| Failure::input(format!("{}: there is nothing to draw: {e}", path.display()), "");
    let failed = |e: RenderError| Failure::not_converged(format!("{}: {e}", path.display()), "");
    let positions: Vec<[f32; 3]> = picture.mesh.vertices.iter().map(|p| p.map(|c| c as f32)).collect();
    let normals = vertex_normals(picture.mesh, NormalWeighting::Angle).map_err(unusable)?;
    let normals: Vec<[f32; 3]> = normals.iter().map(|n| n.map(|c| c as f32)).collect();
    let view = MeshView {
        positions: &positions,
        normals: &normals,
        triangles: &picture.mesh.triangles,
        ..MeshView::default()
    };
    let from = looked_at(picture.mesh);
    let (mut drawn, by) = if let Some(handle) = picture.of {
        let last = f64::from(TEXELS);
        // From the middle of the first texel to the middle of the last, since textures repeat.
        let along = |weight: &f64| ((0.5 + weight.clamp(0.0, 1.0) * (last - 1.0)) / last) as f32;
        let uv: Vec<[f32; 2]> = picture.weights.bone(handle).iter().map(|w| [along(w), 0.5]).collect();
        let texture = Some(Arc::new(Picture { width: TEXELS, height: 1, rgba: scale() }));
        let materials = [Material { texture, ..Material::default() }];
        draw_mesh(&MeshView { uv: Some(&uv), materials: &materials, ..view }, &from)
    } else {
        let colors = blended(picture.weights);
        draw_mesh(&MeshView { colors: Some(&colors), materials: &[Material::of_color([1.0; 3])], ..view }, &from)
    }
    .map_err(failed)?;
    label(&mut drawn, picture);
    overwrite.write(path, &armature_render::encode_png(&drawn).map_err(failed)?)?;
    Ok(by)
}

/// Slightly from the side; a flat mesh from the front.
fn looked_at(mesh: &TriangleMesh) -> View {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
    let view = View::default();
    if size[2] > FLAT * size[0].max(size[1]) { view } else { View { yaw: 0.0, pitch: 0.0, ..view } }
}

fn color(weight: f64) -> [u8; 3] {
    let weight = weight.clamp(0.0, 1.0);
    let interval = STOPS.windows(2).find(|pair| weight <= pair[1].0);
    interval.map_or(STOPS[0].1, |pair| {
        let ((from, a), (to, b)) = (pair[0], pair[1]);
        mix(a, b, (weight - from) / (to - from))
    })
}

/// The colours from weight 0 to 1 with lines of equal weight, as a texture.
fn scale() -> Vec<u8> {
    let texel = |k: u32| {
        let weight = f64::from(k) / f64::from(TEXELS - 1);
        let off_line = (weight / LINE_EVERY - (weight / LINE_EVERY).round()).abs() * LINE_EVERY;
        // No line where there is no weight, or nothing else.
        let is_inner = weight > 0.5 * LINE_EVERY && weight < 1.0 - 0.5 * LINE_EVERY;
        // Its edges are softened over a third of its width.
        let share = ((0.5 * LINE_WIDTH - off_line) / (LINE_WIDTH / 3.0) + 0.5).clamp(0.0, 1.0);
        let [r, g, b] = mix(color(weight), LINE, if is_inner { 0.85 * share } else { 0.0 });
        [r, g, b, 255]
    };
    (0..TEXELS).flat_map(texel).collect()
}

/// The colour of a handle: hues by the golden ratio, so that neighbours differ, in three strengths.
fn handle_color(handle: usize) -> [f64; 3] {
    let hue = (0.04 + 0.618_033_988_749_895 * handle as f64).fract() * 6.0;
    let (strong, light) = [(0.72, 0.95), (0.5, 0.98), (0.85, 0.72)][handle % 3];
    // From hue, saturation and value.
    [5.0, 3.0, 1.0].map(|offset: f64| {
        let place = (offset + hue) % 6.0;
        light * (1.0 - strong * place.min(4.0 - place).clamp(0.0, 1.0))
    })
}

/// Every vertex in its handles' colours, mixed by weight.
fn blended(weights: &WeightMatrix) -> Vec<[f32; 3]> {
    let mut colors = vec![[0.0_f64; 3]; weights.vertices()];
    for handle in 0..weights.bones() {
        let own = handle_color(handle);
        for (vertex, weight) in weights.column(handle) {
            (0..3).for_each(|k| colors[vertex][k] += weight * own[k]);
        }
    }
    colors.iter().map(|color| color.map(|c| c.clamp(0.0, 1.0) as f32)).collect()
}

/// Writes the caption beside the picture.
fn label(picture: &mut Picture, shown: &WeightPicture) {
    let Some(mut pixmap) = Pixmap::new(picture.width, picture.height) else { return };
    for (pixel, rgba) in pixmap.pixels_mut().iter_mut().zip(picture.rgba.chunks_exact(4)) {
        if let Some(opaque) = PremultipliedColorU8::from_rgba(rgba[0], rgba[1], rgba[2], 255) {
            *pixel = opaque;
        }
    }
    let unit = picture.height as f32 / 960.0;
    let words = paint(WORDS, 255);
    let mut drawing = pixmap.as_mut();
    let left = 28.0 * unit;
    match shown.of {
        Some(handle) => {
            draw_text(&mut drawing, &shown.names[handle], [left, 48.0 * unit], 26.0 * unit, Hold::Left, &words);
            let (top, height) = (80.0 * unit, 420.0 * unit);
            let rows = height as usize;
            let scale = scale();
            for row in 0..rows {
                let texel = (1.0 - (row as f64 + 0.5) / rows as f64) * f64::from(TEXELS - 1);
                let at = 4 * texel as usize;
                let ink = paint([scale[at], scale[at + 1], scale[at + 2]], 255);
                if let Some(strip) = Rect::from_xywh(left, top + row as f32, 22.0 * unit, 1.0) {
                    drawing.fill_rect(strip, &ink, Transform::identity(), None);
                }
            }
            for tenth in 0_u8..=10 {
                let y = top + height * (1.0 - f32::from(tenth) / 10.0) + 5.0 * unit;
                let text = format!("{:.1}", f32::from(tenth) / 10.0);
                draw_text(&mut drawing, &text, [left + 32.0 * unit, y], 16.0 * unit, Hold::Left, &words);
            }
        }
        None => names(&mut drawing, shown.names, left, unit),
    }
    picture.rgba = pixmap.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue(), 255]).collect();
}

/// The handles' names in their colours.
fn names(drawing: &mut tiny_skia::PixmapMut, names: &[String], left: f32, unit: f32) {
    let words = paint(WORDS, 255);
    let mut y = 40.0 * unit;
    for (handle, name) in names.iter().take(MOST_NAMES).enumerate() {
        let swatch = handle_color(handle).map(|c| (255.0 * c).round() as u8);
        if let Some(square) = Rect::from_xywh(left, y - 12.0 * unit, 14.0 * unit, 14.0 * unit) {
            drawing.fill_rect(square, &paint(swatch, 255), Transform::identity(), None);
        }
        draw_text(drawing, name, [left + 22.0 * unit, y], 16.0 * unit, Hold::Left, &words);
        y += 22.0 * unit;
    }
    if names.len() > MOST_NAMES {
        let text = format!("and {} more", names.len() - MOST_NAMES);
        draw_text(drawing, &text, [left, y], 16.0 * unit, Hold::Left, &words);
    }
}

/// Finds a handle by name; `None` stands for `all`.
pub fn handle_of(name: &str, names: &[String]) -> Result<Option<usize>, Failure> {
    if let Some(handle) = names.iter().position(|other| other == name) {
        return Ok(Some(handle));
    }
    if name == "all" {
        return Ok(None);
    }
    let some: Vec<&str> = names.iter().take(8).map(String::as_str).collect();
    let dots = if names.len() > some.len() { ", …" } else { "" };
    Err(Failure::usage(format!("there is no {name:?}"), format!("choose all, {}{dots}", some.join(", "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_has_nine_lines_and_begins_as_clay() {
        let texels: Vec<[u8; 4]> = scale().chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect();
        assert_eq!(texels[0][..3], STOPS[0].1);
        assert_eq!(texels[TEXELS as usize - 1][..3], STOPS[5].1);
        let dark = |t: &[u8; 4]| t[0] < 0x50;
        let lines = texels.windows(2).filter(|pair| !dark(&pair[0]) && dark(&pair[1])).count();
        assert_eq!(lines, 9);
    }

    #[test]
    fn handles_have_colours_of_their_own_and_blend_by_weight() {
        for first in 0..24 {
            for second in 0..first {
                let apart =
                    (0..3).map(|k| (handle_color(first)[k] - handle_color(second)[k]).abs()).fold(0.0, f64::max);
                assert!(apart > 0.03, "{first} and {second} look alike");
            }
        }
        let weights = WeightMatrix::from_columns(2, 2, &[1.0, 0.5, 0.0, 0.5]).unwrap();
        let colors = blended(&weights);
        for k in 0..3 {
            assert!((f64::from(colors[0][k]) - handle_color(0)[k]).abs() < 1e-6);
            let mean = f64::midpoint(handle_color(0)[k], handle_color(1)[k]);
            assert!((f64::from(colors[1][k]) - mean).abs() < 1e-6);
        }
    }

    #[test]
    fn a_picture_is_of_one_or_of_all_and_nonsense_is_named() {
        let names = ["head".to_string(), "tail".to_string()];
        assert_eq!(handle_of("tail", &names).unwrap(), Some(1));
        assert_eq!(handle_of("all", &names).unwrap(), None);
        assert!(handle_of("wing", &names).unwrap_err().to_string().contains("choose all, head, tail"));
    }
}
