//! Tetrahedra that know their neighbours, and the one way to change them.

use glam::DVec3;

use super::dihedral_angles::angles;
use super::facets::{FACETS, NONE, facet, sorted};
use super::quality::smallest_sine;
use crate::predicates::orientation;

/// Even permutations that put each of the six edges first.
pub(super) const EDGES_FIRST: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];

/// Slots of tetrahedra, alive or waiting to be used again.
pub(super) struct Complex {
    /// n×3, scaled so that the largest lies in [1, 2).
    pub(super) positions: Vec<DVec3>,
    /// Vertices that neither move nor vanish.
    pub(super) pinned: Vec<bool>,
    /// Corners of each slot; the first is [`NONE`] in a dead one.
    pub(super) corners: Vec<[u32; 4]>,
    /// Across the facet opposite each corner, [`NONE`] beyond the boundary.
    pub(super) neighbours: Vec<[u32; 4]>,
    /// Bit k: the facet opposite corner k has to stay.
    pub(super) locked: Vec<u8>,
    /// The smallest sine of each.
    pub(super) quality: Vec<f64>,
    marks: Vec<u32>,
    mark: u32,
    dead: Vec<u32>,
    sides: Vec<Side>,
}

/// A facet of a cavity, or of what will fill it.
#[derive(Clone, Copy)]
struct Side {
    corners: [u32; 3],
    odd: bool,
    /// The neighbour outside for a facet of the cavity, the new tetrahedron otherwise.
    tetrahedron: u32,
    /// Which facet of it.
    slot: u8,
    outside: bool,
    locked: bool,
}

impl Complex {
    pub(super) fn new(
        positions: Vec<DVec3>,
        corners: Vec<[u32; 4]>,
        neighbours: Vec<[u32; 4]>,
        pinned: Vec<bool>,
        locked: Vec<u8>,
    ) -> Self {
        let quality = corners.iter().map(|t| smallest_sine(t.map(|v| positions[v as usize]))).collect();
        let marks = vec![0; corners.len()];
        Self {
            positions,
            pinned,
            corners,
            neighbours,
            locked,
            quality,
            marks,
            mark: 0,
            dead: Vec::new(),
            sides: Vec::new(),
        }
    }

    pub(super) fn is_alive(&self, tetrahedron: u32) -> bool {
        self.corners[tetrahedron as usize][0] != NONE
    }

    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize]
    }

    pub(super) fn sine(&self, tetrahedron: [u32; 4]) -> f64 {
        smallest_sine(tetrahedron.map(|v| self.at(v)))
    }

    pub(super) fn is_positive(&self, tetrahedron: [u32; 4]) -> bool {
        let [a, b, c, d] = tetrahedron.map(|v| self.at(v).to_array());
        orientation(&a, &b, &c, &d) > 0.0
    }

    /// How many dihedral angles are below 5°.
    pub(super) fn small_angles(&self, tetrahedra: impl Iterator<Item = [u32; 4]>) -> usize {
        let small = |t: [u32; 4]| angles(t.map(|v| self.at(v))).iter().filter(|a| a.to_degrees() < 5.0).count();
        tetrahedra.map(small).sum()
    }

    /// Which corner of a tetrahedron a vertex is.
    pub(super) fn slot_of(&self, tetrahedron: u32, vertex: u32) -> Option<usize> {
        self.corners[tetrahedron as usize].iter().position(|&v| v == vertex)
    }

    /// The tetrahedron across the facet opposite corner `k`, unless that is of the boundary or has to stay.
    pub(super) fn across(&self, tetrahedron: u32, k: usize) -> Option<u32> {
        let other = self.neighbours[tetrahedron as usize][k];
        (other != NONE && self.locked[tetrahedron as usize] >> k & 1 == 0).then_some(other)
    }

    /// The corner of `other` that is not on its facet shared with `tetrahedron`.
    pub(super) fn apex_towards(&self, other: u32, tetrahedron: u32) -> Option<u32> {
        let k = self.neighbours[other as usize].iter().position(|&n| n == tetrahedron)?;
        Some(self.corners[other as usize][k])
    }

    /// The smallest quality of some tetrahedra.
    pub(super) fn worst(&self, tetrahedra: &[u32]) -> f64 {
        tetrahedra.iter().fold(f64::INFINITY, |least, &t| least.min(self.quality[t as usize]))
    }

    /// Starts a new set of marked tetrahedra.
    pub(super) fn clear_marks(&mut self) {
        if self.mark == u32::MAX {
            self.marks.fill(0);
            self.mark = 0;
        }
        self.mark += 1;
    }

    /// Marks a tetrahedron; false if it already was.
    pub(super) fn set_mark(&mut self, tetrahedron: u32) -> bool {
        std::mem::replace(&mut self.marks[tetrahedron as usize], self.mark) != self.mark
    }

    pub(super) fn is_marked(&self, tetrahedron: u32) -> bool {
        self.marks[tetrahedron as usize] == self.mark
    }

    /// All tetrahedra around an interior vertex, from one of them on.
    pub(super) fn star(&mut self, vertex: u32, first: u32, star: &mut Vec<u32>) {
        self.clear_marks();
        self.set_mark(first);
        star.clear();
        star.push(first);
        let mut next = 0;
        while next < star.len() {
            let tetrahedron = star[next] as usize;
            next += 1;
            for k in 0..4 {
                let other = self.neighbours[tetrahedron][k];
                if self.corners[tetrahedron][k] != vertex && other != NONE && self.set_mark(other) {
                    star.push(other);
                }
            }
        }
    }

    /// Puts `new` tetrahedra in the place of `old` ones, and whether that was possible: all have to be positive, and
    /// both sets must have the same oriented boundary. Together that makes the new ones cover exactly what the old
    /// ones did, once. Facets that have to stay are never lost.
    pub(super) fn replace(&mut self, old: &[u32], new: &[[u32; 4]]) -> bool {
        if !new.iter().all(|&t| self.is_positive(t)) || !self.match_sides(old, new) {
            return false;
        }
        // The worst may rise while others sink: the number of angles that count may not.
        let worst = new.iter().map(|&t| self.sine(t)).fold(f64::INFINITY, f64::min);
        let were = old.iter().map(|&t| self.corners[t as usize]);
        if worst < SMALL_SINE && self.small_angles(new.iter().copied()) > self.small_angles(were) {
            return false;
        }
        for &t in old {
            self.corners[t as usize][0] = NONE;
            self.dead.push(t);
        }
        let mut names = [0; MOST_NEW];
        for (name, &corners) in names.iter_mut().zip(new) {
            let slot = self.dead.pop().unwrap_or_else(|| self.push_slot());
            *name = slot;
            self.corners[slot as usize] = corners;
            self.neighbours[slot as usize] = [NONE; 4];
            self.locked[slot as usize] = 0;
            self.quality[slot as usize] = self.sine(corners);
        }
        for pair in self.sides.chunks_exact(2) {
            let (one, new) = if pair[0].outside { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
            let (tetrahedron, k) = (names[new.tetrahedron as usize], new.slot as usize);
            if one.outside {
                self.neighbours[tetrahedron as usize][k] = one.tetrahedron;
                self.locked[tetrahedron as usize] |= u8::from(one.locked) << k;
                if one.tetrahedron != NONE {
                    self.neighbours[one.tetrahedron as usize][one.slot as usize] = tetrahedron;
                }
            } else {
                let other = names[one.tetrahedron as usize];
                self.neighbours[tetrahedron as usize][k] = other;
                self.neighbours[other as usize][one.slot as usize] = tetrahedron;
            }
        }
        true
    }

    /// Fills `sides` with pairs of the same facet, and whether all are pairs that fit.
    fn match_sides(&mut self, old: &[u32], new: &[[u32; 4]]) -> bool {
        if new.len() > MOST_NEW {
            return false;
        }
        self.clear_marks();
        for &t in old {
            self.set_mark(t);
        }
        self.sides.clear();
        for &t in old {
            for k in 0..4 {
                let other = self.neighbours[t as usize][k];
                let locked = self.locked[t as usize] >> k & 1 == 1;
                if other != NONE && self.is_marked(other) {
                    if locked {
                        return false;
                    }
                    continue;
                }
                let (corners, odd) = sorted(facet(self.corners[t as usize], k));
                // Two tetrahedra may share several facets; the corners tell which one.
                let is_same = |&s: &usize| {
                    self.neighbours[other as usize][s] == t
                        && sorted(facet(self.corners[other as usize], s)).0 == corners
                };
                let slot = match other {
                    NONE => 0,
                    _ => match (0..4).find(is_same) {
                        Some(slot) => slot as u8,
                        None => return false,
                    },
                };
                self.sides.push(Side { corners, odd, tetrahedron: other, slot, outside: true, locked });
            }
        }
        for (index, &t) in new.iter().enumerate() {
            for k in 0..FACETS.len() {
                let (corners, odd) = sorted(facet(t, k));
                let (tetrahedron, slot) = (index as u32, k as u8);
                self.sides.push(Side { corners, odd, tetrahedron, slot, outside: false, locked: false });
            }
        }
        self.sides.sort_unstable_by_key(|side| (side.corners, !side.outside, side.tetrahedron));
        self.sides.len().is_multiple_of(2)
            && self.sides.chunks_exact(2).all(|pair| {
                // An old facet is met from the same side, two new tetrahedra lie on opposite ones.
                pair[0].corners == pair[1].corners
                    && !pair[1].outside
                    && (pair[0].odd == pair[1].odd) == pair[0].outside
            })
            && self.sides.windows(3).all(|three| three[0].corners != three[2].corners)
    }

    fn push_slot(&mut self) -> u32 {
        self.corners.push([NONE; 4]);
        self.neighbours.push([NONE; 4]);
        self.locked.push(0);
        self.quality.push(0.0);
        self.marks.push(0);
        (self.corners.len() - 1) as u32
    }
}

/// Tetrahedra that one operation may make; an inserted vertex with 64 around it has about three times a usual star.
pub(super) const MOST_NEW: usize = 64;
/// A little above the sine of 5°: with a smallest sine from here up no angle is below 5°.
pub(super) const SMALL_SINE: f64 = 0.08716;
