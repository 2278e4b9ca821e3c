//! Dense matrices in libigl's text format: `.dmat`.

use std::fmt::Write as _;

use super::table::NumberTable;
use crate::FormatError;
use crate::text::{decode, numbered_lines, quoted};

/// Reads a line `columns rows`, then one number per line, column by column. The error does not name the file: see
/// [`FormatError::in_file`].
///
/// ```
/// let table = armature_formats::tables::read_dmat(b"2 1\n0.25\n0.75\n")?;
/// assert_eq!((table.rows, table.columns, table.values), (1, 2, vec![0.25, 0.75]));
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_dmat(bytes: &[u8]) -> Result<NumberTable, FormatError> {
    let text = decode(bytes);
    let remedy = "The first line is \"columns rows\", then come the numbers, column by column";
    let mut words =
        numbered_lines(&text).flat_map(|(line, content)| content.split_whitespace().map(move |w| (line, w)));
    let mut count = || -> Result<usize, FormatError> {
        let (line, word) = words.next().ok_or_else(|| FormatError::line("", 1, "the matrix has no size", remedy))?;
        word.parse().map_err(|_| FormatError::line("", line, format!("{} is not a size", quoted(word)), remedy))
    };
    let (columns, rows) = (count()?, count()?);
    let expected = columns.checked_mul(rows);
    let mut values = Vec::new();
    let mut last_line = 1;
    for (line, word) in words {
        last_line = line;
        let value = word
            .parse()
            .map_err(|_| FormatError::line("", line, format!("{} is not a number", quoted(word)), remedy))?;
        values.push(value);
    }
    if expected != Some(values.len()) {
        let what = format!("{} numbers follow, but {columns} columns and {rows} rows were announced", values.len());
        return Err(FormatError::line("", last_line, what, "The file may be cut off; write it again"));
    }
    Ok(NumberTable { rows, columns, values })
}

/// Writes a matrix so that every number is read back bit for bit.
pub fn write_dmat(table: &NumberTable) -> String {
    let mut text = format!("{} {}\n", table.columns, table.rows);
    for value in &table.values {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{value}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_comes_back() {
        let table = NumberTable { rows: 3, columns: 2, values: vec![1.0, 0.1, 1e-300, -2.5e7, 0.0, 1.0 / 3.0] };
        let text = write_dmat(&table);
        assert!(text.starts_with("2 3\n1\n0.1\n"), "{text}");
        assert_eq!(read_dmat(text.as_bytes()).unwrap(), table);
    }

    #[test]
    fn nonsense_is_named() {
        for (text, line, word) in [
            ("", 1, "no size"),
            ("2\n", 1, "no size"),
            ("2 x\n", 1, "\"x\" is not a size"),
            ("1 2\n0.5\n", 2, "1 numbers follow"),
            ("1 2\n0.5\noops\n", 3, "\"oops\" is not a number"),
            ("18446744073709551615 2\n0.5\n", 2, "announced"),
            ("\u{0}\u{1}\n", 1, "not a size"),
        ] {
            let error = read_dmat(text.as_bytes()).unwrap_err();
            assert!(error.what.contains(word), "{error:?}");
            assert_eq!(error.place, crate::Place::Line(line), "{error:?}");
        }
    }
}
