//! Reading numbers from lines, with errors that name the line.

use std::borrow::Cow;

use super::error::FormatError;

/// Longest piece of a file that an error message quotes.
const QUOTED_CHARS: usize = 40;

/// Text of a file: a byte order mark is dropped, bytes that are not UTF-8 become replacement characters (they can only
/// be part of names and comments, or else fail as numbers).
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(without_bom(bytes))
}

/// The bytes without a byte order mark.
pub(crate) fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// `(one-based number, line)` of every line; `\n`, `\r\n` and (if there is no `\n` at all) `\r` count as line ends.
pub(crate) fn numbered_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end)
        .map(|line| line.strip_suffix('\r').unwrap_or(line))
        .enumerate()
        .map(|(index, line)| (index + 1, line))
}

/// The line up to a `#` that begins a comment; the one in Microsoft's `1.#IND` does not.
pub(crate) fn without_comment(line: &str) -> &str {
    let is_number = |at: usize| {
        let kind = line.get(at + 1..at + 4).unwrap_or_default();
        line[..at].ends_with('.') && ["IND", "INF", "QNA", "SNA"].iter().any(|k| kind.eq_ignore_ascii_case(k))
    };
    line.match_indices('#').find(|&(at, _)| !is_number(at)).map_or(line, |(at, _)| &line[..at])
}

/// A word as quoted in an error message: short, and without anything a terminal would act on.
pub(crate) fn quoted(word: &str) -> String {
    let short: String = word.chars().take(QUOTED_CHARS).collect();
    let dots = if short.len() < word.len() { "…" } else { "" };
    format!("{short:?}{dots}")
}

/// `1 face`, `2 faces`.
pub(crate) fn counted(count: usize, [one, many]: [&str; 2]) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// A number, finite or not, including what Microsoft's libraries write: `1.#IND`, `-1.#QNAN`, `1.#INF`, `-nan(ind)`.
pub(crate) fn any_number(word: &str) -> Option<f64> {
    if let Ok(value) = word.parse() {
        return Some(value);
    }
    let unsigned = word.strip_prefix(['-', '+']).unwrap_or(word).to_ascii_lowercase();
    if let Some((digits, kind)) = unsigned.split_once(".#") {
        let sign = if word.starts_with('-') { -1.0 } else { 1.0 };
        let known = digits.bytes().all(|b| b.is_ascii_digit())
            && ["inf", "ind", "qnan", "snan"].iter().any(|k| kind.starts_with(k));
        return known.then_some(if kind.starts_with("inf") { sign * f64::INFINITY } else { f64::NAN });
    }
    (unsigned.starts_with("nan(") && unsigned.ends_with(')')).then_some(f64::NAN)
}

/// A finite number.
pub(crate) fn number(file: &str, line: usize, word: &str) -> Result<f64, FormatError> {
    match any_number(word) {
        Some(value) if value.is_finite() => Ok(value),
        Some(_) => Err(FormatError::line(
            file,
            line,
            format!("{} is not a finite number", quoted(word)),
            "Repair the coordinate or export the file again",
        )),
        None => Err(FormatError::line(
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
            "There should be a count or index like 12 here; repair the line or export the file again",
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
                format!("{what} needs {N} numbers, but there are only {have}"),
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

    #[test]
    fn microsofts_infinities_and_nans_are_known() {
        for word in ["1.#IND", "-1.#IND00", "1.#QNAN", "-nan(ind)", "nan", "NaN", "nan(snan)"] {
            assert!(any_number(word).is_some_and(f64::is_nan), "{word}");
            assert!(number("", 1, word).unwrap_err().what.ends_with("is not a finite number"), "{word}");
        }
        assert_eq!(any_number("-1.#INF00"), Some(f64::NEG_INFINITY));
        assert_eq!(without_comment("v 1.#IND -1.#INF00 0 # 1.#QNAN"), "v 1.#IND -1.#INF00 0 ");
        assert_eq!(without_comment("1.# INDEX"), "1.");
        for word in ["1.#", "1.#X", "x.#IND", "#IND", "nan(", "1.5.#IND"] {
            assert_eq!(any_number(word), None, "{word}");
        }
    }
}
