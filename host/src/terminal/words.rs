//! Numbers in sentences, and text that is safe to print.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Text with its control characters escaped, like `\u{1b}`: names from files and devices may contain some, which would
/// move the cursor, change colours, or hide what is printed. Marks that reverse the writing direction are escaped too;
/// line ends and tabs stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unsafe(c) {
            // Writing to a string cannot fail.
            let _ = write!(out, "{}", c.escape_unicode());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

fn is_unsafe(c: char) -> bool {
    let turns_direction = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    turns_direction || (c.is_control() && !matches!(c, '\n' | '\t'))
}

/// A whole number with commas between thousands.
pub fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A number of things: `1 edge`, `1,388 edges`.
pub fn counted(number: usize, one: &str, more: &str) -> String {
    format!("{} {}", grouped(number), if number == 1 { one } else { more })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        assert!(matches!(plain("Käfer 昆虫\n\tbone_1 → …"), Cow::Borrowed(_)));
        assert_eq!(plain("\u{1b}[2Jgone\rnew\u{7}\u{9b}31m"), r"\u{1b}[2Jgone\u{d}new\u{7}\u{9b}31m");
        assert_eq!(plain("a\u{202e}b\u{2066}"), r"a\u{202e}b\u{2066}");
    }

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!([0, 7, 999, 1000, 1_234_567].map(grouped), ["0", "7", "999", "1,000", "1,234,567"]);
        assert_eq!(counted(1, "edge", "edges"), "1 edge");
        assert_eq!(counted(1388, "edge", "edges"), "1,388 edges");
    }
}
