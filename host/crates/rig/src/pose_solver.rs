//! From raw counts to a pose, sample by sample.

use std::ops::Range;

use glam::Quat;

use crate::{
    Calibration, JointTree, Mapping, MappingEntry, MappingError, PartUid, Pose, SensorCalibration, SensorState,
    Skeleton, Transform, joint_rotation,
};

/// How far a bone's rotation can be trusted, worst first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum BoneQuality {
    /// No part drives the bone; it is in the rest pose.
    #[default]
    Unmapped,
    /// The part that drives it is not plugged in; the bone keeps its last rotation.
    Absent,
    /// A sensor was never zeroed and counts as being in the rest pose.
    Unzeroed,
    /// A sensor has not had one usable reading yet and counts as being in the rest pose.
    NoReading,
    /// A sensor has no good reading now; its last good one is used.
    Held,
    /// A sensor reports a weak magnet; its reading is used.
    Weak,
    /// All sensors are good.
    Live,
}

/// The state of one bone after the latest sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoneStatus {
    /// The worst of what its sensors say.
    pub quality: BoneQuality,
    /// For how many samples in a row the stalest of its sensors has had no usable reading.
    pub held_samples: u32,
}

/// Why a sample cannot be solved.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// The sample is numbered by another tree.
    #[error("the sample has {counts} counts and {states} states, the puppet has {sensors} sensors")]
    Length {
        /// Counts given.
        counts: usize,
        /// States given.
        states: usize,
        /// Sensors of the tree.
        sensors: usize,
    },
}

/// A sensor and its last usable reading.
#[derive(Clone, Debug)]
struct Sensor {
    slot: usize,
    calibration: SensorCalibration,
    counts_per_turn: u32,
    last_counts: Option<u16>,
    held_samples: u32,
    weak: bool,
}

/// A part that drives a bone.
#[derive(Clone, Debug)]
struct Driver {
    part: PartUid,
    plugged_in: bool,
    bone: usize,
    bone_from_part: Quat,
    sensors: Range<usize>,
    delta: Quat,
}

/// Turns samples into poses.
///
/// Bone rotation = rest · Π F·Δ·F⁻¹ over its parts from the root outwards, with F = `bone_from_joint` ·
/// mounting and Δ the part's own rotation. Translation and scale stay as in the rest pose.
#[derive(Clone, Debug)]
pub struct PoseSolver {
    rest: Vec<Transform>,
    sensor_count: usize,
    sensors: Vec<Sensor>,
    drivers: Vec<Driver>,
    status: Vec<BoneStatus>,
}

impl PoseSolver {
    /// Prepares everything that does not change from sample to sample.
    ///
    /// Parts of the tree that the calibration does not know count as never zeroed. Parts of the mapping that
    /// are not in the tree leave their bone alone.
    pub fn new(
        tree: &JointTree,
        calibration: &Calibration,
        mapping: &Mapping,
        skeleton: &Skeleton,
    ) -> Result<Self, MappingError> {
        let rest_frames = skeleton.rest_model_from_bone();
        let mut solver = Self {
            rest: skeleton.bones().iter().map(|bone| bone.rest).collect(),
            sensor_count: tree.sensor_count(),
            sensors: Vec::with_capacity(tree.sensor_count()),
            drivers: Vec::with_capacity(mapping.entries.len()),
            status: vec![BoneStatus::default(); skeleton.len()],
        };
        for (part, entry) in in_tree_order(tree, mapping)? {
            let bone = find_bone(skeleton, entry)?;
            if !(entry.mounting.is_finite() && entry.mounting.is_normalized()) {
                return Err(MappingError::BadMounting { part: entry.part });
            }
            let first = solver.sensors.len();
            if let Some(part) = part {
                solver.add_sensors(tree, part, calibration, entry)?;
            }
            solver.drivers.push(Driver {
                part: entry.part,
                plugged_in: part.is_some(),
                bone,
                bone_from_part: (skeleton.bone_from_joint(bone, &rest_frames) * entry.mounting).normalize(),
                sensors: first..solver.sensors.len(),
                delta: Quat::IDENTITY,
            });
        }
        solver.update_status();
        Ok(solver)
    }

    fn add_sensors(
        &mut self,
        tree: &JointTree,
        part: usize,
        calibration: &Calibration,
        entry: &MappingEntry,
    ) -> Result<(), MappingError> {
        let axes = tree.parts()[part].kind.axes();
        if axes.is_empty() {
            return Err(MappingError::Splitter { part: entry.part, bone: entry.bone.clone() });
        }
        let known = calibration.checked_part(tree, part)?;
        for (index, (slot, &axis)) in tree.sensors(part).zip(axes).enumerate() {
            self.sensors.push(Sensor {
                slot,
                calibration: known.map_or(SensorCalibration::unzeroed(axis), |sensors| sensors[index]),
                counts_per_turn: tree.parts()[part].counts_per_turn,
                last_counts: None,
                held_samples: 0,
                weak: false,
            });
        }
        Ok(())
    }

    /// Number of sensors that a sample needs.
    pub fn sensor_count(&self) -> usize {
        self.sensor_count
    }

    /// Takes over the last readings and rotations of a solver that this one replaces (after zeroing, after a
    /// change of the mapping, after something was plugged in or out), so that nothing jumps without reason.
    /// Parts are matched by their numbers.
    pub fn continue_from(&mut self, previous: &Self) {
        for driver in &mut self.drivers {
            let Some(before) = previous.drivers.iter().find(|d| d.part == driver.part) else { continue };
            driver.delta = before.delta;
            let old = &previous.sensors[before.sensors.clone()];
            for (sensor, old) in self.sensors[driver.sensors.clone()].iter_mut().zip(old) {
                sensor.last_counts = old.last_counts;
                sensor.held_samples = old.held_samples;
            }
        }
        self.update_status();
    }

    /// Writes the pose of one sample; allocates nothing unless `pose` has another number of bones.
    ///
    /// A sensor without data or with an outlier keeps its last usable count, and one that never had any is
    /// taken to be in the rest pose; [`bone_status`](Self::bone_status) tells. A weak magnet's count is used.
    pub fn solve(&mut self, counts: &[u16], states: &[SensorState], pose: &mut Pose) -> Result<(), SampleError> {
        if counts.len() != self.sensor_count || states.len() != self.sensor_count {
            let (counts, states, sensors) = (counts.len(), states.len(), self.sensor_count);
            return Err(SampleError::Length { counts, states, sensors });
        }
        for sensor in &mut self.sensors {
            sensor.read(counts[sensor.slot], states[sensor.slot]);
        }
        for driver in self.drivers.iter_mut().filter(|driver| driver.plugged_in) {
            driver.delta = rotation_of(&self.sensors[driver.sensors.clone()]);
        }
        self.update_status();
        self.write_pose(pose);
        Ok(())
    }

    /// Writes the pose of the latest sample again (before the first: the rest pose).
    pub fn write_pose(&self, pose: &mut Pose) {
        pose.parent_from_bone.clear();
        pose.parent_from_bone.extend_from_slice(&self.rest);
        for driver in &self.drivers {
            let turn = driver.bone_from_part * driver.delta * driver.bone_from_part.inverse();
            let rotation = &mut pose.parent_from_bone[driver.bone].rotation;
            *rotation = (*rotation * turn).normalize();
        }
    }

    /// What is known of each bone after the latest sample, in the skeleton's order.
    pub fn bone_status(&self) -> &[BoneStatus] {
        &self.status
    }

    fn update_status(&mut self) {
        self.status.fill(BoneStatus::default());
        for driver in &self.drivers {
            let status = &mut self.status[driver.bone];
            let mut join = |quality: BoneQuality, held_samples: u32| {
                let worst = status.quality == BoneQuality::Unmapped || quality < status.quality;
                status.quality = if worst { quality } else { status.quality };
                status.held_samples = status.held_samples.max(held_samples);
            };
            if !driver.plugged_in {
                join(BoneQuality::Absent, 0);
            }
            for sensor in &self.sensors[driver.sensors.clone()] {
                join(sensor.quality(), sensor.held_samples);
            }
        }
    }
}

impl Sensor {
    fn read(&mut self, counts: u16, state: SensorState) {
        match state {
            SensorState::Ok | SensorState::MagnetWeak => {
                self.last_counts = Some(counts);
                self.held_samples = 0;
            }
            SensorState::NoData | SensorState::Outlier => self.held_samples = self.held_samples.saturating_add(1),
        }
        self.weak = state == SensorState::MagnetWeak;
    }

    fn angle(&self) -> f64 {
        self.last_counts.and_then(|counts| self.calibration.angle(counts, self.counts_per_turn)).unwrap_or(0.0)
    }

    fn quality(&self) -> BoneQuality {
        match self.last_counts {
            _ if self.calibration.zero_counts.is_none() => BoneQuality::Unzeroed,
            None => BoneQuality::NoReading,
            Some(_) if self.held_samples > 0 => BoneQuality::Held,
            Some(_) if self.weak => BoneQuality::Weak,
            Some(_) => BoneQuality::Live,
        }
    }
}

fn rotation_of(sensors: &[Sensor]) -> Quat {
    let mut axes = [crate::JointAxis::Twist; 3];
    let mut angles = [0.0; 3];
    let count = sensors.len().min(3);
    for (index, sensor) in sensors.iter().take(3).enumerate() {
        axes[index] = sensor.calibration.axis;
        angles[index] = sensor.angle();
    }
    joint_rotation(&axes[..count], &angles[..count])
}

type PlacedEntry<'a> = (Option<usize>, &'a MappingEntry);

/// Entries with the index of their part: parents before children, then those that are not plugged in.
fn in_tree_order<'a>(tree: &JointTree, mapping: &'a Mapping) -> Result<Vec<PlacedEntry<'a>>, MappingError> {
    let mut by_uid: Vec<&MappingEntry> = mapping.entries.iter().collect();
    by_uid.sort_by_key(|entry| entry.part);
    if let Some(twice) = by_uid.windows(2).find(|pair| pair[0].part == pair[1].part) {
        let (first, second) = (twice[0].bone.clone(), twice[1].bone.clone());
        return Err(MappingError::PartTwice { part: twice[0].part, first, second });
    }
    let mut placed: Vec<PlacedEntry<'_>> = mapping.entries.iter().map(|entry| (tree.find(entry.part), entry)).collect();
    placed.sort_by_key(|(part, _)| part.unwrap_or(usize::MAX));
    Ok(placed)
}

fn find_bone(skeleton: &Skeleton, entry: &MappingEntry) -> Result<usize, MappingError> {
    skeleton.find(&entry.bone).ok_or_else(|| {
        let plain = |name: &str| name.rsplit([':', '|']).next().unwrap_or(name).to_lowercase();
        let wanted = plain(&entry.bone);
        let nearest = skeleton.bones().iter().find(|bone| plain(&bone.name) == wanted).map(|bone| bone.name.clone());
        MappingError::UnknownBone { part: entry.part, bone: entry.bone.clone(), nearest }
    })
}
