//! Flat elements on the boundary of the inside, left behind by facets that are in one plane up to rounding.

use super::elements::Elements;
use crate::vectors::{longest_edge, places};

/// Elements with a smaller height than this, relative to their longest edge, are flat up to rounding.
const FLAT: f64 = 1e-9;

/// Labels flat elements at the boundary as outside, layer by layer, as long as each of their `needed` vertices has
/// another inside element; returns how many.
pub(super) fn peel(elements: &Elements, needed: &[bool], labels: &mut [bool]) -> usize {
    let mut count = vec![0_u32; elements.vertices.len()];
    let inside = elements.tetrahedra.iter().zip(labels.iter()).filter(|(_, inside)| **inside);
    inside.flat_map(|(corners, _)| corners).for_each(|&v| count[v as usize] += 1);
    let mut open: Vec<u32> = (0..labels.len() as u32).collect();
    let mut peeled = 0;
    while let Some(element) = open.pop() {
        let element = element as usize;
        let corners = elements.tetrahedra[element];
        let is_outside = |&n: &u32| !labels.get(n as usize).is_some_and(|&inside| inside);
        let on_boundary = elements.neighbours[element].iter().any(is_outside);
        let spare = corners.iter().all(|&v| !needed[v as usize] || count[v as usize] > 1);
        if labels[element] && on_boundary && spare && is_flat(elements, element) {
            labels[element] = false;
            corners.iter().for_each(|&v| count[v as usize] -= 1);
            peeled += 1;
            open.extend(elements.neighbours[element].iter().filter(|&&n| n != u32::MAX));
        }
    }
    peeled
}

/// Whether an element is flat up to rounding.
pub(super) fn is_flat(elements: &Elements, element: usize) -> bool {
    let largest = elements.areas[element].iter().fold(0.0, |most: f64, &area| most.max(area));
    3.0 * elements.volumes[element] <= FLAT * longest_edge_of(elements, element) * largest
}

/// In the mesh's unit.
pub(super) fn longest_edge_of(elements: &Elements, element: usize) -> f64 {
    longest_edge(places(&elements.vertices, elements.tetrahedra[element]))
}
