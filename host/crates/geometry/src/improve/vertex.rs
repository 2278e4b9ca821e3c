//! Operations on vertices: moving one, contracting an edge onto its other end, inserting a new one.

use glam::DVec3;

use super::candidate::{Candidate, LEAST_GAIN};
use super::complex::{Complex, MOST_NEW, SMALL_SINE};
use super::facets::NONE;
use super::place_vertex::{Placed, place_vertex};
use crate::facets::facet;

/// Most tetrahedra that a new vertex may replace.
const MOST_TAKEN: usize = 24;

fn hole_around(complex: &Complex, facets: &[[u32; 3]]) -> Vec<[DVec3; 3]> {
    facets.iter().map(|f| f.map(|v| complex.at(v))).collect()
}

fn facets_opposite(complex: &Complex, vertex: u32, star: &[u32]) -> Vec<[u32; 3]> {
    let opposite = |&t: &u32| complex.slot_of(t, vertex).map(|k| facet(complex.corners(t), k));
    star.iter().filter_map(opposite).collect()
}

/// Moves free corners of a tetrahedron to where their worst tetrahedron is best; returns how many moved.
pub(super) fn smooth_corners(complex: &mut Complex, tetrahedron: u32, enough: f64) -> usize {
    let mut moved = 0;
    let mut star = Vec::new();
    for vertex in complex.corners(tetrahedron) {
        if complex.is_pinned(vertex) {
            continue;
        }
        complex.star(vertex, tetrahedron, &mut star);
        let before = complex.worst(&star);
        if before >= enough {
            continue;
        }
        let hole = hole_around(complex, &facets_opposite(complex, vertex, &star));
        let here = complex.at(vertex);
        let placed = place_vertex(here, &hole, enough);
        if placed.worst <= before + LEAST_GAIN {
            continue;
        }
        moved += usize::from(move_if_sound(complex, vertex, &star, &placed));
    }
    moved
}

/// Moves a vertex with its star to its new place, unless that inverts an element or makes small angles more; returns
/// whether it moved.
pub(super) fn move_if_sound(complex: &mut Complex, vertex: u32, star: &[u32], placed: &Placed) -> bool {
    let may_count = placed.worst < SMALL_SINE;
    let small = |complex: &Complex| {
        if may_count { complex.small_angles(star.iter().map(|&t| complex.corners(t))) } else { 0 }
    };
    let (here, were) = (complex.at(vertex), small(complex));
    complex.move_vertex(vertex, placed.position);
    if !star.iter().all(|&t| complex.is_positive(complex.corners(t))) || small(complex) > were {
        complex.move_vertex(vertex, here);
        return false;
    }
    complex.measure(star);
    true
}

/// The best contraction of an edge of `tetrahedron` from a free end, if it beats `at_least`.
pub(super) fn contract_edges(complex: &mut Complex, tetrahedron: u32, at_least: f64, best: &mut Candidate) {
    let mut worst_of_best = at_least;
    let corners = complex.corners(tetrahedron);
    let mut star = Vec::new();
    for vertex in corners {
        if complex.is_pinned(vertex) {
            continue;
        }
        complex.star(vertex, tetrahedron, &mut star);
        let facets = facets_opposite(complex, vertex, &star);
        let mut ends: Vec<u32> = facets.iter().flatten().copied().collect();
        ends.sort_unstable();
        ends.dedup();
        for &end in &ends {
            let mut worst = f64::INFINITY;
            let new = || facets.iter().filter(|f| !f.contains(&end)).map(|&[x, y, z]| [x, z, y, end]);
            for t in new() {
                worst = worst.min(complex.sine(t));
                if worst <= worst_of_best {
                    break;
                }
            }
            if worst > worst_of_best && worst < f64::INFINITY {
                worst_of_best = worst;
                best.worst = worst;
                best.old.clone_from(&star);
                best.new = new().collect();
            }
        }
    }
}

/// A new vertex replacing `tetrahedron` and those around it that it sees, if all become better than `at_least`.
/// `enough` is the quality that new tetrahedra should have: others are also replaced as long as their facets may
/// vanish.
pub(super) fn insert_vertex(complex: &mut Complex, tetrahedron: u32, at_least: f64, enough: f64) -> bool {
    let corners = complex.corners(tetrahedron);
    let middle = corners.iter().map(|&v| complex.at(v)).sum::<DVec3>() * 0.25;
    let Some((old, facets)) = hole_seen_from(complex, tetrahedron, middle, enough) else { return false };
    let mut placed = place_vertex(middle, &hole_around(complex, &facets), enough);
    if placed.worst < enough {
        // There is often more space away from the sliver's own plane.
        let sum: DVec3 = facets.iter().flatten().map(|&v| complex.at(v)).sum();
        let other = place_vertex(sum / (3 * facets.len()) as f64, &hole_around(complex, &facets), enough);
        if other.worst > placed.worst {
            placed = other;
        }
    }
    if placed.worst <= at_least + LEAST_GAIN {
        return false;
    }
    let vertex = complex.push_vertex(placed.position);
    let new: Vec<[u32; 4]> = facets.iter().map(|&[x, y, z]| [x, z, y, vertex]).collect();
    let done = complex.replace(&old, &new);
    if !done {
        complex.pop_vertex();
    }
    done
}

/// Tetrahedra to remove for a vertex at `point`, and the facets around them.
fn hole_seen_from(
    complex: &mut Complex,
    tetrahedron: u32,
    point: DVec3,
    enough: f64,
) -> Option<(Vec<u32>, Vec<[u32; 3]>)> {
    complex.clear_marks();
    complex.set_mark(tetrahedron);
    let mut old = vec![tetrahedron];
    let mut next = 0;
    while next < old.len() {
        let t = old[next];
        next += 1;
        for k in 0..4 {
            let Some(other) = complex.across(t, k) else { continue };
            let [x, y, z] = facet(complex.corners(t), k).map(|v| complex.at(v));
            if complex.is_marked(other) || super::quality::smallest_sine([x, z, y, point]) >= enough {
                continue;
            }
            if old.len() < MOST_TAKEN {
                complex.set_mark(other);
                old.push(other);
            }
        }
    }
    let mut facets = Vec::new();
    for &t in &old {
        for k in 0..4 {
            let other = complex.neighbour(t, k);
            if other == NONE || !complex.is_marked(other) {
                facets.push(facet(complex.corners(t), k));
            }
        }
    }
    let inside = |v: &u32| complex.is_pinned(*v) && !facets.iter().flatten().any(|u| u == v);
    let loses_pinned = old.iter().flat_map(|&t| complex.corners(t)).any(|v| inside(&v));
    (facets.len() <= MOST_NEW && !loses_pinned).then_some((old, facets))
}
