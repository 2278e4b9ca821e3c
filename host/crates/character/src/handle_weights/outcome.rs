//! Weights with their certificates.

use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{BiharmonicOutcome, ExactPartitionReport, HandleReport};
use armature_weights::finish::Normalisation;
use armature_weights::monotone::{MonotoneOutcome, MonotonePartitionReport, MonotoneReport};

use super::settings::DomainKind;
use super::spurious::SpuriousExtrema;

/// Weights with their certificates.
#[derive(Clone, Debug)]
pub struct HandleWeights {
    /// n vertices of the surface × m handles.
    pub weights: WeightMatrix,
    /// How good they are, before normalising.
    pub certificates: Certificates,
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

/// How good weights are: one report for every handle that was solved separately, `None` if it holds nothing and its
/// weights are zero; or one for all that were solved together.
#[derive(Clone, Debug)]
pub enum Certificates {
    /// Bounded biharmonic weights.
    Bounded(Vec<Option<HandleReport>>),
    /// Bounded biharmonic weights that sum to one.
    BoundedTogether(ExactPartitionReport),
    /// Monotone weights: no extrema of their own before normalising.
    Monotone(Vec<Option<MonotoneReport>>),
    /// Monotone weights that sum to one.
    MonotoneTogether(Box<MonotonePartitionReport>),
}

impl Certificates {
    /// For each handle or all together: error bound, energy, and whether it converged.
    fn all(&self) -> Vec<(f64, f64, bool)> {
        let bounded = |r: &HandleReport| (r.error_bound, r.energy, r.outcome == BiharmonicOutcome::Converged);
        let monotone = |r: &MonotoneReport| (r.error_bound, r.energy, r.outcome == MonotoneOutcome::Converged);
        match self {
            Self::Bounded(reports) => reports.iter().flatten().map(bounded).collect(),
            Self::BoundedTogether(r) => vec![(r.error_bound, r.energy, r.outcome == BiharmonicOutcome::Converged)],
            Self::Monotone(reports) => reports.iter().flatten().map(monotone).collect(),
            Self::MonotoneTogether(r) => vec![(r.error_bound, r.energy, r.outcome == MonotoneOutcome::Converged)],
        }
    }

    /// How many are not as good as requested, and the largest error bound of these.
    pub(super) fn late(&self) -> (usize, f64) {
        let late = self.all().into_iter().filter(|(.., converged)| !converged);
        late.fold((0, 0.0), |(count, worst), (error_bound, ..)| (count + 1, f64::max(worst, error_bound)))
    }

    /// Whether all handles were solved together.
    pub fn together(&self) -> bool {
        matches!(self, Self::BoundedTogether(_) | Self::MonotoneTogether(_))
    }
}

impl HandleWeights {
    /// No weight, before normalising, is farther than this from the optimal one; for monotone weights, from the best that
    /// rises along the same edges.
    pub fn error_bound(&self) -> f64 {
        self.certificates.all().into_iter().map(|(error_bound, ..)| error_bound).fold(0.0, f64::max)
    }

    /// The sum of all handles' energies.
    pub fn energy(&self) -> f64 {
        self.certificates.all().into_iter().map(|(_, energy, _)| energy).sum()
    }

    /// Handles that were solved separately and whose weights are not as good as requested.
    pub fn unconverged(&self) -> usize {
        if self.certificates.together() { 0 } else { self.certificates.late().0 }
    }

    /// Whether all weights are as good as requested.
    pub fn converged(&self) -> bool {
        self.certificates.late().0 == 0
    }
}
