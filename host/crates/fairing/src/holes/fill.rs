//! Surfaces that close holes, or join several rims.

use std::ops::Range;

use armature_geometry::surface::vertex_triangles;
use armature_geometry::{MeshError, Progress, TriangleMesh};

use glam::DVec3;

use super::hole::Holes;
use super::welded::Welded;
use crate::mixed::FairingError;
use crate::patch::{Around, DomainSettings, NoPatch, PatchOutcome, PatchSettings, make_blend, make_patch};

/// Why nothing was filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There is no such hole.
    #[error("there is no hole {}; the mesh has {count}", .index + 1)]
    NoSuchHole {
        /// Zero-based.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A blend needs at least two rims.
    #[error("a blend joins two rims or more; {given} is given")]
    TooFewRims {
        /// How many were given.
        given: usize,
    },
    /// Two rims of a blend share a vertex.
    #[error("the rims to be joined share vertex {vertex}; there is no room for a surface between them")]
    RimsTouch {
        /// The vertex.
        vertex: u32,
    },
    /// The progress callback stopped the work.
    #[error("stopped while {stage}")]
    Cancelled {
        /// During this.
        stage: &'static str,
    },
}

/// What became of a hole, or of a blend's rims.
#[derive(Clone, Debug, PartialEq)]
pub enum HoleOutcome {
    /// Filled, and another round would change nothing worth seeing.
    Settled,
    /// Filled, but the rounds ended while vertices still moved.
    RoundsEnded {
        /// How far the last round moved a vertex across the surface, in lengths of the rim's edges.
        last_move: f64,
    },
    /// Filled, but a later round could not be solved: the surface is that of the round before, and may be folded.
    RoundFailed(FairingError),
    /// Left open: no triangles were found that have no edge of the surface around.
    NoTriangles,
    /// Left open: the surface went far beyond its rim, because tangents there are too long, too bent, or contradict each
    /// other, as at slivers.
    Thrown,
    /// Left open: the surface could not be solved for.
    NotSolved(FairingError),
}

impl HoleOutcome {
    /// Whether there is a surface now.
    pub fn is_filled(&self) -> bool {
        matches!(self, Self::Settled | Self::RoundsEnded { .. } | Self::RoundFailed(_))
    }
}

/// One surface that was made, or not.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledHole {
    /// Indices of the holes that it closes: one, or those of a blend.
    pub holes: Vec<usize>,
    /// Its new vertices.
    pub vertices: Range<u32>,
    /// Its triangles.
    pub triangles: Range<usize>,
    /// Rounds of refining and solving.
    pub rounds: usize,
    /// Of the last linear system.
    pub residual: f64,
    /// How it went.
    pub outcome: HoleOutcome,
}

/// A mesh with holes closed.
#[derive(Clone, Debug, PartialEq)]
pub struct Filled {
    /// All vertices and triangles of the original, unchanged and first; then those of the patches.
    pub mesh: TriangleMesh,
    /// In the order asked for.
    pub patches: Vec<FilledHole>,
}

/// How holes are filled.
pub type FillSettings = PatchSettings;

/// Closes each of the `chosen` holes of `mesh` by a surface of its own. One that fails stays open and says why.
pub fn fill_holes(
    mesh: &TriangleMesh,
    holes: &Holes,
    chosen: &[usize],
    settings: &FillSettings,
    progress: Progress<'_>,
) -> Result<Filled, FillError> {
    let groups: Vec<Vec<usize>> = chosen.iter().map(|&hole| vec![hole]).collect();
    make(mesh, holes, &groups, "filling holes", &|around| make_patch(around, settings), progress)
}

/// Joins the rims of the `chosen` holes, two or more, by one surface.
pub fn blend_rims(
    mesh: &TriangleMesh,
    holes: &Holes,
    chosen: &[usize],
    settings: &FillSettings,
    progress: Progress<'_>,
) -> Result<Filled, FillError> {
    check_apart(holes, chosen)?;
    make(mesh, holes, &[chosen.to_vec()], JOINING, &|around| make_patch(around, settings), progress)
}

/// Joins the rims of two holes by a function on a parameter domain.
pub fn blend_on_domain(
    mesh: &TriangleMesh,
    holes: &Holes,
    chosen: [usize; 2],
    settings: &DomainSettings,
    progress: Progress<'_>,
) -> Result<Filled, FillError> {
    check_apart(holes, &chosen)?;
    make(mesh, holes, &[chosen.to_vec()], JOINING, &|around| make_blend(around, settings), progress)
}

const JOINING: &str = "joining rims";

fn check_apart(holes: &Holes, chosen: &[usize]) -> Result<(), FillError> {
    if chosen.len() < 2 {
        return Err(FillError::TooFewRims { given: chosen.len() });
    }
    check_exist(holes, chosen)?;
    let mut all: Vec<u32> = chosen.iter().flat_map(|&h| holes.holes[h].rim.iter().copied()).collect();
    all.sort_unstable();
    match all.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(FillError::RimsTouch { vertex: pair[0] }),
        None => Ok(()),
    }
}

fn check_exist(holes: &Holes, chosen: &[usize]) -> Result<(), FillError> {
    let count = holes.holes.len();
    match chosen.iter().find(|&&index| index >= count) {
        Some(&index) => Err(FillError::NoSuchHole { index, count }),
        None => Ok(()),
    }
}

fn make(
    mesh: &TriangleMesh,
    holes: &Holes,
    groups: &[Vec<usize>],
    stage: &'static str,
    patch: &dyn Fn(&Around) -> Result<PatchOutcome, NoPatch>,
    progress: Progress<'_>,
) -> Result<Filled, FillError> {
    groups.iter().try_for_each(|group| check_exist(holes, group))?;
    let welded = Welded::of(mesh)?;
    let fans = vertex_triangles(welded.positions.len(), &welded.triangles);
    let mut filled = Filled { mesh: mesh.clone(), patches: Vec::new() };
    for (index, group) in groups.iter().enumerate() {
        if progress(stage, index as f64 / groups.len() as f64).is_break() {
            return Err(FillError::Cancelled { stage });
        }
        let rims: Vec<Vec<u32>> =
            group.iter().map(|&h| holes.holes[h].rim.iter().map(|&v| welded.joined[v as usize]).collect()).collect();
        let around = Around::of(&welded.positions, &welded.triangles, &fans, &rims, 2);
        let made = patch(&around);
        filled.patches.push(add(&mut filled.mesh, group, &welded, &around, made));
    }
    let _ = progress(stage, 1.0);
    Ok(filled)
}

/// Appends a patch to the mesh.
fn add(
    mesh: &mut TriangleMesh,
    group: &[usize],
    welded: &Welded,
    around: &Around,
    made: Result<PatchOutcome, NoPatch>,
) -> FilledHole {
    let (first, before) = (mesh.vertices.len() as u32, mesh.triangles.len());
    let nothing = |outcome| FilledHole {
        holes: group.to_vec(),
        vertices: first..first,
        triangles: before..before,
        rounds: 0,
        residual: 0.0,
        outcome,
    };
    let made = match made {
        Ok(made) => made,
        Err(NoPatch::NoTriangles) => return nothing(HoleOutcome::NoTriangles),
        Err(NoPatch::Thrown) => return nothing(HoleOutcome::Thrown),
        Err(NoPatch::Fairing(error)) => return nothing(HoleOutcome::NotSolved(error)),
    };
    let held = made.patch.held;
    let original = |v: u32| {
        if (v as usize) < held {
            welded.original[around.vertices[v as usize] as usize]
        } else {
            first + v - held as u32
        }
    };
    mesh.vertices.extend(made.patch.places[held..].iter().map(DVec3::to_array));
    mesh.triangles.extend(made.patch.triangles.iter().map(|t| t.map(original)));
    let outcome = match (made.settled, made.failed) {
        (_, Some(error)) => HoleOutcome::RoundFailed(error),
        (true, None) => HoleOutcome::Settled,
        (false, None) => HoleOutcome::RoundsEnded { last_move: made.last_move },
    };
    FilledHole {
        vertices: first..mesh.vertices.len() as u32,
        triangles: before..mesh.triangles.len(),
        rounds: made.rounds,
        residual: made.residual,
        ..nothing(outcome)
    }
}
