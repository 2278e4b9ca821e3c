//! From cut cells to pixels.

use armature_render::Picture;
use tiny_skia::{FillRule, LineCap, LineJoin, Path, PathBuilder, Pixmap, PixmapMut, Stroke, Transform};

use super::colors::color;
use super::cut::CutCell;
use super::field::field;
use super::frame::Frame;
use super::legend::{INK, draw_axes, draw_color_bar, draw_title};
use super::{Slice, bounds};
use crate::pictures::ink::{mix, paint};

/// Pictures are drawn this much larger and averaged, so that adjacent cells leave no seam between them.
const OVERSAMPLING: u32 = 2;
/// The smallest and largest side of a picture.
const SIDES: std::ops::RangeInclusive<u32> = 200..=4096;
/// The field outside the volume is mixed with this much of the paper's colour.
const FAINT: f64 = 0.45;
const PAPER: [u8; 3] = [0xff, 0xff, 0xff];
/// Below this mean size of the cut cells, in pixels of the finished picture, their edges fade, or nothing else would be
/// visible.
const FINE: f64 = 7.0;

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SliceError {
    /// Nothing to fit the picture to.
    #[error("there are no vertices to show")]
    Empty,
    /// The number of winding numbers does not match the cells.
    #[error("there are {numbers} winding numbers for {cells} cells")]
    WindingLength {
        /// Winding numbers given.
        numbers: usize,
        /// Cells there are.
        cells: usize,
    },
    /// The picture is too small to read or too large to draw.
    #[error("a picture of {width} × {height} pixels cannot be drawn; give sides of 200 to 4096")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The plane's position or a vertex is not finite or out of bounds.
    #[error("the slice's position or a vertex is not a usable number")]
    NotFinite,
}

pub(super) fn draw(
    slice: &Slice,
    cells: &[CutCell],
    lines: &[[[f64; 2]; 2]],
    size: [u32; 2],
) -> Result<Picture, SliceError> {
    let [width, height] = size;
    if !size.iter().all(|side| SIDES.contains(side)) {
        return Err(SliceError::Size { width, height });
    }
    let (low, high) = bounds(slice).ok_or(SliceError::Empty)?;
    let corners = [low, high].map(|p| slice.plane.flatten(p));
    let [low, high] =
        [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| [0, 1].map(|k| pick(corners[0][k], corners[1][k])));
    let large = size.map(|side| side * OVERSAMPLING);
    let frame = Frame::fit(large, low, high);
    if !slice.plane.position.is_finite() || !frame.scale.is_finite() || !frame.centre.iter().all(|c| c.is_finite()) {
        return Err(SliceError::NotFinite);
    }
    let mut pixmap = Pixmap::new(large[0], large[1]).ok_or(SliceError::Size { width, height })?;
    pixmap.fill(tiny_skia::Color::WHITE);
    let mut drawing = pixmap.as_mut();
    fill_cells(&mut drawing, &frame, cells);
    let around = fill_field(&mut drawing, &frame, slice);
    stroke_cells(&mut drawing, &frame, cells);
    stroke_lines(&mut drawing, &frame, lines);
    let shown = cells.iter().map(|c| c.winding).chain(around).filter(|w| w.is_finite());
    let (least, most) = shown.fold((0.0_f64, 1.0_f64), |(l, m), w| (l.min(w), m.max(w)));
    draw_axes(&mut drawing, &frame, slice.plane);
    draw_title(&mut drawing, &frame, slice.title, slice.plane);
    draw_color_bar(&mut drawing, &frame, least, most);
    Ok(average(&pixmap, size))
}

fn outline(frame: &Frame, corners: &[[f64; 2]]) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (k, &corner) in corners.iter().enumerate() {
        let [x, y] = frame.place(corner);
        if k == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.close();
    path.finish()
}

/// Each cell in its colour, without antialiasing its border: neighbours share it to the pixel.
fn fill_cells(drawing: &mut PixmapMut, frame: &Frame, cells: &[CutCell]) {
    for cell in cells {
        if let Some(path) = outline(frame, &cell.corners) {
            let mut fill = paint(color(cell.winding), 255);
            fill.anti_alias = false;
            drawing.fill_path(&path, &fill, FillRule::EvenOdd, Transform::identity(), None);
        }
    }
}

/// Thin edges of the cut cells.
fn stroke_cells(drawing: &mut PixmapMut, frame: &Frame, cells: &[CutCell]) {
    let length = |c: &CutCell| {
        let next = c.corners.iter().cycle().skip(1);
        c.corners.iter().zip(next).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).sum::<f64>() / c.corners.len() as f64
    };
    let mean = cells.iter().map(length).sum::<f64>() / cells.len().max(1) as f64;
    let pixels = mean * frame.scale / f64::from(OVERSAMPLING);
    let opacity = 110.0 * (pixels / FINE).clamp(0.1, 1.0);
    let ink = paint(INK, opacity as u8);
    for cell in cells {
        if let Some(path) = outline(frame, &cell.corners) {
            drawing.stroke_path(&path, &ink, &stroke(0.35 * frame.unit), Transform::identity(), None);
        }
    }
}

/// The cut of the surface.
fn stroke_lines(drawing: &mut PixmapMut, frame: &Frame, lines: &[[[f64; 2]; 2]]) {
    let mut path = PathBuilder::new();
    for &[a, b] in lines {
        let ([ax, ay], [bx, by]) = (frame.place(a), frame.place(b));
        path.move_to(ax, ay);
        path.line_to(bx, by);
    }
    if let Some(path) = path.finish() {
        drawing.stroke_path(&path, &paint(INK, 235), &stroke(1.3 * frame.unit), Transform::identity(), None);
    }
}

fn stroke(width: f32) -> Stroke {
    Stroke { width, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() }
}

/// The winding number of the surface, faintly, wherever the plot is still blank; returns the least and the greatest.
/// One number serves all oversampled pixels of a pixel.
fn fill_field(drawing: &mut PixmapMut, frame: &Frame, slice: &Slice) -> [f64; 2] {
    let Some((_, winding)) = slice.surface else { return [0.0; 2] };
    let over = OVERSAMPLING as usize;
    let [left, top, right, bottom] = frame.plot.map(|side| side as usize / over);
    let (across, stride) = (right - left, drawing.width() as usize);
    let pixels = drawing.pixels_mut();
    let is_paper = |column: usize, row: usize, pixels: &[tiny_skia::PremultipliedColorU8]| {
        let pixel = pixels[row * stride + column];
        [pixel.red(), pixel.green(), pixel.blue()] == PAPER
    };
    let oversampled =
        |x: usize, y: usize| (0..over * over).map(move |k| ((left + x) * over + k % over, (top + y) * over + k / over));
    let size = [across, bottom - top];
    let all = || (0..size[1]).flat_map(|y| (0..across).map(move |x| (x, y)));
    let needed: Vec<bool> =
        all().map(|(x, y)| oversampled(x, y).any(|(column, row)| is_paper(column, row, pixels))).collect();
    let place = |x: f64, y: f64| {
        let place = [(x + left as f64) * over as f64, (y + top as f64) * over as f64];
        slice.plane.unflatten(frame.point(place))
    };
    let values = field(winding, size, &needed, place);
    let mut range = [0.0_f64; 2];
    for ((x, y), value) in all().zip(values) {
        range = [range[0].min(value.into()), range[1].max(value.into())];
        let [r, g, b] = mix(color(f64::from(value)), PAPER, FAINT);
        for (column, row) in oversampled(x, y) {
            if is_paper(column, row, pixels)
                && let Some(faint) = tiny_skia::PremultipliedColorU8::from_rgba(r, g, b, 255)
            {
                pixels[row * stride + column] = faint;
            }
        }
    }
    range
}

/// The finished picture: every pixel is the mean of its oversampled ones.
fn average(pixmap: &Pixmap, size: [u32; 2]) -> Picture {
    let over = OVERSAMPLING as usize;
    let (width, stride) = (size[0] as usize, pixmap.width() as usize);
    let pixels = pixmap.pixels();
    let mean = |index: usize, pick: fn(&tiny_skia::PremultipliedColorU8) -> u8| {
        let (column, row) = (index % width * over, index / width * over);
        let of = (0..over * over).map(|k| u32::from(pick(&pixels[(row + k / over) * stride + column + k % over])));
        (of.sum::<u32>() / (OVERSAMPLING * OVERSAMPLING)) as u8
    };
    let rgba = (0..width * size[1] as usize)
        .flat_map(|i| [mean(i, |p| p.red()), mean(i, |p| p.green()), mean(i, |p| p.blue()), 255])
        .collect();
    Picture { width: size[0], height: size[1], rgba }
}
