//! Weights with their certificates.

use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{BiharmonicOutcome, ExactPartitionReport, HandleReport};
use armature_weights::finish::Normalisation;

use super::settings::DomainKind;
use super::spurious::SpuriousExtrema;

/// Weights with their certificates.
#[derive(Clone, Debug)]
pub struct HandleWeights {
    /// n vertices of the surface × m handles.
    pub weights: WeightMatrix,
    /// One for every handle solved separately; `None` if it holds nothing, and its weights are zero.
    pub reports: Vec<Option<HandleReport>>,
    /// The single certificate of handles that were solved together; `reports` are then all `None`.
    pub together: Option<ExactPartitionReport>,
    /// What normalising changed, if requested.
    pub normalisation: Option<Normalisation>,
    /// Extrema where no handle holds the shape, before and after normalising.
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

impl HandleWeights {
    /// No weight, before normalising, is farther than this from the optimal one.
    pub fn error_bound(&self) -> f64 {
        self.known().map(|report| report.error_bound).chain(self.together.map(|t| t.error_bound)).fold(0.0, f64::max)
    }

    /// The sum of all handles' energies.
    pub fn energy(&self) -> f64 {
        self.known().map(|report| report.energy).chain(self.together.map(|t| t.energy)).sum()
    }

    /// Handles that were solved separately and whose weights are not as good as requested.
    pub fn unconverged(&self) -> usize {
        self.known().filter(|report| report.outcome != BiharmonicOutcome::Converged).count()
    }

    /// Whether all weights are as good as requested.
    pub fn converged(&self) -> bool {
        let together = self.together.is_none_or(|report| report.outcome == BiharmonicOutcome::Converged);
        together && self.unconverged() == 0
    }

    fn known(&self) -> impl Iterator<Item = &HandleReport> {
        self.reports.iter().flatten()
    }
}
