//! Emulated servo buses: Feetech STS/SMS and Dynamixel 2.0, on a clock that the caller advances.
//!
//! ```
//! use armature_sim::servo::{ServoBus, ServoBusSettings};
//!
//! let mut bus = ServoBus::new(ServoBusSettings::preset("so101-leader", 1)?)?;
//! let mut bytes = Vec::new();
//! bus.step(0, 1_000_000, &[0xFF, 0xFF, 0x01, 0x04, 0x02, 0x03, 0x02, 0xF3], &mut bytes);
//! bus.step(1_000_000, 1_000_000, &[], &mut bytes);
//! assert_eq!(bytes, [0xFF, 0xFF, 0x01, 0x04, 0x00, 0x09, 0x03, 0xEE], "servo 1 is an STS3215, number 777");
//! # Ok::<(), armature_sim::servo::ServoBusError>(())
//! ```
//!
//! Times are in nanoseconds: at 1 Mbaud a byte takes 10,000, and the bus itself keeps to the line's speed. In a sync
//! read each servo waits for the answer of the one before, so all servos after a missing one stay silent; real firmware
//! varies, and this emulates the strictest kind.

mod bus;
mod memory;
mod packets;
mod settings;

pub use bus::{ServoBus, ServoBusTruth};
pub use settings::{BusKind, ServoBusError, ServoBusSettings, SimulatedServo};
