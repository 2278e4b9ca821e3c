//! The mesh, the energy and the data of monotone functions.

use armature_geometry::operators::SparseMatrix;

use crate::extrema::Neighbours;

/// A mesh and what is to be least on it.
#[derive(Clone, Copy, Debug)]
pub struct MonotoneProblem<'a> {
    /// Which vertices share an edge.
    pub neighbours: &'a Neighbours,
    /// n×n cotangent Laplacian of the same mesh, as [`armature_geometry::operators`] builds it.
    pub laplacian: &'a SparseMatrix,
    /// n lumped masses.
    pub mass: &'a [f64],
    /// Order k of the smoothness energy `½ ∫ ‖∇ᵏf‖²` (thesis eq. 5.18): 2, 3 or 4.
    pub order: usize,
    /// How smooth the function is at each vertex (n), 0 for a crease to 1 (Botsch & Kobbelt 2004); 1 everywhere if absent.
    pub blend: Option<&'a [f64]>,
    /// A function to stay close to.
    pub data: Option<Data<'a>>,
}

/// The energy `½ fidelity ∫ (f - values)²` (thesis eq. 5.4, by mass), and the function whose order is kept.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a> {
    /// One for each vertex.
    pub values: &'a [f64],
    /// Its weight against smoothness, not negative.
    pub fidelity: f64,
}

impl Data<'_> {
    /// The fidelity with which a wave of this length (mesh unit) on a large flat mesh keeps half of its height; shorter
    /// ones keep less. `order` is that of the smoothness energy.
    pub fn fidelity_for(wavelength: f64, order: usize) -> f64 {
        (std::f64::consts::TAU / wavelength).powi(2 * order as i32)
    }
}
