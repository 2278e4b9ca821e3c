//! Skinning: where every vertex goes when the bones move, and where bones go that nobody has moved.
//!
//! What repeats per frame is split in two: a `precompute` that is built once for a character and a `solve` that
//! runs every frame and allocates nothing. Pose time is `f32`. This crate does no I/O and reads no clock.

mod arap_constraints;
mod arap_dynamics;
mod arap_energy;
mod arap_reduction;
mod arap_soft_joints;
mod arap_solve;
mod dense;
mod dual_quaternion_skinning;
mod eight;
mod in_chunks;
mod linear_blend_skinning;
mod nearest_rotation;
mod pseudo_edges;
mod reduced_arap;
mod rotation_clusters;
mod skin_blocks;
mod stretch_twist_blocks;
mod stretch_twist_dual;
mod stretch_twist_linear;
mod stretch_twist_skinning;
mod widest;

pub use arap_dynamics::ArapDynamics;
pub use arap_energy::ArapEnergy;
pub use arap_soft_joints::{RotationLimit, SoftJoint};
pub use dual_quaternion_skinning::DualQuaternionSkin;
pub use linear_blend_skinning::{LinearBlendSkin, SkinError};
pub use nearest_rotation::{LANES, Matrices, nearest_rotations};
pub use pseudo_edges::{PseudoEdgeError, PseudoEdgeSpace, PseudoEdges};
pub use reduced_arap::{
    Anchor, ArapError, ArapOutcome, ArapReport, ArapSettings, ArapShape, ArapStop, ArapWarnings, HandleConstraint,
    MOST_CLUSTERS, ReducedArap, SharedJoint,
};
pub use stretch_twist_skinning::{BoneBlend, BoneSegment, StretchTwist, StretchTwistSkin};
