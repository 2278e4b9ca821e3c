//! Bone heat weights (Baran & Popović 2007, section 4; thesis 6.2.3).
//!
//! Each bone in turn is hot and all others are cold. A vertex takes heat from those of its nearest bones that it sees
//! through the inside of the shape, and heat spreads along the surface to equilibrium:
//! `(-Δ + H) w_i = H p_i`, or, multiplied by the mass matrix to make it symmetric,
//! `(-L + M H) w_i = M H p_i`.
//! `L` is that of the intrinsic Delaunay triangulation: `-L` has no positive entry off its diagonal, so weights lie
//! between 0 and 1 (a discrete maximum principle) on every mesh. Clamping the negative cotangents of obtuse triangles
//! would also achieve that, but with a different operator. As the shares `p_i` of all bones sum to one, so do the
//! weights.

use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use glam::DVec3;

use super::settings::{BoneHeatError, BoneHeatReport, BoneHeatSettings};
use super::sources::nearest_bones;
use super::surface::HeatSurface;
use super::system::{HeatSystem, zeros};
use crate::bone_segment::BoneSegment;
use crate::progress::report;
use crate::sparse::cholesky::SparseCholesky;
use crate::weight_matrix::WeightMatrix;

/// Weights, and how accurate they are.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneHeat {
    /// n vertices × m bones, each within 0..=1; each vertex's sum to one.
    pub weights: WeightMatrix,
    /// Largest relative residual `‖A w - b‖ / (‖A‖ ‖w‖ + ‖b‖)` over all bones, maximum norms.
    pub residual: f64,
    /// Largest amount by which a solution left 0..=1, or a vertex's sum differed from one, before both were corrected.
    pub deviation: f64,
    /// What was found along the way.
    pub report: BoneHeatReport,
}

/// A residual or deviation above this is a numerical failure: a factorisation that works leaves less than 1e-12.
const FAILURE: f64 = 1e-6;

/// Computes how much every vertex of `mesh` follows every bone.
///
/// Bones and mesh share one space and unit; scaling or moving both changes the weights by no more than rounding. Open,
/// non-manifold and disconnected meshes are fine. `progress` receives the current stage and the fraction of the whole
/// that is done, 0 to 1 and never falling; returning `Break` stops the computation.
pub fn bone_heat(
    mesh: &TriangleMesh,
    bones: &[BoneSegment],
    settings: &BoneHeatSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<BoneHeat, BoneHeatError> {
    settings.check()?;
    report(progress, "preparing the surface", 0.0)?;
    let surface = HeatSurface::new(mesh, settings.weld_ratio)?;
    let local_bones = bones_on(&surface, bones)?;
    let mut stopped = None;
    let nearest = nearest_bones(&surface, &local_bones, settings, |done| {
        stopped = report(progress, "looking for bones", 0.2 + 0.2 * done).err();
        stopped.is_none()
    })?;
    if let Some(error) = stopped {
        return Err(error.into());
    }
    report(progress, "factorising the heat equation", 0.4)?;
    let system = HeatSystem::new(&surface, &nearest, bones.len(), settings.heat)?;
    let factor = SparseCholesky::new(&system.matrix)?;
    let mut solutions = zeros(factor.rows(), system.hot_bones.len())?;
    solutions.copy_from_slice(&system.right_hand_sides);
    let columns = system.hot_bones.len().max(1) as f64;
    factor.solve_in_place(&mut solutions, |done| {
        stopped = report(progress, "diffusing heat", 0.6 + 0.35 * done as f64 / columns).err();
        stopped.is_none()
    })?;
    if let Some(error) = stopped {
        return Err(error.into());
    }
    report(progress, "checking the weights", 0.95)?;
    let residual = system.residual(&solutions);
    let deviation = put_right(&mut solutions, surface.mesh.vertices.len());
    // Negated, so that NaN fails too.
    if !(residual <= FAILURE && deviation <= FAILURE) {
        return Err(BoneHeatError::Inaccurate { residual, deviation });
    }
    let weights = spread(&solutions, &system.hot_bones, &surface, bones.len())?;
    Ok(BoneHeat { weights, residual, deviation, report: system.report })
}

/// The bones at the surface's scale.
fn bones_on(surface: &HeatSurface, bones: &[BoneSegment]) -> Result<Vec<(DVec3, DVec3)>, BoneHeatError> {
    let limit = usize::from(u16::MAX);
    if bones.is_empty() {
        return Err(BoneHeatError::NoBones);
    }
    if bones.len() > limit {
        return Err(BoneHeatError::TooManyBones { count: bones.len(), limit });
    }
    let local: Vec<_> = bones.iter().map(|b| (surface.here(b.head), surface.here(b.tail))).collect();
    // Squares of distances beyond this many mesh sizes would approach the limit of f64.
    let reachable = |p: DVec3| p.is_finite() && p.abs().max_element() < 1e100;
    match local.iter().position(|&(head, tail)| !reachable(head) || !reachable(tail)) {
        Some(bone) => Err(BoneHeatError::BoneOutOfReach { bone }),
        None => Ok(local),
    }
}

/// Corrects weights to 0..=1 and each vertex's sum to one; returns the largest change that took.
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
