//! The unknowns near one of many handles, so that the cost of its weights depends on what it affects rather than on the
//! size of the mesh.
//!
//! Weights that are zero outside a neighbourhood are optimal on the whole mesh if they are optimal within it and no
//! multiplier outside has the wrong sign. A row of the bi-Laplacian reaches two rings; beyond the rows of all nonzero
//! unknowns the gradient is exactly zero, and there is nothing to check. So a neighbourhood holds these rows, plus one
//! more row around each to grow into before it has to be rebuilt.

use std::collections::VecDeque;

use armature_geometry::operators::SparseMatrix;

use super::energy::BiharmonicEnergy;
use crate::sparse::symmetric::Symmetric;

/// A vertex is guessed to follow a handle that is at most this many rings farther away than the nearest one. Tuned on
/// 300 and 1000 points in the elephant: 0 and 2 both take a tenth longer.
const SLACK: u32 = 1;

/// Rows included around what may be free.
const ROWS: usize = 2;

/// Unknowns near a handle.
pub(crate) struct Neighbourhood {
    /// Position of each among all unknowns, ascending.
    pub(crate) places: Vec<u32>,
    /// Their rows and columns of the Hessian.
    pub(crate) hessian: Symmetric,
    /// Whether an unknown's row is incomplete.
    pub(crate) rim: Vec<bool>,
}

impl Neighbourhood {
    /// The unknowns within two rows of the Hessian from `start` (positions among all unknowns).
    pub(crate) fn around(energy: &BiharmonicEnergy, start: impl Iterator<Item = u32>) -> Self {
        let mut inside = vec![false; energy.len()];
        let mut places: Vec<u32> = start.filter(|&k| !std::mem::replace(&mut inside[k as usize], true)).collect();
        let mut from = 0;
        for _ in 0..ROWS {
            let to = places.len();
            for at in from..to {
                for (row, _) in energy.hessian.column(places[at] as usize) {
                    if !std::mem::replace(&mut inside[row], true) {
                        places.push(row as u32);
                    }
                }
            }
            from = to;
        }
        places.sort_unstable();
        let (hessian, whole) = energy.hessian.at(&places);
        Self { places, hessian, rim: whole.into_iter().map(|whole| !whole).collect() }
    }
}

/// How many rings each vertex is from the nearest of `fixed`.
pub(crate) fn rings_from(laplacian: &SparseMatrix, fixed: &[usize]) -> Vec<u32> {
    let mut rings = vec![u32::MAX; laplacian.columns()];
    spread(laplacian, fixed, &mut rings, |_, _| true);
    rings
}

/// Positions of the unknowns that may follow the handle that holds `own`; `rings` as from [`rings_from`].
pub(crate) fn likely_support(
    laplacian: &SparseMatrix,
    energy: &BiharmonicEnergy,
    rings: &[u32],
    own: &[usize],
) -> Vec<u32> {
    let mut near = vec![u32::MAX; rings.len()];
    let met = spread(laplacian, own, &mut near, |vertex, ring| ring <= rings[vertex].saturating_add(SLACK));
    met.into_iter().filter_map(|vertex| energy.position(vertex)).collect()
}

/// Breadth first from `start` over vertices that `enter` admits at that many rings; returns the vertices visited.
fn spread(
    laplacian: &SparseMatrix,
    start: &[usize],
    rings: &mut [u32],
    enter: impl Fn(usize, u32) -> bool,
) -> Vec<usize> {
    let mut met = start.to_vec();
    met.iter().for_each(|&vertex| rings[vertex] = 0);
    let mut open: VecDeque<usize> = met.iter().copied().collect();
    while let Some(vertex) = open.pop_front() {
        let ring = rings[vertex] + 1;
        for (neighbour, value) in laplacian.column(vertex) {
            if value != 0.0 && rings[neighbour] == u32::MAX && enter(neighbour, ring) {
                rings[neighbour] = ring;
                met.push(neighbour);
                open.push_back(neighbour);
            }
        }
    }
    met
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(n: u32) -> SparseMatrix {
        let mut triplets = Vec::new();
        for i in 1..n {
            triplets.extend([(i, i, -1.0), (i - 1, i - 1, -1.0), (i, i - 1, 1.0), (i - 1, i, 1.0)]);
        }
        SparseMatrix::from_triplets(n as usize, n as usize, &triplets).unwrap()
    }

    #[test]
    fn holds_two_rows_and_tells_its_rim() {
        let (laplacian, fixed) = (chain(30), [0, 14, 29]);
        let energy = BiharmonicEnergy::new(&laplacian, &[1.0; 30], None, &fixed, &[true; 30]).unwrap();
        let rings = rings_from(&laplacian, &fixed);
        assert_eq!((rings[7], rings[8], rings[28]), (7, 6, 1));
        let vertices = |places: &[u32]| {
            let mut vertices: Vec<u32> = places.iter().map(|&k| energy.unknowns[k as usize]).collect();
            vertices.sort_unstable();
            vertices
        };
        let support = likely_support(&laplacian, &energy, &rings, &fixed[2..]);
        assert_eq!(vertices(&support), (21..=28).collect::<Vec<u32>>());
        let near = Neighbourhood::around(&energy, support.into_iter());
        assert_eq!(vertices(&near.places), (17..=28).collect::<Vec<u32>>(), "a row reaches two rings");
        let rim: Vec<u32> = near.places.iter().zip(&near.rim).filter(|(_, rim)| **rim).map(|(&k, _)| k).collect();
        assert_eq!(vertices(&rim), [17, 18]);
    }
}
