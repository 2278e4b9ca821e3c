//! From raw counts to a pose, sample by sample.

use std::ops::Range;

use glam::{Affine3A, Quat};

use crate::engagement::Engagement;
use crate::filter::Smoother;
use crate::{
    Calibration, Filter, JointTree, Mapping, MappingEntry, MappingError, PartUid, Pose, SensorCalibration, SensorState,
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
    /// A sensor has had no good reading for longer than its filter's patience; its last good one is used.
    Stale,
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
    filter: Filter,
    smoother: Smoother,
    last_counts: Option<u16>,
    /// The device's clock at the last usable reading.
    last_micros: u64,
    held_samples: u32,
    weak: bool,
    stale: bool,
}

/// A part that drives a bone.
#[derive(Clone, Debug)]
struct Driver {
    part: PartUid,
    plugged_in: bool,
    bone: usize,
    bone_from_part: Quat,
    /// In the frame of the bone's parent: what turns the bone back about the model's vertical.
    heading: Option<Quat>,
    sensors: Range<usize>,
    /// The rotation shown.
    delta: Quat,
    engagement: Option<Engagement>,
}

/// Turns samples into poses.
///
/// Bone rotation = heading · rest · Π F·Δ·F⁻¹ over its parts from the root outwards, with F = `bone_from_joint` ·
/// mounting and Δ the part's own rotation. Translation and scale stay as in the rest pose.
#[derive(Clone, Debug)]
pub struct PoseSolver {
    rest: Vec<Transform>,
    rest_frames: Vec<Affine3A>,
    parents: Vec<Option<usize>>,
    /// How long a part takes to come back, microseconds.
    engage_micros: u32,
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
            engage_micros: 0,
            parents: skeleton.bones().iter().map(|bone| bone.parent).collect(),
            rest: skeleton.bones().iter().map(|bone| bone.rest).collect(),
            sensor_count: tree.sensor_count(),
            sensors: Vec::with_capacity(tree.sensor_count()),
            drivers: Vec::with_capacity(mapping.entries.len()),
            status: vec![BoneStatus::default(); skeleton.len()],
            rest_frames,
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
            let settings = calibration.part_settings(entry.part);
            if !(settings.mounting.is_finite() && settings.mounting.is_normalized() && settings.heading.is_finite()) {
                return Err(MappingError::BadMounting { part: entry.part });
            }
            let mut bone_from_part = skeleton.bone_from_joint(bone, &solver.rest_frames) * entry.mounting;
            if settings.mounting != Quat::IDENTITY {
                bone_from_part *= settings.mounting;
            }
            solver.drivers.push(Driver {
                part: entry.part,
                plugged_in: part.is_some(),
                bone,
                bone_from_part: bone_from_part.normalize(),
                heading: (settings.heading != 0.0).then(|| solver.turned_back(bone, settings.heading)),
                sensors: first..solver.sensors.len(),
                delta: Quat::IDENTITY,
                engagement: None,
            });
        }
        solver.update_status();
        Ok(solver)
    }

    /// The turn of a bone by -heading about the model's vertical, in its parent's frame in the rest pose.
    fn turned_back(&self, bone: usize, heading: f64) -> Quat {
        let (sin, cos) = libm::sincos(-0.5 * heading);
        let in_model = Quat::from_xyzw(0.0, sin as f32, 0.0, cos as f32);
        let model_from_parent = self.parents[bone].map_or(Quat::IDENTITY, |parent| self.rest_rotation(parent));
        (model_from_parent.inverse() * in_model * model_from_parent).normalize()
    }

    /// `model_from_bone` of the rest pose, without its place.
    fn rest_rotation(&self, bone: usize) -> Quat {
        let mut rotation = self.rest[bone].rotation;
        let mut above = self.parents[bone];
        while let Some(parent) = above {
            rotation = self.rest[parent].rotation * rotation;
            above = self.parents[parent];
        }
        rotation.normalize()
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
                filter: calibration.filter_of(entry.part),
                smoother: Smoother::default(),
                last_counts: None,
                last_micros: 0,
                held_samples: 0,
                weak: false,
                stale: false,
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
    /// Parts are matched by their numbers. One that was out and is back goes from where its bone stands to what it
    /// reads over [`engage_micros`](Self::engage_over) of the device's clock.
    pub fn continue_from(&mut self, previous: &Self) {
        self.engage_micros = previous.engage_micros;
        for driver in &mut self.drivers {
            let Some(before) = previous.drivers.iter().find(|d| d.part == driver.part) else { continue };
            driver.delta = before.delta;
            let is_back = driver.plugged_in && !before.plugged_in;
            driver.engagement = match before.engagement {
                _ if is_back && self.engage_micros > 0 => Some(Engagement::from(before.delta)),
                under_way => under_way.filter(|_| driver.plugged_in),
            };
            let old = &previous.sensors[before.sensors.clone()];
            for (sensor, old) in self.sensors[driver.sensors.clone()].iter_mut().zip(old) {
                sensor.last_counts = old.last_counts;
                sensor.last_micros = old.last_micros;
                sensor.held_samples = old.held_samples;
                sensor.stale = old.stale;
                if sensor.filter == old.filter && !is_back {
                    sensor.smoother = old.smoother;
                }
            }
        }
        self.update_status();
    }

    /// From now on, a part that comes back moves its bone to what it reads over so long, microseconds of the device's
    /// clock; 0 (as at first) for at once.
    pub fn engage_over(&mut self, micros: u32) {
        self.engage_micros = micros;
    }

    /// Treats every part as one that comes back with the next sample: the whole puppet was away.
    pub fn engage_all(&mut self) {
        for driver in self.drivers.iter_mut().filter(|driver| driver.plugged_in && self.engage_micros > 0) {
            driver.engagement = Some(Engagement::from(driver.delta));
        }
        self.sensors.iter_mut().for_each(|sensor| sensor.smoother = Smoother::default());
    }

    /// Writes the pose of one sample; allocates nothing unless `pose` has another number of bones.
    /// `micros`: the device's clock.
    ///
    /// A sensor without data or with an outlier keeps its last usable count, and one that never had any is
    /// taken to be in the rest pose; [`bone_status`](Self::bone_status) tells. A weak magnet's count is used.
    pub fn solve(
        &mut self,
        micros: u64,
        counts: &[u16],
        states: &[SensorState],
        pose: &mut Pose,
    ) -> Result<(), SampleError> {
        if counts.len() != self.sensor_count || states.len() != self.sensor_count {
            let (counts, states, sensors) = (counts.len(), states.len(), self.sensor_count);
            return Err(SampleError::Length { counts, states, sensors });
        }
        for sensor in &mut self.sensors {
            sensor.read(micros, counts[sensor.slot], states[sensor.slot]);
        }
        for driver in self.drivers.iter_mut().filter(|driver| driver.plugged_in) {
            driver.follow(&mut self.sensors[driver.sensors.clone()], micros, self.engage_micros);
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
        for (driver, heading) in self.drivers.iter().filter_map(|driver| Some((driver, driver.heading?))) {
            let rotation = &mut pose.parent_from_bone[driver.bone].rotation;
            *rotation = (heading * *rotation).normalize();
        }
    }

    /// The part that is nearest to the puppet's root and drives a bone, and how it turns that bone away from the rest
    /// pose, in the model's frame and without the heading; `None` while no part drives a bone.
    ///
    /// The bone's parents are taken to be in the rest pose, as those of a root are.
    pub fn root_turn(&self) -> Option<(PartUid, Quat)> {
        let root = self.drivers.iter().find(|driver| driver.plugged_in)?;
        let model_from_bone = self.rest_rotation(root.bone);
        let mut turn = Quat::IDENTITY;
        for driver in self.drivers.iter().filter(|driver| driver.bone == root.bone) {
            turn *= driver.bone_from_part * driver.delta * driver.bone_from_part.inverse();
        }
        Some((root.part, (model_from_bone * turn * model_from_bone.inverse()).normalize()))
    }

    /// By how much the filters delay the quickest and the slowest joint now, seconds.
    pub fn lag_seconds(&self) -> (f64, f64) {
        let lags = self.sensors.iter().map(|sensor| match sensor.filter {
            Filter::OneEuro(_) => sensor.smoother.lag_seconds(),
            Filter::None | Filter::Hold { .. } => 0.0,
        });
        lags.fold(None, |bounds: Option<(f64, f64)>, lag| {
            Some(bounds.map_or((lag, lag), |(least, most)| (least.min(lag), most.max(lag))))
        })
        .unwrap_or_default()
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

impl Driver {
    /// Takes what the sensors read now. Where the last reading stood in for too long, the way back takes a moment.
    fn follow(&mut self, sensors: &mut [Sensor], micros: u64, engage_micros: u32) {
        let measured = rotation_of(sensors);
        let is_good = sensors.iter().all(|sensor| sensor.held_samples == 0);
        let mut stale = false;
        for sensor in sensors {
            let over = sensor.held_too_long(micros);
            stale |= over && !sensor.stale;
            sensor.stale = over;
        }
        if stale && engage_micros > 0 {
            self.engagement = Some(Engagement::from(self.delta));
        }
        self.delta = measured;
        if let Some(engagement) = &mut self.engagement {
            match engagement.shown(measured, is_good, micros, engage_micros) {
                Some(shown) => self.delta = shown,
                None => self.engagement = None,
            }
        }
    }
}

impl Sensor {
    fn read(&mut self, micros: u64, counts: u16, state: SensorState) {
        match state {
            SensorState::Ok | SensorState::MagnetWeak => {
                self.last_counts = Some(counts);
                self.last_micros = micros;
                self.held_samples = 0;
                if let Filter::OneEuro(settings) = &self.filter {
                    let turn = f64::from(counts) * self.radians_per_count();
                    self.smoother.step(settings, turn, micros);
                }
            }
            SensorState::NoData | SensorState::Outlier => self.held_samples = self.held_samples.saturating_add(1),
        }
        self.weak = state == SensorState::MagnetWeak;
    }

    fn radians_per_count(&self) -> f64 {
        std::f64::consts::TAU / f64::from(self.counts_per_turn)
    }

    fn angle(&self) -> f64 {
        let smoothed = match self.filter {
            Filter::OneEuro(_) => self.smoother.turn(),
            Filter::None | Filter::Hold { .. } => None,
        };
        let angle = match smoothed {
            Some(turn) => self.calibration.angle_of(turn / self.radians_per_count(), self.counts_per_turn),
            None => self.last_counts.and_then(|counts| self.calibration.angle(counts, self.counts_per_turn)),
        };
        angle.unwrap_or(0.0)
    }

    /// Whether its filter's patience with the missing readings is over at this time of the device's clock.
    fn held_too_long(&self, micros: u64) -> bool {
        let Filter::Hold { patience_seconds } = self.filter else { return false };
        let held = micros.saturating_sub(self.last_micros) as f64 * 1e-6;
        self.last_counts.is_some() && self.held_samples > 0 && held > patience_seconds
    }

    fn quality(&self) -> BoneQuality {
        match self.last_counts {
            _ if self.calibration.zero_counts.is_none() => BoneQuality::Unzeroed,
            None => BoneQuality::NoReading,
            Some(_) if self.stale => BoneQuality::Stale,
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
