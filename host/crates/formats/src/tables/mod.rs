//! Tables of numbers, such as weights: `NumPy` arrays (`.npy`, archives of them `.npz`) and libigl's text matrices (`.dmat`).

mod dmat;
mod npy;
mod npz;
mod table;

pub use dmat::{read_dmat, write_dmat};
pub use npy::{read_npy, write_npy};
pub use npz::{NpyArray, NpyValues, write_npz};
pub use table::NumberTable;
