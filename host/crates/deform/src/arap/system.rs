//! The global step for one set of constraints: what is given, and what solves for the rest (thesis eq. 7.19).

use super::constraint::{Anchor, HandleConstraint};
use super::error::ArapError;
use super::factor::Factor;
use super::given::{Given, Resistance};
use super::inverse::Inverse;
use super::reduction::Reduction;

/// The global step for one set of constraints.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    pub(super) given: Given,
    pub(super) solver: Solver,
}

/// What finds the open rows of `T`.
#[derive(Clone, Debug)]
pub(super) enum Solver {
    /// `GlobalStep::Inverse`.
    Inverse(Inverse),
    /// `GlobalStep::Factor`.
    Factor(Factor),
}

impl Default for Solver {
    fn default() -> Self {
        Self::Inverse(Inverse::default())
    }
}

impl System {
    pub(super) fn new(
        reduction: &Reduction,
        constraints: &[HandleConstraint],
        anchors: &[Anchor],
        resistance: Option<Resistance>,
    ) -> Result<Self, ArapError> {
        let mut given = Given::new(reduction, constraints, anchors)?;
        let solver = if let Some(with_zeros) = &reduction.with_zeros {
            Solver::Inverse(Inverse::new(reduction, with_zeros, &mut given, resistance))
        } else {
            let (factor, undetermined) = Factor::new(reduction, &given, resistance);
            given.add_undetermined(undetermined);
            Solver::Factor(factor)
        };
        Ok(Self { given, solver })
    }
}
