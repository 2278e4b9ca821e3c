//! Takes as data: tables for scientists (CSV, `NumPy`), and logs for the viewers of robotics (MCAP).

mod csv;
mod log;
mod mcap;
mod messages;
mod npz;
mod protobuf;
mod readings;

pub use csv::{csv_of, csv_of_motion};
pub use mcap::{McapError, mcap_of};
pub use npz::npz_of;
pub use readings::{JointReading, ReadJoint, Readings, Row, readings};
