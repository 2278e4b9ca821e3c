//! From raw counts to a pose, sample by sample.

use std::ops::Range;

use glam::{Affine3A, Quat};

use super::engagement::Engagement;
use super::sensor::{Sensor, rotation_of};
use super::shape_weights::ShapeDriver;
use super::share::Share;
use super::status::{BoneQuality, BoneStatus};
use crate::calibration::{Calibration, SensorCalibration};
use crate::mapping::{Mapping, MappingEntry, MappingError, ShapeDrive, Sharing};
use crate::puppet::{JointTree, PartUid, SensorState};
use crate::skeleton::{Pose, Skeleton, Transform};

/// Why a sample cannot be solved.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// The sample is numbered by another tree.
    #[error("the sample has {counts} counts and {states} states, but the puppet has {sensors} sensors")]
    Length {
        /// Counts given.
        counts: usize,
        /// States given.
        states: usize,
        /// Sensors of the tree.
        sensors: usize,
    },
}

/// A part that drives a bone.
#[derive(Clone, Debug)]
struct Driver {
    part: PartUid,
    plugged_in: bool,
    bone: usize,
    bone_from_part: Quat,
    /// In the frame of the bone's parent: the rotation that turns the bone back about the model's vertical.
    heading: Option<Quat>,
    sensors: Range<usize>,
    /// It has no bone of its own and turns this one for the joints below it.
    is_carried: bool,
    /// The rotation of the joint that is shown.
    delta: Quat,
    /// What the bone takes of it, where others take some too.
    share: Option<Share>,
    engagement: Option<Engagement>,
    /// The device's clock at the latest sample with good readings.
    good_micros: Option<u64>,
    /// Whether readings have been missing since then.
    is_missing: bool,
}

/// How parts and readings come back, microseconds of the device's clock; 0 for at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Returning {
    /// A part that was not plugged in; a joint whose `hold` ran out, where readings have no rule of their own.
    parts: u32,
    /// A joint whose readings were missing: at most this long, and no longer than it was away.
    readings: u32,
}

/// Readings that are missing for no longer than this leave nothing to make up for, microseconds: two frames of a screen.
const UNSEEN_MICROS: u64 = 33_000;

/// Turns samples into poses.
///
/// Bone rotation = heading · rest · Π F·Δ·F⁻¹ over its parts from the root outwards, with F = `bone_from_joint` ·
/// mounting and Δ the part's own rotation, or a power of it where several bones share it ([`Mapping::shared`]). The rest is the character's, turned as the mapping says
/// ([`Mapping::rest`]). Translation and scale stay as in the rest pose.
#[derive(Clone, Debug)]
pub struct PoseSolver {
    rest: Vec<Transform>,
    rest_frames: Vec<Affine3A>,
    parents: Vec<Option<usize>>,
    returning: Returning,
    sensor_count: usize,
    sensors: Vec<Sensor>,
    drivers: Vec<Driver>,
    shapes: Vec<ShapeDriver>,
    status: Vec<BoneStatus>,
}

impl PoseSolver {
    /// Prepares everything that does not change from sample to sample.
    ///
    /// Parts of the tree that the calibration does not know count as never zeroed. Parts of the mapping that are not in
    /// the tree do not affect their bone.
    pub fn new(
        tree: &JointTree,
        calibration: &Calibration,
        mapping: &Mapping,
        skeleton: &Skeleton,
    ) -> Result<Self, MappingError> {
        let rested;
        let skeleton = if mapping.rest.is_empty() {
            skeleton
        } else {
            rested = mapping.rested(skeleton)?;
            &rested
        };
        let rest_frames = skeleton.rest_model_from_bone();
        let mut solver = Self {
            returning: Returning::default(),
            parents: skeleton.bones().iter().map(|bone| bone.parent).collect(),
            rest: skeleton.bones().iter().map(|bone| bone.rest).collect(),
            sensor_count: tree.sensor_count(),
            sensors: Vec::with_capacity(tree.sensor_count()),
            drivers: Vec::with_capacity(mapping.entries.len() + mapping.carried.len()),
            shapes: Vec::with_capacity(mapping.shapes.len()),
            status: vec![BoneStatus::default(); skeleton.len()],
            rest_frames,
        };
        for (part, is_carried, entry) in in_tree_order(tree, mapping)? {
            let bone = find_bone(skeleton, entry)?;
            if !(entry.mounting.is_finite() && entry.mounting.is_normalized()) {
                return Err(MappingError::BadMounting { part: entry.part });
            }
            let settings = calibration.part_settings(entry.part);
            if !(settings.mounting.is_finite() && settings.mounting.is_normalized() && settings.heading.is_finite()) {
                return Err(MappingError::BadMounting { part: entry.part });
            }
            let mut bone_from_part = skeleton.bone_from_joint(bone, &solver.rest_frames) * entry.mounting;
            if settings.mounting != Quat::IDENTITY {
                bone_from_part *= settings.mounting;
            }
            let shared = mapping.shared.iter().find(|joint| joint.part == entry.part && !is_carried);
            let shares = shared.map(|joint| joint.resolve(&entry.bone, skeleton)).transpose()?;
            for (own, share) in shares.unwrap_or_else(|| vec![(bone, 1.0)]) {
                let first = solver.sensors.len();
                if let Some(part) = part {
                    solver.add_sensors(tree, part, calibration, entry)?;
                }
                let bone_from_part = match shared.map(|joint| joint.sharing) {
                    Some(Sharing::Chain) if own != bone => {
                        solver.rest_rotation(own).inverse() * solver.rest_rotation(bone) * bone_from_part
                    }
                    Some(Sharing::Curl) if own != bone => {
                        skeleton.bone_from_joint(own, &solver.rest_frames) * entry.mounting * settings.mounting
                    }
                    _ => bone_from_part,
                };
                let heading = (settings.heading != 0.0 && own == bone).then_some(settings.heading);
                solver.drivers.push(Driver {
                    part: entry.part,
                    plugged_in: part.is_some(),
                    bone: own,
                    is_carried,
                    bone_from_part: bone_from_part.normalize(),
                    heading: heading.map(|heading| solver.turned_back(bone, heading)),
                    sensors: first..solver.sensors.len(),
                    delta: Quat::IDENTITY,
                    share: shared.map(|_| Share::new(share)),
                    engagement: None,
                    good_micros: None,
                    is_missing: false,
                });
            }
        }
        for drive in &mapping.shapes {
            solver.add_shape(tree, calibration, drive)?;
        }
        solver.update_status();
        Ok(solver)
    }

    /// The rotation of a bone by -heading about the model's vertical, in its parent's frame in the rest pose.
    fn turned_back(&self, bone: usize, heading: f64) -> Quat {
        let (sin, cos) = libm::sincos(-0.5 * heading);
        let in_model = Quat::from_xyzw(0.0, sin as f32, 0.0, cos as f32);
        let model_from_parent = self.parents[bone].map_or(Quat::IDENTITY, |parent| self.rest_rotation(parent));
        (model_from_parent.inverse() * in_model * model_from_parent).normalize()
    }

    /// `model_from_bone` of the rest pose, without its translation.
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
            let calibration_of = known.map_or(SensorCalibration::unzeroed(axis), |sensors| sensors[index]);
            let counts_per_turn = tree.parts()[part].counts_per_turn;
            self.sensors.push(Sensor::new(slot, calibration_of, counts_per_turn, calibration.filter_of(entry.part)));
        }
        Ok(())
    }

    fn add_shape(
        &mut self,
        tree: &JointTree,
        calibration: &Calibration,
        drive: &ShapeDrive,
    ) -> Result<(), MappingError> {
        drive.check()?;
        let bad = |what: String| MappingError::BadShape { shape: drive.shape.clone(), what };
        if self.shapes.iter().any(|known| known.shape() == drive.shape) {
            return Err(bad("two joints drive it; only one can".into()));
        }
        let mut sensor = None;
        if let Some(part) = tree.find(drive.part) {
            let Some(index) = drive.axis.sensor_of(tree.parts()[part].kind) else {
                return Err(bad(format!("part {} has no sensor for {}", drive.part, drive.axis)));
            };
            let known = calibration.checked_part(tree, part)?;
            let axis = tree.parts()[part].kind.axes()[index];
            let calibration_of = known.map_or(SensorCalibration::unzeroed(axis), |sensors| sensors[index]);
            let counts_per_turn = tree.parts()[part].counts_per_turn;
            let slot = tree.sensors(part).start + index;
            sensor = Some(Sensor::new(slot, calibration_of, counts_per_turn, calibration.filter_of(drive.part)));
        }
        self.shapes.push(ShapeDriver::new(drive.clone(), sensor));
        Ok(())
    }

    /// Number of sensors that a sample must have.
    pub fn sensor_count(&self) -> usize {
        self.sensor_count
    }

    /// Takes over the last readings and rotations of a solver that this one replaces (after zeroing, a change of the
    /// mapping, or plugging something in or out), so that nothing jumps without reason. Parts are matched by their
    /// numbers. One that was unplugged and is back blends from its bone's current rotation to its reading over
    /// [`engage_micros`](Self::engage_over) of the device's clock.
    pub fn continue_from(&mut self, previous: &Self) {
        self.returning = previous.returning;
        for driver in &mut self.drivers {
            let same_bone = |d: &&Driver| d.part == driver.part && d.bone == driver.bone;
            let any_bone = || previous.drivers.iter().find(|d| d.part == driver.part);
            let Some(before) = previous.drivers.iter().find(same_bone).or_else(any_bone) else { continue };
            driver.delta = before.delta;
            if let (Some(share), Some(before)) = (&mut driver.share, &before.share) {
                share.continue_from(before);
            }
            let is_back = driver.plugged_in && !before.plugged_in;
            driver.engagement = match before.engagement {
                _ if is_back && self.returning.parts > 0 => Some(Engagement::from(before.delta)),
                under_way => under_way.filter(|_| driver.plugged_in),
            };
            (driver.good_micros, driver.is_missing) = (before.good_micros, before.is_missing && !is_back);
            let old = &previous.sensors[before.sensors.clone()];
            for (sensor, old) in self.sensors[driver.sensors.clone()].iter_mut().zip(old) {
                sensor.continue_from(old, is_back);
            }
        }
        self.shapes.iter_mut().for_each(|shape| shape.continue_from(&previous.shapes));
        self.update_status();
    }

    /// From now on, a part that comes back moves its bone to its reading over this time, microseconds of the device's
    /// clock; 0 (the initial value) means immediately.
    pub fn engage_over(&mut self, micros: u32) {
        self.returning.parts = micros;
    }

    /// From now on, a joint whose readings were missing moves its bone to what it reads over as long as they were, but no
    /// longer than this, microseconds of the device's clock; 0 (as at first) for at once, except where `hold` ran out.
    pub fn return_over(&mut self, micros: u32) {
        self.returning.readings = micros;
    }

    /// Treats every part as coming back with the next sample: the whole puppet was away.
    pub fn engage_all(&mut self) {
        for driver in self.drivers.iter_mut().filter(|driver| driver.plugged_in && self.returning.parts > 0) {
            driver.engagement = Some(Engagement::from(driver.delta));
        }
        self.sensors.iter_mut().for_each(Sensor::forget_smoothing);
        if self.returning.parts > 0 {
            self.shapes.iter_mut().for_each(ShapeDriver::engage);
        }
    }

    /// Writes the pose of one sample; does not allocate unless `pose` has a different number of bones. `micros`: the
    /// device's clock.
    ///
    /// A sensor without data or with an outlier keeps its last usable count, and one that never had any is assumed to
    /// be in the rest pose; [`bone_status`](Self::bone_status) reports this. A weak magnet's count is used.
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
            sensor.read(micros, counts[sensor.slot()], states[sensor.slot()]);
        }
        for driver in self.drivers.iter_mut().filter(|driver| driver.plugged_in) {
            driver.follow(&mut self.sensors[driver.sensors.clone()], micros, self.returning);
        }
        self.update_status();
        self.write_pose(pose);
        Ok(())
    }

    /// Passes each shape that a joint drives, in the mapping's order, and its weight by this sample, which
    /// [`solve`](Self::solve) has taken; nothing for one that was never read.
    pub(super) fn solve_shapes(
        &mut self,
        micros: u64,
        counts: &[u16],
        states: &[SensorState],
        each: &mut dyn FnMut(usize, f32),
    ) {
        for (index, shape) in self.shapes.iter_mut().enumerate() {
            if let Some(weight) = shape.follow(micros, counts, states, self.returning.parts) {
                each(index, weight);
            }
        }
    }

    /// Writes the pose of the latest sample again (before the first: the rest pose).
    pub fn write_pose(&self, pose: &mut Pose) {
        pose.parent_from_bone.clear();
        pose.parent_from_bone.extend_from_slice(&self.rest);
        for driver in &self.drivers {
            let delta = driver.share.map_or(driver.delta, |share| share.rotation());
            let turn = driver.bone_from_part * delta * driver.bone_from_part.inverse();
            let rotation = &mut pose.parent_from_bone[driver.bone].rotation;
            *rotation = (*rotation * turn).normalize();
        }
        for (driver, heading) in self.drivers.iter().filter_map(|driver| Some((driver, driver.heading?))) {
            let rotation = &mut pose.parent_from_bone[driver.bone].rotation;
            *rotation = (heading * *rotation).normalize();
        }
    }

    /// The part closest to the puppet's root that drives a bone, and how it rotates that bone away from the rest pose,
    /// in the model's frame and without the heading; `None` while no part drives a bone.
    ///
    /// The bone's parents are assumed to be in the rest pose, as those of a root are.
    pub fn root_turn(&self) -> Option<(PartUid, Quat)> {
        let root = self.drivers.iter().find(|driver| driver.plugged_in)?;
        let model_from_bone = self.rest_rotation(root.bone);
        let mut turn = Quat::IDENTITY;
        let alone = |driver: &&Driver| !root.is_carried || driver.part == root.part;
        for driver in self.drivers.iter().filter(|driver| driver.bone == root.bone).filter(alone) {
            turn *= driver.bone_from_part * driver.delta * driver.bone_from_part.inverse();
        }
        Some((root.part, (model_from_bone * turn * model_from_bone.inverse()).normalize()))
    }

    /// The current filter lag of the fastest and the slowest joint, seconds.
    pub fn lag_seconds(&self) -> (f64, f64) {
        let lags = self.sensors.iter().map(Sensor::lag_seconds);
        lags.fold(None, |bounds: Option<(f64, f64)>, lag| {
            Some(bounds.map_or((lag, lag), |(least, most)| (least.min(lag), most.max(lag))))
        })
        .unwrap_or_default()
    }

    /// The place in a sample, and the angle after the filter (radians), of every sensor that moves a bone or a shape.
    pub fn filtered_angles(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let shapes = self.shapes.iter().filter_map(ShapeDriver::sensor);
        self.sensors.iter().chain(shapes).map(|sensor| (sensor.slot(), sensor.angle()))
    }

    /// The status of each bone after the latest sample, in the skeleton's order.
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
                join(sensor.quality(), sensor.held_samples());
            }
        }
    }
}

impl Driver {
    /// Readings are back: the way to what they say takes as long as they were missing, so that the bone makes up for it
    /// about as quickly as the joint moved.
    fn come_back(&mut self, measured: Quat, micros: u64, most: u32) {
        // A joint that was never read comes out of the rest pose.
        let away = self.good_micros.map_or(u64::from(most), |good| micros.saturating_sub(good));
        if away > UNSEEN_MICROS && measured != self.delta {
            let over = away.min(u64::from(most)) as u32;
            self.engagement = Some(Engagement::from(self.delta).over(over));
        }
    }

    /// Takes the sensors' current readings. If an old reading was used for too long, the return is gradual.
    fn follow(&mut self, sensors: &mut [Sensor], micros: u64, returning: Returning) {
        let measured = rotation_of(sensors);
        let is_good = sensors.iter().all(|sensor| sensor.held_samples() == 0);
        let mut stale = false;
        for sensor in sensors {
            stale |= sensor.becomes_stale(micros);
        }
        if returning.readings > 0 {
            if is_good && self.is_missing {
                self.come_back(measured, micros, returning.readings);
            }
        } else if stale && returning.parts > 0 {
            self.engagement = Some(Engagement::from(self.delta));
        }
        self.is_missing = !is_good;
        self.good_micros = if is_good { Some(micros) } else { self.good_micros };
        self.delta = measured;
        if let Some(engagement) = &mut self.engagement {
            match engagement.shown(measured, is_good, micros, returning.parts) {
                Some(shown) => self.delta = shown,
                None => self.engagement = None,
            }
        }
        if let Some(share) = &mut self.share {
            share.follow(self.delta);
        }
    }
}

/// The number of its part; whether it is carried.
type PlacedEntry<'a> = (Option<usize>, bool, &'a MappingEntry);

/// Entries with the index of their part: parents before children, then those that are not plugged in.
fn in_tree_order<'a>(tree: &JointTree, mapping: &'a Mapping) -> Result<Vec<PlacedEntry<'a>>, MappingError> {
    let mut by_uid: Vec<&MappingEntry> = mapping.entries.iter().collect();
    by_uid.sort_by_key(|entry| entry.part);
    if let Some(twice) = by_uid.windows(2).find(|pair| pair[0].part == pair[1].part) {
        let (first, second) = (twice[0].bone.clone(), twice[1].bone.clone());
        return Err(MappingError::PartTwice { part: twice[0].part, first, second });
    }
    for (index, joint) in mapping.shared.iter().enumerate() {
        let bad = |what: &str| Err(MappingError::BadShares { part: joint.part, what: what.into() });
        if by_uid.binary_search_by_key(&joint.part, |entry| entry.part).is_err() {
            return bad("it drives no bone; give it one first");
        }
        if mapping.shared[..index].iter().any(|other| other.part == joint.part) {
            return bad("it is shared twice");
        }
    }
    let (own, carried) = (mapping.entries.iter(), mapping.carried.iter());
    let all = own.map(|entry| (false, entry)).chain(carried.map(|entry| (true, entry)));
    let mut placed: Vec<PlacedEntry<'_>> =
        all.map(|(is_carried, entry)| (tree.find(entry.part), is_carried, entry)).collect();
    placed.sort_by_key(|(part, ..)| part.unwrap_or(usize::MAX));
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
