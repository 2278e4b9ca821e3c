//! Vertices without weights get the smoothest ones that fit those around them.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use armature_geometry::operators::SparseMatrix;

use super::error::TransferError;
use crate::FunctionDomain;
use crate::harmonic::positive_conductances;
use crate::progress::report;
use crate::sparse::cholesky::SparseCholesky;

/// Bones and weights of one vertex, each bone once, summing to one.
pub type WeightRow = Vec<(u16, f64)>;

/// Weights this small are rounding.
const DUST: f64 = 1e-9;
/// Smallest mass of a vertex, as a fraction of the mean: slivers would count as infinitely stiff.
const LEAST_MASS: f64 = 1e-3;

const STAGE: &str = "filling in weights";

/// Weights of all vertices of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Inpainted {
    /// One row per vertex: those given, unchanged, and the filled-in ones; empty for `unreached` vertices.
    pub rows: Vec<WeightRow>,
    /// Vertices that were filled in.
    pub filled: usize,
    /// Vertices in pieces of the mesh without a given row, ascending.
    pub unreached: Vec<u32>,
    /// Largest imbalance of the linear systems, relative to their largest right-hand side.
    pub residual: f64,
    /// How far below zero a weight was before it was set to zero and its row scaled to sum to one.
    pub undershoot: f64,
}

/// Fills in the rows that are `None`: of each bone, the weights that minimise `‖ΔW‖² + ‖∇W‖²` (the first in units of the
/// mean mass of a vertex) with the given ones held. Vertices at one place are one.
pub fn inpaint_weights(
    mesh: &TriangleMesh,
    given: &[Option<WeightRow>],
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Inpainted, TransferError> {
    check(mesh, given)?;
    let domain = FunctionDomain::of_triangles(mesh).map_err(|error| TransferError::Mesh { which: "target", error })?;
    let cancelled = |stopped: crate::progress::Stopped| TransferError::Cancelled { stage: stopped.stage };
    report(progress, STAGE, 0.0).map_err(cancelled)?;
    let laplacian = positive_conductances(&domain.laplacian).matrix;
    let mut held: Vec<Option<&WeightRow>> = vec![None; domain.vertices.len()];
    for (&vertex, row) in domain.vertex_of.iter().zip(given) {
        if held[vertex as usize].is_none() {
            held[vertex as usize] = row.as_ref();
        }
    }
    let reached = reached(&laplacian, &held);
    let free: Vec<usize> = (0..held.len()).filter(|&v| held[v].is_none() && reached[v]).collect();
    let system = System::new(&laplacian, &domain.mass, &held, &free);
    let factor = SparseCholesky::new(&system.matrix)?;
    let mut filled: Vec<WeightRow> = vec![Vec::new(); free.len()];
    let (mut residual, mut undershoot) = (0.0_f64, 0.0_f64);
    let count = system.pulls.len();
    for (done, (&bone, right)) in system.pulls.iter().enumerate() {
        report(progress, STAGE, done as f64 / count as f64).map_err(cancelled)?;
        let mut weights = right.clone();
        factor.solve_here(&mut weights)?;
        // One step of refinement, and what is left after it.
        let imbalance = |weights: &[f64]| -> Vec<f64> {
            system.matrix.multiply(weights).iter().zip(right).map(|(left, right)| right - left).collect()
        };
        let mut step = imbalance(&weights);
        factor.solve_here(&mut step)?;
        weights.iter_mut().zip(step).for_each(|(weight, step)| *weight += step);
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        residual = residual.max(largest(&imbalance(&weights)) / largest(right).max(f64::MIN_POSITIVE));
        for (row, weight) in filled.iter_mut().zip(weights) {
            undershoot = undershoot.max(-weight);
            if weight > DUST {
                row.push((bone, weight));
            }
        }
    }
    for row in &mut filled {
        let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    let mut place = vec![None; held.len()];
    free.iter().zip(filled).for_each(|(&vertex, row)| place[vertex] = Some(row));
    let rows = domain.vertex_of.iter().zip(given).map(|(&vertex, own)| {
        let here = held[vertex as usize].or(place[vertex as usize].as_ref());
        own.as_ref().or(here).cloned().unwrap_or_default()
    });
    let rows: Vec<WeightRow> = rows.collect();
    let unreached: Vec<u32> = (0..).zip(&rows).filter(|(_, row)| row.is_empty()).map(|(vertex, _)| vertex).collect();
    let missing = given.iter().filter(|row| row.is_none()).count();
    Ok(Inpainted { filled: missing - unreached.len(), rows, unreached, residual, undershoot })
}

fn check(mesh: &TriangleMesh, given: &[Option<WeightRow>]) -> Result<(), TransferError> {
    let vertices = mesh.vertices.len();
    if given.len() != vertices {
        return Err(TransferError::RowCount { rows: given.len(), vertices });
    }
    let is_bad = |row: &WeightRow| row.is_empty() || !row.iter().all(|(_, w)| w.is_finite() && *w > 0.0);
    match given.iter().position(|row| row.as_ref().is_some_and(is_bad)) {
        Some(vertex) => Err(TransferError::BadRow { vertex }),
        None => Ok(()),
    }
}

/// Which vertices are connected to one with a given row.
fn reached(laplacian: &SparseMatrix, held: &[Option<&WeightRow>]) -> Vec<bool> {
    let mut reached: Vec<bool> = held.iter().map(Option::is_some).collect();
    let mut open: Vec<usize> = (0..held.len()).filter(|&vertex| reached[vertex]).collect();
    while let Some(vertex) = open.pop() {
        let around = laplacian.column(vertex).filter(|(_, conductance)| *conductance > 0.0);
        open.extend(around.map(|(row, _)| row).filter(|&row| !std::mem::replace(&mut reached[row], true)));
    }
    reached
}

/// `Q = m̄ L M⁻¹ L − L` at the free vertices.
struct System {
    matrix: SparseMatrix,
    /// For each bone, what the held vertices pull with.
    pulls: BTreeMap<u16, Vec<f64>>,
}

impl System {
    fn new(laplacian: &SparseMatrix, mass: &[f64], held: &[Option<&WeightRow>], free: &[usize]) -> Self {
        let mut place = vec![usize::MAX; held.len()];
        free.iter().enumerate().for_each(|(k, &vertex)| place[vertex] = k);
        let mean = mass.iter().sum::<f64>() / mass.len().max(1) as f64;
        let mut entries = Vec::new();
        let mut pulls: BTreeMap<u16, Vec<f64>> = BTreeMap::new();
        let mut add = |row: usize, column: usize, value: f64| {
            if place[column] != usize::MAX {
                entries.push((place[row] as u32, place[column] as u32, value));
            } else if let Some(weights) = held[column] {
                for &(bone, weight) in weights {
                    pulls.entry(bone).or_insert_with(|| vec![0.0; free.len()])[place[row]] -= value * weight;
                }
            }
        };
        for &vertex in free {
            laplacian.column(vertex).for_each(|(other, value)| add(vertex, other, -value));
        }
        // Of vertices without area there is only the gradient.
        let stiff = |vertex: usize| if mean > 0.0 { mean / mass[vertex].max(LEAST_MASS * mean) } else { 0.0 };
        for middle in 0..held.len() {
            let around: Vec<(usize, f64)> = laplacian.column(middle).filter(|(_, value)| *value != 0.0).collect();
            for &(row, value) in around.iter().filter(|(row, _)| place[*row] != usize::MAX) {
                around.iter().for_each(|&(column, other)| add(row, column, stiff(middle) * value * other));
            }
        }
        let n = free.len();
        let matrix = SparseMatrix::from_triplets(n, n, &entries).unwrap_or_default();
        Self { matrix, pulls }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet(_: &'static str, _: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// A flat grid of `n` by `n` squares of this size.
    fn grid(n: u32, size: f64) -> TriangleMesh {
        let across = n + 1;
        let vertices = (0..across * across).map(|k| [f64::from(k % across) * size, f64::from(k / across) * size, 0.0]);
        let squares = (0..n * n).map(|k| (k / n) * across + k % n);
        let triangles = squares.flat_map(|v| [[v, v + 1, v + across], [v + 1, v + across + 1, v + across]]);
        TriangleMesh { vertices: vertices.collect(), triangles: triangles.collect() }
    }

    #[test]
    fn a_slope_goes_on_through_a_hole_in_the_weights_in_any_unit() {
        for size in [1e-3, 1.0, 1e3] {
            let mesh = grid(10, size);
            let share = |v: usize| mesh.vertices[v][0] / (10.0 * size);
            let row = |v: usize| match share(v) {
                t if t <= 0.0 => vec![(3, 1.0)],
                t if t >= 1.0 => vec![(5, 1.0)],
                t => vec![(3, 1.0 - t), (5, t)],
            };
            let inside = |v: usize| mesh.vertices[v][..2].iter().all(|c| (2.5 * size..7.5 * size).contains(c));
            let given: Vec<_> = (0..mesh.vertices.len()).map(|v| (!inside(v)).then(|| row(v))).collect();
            let made = inpaint_weights(&mesh, &given, &mut quiet).unwrap();
            assert_eq!((made.filled, made.unreached.len()), (25, 0));
            assert!(made.residual < 1e-9 && made.undershoot <= 0.0, "{} {}", made.residual, made.undershoot);
            for (v, row) in made.rows.iter().enumerate() {
                let of_five = row.iter().find(|(bone, _)| *bone == 5).map_or(0.0, |(_, weight)| *weight);
                assert!((of_five - share(v)).abs() < 1e-9, "vertex {v}: {of_five} instead of {}", share(v));
                assert!((row.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn pieces_without_a_row_are_named_and_seams_are_closed() {
        let mut mesh = grid(2, 1.0);
        let lone = grid(1, 1.0);
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(lone.vertices.iter().map(|p| [p[0] + 9.0, p[1], p[2]]));
        mesh.triangles.extend(lone.triangles.iter().map(|t| t.map(|v| v + first)));
        // The middle vertex once more, for another triangle.
        let again = mesh.vertices.len() as u32;
        mesh.vertices.push(mesh.vertices[4]);
        mesh.triangles[1] = mesh.triangles[1].map(|v| if v == 4 { again } else { v });
        let mut given = vec![None; mesh.vertices.len()];
        given[0] = Some(vec![(7, 1.0)]);
        let made = inpaint_weights(&mesh, &given, &mut quiet).unwrap();
        assert_eq!(made.unreached, [9, 10, 11, 12]);
        assert_eq!(made.filled, 9);
        assert!(made.rows[again as usize] == made.rows[4] && made.rows[4][0].0 == 7);
    }

    #[test]
    fn nonsense_is_named() {
        let mesh = grid(1, 1.0);
        let few = inpaint_weights(&mesh, &[None], &mut quiet);
        assert_eq!(few, Err(TransferError::RowCount { rows: 1, vertices: 4 }));
        for bad in [vec![], vec![(0, f64::NAN)], vec![(0, -1.0)]] {
            let given = [Some(bad), None, None, None];
            assert_eq!(inpaint_weights(&mesh, &given, &mut quiet), Err(TransferError::BadRow { vertex: 0 }));
        }
        let none = inpaint_weights(&mesh, &[None, None, None, None], &mut quiet).unwrap();
        assert_eq!(none.unreached.len(), 4);
        let stopped = inpaint_weights(&mesh, &[None, None, None, None], &mut |_, _| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(TransferError::Cancelled { .. })));
    }
}
