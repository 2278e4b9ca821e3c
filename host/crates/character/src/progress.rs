//! How long computations report progress.

use std::ops::ControlFlow;

/// Receives the current stage in plain words and the fraction of the whole that is done, 0 to 1 and never falling;
/// stops the work with `Break`.
pub type Progress<'a> = &'a mut dyn FnMut(&'static str, f64) -> ControlFlow<()>;
