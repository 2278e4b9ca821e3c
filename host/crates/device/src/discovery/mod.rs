//! What is plugged in ([`list_devices`]), and what comes and goes ([`DeviceWatch`]). Nothing is opened to find out.

mod board;
mod list;
mod twins;
mod watch;

pub use board::Board;
pub(crate) use list::usb_behind;
pub use list::{DeviceDescription, DeviceGuess, Plugged, list_devices, list_serial_ports};
pub use watch::{DeviceWatch, PortChange};
