//! Triangles that face the wrong way, individually, in patches, or in whole components.

use super::sides::{Sides, UNDECIDED, sides};
use crate::surface::{triangle_areas, weld_vertices};
use crate::{MeshError, TriangleMesh};

/// Patches whose triangles agree to less than this fraction of their area do not show which way they were meant.
const CLEAR_MAJORITY: f64 = 0.75;
/// Around a patch within a solid the winding number is 1, next to a solid it is 0.
const WITHIN: f64 = 0.5;

/// A mesh with corrected orientation, and what was changed. Patches are pieces connected through edges with exactly two
/// triangles; vertices at exactly one place count as one.
#[derive(Clone, Debug, PartialEq)]
pub struct OrientedPatches {
    /// The mesh with the same vertices and triangles, some with two corners swapped.
    pub mesh: TriangleMesh,
    /// Patch of every triangle, numbered by their first triangles; [`Self::NO_PATCH`] for triangles that have two
    /// corners at one place and so have no side.
    pub patch_of: Vec<u32>,
    /// The result for every patch.
    pub patches: Vec<OrientedPatch>,
    /// Triangles that were reversed, ascending.
    pub turned: Vec<u32>,
    /// Pairs of triangles that share an edge and still disagree, because going round a Möbius strip leads to the other
    /// side: each ascending, sorted.
    pub contradictions: Vec<[u32; 2]>,
}

/// One patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedPatch {
    /// Number of triangles, including duplicates.
    pub triangles: usize,
    /// How many of them were reversed.
    pub turned: usize,
    /// The mean winding number of both its sides as it is now, due to itself and the larger patches around it: ½ for
    /// the sound skin of a solid or of a hole in a solid, near 0 for a flat sheet, more for a part within another.
    /// `None` if it was not tested because there are too many.
    pub mean_winding: Option<f64>,
    /// How its side was chosen.
    pub verdict: PatchVerdict,
}

/// How the side of a patch was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchVerdict {
    /// By the winding number.
    Decided,
    /// It is so open or flat that neither side is the inside; it has the side that most of its area had.
    Open,
    /// It is within a solid, where it may bound a hole or be a separate part, and its triangles did not agree; it was
    /// turned outwards.
    Within,
    /// It has only one side, like a Möbius strip; its triangles agree except at some edges.
    OneSided,
    /// There were too many larger patches; it has the side that most of its area had.
    NotLookedAt,
}

impl OrientedPatches {
    /// The patch of a triangle that belongs to none.
    pub const NO_PATCH: u32 = u32::MAX;

    /// Patches whose side was not decided by the winding number, ascending.
    pub fn undecided(&self) -> impl Iterator<Item = u32> {
        let patches = self.patches.iter().enumerate();
        patches.filter(|(_, p)| p.verdict != PatchVerdict::Decided).map(|(index, _)| index as u32)
    }
}

/// Reverses triangles so that neighbours agree and the winding number just inside is that of a solid.
///
/// Each patch is first made consistent, breadth first across its edges; then its side is chosen by the winding number
/// (thesis 8.4) together with the larger patches, as in [`crate::orientation::flipped_components`]. Duplicates of a
/// triangle (at the same three places, in either orientation) follow the first. Patches that meet at edges with three
/// or more triangles are judged separately.
pub fn orient_patches(mesh: &TriangleMesh) -> Result<OrientedPatches, MeshError> {
    mesh.validate()?;
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let places: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let first_copy = first_copies(&places);
    let joints = joints(&places, &first_copy);
    let mut patching = Patching::new(places.len());
    for triangle in 0..places.len() as u32 {
        if first_copy[triangle as usize] == Some((triangle, false)) {
            patching.spread(triangle, &joints);
        }
    }
    for (triangle, first) in first_copy.iter().enumerate() {
        if let &Some((first, opposite)) = first
            && first != triangle as u32
        {
            patching.follow(triangle, first as usize, opposite);
        }
    }
    decide(mesh, patching)
}

/// For every triangle, the first one at the same three places, and whether that one has the opposite orientation;
/// `None` for triangles that have two corners at one place.
fn first_copies(places: &[[u32; 3]]) -> Vec<Option<(u32, bool)>> {
    let has_sides = |&[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    let is_even = |[a, b, c]: [u32; 3]| (u32::from(a > b) + u32::from(b > c) + u32::from(a > c)).is_multiple_of(2);
    let sorted = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let mut order: Vec<u32> = (0..places.len() as u32).filter(|&t| has_sides(&places[t as usize])).collect();
    order.sort_by_cached_key(|&t| (sorted(places[t as usize]), t));
    let mut first_copy = vec![None; places.len()];
    for same in order.chunk_by(|&s, &t| sorted(places[s as usize]) == sorted(places[t as usize])) {
        let even = is_even(places[same[0] as usize]);
        for &t in same {
            first_copy[t as usize] = Some((same[0], is_even(places[t as usize]) != even));
        }
    }
    first_copy
}

/// For the edges of every triangle, the single triangle across, and whether the two run along the edge the same way, so
/// that one of them must be reversed.
type Joints = Vec<[Option<(u32, bool)>; 3]>;

fn joints(places: &[[u32; 3]], first_copy: &[Option<(u32, bool)>]) -> Joints {
    let mut sides: Vec<([u32; 2], bool, u32, usize)> = Vec::with_capacity(3 * places.len());
    for (t, corners) in places.iter().enumerate() {
        if first_copy[t] != Some((t as u32, false)) {
            continue;
        }
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            sides.push(([from.min(to), from.max(to)], from < to, t as u32, k));
        }
    }
    sides.sort_unstable();
    let mut joints = vec![[None; 3]; places.len()];
    for around in sides.chunk_by(|a, b| a.0 == b.0) {
        if let &[(_, forward, s, j), (_, other, t, k)] = around {
            joints[s as usize][j] = Some((t, forward == other));
            joints[t as usize][k] = Some((s, forward == other));
        }
    }
    joints
}

struct Patching {
    patch_of: Vec<u32>,
    /// Whether a triangle runs against the first one of its patch.
    against: Vec<bool>,
    members: Vec<Vec<u32>>,
    one_sided: Vec<bool>,
    contradictions: Vec<[u32; 2]>,
}

impl Patching {
    fn new(count: usize) -> Self {
        Self {
            patch_of: vec![OrientedPatches::NO_PATCH; count],
            against: vec![false; count],
            members: Vec::new(),
            one_sided: Vec::new(),
            contradictions: Vec::new(),
        }
    }

    /// Makes a new patch of everything connected to `first`, breadth first, unless it already has one.
    fn spread(&mut self, first: u32, joints: &Joints) {
        if self.patch_of[first as usize] != OrientedPatches::NO_PATCH {
            return;
        }
        let patch = self.members.len() as u32;
        self.patch_of[first as usize] = patch;
        let mut members = vec![first];
        let mut one_sided = false;
        let mut next = 0;
        while let Some(&from) = members.get(next) {
            next += 1;
            for (to, same_way) in joints[from as usize].into_iter().flatten() {
                let against = self.against[from as usize] != same_way;
                if self.patch_of[to as usize] == OrientedPatches::NO_PATCH {
                    self.patch_of[to as usize] = patch;
                    self.against[to as usize] = against;
                    members.push(to);
                } else if self.against[to as usize] != against {
                    one_sided = true;
                    if from < to {
                        self.contradictions.push([from, to]);
                    }
                }
            }
        }
        self.members.push(members);
        self.one_sided.push(one_sided);
    }

    fn follow(&mut self, copy: usize, first: usize, opposite: bool) {
        let patch = self.patch_of[first];
        self.patch_of[copy] = patch;
        self.against[copy] = self.against[first] != opposite;
        self.members[patch as usize].push(copy as u32);
    }
}

fn decide(mesh: &TriangleMesh, mut patching: Patching) -> Result<OrientedPatches, MeshError> {
    // Each patch first takes the side that most of its area has.
    let mut is_clear = Vec::with_capacity(patching.members.len());
    let areas = triangle_areas(mesh)?;
    for members in &patching.members {
        let sum = |against: bool| -> f64 {
            members.iter().filter(|&&t| patching.against[t as usize] == against).map(|&t| areas[t as usize]).sum()
        };
        let (with, against) = (sum(false), sum(true));
        is_clear.push(with.max(against) >= CLEAR_MAJORITY * (with + against));
        if against > with {
            members.iter().for_each(|&t| patching.against[t as usize] ^= true);
        }
    }
    let agreeing = turned_where(mesh, &patching.against);
    let mut is_flipped = vec![false; patching.members.len()];
    let found = sides(&agreeing, &patching.members, |patch, Sides { own, around }| {
        let unclear = !is_clear[patch] && own.abs() > UNDECIDED;
        is_flipped[patch] = !patching.one_sided[patch] && if unclear { own < 0.0 } else { own + around < -UNDECIDED };
        is_flipped[patch]
    })?;
    let mut patches = Vec::with_capacity(found.len());
    for (patch, members) in patching.members.iter().enumerate() {
        let sign = if is_flipped[patch] { -1.0 } else { 1.0 };
        if is_flipped[patch] {
            members.iter().for_each(|&t| patching.against[t as usize] ^= true);
        }
        let verdict = match found[patch] {
            _ if patching.one_sided[patch] => PatchVerdict::OneSided,
            None => PatchVerdict::NotLookedAt,
            Some(s) if s.own.abs() <= UNDECIDED => PatchVerdict::Open,
            Some(s) if s.around >= WITHIN && !is_clear[patch] => PatchVerdict::Within,
            Some(_) => PatchVerdict::Decided,
        };
        patches.push(OrientedPatch {
            triangles: members.len(),
            turned: members.iter().filter(|&&t| patching.against[t as usize]).count(),
            mean_winding: found[patch].map(|s| sign * s.own + s.around),
            verdict,
        });
    }
    patching.contradictions.sort_unstable();
    Ok(OrientedPatches {
        mesh: turned_where(mesh, &patching.against),
        turned: (0..mesh.triangles.len() as u32).filter(|&t| patching.against[t as usize]).collect(),
        patch_of: patching.patch_of,
        patches,
        contradictions: patching.contradictions,
    })
}

fn turned_where(mesh: &TriangleMesh, turn: &[bool]) -> TriangleMesh {
    let turned = |(&[a, b, c], &turn): (&[u32; 3], &bool)| if turn { [a, c, b] } else { [a, b, c] };
    TriangleMesh { vertices: mesh.vertices.clone(), triangles: mesh.triangles.iter().zip(turn).map(turned).collect() }
}
