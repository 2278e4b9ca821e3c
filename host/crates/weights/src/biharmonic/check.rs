//! What a bounded biharmonic problem must look like, and which error is returned if it does not.

use armature_geometry::operators::SparseMatrix;

use super::error::BiharmonicError;
use super::problem::{BiharmonicProblem, BiharmonicSettings};

/// Returns the first thing wrong with a problem or its settings.
pub(crate) fn check(problem: &BiharmonicProblem<'_>, settings: &BiharmonicSettings) -> Result<(), BiharmonicError> {
    settings.check()?;
    let n = problem.mass.len();
    let size = |what, given: usize, wanted| {
        if given == wanted { Ok(()) } else { Err(BiharmonicError::Size { what, given, wanted }) }
    };
    check_matrix("the Laplacian", problem.laplacian, n)?;
    if let Some(matrix) = problem.shape_preservation {
        check_matrix("the shape-preservation term", matrix, n)?;
    }
    if problem.fixed.is_empty() || problem.handles == 0 {
        return Err(BiharmonicError::NoHandles);
    }
    let wanted = problem.fixed.len().saturating_mul(problem.handles);
    size("fixed_weights", problem.fixed_weights.len(), wanted)?;
    for (vertex, &mass) in problem.mass.iter().enumerate() {
        let used = problem.laplacian.column(vertex).any(|(_, value)| value != 0.0);
        if !mass.is_finite() || (used && !mass.is_normal()) || mass < 0.0 {
            return Err(BiharmonicError::BadMass { vertex, mass });
        }
    }
    let mut taken = vec![false; n];
    for &vertex in problem.fixed {
        if vertex >= n {
            return Err(BiharmonicError::NoSuchVertex { vertex, vertices: n });
        }
        if std::mem::replace(&mut taken[vertex], true) {
            return Err(BiharmonicError::FixedTwice { vertex });
        }
    }
    for (handle, given) in problem.fixed_weights.chunks(problem.fixed.len()).enumerate() {
        for (&vertex, &weight) in problem.fixed.iter().zip(given) {
            if !(0.0..=1.0).contains(&weight) {
                return Err(BiharmonicError::BadFixedWeight { handle, vertex, weight });
            }
        }
        if given.iter().all(|weight| *weight == 0.0) {
            return Err(BiharmonicError::EmptyHandle { handle });
        }
    }
    Ok(())
}

impl BiharmonicSettings {
    fn check(&self) -> Result<(), BiharmonicError> {
        let bad = |name, value, allowed| Err(BiharmonicError::BadSetting { name, value, allowed });
        if !(1e-9..=1.0).contains(&self.error_bound) {
            return bad("error_bound", self.error_bound, "between 1e-9 and 1");
        }
        if !(1e-14..=1.0).contains(&self.relative_gap) {
            return bad("relative_gap", self.relative_gap, "between 1e-14 and 1");
        }
        if self.max_active_sets == 0 {
            return bad("max_active_sets", 0.0, "at least 1");
        }
        if !(1..=10_000).contains(&self.guess_steps) {
            return bad("guess_steps", self.guess_steps as f64, "between 1 and 10000");
        }
        Ok(())
    }
}

/// Square, finite and symmetric up to rounding.
fn check_matrix(what: &'static str, matrix: &SparseMatrix, n: usize) -> Result<(), BiharmonicError> {
    for given in [matrix.rows(), matrix.columns()] {
        if given != n {
            return Err(BiharmonicError::Size { what, given, wanted: n });
        }
    }
    // As columns come in order, so do the rows of their transposes: one pointer per column is enough.
    let mut next: Vec<usize> = matrix.column_starts()[..n].to_vec();
    for column in 0..n {
        for (row, value) in matrix.column(column) {
            let mirror = next[row];
            let inside = mirror < matrix.column_starts()[row + 1];
            let mirrored =
                if inside && matrix.row_indices()[mirror] == column { matrix.values()[mirror] } else { f64::NAN };
            let allowed = 1e-9 * value.abs().max(mirrored.abs());
            // Negated, so that NaN and infinity fail too.
            if !((value - mirrored).abs() <= allowed && value.is_finite()) {
                return Err(BiharmonicError::BadMatrix { what, column });
            }
            next[row] += 1;
        }
    }
    Ok(())
}

/// Which vertices are connected to a fixed one, and the pieces that are not: each ascending, ordered by first vertex.
pub(crate) fn reached(laplacian: &SparseMatrix, fixed: &[usize]) -> (Vec<bool>, Vec<Vec<usize>>) {
    let n = laplacian.columns();
    let mut seen = vec![false; n];
    let mut spread = |start: &[usize]| {
        let mut piece = Vec::new();
        let mut open = start.to_vec();
        open.iter().for_each(|&vertex| seen[vertex] = true);
        while let Some(vertex) = open.pop() {
            piece.push(vertex);
            for (neighbour, value) in laplacian.column(vertex) {
                if value != 0.0 && !std::mem::replace(&mut seen[neighbour], true) {
                    open.push(neighbour);
                }
            }
        }
        piece.sort_unstable();
        piece
    };
    let mut takes_part = vec![false; n];
    spread(fixed).into_iter().for_each(|vertex| takes_part[vertex] = true);
    let mut unreached = Vec::new();
    let mut told = takes_part.clone();
    for vertex in 0..n {
        if !told[vertex] {
            let piece = spread(&[vertex]);
            piece.iter().for_each(|&v| told[v] = true);
            unreached.push(piece);
        }
    }
    (takes_part, unreached)
}
