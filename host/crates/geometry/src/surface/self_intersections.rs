//! Pairs of triangles that meet where they should not.

use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::weld::weld_vertices;
use crate::search::TriangleHierarchy;
use crate::{MeshError, TriangleMesh};

/// Triangles checked between two progress reports.
const CHUNK: usize = 1024;
/// Pairs tested before giving up; a mesh of a million triangles with occasional intersections needs fewer.
const ENOUGH: usize = 20_000_000;

/// Which triangles meet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SelfIntersections {
    /// Pairs of zero-based triangles, the smaller first, ascending.
    pub pairs: Vec<[u32; 2]>,
    /// False if so many triangles are on top of each other that the search was cut short: there are more pairs.
    pub complete: bool,
}

/// Pairs of triangles that meet anywhere except in the corners and edges they share, after merging vertices at exactly
/// the same place. Touching counts; signs are exact. Triangles without area are skipped, and so are pairs on the same
/// three corners, which are duplicates.
pub fn self_intersections(mesh: &TriangleMesh) -> Result<SelfIntersections, MeshError> {
    search(mesh, ENOUGH)
}

fn search(mesh: &TriangleMesh, enough: usize) -> Result<SelfIntersections, MeshError> {
    let enough_for_one = enough / CHUNK;
    let boxes = TriangleHierarchy::new(mesh)?;
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let facets: Vec<Facet> = mesh
        .triangles
        .par_iter()
        .map(|t| Facet::new(t.map(|v| weld.welded_of[v as usize]), t.map(|v| mesh.vertices[v as usize])))
        .collect();
    let mut found = SelfIntersections { pairs: Vec::new(), complete: true };
    let mut tested = 0;
    for start in (0..facets.len()).step_by(CHUNK) {
        if tested > enough {
            found.complete = false;
            break;
        }
        let end = (start + CHUNK).min(facets.len());
        let of_each: Vec<OfOne> =
            (start..end).into_par_iter().map(|t| meeting(&boxes, &facets, t, enough_for_one)).collect();
        for (offset, of_one) in of_each.into_iter().enumerate() {
            tested += of_one.tested;
            found.complete &= of_one.tested <= enough_for_one;
            found.pairs.extend(of_one.others.into_iter().map(|other| [(start + offset) as u32, other]));
        }
    }
    Ok(found)
}

struct OfOne {
    /// Later triangles that meet it, ascending.
    others: Vec<u32>,
    tested: usize,
}

fn meeting(boxes: &TriangleHierarchy, facets: &[Facet], first: usize, enough_for_one: usize) -> OfOne {
    let mut of_one = OfOne { others: Vec::new(), tested: 0 };
    let facet = &facets[first];
    if facet.flat_axis.is_some() {
        boxes.visit_overlapping(facet.places, |second| {
            if second as usize > first {
                of_one.tested += 1;
                if meet(facet, &facets[second as usize]) {
                    of_one.others.push(second);
                }
            }
            of_one.tested <= enough_for_one
        });
    }
    of_one.others.sort_unstable();
    of_one
}

type Point = [f64; 3];

pub(crate) struct Facet {
    /// Which welded vertices.
    names: [u32; 3],
    places: [Point; 3],
    /// The axis along which the triangle can be projected and keeps an area; `None` if it has none.
    flat_axis: Option<usize>,
}

impl Facet {
    pub(crate) fn new(names: [u32; 3], places: [Point; 3]) -> Self {
        let area_along = |axis: usize| side_2d(axis, places[0], places[1], places[2]).abs();
        let axis = (0..3).max_by(|&i, &j| area_along(i).total_cmp(&area_along(j)));
        Self { names, places, flat_axis: axis.filter(|&axis| area_along(axis) > 0.0) }
    }

    /// The corner opposite to a shared edge, or the edge opposite to a shared corner.
    fn places_but(&self, shared: &[u32]) -> impl Iterator<Item = Point> {
        (0..3).filter(|&k| !shared.contains(&self.names[k])).map(|k| self.places[k])
    }
}

pub(crate) fn meet(a: &Facet, b: &Facet) -> bool {
    let (Some(a_axis), Some(b_axis)) = (a.flat_axis, b.flat_axis) else { return false };
    let shared: Vec<u32> = a.names.into_iter().filter(|name| b.names.contains(name)).collect();
    match shared.len() {
        0 => {
            if misses_plane(&b.places, &a.places) || misses_plane(&a.places, &b.places) {
                return false;
            }
            let edges = |[p, q, r]: [Point; 3]| [[p, q], [q, r], [r, p]];
            edges(a.places).into_iter().any(|edge| segment_meets(edge, &b.places, b_axis))
                || edges(b.places).into_iter().any(|edge| segment_meets(edge, &a.places, a_axis))
        }
        1 => {
            // The common part of two triangles beyond their shared corner ends on the opposite edge of one of them.
            let opposite = |facet: &Facet| {
                let mut ends = facet.places_but(&shared);
                Some([ends.next()?, ends.next()?])
            };
            opposite(a).is_some_and(|edge| segment_meets(edge, &b.places, b_axis))
                || opposite(b).is_some_and(|edge| segment_meets(edge, &a.places, a_axis))
        }
        2 => {
            let (Some(p), Some(q)) = (a.places_but(&shared).next(), b.places_but(&shared).next()) else { return false };
            let edge: Vec<Point> = (0..3).filter(|&k| shared.contains(&a.names[k])).map(|k| a.places[k]).collect();
            let [from, to] = edge[..] else { return false };
            side(&a.places, q) == 0.0 && side_2d(a_axis, from, to, p) * side_2d(a_axis, from, to, q).signum() > 0.0
        }
        _ => false,
    }
}

/// Whether all of `points` lie strictly on one side of the plane of `triangle`.
fn misses_plane(points: &[Point; 3], triangle: &[Point; 3]) -> bool {
    let sides = points.map(|p| side(triangle, p));
    sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0)
}

/// Whether a segment and a triangle have a point in common.
fn segment_meets([p, q]: [Point; 2], triangle: &[Point; 3], axis: usize) -> bool {
    let (from, to) = (side(triangle, p), side(triangle, q));
    if (from > 0.0 && to > 0.0) || (from < 0.0 && to < 0.0) {
        return false;
    }
    let [a, b, c] = *triangle;
    if from == 0.0 && to == 0.0 {
        return is_within_2d(axis, p, triangle)
            || is_within_2d(axis, q, triangle)
            || [[a, b], [b, c], [c, a]].into_iter().any(|edge| segments_meet_2d(axis, [p, q], edge));
    }
    let turns = [[a, b], [b, c], [c, a]].map(|[from, to]| side(&[p, q, from], to));
    turns.iter().all(|&t| t >= 0.0) || turns.iter().all(|&t| t <= 0.0)
}

fn is_within_2d(axis: usize, p: Point, [a, b, c]: &[Point; 3]) -> bool {
    let turns = [[a, b], [b, c], [c, a]].map(|[from, to]| side_2d(axis, *from, *to, p));
    turns.iter().all(|&t| t >= 0.0) || turns.iter().all(|&t| t <= 0.0)
}

fn segments_meet_2d(axis: usize, [p, q]: [Point; 2], [a, b]: [Point; 2]) -> bool {
    let (pa, pb) = (side_2d(axis, p, q, a), side_2d(axis, p, q, b));
    let (ap, aq) = (side_2d(axis, a, b, p), side_2d(axis, a, b, q));
    if pa == 0.0 && pb == 0.0 && ap == 0.0 && aq == 0.0 {
        // On one line: they meet if their extents overlap.
        let overlap = |k: usize| p[k].min(q[k]) <= a[k].max(b[k]) && a[k].min(b[k]) <= p[k].max(q[k]);
        return (0..3).filter(|&k| k != axis).all(overlap);
    }
    let parted = |s: f64, t: f64| (s > 0.0 && t > 0.0) || (s < 0.0 && t < 0.0);
    !parted(pa, pb) && !parted(ap, aq)
}

/// Which side of the plane of `triangle` `p` is on; the sign is exact.
fn side([a, b, c]: &[Point; 3], p: Point) -> f64 {
    let coord = |[x, y, z]: Point| Coord3D { x, y, z };
    orient3d(coord(*a), coord(*b), coord(*c), coord(p))
}

/// Which side of the line from `a` to `b` `p` is on, seen along an axis; the sign is exact.
fn side_2d(axis: usize, a: Point, b: Point, p: Point) -> f64 {
    let coord = |p: Point| Coord { x: p[(axis + 1) % 3], y: p[(axis + 2) % 3] };
    orient2d(coord(a), coord(b), coord(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(vertices: &[Point], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
        let mesh = TriangleMesh { vertices: vertices.to_vec(), triangles: triangles.to_vec() };
        let found = self_intersections(&mesh).unwrap();
        assert!(found.complete);
        found.pairs
    }

    const FLAT: [Point; 3] = [[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    fn against_flat(other: [Point; 3]) -> bool {
        let vertices: Vec<Point> = FLAT.into_iter().chain(other).collect();
        !pairs(&vertices, &[[0, 1, 2], [3, 4, 5]]).is_empty()
    }

    #[test]
    fn crossing_touching_and_missing() {
        assert!(against_flat([[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [9.0, 9.0, 1.0]]), "an edge goes through");
        assert!(against_flat([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]]), "a corner touches inside");
        assert!(against_flat([[2.0, 0.0, -1.0], [2.0, 0.0, 1.0], [2.0, -3.0, 0.0]]), "an edge touches an edge");
        assert!(!against_flat([[1.0, 1.0, 1e-300], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]]), "hardly above");
        assert!(!against_flat([[3.0, 3.0, -1.0], [3.0, 3.0, 1.0], [9.0, 9.0, 0.0]]), "passes by");
    }

    #[test]
    fn triangles_in_one_plane() {
        assert!(against_flat([[1.0, 1.0, 0.0], [1.5, 1.0, 0.0], [1.0, 1.5, 0.0]]), "inside");
        assert!(against_flat([[-9.0, -9.0, 0.0], [30.0, -9.0, 0.0], [-9.0, 30.0, 0.0]]), "around");
        assert!(against_flat([[3.0, -1.0, 0.0], [3.0, 5.0, 0.0], [9.0, 5.0, 0.0]]), "across");
        assert!(!against_flat([[3.0, 3.0, 0.0], [5.0, 3.0, 0.0], [3.0, 5.0, 0.0]]), "beside");
    }

    #[test]
    fn neighbours_only_meet_where_folded_over() {
        let corner =
            |p: Point| -> Vec<Point> { FLAT.into_iter().chain([p, [0.0, -1.0, 3.0], [1.0, 1.0, -1.0]]).collect() };
        let upright = corner([1.0, 1.0, 1.0]);
        assert!(pairs(&upright, &[[0, 1, 2], [1, 0, 3]]).is_empty(), "a hinge");
        assert_eq!(pairs(&corner([1.0, 1.0, 0.0]), &[[0, 1, 2], [1, 0, 3]]), [[0, 1]], "a hinge folded shut");
        assert!(pairs(&corner([1.0, -1.0, 0.0]), &[[0, 1, 2], [1, 0, 3]]).is_empty(), "a hinge laid open");
        assert!(pairs(&upright, &[[0, 1, 2], [0, 3, 4]]).is_empty(), "a common corner");
        assert_eq!(pairs(&upright, &[[0, 1, 2], [0, 3, 5]]), [[0, 1]], "a common corner, and across");
        assert!(pairs(&upright, &[[0, 1, 2], [2, 1, 0], [1, 1, 3]]).is_empty(), "duplicates and slivers do not count");
    }

    #[test]
    fn everything_on_everything_is_cut_short() {
        let mut mesh = TriangleMesh::default();
        for k in 0..3000_u32 {
            let z = f64::from(k % 7) - 3.0;
            mesh.vertices.extend([[0.0, 0.0, z], [1.0, 0.0, -z], [0.0, 1.0, z + f64::from(k)]]);
            mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        assert!(!search(&mesh, 100_000).unwrap().complete);
        assert!(search(&mesh, 100_000_000).unwrap().complete);
    }
}
