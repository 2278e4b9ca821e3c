//! Text in a picture, in the window's font.

use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, MetadataProvider};
use tiny_skia::{FillRule, Paint, PathBuilder, PixmapMut, Transform};

/// Where a line of text is anchored.
#[derive(Clone, Copy, Debug)]
pub enum Hold {
    /// At its beginning.
    Left,
    /// At its middle.
    Middle,
    /// At its end.
    Right,
}

/// Collects the outline of glyphs, from font coordinates (up) to pixels (down).
struct Outline {
    path: PathBuilder,
    x: f32,
    y: f32,
}

impl OutlinePen for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(self.x + x, self.y - y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(self.x + x, self.y - y);
    }

    fn quad_to(&mut self, cx: f32, cy: f32, x: f32, y: f32) {
        self.path.quad_to(self.x + cx, self.y - cy, self.x + x, self.y - y);
    }

    fn curve_to(&mut self, ax: f32, ay: f32, bx: f32, by: f32, x: f32, y: f32) {
        self.path.cubic_to(self.x + ax, self.y - ay, self.x + bx, self.y - by, self.x + x, self.y - y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// Draws one line of text; `at` is the baseline, in pixels, at the anchor.
pub fn draw_text(pixmap: &mut PixmapMut, text: &str, at: [f32; 2], height: f32, hold: Hold, paint: &Paint) {
    // The font is part of the program; even if it were damaged, a picture without text would still be a picture.
    let Ok(font) = FontRef::new(epaint_default_fonts::UBUNTU_LIGHT) else { return };
    let (size, location) = (Size::new(height), LocationRef::default());
    let (map, metrics, outlines) = (font.charmap(), font.glyph_metrics(size, location), font.outline_glyphs());
    let glyphs: Vec<_> = text.chars().filter_map(|c| map.map(c).or_else(|| map.map('?'))).collect();
    let advance = |&glyph: &skrifa::GlyphId| metrics.advance_width(glyph).unwrap_or(0.0);
    let width: f32 = glyphs.iter().map(advance).sum();
    let start = at[0]
        - match hold {
            Hold::Left => 0.0,
            Hold::Middle => 0.5 * width,
            Hold::Right => width,
        };
    let mut outline = Outline { path: PathBuilder::new(), x: start, y: at[1] };
    for glyph in &glyphs {
        if let Some(shape) = outlines.get(*glyph) {
            // A glyph that cannot be drawn leaves a gap.
            let _ = shape.draw(DrawSettings::unhinted(size, location), &mut outline);
        }
        outline.x += advance(glyph);
    }
    if let Some(path) = outline.path.finish() {
        pixmap.fill_path(&path, paint, FillRule::Winding, Transform::identity(), None);
    }
}
