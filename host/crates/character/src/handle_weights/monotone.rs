//! Monotone weights of handles for the vertices of a mesh.

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::extrema::Neighbours;
use armature_weights::finish::{Normalisation, follow_nearest_handle, normalise};
use armature_weights::monotone::{
    MonotoneError, MonotoneOutcome, MonotoneProblem, MonotoneReport, MonotoneSettings, monotone_weights,
};

use super::error::HandleWeightsError;
use super::handle::Held;
use super::settings::{BiharmonicTier, DomainKind, HandleWeightsSettings, Partition};
use super::spurious::{SpuriousExtrema, spurious_of};
use super::warnings::{Drawbacks, weight_warnings};
use super::weights::{VOLUME_SHARE, prepare, whole};
use crate::progress::Progress;

/// Monotone weights with their reports.
#[derive(Clone, Debug)]
pub struct MonotoneHandleWeights {
    /// n vertices of the surface × m handles.
    pub weights: WeightMatrix,
    /// One for every handle; `None` if it holds nothing, and its weights are zero.
    pub reports: Vec<Option<MonotoneReport>>,
    /// What normalising changed, if requested.
    pub normalisation: Option<Normalisation>,
    /// Extrema where no handle holds the shape: none before normalising, and those that it made.
    pub spurious: SpuriousExtrema,
    /// What they were computed on.
    pub domain: DomainKind,
    /// How many vertices that has.
    pub domain_vertices: usize,
    /// Elements without a size, or with so little that they were ignored.
    pub flat_elements: usize,
    /// The fraction of their length over which bones were released at shared joints; `None` for fixed vertices.
    pub joint_release: Option<f64>,
    /// Handles that move no vertex of the surface by more than dust.
    pub idle: Vec<usize>,
    /// What the user should know, in sentences.
    pub warnings: Vec<String>,
}

impl MonotoneHandleWeights {
    /// Handles whose weights are not as good as requested.
    pub fn unconverged(&self) -> usize {
        self.known().filter(|report| report.outcome != MonotoneOutcome::Converged).count()
    }

    /// No weight, before normalising, is farther than this from the best one that rises along the same edges.
    pub fn error_bound(&self) -> f64 {
        self.known().map(|report| report.error_bound).fold(0.0, f64::max)
    }

    /// The sum of all handles' energies.
    pub fn energy(&self) -> f64 {
        self.known().map(|report| report.energy).sum()
    }

    fn known(&self) -> impl Iterator<Item = &MonotoneReport> {
        self.reports.iter().flatten()
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
    let names = held.names();
    let followed = follow_nearest_handle(&mut solved.weights, &solved.unreached, &boundary, &domain.vertices);
    let spurious = |weights: &_| spurious_of(&domain, &neighbours, &boundary, weights, (&columns, names.len()));
    let computed = spurious(&solved.weights)?;
    let normalisation = (settings.partition == Partition::Normalised).then(|| normalise(&mut solved.weights));
    let scaled = normalisation.as_ref().map(|_| spurious(&solved.weights)).transpose()?;
    let weights = whole(&domain, &solved.weights, &columns, names.len())?;
    let mut reports = vec![None; names.len()];
    columns.iter().zip(solved.reports).for_each(|(&column, report)| reports[column] = Some(report));
    let late = reports.iter().flatten().filter(|report| report.outcome != MonotoneOutcome::Converged);
    let unconverged = late.fold((0, 0.0), |(count, worst), r| (count + 1, f64::max(worst, r.error_bound)));
    let followed: Vec<usize> = followed.into_iter().map(|handle| columns[handle]).collect();
    let drawbacks = Drawbacks::find(&domain, &weights, unconverged, &solved.unreached, &followed);
    Ok(MonotoneHandleWeights {
        warnings: weight_warnings(&drawbacks, &names),
        idle: drawbacks.idle,
        weights,
        reports,
        normalisation,
        spurious: SpuriousExtrema { computed, scaled },
        domain: domain.kind,
        domain_vertices: domain.vertices.len(),
        flat_elements: domain.degenerate,
        joint_release: matches!(held, Held::Shapes { .. }).then_some(settings.joint_release),
    })
}
