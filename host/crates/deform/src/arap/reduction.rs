//! The energy of a shape as a quadratic form in its handles' transformations (thesis eq. 7.15).

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::Vec3;

use super::blocks::BlockRows;
use super::clusters::{SparsePoints, rotation_clusters};
use super::constraint::{Anchor, AnchorPoint};
use super::energy::EdgeSets;
use super::error::ArapError;
use super::rotation_limit::LimitedPair;
use super::settings::{ArapSettings, GlobalStep};
use super::shape::{ArapShape, SharedJoint};
use super::weights::WeightRows;
use crate::dense::Dense;

/// Everything about a shape that constraints do not change, in coordinates with its centre at the origin and a radius
/// of about one. `T` stacks the transposed 3×4 transformations, 4m×3.
#[derive(Clone, Debug)]
pub(super) struct Reduction {
    pub(super) handle_count: usize,
    pub(super) cluster_count: usize,
    pub(super) planar: bool,
    /// normalised = (position - centre) / size
    pub(super) centre: [f64; 3],
    pub(super) size: f64,
    /// From the normalised energy to the shape's own units.
    pub(super) energy_unit: f64,
    /// `L̃ = Mᵀ L M`, 4m×4m.
    pub(super) stiffness: BlockRows<4>,
    /// `K̃ = K M`, 3r×4m.
    pub(super) covariance: BlockRows<3>,
    /// `½ Σ c ‖v_i − v_j‖²`.
    pub(super) constant: f64,
    /// `Mᵀ mass M` plus a little of the identity: how far a pose is from rest, to decide what nothing else does.
    pub(super) closeness: BlockRows<4>,
    /// The same matrices with their zeros, for a global step by an inverse.
    pub(super) with_zeros: Option<WithZeros>,
    pub(super) degenerate: usize,
    pub(super) weightless: Vec<usize>,
    pub(super) handle_points: Vec<[f64; 3]>,
    pub(super) joints: Vec<SharedJoint>,
    /// In an `Arc`: it grows with the shape, everything else with the handles.
    pub(super) rows: Arc<LinearBlendRows>,
    /// Soft joints with a limit; their rotations are the last clusters.
    pub(super) limits: Vec<LimitedPair>,
}

/// Stiffness, covariance and closeness of a [`Reduction`] with their zeros.
#[derive(Clone, Debug)]
pub(super) struct WithZeros {
    pub(super) stiffness: Dense,
    pub(super) covariance: Dense,
    pub(super) closeness: Dense,
}

/// The rows of `M` by vertex: the handles with their weights, and the normalised position.
#[derive(Clone, Debug)]
pub(super) struct LinearBlendRows {
    weights: WeightRows,
    positions: Vec<[f64; 3]>,
}

/// Fraction of the identity added to the mass matrix: enough to decide for handles without weight, too little to affect
/// the others noticeably.
const IDENTITY_SHARE: f64 = 1e-6;
/// Fraction of the largest stiffness: far above the rounding error of zero, far below anything noticeable.
const VISCOSITY: f64 = 1e-8;
/// Edges between two calls of the progress callback.
const STRIDE: usize = 1 << 14;

/// Takes the current stage and the fraction of the whole that is done, 0 to 1 and never falling; may stop the work.
pub(super) type Progress<'a> = &'a mut dyn FnMut(&'static str, f64) -> ControlFlow<()>;

/// The stages of reducing a shape.
const GROUPING: &str = "grouping what turns together";
const COVARIANCES: &str = "adding up what pulls at rotations";
const STIFFNESS: &str = "adding up the stiffness";

impl LinearBlendRows {
    /// Adds a multiple of a vertex's row.
    pub(super) fn add(&self, vertex: usize, factor: f64, to: &mut [f64]) {
        let point = homogeneous(self.positions[vertex]);
        for &(handle, weight) in self.weights.of(vertex) {
            let weight = factor * weight;
            let four = &mut to[4 * handle as usize..4 * handle as usize + 4];
            four.iter_mut().zip(point).for_each(|(to, c)| *to += weight * c);
        }
    }

    /// Adds a multiple of a vertex's row to a row of a block row.
    fn add_to_blocks(&self, vertex: usize, factor: f64, to: &mut BlockRows<3>, row: usize, part: usize) {
        let point = homogeneous(self.positions[vertex]);
        for &(handle, weight) in self.weights.of(vertex) {
            let weight = factor * weight;
            to.at_mut(row, handle)[part].iter_mut().zip(point).for_each(|(to, c)| *to += weight * c);
        }
    }

    pub(super) fn of(&self, vertex: usize) -> &[(u32, f64)] {
        self.weights.of(vertex)
    }

    pub(super) fn vertex_count(&self) -> usize {
        self.positions.len()
    }
}

impl Reduction {
    pub(super) fn normalised(&self, point: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| (point[axis] - self.centre[axis]) / self.size)
    }

    pub(super) fn rest_anchor(&self, anchor: &Anchor) -> Vec3 {
        let mut point = [0.0; 3];
        match &anchor.point {
            AnchorPoint::OnShape { vertices, barycentric } => {
                for (&vertex, weight) in vertices.iter().zip(barycentric) {
                    let at = self.rows.positions[vertex as usize];
                    (0..3).for_each(|axis| point[axis] += weight * (at[axis] * self.size + self.centre[axis]));
                }
            }
            AnchorPoint::OnHandles(parts) => {
                for (_, weight, at) in parts {
                    (0..3).for_each(|axis| point[axis] += weight * at[axis]);
                }
            }
        }
        Vec3::from_array(point.map(|c| c as f32))
    }

    /// Resists every change of a transformation in a step, however long: it decides what neither stiffness nor a long
    /// step's inertia does, such as the rotation of a handle with a single vertex.
    pub(super) fn viscosity(&self) -> f64 {
        VISCOSITY * self.stiffness.largest_diagonal()
    }

    /// The row of `M` by which an anchor's point moves, four numbers for each handle it concerns; for one that is held, an
    /// equation (a row of `M_eq`).
    pub(super) fn anchor_row(&self, anchor: &Anchor) -> Vec<(u32, [f64; 4])> {
        let mut row = BlockRows::zeros(1);
        match &anchor.point {
            AnchorPoint::OnShape { vertices, barycentric } => {
                for (&vertex, weight) in vertices.iter().zip(barycentric) {
                    self.rows.add_to_blocks(vertex as usize, *weight, &mut row, 0, 0);
                }
            }
            AnchorPoint::OnHandles(parts) => {
                for (handle, weight, at) in parts {
                    let four = &mut row.at_mut(0, *handle as u32)[0];
                    four.iter_mut().zip(homogeneous(self.normalised(*at))).for_each(|(to, c)| *to += weight * c);
                }
            }
        }
        row.row(0).iter().map(|(handle, block)| (*handle, block[0])).collect()
    }

    /// Adds the zeros, where the global step needs them.
    pub(super) fn fill_in(&mut self, global_step: GlobalStep) {
        let handles = self.handle_count;
        self.with_zeros = (global_step == GlobalStep::Inverse).then(|| WithZeros {
            stiffness: self.stiffness.to_dense(handles),
            covariance: self.covariance.to_dense(handles),
            closeness: self.closeness.to_dense(handles),
        });
    }
}

pub(super) fn reduce(
    shape: &ArapShape,
    settings: &ArapSettings,
    progress: Progress<'_>,
) -> Result<Reduction, ArapError> {
    let handle_count = shape.handle_points.len();
    let (centre, size) = centre_and_size(shape.positions);
    let mut normalised: Vec<[f64; 3]> =
        shape.positions.iter().map(|p| std::array::from_fn(|axis| (p[axis] - centre[axis]) / size)).collect();
    if shape.energy.is_planar() {
        normalised.iter_mut().for_each(|p| p[2] = 0.0);
    }
    proceed(progress, GROUPING, 0.0)?;
    let sets = shape.energy.edge_sets(&normalised);
    let weights = shape.weights.rows(handle_count).into_owned();
    let (cluster_of, cluster_count) = clusters_of_sets(&sets, &weights, handle_count, settings)?;
    proceed(progress, GROUPING, 0.2)?;
    let mut used = vec![false; handle_count];
    (0..weights.vertex_count())
        .for_each(|v| weights.of(v).iter().for_each(|(handle, _)| used[*handle as usize] = true));
    let mut reduction = Reduction {
        handle_count,
        cluster_count,
        planar: shape.energy.is_planar(),
        centre,
        size,
        energy_unit: size.powi(shape.energy.length_power()),
        stiffness: BlockRows::zeros(handle_count),
        covariance: BlockRows::zeros(cluster_count),
        constant: 0.0,
        closeness: BlockRows::zeros(handle_count),
        with_zeros: None,
        degenerate: sets.degenerate,
        weightless: (0..handle_count).filter(|&h| !used[h]).collect(),
        handle_points: shape.handle_points.to_vec(),
        joints: shape.joints.to_vec(),
        rows: Arc::new(LinearBlendRows { weights, positions: normalised }),
        limits: Vec::new(),
    };
    reduction.add_covariances(&sets, &cluster_of, progress)?;
    reduction.add_stiffness(&sets, progress)?;
    reduction.add_closeness(&sets.mass);
    reduction.fill_in(settings.global_step);
    proceed(progress, STIFFNESS, 0.95)?;
    Ok(reduction)
}

pub(super) fn proceed(progress: Progress<'_>, stage: &'static str, part: f64) -> Result<(), ArapError> {
    if progress(stage, part).is_break() { Err(ArapError::Cancelled) } else { Ok(()) }
}

/// Centre and half diagonal of the bounding box; a shape that is a point keeps its size.
fn centre_and_size(positions: &[[f64; 3]]) -> ([f64; 3], f64) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let centre = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
    let size = (0..3).map(|axis| (0.5 * (high[axis] - low[axis])).powi(2)).sum::<f64>().sqrt();
    (centre, if size > 1e-30 { size } else { 1.0 })
}

fn clusters_of_sets(
    sets: &EdgeSets,
    weights: &WeightRows,
    handle_count: usize,
    settings: &ArapSettings,
) -> Result<(Vec<u32>, usize), ArapError> {
    let wanted = settings.clusters.unwrap_or(2 * handle_count).clamp(1, sets.corners.len().max(1));
    let most = settings.global_step.most_clusters();
    if wanted > most {
        return Err(ArapError::TooManyClusters { clusters: wanted, most });
    }
    let share = 1.0 / sets.corner_count as f64;
    let mut features = SparsePoints::default();
    let mut sums = vec![0.0; handle_count];
    let mut used: Vec<u32> = Vec::new();
    for corners in &sets.corners {
        for &corner in &corners[..sets.corner_count] {
            for &(handle, weight) in weights.of(corner as usize) {
                used.push(handle);
                sums[handle as usize] += share * weight;
            }
        }
        used.sort_unstable();
        used.dedup();
        features.push(used.drain(..).map(|handle| (handle, std::mem::take(&mut sums[handle as usize]))));
    }
    Ok(rotation_clusters(&features, handle_count, wanted, settings.seed))
}

impl Reduction {
    /// `K̃`: every edge's rest vector times the difference of its ends' rows, by cluster.
    fn add_covariances(
        &mut self,
        sets: &EdgeSets,
        cluster_of: &[u32],
        progress: Progress<'_>,
    ) -> Result<(), ArapError> {
        for (number, edge) in sets.edges.iter().enumerate() {
            if number % STRIDE == 0 {
                proceed(progress, COVARIANCES, 0.2 + 0.3 * number as f64 / sets.edges.len() as f64)?;
            }
            let cluster = cluster_of[edge.set as usize] as usize;
            let [i, j] = edge.ends.map(|v| v as usize);
            for axis in 0..3 {
                let along = self.rows.positions[i][axis] - self.rows.positions[j][axis];
                self.constant += 0.5 * edge.weight * along * along;
                let covariance = &mut self.covariance;
                self.rows.add_to_blocks(i, edge.weight * along, covariance, cluster, axis);
                self.rows.add_to_blocks(j, -edge.weight * along, covariance, cluster, axis);
            }
        }
        Ok(())
    }

    /// `L̃`: the outer product of the difference of its ends' rows, edge by edge.
    fn add_stiffness(&mut self, sets: &EdgeSets, progress: Progress<'_>) -> Result<(), ArapError> {
        let mut unique: Vec<([u32; 2], f64)> =
            sets.edges.iter().map(|e| ([e.ends[0].min(e.ends[1]), e.ends[0].max(e.ends[1])], e.weight)).collect();
        unique.sort_by_key(|(ends, _)| *ends);
        unique.dedup_by(|next, first| {
            let same = next.0 == first.0;
            first.1 += if same { next.1 } else { 0.0 };
            same
        });
        let mut difference = vec![0.0; 4 * self.handle_count];
        let mut handles: Vec<u32> = Vec::new();
        for (number, (ends, weight)) in unique.iter().enumerate() {
            if number % STRIDE == 0 {
                proceed(progress, STIFFNESS, 0.5 + 0.4 * number as f64 / unique.len() as f64)?;
            }
            let [i, j] = ends.map(|v| v as usize);
            handles.clear();
            handles.extend(self.rows.of(i).iter().chain(self.rows.of(j)).map(|(h, _)| *h));
            handles.sort_unstable();
            handles.dedup();
            self.rows.add(i, 1.0, &mut difference);
            self.rows.add(j, -1.0, &mut difference);
            add_outer_product(&mut self.stiffness, &difference, *weight, &handles);
            handles.iter().for_each(|&h| difference[4 * h as usize..4 * h as usize + 4].fill(0.0));
        }
        Ok(())
    }

    fn add_closeness(&mut self, mass: &[f64]) {
        let mut row = vec![0.0; 4 * self.handle_count];
        for (vertex, &mass) in mass.iter().enumerate() {
            let handles: Vec<u32> = self.rows.of(vertex).iter().map(|(h, _)| *h).collect();
            self.rows.add(vertex, 1.0, &mut row);
            add_outer_product(&mut self.closeness, &row, mass, &handles);
            handles.iter().for_each(|&h| row[4 * h as usize..4 * h as usize + 4].fill(0.0));
        }
        for handle in 0..self.handle_count {
            let block = self.closeness.at_mut(handle, handle as u32);
            (0..4).for_each(|part| block[part][part] += IDENTITY_SHARE);
        }
    }
}

/// `to += weight · row rowᵀ`, where only the entries of some handles are nonzero.
fn add_outer_product(to: &mut BlockRows<4>, row: &[f64], weight: f64, handles: &[u32]) {
    for &a in handles {
        for &b in handles {
            let block = to.at_mut(a as usize, b);
            let columns = &row[4 * b as usize..][..4];
            for (out, value) in block.iter_mut().zip(&row[4 * a as usize..][..4]) {
                let factor = weight * value;
                out.iter_mut().zip(columns).for_each(|(to, c)| *to += factor * c);
            }
        }
    }
}

/// The row of `M` by which an affine map of a handle moves a point: its coordinates and a one.
pub(super) fn homogeneous(point: [f64; 3]) -> [f64; 4] {
    [point[0], point[1], point[2], 1.0]
}
