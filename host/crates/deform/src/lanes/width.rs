//! How many numbers are processed side by side.

/// Matrices processed side by side.
pub const LANES: usize = 8;
/// One number per lane.
pub(crate) type Lane = [f32; LANES];
/// Eight 3×3 matrices, `[row][column][lane]`.
pub type Matrices = [[[f32; LANES]; 3]; 3];
