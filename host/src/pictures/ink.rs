//! Colours to draw with.

use tiny_skia::Paint;

/// A colour between two.
pub(super) fn mix(a: [u8; 3], b: [u8; 3], share_of_b: f64) -> [u8; 3] {
    std::array::from_fn(|k| (f64::from(a[k]) + share_of_b * (f64::from(b[k]) - f64::from(a[k]))).round() as u8)
}

/// A colour to draw with.
pub(super) fn paint(rgb: [u8; 3], opacity: u8) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(rgb[0], rgb[1], rgb[2], opacity);
    paint
}
