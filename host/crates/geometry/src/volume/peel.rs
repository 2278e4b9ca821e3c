//! Flat elements on the boundary of the inside: facets that lie in one plane up to rounding leave them behind.

use glam::DVec3;

use super::elements::Elements;
use super::solid::{pieces, pieces_of, sorted_facets};
use crate::{TetrahedralMesh, connected_components};

/// Elements with a smaller height than this, beside their longest edge, are flat up to rounding.
const FLAT: f64 = 1e-9;
/// The same for elements that no operation on a mesh could make better.
const SLIVER: f64 = 2e-3;

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

/// Takes slivers off a mesh whose boundary may recede by as little as they are high, one layer after the other, as long
/// as each vertex that is `needed` has another element and neither the mesh nor the bones on its vertices (`runs`) fall
/// apart; how many. One flat element is enough to spoil a Hessian with its cotangents.
pub(super) fn peel_slivers(mesh: &mut TetrahedralMesh, needed: &[bool], runs: &[Vec<u32>]) -> usize {
    let facets = sorted_facets(mesh);
    let mut count = vec![0_u32; mesh.vertices.len()];
    mesh.tetrahedra.iter().flatten().for_each(|&v| count[v as usize] += 1);
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); mesh.tetrahedra.len()];
    for pair in facets.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        neighbours[pair[0].1 as usize].push(pair[1].1);
        neighbours[pair[1].1 as usize].push(pair[0].1);
    }
    let mut gone = vec![false; mesh.tetrahedra.len()];
    let mut open: Vec<u32> = (0..mesh.tetrahedra.len() as u32).collect();
    while let Some(element) = open.pop() {
        let element = element as usize;
        let corners = mesh.tetrahedra[element];
        let left = neighbours[element].iter().filter(|&&n| !gone[n as usize]).count();
        let spare =
            corners.iter().all(|&v| count[v as usize] > 1 || !needed.get(v as usize).is_some_and(|&needed| needed));
        if !gone[element] && left < 4 && spare && is_sliver(mesh, corners) {
            gone[element] = true;
            corners.iter().for_each(|&v| count[v as usize] -= 1);
            open.extend(&neighbours[element]);
        }
    }
    let peeled = gone.iter().filter(|gone| **gone).count();
    if peeled == 0 {
        return 0;
    }
    let (_, apart_before) = pieces(mesh, runs);
    let before = Joined::of(mesh);
    let kept = mesh.tetrahedra.iter().zip(&gone).filter(|(_, gone)| !**gone).map(|(t, _)| *t).collect();
    let whole = std::mem::replace(&mut mesh.tetrahedra, kept);
    if mesh.tetrahedra.is_empty()
        || before.kept(&gone).is_split_in(&Joined::of(mesh))
        || pieces(mesh, runs).1 > apart_before
    {
        mesh.tetrahedra = whole;
        return 0;
    }
    peeled
}

/// The piece of every element, joined through facets, and joined through corners.
struct Joined([Vec<u32>; 2]);

impl Joined {
    fn of(mesh: &TetrahedralMesh) -> Self {
        let sides: Vec<[u32; 3]> = mesh.tetrahedra.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, b, d]]).collect();
        let through_corners = connected_components(mesh.vertices.len(), &sides);
        let at = |t: &[u32; 4]| through_corners.of_vertex[t[0] as usize];
        Self([pieces_of(mesh).of_vertex, mesh.tetrahedra.iter().map(at).collect()])
    }

    fn kept(self, gone: &[bool]) -> Self {
        Self(self.0.map(|all| all.into_iter().zip(gone).filter(|(_, gone)| !**gone).map(|(piece, _)| piece).collect()))
    }

    /// Whether elements of one piece lie in several pieces of the other.
    fn is_split_in(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).any(|(own, others)| {
            let mut pairs: Vec<(u32, u32)> = own.iter().copied().zip(others.iter().copied()).collect();
            pairs.sort_unstable();
            pairs.dedup();
            pairs.windows(2).any(|pair| pair[0].0 == pair[1].0)
        })
    }
}

fn is_sliver(mesh: &TetrahedralMesh, corners: [u32; 4]) -> bool {
    let p = corners.map(|v| DVec3::from(mesh.vertices[v as usize]));
    let volume_6 = (p[1] - p[0]).dot((p[2] - p[0]).cross(p[3] - p[0]));
    let doubled = |k: usize| {
        let [a, b, c] = [1, 2, 3].map(|step| p[(k + step) % 4]);
        (b - a).cross(c - a).length()
    };
    volume_6 <= SLIVER * longest(p) * (0..4).map(doubled).fold(0.0, f64::max)
}

fn is_flat(elements: &Elements, element: usize) -> bool {
    let largest = elements.areas[element].iter().fold(0.0, |most: f64, &area| most.max(area));
    3.0 * elements.volumes[element] <= FLAT * longest_edge(elements, element) * largest
}

/// In the mesh's unit.
pub(super) fn longest_edge(elements: &Elements, element: usize) -> f64 {
    longest(elements.tetrahedra[element].map(|v| DVec3::from(elements.vertices[v as usize])))
}

fn longest(p: [DVec3; 4]) -> f64 {
    (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max)
}
