//! The take file: written record by record ([`TakeWriter`]), read as a whole with a report of what is missing
//! ([`Take::read`]).
//!
//! ```
//! use armature_rig::{RawSample, SensorState};
//! use armature_take::{Header, Take, TakeWriter};
//!
//! let mut writer = TakeWriter::new(Vec::new(), &Header { character_name: "spider".into(), ..Header::default() })?;
//! let sample = RawSample { device_micros: 1_000, counts: vec![2048], states: vec![SensorState::Ok], ..Default::default() };
//! writer.sample(&sample, None)?;
//! let bytes = writer.finish()?;
//!
//! let (take, report) = Take::read(&bytes)?;
//! assert!(report.is_whole());
//! assert_eq!(take.samples().count(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The file, byte by byte
//!
//! All numbers are little-endian; `f32` and `f64` are IEEE 754, and every bit of them counts. `text` is a `u16` length
//! in bytes followed by that much UTF-8. Nothing is aligned or padded.
//!
//! | preamble, 16 bytes | |
//! |---|---|
//! | 8 bytes | `8A 54 41 4B 45 0D 0A 0A` |
//! | `u16` | major version, 1 |
//! | `u16` | minor version: 3 if the header says 128 (below), 2 if it says 64, 1 if it says 16, else 0 |
//! | `u32` | CRC-32 of the 12 bytes before |
//!
//! Then come records until the end of the file, the header first:
//!
//! | record | |
//! |---|---|
//! | `u16` | type |
//! | `u32` | length of the payload, at most 67,108,864 |
//! | length bytes | payload |
//! | `u32` | CRC-32 of type, length and payload |
//!
//! The CRC-32 is the one used by zip and PNG (ISO-HDLC: polynomial 04C11DB7 reflected, initial value and final
//! exclusive-or FFFFFFFF; for `123456789` it is CBF43926).
//!
//! | type | payload |
//! |---|---|
//! | 1 header, once, first | `u32` flags: 1 virtual clock, 2 rate given, 4 seed given, 8 wall-clock time given, 16 inverse kinematics, 32 with preferences (both since 1.1), 64 with limits (since 1.2), 128 with settings (since 1.3) · `f64` nominal samples a second · `u64` seed · `i64` start, microseconds since 1970 UTC · 32 bytes hash of the character's content · `text` character · `text` program version · if flagged 16: `u16` pinned bones · for each: `text` name · if flagged 32 as well: `u16` preferences · for each: `text` · if flagged 64 as well: `u16` limits of joints · for each: `text` · if flagged 128 as well: `u16` settings of inverse kinematics · for each: `text` |
//! | 2 skeleton, at most once, before the first pose | `u16` bones · for each: `text` name · `u16` parent, FFFF for a root · rest transform `parent_from_bone`: 3 `f32` translation, 4 `f32` rotation (x, y, z, w), 3 `f32` scale · 3 `f32` tail in the bone's rest frame |
//! | 3 topology, from here on | `u16` epoch · `u16` parts, at most 4,096 · for each: 12 bytes number · `u8` kind: 1 bend, 2 twist, 3 twist-bend-twist, 4 splitter · `u8` outlets of a splitter, else 0 · `u16` parent, FFFF for the root · `u8` outlet of the parent · `u32` counts a turn |
//! | 4 calibration, from here on, replaces the former one | `u16` parts · for each: 12 bytes number · `u8` sensors · for each: `u8` flags: 1 zeroed, 2 reversed, 4 turns about the twist axis (else bend) · `u16` count in the rest pose, 0 if not zeroed |
//! | 5 mapping, from here on, replaces the former one | `u16` entries, at most 4,096 · for each: 12 bytes part number · `text` bone · 4 `f32` mounting (x, y, z, w) · only where there are any: `u16` joints without a bone of their own, once for every bone that they turn together with the joints below them · for each the same fields · only where there are any: `u16` turns of the rest pose · for each: `text` bone · 3 `f64` axis times degrees · only where there are any: `u16` shared joints · for each: 12 bytes part number · `u8` 1 shares along a chain, 2 curls · `u16` bones · for each: `text` name · `f64` share · `u16` driven shapes · for each: `text` shape · 12 bytes part number · `u8` axis: 0 bend, 1 twist, 2 twist at the outlet · 2 `f64` degrees · 2 `f64` weights |
//! | 6 sample | `u32` sequence · `u64` device time, microseconds · `u16` epoch of the topology that numbers the sensors · `u8` flags: 1 host time follows, 2 states follow · `u16` sensors · if flagged: `f64` host time of receipt, seconds · for each sensor: `u16` count · if flagged: states, 2 bits a sensor, the first in the lowest bits, ⌈sensors / 4⌉ bytes: 0 ok, 1 no data, 2 magnet weak, 3 outlier (without the flag all are ok) |
//! | 7 pose | `u32` sequence and `u64` device time of its sample · `u16` bones, as many as the skeleton has · for each bone `u8` flags: 1 translation, 2 rotation, 4 scale follows · then, bone after bone, what the flags say: 3 `f32` translation, 4 `f32` rotation, 3 `f32` scale. What is not there has the bits of the rest transform |
//! | 8 event | `u8` flags: 1 device time given, 2 host time given · `u64` device time, microseconds · `f64` host time, seconds · `u16` what: 1 lost samples (`u64` count, `u32` sequence before them), 2 noise (`u64` frames with a wrong checksum, `u64` bytes passed over), 3 the device restarted, 4 the connection came back, 5 topology changes (`u16` epoch), 6 marker (`text`), 7 the stream lost synchronisation (`u64` pieces that were no frame, before it was found again), 8 the device's clock could not be believed (`u8` 1: it leapt ahead, 2: it stood still, 3: it went back; `u64` microseconds by how much), 9 time from the last byte of a sample to the pose (`u32` microseconds each: median, what 99 of 100 do not exceed, longest) |
//! | 9 end, last | `u64` each: records before this one, samples, poses, events, bytes before this record |
//!
//! | 10 joint settings, right behind a calibration, where something of this is set | a filter for all · `u16` parts · for each: 12 bytes number · `u8` flags: 1 mounting, 2 heading, 4 filter · 4 `f32` mounting (x, y, z, w) · `f64` heading, radians · a filter · `u16` ranges · for each: 12 bytes number · `u8` sensor · `u16` count at the first stop · `u32` counts to the other one. A filter: `u8` kind: 0 none, 1 One Euro (cutoff, beta, speed cutoff), 2 hold (seconds) · 3 `f64` |
//! | 11 engagement, from here on | `u32` microseconds over which a part that comes back takes its bone along · `u8` 1: the whole puppet comes back here |
//! | 12 return of readings, from here on | `u32` microseconds, at most, over which a joint whose readings were missing takes its bone along; no longer than they were missing |
//!
//! | 13 ground, behind the skeleton, from here on | `u8` mode: 0 off (nothing follows), 1 stand, 2 walk · `f32` height of the floor · `u16` contacts · for each: `u16` bone · `u32` points of the skin · for each: `u16` bone · 3 `f32` place in the bone's frame · only where one of them is not 0: `u8` what stays of a foot: 0 its lowest point, 1 its sole, and all feet whose legs no joint turns · `u8` 1: something else places the roots, which are only lifted |
//! | 20 target, behind the skeleton, from the next sample on | `u8` 0 let go, 1 set · `u32` microseconds of the device's clock over which the point goes there, or the character back · `u8` point: 0 head of a bone, 1 its tail: `u16` bone; 2 on the skin: 3 `u32` vertices, 3 `f32` shares · if set: `u8` flags: 1 place, 2 orientation · `f32` strength · if flagged 1: 3 `f32` place in the world · if flagged 2: 4 `f32` `model_from_bone` of the bone |
//! | 21 inverse kinematics, from here on, in a take whose header has none | `u16` pinned bones · for each: `text` name · `u16` preferences · for each: `text` · `u16` limits of joints · for each: `text` · only where there are any: `u16` settings · for each: `text` |
//!
//! | 14 shape set by hand, from here on | `u8` flags: 1 device time given · `u64` device time of the last sample before, microseconds · `text` name · `f32` weight |
//!
//! | 15 dynamics, behind the skeleton, from here on | `u8` 0 off (nothing follows), 1 on · 3 `f32` wind · `u16` chains · for each: `u16` bones · for each: `u16` bone · 3 `f32` tail in its frame · `f64` stiffness · `f64` drag · `f64` gravity · 3 `f32` direction of gravity · `f64` radius · `u16` colliders · for each: `u16` bone · `u8` 0 sphere, 1 capsule · 3 `f32` centre · 3 `f32` other centre of a capsule, else 0 · `f64` radius |
//!
//! Fields whose flag is not set contain zero. Equal content gives equal bytes.
//!
//! # What a crash leaves, and what damage loses
//!
//! Records are only ever appended, each in one piece. After a crash the file ends with whole records and at most one
//! truncated one, and has no end record. A reader that meets a wrong checksum continues after the record if another
//! whole record follows, and otherwise looks for the next whole record byte by byte; [`ReadReport`] lists every byte
//! that was skipped and, given the end record, how many records of each kind.
//!
//! # Compatibility
//!
//! - A reader refuses another major version, and says so.
//! - Types 10 to 15, the last two fields of 13, types 20, 21 and events 7, 8 and 9 were added after the first takes of version 1.0 and only appear in takes that need
//!   them; older programs skip them and say so.
//! - A higher minor version may bring new record types, which older readers skip by their length and report, and may
//!   append fields to payloads, which older readers ignore. Event codes may be added in the same way; a reader skips an
//!   event it does not know and reports it. Nothing else changes.
//! - Every program of major version 1 reads every take of version 1.x that an earlier one wrote. A golden take in
//!   `tests/golden/` holds us to it.

mod bytes;
mod error;
mod format;
mod frame;
mod packed_pose;
mod payload;
mod payload_dynamics;
mod payload_rig;
mod payload_target;
mod reader;
mod record;
mod record_kind;
mod report;
mod writer;

pub use error::{PayloadError, TakeError, WriteError};
pub use format::{
    MAGIC, MAJOR_VERSION, MAX_PARTS, MAX_PAYLOAD_BYTES, MINOR_VERSION, PREAMBLE_BYTES, RECORD_OVERHEAD_BYTES,
};
pub use packed_pose::PackedPose;
pub(crate) use packed_pose::same_bits;
pub use reader::Take;
pub use record::{
    ClockFault, Event, EventKind, Header, InverseKinematicsHeader, Record, Sample, ShapeSetting, Topology, Totals,
};
pub use record_kind::RecordKind;
pub use report::{Problem, ReadReport, UnknownRecords};
pub use writer::TakeWriter;
