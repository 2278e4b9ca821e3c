//! Arrays of numbers in `NumPy`'s format (NEP 1): `.npy`, versions 1 to 3.

use super::table::NumberTable;
use crate::FormatError;
use crate::text::quoted;

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// How a value is stored.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Float,
    Signed,
    Unsigned,
}

/// Reads an array of one or two dimensions of floating-point numbers, integers or booleans. The error does not name the
/// file: see [`FormatError::in_file`].
///
/// ```
/// use armature_formats::tables::{NumberTable, read_npy, write_npy};
///
/// let table = NumberTable { rows: 2, columns: 1, values: vec![0.25, 0.75] };
/// assert_eq!(read_npy(&write_npy(&table))?, table);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_npy(bytes: &[u8]) -> Result<NumberTable, FormatError> {
    let bad = |byte: usize, what: String| {
        FormatError::byte("", byte, what, "Save it again with numpy.save, as an array of numbers")
    };
    let cut = |byte: usize| bad(byte, "the file ends too early".into());
    if !bytes.starts_with(MAGIC) {
        return Err(bad(0, "this is not a NumPy array (it does not begin with \\x93NUMPY)".into()));
    }
    let wide = match bytes.get(6) {
        Some(1) => false,
        Some(2 | 3) => true,
        Some(version) => return Err(bad(6, format!("version {version} of the format is not known"))),
        None => return Err(cut(6)),
    };
    let (length, start) = if wide {
        (array(bytes, 8).map(|b| u32::from_le_bytes(b) as usize), 12)
    } else {
        (array(bytes, 8).map(|b| usize::from(u16::from_le_bytes(b))), 10)
    };
    let length = length.ok_or_else(|| cut(8))?;
    let end = start + length;
    let header = bytes.get(start..end).ok_or_else(|| cut(start))?;
    let header = String::from_utf8_lossy(header);
    let told = |key: &str| value_of(&header, key).ok_or_else(|| bad(start, format!("the header has no {key:?}")));
    let (kind, size, big) = kind_of(told("descr")?).ok_or_else(|| {
        bad(start, format!("numbers of type {} are not supported", quoted(told("descr").unwrap_or(""))))
    })?;
    let by_columns = told("fortran_order")?.starts_with("True");
    let (rows, columns) =
        shape_of(told("shape")?).ok_or_else(|| bad(start, "the array must have one or two dimensions".into()))?;
    let count = rows.checked_mul(columns).filter(|count| count.checked_mul(size).is_some());
    let needed = count.ok_or_else(|| bad(start, "the array is larger than any memory".into()))? * size;
    let data = &bytes[end..];
    if data.len() != needed {
        let what = format!("{} bytes of numbers follow, but {rows} × {columns} numbers need {needed}", data.len());
        return Err(bad(end, what));
    }
    let stored: Vec<f64> = data.chunks_exact(size.max(1)).map(|chunk| number(chunk, kind, big)).collect();
    let values = if by_columns || columns == 1 {
        stored
    } else {
        (0..columns).flat_map(|column| stored.iter().skip(column).step_by(columns).copied()).collect()
    };
    Ok(NumberTable { rows, columns, values })
}

fn array<const K: usize>(bytes: &[u8], at: usize) -> Option<[u8; K]> {
    bytes.get(at..at + K)?.try_into().ok()
}

/// What follows `'key':` in the header, which is a Python dictionary.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let at = header.find(&format!("'{key}'")).or_else(|| header.find(&format!("\"{key}\"")))?;
    let rest = header[at + key.len() + 2..].trim_start();
    Some(rest.strip_prefix(':')?.trim_start())
}

/// `'<f8'`: type, bytes per number, and whether the most significant byte comes first.
fn kind_of(descr: &str) -> Option<(Kind, usize, bool)> {
    let quote = descr.chars().next().filter(|c| *c == '\'' || *c == '"')?;
    let inner = descr[1..].split(quote).next()?;
    let mut letters = inner.chars();
    let big = match letters.next()? {
        '<' | '|' => false,
        '>' => true,
        _ => return None,
    };
    let kind = match letters.next()? {
        'f' => Kind::Float,
        'i' => Kind::Signed,
        'u' | 'b' => Kind::Unsigned,
        _ => return None,
    };
    let size: usize = letters.as_str().parse().ok()?;
    let known = match kind {
        Kind::Float => [4, 8].contains(&size),
        Kind::Signed | Kind::Unsigned => [1, 2, 4, 8].contains(&size),
    };
    known.then_some((kind, size, big))
}

/// `(n,)` or `(n, m)`.
fn shape_of(shape: &str) -> Option<(usize, usize)> {
    let inner = shape.strip_prefix('(')?.split_once(')')?.0;
    let sides: Option<Vec<usize>> =
        inner.split(',').map(str::trim).filter(|side| !side.is_empty()).map(|side| side.parse().ok()).collect();
    match *sides? {
        [rows] => Some((rows, 1)),
        [rows, columns] => Some((rows, columns)),
        _ => None,
    }
}

/// One number of 1, 2, 4 or 8 bytes.
fn number(chunk: &[u8], kind: Kind, big: bool) -> f64 {
    let mut little = [0_u8; 8];
    for (k, byte) in chunk.iter().enumerate() {
        little[if big { chunk.len() - 1 - k } else { k }] = *byte;
    }
    let bits = u64::from_le_bytes(little);
    let unused = 64 - 8 * chunk.len() as u32;
    match kind {
        Kind::Float if chunk.len() == 4 => f64::from(f32::from_bits(bits as u32)),
        Kind::Float => f64::from_bits(bits),
        Kind::Signed => ((bits << unused) as i64 >> unused) as f64,
        Kind::Unsigned => bits as f64,
    }
}

/// Writes a two-dimensional table, double precision, row by row.
pub fn write_npy(table: &NumberTable) -> Vec<u8> {
    let mut out = begin("<f8", &format!("({}, {})", table.rows, table.columns), 8 * table.values.len());
    for row in 0..table.rows {
        for value in table.values.iter().skip(row).step_by(table.rows.max(1)) {
            out.extend(value.to_le_bytes());
        }
    }
    out
}

/// The bytes before the numbers. `shape`: a tuple as Python writes it.
pub(super) fn begin(descr: &str, shape: &str, bytes: usize) -> Vec<u8> {
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    // The data start at a multiple of 64 bytes; a line break ends the header.
    let unpadded = MAGIC.len() + 4 + header.len() + 1;
    header.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut out = Vec::with_capacity(128 + bytes);
    out.extend(MAGIC);
    out.extend([1, 0]);
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.save` of `numpy.array([[1.5, 2, 3], [4, 5, 6]])`, as `NumPy` 2 writes it.
    fn numpys() -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(format!("{:117}\n", "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }").bytes());
        bytes.extend([1.5_f64, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()));
        bytes
    }

    fn table() -> NumberTable {
        NumberTable { rows: 2, columns: 3, values: vec![1.5, 4.0, 2.0, 5.0, 3.0, 6.0] }
    }

    fn with(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x02\x00".to_vec();
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn reads_and_writes_what_numpy_does() {
        assert_eq!(read_npy(&numpys()).unwrap(), table());
        assert_eq!(write_npy(&table()), numpys());
        let none = NumberTable { rows: 0, columns: 3, values: Vec::new() };
        assert_eq!(read_npy(&write_npy(&none)).unwrap(), none);
    }

    #[test]
    fn reads_other_kinds_orders_and_versions() {
        let columns: Vec<u8> = [1.0_f32, 2.0, 3.0, 4.0].iter().flat_map(|v| v.to_be_bytes()).collect();
        assert_eq!(read_npy(&with(">f4", "True", "(2, 2)", &columns)).unwrap().values, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(read_npy(&with("|b1", "False", "(3,)", &[1, 0, 1])).unwrap().indices(), Some(vec![1, 0, 1]));
        let signed = read_npy(&with("<i2", "False", "(2,)", &[0xfe, 0xff, 7, 0])).unwrap();
        assert_eq!((signed.values.as_slice(), signed.indices()), ([-2.0, 7.0].as_slice(), None));
        assert_eq!(read_npy(&with("<u8", "False", "(1,)", &[2, 1, 0, 0, 0, 0, 0, 0])).unwrap().values, [258.0]);
    }

    #[test]
    fn nonsense_is_named_and_never_believed() {
        let whole = numpys();
        for length in 0..whole.len() {
            assert!(read_npy(&whole[..length]).is_err(), "{length} bytes");
        }
        for (bytes, word) in [
            (with("<c16", "False", "(1,)", &[0; 16]), "are not supported"),
            (with("<f8", "False", "(1, 1, 1)", &[0; 8]), "dimensions"),
            (with("<f8", "False", "(99999999999, 99999999999)", &[0; 8]), "larger"),
            (with("<f8", "False", "(3,)", &[0; 8]), "need 24"),
            (b"PK\x03\x04 an archive of arrays".to_vec(), "not a NumPy array"),
        ] {
            let error = read_npy(&bytes).unwrap_err();
            assert!(error.what.contains(word), "{word:?} is not in {error:?}");
        }
        // Every damaged byte gives an array or an error.
        for at in 0..whole.len() {
            for value in [0, b'(', b'9', 0xff] {
                let mut hostile = whole.clone();
                hostile[at] = value;
                let _ = read_npy(&hostile);
            }
        }
    }
}
