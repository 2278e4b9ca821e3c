//! Takes.

mod bytes;
mod error;
mod frame;
mod packed_pose;
mod payload;
mod reader;
mod record;
mod report;
mod writer;

pub use error::{PayloadError, TakeError, WriteError};
pub use frame::{MAGIC, MAJOR_VERSION, MAX_PAYLOAD_BYTES, MINOR_VERSION, PREAMBLE_BYTES, RECORD_OVERHEAD_BYTES};
pub use packed_pose::PackedPose;
pub use payload::MAX_PARTS;
pub use reader::Take;
pub use record::{Event, EventKind, Header, Record, RecordKind, Sample, Topology, Totals};
pub use report::{Problem, ReadReport, UnknownRecords};
pub use writer::TakeWriter;
