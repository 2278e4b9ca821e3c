//! Reading a take, and reporting exactly what is missing.

use std::io;

use armature_rig::{Calibration, Dynamics, Ground, Pose, Skeleton};

use super::bytes::Fields;
use super::error::{PayloadError, TakeError, WriteError};
use super::format::{MAGIC, MAJOR_VERSION, MINOR_VERSION, PREAMBLE_BYTES, RECORD_OVERHEAD_BYTES};
use super::frame::{self, Damage, Found, RawRecord, Scanner};
use super::packed_pose::PackedPose;
use super::record::{Event, Header, InverseKinematicsHeader, Record, Sample, Totals};
use super::record_kind::RecordKind;
use super::report::{Problem, ReadReport};
use super::writer::TakeWriter;
use super::{payload, payload_dynamics, payload_rig, payload_target};

/// A take in memory: its records in the order they were written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Take {
    header: Header,
    records: Vec<Record>,
    skeleton: Option<usize>,
    end: Option<Totals>,
}

impl Take {
    /// Reads a take. Only bytes without a readable header are an error; anything else that is damaged or cut off is
    /// skipped and listed in the report.
    pub fn read(bytes: &[u8]) -> Result<(Self, ReadReport), TakeError> {
        let minor_version = read_preamble(bytes)?;
        let mut scanner = Scanner::new(bytes);
        let (header, mut offset) = read_header(&mut scanner, bytes.len(), minor_version)?;
        let mut take = Self { header, ..Self::default() };
        let mut report = ReadReport::new(bytes.len() as u64, minor_version);
        report.read.bytes = PREAMBLE_BYTES as u64;
        report.read.count(Some(RecordKind::Header), (offset - PREAMBLE_BYTES) as u64);
        while offset < bytes.len() {
            match scanner.at(offset) {
                Found::Record { record, end } => {
                    take.accept(record, offset, minor_version, &mut report);
                    offset = end;
                }
                Found::Damage(damage) => {
                    report.problems.push(problem(offset, damage));
                    offset = damage.end;
                }
            }
            if take.end.is_some() {
                break;
            }
        }
        if offset < bytes.len() {
            report.problems.push(Problem::AfterEnd { offset: offset as u64, bytes: (bytes.len() - offset) as u64 });
        }
        report.end = take.end;
        Ok((take, report))
    }

    /// The origin of the take.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Everything between header and end, in file order.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The skeleton its poses move.
    pub fn skeleton(&self) -> Option<&Skeleton> {
        match self.records.get(self.skeleton?) {
            Some(Record::Skeleton(skeleton)) => Some(skeleton),
            _ => None,
        }
    }

    /// All samples, in file order.
    pub fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.records.iter().filter_map(|record| if let Record::Sample(sample) = record { Some(sample) } else { None })
    }

    /// All poses, in file order.
    pub fn poses(&self) -> impl Iterator<Item = &PackedPose> {
        self.records.iter().filter_map(|record| if let Record::Pose(pose) = record { Some(pose) } else { None })
    }

    /// All events, in file order.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.records.iter().filter_map(|record| if let Record::Event(event) = record { Some(event) } else { None })
    }

    /// How bones without a joint were posed, from its beginning or from some sample on; `None`: they stayed in the rest pose.
    pub fn inverse_kinematics(&self) -> Option<&InverseKinematicsHeader> {
        let later = || {
            self.records.iter().find_map(|record| match record {
                Record::InverseKinematics(ik) => Some(ik),
                _ => None,
            })
        };
        self.header.inverse_kinematics.as_ref().or_else(later)
    }

    /// How the roots follow the feet, as last said; `None` where they do not.
    pub fn ground(&self) -> Option<&Ground> {
        let said = self
            .records
            .iter()
            .rev()
            .find_map(|record| if let Record::Ground(ground) = record { Some(ground) } else { None });
        said.and_then(Option::as_ref)
    }

    /// Which bones swing and how, as last said; `None` where none do.
    pub fn dynamics(&self) -> Option<&Dynamics> {
        let said = self
            .records
            .iter()
            .rev()
            .find_map(|record| if let Record::Dynamics(dynamics) = record { Some(dynamics) } else { None });
        said.and_then(Option::as_ref)
    }

    /// The same take with other records.
    pub(crate) fn with_records(&self, records: Vec<Record>) -> Self {
        let skeleton = records.iter().position(|record| matches!(record, Record::Skeleton(_)));
        Self { header: self.header.clone(), records, skeleton, end: self.end }
    }

    /// A pose with every bone; empty for a take without a skeleton.
    pub fn unpack(&self, packed: &PackedPose) -> Pose {
        let mut pose = Pose::default();
        if let Some(skeleton) = self.skeleton() {
            packed.unpack(skeleton, &mut pose);
        }
        pose
    }

    /// The end record; `None` for a take that was not finished.
    pub fn end(&self) -> Option<Totals> {
        self.end
    }

    /// Writes the take. A take that was read whole comes out byte for byte; a take without an end record gets none.
    pub fn write<W: io::Write>(&self, out: W) -> Result<W, WriteError> {
        let mut writer = TakeWriter::new(out, &self.header)?;
        for record in &self.records {
            writer.record(record)?;
        }
        if self.end.is_some() {
            return writer.finish();
        }
        writer.flush()?;
        Ok(writer.abandon())
    }

    fn accept(&mut self, record: RawRecord<'_>, offset: usize, minor_version: u16, report: &mut ReadReport) {
        let bytes = (RECORD_OVERHEAD_BYTES + record.payload.len()) as u64;
        let Some(kind) = RecordKind::from_code(record.kind) else {
            report.read.count(None, bytes);
            report.count_unknown(record.kind, record.payload.len() as u64);
            return;
        };
        let mut fields = Fields::new(record.payload);
        let read = self.read_payload(kind, &mut fields).and_then(|read| all_read(fields, minor_version).map(|()| read));
        match read {
            Ok(Read::Record(record)) => {
                if kind == RecordKind::Skeleton {
                    self.skeleton = Some(self.records.len());
                }
                self.records.push(record);
                report.read.count(Some(kind), bytes);
            }
            Ok(Read::Calibration(calibration)) => {
                if let Some(last) = self.records.last_mut() {
                    *last = Record::Calibration(calibration);
                }
                report.read.count(Some(kind), bytes);
            }
            Ok(Read::End(totals)) => self.end = Some(totals),
            Err(reason) => report.problems.push(Problem::Unusable { offset: offset as u64, kind, reason }),
        }
    }

    fn read_payload(&self, kind: RecordKind, fields: &mut Fields<'_>) -> Result<Read, PayloadError> {
        Ok(Read::Record(match kind {
            RecordKind::Header => return Err(PayloadError::Repeated),
            RecordKind::Skeleton if self.skeleton.is_some() => return Err(PayloadError::Repeated),
            RecordKind::Skeleton => Record::Skeleton(payload::read_skeleton(fields)?),
            RecordKind::Topology => Record::Topology(payload::read_topology(fields)?),
            RecordKind::Calibration => Record::Calibration(payload_rig::read_calibration(fields)?),
            RecordKind::Mapping => Record::Mapping(payload_rig::read_mapping(fields)?),
            RecordKind::Sample => Record::Sample(payload::read_sample(fields)?),
            RecordKind::Pose => Record::Pose(payload::read_pose(fields, self.skeleton())?),
            RecordKind::Event => Record::Event(payload::read_event(fields)?),
            RecordKind::JointSettings => {
                let Some(Record::Calibration(before)) = self.records.last() else { return Err(PayloadError::Alone) };
                let mut calibration = before.clone();
                payload_rig::read_joint_settings(fields, &mut calibration)?;
                return Ok(Read::Calibration(calibration));
            }
            RecordKind::Engagement => {
                Record::Engagement { micros: fields.u32("time")?, all: fields.u8("whole puppet")? != 0 }
            }
            RecordKind::Ground => Record::Ground(payload_rig::read_ground(fields, self.skeleton())?),
            RecordKind::Dynamics => Record::Dynamics(payload_dynamics::read(fields, self.skeleton())?),
            RecordKind::Shape => Record::Shape(payload_rig::read_shape_setting(fields)?),
            RecordKind::Target => Record::Target(payload_target::read_target(fields, self.skeleton())?),
            RecordKind::InverseKinematics => Record::InverseKinematics(payload::read_inverse_kinematics(fields)?),
            RecordKind::ReadingsReturn => Record::ReadingsReturn { micros: fields.u32("time")? },
            RecordKind::End => return payload::read_totals(fields).map(Read::End),
        }))
    }
}

enum Read {
    Record(Record),
    /// What becomes of the last record.
    Calibration(Calibration),
    End(Totals),
}

/// A newer minor version may append fields; our own may not.
fn all_read(fields: Fields<'_>, minor_version: u16) -> Result<(), PayloadError> {
    match fields.left() {
        0 => Ok(()),
        _ if minor_version > MINOR_VERSION => Ok(()),
        bytes => Err(PayloadError::TooLong { bytes }),
    }
}

fn read_preamble(bytes: &[u8]) -> Result<u16, TakeError> {
    let known = bytes.len().min(MAGIC.len());
    if bytes[..known] != MAGIC[..known] {
        return Err(TakeError::NotATake);
    }
    let ends = TakeError::EndsInHeader { bytes: bytes.len() as u64 };
    let preamble = bytes.first_chunk::<PREAMBLE_BYTES>().ok_or(ends)?;
    let (major, minor) = frame::versions(preamble).ok_or(TakeError::DamagedVersion)?;
    if major != MAJOR_VERSION {
        return Err(TakeError::OtherMajorVersion { major, minor });
    }
    Ok(minor)
}

fn read_header(scanner: &mut Scanner<'_>, file_bytes: usize, minor_version: u16) -> Result<(Header, usize), TakeError> {
    let offset = PREAMBLE_BYTES as u64;
    if file_bytes == PREAMBLE_BYTES {
        return Err(TakeError::EndsInHeader { bytes: offset });
    }
    match scanner.at(PREAMBLE_BYTES) {
        Found::Record { record, end } if record.kind == RecordKind::Header.code() => {
            let mut fields = Fields::new(record.payload);
            let header = payload::read_header(&mut fields)
                .and_then(|header| all_read(fields, minor_version).map(|()| header))
                .map_err(|reason| TakeError::BadHeader { offset, reason })?;
            Ok((header, end))
        }
        Found::Damage(damage) if damage.truncated => Err(TakeError::EndsInHeader { bytes: file_bytes as u64 }),
        _ => Err(TakeError::DamagedHeader { offset }),
    }
}

fn problem(offset: usize, damage: Damage) -> Problem {
    let kind = damage.kind.and_then(RecordKind::from_code);
    let (offset, bytes) = (offset as u64, (damage.end - offset) as u64);
    if damage.truncated {
        Problem::CutOff { offset, bytes, kind }
    } else {
        Problem::Damaged { offset, bytes, kind, rest_unread: damage.given_up }
    }
}
