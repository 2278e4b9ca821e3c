//! Tables of numbers, such as weights: `NumPy` arrays (`.npy`) and libigl's text matrices (`.dmat`).

mod dmat;
mod npy;
mod table;

pub use dmat::{read_dmat, write_dmat};
pub use npy::{read_npy, write_npy};
pub use table::NumberTable;
