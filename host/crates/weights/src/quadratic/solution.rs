//! What was found, and how good it is.

/// How the computation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuadraticOutcome {
    /// All bounds of the settings hold.
    Converged,
    /// The limit was reached, steps gained nothing any more, or rounding ended them; the residuals say how far it got.
    LimitReached,
}

/// The best values found.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadraticSolution {
    /// x.
    pub values: Vec<f64>,
    /// One for each equality, with the sign of `Q x + l + A_eqᵀ y + A_ieᵀ λ = 0`.
    pub equality_multipliers: Vec<f64>,
    /// λ, one for each inequality, not negative.
    pub inequality_multipliers: Vec<f64>,
    /// `½ xᵀ Q x + xᵀ l + c`.
    pub energy: f64,
    /// Largest entry of the gradient with multipliers.
    pub stationarity: f64,
    /// Largest miss of an equality.
    pub equality_residual: f64,
    /// Largest violation of an inequality; zero if all hold.
    pub violation: f64,
    /// `λᵀ (b_ie - A_ie x)`: how much the energy can be above the least one, once the other residuals are zero.
    pub gap: f64,
    /// Steps, each with a factorisation.
    pub steps: usize,
    /// How it ended.
    pub outcome: QuadraticOutcome,
}

impl QuadraticSolution {
    /// The same for an energy that is this many times as large.
    pub(super) fn scaled(mut self, times: f64) -> Self {
        let multipliers = self.equality_multipliers.iter_mut().chain(&mut self.inequality_multipliers);
        let numbers = multipliers.chain([&mut self.energy, &mut self.stationarity, &mut self.gap]);
        numbers.for_each(|number| *number *= times);
        self
    }
}
