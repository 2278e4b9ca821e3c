//! The rims of holes, traced along edges with one triangle.

use std::collections::{BTreeMap, BTreeSet};

use armature_geometry::surface::{connected_components, edges};
use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;

use super::hole::{BrokenRim, Hole, Holes};
use super::meant::decide;
use super::welded::Welded;

/// Finds all holes. Vertices at exactly one place count as one, so that seams of texture coordinates are no holes.
pub fn find_holes(mesh: &TriangleMesh) -> Result<Holes, MeshError> {
    let welded = Welded::of(mesh)?;
    let (loops, chains) = trace(&welded.triangles);
    let mut visits: BTreeMap<u32, usize> = BTreeMap::new();
    loops.iter().flatten().for_each(|&v| *visits.entry(v).or_default() += 1);
    let original = |list: &[u32]| list.iter().map(|&v| welded.original[v as usize]).collect::<Vec<u32>>();
    let describe = |rim: &Vec<u32>| {
        let at = |k: usize| welded.positions[rim[k % rim.len()] as usize];
        let touches: Vec<u32> = rim.iter().copied().filter(|v| visits[v] > 1).collect();
        Hole {
            length: (0..rim.len()).map(|k| at(k).distance(at(k + 1))).sum(),
            centre: (rim.iter().map(|&v| welded.positions[v as usize]).sum::<DVec3>() / rim.len() as f64).to_array(),
            touches: original(&touches),
            rim: original(rim),
            meant: None,
        }
    };
    let mut found: Vec<(Hole, u32)> = loops.iter().map(|rim| (describe(rim), rim[0])).collect();
    found.sort_by(|(a, _), (b, _)| b.length.total_cmp(&a.length).then(a.rim.cmp(&b.rim)));
    let components = connected_components(welded.positions.len(), &welded.triangles);
    let part_of: Vec<u32> = found.iter().map(|&(_, v)| components.of_vertex[v as usize]).collect();
    let mut holes: Vec<Hole> = found.into_iter().map(|(hole, _)| hole).collect();
    let meant = decide(&welded, &components, &holes, &part_of);
    holes.iter_mut().zip(meant).for_each(|(hole, meant)| hole.meant = meant);
    Ok(Holes { holes, broken: chains.iter().map(|c| BrokenRim { vertices: original(c) }).collect() })
}

/// Simple closed loops, and what is left over.
fn trace(triangles: &[[u32; 3]]) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
    let rim: BTreeSet<[u32; 2]> = edges(triangles).iter().filter(|e| e.triangles == 1).map(|e| e.vertices).collect();
    // Along the hole, against the triangle.
    let mut ahead: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if rim.contains(&[from.min(to), from.max(to)]) {
                ahead.entry(to).or_default().push(from);
            }
        }
    }
    ahead.values_mut().for_each(|list| list.sort_unstable_by(|a, b| b.cmp(a)));
    let (mut loops, mut chains) = (Vec::new(), Vec::new());
    let starts: Vec<u32> = ahead.keys().copied().collect();
    for start in starts {
        while ahead.get(&start).is_some_and(|list| !list.is_empty()) {
            let mut path = vec![start];
            let mut place: BTreeMap<u32, usize> = BTreeMap::from([(start, 0)]);
            while let Some(next) = path.last().and_then(|v| ahead.get_mut(v)).and_then(Vec::pop) {
                if let Some(&at) = place.get(&next) {
                    // Where holes touch, a loop closes before the path is back at its start.
                    let closed = path.split_off(at + 1);
                    closed.iter().for_each(|v| {
                        place.remove(v);
                    });
                    loops.push(std::iter::once(next).chain(closed).collect());
                } else {
                    place.insert(next, path.len());
                    path.push(next);
                }
            }
            if path.len() > 1 {
                chains.push(path);
            }
        }
    }
    // Two edges between the same vertices enclose nothing.
    loops.retain(|rim: &Vec<u32>| rim.len() >= 3);
    (loops, chains)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rims_run_as_their_filling_does() {
        // A tetrahedron without its last face [1, 2, 3].
        let (loops, chains) = trace(&[[0, 2, 1], [0, 1, 3], [0, 3, 2]]);
        assert_eq!((loops, chains), (vec![vec![1, 2, 3]], vec![]));
    }

    #[test]
    fn holes_that_touch_are_told_apart() {
        // Two triangles that share a corner are two sheets; their rims are two loops through that corner.
        let (mut loops, chains) = trace(&[[0, 1, 2], [0, 3, 4]]);
        loops.sort();
        assert_eq!(loops.len(), 2);
        assert!(loops.iter().all(|rim| rim.len() == 3) && chains.is_empty(), "{loops:?}");
    }

    #[test]
    fn a_rim_that_meets_three_triangles_is_broken() {
        let (loops, chains) = trace(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert!(!chains.is_empty(), "{loops:?}");
        assert!(loops.iter().all(|rim| rim.len() >= 3));
    }
}
