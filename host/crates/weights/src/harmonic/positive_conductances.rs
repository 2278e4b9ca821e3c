//! A Laplacian with the maximum principle on the mesh's own edges.
//!
//! A harmonic function has no extrema inside as long as no conductance is negative: each value is then a mean of its
//! neighbours'. Obtuse angles, and nearly every tetrahedral mesh, have negative ones (thesis 5.5,
//! "no free lunch"). Those are raised to a small positive value here, and all others stay: linear functions are no
//! longer harmonic where that was needed, which does not matter to what only has to rise and fall in the right places.

use armature_geometry::operators::SparseMatrix;

/// What a conductance is raised to, as a fraction of the mean positive one at its ends: small, because the other edges
/// measure the shape and this one only has to be there.
const FLOOR: f64 = 1e-2;

/// A negative conductance this small a fraction of the mean is the rounding of a right angle, and becomes zero.
const ROUNDING: f64 = 1e-9;

/// A Laplacian without negative conductances.
#[derive(Clone, Debug, PartialEq)]
pub struct PositiveLaplacian {
    /// n×n with the pattern of the given one; rows sum to zero.
    pub matrix: SparseMatrix,
    /// Edges whose conductance was raised.
    pub raised_edges: usize,
    /// Vertices at such an edge.
    pub vertices: usize,
}

/// Raises the negative conductances (off-diagonal entries) of a symmetric Laplacian.
pub fn positive_conductances(laplacian: &SparseMatrix) -> PositiveLaplacian {
    let n = laplacian.columns();
    let mean = |vertex: usize| {
        let positive = laplacian.column(vertex).filter(|&(row, value)| row != vertex && value > 0.0);
        let (sum, count) = positive.fold((0.0, 0_usize), |(sum, count), (_, value)| (sum + value, count + 1));
        sum / count.max(1) as f64
    };
    let means: Vec<f64> = (0..n).map(mean).collect();
    let anywhere = means.iter().sum::<f64>() / n.max(1) as f64;
    let typical = |a: usize, b: usize| {
        let both = 0.5 * (means[a] + means[b]);
        if both > 0.0 {
            both
        } else if anywhere > 0.0 {
            anywhere
        } else {
            1.0
        }
    };
    let mut matrix = laplacian.clone();
    let starts = laplacian.column_starts().to_vec();
    let rows = laplacian.row_indices().to_vec();
    let (mut raised, mut touched) = (0, vec![false; n]);
    for column in 0..n {
        let range = starts[column]..starts[column + 1];
        let mut sum = 0.0;
        for (value, &row) in matrix.values_mut()[range.clone()].iter_mut().zip(&rows[range.clone()]) {
            if row == column {
                continue;
            }
            let typical = typical(row, column);
            let cut_off = *value <= 0.0 && (means[row] == 0.0 || means[column] == 0.0);
            if cut_off || value.is_nan() || *value < -ROUNDING * typical {
                *value = FLOOR * typical;
                touched[column] = true;
                raised += 1;
            }
            *value = value.max(0.0);
            sum += *value;
        }
        for (value, &row) in matrix.values_mut()[range.clone()].iter_mut().zip(&rows[range]) {
            if row == column {
                *value = -sum;
            }
        }
    }
    PositiveLaplacian { matrix, raised_edges: raised / 2, vertices: touched.iter().filter(|touched| **touched).count() }
}
