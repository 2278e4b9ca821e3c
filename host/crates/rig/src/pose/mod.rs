//! From samples to poses: [`PoseSolver`] for one puppet, calibration and mapping, [`StreamSolver`] while they change.
//! [`PoseCompletion`] poses the bones that no joint drives.

mod completion;
mod engagement;
mod sensor;
mod shape_weights;
mod share;
mod solver;
mod status;
mod stream_solver;
mod target;

pub use completion::{PoseCompletion, PoseMoment};
pub use shape_weights::{ShapeError, ShapeWeights};
pub use solver::{PoseSolver, SampleError};
pub use status::{BoneQuality, BoneStatus};
pub use stream_solver::{SolveError, StreamSolver};
pub use target::{Target, TargetChange, TargetError, TargetPoint};
