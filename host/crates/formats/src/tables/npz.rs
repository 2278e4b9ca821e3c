//! Archives of named arrays in `NumPy`'s format: `.npz`.

use super::npy::begin;
use crate::FormatError;
use crate::archive::store;

/// An array of any number of dimensions, its last index running fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyArray {
    /// Length of each dimension; none for one number.
    pub shape: Vec<usize>,
    /// As many values as the lengths multiplied.
    pub values: NpyValues,
}

/// The values of an array.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "each is called as its type")]
pub enum NpyValues {
    F32(Vec<f32>),
    F64(Vec<f64>),
    I32(Vec<i32>),
    U8(Vec<u8>),
    U32(Vec<u32>),
    U64(Vec<u64>),
    /// Texts of any lengths.
    Text(Vec<String>),
}

impl NpyValues {
    fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::U8(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::U64(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// The type as `NumPy` writes it, and the bytes.
    fn stored(&self) -> (String, Vec<u8>) {
        fn all<T: Copy, const K: usize>(values: &[T], of: fn(T) -> [u8; K]) -> Vec<u8> {
            values.iter().flat_map(|&value| of(value)).collect()
        }
        match self {
            Self::F32(values) => ("<f4".into(), all(values, f32::to_le_bytes)),
            Self::F64(values) => ("<f8".into(), all(values, f64::to_le_bytes)),
            Self::I32(values) => ("<i4".into(), all(values, i32::to_le_bytes)),
            Self::U8(values) => ("|u1".into(), values.clone()),
            Self::U32(values) => ("<u4".into(), all(values, u32::to_le_bytes)),
            Self::U64(values) => ("<u8".into(), all(values, u64::to_le_bytes)),
            Self::Text(values) => {
                // Texts of one length, filled up with zeros.
                let width = values.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
                let padded = |text: &String| {
                    let letters = text.chars().map(u32::from).collect::<Vec<_>>();
                    (0..width).flat_map(move |k| letters.get(k).copied().unwrap_or(0).to_le_bytes())
                };
                (format!("<U{width}"), values.iter().flat_map(padded).collect())
            }
        }
    }
}

/// Writes an archive of arrays, each under its name.
///
/// ```
/// use armature_formats::tables::{NpyArray, NpyValues, write_npz};
///
/// let time = NpyArray { shape: vec![2], values: NpyValues::F64(vec![0.0, 0.04]) };
/// assert!(write_npz(&[("time", time)])?.starts_with(b"PK"));
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_npz(arrays: &[(&str, NpyArray)]) -> Result<Vec<u8>, FormatError> {
    let mut files = Vec::with_capacity(arrays.len());
    for (name, array) in arrays {
        let count = array.shape.iter().product::<usize>();
        if count != array.values.len() {
            let what = format!("the array {name} has {} values, not {count}", array.values.len());
            return Err(FormatError::whole("NPZ", what, "Give as many values as its shape says"));
        }
        let lengths: Vec<String> = array.shape.iter().map(|length| format!("{length},")).collect();
        let (descr, values) = array.values.stored();
        let mut bytes = begin(&descr, &format!("({})", lengths.join(" ")), values.len());
        bytes.extend(values);
        files.push((format!("{name}.npy"), bytes));
    }
    let stored = store(files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())), 64);
    stored.map_err(|error| FormatError::whole("NPZ", error, "Export a shorter take"))
}
