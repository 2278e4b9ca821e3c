//! Cutting a region along a curve, so that its two sides have tangents of their own.

use std::collections::{HashMap, HashSet};

/// A curve along which a displacement may have a crease.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SharpCurve {
    /// Vertices of the mesh, all of them handles. With slopes, each has an edge to the next, and a closed curve ends where it
    /// starts.
    pub vertices: Vec<u32>,
    /// How the displacement changes with each unit of length away from the curve, to its left and to its right, as seen from
    /// outside along the curve. Without them, its Laplacian is zero at the curve, and the slopes are what follows.
    pub slopes: Option<[[f64; 3]; 2]>,
}

/// A region cut along a curve.
#[derive(Debug)]
pub(super) struct Cut {
    /// Vertices that there are twice now; their copies, to the right of the curve, are numbered on from the last vertex.
    pub(super) doubled: Vec<u32>,
    /// Edges along the curve, as the triangles to its left run, and to its right.
    pub(super) sides: [Vec<[u32; 2]>; 2],
}

/// Cuts triangles over `count` vertices along a path; `Err` has two vertices of it without an edge, or one twice.
pub(super) fn cut(triangles: &mut [[u32; 3]], count: usize, path: &[u32]) -> Result<Cut, [u32; 2]> {
    let mut apex_of: HashMap<[u32; 2], (usize, u32)> = HashMap::new();
    for (index, &[a, b, c]) in triangles.iter().enumerate() {
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            apex_of.insert([from, to], (index, apex));
        }
    }
    let closed = path.len() > 3 && path.first() == path.last();
    let once = if closed { &path[1..] } else { path };
    let mut seen = HashSet::new();
    if let Some(&twice) = once.iter().find(|v| !seen.insert(**v)) {
        return Err([twice, twice]);
    }
    let has_edge = |&[a, b]: &[u32; 2]| apex_of.contains_key(&[a, b]) || apex_of.contains_key(&[b, a]);
    let edges: Vec<[u32; 2]> = path.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    if let Some(&missing) = edges.iter().find(|edge| !has_edge(edge)) {
        return Err(missing);
    }
    let mut corners: Vec<[u32; 3]> = path.windows(3).map(|w| [w[0], w[1], w[2]]).collect();
    if closed {
        corners.push([path[path.len() - 2], path[0], path[1]]);
    }
    let mut copies: HashMap<u32, u32> = HashMap::new();
    let mut left: HashSet<(usize, u32)> = HashSet::new();
    for (k, &[before, vertex, after]) in corners.iter().enumerate() {
        copies.insert(vertex, (count + k) as u32);
        // From the edge ahead to the left, and from the edge behind to the right, until they meet or the mesh ends.
        let mut spoke = after;
        while let Some(&(triangle, apex)) = apex_of.get(&[vertex, spoke]) {
            if !left.insert((triangle, vertex)) || apex == before {
                break;
            }
            spoke = apex;
        }
        let mut spoke = before;
        while let Some(&(triangle, apex)) = apex_of.get(&[spoke, vertex]) {
            if !left.insert((triangle, vertex)) || apex == after {
                break;
            }
            spoke = apex;
        }
    }
    for (index, triangle) in triangles.iter_mut().enumerate() {
        for vertex in triangle {
            if let Some(&copy) = copies.get(vertex).filter(|_| !left.contains(&(index, *vertex))) {
                *vertex = copy;
            }
        }
    }
    let copy = |v: u32| copies.get(&v).copied().unwrap_or(v);
    let on_left = edges.iter().copied().filter(|edge| apex_of.contains_key(edge)).collect();
    let turned = edges.iter().map(|&[a, b]| [b, a]).filter(|edge| apex_of.contains_key(edge));
    let on_right = turned.map(|edge| edge.map(copy)).collect();
    Ok(Cut { doubled: corners.iter().map(|corner| corner[1]).collect(), sides: [on_left, on_right] })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hexagon's fan around vertex 0.
    fn fan() -> Vec<[u32; 3]> {
        (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect()
    }

    #[test]
    fn the_left_side_keeps_its_vertices() {
        let mut triangles = fan();
        let cut = cut(&mut triangles, 7, &[1, 0, 4]).unwrap();
        assert_eq!(cut.doubled, [0]);
        // Vertices 1 to 6 run counter-clockwise: from 1 to 4, the left has 4, 5, 6 and 1.
        let expected = [[7, 1, 2], [7, 2, 3], [7, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 1]];
        assert_eq!(triangles, expected);
        assert_eq!(cut.sides, [vec![[1, 0], [0, 4]], vec![[7, 1], [4, 7]]]);
    }

    #[test]
    fn what_is_no_curve_is_named() {
        assert_eq!(cut(&mut fan(), 7, &[1, 3, 0]).unwrap_err(), [1, 3]);
        assert_eq!(cut(&mut fan(), 7, &[1, 0, 4, 0]).unwrap_err(), [0, 0]);
    }
}
