//! Tables that other programs computed, from `.npy` files.

use std::path::Path;

/// A dense table of numbers, column by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// How many columns.
    pub columns: usize,
    /// Column-major.
    pub values: Vec<f64>,
}

/// A two-dimensional table of f64.
pub fn read_npy(path: &Path) -> Array {
    let (header, data) = npy_parts(path);
    assert!(header.contains("'<f8'"), "{}: {header}", path.display());
    let shape = header.split('(').nth(1).and_then(|rest| rest.split(')').next()).unwrap_or_default();
    let columns: usize = shape.split(',').nth(1).and_then(|word| word.trim().parse().ok()).unwrap_or_default();
    let stored: Vec<f64> = data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let values = if header.contains("'fortran_order': True") {
        stored
    } else {
        (0..columns).flat_map(|column| stored.iter().skip(column).step_by(columns).copied()).collect()
    };
    Array { columns, values }
}

/// A one-dimensional list of i64 indices.
pub fn read_npy_indices(path: &Path) -> Vec<usize> {
    let (header, data) = npy_parts(path);
    assert!(header.contains("'<i8'"), "{}: {header}", path.display());
    data.as_chunks::<8>().0.iter().map(|bytes| i64::from_le_bytes(*bytes) as usize).collect()
}

fn npy_parts(path: &Path) -> (String, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(bytes.starts_with(b"\x93NUMPY\x01"), "{} is not a version 1 npy file", path.display());
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    (String::from_utf8_lossy(&bytes[10..10 + length]).into_owned(), bytes[10 + length..].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_come_column_by_column_whichever_way_they_are_stored() {
        let path = std::env::temp_dir().join(format!("armature-test-support-{}.npy", std::process::id()));
        let write = |kind: &str, order: &str, shape: &str, data: &[[u8; 8]]| {
            let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
            let bytes = [b"\x93NUMPY\x01\0".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes()];
            std::fs::write(&path, [bytes.concat(), data.concat()].concat()).unwrap_or_else(|error| panic!("{error}"));
        };
        let columns = [1.0, 2.0, 3.0, 10.0, 20.0, 30.0];
        let rows = [1.0, 10.0, 2.0, 20.0, 3.0, 30.0];
        let expected = Array { columns: 2, values: columns.to_vec() };
        for (order, stored) in [("False", rows), ("True", columns)] {
            write("<f8", order, "(3, 2)", &stored.map(f64::to_le_bytes));
            assert_eq!(read_npy(&path), expected);
        }
        write("<i8", "False", "(3,)", &[7_i64, 0, 5].map(i64::to_le_bytes));
        assert_eq!(read_npy_indices(&path), [7, 0, 5]);
        drop(std::fs::remove_file(&path));
    }
}
