//! What all readers share: the error, parsing of numbers from lines, names that a skeleton accepts.

mod error;
pub(crate) mod names;
mod numbers;

pub use error::{FormatError, Place};
pub(crate) use numbers::{
    any_number, count, counted, decode, number, numbered_lines, numbers, quoted, without_bom, without_comment,
};
