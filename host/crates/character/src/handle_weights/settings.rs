//! What weights are computed on, how accurate they must be, and how they are made to sum to one.

use armature_weights::biharmonic::BiharmonicSettings;

/// How accurate weights must be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BiharmonicTier {
    /// Within 2e-3 of the optimal ones: the difference is not visible in any deformation.
    #[default]
    Interactive,
    /// Within 2e-5 of the optimal ones, and to ten digits in the energy.
    Certified,
}

impl BiharmonicTier {
    /// When the solver may stop.
    pub fn settings(self) -> BiharmonicSettings {
        match self {
            Self::Interactive => BiharmonicSettings::interactive(),
            Self::Certified => BiharmonicSettings::certified(),
        }
    }
}

/// How a vertex's weights are made to sum to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Partition {
    /// Each handle is solved separately, and a vertex's weights are scaled afterwards.
    #[default]
    Normalised,
    /// Each handle is solved separately, and its weights stay as they are: the sums differ from one.
    Left,
    /// All handles are solved together with the sum as a constraint: slower, and smoother where many meet.
    Exact,
}

/// Which weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WeightMethod {
    /// Bounded biharmonic weights.
    #[default]
    BoundedBiharmonic,
    /// Monotone weights (thesis chapter 5), without extrema of their own.
    Monotone {
        /// Order of smoothness, 2 to 4.
        order: usize,
    },
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleWeightsSettings {
    /// Which weights.
    pub method: WeightMethod,
    /// How accurate.
    pub tier: BiharmonicTier,
    /// On what.
    pub on: WeightsOn,
    /// Whether and how they sum to one.
    pub partition: Partition,
    /// The fraction of a bone's length, 0 to
    /// [`MOST_FREE_NEAR_JOINTS`](armature_weights::handles::MOST_FREE_NEAR_JOINTS), over which it is released at each
    /// joint that it shares ([`free_joints`](armature_weights::handles::free_joints)); with 0 bones hold to their ends,
    /// as in the papers and in libigl.
    pub joint_release: f64,
}

/// What to compute weights on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightsOn {
    /// A volume around the surface with about this many vertices; for a flat mesh, the triangles that fill it.
    Volume {
        /// Approximate number of vertices.
        vertices: usize,
    },
    /// The mesh as it is: its tetrahedra if it has any, its triangles otherwise.
    OwnElements,
    /// The triangles of the surface alone.
    Surface,
}

/// What weights were computed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainKind {
    /// Tetrahedra made for it.
    Volume,
    /// Triangles that fill a flat figure.
    Flat,
    /// The tetrahedra that came with the mesh.
    OwnTetrahedra,
    /// The surface alone.
    Surface,
}
