//! Tetrahedra with links to their neighbours, and the only way to change them.

use glam::DVec3;

use super::dihedral_angles::angles;
use super::facets::NONE;
use super::loose::Loose;
use super::quality::smallest_sine;
use crate::facets::{FACETS, facet, sorted};
use crate::predicates::orientation;

/// Even permutations that put each of the six edges first.
pub(super) const EDGES_FIRST: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];

/// Slots of tetrahedra, in use or free for reuse.
pub(super) struct Complex {
    /// n×3, scaled so that the largest coordinate is in [1, 2).
    positions: Vec<DVec3>,
    /// Vertices that neither move nor vanish.
    pinned: Vec<bool>,
    /// Corners of each slot; the first is [`NONE`] in a dead one.
    corners: Vec<[u32; 4]>,
    /// Across the facet opposite each corner, [`NONE`] beyond the boundary.
    neighbours: Vec<[u32; 4]>,
    /// Bit k: the facet opposite corner k must stay.
    locked: Vec<u8>,
    /// The smallest sine of each.
    quality: Vec<f64>,
    marks: Vec<u32>,
    mark: u32,
    dead: Vec<u32>,
    sides: Vec<Side>,
    /// What is needed where the boundary may change; none if it has to stay.
    pub(super) loose: Option<Loose>,
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
            loose: None,
        }
    }

    /// Lets vertices of the boundary give way.
    pub(super) fn loosen(&mut self, mut loose: Loose) {
        for (t, corners) in (0..).zip(&self.corners) {
            loose.enter(t, *corners);
        }
        self.loose = Some(loose);
    }

    pub(super) fn is_alive(&self, tetrahedron: u32) -> bool {
        self.corners[tetrahedron as usize][0] != NONE
    }

    /// The corners of a tetrahedron that is alive.
    pub(super) fn corners(&self, tetrahedron: u32) -> [u32; 4] {
        self.corners[tetrahedron as usize]
    }

    /// The corners of all that are alive.
    pub(super) fn alive(&self) -> impl Iterator<Item = [u32; 4]> {
        self.corners.iter().filter(|t| t[0] != NONE).copied()
    }

    /// Slots, alive or not.
    pub(super) fn slots(&self) -> u32 {
        self.corners.len() as u32
    }

    /// The smallest sine of a tetrahedron that is alive.
    pub(super) fn quality(&self, tetrahedron: u32) -> f64 {
        self.quality[tetrahedron as usize]
    }

    pub(super) fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize]
    }

    /// Whether a vertex may neither move nor vanish.
    pub(super) fn is_pinned(&self, vertex: u32) -> bool {
        self.pinned[vertex as usize]
    }

    pub(super) fn move_vertex(&mut self, vertex: u32, to: DVec3) {
        self.positions[vertex as usize] = to;
    }

    /// Updates the qualities after corners moved.
    pub(super) fn measure(&mut self, tetrahedra: &[u32]) {
        for &t in tetrahedra {
            self.quality[t as usize] = self.sine(self.corners(t));
        }
    }

    /// A new vertex, which may move; no tetrahedron has it yet.
    pub(super) fn push_vertex(&mut self, position: DVec3) -> u32 {
        self.positions.push(position);
        self.pinned.push(false);
        if let Some(loose) = &mut self.loose {
            loose.push_vertex();
        }
        (self.positions.len() - 1) as u32
    }

    /// Removes the most recently pushed vertex, before a tetrahedron uses it.
    pub(super) fn pop_vertex(&mut self) {
        self.positions.pop();
        self.pinned.pop();
        if let Some(loose) = &mut self.loose {
            loose.pop_vertex();
        }
    }

    /// Whether a vertex is on a loose boundary, and may move or vanish.
    pub(super) fn may_give(&self, vertex: u32) -> bool {
        self.loose.as_ref().is_some_and(|loose| loose.may_give(vertex))
    }

    /// What a vertex has left after giving way.
    pub(super) fn give_way(&mut self, vertex: u32, recede: f64, bulge: f64) {
        if let Some(loose) = &mut self.loose {
            loose.set(vertex, recede, bulge);
        }
    }

    /// A vertex that is on the loose boundary from now on, if it was not, and how far that may still recede there.
    pub(super) fn expose(&mut self, vertex: u32, recede: f64) {
        let is_new = !std::mem::replace(&mut self.pinned[vertex as usize], true);
        if let Some(loose) = &mut self.loose {
            loose.expose(vertex, is_new, recede);
        }
    }

    /// Notes that a vertex vanished, and which one is in its place and what that has left.
    pub(super) fn merge(&mut self, vertex: u32, end: u32, recede: f64, bulge: f64) {
        if let Some(loose) = &mut self.loose {
            loose.merge(vertex, end, recede, bulge);
        }
    }

    /// All tetrahedra at a vertex of a loose boundary, whether or not they are connected through facets.
    pub(super) fn around(&self, vertex: u32) -> Vec<u32> {
        let listed = self.loose.as_ref().map_or(&[][..], |loose| loose.listed(vertex));
        let mut around: Vec<u32> =
            listed.iter().copied().filter(|&t| self.is_alive(t) && self.slot_of(t, vertex).is_some()).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// The facets of a tetrahedron that are on the boundary, counter-clockwise seen from outside.
    pub(super) fn boundary_facets(&self, tetrahedron: u32) -> impl Iterator<Item = [u32; 3]> + '_ {
        let corners = self.corners(tetrahedron);
        let bare = move |&k: &usize| self.neighbours[tetrahedron as usize][k] == NONE;
        (0..4).filter(bare).map(move |k| facet(corners, k))
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

    /// The tetrahedron across the facet opposite corner `k`, unless that facet is on the boundary or must stay.
    pub(super) fn across(&self, tetrahedron: u32, k: usize) -> Option<u32> {
        let other = self.neighbours[tetrahedron as usize][k];
        (other != NONE && self.locked[tetrahedron as usize] >> k & 1 == 0).then_some(other)
    }

    /// The tetrahedron across the facet opposite corner `k`, [`NONE`] beyond the boundary.
    pub(super) fn neighbour(&self, tetrahedron: u32, k: usize) -> u32 {
        self.neighbours[tetrahedron as usize][k]
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

    /// Replaces the `old` tetrahedra by `new` ones; returns whether that was possible: all must be positive, and both
    /// sets must have the same oriented boundary. Together that makes the new ones cover exactly what the old ones did,
    /// once. Facets that must stay are never lost.
    pub(super) fn replace(&mut self, old: &[u32], new: &[[u32; 4]]) -> bool {
        let fits = self.gather_sides(old, new)
            && groups(&self.sides).all(|group| match group {
                Group::Kept => true,
                Group::Inner(side) => self.is_free(side.corners, old),
                _ => false,
            });
        fits && self.exchange(old, new)
    }

    /// Like [`Self::replace`], but facets of the boundary may vanish or be new. With `expose`, facets around the `old`
    /// ones may come to lie on the boundary.
    pub(super) fn replace_at_boundary(&mut self, old: &[u32], new: &[[u32; 4]], expose: bool) -> bool {
        let fits = self.gather_sides(old, new)
            && groups(&self.sides).all(|group| match group {
                Group::Kept => true,
                Group::Gone(side) => side.tetrahedron == NONE || (expose && !side.locked),
                Group::Inner(side) | Group::New(side) => self.is_free(side.corners, old),
                Group::Crowded => false,
            });
        fits && self.exchange(old, new)
    }

    /// Whether no tetrahedron but those of `except` has this facet. Within a boundary that stays, that follows from the
    /// space it would take.
    fn is_free(&self, corners: [u32; 3], except: &[u32]) -> bool {
        let has = |t: &u32| corners.iter().all(|&v| self.slot_of(*t, v).is_some()) && !except.contains(t);
        self.loose.is_none() || !self.around(corners[0]).iter().any(has)
    }

    /// Exchanges tetrahedra after their sides have been gathered and checked.
    fn exchange(&mut self, old: &[u32], new: &[[u32; 4]]) -> bool {
        if !new.iter().all(|&t| self.is_positive(t)) {
            return false;
        }
        // The worst may rise while others fall: the number of small angles may not rise.
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
            if let Some(loose) = &mut self.loose {
                loose.enter(slot, corners);
            }
        }
        for group in self.sides.chunk_by(|a, b| a.corners == b.corners) {
            let (one, other) = match group {
                [one, other] if one.outside => (*one, *other),
                [one, other] => (*other, *one),
                [alone] if alone.outside && alone.tetrahedron != NONE => {
                    self.neighbours[alone.tetrahedron as usize][alone.slot as usize] = NONE;
                    continue;
                }
                _ => continue,
            };
            let (tetrahedron, k) = (names[other.tetrahedron as usize], other.slot as usize);
            if one.outside {
                self.neighbours[tetrahedron as usize][k] = one.tetrahedron;
                self.locked[tetrahedron as usize] |= u8::from(one.locked) << k;
                if one.tetrahedron != NONE {
                    self.neighbours[one.tetrahedron as usize][one.slot as usize] = tetrahedron;
                }
            } else {
                let across = names[one.tetrahedron as usize];
                self.neighbours[tetrahedron as usize][k] = across;
                self.neighbours[across as usize][one.slot as usize] = tetrahedron;
            }
        }
        true
    }

    /// Fills `sides`, the same facets side by side; returns whether that is possible without losing one that must stay.
    fn gather_sides(&mut self, old: &[u32], new: &[[u32; 4]]) -> bool {
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
        true
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

/// What the sides of one facet are.
enum Group {
    /// The same facet before and after.
    Kept,
    /// One between two new tetrahedra.
    Inner(Side),
    /// A facet around the old tetrahedra that no new one has.
    Gone(Side),
    /// A facet that only one new tetrahedron has.
    New(Side),
    /// More than two, or two on the same side.
    Crowded,
}

fn groups(sides: &[Side]) -> impl Iterator<Item = Group> + '_ {
    sides.chunk_by(|a, b| a.corners == b.corners).map(|group| match *group {
        [alone] if alone.outside => Group::Gone(alone),
        [alone] => Group::New(alone),
        // An old facet is met from the same side, two new tetrahedra are on opposite sides.
        [one, other] if one.outside && !other.outside && one.odd == other.odd => Group::Kept,
        [one, other] if !one.outside && one.odd != other.odd => Group::Inner(one),
        _ => Group::Crowded,
    })
}

/// Most tetrahedra that one operation may make; an inserted vertex with 64 around it has about three times a usual
/// star.
pub(super) const MOST_NEW: usize = 64;
/// A little above the sine of 5°: with a smallest sine from here up no angle is below 5°.
pub(super) const SMALL_SINE: f64 = 0.08716;
