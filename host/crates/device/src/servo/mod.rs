//! Arms of bus servos as joint-angle devices: Feetech STS/SMS and Dynamixel 2.0.
//!
//! [`feetech`] and [`dynamixel`] turn bytes into statuses and back; [`ServoSession`] runs the conversation and reports
//! the same [`Event`](crate::Event)s as a puppet's session, so that nothing above has to know the difference.
//! [`ServoArm`] says which servo sits at which joint.
//!
//! A session reads, and writes only what lets an arm move freely: torque off. Registers that keep their value without
//! power are written only with [`EepromConsent`].

mod arm;
mod bus;
mod cycle;
pub mod dynamixel;
mod exchange;
pub mod feetech;
mod packet;
mod prepare;
mod session;

pub use arm::{COUNTS_PER_TURN, ServoArm, ServoJoint, ServoProtocol, UnknownArm, seat_of};
pub use bus::{ReadMode, wire_bound_hertz};
pub use packet::{PacketCounters, Status};
pub use session::{EepromConsent, ServoSession, ServoSettings};
