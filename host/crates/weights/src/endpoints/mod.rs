//! Endpoint weights of bones that stretch and twist (thesis chapter 6): how far along a bone, from 0 at its head to 1
//! at its tail, each vertex sits.
//!
//! - [`endpoint_weights`] computes them as bounded biharmonic weights;
//! - [`joint_weights`] and [`endpoint_weights_from_joints`] derive them from weights of the joints;
//! - [`inverse_distance_weights`] of the joints and [`projected_endpoint_weights`] need no volume;
//! - [`endpoint_weights_of_influences`] puts them in the order of a skin's influences;
//! - [`SplineFilter`] controls where along a bone the twist happens.
//!
//! ```
//! use armature_weights::{BoneSegment, endpoints::{SplineFilter, projected_endpoint_weights}};
//!
//! let bone = BoneSegment { head: [0.0; 3], tail: [2.0, 0.0, 0.0] };
//! let mut ends = projected_endpoint_weights(&[[0.5, 1.0, 0.0], [9.0, 0.0, 0.0]], &[bone]);
//! assert_eq!(ends.bone(0), [0.25, 1.0]);
//! // All of the twist in the second half of the bone.
//! SplineFilter::through(&[[0.5, 0.0]])?.apply(&mut ends, 0);
//! assert_eq!(ends.bone(0), [0.0, 1.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod endpoint_weights;
mod inverse_distance;
mod joint_weights;
mod projected;
mod sampled_skeleton;
mod spline_filter;

pub use endpoint_weights::{EndpointWeights, OtherBones, endpoint_weights, endpoint_weights_of_influences};
pub use inverse_distance::inverse_distance_weights;
pub use joint_weights::{JointWeights, endpoint_weights_from_joints, joint_weights};
pub use projected::{projected_endpoint_weight, projected_endpoint_weights};
pub use sampled_skeleton::{EndpointError, SampledSkeleton};
pub use spline_filter::{SplineFilter, SplineFilterError};
