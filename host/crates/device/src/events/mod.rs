//! Everything that a session reports: what happened ([`Event`]), what is worth knowing ([`DeviceNotice`]) and what is
//! wrong ([`DeviceProblem`]); the last two say what to do.

mod clock_estimate;
mod event;
mod notice;
mod problem;
mod request_kind;

pub use clock_estimate::ClockEstimate;
pub(crate) use event::printable;
pub use event::{DeviceInfo, Event, Sample, SessionCounters};
pub use notice::DeviceNotice;
pub use problem::{DeviceProblem, UDEV_RULES};
pub use request_kind::RequestKind;
