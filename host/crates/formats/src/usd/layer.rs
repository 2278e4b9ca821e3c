//! The text of a layer.

use std::fmt::{Display, Write as _};

use glam::DAffine3;

/// A layer while it is written: prims within each other, and their properties.
#[derive(Debug, Default)]
pub(super) struct Layer {
    text: String,
    depth: usize,
}

impl Layer {
    /// A line at the current depth.
    pub(super) fn line(&mut self, line: impl Display) {
        let _ = writeln!(self.text, "{:width$}{line}", "", width = 4 * self.depth);
    }

    /// Begins a prim, such as `def Mesh`, with its name, the schemas applied to it, and the name that people see if it is
    /// another.
    pub(super) fn open(&mut self, kind: &str, name: &str, schemas: &[&str], shown: &str) {
        let shown =
            if shown.is_empty() || shown == name { String::new() } else { format!("displayName = {}", text(shown)) };
        let quoted: Vec<String> = schemas.iter().map(|schema| text(schema)).collect();
        let applied =
            if quoted.is_empty() { String::new() } else { format!("prepend apiSchemas = [{}]", quoted.join(", ")) };
        let said: Vec<String> = [applied, shown].into_iter().filter(|said| !said.is_empty()).collect();
        if said.is_empty() {
            self.line(format_args!("{kind} \"{name}\""));
        } else {
            self.line(format_args!("{kind} \"{name}\" ("));
            said.iter().for_each(|said| self.line(format_args!("    {said}")));
            self.line(")");
        }
        self.line("{");
        self.depth += 1;
    }

    /// Ends the prim that was begun last.
    pub(super) fn close(&mut self) {
        self.depth = self.depth.saturating_sub(1);
        self.line("}");
    }

    /// Begins the values of a property at times.
    pub(super) fn open_samples(&mut self, property: &str) {
        self.line(format_args!("{property}.timeSamples = {{"));
        self.depth += 1;
    }

    /// The whole text.
    pub(super) fn finish(self) -> String {
        self.text
    }
}

/// A text in quotes.
pub(super) fn text(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// `[a, b]`
pub(super) fn list<T: Display>(values: impl IntoIterator<Item = T>) -> String {
    let mut out = String::from("[");
    for (index, value) in values.into_iter().enumerate() {
        let _ = write!(out, "{}{value}", if index > 0 { ", " } else { "" });
    }
    out.push(']');
    out
}

/// `[(x, y), …]`
pub(super) fn tuples<const K: usize>(values: impl IntoIterator<Item = [f32; K]>) -> String {
    list(values.into_iter().map(tuple))
}

/// `(x, y)`, each with the fewest digits that give the same number in single precision.
pub(super) fn tuple<const K: usize>(values: [f32; K]) -> String {
    let mut out = String::from("(");
    for (index, value) in values.into_iter().enumerate() {
        // Adding zero turns -0 into 0.
        let _ = write!(out, "{}{}", if index > 0 { ", " } else { "" }, value + 0.0);
    }
    out.push(')');
    out
}

/// A frame as a matrix of rows, by which rows are multiplied.
pub(super) fn matrix(frame: &DAffine3) -> String {
    let row = |v: glam::DVec3, w: u8| format!("({}, {}, {}, {w})", v.x + 0.0, v.y + 0.0, v.z + 0.0);
    let m = &frame.matrix3;
    format!("({}, {}, {}, {})", row(m.x_axis, 0), row(m.y_axis, 0), row(m.z_axis, 0), row(frame.translation, 1))
}
