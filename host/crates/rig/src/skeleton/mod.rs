//! The character's skeleton ([`Skeleton::new`]), where its bones are ([`Pose::forward_kinematics`]), and clips of poses
//! ([`Motion`]).

mod bones;
mod child_order;
mod forward_kinematics;
mod motion;
mod transforms;

pub use bones::{Bone, Skeleton, SkeletonError};
pub use child_order::ChildOrder;
pub use motion::{Motion, MotionError};
pub use transforms::{Pose, Transform};
