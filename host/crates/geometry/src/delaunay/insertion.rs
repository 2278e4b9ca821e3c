//! One point more: the tetrahedra whose spheres hold it give way to a fan around it (Bowyer 1981, Watson 1981).
//!
//! The triangulation is of the whole of space: each facet of the hull carries a tetrahedron to a point at infinity.
//! A tetrahedron is in conflict with a point that lies *strictly* inside its sphere; one at infinity, if the point
//! lies beyond the facet, or in the facet's plane and strictly inside its circle. With exact signs the facets around
//! the conflicting region are then seen from the point strictly from inside: no flat tetrahedron can arise, however
//! many points lie on one sphere, and no perturbation is needed. (If the point lay in the plane of such a facet, it
//! would lie inside the facet's circle, hence inside the spheres on both sides.)

use crate::predicates::{in_sphere, orientation, same_place};

/// The corner at infinity.
pub(crate) const INFINITE: u32 = u32::MAX;
/// No tetrahedron.
pub(crate) const NONE: u32 = u32::MAX;
const DEAD: [u32; 4] = [INFINITE; 4];

/// A Delaunay triangulation of space that grows point by point.
pub(crate) struct Triangulation {
    /// Positions, in the numbering of the corners.
    pub(crate) points: Vec<[f64; 3]>,
    /// Positively oriented corners; at most one is [`INFINITE`], or all are in a slot out of use.
    pub(crate) corners: Vec<[u32; 4]>,
    /// `neighbours[t][k]` lies across the facet of `t` opposite its corner `k`.
    pub(crate) neighbours: Vec<[u32; 4]>,
    /// Where [`Triangulation::locate`] starts: around the point inserted last.
    pub(crate) last: u32,
    /// A bit for each facet that has to stay, on both of its sides; empty until [`Triangulation::track`].
    pub(super) locked: Vec<u8>,
    /// A tetrahedron at each point; empty until [`Triangulation::track`].
    pub(super) tet_of: Vec<u32>,
    /// Tetrahedra made since then.
    pub(crate) changed: Vec<u32>,
    /// `stamp` if in conflict with the current point, `stamp + 1` if not, anything less if not looked at.
    pub(super) mark: Vec<u32>,
    pub(super) most: usize,
    pub(super) stamp: u32,
    pub(super) free: Vec<u32>,
    pub(super) conflicts: Vec<u32>,
    pub(super) boundary: Vec<BoundaryFacet>,
}

/// A facet between a conflicting tetrahedron and one that stays.
#[derive(Clone, Copy)]
pub(super) struct BoundaryFacet {
    /// The conflicting tetrahedron.
    pub(super) inner: u32,
    /// Its corner opposite the facet.
    pub(super) slot: u8,
    /// What takes its place.
    pub(super) new: u32,
}

/// What became of a point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Inserted {
    /// It is a corner now.
    Yes,
    /// That earlier point lies at the same place.
    DuplicateOf(u32),
    /// There would be more tetrahedra than allowed; nothing was changed.
    Full,
}

impl Triangulation {
    /// The positively oriented tetrahedron `inner`, and infinity; never to have more than `most` tetrahedra.
    pub(crate) fn new(points: Vec<[f64; 3]>, inner: [u32; 4], most: usize) -> Self {
        let mut all = vec![inner];
        for slot in 0..4 {
            let mut outer = inner;
            outer[slot] = INFINITE;
            // Seen from the other side of the facet, the order turns round.
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
            locked: Vec::new(),
            tet_of: Vec::new(),
            changed: Vec::new(),
            mark: vec![0; all.len()],
            corners: all,
            most,
            last: 0,
            stamp: 0,
            free: Vec::new(),
            conflicts: Vec::new(),
            boundary: Vec::new(),
        }
    }

    /// Makes a point a corner.
    pub(crate) fn insert(&mut self, point: u32) -> Inserted {
        let position = self.points[point as usize];
        let start = self.locate(&position);
        let twin = |&&corner: &&u32| corner != INFINITE && same_place(&self.points[corner as usize], &position);
        if let Some(&twin) = self.corners[start as usize].iter().find(twin) {
            return Inserted::DuplicateOf(twin);
        }
        self.find_conflicts(start, &position);
        if self.corners.len() + self.boundary.len() > self.most {
            return Inserted::Full;
        }
        self.fan_out(point);
        Inserted::Yes
    }

    /// The point takes the place of the tetrahedra in conflict.
    pub(super) fn fan_out(&mut self, point: u32) {
        self.fill(point);
        self.stitch();
        for &tet in &self.conflicts {
            self.corners[tet as usize] = DEAD;
        }
        self.free.append(&mut self.conflicts);
    }

    /// Whether the slot holds a tetrahedron, at infinity or not.
    pub(crate) fn is_alive(&self, tet: u32) -> bool {
        self.corners[tet as usize] != DEAD
    }

    /// Which corner is at infinity, if one is.
    pub(crate) fn infinite_slot(&self, tet: u32) -> Option<usize> {
        self.corners[tet as usize].iter().position(|&corner| corner == INFINITE)
    }

    /// The orientation with one corner, finite or not, moved to `position`; the others are finite.
    pub(crate) fn orientation_with(&self, tet: u32, slot: usize, position: &[f64; 3]) -> f64 {
        let corners = self.corners[tet as usize];
        let at = |k: usize| if k == slot { position } else { &self.points[corners[k] as usize] };
        orientation(at(0), at(1), at(2), at(3))
    }

    fn in_conflict(&self, tet: u32, position: &[f64; 3]) -> bool {
        let Some(slot) = self.infinite_slot(tet) else { return self.sphere_holds(tet, position) };
        let beyond = self.orientation_with(tet, slot, position);
        // In the plane of the facet, its circle is where the plane cuts the sphere of the tetrahedron behind.
        beyond > 0.0 || beyond == 0.0 && self.sphere_holds(self.neighbours[tet as usize][slot], position)
    }

    fn sphere_holds(&self, tet: u32, position: &[f64; 3]) -> bool {
        let [a, b, c, d] = self.corners[tet as usize].map(|corner| &self.points[corner as usize]);
        in_sphere(a, b, c, d, position) > 0.0
    }

    /// Whether the facet opposite a corner has to stay.
    pub(crate) fn is_locked(&self, tet: u32, slot: usize) -> bool {
        self.locked.get(tet as usize).is_some_and(|bits| bits >> slot & 1 == 1)
    }

    pub(super) fn find_conflicts(&mut self, start: u32, position: &[f64; 3]) {
        self.stamp += 2;
        self.conflicts.clear();
        self.boundary.clear();
        self.conflicts.push(start);
        self.mark[start as usize] = self.stamp;
        let mut looked_at = 0;
        while looked_at < self.conflicts.len() {
            let inner = self.conflicts[looked_at];
            looked_at += 1;
            for slot in 0..4 {
                let outer = self.neighbours[inner as usize][slot];
                if !self.is_locked(inner, slot) && self.mark[outer as usize] < self.stamp {
                    let in_conflict = self.in_conflict(outer, position);
                    self.mark[outer as usize] = self.stamp + u32::from(!in_conflict);
                    if in_conflict {
                        self.conflicts.push(outer);
                    }
                }
                if self.mark[outer as usize] != self.stamp {
                    self.boundary.push(BoundaryFacet { inner, slot: slot as u8, new: NONE });
                }
            }
        }
    }

    /// A new tetrahedron from each facet of the boundary to the point, linked to what lies outside.
    fn fill(&mut self, point: u32) {
        for index in 0..self.boundary.len() {
            let BoundaryFacet { inner, slot, .. } = self.boundary[index];
            let slot = slot as usize;
            let outer = self.neighbours[inner as usize][slot];
            let mut corners = self.corners[inner as usize];
            corners[slot] = point;
            let mut neighbours = [NONE; 4];
            neighbours[slot] = outer;
            let locked = self.is_locked(inner, slot);
            let new = self.put(corners, neighbours);
            if locked {
                self.locked[new as usize] |= 1 << slot;
            }
            for back in &mut self.neighbours[outer as usize] {
                if *back == inner {
                    *back = new;
                }
            }
            // From here on the way out of the region leads to what is new.
            self.neighbours[inner as usize][slot] = new;
            self.boundary[index].new = new;
            self.last = new;
        }
    }

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
        tet
    }

    /// Takes a tetrahedron out of use.
    pub(super) fn retire(&mut self, tet: u32) {
        self.corners[tet as usize] = DEAD;
        self.free.push(tet);
    }

    /// Links the new tetrahedra with each other: two are neighbours if their facets of the boundary share an edge,
    /// which turning around that edge through the old tetrahedra finds.
    fn stitch(&mut self) {
        for index in 0..self.boundary.len() {
            let BoundaryFacet { inner, slot, new } = self.boundary[index];
            for side in (0..4).filter(|&side| side != slot as usize) {
                if self.neighbours[new as usize][side] != NONE {
                    continue;
                }
                let (mut at, mut behind, mut ahead) = (inner, slot as usize, side);
                let mut next = self.neighbours[at as usize][ahead];
                while self.mark[next as usize] == self.stamp {
                    let hinge = self.corners[at as usize][behind];
                    behind = position_of(&self.neighbours[next as usize], at);
                    ahead = position_of(&self.corners[next as usize], hinge);
                    at = next;
                    next = self.neighbours[at as usize][ahead];
                }
                self.neighbours[new as usize][side] = next;
                self.neighbours[next as usize][behind] = new;
            }
        }
    }
}

pub(super) fn position_of(four: &[u32; 4], wanted: u32) -> usize {
    usize::from(four[0] != wanted) * (1 + usize::from(four[1] != wanted) * (1 + usize::from(four[2] != wanted)))
}
