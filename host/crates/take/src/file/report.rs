//! What was found missing when a take was read.

use std::collections::BTreeMap;
use std::fmt;

use super::error::PayloadError;
use super::format::MINOR_VERSION;
use super::record::Totals;
use super::record_kind::RecordKind;

/// What was read, and what was not. `Display` prints one line per fact.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadReport {
    /// Length of the take.
    pub file_bytes: u64,
    /// Minor version of the program that wrote it.
    pub minor_version: u16,
    /// What was read intact, counted as in the end record (including unknown records).
    pub read: Totals,
    /// The end record; `None` for a take that was not finished.
    pub end: Option<Totals>,
    /// Damage and unusable records, in file order.
    pub problems: Vec<Problem>,
    /// Records of types that only a newer program knows, by type.
    pub unknown: BTreeMap<u16, UnknownRecords>,
}

/// Records that were skipped because a newer program wrote them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnknownRecords {
    /// How many.
    pub count: u64,
    /// Bytes of their payloads.
    pub bytes: u64,
}

/// A place where something is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// The file ends inside a record: the recording program was stopped, or the copy is incomplete.
    CutOff {
        /// First byte of the record.
        offset: u64,
        /// Bytes of it that are there.
        bytes: u64,
        /// Its kind, if its first bytes are there.
        kind: Option<RecordKind>,
    },
    /// Bytes with a wrong checksum.
    Damaged {
        /// First byte.
        offset: u64,
        /// Bytes up to the next whole record.
        bytes: u64,
        /// The kind the first damaged record claims.
        kind: Option<RecordKind>,
        /// The search for the next whole record was abandoned, so whole records may be among the bytes.
        rest_unread: bool,
    },
    /// A record whose checksum matches but whose content is invalid.
    Unusable {
        /// First byte.
        offset: u64,
        /// Its kind.
        kind: RecordKind,
        /// What is wrong.
        reason: PayloadError,
    },
    /// Bytes after the end record; they were ignored.
    AfterEnd {
        /// First byte.
        offset: u64,
        /// How many.
        bytes: u64,
    },
}

impl ReadReport {
    pub(super) fn new(file_bytes: u64, minor_version: u16) -> Self {
        let (read, problems, unknown) = (Totals::default(), Vec::new(), BTreeMap::new());
        Self { file_bytes, minor_version, read, end: None, problems, unknown }
    }

    pub(super) fn count_unknown(&mut self, code: u16, payload_bytes: u64) {
        let unknown = self.unknown.entry(code).or_default();
        unknown.count += 1;
        unknown.bytes += payload_bytes;
    }

    /// Whether the take was finished and every record of it was read and understood.
    pub fn is_whole(&self) -> bool {
        self.problems.is_empty() && self.unknown.is_empty() && self.missing() == Some(Totals::default())
    }

    /// How many records of each kind, and how many bytes, the end record announces beyond what was read; `None` for a
    /// take that was not finished, for which nobody knows.
    pub fn missing(&self) -> Option<Totals> {
        let end = self.end?;
        Some(Totals {
            records: end.records.saturating_sub(self.read.records),
            samples: end.samples.saturating_sub(self.read.samples),
            poses: end.poses.saturating_sub(self.read.poses),
            events: end.events.saturating_sub(self.read.events),
            bytes: end.bytes.saturating_sub(self.read.bytes),
        })
    }
}

impl fmt::Display for ReadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Totals { records, samples, poses, events, .. } = self.read;
        write!(f, "{records} records read: {samples} samples, {poses} poses, {events} events")?;
        for problem in &self.problems {
            write!(f, "\n{problem}")?;
        }
        for (code, UnknownRecords { count, bytes }) in &self.unknown {
            write!(f, "\n{count} records of the unknown type {code} ({bytes} bytes) were skipped")?;
            if self.minor_version > MINOR_VERSION {
                f.write_str("; a newer program wrote them")?;
            }
        }
        match self.missing() {
            None => f.write_str("\nno end record: the take was not finished")?,
            Some(missing) if missing != Totals::default() => write!(
                f,
                "\nmissing: {} records ({} samples, {} poses, {} events; {} bytes)",
                missing.records, missing.samples, missing.poses, missing.events, missing.bytes
            )?,
            Some(_) => {}
        }
        Ok(())
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name =
            |kind: &Option<RecordKind>| kind.map_or_else(|| "record".to_owned(), |kind| format!("{kind} record"));
        match self {
            Self::CutOff { offset, bytes, kind } => {
                write!(f, "byte {offset}: the take ends inside a {} (its first {bytes} bytes are there)", name(kind))
            }
            Self::Damaged { offset, bytes, kind, rest_unread } => {
                write!(f, "byte {offset}: {bytes} bytes are damaged, starting with a {}", name(kind))?;
                if *rest_unread {
                    f.write_str("; too much is damaged to look for whole records among them")?;
                }
                Ok(())
            }
            Self::Unusable { offset, kind, reason } => {
                write!(f, "byte {offset}: a {kind} record was skipped: {reason}")
            }
            Self::AfterEnd { offset, bytes } => {
                write!(f, "byte {offset}: {bytes} bytes after the end record were ignored")
            }
        }
    }
}
