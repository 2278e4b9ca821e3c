//! An operation before it is carried out.

/// An operation must improve the worst tetrahedron it touches by this (in sines), so that the process terminates.
pub(super) const LEAST_GAIN: f64 = 1e-5;

/// Tetrahedra to replace, and their replacements.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidate {
    pub(super) worst: f64,
    pub(super) old: Vec<u32>,
    pub(super) new: Vec<[u32; 4]>,
}
