//! How a shape is reduced to its handles.

/// How a shape is reduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArapSettings {
    /// Number of rotation clusters; `None` means two per handle, which the thesis found sufficient.
    ///
    /// Limited to the number of edge sets (elements, or vertices for the spokes' energies). Memory and the time of an
    /// iteration grow quadratically: more than [`MOST_CLUSTERS`] are an error.
    pub clusters: Option<usize>,
    /// Seed for the clustering.
    pub seed: u64,
}

/// The most rotation clusters a shape may have: with this many, its matrices take half a gigabyte.
pub const MOST_CLUSTERS: usize = 2048;

impl Default for ArapSettings {
    fn default() -> Self {
        Self { clusters: None, seed: 1 }
    }
}
