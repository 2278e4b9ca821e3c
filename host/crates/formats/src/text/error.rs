//! One error for all readers: which file, where in it, what is wrong and what to do about it.

use std::fmt;

/// Where in a file something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// No particular place.
    Whole,
    /// One-based line of a text file.
    Line(usize),
    /// Zero-based byte of a binary file.
    Byte(usize),
}

/// Why bytes could not be read, in words a user can act on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormatError {
    /// The file's name; empty if the caller only passed bytes (see [`FormatError::in_file`]).
    pub file: String,
    /// Where in the file.
    pub place: Place,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub remedy: String,
}

impl FormatError {
    pub(crate) fn new(file: &str, place: Place, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { file: file.to_owned(), place, what: what.into(), remedy: remedy.into() }
    }

    pub(crate) fn whole(file: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(file, Place::Whole, what, remedy)
    }

    pub(crate) fn line(file: &str, line: usize, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(file, Place::Line(line), what, remedy)
    }

    pub(crate) fn byte(file: &str, byte: usize, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(file, Place::Byte(byte), what, remedy)
    }

    /// The same error with the name of the file the bytes came from.
    #[must_use]
    pub fn in_file(mut self, file: &str) -> Self {
        file.clone_into(&mut self.file);
        self
    }
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = if self.file.is_empty() { "the input" } else { self.file.as_str() };
        match self.place {
            Place::Whole => write!(f, "{file}: ")?,
            Place::Line(line) => write!(f, "{file}, line {line}: ")?,
            Place::Byte(byte) => write!(f, "{file}, byte {byte}: ")?,
        }
        write!(f, "{}. {}.", self.what, self.remedy)
    }
}

impl std::error::Error for FormatError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_like_a_sentence() {
        let error = FormatError::line("a.obj", 3, "there is no vertex 9", "Export the mesh again");
        assert_eq!(error.to_string(), "a.obj, line 3: there is no vertex 9. Export the mesh again.");
        let error = FormatError::whole("", "it is empty", "Choose another file").in_file("b.bvh");
        assert_eq!(error.to_string(), "b.bvh: it is empty. Choose another file.");
    }
}
