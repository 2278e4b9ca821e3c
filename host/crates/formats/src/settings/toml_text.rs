//! TOML with errors that name the line.

use crate::FormatError;

pub(super) fn utf8<'a>(bytes: &'a [u8], remedy: &str) -> Result<&'a str, FormatError> {
    std::str::from_utf8(bytes)
        .map_err(|error| FormatError::byte("", error.valid_up_to(), "this is not UTF-8 text", remedy))
}

pub(super) fn toml_error(text: &str, error: &toml::de::Error, remedy: &str) -> FormatError {
    let line = error.span().map_or(1, |span| line_at(text, span.start));
    FormatError::line("", line, error.message(), remedy)
}

/// `known`: the newest version there is, and all before it.
pub(super) fn check_version(what: &str, got: u32, known: u32) -> Result<(), FormatError> {
    if (1..=known).contains(&got) {
        return Ok(());
    }
    let what = format!("this is a {what} file of version {got}, but this program knows version {known}");
    Err(FormatError::whole("", what, "Use the program that wrote it, or a newer one"))
}

pub(super) fn line_at(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|&b| b == b'\n').count()
}
