//! Regions of interest: what is within reach along the surface, and the vertices nearest to points.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use armature_geometry::TriangleMesh;
use armature_geometry::surface::{edges, weld_vertices};
use glam::DVec3;

/// Vertices no further than `radius` (mesh unit) from one of `seeds` along edges; ascending. Seams do not stop the way.
///
/// # Panics
/// If a triangle or a seed refers to a vertex that does not exist.
pub fn vertices_within(mesh: &TriangleMesh, seeds: &[u32], radius: f64) -> Vec<u32> {
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let joined: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let count = weld.representative.len();
    let place = |v: u32| DVec3::from(mesh.vertices[weld.representative[v as usize] as usize]);
    let mut ways: Vec<Vec<(u32, f64)>> = vec![Vec::new(); count];
    for edge in edges(&joined) {
        let [a, b] = edge.vertices;
        let length = place(a).distance(place(b));
        ways[a as usize].push((b, length));
        ways[b as usize].push((a, length));
    }
    let mut reach = vec![f64::INFINITY; count];
    // Positive numbers are ordered as their bits are.
    let mut open: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
    for &seed in seeds {
        let seed = weld.welded_of[seed as usize];
        reach[seed as usize] = 0.0;
        open.push(Reverse((0, seed)));
    }
    while let Some(Reverse((bits, vertex))) = open.pop() {
        let here = f64::from_bits(bits);
        if here > reach[vertex as usize] {
            continue;
        }
        for &(other, length) in &ways[vertex as usize] {
            let there = here + length;
            if there <= radius && there < reach[other as usize] {
                reach[other as usize] = there;
                open.push(Reverse((there.to_bits(), other)));
            }
        }
    }
    (0..mesh.vertices.len() as u32).filter(|&v| reach[weld.welded_of[v as usize] as usize] <= radius).collect()
}

/// The vertex nearest to each point, among those in a triangle; `None` without any.
pub fn near_vertices(mesh: &TriangleMesh, points: &[[f64; 3]]) -> Option<Vec<u32>> {
    let mut used = vec![false; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let nearest = |&point: &[f64; 3]| {
        let point = DVec3::from(point);
        let distance = |v: usize| point.distance_squared(DVec3::from(mesh.vertices[v]));
        (0..used.len()).filter(|&v| used[v]).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).map(|v| v as u32)
    };
    points.iter().map(nearest).collect()
}
