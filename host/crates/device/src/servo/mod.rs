//! Arms of bus servos as joint-angle devices: Feetech STS/SMS and Dynamixel 2.0.
//!
//! [`feetech`] and [`dynamixel`] turn bytes into statuses and back; [`ServoSession`] runs the conversation and reports
//! the same [`Event`](crate::Event)s as a puppet's session, so that nothing above needs to know the difference.
//! [`ServoArm`] says which servo drives which joint.
//!
//! A session reads, and only writes what lets an arm move freely: torque off. Registers that keep their value without
//! power are written only with [`EepromConsent`].
//!
//! Within the session, `roster` owns what is known about each servo, `line` the pending request and the adapter's
//! delays, `preparation` the work on single servos, `stream` the readings.

mod bus;
pub mod dynamixel;
mod exchange;
pub mod feetech;
mod line;
mod packet;
mod preparation;
mod readings;
mod roster;
mod servo_session;
mod settings;
mod stream;
mod task;

pub use crate::arm::{COUNTS_PER_TURN, NO_SEAT, ServoArm, ServoJoint, ServoProtocol, UnknownArm, seat_of};
pub use bus::{ReadMode, wire_bound_hertz};
pub use packet::{PacketCounters, Status};
pub use servo_session::ServoSession;
pub use settings::{EepromConsent, ServoSettings};
