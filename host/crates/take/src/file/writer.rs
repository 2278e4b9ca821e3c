//! Writing a take, record by record.

use std::io;

use armature_rig::{Calibration, Dynamics, Ground, JointTree, Mapping, Pose, RawSample, Skeleton, TargetChange};

use super::bytes::Put;
use super::error::WriteError;
use super::format::PREAMBLE_BYTES;
use super::packed_pose::PackedPose;
use super::record::{Event, Header, InverseKinematicsHeader, Record, ShapeSetting, Totals};
use super::record_kind::RecordKind;
use super::{frame, packed_pose, payload, payload_dynamics, payload_rig, payload_target};

/// Appends records to any byte sink.
///
/// Each record goes out in one `write_all`, so whatever happens to the program, everything written before can be read.
/// The writer never seeks and never flushes on its own: wrap the file in a `BufWriter` and call [`TakeWriter::flush`]
/// as often as you want to limit losses.
#[derive(Debug)]
pub struct TakeWriter<W: io::Write> {
    out: W,
    record: Vec<u8>,
    skeleton: Option<Skeleton>,
    totals: Totals,
    cut_off: bool,
}

impl<W: io::Write> TakeWriter<W> {
    /// Writes preamble and header.
    pub fn new(mut out: W, header: &Header) -> Result<Self, WriteError> {
        out.write_all(&frame::preamble(header.minor_version()))?;
        let totals = Totals { bytes: PREAMBLE_BYTES as u64, ..Totals::default() };
        let mut writer = Self { out, record: Vec::new(), skeleton: None, totals, cut_off: false };
        writer.write(RecordKind::Header, |payload| payload::put_header(payload, header))?;
        Ok(writer)
    }

    /// The character's skeleton; once, before the first pose.
    pub fn skeleton(&mut self, skeleton: &Skeleton) -> Result<(), WriteError> {
        if self.skeleton.is_some() {
            return Err(WriteError::SecondSkeleton);
        }
        self.write(RecordKind::Skeleton, |payload| payload::put_skeleton(payload, skeleton))?;
        self.skeleton = Some(skeleton.clone());
        Ok(())
    }

    /// The puppet, from here on.
    pub fn topology(&mut self, epoch: u16, tree: &JointTree) -> Result<(), WriteError> {
        self.write(RecordKind::Topology, |payload| payload::put_topology(payload, epoch, tree))
    }

    /// What counts mean, from here on; replaces the former calibration as a whole.
    pub fn calibration(&mut self, calibration: &Calibration) -> Result<(), WriteError> {
        self.write(RecordKind::Calibration, |payload| payload_rig::put_calibration(payload, calibration))?;
        if !payload_rig::has_joint_settings(calibration) {
            return Ok(());
        }
        self.write(RecordKind::JointSettings, |payload| payload_rig::put_joint_settings(payload, calibration))
    }

    /// Which part drives which bone, from here on; replaces the former mapping as a whole.
    pub fn mapping(&mut self, mapping: &Mapping) -> Result<(), WriteError> {
        self.write(RecordKind::Mapping, |payload| payload_rig::put_mapping(payload, mapping))
    }

    /// One reading; `host_receive_seconds` on the recorder's clock, if it has one.
    pub fn sample(&mut self, raw: &RawSample, host_receive_seconds: Option<f64>) -> Result<(), WriteError> {
        self.write(RecordKind::Sample, |payload| payload::put_sample(payload, raw, host_receive_seconds))
    }

    /// The pose solved from the sample with this sequence number and device time.
    pub fn pose(&mut self, sequence: u32, device_micros: u64, pose: &Pose) -> Result<(), WriteError> {
        let skeleton = self.skeleton.take().ok_or(WriteError::NoSkeleton)?;
        let (got, expected) = (pose.parent_from_bone.len(), skeleton.len());
        let outcome = if got == expected {
            self.write(RecordKind::Pose, |payload| {
                payload::put_pose_head(payload, sequence, device_micros, expected);
                packed_pose::pack(pose, &skeleton, payload);
                Ok(())
            })
        } else {
            Err(WriteError::BoneCount { got, expected })
        };
        self.skeleton = Some(skeleton);
        outcome
    }

    /// Something that happened.
    pub fn event(&mut self, event: &Event) -> Result<(), WriteError> {
        self.write(RecordKind::Event, |payload| payload::put_event(payload, event))
    }

    /// How parts that come back move their bones from here on: over this time, microseconds of the device's clock.
    /// `all`: the whole puppet comes back here.
    pub fn engagement(&mut self, micros: u32, all: bool) -> Result<(), WriteError> {
        self.write(RecordKind::Engagement, |payload| {
            payload.put_u32(micros);
            payload.put_u8(all.into());
            Ok(())
        })
    }

    /// How joints whose readings were missing take their bones along from here on: over as long as that was, but no
    /// longer than this, microseconds of the device's clock.
    pub fn readings_return(&mut self, micros: u32) -> Result<(), WriteError> {
        self.write(RecordKind::ReadingsReturn, |payload| {
            payload.put_u32(micros);
            Ok(())
        })
    }

    /// How the roots follow the feet from here on; `None`: they do not.
    pub fn ground(&mut self, ground: Option<&Ground>) -> Result<(), WriteError> {
        self.write(RecordKind::Ground, |payload| payload_rig::put_ground(payload, ground))
    }

    /// A blend shape is set by hand from here on; its weight must be finite.
    pub fn shape(&mut self, setting: &ShapeSetting) -> Result<(), WriteError> {
        self.write(RecordKind::Shape, |payload| payload_rig::put_shape_setting(payload, setting))
    }

    /// Which bones swing and how from here on; `None`: none do.
    pub fn dynamics(&mut self, dynamics: Option<&Dynamics>) -> Result<(), WriteError> {
        self.write(RecordKind::Dynamics, |payload| payload_dynamics::put(payload, dynamics))
    }

    /// A point of the character is dragged, or let go, from the next sample on.
    pub fn target(&mut self, change: &TargetChange) -> Result<(), WriteError> {
        self.write(RecordKind::Target, |payload| {
            payload_target::put_target(payload, change);
            Ok(())
        })
    }

    /// Bones without a joint are posed by inverse kinematics from here on; for a take whose header has none.
    pub fn inverse_kinematics(&mut self, ik: &InverseKinematicsHeader) -> Result<(), WriteError> {
        self.write(RecordKind::InverseKinematics, |payload| payload::put_inverse_kinematics(payload, ik))
    }

    /// Any record, as stored in a take that was read.
    pub fn record(&mut self, record: &Record) -> Result<(), WriteError> {
        match record {
            Record::Skeleton(skeleton) => self.skeleton(skeleton),
            Record::Topology(topology) => self.topology(topology.epoch, &topology.tree),
            Record::Calibration(calibration) => self.calibration(calibration),
            Record::Mapping(mapping) => self.mapping(mapping),
            Record::Sample(sample) => self.sample(&sample.raw, sample.host_receive_seconds),
            Record::Pose(pose) => self.packed_pose(pose),
            Record::Event(event) => self.event(event),
            Record::Engagement { micros, all } => self.engagement(*micros, *all),
            Record::ReadingsReturn { micros } => self.readings_return(*micros),
            Record::Ground(ground) => self.ground(ground.as_ref()),
            Record::Shape(setting) => self.shape(setting),
            Record::Dynamics(dynamics) => self.dynamics(dynamics.as_ref()),
            Record::Target(change) => self.target(change),
            Record::InverseKinematics(ik) => self.inverse_kinematics(ik),
        }
    }

    /// What has been written so far.
    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// Flushes the underlying writer.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.out.flush()?)
    }

    /// Writes the end record, flushes and returns the underlying writer.
    pub fn finish(mut self) -> Result<W, WriteError> {
        let totals = self.totals;
        self.write(RecordKind::End, |payload| {
            payload::put_totals(payload, &totals);
            Ok(())
        })?;
        self.out.flush()?;
        Ok(self.out)
    }

    /// Returns the underlying writer without an end record, as a crash would leave it.
    pub fn abandon(self) -> W {
        self.out
    }

    fn packed_pose(&mut self, pose: &PackedPose) -> Result<(), WriteError> {
        let expected = self.skeleton.as_ref().ok_or(WriteError::NoSkeleton)?.len();
        if pose.bone_count() != expected {
            return Err(WriteError::BoneCount { got: pose.bone_count(), expected });
        }
        self.write(RecordKind::Pose, |payload| {
            payload::put_pose_head(payload, pose.sequence, pose.device_micros, expected);
            payload.extend_from_slice(pose.packed());
            Ok(())
        })
    }

    fn write(
        &mut self,
        kind: RecordKind,
        put: impl FnOnce(&mut Vec<u8>) -> Result<(), WriteError>,
    ) -> Result<(), WriteError> {
        if self.cut_off {
            return Err(WriteError::CutOff);
        }
        self.record.clear();
        self.record.put_u16(kind.code());
        self.record.put_u32(0);
        put(&mut self.record)?;
        frame::seal(&mut self.record).map_err(|bytes| WriteError::TooLarge { bytes })?;
        if let Err(error) = self.out.write_all(&self.record) {
            self.cut_off = true;
            return Err(error.into());
        }
        self.totals.count(Some(kind), self.record.len() as u64);
        Ok(())
    }
}
