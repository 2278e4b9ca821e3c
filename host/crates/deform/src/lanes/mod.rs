//! Eight numbers side by side: their types, the processor's own instructions for them, and how kernels are compiled for
//! the widest registers available.

mod eight;
mod widest;
mod width;

pub(crate) use eight::Eight;
pub(crate) use widest::{EightKernel, Kernel, widest, with_eight};
pub(crate) use width::Lane;
pub use width::{LANES, Matrices};
