//! Flat elements on the boundary of the inside: facets that lie in one plane up to rounding leave them behind.

use glam::DVec3;

use super::elements::Elements;

/// Elements with a smaller height than this, beside their longest edge, are flat up to rounding.
const FLAT: f64 = 1e-9;

/// Labels flat elements at the boundary outside, one layer after the other, as long as each of their vertices has
/// another element inside; how many.
pub(super) fn peel(elements: &Elements, labels: &mut [bool]) -> usize {
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
        let spare = corners.iter().all(|&v| count[v as usize] > 1);
        if labels[element] && on_boundary && spare && is_flat(elements, element) {
            labels[element] = false;
            corners.iter().for_each(|&v| count[v as usize] -= 1);
            peeled += 1;
            open.extend(elements.neighbours[element].iter().filter(|&&n| n != u32::MAX));
        }
    }
    peeled
}

fn is_flat(elements: &Elements, element: usize) -> bool {
    let largest = elements.areas[element].iter().fold(0.0, |most: f64, &area| most.max(area));
    3.0 * elements.volumes[element] <= FLAT * longest_edge(elements, element) * largest
}

/// In the mesh's unit.
pub(super) fn longest_edge(elements: &Elements, element: usize) -> f64 {
    longest(elements.tetrahedra[element].map(|v| DVec3::from(elements.vertices[v as usize])))
}

/// The longest edge of a tetrahedron.
pub(super) fn longest(p: [DVec3; 4]) -> f64 {
    (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max)
}
