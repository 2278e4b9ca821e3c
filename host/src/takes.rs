//! Takes on disk.

use std::path::Path;

use armature_take::{ReadReport, Take};

use crate::failure::Failure;
use crate::files;

/// Reads a take; what is damaged or missing is in the report.
pub fn read(path: &Path) -> Result<(Take, ReadReport), Failure> {
    Take::read(&files::read(path)?).map_err(|e| Failure::input(format!("{}: {e}", path.display()), ""))
}

/// Reads a take and tells the user what is missing in it.
pub fn read_and_tell(path: &Path) -> Result<Take, Failure> {
    let (take, report) = read(path)?;
    for problem in &report.problems {
        eprintln!("note: {}: {problem}", path.display());
    }
    Ok(take)
}
