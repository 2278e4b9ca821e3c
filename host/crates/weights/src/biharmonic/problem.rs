//! The problem, when to stop, and how it ended; shared by the methods that solve handles separately and together.

use armature_geometry::operators::SparseMatrix;

use super::energy::BiharmonicEnergy;
use super::error::BiharmonicError;
use crate::handles::HandleBoundary;

/// The problem to solve, on triangles or tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct BiharmonicProblem<'a> {
    /// n×n cotangent Laplacian, symmetric; its sign does not matter.
    pub laplacian: &'a SparseMatrix,
    /// n lumped masses, positive wherever the Laplacian has an entry.
    pub mass: &'a [f64],
    /// Vertices whose weights are given, each once.
    pub fixed: &'a [usize],
    /// Their weights: `fixed.len()` × m handles, column-major, each within 0..=1.
    pub fixed_weights: &'a [f64],
    /// Number of handles m.
    pub handles: usize,
    /// The shape-preservation brush's term `K` (thesis eq. 4.9): n×n, symmetric positive semidefinite.
    pub shape_preservation: Option<&'a SparseMatrix>,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiharmonicSettings {
    /// A handle is done once no weight can be farther than this from the optimal one ...
    pub error_bound: f64,
    /// ... and no weights have an energy lower by more than this fraction.
    pub relative_gap: f64,
    /// Steps of alternating directions for the first guess; up to twice as many on small meshes.
    pub guess_steps: usize,
    /// Active sets tried before giving up on a handle.
    pub max_active_sets: usize,
}

impl BiharmonicSettings {
    /// Optimal to 2e-5 in every weight and to ten digits in the energy.
    pub const fn certified() -> Self {
        Self { error_bound: 2e-5, relative_gap: 1e-10, guess_steps: 40, max_active_sets: 200 }
    }

    /// Every weight within 2e-3 of the optimal one: the difference is not visible in any deformation.
    pub const fn interactive() -> Self {
        Self { error_bound: 2e-3, relative_gap: 1.0, guess_steps: 40, max_active_sets: 200 }
    }
}

impl Default for BiharmonicSettings {
    fn default() -> Self {
        Self::interactive()
    }
}

/// How the computation of one handle's weights ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BiharmonicOutcome {
    /// Both bounds of the settings hold.
    Converged,
    /// The limit was reached; these are the best weights found, and the report says how good they are.
    LimitReached,
}

impl<'a> BiharmonicProblem<'a> {
    /// A problem for handles on a mesh with this Laplacian (n×n) and these masses (n), with no brush.
    pub fn new(laplacian: &'a SparseMatrix, mass: &'a [f64], held: &'a HandleBoundary) -> Self {
        let HandleBoundary { fixed, fixed_weights, handles } = held;
        Self { laplacian, mass, fixed, fixed_weights, handles: *handles, shape_preservation: None }
    }

    /// The nonzero given weights of one handle, by row among the fixed vertices.
    pub(crate) fn given(&self, handle: usize) -> Vec<(usize, f64)> {
        let given = &self.fixed_weights[handle * self.fixed.len()..(handle + 1) * self.fixed.len()];
        given.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect()
    }

    /// The same by vertex.
    pub(crate) fn at_vertices(&self, given: &[(usize, f64)]) -> Vec<(usize, f64)> {
        given.iter().map(|&(row, weight)| (self.fixed[row], weight)).collect()
    }

    /// Given and computed weights of one handle together, without zeros, by ascending vertex; `column` covers the
    /// unknowns in `places`, or all of them.
    pub(crate) fn whole(
        &self,
        energy: &BiharmonicEnergy,
        handle: usize,
        places: Option<&[u32]>,
        column: &[f64],
    ) -> Vec<(usize, f64)> {
        let vertex = |at: usize| energy.unknowns[places.map_or(at, |places| places[at] as usize)] as usize;
        let moved = column.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        let mut weights: Vec<(usize, f64)> = moved.map(|(at, &weight)| (vertex(at), weight)).collect();
        weights.extend(self.at_vertices(&self.given(handle)));
        weights.sort_unstable_by_key(|&(vertex, _)| vertex);
        weights
    }

    /// `½ wᵀ (L M⁻¹ L + K) w`, as a sum of squares so that the huge entries of slivers do not cancel; `weights` are the
    /// nonzero ones, by ascending vertex.
    pub(crate) fn energy(&self, weights: &[(usize, f64)]) -> f64 {
        let mut curvature = vec![0.0; self.mass.len()];
        let touched = multiply_sparse(self.laplacian, weights, &mut curvature);
        let bent = touched.into_iter().filter(|&row| curvature[row] != 0.0);
        let squares: f64 = bent.map(|row| curvature[row] * curvature[row] / self.mass[row]).sum();
        let kept: f64 = self.shape_preservation.map_or(0.0, |k| {
            let mut gradient = vec![0.0; self.mass.len()];
            multiply_sparse(k, weights, &mut gradient);
            weights.iter().map(|&(vertex, weight)| gradient[vertex] * weight).sum()
        });
        0.5 * (squares + kept)
    }

    pub(crate) fn out_of_memory(&self) -> BiharmonicError {
        BiharmonicError::OutOfMemory { vertices: self.mass.len(), handles: self.handles }
    }
}

/// Adds a matrix times a sparse vector to `product`, which is zero; returns the rows reached, ascending.
fn multiply_sparse(matrix: &SparseMatrix, vector: &[(usize, f64)], product: &mut [f64]) -> Vec<usize> {
    let mut reached = vec![false; product.len()];
    let mut rows = Vec::new();
    for &(column, factor) in vector {
        for (row, value) in matrix.column(column) {
            product[row] += value * factor;
            if !std::mem::replace(&mut reached[row], true) {
                rows.push(row);
            }
        }
    }
    rows.sort_unstable();
    rows
}
