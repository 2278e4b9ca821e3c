//! Pictures of functions on a mesh: in colours with lines of equal value, or in colours given for each vertex; with their
//! extrema as dots.

use std::path::Path;
use std::sync::Arc;

use armature_geometry::surface::{NormalWeighting, vertex_normals};
use armature_geometry::{MeshError, TriangleMesh};
use armature_render::{Map, Material, MeshView, Picture, RenderError, linear_from_srgb};
use tiny_skia::{FillRule, PathBuilder, Pixmap, PixmapMut, PremultipliedColorU8, Rect, Transform};

use super::ink::{mix, paint};
use super::scene::{DrawnBy, View, camera_of, draw_mesh};
use super::text::{Hold, draw_text};
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::terminal::counted;

/// A function to show.
#[derive(Clone, Copy, Debug)]
pub struct FunctionPicture<'a> {
    /// The surface; vertices in no triangle do not matter.
    pub mesh: &'a TriangleMesh,
    /// The function.
    pub shown: Shown<'a>,
    /// Written above the scale.
    pub title: &'a str,
    /// Colours and what they stand for.
    pub legend: &'a [([u8; 3], String)],
    /// Extrema to mark.
    pub extrema: &'a [Dot],
}

/// What is shown of a function.
#[derive(Clone, Copy, Debug)]
pub enum Shown<'a> {
    /// One value for each vertex, in the colours of a scale.
    Values {
        /// The values.
        values: &'a [f64],
        /// The values at the ends of the scale.
        range: [f64; 2],
    },
    /// A colour for each vertex, sRGB 0 to 1.
    Colors(&'a [[f32; 3]]),
}

/// An extremum: a dot in the picture, also where something is in front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dot {
    /// Mesh unit.
    pub place: [f64; 3],
    /// Blue for a minimum, red for a maximum.
    pub is_minimum: bool,
}

/// The colours of dots.
const MINIMUM: [u8; 3] = [0x2b, 0x6c, 0xff];
const MAXIMUM: [u8; 3] = [0xff, 0x20, 0x30];

/// A value, as a fraction of the range, and its colour, sRGB: clay where a handle moves nothing, then warmer and darker.
const STOPS: [(f64, [u8; 3]); 6] = [
    (0.0, [0xc9, 0xc4, 0xbd]),
    (0.02, [0xe4, 0xdc, 0xb4]),
    (0.25, [0xf3, 0xc7, 0x5f]),
    (0.5, [0xee, 0x8a, 0x3a]),
    (0.75, [0xc9, 0x3a, 0x36]),
    (1.0, [0x76, 0x0f, 0x3c]),
];
/// Lines of equal value are this far apart ...
const LINE_EVERY: f64 = 0.1;
/// ... and are this wide, as fractions of the range.
const LINE_WIDTH: f64 = 0.009;
const LINE: [u8; 3] = [0x2a, 0x1c, 0x1c];
/// A mesh this flat relative to its height is shown from the front.
const FLAT: f64 = 0.01;
/// Texels along the scale.
const TEXELS: u32 = 2048;
const WORDS: [u8; 3] = [0xe9, 0xec, 0xf0];
/// No more names than this fit beside a picture.
const MOST_NAMES: usize = 40;

/// Draws functions on their meshes, from left to right in rows of this many, and writes a PNG.
pub fn write_function_pictures(
    overwrite: Overwrite,
    path: &Path,
    pictures: &[FunctionPicture],
    per_row: usize,
) -> Result<DrawnBy, Failure> {
    let failed = |e: RenderError| Failure::not_converged(format!("{}: {e}", path.display()), "");
    let mut drawn = Vec::with_capacity(pictures.len());
    let mut drawn_by = None;
    for picture in pictures {
        let (made, by) = draw_function(picture, size_of_each(per_row), path)?;
        drawn.push(made);
        drawn_by = Some(by);
    }
    let nothing = || Failure::input(format!("{}: there is nothing to draw", path.display()), "");
    let whole = in_rows(&drawn, per_row).ok_or_else(nothing)?;
    overwrite.write(path, &armature_render::encode_png(&whole).map_err(failed)?)?;
    drawn_by.ok_or_else(nothing)
}

/// Pixels across and down of each of this many pictures in a row.
fn size_of_each(per_row: usize) -> [u32; 2] {
    match per_row {
        0 | 1 => View::default().size,
        2 => [800, 800],
        _ => [480, 480],
    }
}

/// Pictures of one size in full rows.
fn in_rows(pictures: &[Picture], per_row: usize) -> Option<Picture> {
    let rows: Vec<Picture> = pictures.chunks(per_row.max(1)).map(beside).collect::<Option<_>>()?;
    let width = rows.first()?.width;
    let height = rows.iter().map(|row| row.height).sum();
    Some(Picture { width, height, rgba: rows.into_iter().flat_map(|row| row.rgba).collect() })
}

/// Pictures of one height, from left to right.
fn beside(pictures: &[Picture]) -> Option<Picture> {
    let height = pictures.first()?.height;
    let row = |y: u32| {
        pictures.iter().flat_map(move |picture| {
            let bytes = 4 * picture.width as usize;
            picture.rgba[y as usize * bytes..(y as usize + 1) * bytes].iter().copied()
        })
    };
    let rgba = (0..height).flat_map(row).collect();
    Some(Picture { width: pictures.iter().map(|picture| picture.width).sum(), height, rgba })
}

fn draw_function(picture: &FunctionPicture, size: [u32; 2], path: &Path) -> Result<(Picture, DrawnBy), Failure> {
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
    let from = View { size, ..looked_at(picture.mesh) };
    let (mut drawn, by) = match picture.shown {
        Shown::Values { values, range: [low, high] } => {
            let last = f64::from(TEXELS);
            // From the middle of the first texel to the middle of the last, since textures repeat.
            let share = |value: f64| if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
            let along = |value: &f64| ((0.5 + share(*value) * (last - 1.0)) / last) as f32;
            let uv: Vec<[f32; 2]> = values.iter().map(|value| [along(value), 0.5]).collect();
            let scale = Arc::new(Picture { width: TEXELS, height: 1, rgba: scale() });
            let materials = [Material { base_color_map: Some(Map::repeating(scale)), ..Material::default() }];
            draw_mesh(&MeshView { uv: Some(&uv), materials: &materials, ..view }, &from)
        }
        Shown::Colors(colors) => {
            let linear = |color: &[f32; 3]| color.map(linear_from_srgb);
            let colors: Vec<[f32; 4]> = colors.iter().map(linear).map(|[r, g, b]| [r, g, b, 1.0]).collect();
            draw_mesh(&MeshView { colors: Some(&colors), materials: &[Material::of_color([1.0; 3])], ..view }, &from)
        }
    }
    .map_err(failed)?;
    label(&mut drawn, picture, &from);
    Ok((drawn, by))
}

/// Slightly from the side; a flat mesh from the front.
fn looked_at(mesh: &TriangleMesh) -> View {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
    let view = View::default();
    if size[2] > FLAT * size[0].max(size[1]) { view } else { View { yaw: 0.0, pitch: 0.0, closer: 1.0, ..view } }
}

fn color(value: f64) -> [u8; 3] {
    let value = value.clamp(0.0, 1.0);
    let interval = STOPS.windows(2).find(|pair| value <= pair[1].0);
    interval.map_or(STOPS[0].1, |pair| {
        let ((from, a), (to, b)) = (pair[0], pair[1]);
        mix(a, b, (value - from) / (to - from))
    })
}

/// The colours of the range with lines of equal value, as a texture.
fn scale() -> Vec<u8> {
    let texel = |k: u32| {
        let value = f64::from(k) / f64::from(TEXELS - 1);
        let off_line = (value / LINE_EVERY - (value / LINE_EVERY).round()).abs() * LINE_EVERY;
        // No line at the ends of the range.
        let is_inner = value > 0.5 * LINE_EVERY && value < 1.0 - 0.5 * LINE_EVERY;
        // Its edges are softened over a third of its width.
        let share = ((0.5 * LINE_WIDTH - off_line) / (LINE_WIDTH / 3.0) + 0.5).clamp(0.0, 1.0);
        let [r, g, b] = mix(color(value), LINE, if is_inner { 0.85 * share } else { 0.0 });
        [r, g, b, 255]
    };
    (0..TEXELS).flat_map(texel).collect()
}

/// Writes the caption beside the picture.
fn label(picture: &mut Picture, shown: &FunctionPicture, from: &View) {
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
    if !shown.title.is_empty() {
        draw_text(&mut drawing, shown.title, [left, 48.0 * unit], 26.0 * unit, Hold::Left, &words);
    }
    if let Shown::Values { range: [low, high], .. } = shown.shown {
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
        // As many decimals as distinguish the tenths of the range.
        let decimals = (1.0 - (high - low).abs().max(f64::MIN_POSITIVE).log10().floor()).clamp(0.0, 9.0) as usize;
        for tenth in 0_u8..=10 {
            let share = f64::from(tenth) / 10.0;
            let y = top + height * (1.0 - share as f32) + 5.0 * unit;
            let text = format!("{:.*}", decimals, low + share * (high - low));
            draw_text(&mut drawing, &text, [left + 32.0 * unit, y], 16.0 * unit, Hold::Left, &words);
        }
    }
    legend(&mut drawing, shown.legend, left, unit);
    dots(&mut drawing, shown, from, unit);
    picture.rgba = pixmap.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue(), 255]).collect();
}

/// Colours and what they stand for.
fn legend(drawing: &mut PixmapMut, entries: &[([u8; 3], String)], left: f32, unit: f32) {
    let words = paint(WORDS, 255);
    let mut y = 40.0 * unit;
    for (color, name) in entries.iter().take(MOST_NAMES) {
        if let Some(square) = Rect::from_xywh(left, y - 12.0 * unit, 14.0 * unit, 14.0 * unit) {
            drawing.fill_rect(square, &paint(*color, 255), Transform::identity(), None);
        }
        draw_text(drawing, name, [left + 22.0 * unit, y], 16.0 * unit, Hold::Left, &words);
        y += 22.0 * unit;
    }
    if entries.len() > MOST_NAMES {
        let text = format!("and {} more", entries.len() - MOST_NAMES);
        draw_text(drawing, &text, [left, y], 16.0 * unit, Hold::Left, &words);
    }
}

/// A dot with a white rim.
fn disc(drawing: &mut PixmapMut, [x, y]: [f32; 2], unit: f32, color: [u8; 3]) {
    for (radius, ink) in [(7.0 * unit, [0xff; 3]), (5.5 * unit, color)] {
        if let Some(path) = PathBuilder::from_circle(x, y, radius) {
            drawing.fill_path(&path, &paint(ink, 255), FillRule::Winding, Transform::identity(), None);
        }
    }
}

/// The extrema, and how many there are.
fn dots(drawing: &mut PixmapMut, shown: &FunctionPicture, from: &View, unit: f32) {
    if shown.extrema.is_empty() {
        return;
    }
    let positions: Vec<[f32; 3]> = shown.mesh.vertices.iter().map(|p| p.map(|c| c as f32)).collect();
    let camera = camera_of(&positions, from);
    let size = from.size.map(|pixels| pixels as f32);
    let clip_from_world = camera.clip_from_world(size[0] / size[1]);
    for dot in shown.extrema {
        let place = clip_from_world.project_point3(glam::DVec3::from(dot.place).as_vec3());
        if place.is_finite() {
            let at = [0.5 * (1.0 + place.x) * size[0], 0.5 * (1.0 - place.y) * size[1]];
            disc(drawing, at, unit, if dot.is_minimum { MINIMUM } else { MAXIMUM });
        }
    }
    let minima = shown.extrema.iter().filter(|dot| dot.is_minimum).count();
    let counts = [(minima, "minimum", "minima", MINIMUM), (shown.extrema.len() - minima, "maximum", "maxima", MAXIMUM)];
    let mut y = size[1] - 26.0 * unit;
    for (count, one, more, color) in counts.into_iter().filter(|(count, ..)| *count > 0) {
        disc(drawing, [size[0] - 36.0 * unit, y - 6.0 * unit], unit, color);
        let text = counted(count, one, more);
        draw_text(drawing, &text, [size[0] - 52.0 * unit, y], 18.0 * unit, Hold::Right, &paint(WORDS, 255));
        y -= 30.0 * unit;
    }
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
    fn pictures_stand_beside_each_other() {
        let of = |byte: u8, width: u32| Picture { width, height: 2, rgba: vec![byte; 8 * width as usize] };
        let both = beside(&[of(1, 1), of(2, 2)]).unwrap();
        assert_eq!((both.width, both.height), (3, 2));
        assert_eq!(both.rgba[..12], [1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2]);
        assert_eq!(both.rgba[12..], both.rgba[..12]);
        assert!(beside(&[]).is_none());
        let four = in_rows(&[of(1, 1), of(2, 1), of(3, 1), of(4, 1)], 2).unwrap();
        assert_eq!((four.width, four.height, four.rgba[0], four.rgba[4], four.rgba[16]), (2, 4, 1, 2, 3));
    }
}
