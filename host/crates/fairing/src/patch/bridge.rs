//! From rims to the first triangles of a patch: long rims are thinned out, several are joined by bridges into one polygon,
//! the polygon is cut into triangles, and what was thinned out comes back.

use glam::DVec3;

use super::triangulate::{Polygon, Side, triangulate};

/// Corners of the polygon that is cut exactly; the work grows with the third power.
const CORNERS: usize = 160;

/// A rim, and what is beyond each of its edges.
#[derive(Clone, Debug)]
pub(crate) struct Rim {
    pub(crate) vertices: Vec<u32>,
    /// Unit normals of the surface beyond the edge that starts at each vertex.
    pub(crate) beyond: Vec<Option<DVec3>>,
}

/// Triangles over the rims' vertices; `None` if there are none without a forbidden edge.
pub(super) fn first_triangles(
    rims: &[Rim],
    place: impl Fn(u32) -> DVec3,
    forbidden: impl Fn(u32, u32) -> bool,
) -> Option<Vec<[u32; 3]>> {
    let total: usize = rims.iter().map(|rim| rim.vertices.len()).sum();
    let mut walks: Vec<Vec<Corner>> = Vec::new();
    for (index, rim) in rims.iter().enumerate() {
        let count = rim.vertices.len();
        let kept = if total <= CORNERS { count } else { (count * CORNERS / total).max(3).min(count) };
        let picks: Vec<usize> = (0..kept).map(|k| k * count / kept).collect();
        let corner = |k: usize| {
            let (from, to) = (picks[k], if k + 1 < kept { picks[k + 1] } else { count });
            Corner {
                vertex: rim.vertices[from],
                rim: index as u32,
                chain: (from..=to).map(|v| rim.vertices[v % count]).collect(),
                beyond: mean_normal(&rim.beyond[from..to]),
            }
        };
        walks.push((0..kept).map(corner).collect());
    }
    let walk = join(walks, &place)?;
    let polygon = Polygon {
        places: walk.iter().map(|c| place(c.vertex)).collect(),
        vertices: walk.iter().map(|c| c.vertex).collect(),
        rims: walk.iter().map(|c| c.rim).collect(),
        sides: walk.iter().map(|c| Side { beyond: c.beyond }).collect(),
    };
    let cut = triangulate(&polygon, |a, b| forbidden(a, b) && total <= CORNERS)?;
    let count = walk.len();
    let chain = |from: usize, to: usize| -> Vec<u32> {
        let next = (from + 1) % count;
        if next == to { walk[from].chain.clone() } else { vec![walk[from].vertex, walk[to].vertex] }
    };
    let mut triangles = Vec::new();
    for [i, j, k] in cut {
        restore([chain(i, j), chain(j, k), chain(k, i)], &place, &mut triangles);
    }
    Some(triangles)
}

#[derive(Clone)]
struct Corner {
    vertex: u32,
    rim: u32,
    /// The vertices up to the next corner, both included.
    chain: Vec<u32>,
    beyond: Option<DVec3>,
}

fn mean_normal(normals: &[Option<DVec3>]) -> Option<DVec3> {
    let sum: DVec3 = normals.iter().flatten().sum();
    (sum.length() > 1e-9).then(|| sum.normalize())
}

/// One walk through all rims, which crosses each bridge there and back. Bridges are short.
fn join(mut walks: Vec<Vec<Corner>>, place: &impl Fn(u32) -> DVec3) -> Option<Vec<Corner>> {
    if walks.is_empty() {
        return None;
    }
    let mut walk = walks.remove(0);
    while !walks.is_empty() {
        let mut best = (f64::INFINITY, 0, 0, 0);
        for (which, other) in walks.iter().enumerate() {
            for (to, there) in other.iter().enumerate() {
                for (from, here) in walk.iter().enumerate() {
                    let distance = place(here.vertex).distance(place(there.vertex));
                    if distance < best.0 {
                        best = (distance, which, from, to);
                    }
                }
            }
        }
        let (_, which, from, to) = best;
        let mut other = walks.remove(which);
        other.rotate_left(to);
        let (here, there) = (walk[from].clone(), other[0].clone());
        let bridge = |a: &Corner, b: &Corner| Corner { chain: vec![a.vertex, b.vertex], beyond: None, ..a.clone() };
        let mut piece = vec![bridge(&here, &there)];
        piece.extend(other);
        piece.push(bridge(&there, &here));
        // The walk goes over the bridge, around, back, and on as it would have gone from here.
        walk.splice(from..from, piece);
    }
    Some(walk)
}

/// Triangles of a triangle whose sides may be chains.
fn restore([ab, bc, ca]: [Vec<u32>; 3], place: &impl Fn(u32) -> DVec3, triangles: &mut Vec<[u32; 3]>) {
    // A ladder between the two sides with most vertices, from the tip where they meet to the third.
    let sides = [ab, bc, ca];
    let shortest = (0..3).min_by_key(|&k| sides[k].len()).unwrap_or(0);
    // Both lead away from the tip.
    let (base, right, left) = (&sides[shortest], &sides[(shortest + 2) % 3], &sides[(shortest + 1) % 3]);
    let left: Vec<u32> = left.iter().rev().copied().collect();
    triangles.push([left[1], left[0], right[1]]);
    let (mut i, mut j) = (1, 1);
    while i + 1 < left.len() || j + 1 < right.len() {
        let next_left = (i + 1 < left.len()).then(|| place(left[i + 1]).distance(place(right[j])));
        let next_right = (j + 1 < right.len()).then(|| place(right[j + 1]).distance(place(left[i])));
        let go_left = match (next_left, next_right) {
            (Some(l), Some(r)) => l <= r,
            (l, _) => l.is_some(),
        };
        let rung = [left[i], right[j]];
        let new = if go_left {
            i += 1;
            left[i]
        } else {
            j += 1;
            right[j]
        };
        triangles.push([rung[0], rung[1], new]);
    }
    // A base that is a chain too is fanned from the left side's end.
    if base.len() > 2 {
        let (from, to) = (base[0], base[base.len() - 1]);
        if let Some(last) = triangles.iter_mut().rev().find(|t| t.contains(&from) && t.contains(&to)) {
            let apex = last.iter().copied().find(|&v| v != from && v != to).unwrap_or(from);
            *last = [base[0], base[1], apex];
            triangles.extend((1..base.len() - 1).map(|k| [base[k], base[k + 1], apex]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(count: usize, radius: f64, z: f64, turned: bool, first: u32) -> (Rim, Vec<DVec3>) {
        let angle = |k: usize| std::f64::consts::TAU * k as f64 / count as f64 * if turned { -1.0 } else { 1.0 };
        let places = (0..count).map(|k| DVec3::new(radius * angle(k).cos(), radius * angle(k).sin(), z)).collect();
        (Rim { vertices: (first..first + count as u32).collect(), beyond: vec![None; count] }, places)
    }

    fn boundary(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
        let sides: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        let mut open: Vec<[u32; 2]> = sides.iter().copied().filter(|&[a, b]| !sides.contains(&[b, a])).collect();
        open.sort_unstable();
        open
    }

    #[test]
    fn long_rims_keep_every_edge() {
        let (rim, places) = circle(500, 1.0, 0.0, false, 0);
        let triangles = first_triangles(&[rim], |v| places[v as usize], |_, _| false).unwrap();
        assert_eq!(triangles.len(), 498);
        assert_eq!(boundary(&triangles), (0..500).map(|k| [k, (k + 1) % 500]).collect::<Vec<_>>());
    }

    #[test]
    fn rims_far_apart_are_joined_by_a_tube() {
        for count in [12, 300] {
            let (below, mut places) = circle(count, 1.0, 0.0, false, 0);
            let (above, more) = circle(count, 1.0, 9.0, true, count as u32);
            places.extend(more);
            let triangles = first_triangles(&[below, above], |v| places[v as usize], |_, _| false).unwrap();
            // An annulus without inner vertices has as many triangles as border edges.
            assert_eq!(triangles.len(), 2 * count);
            assert_eq!(boundary(&triangles).len(), 2 * count);
        }
    }
}
