//! What local steps of all kinds share.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use crate::lanes::{LANES, Matrices};

/// What local and global steps came to.
pub(super) struct Solved {
    pub(super) iterations: usize,
    /// The largest change of a rotation in the last step.
    pub(super) change: f32,
    pub(super) energy: f64,
}

/// Makes flipping a flat shape over cost more than any reflection in the plane gains.
#[inline(always)]
pub(super) fn hold_upright(covariances: &mut Matrices) {
    for l in 0..LANES {
        let [[a, b, _], [c, d, _], _] = covariances.map(|row| row.map(|entry| entry[l]));
        covariances[2][2][l] = a.abs() + b.abs() + c.abs() + d.abs();
    }
}

#[inline(always)]
pub(super) fn largest_change(a: &Matrices, b: &Matrices) -> f32 {
    let mut change = [0.0_f32; LANES];
    for row in 0..3 {
        for column in 0..3 {
            for l in 0..LANES {
                change[l] = change[l].max((a[row][column][l] - b[row][column][l]).abs());
            }
        }
    }
    change.into_iter().fold(0.0, f32::max)
}
