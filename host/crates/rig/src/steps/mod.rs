//! The steps for calibrating a puppet ([`CalibrationRun::take`], [`CalibrationRun::finish`]), as state machines fed
//! with samples and the time, and how a part's mounting follows from its motions ([`mounting_from_axes`]).

mod measure;
mod mounting;
mod report;
mod run;
mod step;

pub use mounting::{Mounting, MountingError, mounting_from_axes, mounting_from_axis};
pub use report::{Finding, StepFinding, StepReport};
pub use run::{CalibrationRun, Progress, Reading, StepError, StepTimes};
pub use step::{CalibrationStep, UnknownStep};
