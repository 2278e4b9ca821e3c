//! The text and numbers of a slice: title, axes, colour bar.

use tiny_skia::{PathBuilder, PixmapMut, Rect, Stroke, Transform};

use super::colors::{HIGHEST, LOWEST, color};
use super::cut::SlicePlane;
use super::frame::Frame;
use crate::pictures::ink::paint;
use crate::pictures::text::{Hold, draw_text};

pub(super) const INK: [u8; 3] = [0x22, 0x26, 0x2b];
const QUIET: [u8; 3] = [0x5c, 0x63, 0x6b];
/// Approximate number of labels along an axis.
const TICKS: f64 = 7.0;

/// Winding numbers that differ by less than this are the same.
const ROUNDING: f64 = 0.02;

fn line(drawing: &mut PixmapMut, from: [f32; 2], to: [f32; 2], width: f32, ink: [u8; 3]) {
    let mut path = PathBuilder::new();
    path.move_to(from[0], from[1]);
    path.line_to(to[0], to[1]);
    if let Some(path) = path.finish() {
        let stroke = Stroke { width, ..Stroke::default() };
        drawing.stroke_path(&path, &paint(ink, 255), &stroke, Transform::identity(), None);
    }
}

fn frame_around(drawing: &mut PixmapMut, [left, top, right, bottom]: [f32; 4], width: f32, ink: [u8; 3]) {
    for (from, to) in [
        ([left, top], [right, top]),
        ([right, top], [right, bottom]),
        ([right, bottom], [left, bottom]),
        ([left, bottom], [left, top]),
    ] {
        line(drawing, from, to, width, ink);
    }
}

/// The title, and below it the slice's position.
pub(super) fn draw_title(drawing: &mut PixmapMut, frame: &Frame, title: &str, plane: SlicePlane) {
    let unit = frame.unit;
    let where_cut = format!("slice at {} = {}", plane.axis.name(), short(plane.position));
    draw_text(drawing, title, [frame.plot[0], 32.0 * unit], 21.0 * unit, Hold::Left, &paint(INK, 255));
    draw_text(drawing, &where_cut, [frame.plot[0], 58.0 * unit], 17.0 * unit, Hold::Left, &paint(QUIET, 255));
}

/// A frame around the plot with numbers and the axes' names.
pub(super) fn draw_axes(drawing: &mut PixmapMut, frame: &Frame, plane: SlicePlane) {
    let ([left, top, right, bottom], unit) = (frame.plot, frame.unit);
    frame_around(drawing, frame.plot, 1.2 * unit, QUIET);
    let low = frame.point([left.into(), bottom.into()]);
    let high = frame.point([right.into(), top.into()]);
    let step = nice_step((high[0] - low[0]).min(high[1] - low[1]) / TICKS);
    let [across, up] = plane.axis.directions();
    let (numbers, name) = (paint(QUIET, 255), paint(INK, 255));
    for value in ticks(low[0], high[0], step) {
        let [x, _] = frame.place([value, 0.0]);
        line(drawing, [x, bottom], [x, bottom + 6.0 * unit], 1.2 * unit, QUIET);
        let text = short(across.sign * value);
        draw_text(drawing, &text, [x, bottom + 24.0 * unit], 15.0 * unit, Hold::Middle, &numbers);
    }
    for value in ticks(low[1], high[1], step) {
        let [_, y] = frame.place([0.0, value]);
        line(drawing, [left - 6.0 * unit, y], [left, y], 1.2 * unit, QUIET);
        let text = short(up.sign * value);
        draw_text(drawing, &text, [left - 10.0 * unit, y + 5.0 * unit], 15.0 * unit, Hold::Right, &numbers);
    }
    let names = ["x", "y", "z"];
    let below = [f32::midpoint(left, right), bottom + 54.0 * unit];
    draw_text(drawing, names[across.axis], below, 19.0 * unit, Hold::Middle, &name);
    let beside = [left - 64.0 * unit, f32::midpoint(top, bottom) + 6.0 * unit];
    draw_text(drawing, names[up.axis], beside, 19.0 * unit, Hold::Middle, &name);
}

/// The colours of winding numbers from `least` to `most`, with numbers.
pub(super) fn draw_color_bar(drawing: &mut PixmapMut, frame: &Frame, least: f64, most: f64) {
    let ([_, top, right, bottom], unit) = (frame.plot, frame.unit);
    // To the next half, ignoring anything above due to rounding alone.
    let low = (least.clamp(LOWEST, 0.0) * 2.0 + ROUNDING).floor() / 2.0;
    let high = (most.clamp(1.0, HIGHEST) * 2.0 - ROUNDING).ceil() / 2.0;
    let bar = [right + 40.0 * unit, top + 44.0 * unit, right + 66.0 * unit, bottom];
    let rows = (bar[3] - bar[1]) as usize;
    for row in 0..rows {
        let winding = high - (row as f64 + 0.5) / rows as f64 * (high - low);
        if let Some(strip) = Rect::from_xywh(bar[0], bar[1] + row as f32, bar[2] - bar[0], 1.0) {
            drawing.fill_rect(strip, &paint(color(winding), 255), Transform::identity(), None);
        }
    }
    frame_around(drawing, bar, 1.2 * unit, QUIET);
    let (numbers, name) = (paint(QUIET, 255), paint(INK, 255));
    for value in ticks(low, high, 0.5) {
        let y = bar[3] - ((value - low) / (high - low)) as f32 * (bar[3] - bar[1]);
        line(drawing, [bar[2], y], [bar[2] + 6.0 * unit, y], 1.2 * unit, QUIET);
        // The ends of the scale stand for everything beyond them.
        let sign = if value >= HIGHEST && most > HIGHEST {
            "≥ "
        } else if value <= LOWEST && least < LOWEST {
            "≤ "
        } else {
            ""
        };
        let text = format!("{sign}{value:.1}");
        draw_text(drawing, &text, [bar[2] + 11.0 * unit, y + 5.0 * unit], 15.0 * unit, Hold::Left, &numbers);
    }
    draw_text(drawing, "winding", [bar[0], top + 8.0 * unit], 17.0 * unit, Hold::Left, &name);
    draw_text(drawing, "number", [bar[0], top + 28.0 * unit], 17.0 * unit, Hold::Left, &name);
}

/// The next of 1, 2, 5, 10, 20, … times a power of ten.
fn nice_step(at_least: f64) -> f64 {
    if !(at_least > 0.0 && at_least.is_finite()) {
        return 1.0;
    }
    let power = 10.0_f64.powf(at_least.log10().floor());
    [1.0, 2.0, 5.0].map(|m| m * power).into_iter().find(|&s| s >= at_least).unwrap_or(10.0 * power)
}

/// Multiples of `step` from `low` to `high`.
fn ticks(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    // Far from zero, steps drown in rounding; never more labels than fit.
    let count = (last - first).clamp(-1.0, 1000.0) as i64;
    (0..=count).map(move |k| (first + k as f64) * step)
}

/// Four significant digits without trailing zeros.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || magnitude < 1e-300 {
        "0".to_owned()
    } else if (1e-4..1e6).contains(&magnitude) {
        let digits = (3 - magnitude.log10().floor() as i32).clamp(0, 9) as usize;
        let text = format!("{value:.digits$}");
        if digits == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "numbers that are exact or copied")]
mod tests {
    use super::*;

    #[test]
    fn numbers_along_an_axis_are_round() {
        assert_eq!([0.7, 1.0, 1.1, 3.0, 7.0].map(nice_step), [1.0, 1.0, 2.0, 5.0, 10.0]);
        assert!((nice_step(0.013) - 0.02).abs() < 1e-15);
        assert_eq!(nice_step(f64::NAN), 1.0);
        assert_eq!(ticks(-1.0, 1.0, 0.5).collect::<Vec<_>>(), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(ticks(0.1, 0.2, 5.0).count(), 0);
        assert!(ticks(1e30, 1e30 + 1.0, 1e-3).count() <= 1001);
        let words = [0.0, -0.5, 0.123_456, 12.0, 1234.5, 1e9, -2e-7].map(short);
        assert_eq!(words, ["0", "-0.5", "0.1235", "12", "1234", "1.00e9", "-2.00e-7"]);
    }
}
