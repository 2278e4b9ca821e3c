//! Facet removal, the reverse of edge removal: facets between the same two vertices give way to an edge between those
//! vertices (the 2-3 flip, and Shewchuk's multi-facet removal: Klingner & Shewchuk 2008, section 3.1).

use super::candidate::Candidate;
use super::complex::Complex;
use crate::facets::facet;

/// Most facets removed at once.
const MOST_FACETS: usize = 8;

struct Removal<'a> {
    complex: &'a Complex,
    /// Vertices below and above the facets.
    below: u32,
    above: u32,
    goal: f64,
    old: Vec<u32>,
    new: Vec<[u32; 4]>,
}

/// The best replacement for facet `k` of `tetrahedron` and those beside it, if it beats `at_least`.
pub(super) fn remove_facets(
    complex: &Complex,
    tetrahedron: u32,
    k: usize,
    at_least: f64,
    goal: f64,
    best: &mut Candidate,
) {
    let Some(other) = complex.across(tetrahedron, k) else { return };
    let Some(above) = complex.apex_towards(other, tetrahedron) else { return };
    let corners = complex.corners(tetrahedron);
    let old = vec![tetrahedron, other];
    let mut removal = Removal { complex, below: corners[k], above, goal, old, new: Vec::new() };
    let [x, y, z] = facet(corners, k);
    let mut worst = f64::INFINITY;
    for edge in [[x, y], [y, z], [z, x]] {
        worst = worst.min(removal.beyond(edge, tetrahedron, other, at_least));
        if worst <= at_least {
            return;
        }
    }
    *best = Candidate { worst, old: removal.old, new: removal.new };
}

impl Removal<'_> {
    /// The worst new tetrahedron at the edge from x to y of a facet already removed, or, if that is better, beyond it.
    fn beyond(&mut self, [x, y]: [u32; 2], lower: u32, upper: u32, at_least: f64) -> f64 {
        let stop = self.complex.sine([self.below, self.above, x, y]);
        let (old, new) = (self.old.len(), self.new.len());
        if stop < self.goal
            && let Some(further) = self.next_facet([x, y], lower, upper, stop.max(at_least))
        {
            return further;
        }
        self.old.truncate(old);
        self.new.truncate(new);
        self.new.push([self.below, self.above, x, y]);
        stop
    }

    /// Also removes the facet across the edge, if there is one between the same two vertices and it is worth it.
    fn next_facet(&mut self, [x, y]: [u32; 2], lower: u32, upper: u32, at_least: f64) -> Option<f64> {
        if self.old.len() >= 2 * MOST_FACETS {
            return None;
        }
        let next = |tetrahedron: u32, apex: u32| {
            let corners = self.complex.corners(tetrahedron);
            let k = corners.iter().position(|&v| v != apex && v != x && v != y)?;
            let next = self.complex.across(tetrahedron, k)?;
            Some((next, self.complex.apex_towards(next, tetrahedron)?))
        };
        let (next_lower, corner) = next(lower, self.below)?;
        let (next_upper, same) = next(upper, self.above)?;
        if corner != same || self.old.contains(&next_lower) || self.old.contains(&next_upper) {
            return None;
        }
        self.old.extend([next_lower, next_upper]);
        let mut worst = f64::INFINITY;
        for edge in [[x, corner], [corner, y]] {
            worst = worst.min(self.beyond(edge, next_lower, next_upper, at_least));
            if worst <= at_least {
                return None;
            }
        }
        Some(worst)
    }
}
