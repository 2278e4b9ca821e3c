//! Tetrahedra that fill all of space, linked across their facets: what they hold, and the only ways to change it.
//!
//! Tetrahedra live in numbered slots, which are reused. Each facet of the hull carries a tetrahedron to a point at
//! infinity. Facets can be locked, and a selection of tetrahedra can be marked; a new one is in no selection.

use super::region::Region;
use crate::predicates::orientation;

/// The corner at infinity.
pub(crate) const INFINITE: u32 = u32::MAX;
/// No tetrahedron.
pub(crate) const NONE: u32 = u32::MAX;
const DEAD: [u32; 4] = [INFINITE; 4];

/// A triangulation of space.
pub(crate) struct Triangulation {
    /// Positions, in the numbering of the corners.
    points: Vec<[f64; 3]>,
    /// Positively oriented corners; at most one is [`INFINITE`]; in an unused slot all four are.
    corners: Vec<[u32; 4]>,
    /// `neighbours[t][k]` is across the facet of `t` opposite its corner `k`.
    neighbours: Vec<[u32; 4]>,
    /// The tetrahedron made last.
    last: u32,
    /// How many slots there may be.
    most: usize,
    free: Vec<u32>,
    /// A bit for each facet that must stay, on both of its sides; empty until [`Triangulation::track`].
    locked: Vec<u8>,
    /// A tetrahedron at each point; empty until [`Triangulation::track`].
    tet_of: Vec<u32>,
    /// Tetrahedra made since then.
    changed: Vec<u32>,
    /// `stamp` if selected, `stamp + 1` if rejected, anything less if not decided yet.
    mark: Vec<u32>,
    stamp: u32,
    /// Lent to each insertion, so that it allocates nothing.
    region: Region,
}

impl Triangulation {
    /// The positively oriented tetrahedron `inner`, and infinity; never more than `most` tetrahedra.
    pub(crate) fn new(points: Vec<[f64; 3]>, inner: [u32; 4], most: usize) -> Self {
        let mut all = vec![inner];
        for slot in 0..4 {
            let mut outer = inner;
            outer[slot] = INFINITE;
            // Seen from the other side of the facet, the order is reversed.
            outer.swap((slot + 1) % 4, (slot + 2) % 4);
            all.push(outer);
        }
        let across = |t: usize, slot: usize| {
            let facet = |u: usize, corner: u32| all[u].contains(&corner);
            let opposite = all[t][slot];
            (0..5).find(|&u| u != t && all[t].iter().all(|&corner| corner == opposite || facet(u, corner)))
        };
        let neighbours = (0..5).map(|t| std::array::from_fn(|slot| across(t, slot).map_or(NONE, |u| u as u32)));
        Self {
            points,
            neighbours: neighbours.collect(),
            mark: vec![0; all.len()],
            corners: all,
            last: 0,
            most,
            free: Vec::new(),
            locked: Vec::new(),
            tet_of: Vec::new(),
            changed: Vec::new(),
            stamp: 0,
            region: Region::default(),
        }
    }

    /// The points, corners or not.
    pub(crate) fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Where a vertex is, which is not at infinity.
    #[inline]
    pub(crate) fn point(&self, vertex: u32) -> &[f64; 3] {
        &self.points[vertex as usize]
    }

    /// Number of slots, in use or not.
    pub(crate) fn slots(&self) -> u32 {
        self.corners.len() as u32
    }

    /// Whether the slot holds a tetrahedron, at infinity or not.
    #[inline]
    pub(crate) fn is_alive(&self, tet: u32) -> bool {
        self.corners[tet as usize] != DEAD
    }

    /// The corners of a tetrahedron, positively oriented.
    #[inline]
    pub(crate) fn corners(&self, tet: u32) -> [u32; 4] {
        self.corners[tet as usize]
    }

    /// What is across the facets opposite the corners.
    #[inline]
    pub(crate) fn neighbours(&self, tet: u32) -> [u32; 4] {
        self.neighbours[tet as usize]
    }

    /// What is across the facet opposite a corner.
    #[inline]
    pub(crate) fn neighbour(&self, tet: u32, slot: usize) -> u32 {
        self.neighbours[tet as usize][slot]
    }

    /// What is across the facet opposite a corner, and its corner opposite that facet.
    #[inline]
    pub(crate) fn across(&self, tet: u32, slot: usize) -> (u32, usize) {
        let other = self.neighbour(tet, slot);
        (other, position_of(&self.neighbours[other as usize], tet))
    }

    /// The corner of the neighbour that does not belong to the shared facet.
    pub(crate) fn apex_across(&self, tet: u32, slot: usize) -> u32 {
        let (other, back) = self.across(tet, slot);
        self.corners[other as usize][back]
    }

    /// Which of a tetrahedron's corners a vertex is; it is one.
    #[inline]
    pub(super) fn slot_of(&self, tet: u32, vertex: u32) -> usize {
        position_of(&self.corners[tet as usize], vertex)
    }

    /// Which corner is at infinity, if one is.
    #[inline]
    pub(crate) fn infinite_slot(&self, tet: u32) -> Option<usize> {
        self.corners[tet as usize].iter().position(|&corner| corner == INFINITE)
    }

    /// The orientation with one corner, finite or not, moved to `position`; the others are finite.
    #[inline]
    pub(crate) fn orientation_with(&self, tet: u32, slot: usize, position: &[f64; 3]) -> f64 {
        let corners = self.corners[tet as usize];
        let at = |k: usize| if k == slot { position } else { &self.points[corners[k] as usize] };
        orientation(at(0), at(1), at(2), at(3))
    }

    /// The tetrahedron made last: a walk to a point close to it starts here.
    pub(super) fn last(&self) -> u32 {
        self.last
    }

    /// Whether there is space for so many more tetrahedra.
    pub(super) fn has_space_for(&self, more: usize) -> bool {
        self.corners.len() + more <= self.most
    }

    /// Starts keeping a tetrahedron for every point and a list of new tetrahedra, and allows locked facets.
    pub(crate) fn track(&mut self) {
        self.locked = vec![0; self.corners.len()];
        self.tet_of = vec![NONE; self.points.len()];
        for tet in 0..self.slots() {
            if self.is_alive(tet) {
                for corner in self.corners(tet) {
                    if let Some(entry) = self.tet_of.get_mut(corner as usize) {
                        *entry = tet;
                    }
                }
            }
        }
    }

    /// A tetrahedron at a point; [`NONE`] for a point that is not a corner.
    pub(crate) fn tet_at(&self, point: u32) -> u32 {
        self.tet_of.get(point as usize).copied().unwrap_or(NONE)
    }

    /// Takes one of the tetrahedra made since [`Triangulation::track`] off the list; it may be gone by now.
    pub(super) fn next_changed(&mut self) -> Option<u32> {
        self.changed.pop()
    }

    /// Lists every tetrahedron as new.
    #[cfg(test)]
    pub(crate) fn list_all_as_changed(&mut self) {
        self.changed = (0..self.slots()).collect();
    }

    /// Whether the facet opposite a corner must stay.
    #[inline]
    pub(crate) fn is_locked(&self, tet: u32, slot: usize) -> bool {
        self.locked.get(tet as usize).is_some_and(|bits| bits >> slot & 1 == 1)
    }

    /// Locks or unlocks a facet, on both of its sides.
    pub(crate) fn set_locked(&mut self, tet: u32, slot: usize, lock: bool) {
        let (other, back) = self.across(tet, slot);
        for (tet, slot) in [(tet, slot), (other, back)] {
            let bits = &mut self.locked[tet as usize];
            *bits = if lock { *bits | 1 << slot } else { *bits & !(1 << slot) };
        }
    }

    /// Locks the facet of a new tetrahedron, whose other side is locked.
    pub(super) fn lock_new_side(&mut self, tet: u32, slot: usize) {
        self.locked[tet as usize] |= 1 << slot;
    }

    /// A point more, which is no corner yet. Only after [`Triangulation::track`].
    pub(super) fn add_point(&mut self, position: [f64; 3]) -> u32 {
        self.points.push(position);
        self.tet_of.push(NONE);
        (self.points.len() - 1) as u32
    }

    /// A new tetrahedron, with no facet locked. Links from its neighbours to it are up to the caller.
    pub(super) fn put(&mut self, corners: [u32; 4], neighbours: [u32; 4]) -> u32 {
        let tet = self.free.pop().unwrap_or_else(|| {
            self.corners.push(corners);
            self.neighbours.push(neighbours);
            self.mark.push(0);
            (self.corners.len() - 1) as u32
        });
        self.corners[tet as usize] = corners;
        self.neighbours[tet as usize] = neighbours;
        self.mark[tet as usize] = 0;
        if !self.tet_of.is_empty() {
            self.locked.resize(self.corners.len(), 0);
            self.locked[tet as usize] = 0;
            self.changed.push(tet);
            for corner in corners.into_iter().filter(|&corner| corner != INFINITE) {
                self.tet_of[corner as usize] = tet;
            }
        }
        self.last = tet;
        tet
    }

    /// Frees a tetrahedron's slot. Its links stay until the slot is used again.
    #[inline]
    pub(super) fn retire(&mut self, tet: u32) {
        self.corners[tet as usize] = DEAD;
        self.free.push(tet);
    }

    /// Sets what is across a facet, as seen from one side.
    #[inline]
    pub(super) fn link(&mut self, tet: u32, slot: usize, other: u32) {
        self.neighbours[tet as usize][slot] = other;
    }

    /// Makes the links of `tet` to `old` lead to `new`.
    #[inline]
    pub(super) fn relink(&mut self, tet: u32, old: u32, new: u32) {
        for neighbour in &mut self.neighbours[tet as usize] {
            if *neighbour == old {
                *neighbour = new;
            }
        }
    }

    /// Begins a new selection: no tetrahedron is selected or rejected.
    pub(super) fn begin_selection(&mut self) {
        self.stamp += 2;
    }

    #[inline]
    pub(super) fn select(&mut self, tet: u32) {
        self.mark[tet as usize] = self.stamp;
    }

    #[inline]
    pub(super) fn reject(&mut self, tet: u32) {
        self.mark[tet as usize] = self.stamp + 1;
    }

    #[inline]
    pub(super) fn is_selected(&self, tet: u32) -> bool {
        self.mark[tet as usize] == self.stamp
    }

    /// Whether a tetrahedron was selected in the selection before this one, and not touched since.
    #[inline]
    pub(super) fn was_selected(&self, tet: u32) -> bool {
        self.mark[tet as usize] == self.stamp - 2
    }

    /// Whether a tetrahedron is selected or rejected.
    #[inline]
    pub(super) fn is_decided(&self, tet: u32) -> bool {
        self.mark[tet as usize] >= self.stamp
    }

    /// The buffers of the region that gives way to a point; [`Triangulation::keep_region`] brings them back.
    pub(super) fn lend_region(&mut self) -> Region {
        std::mem::take(&mut self.region)
    }

    pub(super) fn keep_region(&mut self, region: Region) {
        self.region = region;
    }
}

#[inline]
fn position_of(four: &[u32; 4], wanted: u32) -> usize {
    usize::from(four[0] != wanted) * (1 + usize::from(four[1] != wanted) * (1 + usize::from(four[2] != wanted)))
}
