//! Talking to a puppet: sessions (bytes and the time in, events out), and the lines that carry the bytes.
//!
//! From bytes to samples, here with a simulated puppet as the device and a clock that we advance ourselves:
//!
//! ```
//! use std::time::Duration;
//! use armature_device::{Event, Session, SessionSettings};
//! use armature_sim::{Body, Puppet, PuppetSettings};
//!
//! let mut puppet = Puppet::new(PuppetSettings::new(Body::preset("human", 1)?))?;
//! let mut session = Session::new(SessionSettings::default());
//! session.start(120_000);
//! let (mut bytes, mut events) = (Vec::new(), Vec::new());
//! for millis in 0..1_000 {
//!     let now = Duration::from_millis(millis);
//!     session.tick(now, &mut events);
//!     puppet.step(millis * 1_000, &session.take_outgoing(), &mut bytes);
//!     session.receive(now, &std::mem::take(&mut bytes), &mut events);
//! }
//! let samples = events.iter().filter(|event| matches!(event, Event::Sample(_))).count();
//! assert!(samples > 100, "{samples}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`session`] | [`Session::receive`] and [`Session::tick`]: the host's side of the protocol, pure |
//! | [`servo`] | [`ServoSession`](servo::ServoSession): the same for arms of bus servos |
//! | [`connection`] | [`Connection::open`], [`Connection::next`]: a session over a line, on a tokio runtime |
//! | [`transports`] | [`open`] a line: serial, USB bulk, HID, TCP; [`memory`] for tests |
//! | [`address`] | [`DeviceAddress`], from text and back |
//! | [`discovery`] | [`list_devices`], and [`DeviceWatch::look`] for what comes and goes |
//! | [`events`] | [`Event`]: everything that a session reports |
//! | [`topology`] | [`Topology::new`]: the tree of parts, checked |
//!
//! This crate reports raw joint readings. It knows nothing about skeletons.

pub mod address;
mod arm;
pub mod connection;
pub mod discovery;
pub mod events;
pub mod servo;
pub mod session;
pub mod topology;
pub mod transports;

pub use address::{AddressError, DEFAULT_BAUD, DeviceAddress, HidPlace, NoUsbId, UsbDescription, UsbId};
pub use connection::{Connection, ConnectionSettings};
pub use discovery::{
    Board, DeviceDescription, DeviceGuess, DeviceWatch, Plugged, PortChange, list_devices, list_serial_ports,
};
pub use events::{
    ClockEstimate, DeviceInfo, DeviceNotice, DeviceProblem, Event, RequestKind, Sample, SessionCounters, UDEV_RULES,
};
pub use firmware_protocol::{PartKind, PartRecord as Part, PartUid, RefusalReason, SensorState, features};
pub use session::{Session, SessionSettings};
pub use topology::{MAX_PARTS, Topology, TopologyProblem};
pub use transports::{Transport, memory, open};
