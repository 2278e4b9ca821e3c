//! Skinning weights: how much every vertex of a mesh follows every bone of a skeleton.
//!
//! This crate does no I/O, reads no clock and prints nothing. Long computations report progress and can be
//! cancelled. Equal input gives equal weights whatever the number of threads.

mod active_set;
mod additional_weights;
mod alternating_directions;
mod biharmonic_check;
mod biharmonic_energy;
mod bone_heat;
mod bounded_biharmonic;
mod cholesky;
mod endpoint_weights;
mod exact_partition;
mod exchange_bounds;
mod far_handles;
mod finish_weights;
mod free_descent;
mod free_joints;
mod gather_reports;
mod handle_boundary;
mod heat_sources;
mod heat_surface;
mod heat_system;
mod inverse_diagonal;
mod joint_weights;
mod near_handles;
mod neighbourhood;
mod progress;
mod projected_endpoint_weights;
mod sampled_skeleton;
mod shape_preservation;
mod sparsify;
mod spline_filter;
mod weight_matrix;

pub use additional_weights::{
    AdditionalError, AdditionalOutcome, AdditionalSettings, AdditionalWeights, additional_weights,
};
pub use biharmonic_check::BiharmonicError;
pub use bone_heat::{BoneHeat, BoneHeatError, BoneHeatReport, BoneHeatSettings, bone_heat};
pub use bounded_biharmonic::{
    BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, BiharmonicWeights, HandleReport,
    bounded_biharmonic_weights,
};
pub use cholesky::{CholeskyError, SparseCholesky};
pub use endpoint_weights::{EndpointWeights, OtherBones, endpoint_weights, endpoint_weights_of_influences};
pub use exact_partition::{ExactPartition, ExactPartitionReport, ExactPartitionSettings, exact_partition_weights};
pub use finish_weights::{Normalisation, follow_nearest_handle, normalise};
pub use free_joints::{FREE_NEAR_JOINTS, free_joints};
pub use handle_boundary::{CageFacet, Handle, HandleBoundary, HandleError, HandleKind, handle_boundary};
pub use heat_sources::{BoneSegment, Visibility};
pub use joint_weights::{JointWeights, endpoint_weights_from_joints, joint_weights};
pub use progress::{Phase, Progress};
pub use projected_endpoint_weights::{projected_endpoint_weight, projected_endpoint_weights};
pub use sampled_skeleton::{EndpointError, SampledSkeleton};
pub use shape_preservation::{BrushError, shape_preservation};
pub use sparsify::{Sparsification, SparsifyError, sparsify};
pub use spline_filter::{SplineFilter, SplineFilterError};
pub use weight_matrix::WeightMatrix;
