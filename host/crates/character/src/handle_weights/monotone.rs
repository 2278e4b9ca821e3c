//! Monotone weights of handles for the vertices of a mesh.

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::extrema::{Neighbours, local_extrema};
use armature_weights::finish::{Normalisation, follow_nearest_handle, normalise};
use armature_weights::monotone::{
    MonotoneError, MonotoneOutcome, MonotoneProblem, MonotoneReport, MonotoneSettings, monotone_weights,
};

use super::error::HandleWeightsError;
use super::handle::Held;
use super::settings::{BiharmonicTier, DomainKind, HandleWeightsSettings, Partition};
use super::weights::{VOLUME_SHARE, prepare, whole};
use crate::progress::Progress;

/// Monotone weights with their reports.
#[derive(Clone, Debug)]
pub struct MonotoneHandleWeights {
    /// n vertices of the surface × m handles.
    pub weights: WeightMatrix,
    /// One for every handle; `None` if it holds nothing, and its weights are zero.
    pub reports: Vec<Option<MonotoneReport>>,
    /// What normalising changed, if requested, and how many extrema of their own the weights had then, on the elements
    /// that they were computed on.
    pub normalisation: Option<(Normalisation, usize)>,
    /// What they were computed on.
    pub domain: DomainKind,
    /// How many vertices that has.
    pub domain_vertices: usize,
    /// Elements without a size, or with so little that they were ignored.
    pub flat_elements: usize,
    /// The fraction of their length over which bones were released at shared joints; `None` for fixed vertices.
    pub joint_release: Option<f64>,
}

impl MonotoneHandleWeights {
    /// Handles whose weights are not as good as requested.
    pub fn unconverged(&self) -> usize {
        self.reports.iter().flatten().filter(|report| report.outcome != MonotoneOutcome::Converged).count()
    }
}

/// Weights without extrema of their own (thesis chapter 5), of this order of smoothness, 2 to 4; otherwise like
/// [`handle_weights`](super::handle_weights). Each handle is solved separately.
pub fn monotone_handle_weights(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    held: Held<'_>,
    settings: &HandleWeightsSettings,
    order: usize,
    progress: Progress<'_>,
) -> Result<MonotoneHandleWeights, HandleWeightsError> {
    let (domain, boundary, columns) = prepare(surface, tetrahedra, held, settings, progress)?;
    let neighbours = Neighbours::of_matrix(&domain.laplacian);
    let problem = MonotoneProblem {
        neighbours: &neighbours,
        laplacian: &domain.laplacian,
        mass: &domain.mass,
        order,
        blend: None,
        data: None,
    };
    let how = match settings.tier {
        BiharmonicTier::Interactive => MonotoneSettings::default(),
        BiharmonicTier::Certified => MonotoneSettings::certified(),
    };
    let mut told = |stage: &'static str, done: f64| progress(stage, VOLUME_SHARE + (1.0 - VOLUME_SHARE) * done);
    let mut solved = monotone_weights(&problem, &boundary, &how, &mut told).map_err(|error| match error {
        MonotoneError::Cancelled { stage } => HandleWeightsError::Cancelled { stage },
        other => HandleWeightsError::Monotone(other),
    })?;
    follow_nearest_handle(&mut solved.weights, &solved.unreached, &boundary, &domain.vertices);
    let normalisation = (settings.partition == Partition::Normalised)
        .then(|| -> Result<_, HandleWeightsError> {
            let changed = normalise(&mut solved.weights);
            let mut spurious = 0;
            for handle in 0..solved.weights.bones() {
                let found = local_extrema(&neighbours, &solved.weights.bone(handle)).map_err(MonotoneError::from)?;
                spurious += found.besides(&boundary.fixed).count();
            }
            Ok((changed, spurious))
        })
        .transpose()?;
    let handles = match held {
        Held::Shapes { shapes, .. } => shapes.len(),
        Held::Boundary(boundary) => boundary.handles,
    };
    let mut reports = vec![None; handles];
    columns.iter().zip(solved.reports).for_each(|(&column, report)| reports[column] = Some(report));
    Ok(MonotoneHandleWeights {
        weights: whole(&domain, &solved.weights, &columns, handles)?,
        reports,
        normalisation,
        domain: domain.kind,
        domain_vertices: domain.vertices.len(),
        flat_elements: domain.degenerate,
        joint_release: matches!(held, Held::Shapes { .. }).then_some(settings.joint_release),
    })
}
