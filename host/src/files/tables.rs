//! Tables of numbers: `NumPy` arrays and libigl's text matrices, by the file's extension.

use std::path::Path;

use armature_formats::tables::{NumberTable, read_dmat, read_npy, write_dmat, write_npy};

use super::{extension_of, read};
use crate::failure::Failure;

/// Turns a table into a file's bytes.
pub type TableWriter = fn(&NumberTable) -> Vec<u8>;

/// The format of a file to write, checked before the work is done; `what` it is to hold, for the message.
pub fn table_writer(path: &Path, what: &str) -> Result<TableWriter, Failure> {
    match extension_of(path).as_str() {
        "npy" => Ok(write_npy),
        "dmat" => Ok(|table| write_dmat(table).into_bytes()),
        _ => Err(Failure::usage(
            format!("{} is not a {what} file", path.display()),
            format!("{what} are written as .npy (NumPy) and .dmat (libigl)"),
        )),
    }
}

/// Reads a table.
pub fn read_table(path: &Path) -> Result<NumberTable, Failure> {
    let parse = if extension_of(path) == "dmat" { read_dmat } else { read_npy };
    Ok(parse(&read(path)?).map_err(|e| e.in_file(&path.display().to_string()))?)
}
