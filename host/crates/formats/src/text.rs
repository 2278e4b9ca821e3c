//! Reading numbers from lines, with errors that name the line.

use std::borrow::Cow;

use crate::FormatError;

/// Longest piece of a file that an error message repeats.
const QUOTED_CHARS: usize = 40;

/// Text of a file: a byte order mark is dropped, bytes that are no UTF-8 become replacement characters
/// (they can only be part of names and comments, or else fail as numbers).
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes))
}

/// `(one-based number, line)` of every line; the ends `\n`, `\r\n` and (where there is no `\n` at all) `\r` count.
pub(crate) fn numbered_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end)
        .map(|line| line.strip_suffix('\r').unwrap_or(line))
        .enumerate()
        .map(|(index, line)| (index + 1, line))
}

/// The line before a `#`.
pub(crate) fn without_comment(line: &str) -> &str {
    line.split_once('#').map_or(line, |(before, _)| before)
}

/// A word as an error message repeats it: short, and with nothing a terminal would act on.
pub(crate) fn quoted(word: &str) -> String {
    let short: String = word.chars().take(QUOTED_CHARS).collect();
    let dots = if short.len() < word.len() { "…" } else { "" };
    format!("{short:?}{dots}")
}

/// A finite number.
pub(crate) fn number(file: &str, line: usize, word: &str) -> Result<f64, FormatError> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(FormatError::line(
            file,
            line,
            format!("{} is not a finite number", quoted(word)),
            "Repair the coordinate or export the file again",
        )),
        Err(_) => Err(FormatError::line(
            file,
            line,
            format!("{} is not a number", quoted(word)),
            "Numbers look like -1.25 or 3e-4; repair the line or export the file again",
        )),
    }
}

/// A whole number that is not negative.
pub(crate) fn count(file: &str, line: usize, word: &str) -> Result<usize, FormatError> {
    word.parse().map_err(|_| {
        FormatError::line(
            file,
            line,
            format!("{} is not a whole number", quoted(word)),
            "A count or index like 12 belongs here; repair the line or export the file again",
        )
    })
}

/// Exactly `N` finite numbers from the front of `words`; `what` names them for the error.
pub(crate) fn numbers<'w, const N: usize>(
    file: &str,
    line: usize,
    words: &mut impl Iterator<Item = &'w str>,
    what: &str,
) -> Result<[f64; N], FormatError> {
    let mut out = [0.0; N];
    for (have, slot) in out.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| {
            FormatError::line(
                file,
                line,
                format!("{what} needs {N} numbers, there are only {have}"),
                "The file may be cut off; repair the line or export the file again",
            )
        })?;
        *slot = number(file, line, word)?;
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_line_ends_count() {
        let of = |text: &str| numbered_lines(text).map(|(n, l)| (n, l.to_owned())).collect::<Vec<_>>();
        let expected = [(1, "a".to_owned()), (2, "b".to_owned())];
        assert_eq!(of("a\nb"), expected);
        assert_eq!(of("a\r\nb"), expected);
        assert_eq!(of("a\rb"), expected);
    }

    #[test]
    fn numbers_must_be_finite() {
        assert_eq!(number("", 1, "1e3").ok(), Some(1000.0));
        for bad in ["nan", "inf", "-Infinity", "1e999", "1,5", ""] {
            assert!(number("", 1, bad).is_err(), "{bad}");
        }
    }
}
