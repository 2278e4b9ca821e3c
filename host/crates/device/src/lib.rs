//! Talking to a puppet: sessions (bytes and the time in, events out), and the lines that carry the bytes.
//!
//! * [`Session`] is the host's side of the protocol: pure, without I/O and without a clock. It goes from hello to
//!   topology to samples by itself, repeats what is not answered, follows plugging in and out, survives noise and
//!   restarts, and counts what was lost.
//! * [`Connection`] runs a session over a line on a tokio runtime and hands its [`Event`]s on through a bounded channel.
//! * [`DeviceAddress`] says where a device is; [`open`] opens the line; [`list_devices`] finds candidates and
//!   [`DeviceWatch`] tells when they come and go.
//!
//! This crate reports raw joint readings. It knows nothing of skeletons.

mod address;
mod bridge;
mod clock;
mod connection;
mod conversation;
mod discovery;
mod event;
mod hid;
mod notice;
mod problem;
mod reopening;
mod requests;
mod sequence;
pub mod servo;
mod session;
mod talk;
mod topology;
mod transport;
mod usb_bulk;
mod usb_id;
mod watch;

pub use address::{AddressError, DEFAULT_BAUD, DeviceAddress, HidPlace};
pub use clock::ClockEstimate;
pub use connection::{Connection, ConnectionSettings};
pub use discovery::{DeviceDescription, DeviceGuess, Plugged, UsbDescription, list_devices, list_serial_ports};
pub use event::{DeviceInfo, Event, Sample, SessionCounters};
pub use firmware_protocol::{PartKind, PartRecord as Part, PartUid, RefusalReason, SensorState, features};
pub use notice::DeviceNotice;
pub use problem::{DeviceProblem, UDEV_RULES};
pub use requests::RequestKind;
pub use session::{Session, SessionSettings};
pub use topology::{MAX_PARTS, Topology, TopologyProblem};
pub use transport::{Transport, memory, open};
pub use usb_id::{NoUsbId, UsbId};
pub use watch::{DeviceWatch, PortChange};
