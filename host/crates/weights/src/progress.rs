//! How far a long computation has come.

/// What is being computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Welding, cleaning, and building the operators.
    Prepare,
    /// Finding which bones each vertex sees.
    Visibility,
    /// Factorising the linear system.
    Factorise,
    /// Solving for every bone.
    Solve,
    /// Guessing which weights lie at a bound.
    Guess,
    /// Finding out which weights lie at a bound.
    Exchange,
    /// Checking the solution and bringing it into shape.
    Finish,
}

impl Phase {
    /// A few words for a progress bar.
    pub fn label(self) -> &'static str {
        match self {
            Self::Prepare => "preparing the surface",
            Self::Visibility => "looking for bones",
            Self::Factorise => "factorising",
            Self::Solve => "diffusing heat",
            Self::Guess => "guessing the weights",
            Self::Exchange => "refining the weights",
            Self::Finish => "checking the weights",
        }
    }
}

/// Reported at the start of every phase and now and then within it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is being computed now.
    pub phase: Phase,
    /// How much of the whole computation is done, 0 to 1, never falling.
    pub done: f64,
}
