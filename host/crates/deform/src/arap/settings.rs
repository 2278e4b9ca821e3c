//! How a shape is reduced to its handles.

/// How a shape is reduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArapSettings {
    /// Number of rotation clusters; `None` means two per handle, which the thesis found sufficient.
    ///
    /// Limited to the number of edge sets (elements, or vertices for the spokes' energies). More than
    /// [`GlobalStep::most_clusters`] are an error.
    pub clusters: Option<usize>,
    /// Seed for the clustering.
    pub seed: u64,
    /// How transformations are found for given rotations.
    pub global_step: GlobalStep,
}

impl Default for ArapSettings {
    fn default() -> Self {
        Self { clusters: None, seed: 1, global_step: GlobalStep::Inverse }
    }
}

/// How the global step (thesis eq. 7.19) is solved. Both find the same transformations, except for rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GlobalStep {
    /// By the inverse, computed once for a set of constraints: a microsecond for tens of handles. An iteration's time
    /// grows with the square of their number, preparing with the cube.
    #[default]
    Inverse,
    /// By a sparse factorisation: both grow with the number of handles, since a handle shares vertices with few others.
    Factor,
}

impl GlobalStep {
    /// The most rotation clusters a shape may have: with this many, matrices take half a gigabyte.
    pub fn most_clusters(self) -> usize {
        match self {
            Self::Inverse => 2048,
            Self::Factor => 1 << 18,
        }
    }
}
