//! Bone heat weights (Baran & Popović 2007, section 4; thesis 6.2.3).
//!
//! Each bone in turn is hot and all others are cold; a vertex takes heat from the bones nearest to it that it sees
//! through the inside of the shape, and heat spreads along the surface until it rests:
//! `(-Δ + H) w_i = H p_i`, or with the mass matrix in front, which makes it symmetric,
//! `(-L + M H) w_i = M H p_i`.
//! `L` is that of the intrinsic Delaunay triangulation: `-L` has no positive entry beside its diagonal, so weights lie
//! between 0 and 1 (a discrete maximum principle) on every mesh, which clamping the negative cotangents of obtuse
//! triangles would also give, but at the price of a different operator. As the shares `p_i` of all bones sum to one, so do the weights.

use std::ops::ControlFlow;

use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;

use crate::heat_sources::nearest_bones;
use crate::heat_surface::HeatSurface;
use crate::heat_system::{HeatSystem, zeros};
use crate::{BoneSegment, CholeskyError, Phase, Progress, SparseCholesky, Visibility, WeightMatrix};

/// How heat spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneHeatSettings {
    /// `c` in `H_jj = c / d²`: how strongly bones heat compared with how fast heat spreads; more makes narrower
    /// transitions. The paper's `c = 1` is 3 here: its authors' program weighs `H` by the whole area of the triangles
    /// around a vertex, of which a third is the vertex's own, and Blender's weights on the shared test characters
    /// are likewise matched best by 3 to 4. (Their other value, 0.22, for transitions as wide as those of heat that
    /// spreads through the volume, is then 0.66.)
    pub heat: f64,
    /// Bones whose distances from a vertex agree within this fraction are equally near and share it.
    pub tie_ratio: f64,
    /// Vertices nearer to each other than this fraction of half the mesh's largest extent are one vertex to heat:
    /// the seams of texture coordinates and of triangle soups. Zero joins only equal positions.
    pub weld_ratio: f64,
    /// Whether bones behind a wall heat a vertex.
    pub visibility: Visibility,
}

impl Default for BoneHeatSettings {
    fn default() -> Self {
        Self { heat: 3.0, tie_ratio: 1e-4, weld_ratio: 1e-7, visibility: Visibility::Inside }
    }
}

/// Weights, and how far to trust them.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneHeat {
    /// n vertices × m bones, each within 0..=1, each vertex's summing to one.
    pub weights: WeightMatrix,
    /// Largest relative residual `‖A w - b‖ / (‖A‖ ‖w‖ + ‖b‖)` over all bones, maximum norms.
    pub residual: f64,
    /// Largest amount by which a solution left 0..=1, or a vertex's sum left one, before both were put right.
    pub deviation: f64,
    /// What was found on the way.
    pub report: BoneHeatReport,
}

/// What was found on the way; all of it may be shown to an animator.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BoneHeatReport {
    /// Vertices left after joining those at one place.
    pub welded_vertices: usize,
    /// Pieces that the surface falls into; a vertex in no triangle is a piece of its own.
    pub components: usize,
    /// First vertex of every piece none of whose vertices sees a bone. These follow their nearest bones unseen.
    pub blind_components: Vec<usize>,
    /// Vertices that see none of their nearest bones; heat reaches them along the surface.
    pub blind_vertices: usize,
    /// Bones that heat no vertex; their weights are zero everywhere.
    pub cold_bones: Vec<usize>,
    /// Vertices in no triangle with an area. They follow their nearest bones.
    pub isolated_vertices: usize,
    /// Triangles that were left out because two of their corners are one vertex.
    pub collapsed_triangles: usize,
    /// Triangles with hardly an area, between three different vertices; they conduct as very thin ones.
    pub degenerate_triangles: usize,
    /// Triangles that were left out because another has the same corners.
    pub duplicate_triangles: usize,
    /// Edges flipped within the surface, so that heat flows from warm to cold across each.
    pub flipped_edges: usize,
    /// Edges across which heat would still have flowed backwards, and which were closed.
    pub clamped_edges: usize,
}

/// Why there are no weights.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BoneHeatError {
    /// The mesh is empty, names vertices that are not there, or is not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There is nothing to follow.
    #[error("there are no bones to follow; add at least one bone or point handle")]
    NoBones,
    /// More bones than an influence can index.
    #[error("{count} bones are more than the {limit} this program can hold")]
    TooManyBones {
        /// Bones given.
        count: usize,
        /// Bones possible.
        limit: usize,
    },
    /// A bone's end is NaN, infinite, or so far from the mesh that distances overflow.
    #[error("bone {bone} does not lie anywhere near the mesh, or its position is not a finite number")]
    BoneOutOfReach {
        /// Zero-based bone.
        bone: usize,
    },
    /// A setting is out of its range.
    #[error("the setting {name} is {value}; it has to be {allowed}")]
    BadSetting {
        /// The setting's name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The linear system could not be factorised.
    #[error("the heat equation could not be solved: {0}; repair the mesh's degenerate triangles and try again")]
    Factorisation(#[from] CholeskyError),
    /// The solution is too inaccurate to be used.
    #[error(
        "the heat equation was solved only to a residual of {residual:.1e} and weights that miss their range or sum \
         by {deviation:.1e}; repair the mesh's degenerate triangles and try again"
    )]
    Inaccurate {
        /// Relative residual reached.
        residual: f64,
        /// Largest distance of a weight from 0..=1 or of a sum from one.
        deviation: f64,
    },
    /// The dense weights do not fit into memory.
    #[error("there is not enough memory for the weights of {vertices} vertices on {bones} bones")]
    OutOfMemory {
        /// Vertices of the mesh.
        vertices: usize,
        /// Bones that need a column.
        bones: usize,
    },
    /// The progress callback asked to stop.
    #[error("stopped while {}", .0.label())]
    Cancelled(Phase),
}

/// A residual or deviation above this is a numerical failure: a factorisation that works leaves less than 1e-12.
const FAILURE: f64 = 1e-6;

/// Computes how much every vertex of `mesh` follows every bone.
///
/// Bones and mesh share one space and unit; scaling or moving both changes nothing beside rounding. Open,
/// non-manifold and disconnected meshes are fine. `progress` is called a few times a phase; returning `Break`
/// stops the computation.
pub fn bone_heat(
    mesh: &TriangleMesh,
    bones: &[BoneSegment],
    settings: &BoneHeatSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<BoneHeat, BoneHeatError> {
    let mut report_at = |phase, done| match progress(Progress { phase, done }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(BoneHeatError::Cancelled(phase)),
    };
    settings.check()?;
    report_at(Phase::Prepare, 0.0)?;
    let surface = HeatSurface::new(mesh, settings.weld_ratio)?;
    let local_bones = bones_on(&surface, bones)?;
    let mut stopped = None;
    let nearest = nearest_bones(&surface, &local_bones, settings, |done| {
        stopped = report_at(Phase::Visibility, 0.2 + 0.2 * done).err();
        stopped.is_none()
    })?;
    if let Some(error) = stopped {
        return Err(error);
    }
    report_at(Phase::Factorise, 0.4)?;
    let system = HeatSystem::new(&surface, &nearest, bones.len(), settings.heat)?;
    let factor = SparseCholesky::new(&system.matrix)?;
    let mut solutions = zeros(factor.rows(), system.hot_bones.len())?;
    solutions.copy_from_slice(&system.right_hand_sides);
    let columns = system.hot_bones.len().max(1) as f64;
    factor.solve_in_place(&mut solutions, |done| {
        stopped = report_at(Phase::Solve, 0.6 + 0.35 * done as f64 / columns).err();
        stopped.is_none()
    })?;
    if let Some(error) = stopped {
        return Err(error);
    }
    report_at(Phase::Finish, 0.95)?;
    let residual = system.residual(&solutions);
    let deviation = put_right(&mut solutions, surface.mesh.vertices.len());
    // Negated, so that NaN fails too.
    if !(residual <= FAILURE && deviation <= FAILURE) {
        return Err(BoneHeatError::Inaccurate { residual, deviation });
    }
    let weights = spread(&solutions, &system.hot_bones, &surface, bones.len())?;
    Ok(BoneHeat { weights, residual, deviation, report: system.report })
}

impl BoneHeatSettings {
    fn check(&self) -> Result<(), BoneHeatError> {
        let bad = |name, value, allowed| Err(BoneHeatError::BadSetting { name, value, allowed });
        if !(1e-6..=1e6).contains(&self.heat) {
            return bad("heat", self.heat, "between 1e-6 and 1e6");
        }
        if !(0.0..=1.0).contains(&self.tie_ratio) {
            return bad("tie_ratio", self.tie_ratio, "between 0 and 1");
        }
        if !(0.0..=0.1).contains(&self.weld_ratio) {
            return bad("weld_ratio", self.weld_ratio, "between 0 and 0.1");
        }
        Ok(())
    }
}

/// The bones in the surface's scale.
fn bones_on(surface: &HeatSurface, bones: &[BoneSegment]) -> Result<Vec<(DVec3, DVec3)>, BoneHeatError> {
    let limit = usize::from(u16::MAX);
    if bones.is_empty() {
        return Err(BoneHeatError::NoBones);
    }
    if bones.len() > limit {
        return Err(BoneHeatError::TooManyBones { count: bones.len(), limit });
    }
    let local: Vec<_> = bones.iter().map(|b| (surface.here(b.head), surface.here(b.tail))).collect();
    // Squares of distances beyond this many mesh sizes would come near the end of f64.
    let reachable = |p: DVec3| p.is_finite() && p.abs().max_element() < 1e100;
    match local.iter().position(|&(head, tail)| !reachable(head) || !reachable(tail)) {
        Some(bone) => Err(BoneHeatError::BoneOutOfReach { bone }),
        None => Ok(local),
    }
}

/// Brings weights into 0..=1 and each vertex's sum to one; returns the largest change that took.
fn put_right(solutions: &mut [f64], n: usize) -> f64 {
    let mut sums = vec![0.0; n];
    let mut worst: f64 = 0.0;
    for column in solutions.chunks_exact_mut(n) {
        for (value, sum) in column.iter_mut().zip(&mut sums) {
            let inside = value.clamp(0.0, 1.0);
            let change = (*value - inside).abs();
            worst = if change.is_nan() { f64::INFINITY } else { worst.max(change) };
            *value = inside;
            *sum += inside;
        }
    }
    for column in solutions.chunks_exact_mut(n) {
        for (value, sum) in column.iter_mut().zip(&sums) {
            *value /= sum;
        }
    }
    sums.iter().fold(worst, |worst, sum| worst.max((sum - 1.0).abs()))
}

/// From welded vertices and hot bones back to all vertices and bones.
fn spread(
    solutions: &[f64],
    hot_bones: &[usize],
    surface: &HeatSurface,
    bone_count: usize,
) -> Result<WeightMatrix, BoneHeatError> {
    let (n, welded) = (surface.welded_of.len(), surface.mesh.vertices.len());
    let mut values = zeros(n, bone_count)?;
    for (column, &bone) in solutions.chunks_exact(welded).zip(hot_bones) {
        for (value, &from) in values[bone * n..(bone + 1) * n].iter_mut().zip(&surface.welded_of) {
            *value = column[from as usize];
        }
    }
    WeightMatrix::from_columns(n, bone_count, &values)
        .ok_or(BoneHeatError::OutOfMemory { vertices: n, bones: bone_count })
}
