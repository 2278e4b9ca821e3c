//! The lines that carry the bytes: serial ports, USB bulk, HID, TCP, memory. They share one small trait, [`Transport`],
//! and everything above it is the same; [`open`] opens the line to an address. Blocking libraries (USB bulk, HID) reach
//! the runtime through one bridge.

mod bridge;
pub(crate) mod hid;
#[cfg(any(test, target_os = "linux"))]
mod latency_timer;
mod memory;
mod open;
mod serial;
mod tcp;
mod transport;
pub(crate) mod usb_bulk;

pub use memory::memory;
pub use open::open;
pub use transport::Transport;
