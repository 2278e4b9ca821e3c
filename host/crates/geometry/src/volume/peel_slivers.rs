//! Slivers on the boundary of a mesh that no operation could improve.

use std::collections::{BTreeMap, BTreeSet};

use crate::TetrahedralMesh;
use crate::facets::neighbour_pairs;
use crate::surface::connected_components;
use crate::vectors::{is_flatter, places};

/// Elements with a smaller height than this, relative to their longest edge, are slivers.
const SLIVER: f64 = 2e-3;

/// Removes slivers from a mesh whose boundary may recede by their small height, layer by layer; returns how many. Each
/// `needed` vertex keeps an element of every piece it is in, and whatever is connected, through facets or only through
/// corners, stays connected: slivers that are the only connection are kept. A single flat element is enough to spoil a
/// Hessian with its cotangents.
pub(super) fn peel_slivers(mesh: &mut TetrahedralMesh, needed: &[bool]) -> usize {
    let slivers: Vec<bool> = mesh.tetrahedra.iter().map(|&corners| is_sliver(mesh, corners)).collect();
    if !slivers.contains(&true) {
        return 0;
    }
    let neighbours = neighbour_pairs(&mesh.tetrahedra);
    let whole = Pieces::of(mesh, &neighbours, |_| true);
    let mut gone = peel(mesh, &slivers, needed, &neighbours, &whole);
    let kept = Pieces::of(mesh, &neighbours, |element| !gone[element]);
    put_joints_back(mesh, &neighbours, &whole, &kept, &mut gone);
    let peeled = gone.iter().filter(|gone| **gone).count();
    if peeled == mesh.tetrahedra.len() {
        return 0;
    }
    let mut element = 0..gone.len();
    mesh.tetrahedra.retain(|_| element.next().is_none_or(|element| !gone[element]));
    peeled
}

/// Connected pieces.
struct Pieces {
    /// The piece of every element, joined through facets.
    of_element: Vec<u32>,
    /// The piece of every vertex, joined through elements that share a corner.
    of_vertex: Vec<u32>,
}

impl Pieces {
    fn of(mesh: &TetrahedralMesh, neighbours: &[[u32; 2]], there: impl Fn(usize) -> bool) -> Self {
        let both = neighbours.iter().filter(|pair| pair.iter().all(|&element| there(element as usize)));
        let joined: Vec<[u32; 3]> = both.map(|&[a, b]| [a, b, b]).collect();
        let elements = mesh.tetrahedra.iter().enumerate().filter(|(element, _)| there(*element));
        let sides: Vec<[u32; 3]> = elements.flat_map(|(_, &[a, b, c, d])| [[a, b, c], [a, b, d]]).collect();
        Self {
            of_element: connected_components(mesh.tetrahedra.len(), &joined).of_vertex,
            of_vertex: connected_components(mesh.vertices.len(), &sides).of_vertex,
        }
    }
}

/// Which slivers go if only vertices are needed.
fn peel(
    mesh: &TetrahedralMesh,
    slivers: &[bool],
    needed: &[bool],
    neighbours: &[[u32; 2]],
    whole: &Pieces,
) -> Vec<bool> {
    let is_needed = |v: &u32| needed.get(*v as usize).is_some_and(|&needed| needed);
    // Elements at each needed vertex, by the vertex and their piece.
    let mut at: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (corners, &piece) in mesh.tetrahedra.iter().zip(&whole.of_element) {
        corners.iter().filter(|v| is_needed(v)).for_each(|&v| *at.entry((v, piece)).or_default() += 1);
    }
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); mesh.tetrahedra.len()];
    for &[a, b] in neighbours {
        around[a as usize].push(b);
        around[b as usize].push(a);
    }
    let mut gone = vec![false; mesh.tetrahedra.len()];
    let mut open: Vec<usize> = (0..mesh.tetrahedra.len()).filter(|&element| slivers[element]).collect();
    while let Some(element) = open.pop() {
        let keys = mesh.tetrahedra[element].map(|v| (v, whole.of_element[element]));
        let on_boundary = around[element].iter().filter(|&&n| !gone[n as usize]).count() < 4;
        let spare = keys.iter().all(|key| at.get(key).is_none_or(|&count| count > 1));
        if slivers[element] && !gone[element] && on_boundary && spare {
            gone[element] = true;
            for key in keys {
                at.entry(key).and_modify(|count| *count -= 1);
            }
            open.extend(around[element].iter().map(|&n| n as usize));
        }
    }
    gone
}

/// Restores the groups of slivers without which pieces of the whole would fall apart: any path from one kept element to
/// another runs through such groups and kept pieces in turn.
fn put_joints_back(mesh: &TetrahedralMesh, neighbours: &[[u32; 2]], whole: &Pieces, kept: &Pieces, gone: &mut [bool]) {
    let groups = Pieces::of(mesh, neighbours, |element| gone[element]);
    // A group, a piece of the whole that it is in, and a piece of what is kept that it touches there.
    let mut touched: Vec<[u32; 3]> = Vec::new();
    for &[a, b] in neighbours {
        for (out, stays) in [(a as usize, b as usize), (b as usize, a as usize)] {
            if gone[out] && !gone[stays] {
                touched.push([groups.of_element[out], whole.of_element[out], kept.of_element[stays]]);
            }
        }
    }
    let through_facets = joining(touched);
    let mut is_kept = vec![false; mesh.vertices.len()];
    let elements = || mesh.tetrahedra.iter().zip(gone.iter());
    elements().filter(|(_, gone)| !**gone).flat_map(|(corners, _)| corners).for_each(|&v| is_kept[v as usize] = true);
    let corners = elements().filter(|(_, gone)| **gone).flat_map(|(corners, _)| corners);
    let touched = corners.filter(|&&v| is_kept[v as usize]).map(|&v| v as usize);
    let through_corners = joining(touched.map(|v| [groups.of_vertex[v], 0, kept.of_vertex[v]]).collect());
    for (element, gone) in gone.iter_mut().enumerate().filter(|(_, gone)| **gone) {
        *gone = !(through_facets.contains(&groups.of_element[element])
            || through_corners.contains(&groups.of_vertex[mesh.tetrahedra[element][0] as usize]));
    }
}

/// Groups that touch two kept pieces within one piece of the whole.
fn joining(mut touched: Vec<[u32; 3]>) -> BTreeSet<u32> {
    touched.sort_unstable();
    touched.dedup();
    touched.windows(2).filter(|pair| pair[0][..2] == pair[1][..2]).map(|pair| pair[0][0]).collect()
}

fn is_sliver(mesh: &TetrahedralMesh, corners: [u32; 4]) -> bool {
    is_flatter(places(&mesh.vertices, corners), SLIVER)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two thick elements that share an edge and the flat one between them, and a flat one on the second's far side.
    fn chain() -> TetrahedralMesh {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 1e-4],
            [0.0, 1.0, 0.0],
            [1.0, 0.2, 1.0],
            [0.2, 1.0, -1.0],
            [0.9, 1.0001, -0.9],
        ];
        let tetrahedra = vec![[0, 1, 2, 4], [0, 3, 2, 5], [0, 1, 3, 2], [3, 2, 5, 6]];
        TetrahedralMesh { vertices, tetrahedra }
    }

    fn peeled(mesh: &TetrahedralMesh, needed: &[u32]) -> Vec<[u32; 4]> {
        let mut mesh = mesh.clone();
        let needed: Vec<bool> = (0..mesh.vertices.len() as u32).map(|v| needed.contains(&v)).collect();
        let before = mesh.tetrahedra.len();
        let count = peel_slivers(&mut mesh, &needed);
        assert_eq!(count, before - mesh.tetrahedra.len());
        mesh.tetrahedra
    }

    #[test]
    fn a_sliver_that_joins_two_parts_stays_and_its_like_goes() {
        let mesh = chain();
        let slivers: Vec<bool> = mesh.tetrahedra.iter().map(|&t| is_sliver(&mesh, t)).collect();
        assert_eq!(slivers, [false, false, true, true]);
        assert_eq!(peeled(&mesh, &[]), mesh.tetrahedra[..3]);
        assert_eq!(peeled(&mesh, &[6]), mesh.tetrahedra, "vertex 6 has no other element");
        // Without the first thick element the sliver joins nothing.
        let end = TetrahedralMesh { tetrahedra: mesh.tetrahedra[1..].to_vec(), ..mesh.clone() };
        assert_eq!(peeled(&end, &[]), mesh.tetrahedra[1..2]);
        // Nothing but slivers stays as it is.
        let flat = TetrahedralMesh { tetrahedra: mesh.tetrahedra[2..3].to_vec(), ..mesh };
        assert_eq!(peeled(&flat, &[]), flat.tetrahedra);
    }

    #[test]
    fn a_sliver_that_joins_through_a_corner_stays() {
        let mut mesh = chain();
        // A thick element that hangs on the second sliver's far corner alone.
        mesh.vertices.extend([[0.2, 2.0, -2.0], [1.2, 2.0, -2.0], [0.2, 2.0, -3.0]]);
        mesh.tetrahedra.push([6, 7, 8, 9]);
        assert_eq!(peeled(&mesh, &[]), mesh.tetrahedra);
    }

    #[test]
    fn a_vertex_stays_in_the_piece_of_its_bone() {
        let mut mesh = chain();
        // Another element at the second sliver's far corner is joined to the others through corners alone.
        mesh.vertices.extend([[0.5, 2.0, -1.0], [1.2, 2.0, -1.5]]);
        mesh.tetrahedra.push([6, 5, 7, 8]);
        assert_eq!(peeled(&mesh, &[]).len(), 4, "vertex 5 joins it without the sliver");
        assert_eq!(peeled(&mesh, &[6]), mesh.tetrahedra);
    }
}
