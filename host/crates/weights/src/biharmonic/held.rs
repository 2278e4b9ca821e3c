//! Which bound holds an unknown of one handle.

/// Which bound holds an unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Held {
    /// Neither: it is between them.
    #[default]
    Free,
    /// At zero.
    Lower,
    /// At one.
    Upper,
}

impl Held {
    /// The weight of a held unknown.
    pub(crate) fn bound(self) -> Option<f64> {
        match self {
            Self::Free => None,
            Self::Lower => Some(0.0),
            Self::Upper => Some(1.0),
        }
    }
}
