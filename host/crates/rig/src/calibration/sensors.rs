//! What a raw count means as an angle, for each sensor of each part.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::Quat;

use crate::filter::Filter;
use crate::puppet::{JointAxis, JointTree, PartUid, RawSample, SensorState};

/// The counts between a joint's two stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorRange {
    /// The count at the stop from which counts rise towards the other stop.
    pub first_counts: u16,
    /// How many counts further on the other stop is, less than a turn; the way there may cross count zero.
    pub span_counts: u32,
}

/// How one sensor's counts become an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorCalibration {
    /// The count in the rest pose; `None` until the sensor was zeroed.
    pub zero_counts: Option<u16>,
    /// Whether rising counts turn the joint in the negative direction.
    pub reversed: bool,
    /// The axis it turns about; the part's own unless the sensor is mounted differently.
    pub axis: JointAxis,
    /// Where its stops are, if a sweep has found them.
    pub range: Option<SensorRange>,
}

impl SensorCalibration {
    /// A sensor that has not been zeroed.
    pub fn unzeroed(axis: JointAxis) -> Self {
        Self { zero_counts: None, reversed: false, axis, range: None }
    }

    /// The angle in radians, or `None` before zeroing.
    ///
    /// A magnet is glued in at any angle, so the count of a sensor that was never zeroed says nothing about the joint;
    /// rather than throw the character into a random pose, such a sensor has no angle at all. Counts beyond a full turn
    /// are taken modulo the turn.
    ///
    /// The angle is in (-π, π]; if the stops are known, it jumps by a turn in the middle of the gap between them
    /// instead of at ±π, and so nowhere within the joint's travel.
    ///
    /// ```
    /// use armature_rig::{JointAxis, SensorCalibration};
    ///
    /// let sensor = SensorCalibration { zero_counts: Some(4000), ..SensorCalibration::unzeroed(JointAxis::Bend) };
    /// let quarter = sensor.angle(4000 + 1024 - 4096, 4096).expect("it is zeroed");
    /// assert!((quarter - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "across the count zero");
    /// ```
    pub fn angle(&self, counts: u16, counts_per_turn: u32) -> Option<f64> {
        let zero = i64::from(self.zero_counts?);
        let turn = i64::from(counts_per_turn.max(1));
        let counts = i64::from(counts);
        let forward = match self.seam(turn) {
            Some(seam) => (counts - seam).rem_euclid(turn) - (zero - seam).rem_euclid(turn),
            None => shortest(counts - zero, turn, self.reversed),
        };
        let turned = if self.reversed { -forward } else { forward };
        Some(turned as f64 * TAU / turn as f64)
    }

    /// The angle for a turn in counts, as a filter returns it: `turned_counts` may be off by any number of whole turns.
    /// Otherwise like [`angle`](Self::angle).
    pub fn angle_of(&self, turned_counts: f64, counts_per_turn: u32) -> Option<f64> {
        let zero = f64::from(self.zero_counts?);
        let whole = i64::from(counts_per_turn.max(1));
        let turn = whole as f64;
        let modulo = |value: f64| value - turn * libm::floor(value / turn);
        let forward = if let Some(seam) = self.seam(whole) {
            modulo(turned_counts - seam as f64) - modulo(zero - seam as f64)
        } else {
            let turned = modulo(turned_counts - zero);
            if 2.0 * turned > turn { turned - turn } else { turned }
        };
        Some(if self.reversed { -forward } else { forward } * TAU / turn)
    }

    /// The count in the middle of the gap between the stops.
    fn seam(&self, turn: i64) -> Option<i64> {
        let range = self.range?;
        let gap = turn - i64::from(range.span_counts);
        (gap > 0).then(|| i64::from(range.first_counts) - gap / 2)
    }
}

/// The shorter way round; half a turn is resolved to +π in the joint's own direction.
fn shortest(counts: i64, turn: i64, reversed: bool) -> i64 {
    let turned = (if reversed { -counts } else { counts }).rem_euclid(turn);
    let shortest = if 2 * turned > turn { turned - turn } else { turned };
    if reversed { -shortest } else { shortest }
}

/// Settings of a part as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartSettings {
    /// `nominal_from_mounted`: how the part is rotated relative to its nominal joint frame, as found by the mounting
    /// step; a unit quaternion. A mapping's own mounting is applied on top.
    pub mounting: Quat,
    /// How far the bone that the part drives is turned back about the model's vertical, radians, so that it faces
    /// forward again.
    pub heading: f64,
    /// The filter for its readings, if it differs from the common one.
    pub filter: Option<Filter>,
}

impl Default for PartSettings {
    fn default() -> Self {
        Self { mounting: Quat::IDENTITY, heading: 0.0, filter: None }
    }
}

/// Calibration of every part ever seen, by the part's unique number: it stays valid wherever a part is plugged in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    parts: BTreeMap<PartUid, Vec<SensorCalibration>>,
    settings: BTreeMap<PartUid, PartSettings>,
    /// The filter for parts that have no filter of their own.
    pub filter: Filter,
}

/// A sensor that could not be zeroed because its reading was not good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SkippedSensor {
    /// Its part.
    pub part: PartUid,
    /// Which sensor of the part, from the inlet outwards.
    pub sensor: usize,
    /// What it reported instead of a good count.
    pub state: SensorState,
}

/// What [`Calibration::zero`] did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ZeroReport {
    /// Number of sensors that have a new zero.
    pub zeroed: usize,
    /// Those that keep their previous zero, if they had one.
    pub skipped: Vec<SkippedSensor>,
}

/// Why a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrationError {
    /// The sample is numbered by another tree.
    #[error(
        "the sample has {counts} counts and {states} states, but the puppet has {sensors} sensors; take a new sample"
    )]
    SampleLength {
        /// Counts in the sample.
        counts: usize,
        /// States in the sample.
        states: usize,
        /// Sensors of the tree.
        sensors: usize,
    },
    /// The stored entry has a different number of sensors than the part.
    #[error(
        "the calibration of part {part} has {got} sensors, but the part has {expected}; remove its entry and zero again"
    )]
    SensorCount {
        /// The part.
        part: PartUid,
        /// Sensors in the calibration.
        got: usize,
        /// Sensors of the part.
        expected: usize,
    },
}

impl Calibration {
    /// Every sensor of the tree with its own axis, not reversed and not zeroed.
    pub fn for_tree(tree: &JointTree) -> Self {
        let mut calibration = Self::default();
        calibration.add_missing(tree);
        calibration
    }

    /// Adds the parts of the tree that are not known yet; leaves all others unchanged.
    pub fn add_missing(&mut self, tree: &JointTree) {
        for part in tree.parts().iter().filter(|part| !part.kind.axes().is_empty()) {
            self.parts
                .entry(part.uid)
                .or_insert_with(|| part.kind.axes().iter().map(|&axis| SensorCalibration::unzeroed(axis)).collect());
        }
    }

    /// All parts in order of their numbers, whether plugged in or not.
    pub fn parts(&self) -> impl Iterator<Item = (PartUid, &[SensorCalibration])> {
        self.parts.iter().map(|(&uid, sensors)| (uid, sensors.as_slice()))
    }

    /// The sensors of one part, from the inlet outwards.
    pub fn part(&self, uid: PartUid) -> Option<&[SensorCalibration]> {
        self.parts.get(&uid).map(Vec::as_slice)
    }

    /// Sets all sensors of one part.
    pub fn set_part(&mut self, uid: PartUid, sensors: Vec<SensorCalibration>) {
        self.parts.insert(uid, sensors);
    }

    /// Removes a part; `false` if it was not known.
    pub fn remove_part(&mut self, uid: PartUid) -> bool {
        self.settings.remove(&uid);
        self.parts.remove(&uid).is_some()
    }

    /// The settings of a part as a whole.
    pub fn part_settings(&self, uid: PartUid) -> PartSettings {
        self.settings.get(&uid).copied().unwrap_or_default()
    }

    /// Sets the settings of a part as a whole.
    pub fn set_part_settings(&mut self, uid: PartUid, settings: PartSettings) {
        if settings == PartSettings::default() {
            self.settings.remove(&uid);
        } else {
            self.settings.insert(uid, settings);
        }
    }

    /// The parts with settings as a whole, in order of their numbers.
    pub fn set_parts(&self) -> impl Iterator<Item = (PartUid, PartSettings)> {
        self.settings.iter().map(|(&uid, &settings)| (uid, settings))
    }

    /// The filter used for a part's readings.
    pub fn filter_of(&self, uid: PartUid) -> Filter {
        self.part_settings(uid).filter.unwrap_or(self.filter)
    }

    /// One sensor, to change its sign, axis or zero.
    pub fn sensor_mut(&mut self, uid: PartUid, sensor: usize) -> Option<&mut SensorCalibration> {
        self.parts.get_mut(&uid)?.get_mut(sensor)
    }

    /// Reverses one sensor; `false` if there is no such sensor.
    pub fn flip(&mut self, uid: PartUid, sensor: usize) -> bool {
        let found = self.sensor_mut(uid, sensor);
        found.map(|sensor| sensor.reversed = !sensor.reversed).is_some()
    }

    /// Forgets the sensors of parts that have another number of sensors in this tree: their number is on another kind of
    /// part now. Returns those parts.
    pub fn forget_misfits(&mut self, tree: &JointTree) -> Vec<PartUid> {
        let misfits = tree.parts().iter().filter(|part| {
            let known = self.part(part.uid);
            known.is_some_and(|sensors| sensors.len() != part.kind.axes().len())
        });
        let misfits: Vec<PartUid> = misfits.map(|part| part.uid).collect();
        misfits.iter().for_each(|uid| {
            self.parts.remove(uid);
        });
        misfits
    }

    /// The sensors of a part of the tree, `None` if it has not been calibrated yet.
    pub fn checked_part(
        &self,
        tree: &JointTree,
        part: usize,
    ) -> Result<Option<&[SensorCalibration]>, CalibrationError> {
        let part = &tree.parts()[part];
        let expected = part.kind.axes().len();
        match self.part(part.uid) {
            Some(sensors) if sensors.len() != expected => {
                Err(CalibrationError::SensorCount { part: part.uid, got: sensors.len(), expected })
            }
            found => Ok(found),
        }
    }

    /// Takes the sample as the rest pose. Only sensors whose state is [`SensorState::Ok`] get a new zero; the others
    /// are reported and keep their old one. Nothing changes if an error is returned.
    pub fn zero(&mut self, tree: &JointTree, sample: &RawSample) -> Result<ZeroReport, CalibrationError> {
        let sensors = tree.sensor_count();
        if sample.counts.len() != sensors || sample.states.len() != sensors {
            let (counts, states) = (sample.counts.len(), sample.states.len());
            return Err(CalibrationError::SampleLength { counts, states, sensors });
        }
        for part in 0..tree.parts().len() {
            self.checked_part(tree, part)?;
        }
        self.add_missing(tree);
        let mut report = ZeroReport::default();
        for (index, part) in tree.parts().iter().enumerate() {
            let Some(calibrations) = self.parts.get_mut(&part.uid) else { continue };
            for (sensor, (slot, calibration)) in tree.sensors(index).zip(calibrations).enumerate() {
                let state = sample.states[slot];
                if state == SensorState::Ok {
                    calibration.zero_counts = Some(sample.counts[slot]);
                    report.zeroed += 1;
                } else {
                    report.skipped.push(SkippedSensor { part: part.uid, sensor, state });
                }
            }
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;
    use crate::puppet::{Part, PartKind};

    fn sensor(zero: u16, reversed: bool) -> SensorCalibration {
        SensorCalibration { zero_counts: Some(zero), reversed, ..SensorCalibration::unzeroed(JointAxis::Bend) }
    }

    fn tree() -> JointTree {
        let part = |number: u8, kind, parent| Part {
            uid: PartUid([number; 12]),
            kind,
            parent,
            outlet: 0,
            counts_per_turn: 16384,
        };
        JointTree::new(vec![
            part(1, PartKind::TwistBendTwist, None),
            part(2, PartKind::Splitter { outlets: 2 }, Some(0)),
            part(3, PartKind::Bend, Some(1)),
        ])
        .unwrap()
    }

    #[test]
    fn half_a_turn_is_plus_pi_whichever_way_the_sensor_runs() {
        assert_eq!(sensor(0, false).angle(8192, 16384), Some(PI));
        assert_eq!(sensor(0, true).angle(8192, 16384), Some(PI));
        assert_eq!(sensor(16383, false).angle(0, 16384), Some(PI / 8192.0));
        assert_eq!(sensor(16383, true).angle(0, 16384), Some(-PI / 8192.0));
        assert_eq!(sensor(65535, false).angle(0, 65536), Some(PI / 32768.0));
    }

    #[test]
    fn an_unzeroed_sensor_has_no_angle() {
        assert_eq!(SensorCalibration::unzeroed(JointAxis::Twist).angle(77, 16384), None);
    }

    #[test]
    fn zero_skips_and_reports_bad_readings() {
        let tree = tree();
        let mut calibration = Calibration::for_tree(&tree);
        let sample = RawSample {
            counts: vec![5, 6, 7, 8],
            states: vec![SensorState::Ok, SensorState::MagnetWeak, SensorState::NoData, SensorState::Ok],
            ..RawSample::default()
        };
        let report = calibration.zero(&tree, &sample).unwrap();
        assert_eq!(report.zeroed, 2);
        assert_eq!(report.skipped.len(), 2);
        assert_eq!(report.skipped[1], SkippedSensor { part: PartUid([1; 12]), sensor: 2, state: SensorState::NoData });
        let zeros: Vec<_> = calibration.part(PartUid([1; 12])).unwrap().iter().map(|s| s.zero_counts).collect();
        assert_eq!(zeros, [Some(5), None, None]);
        assert_eq!(calibration.part(PartUid([2; 12])), None, "a splitter has nothing to calibrate");
    }

    #[test]
    fn what_does_not_fit_is_refused_and_changes_nothing() {
        let tree = tree();
        let mut calibration = Calibration::default();
        let short = RawSample { counts: vec![1], states: vec![SensorState::Ok], ..RawSample::default() };
        assert!(matches!(calibration.zero(&tree, &short), Err(CalibrationError::SampleLength { .. })));
        calibration.set_part(PartUid([3; 12]), vec![]);
        let before = calibration.clone();
        let sample = RawSample { counts: vec![1; 4], states: vec![SensorState::Ok; 4], ..RawSample::default() };
        assert!(matches!(calibration.zero(&tree, &sample), Err(CalibrationError::SensorCount { .. })));
        assert_eq!(calibration, before);
    }

    proptest! {
        #[test]
        fn angles_stay_in_one_turn_and_sign_mirrors(zero: u16, counts: u16, turn in 2_u32..=65536) {
            let forward = sensor(zero, false).angle(counts, turn).unwrap();
            let backward = sensor(zero, true).angle(counts, turn).unwrap();
            prop_assert!(forward > -PI && forward <= PI);
            prop_assert!(backward > -PI && backward <= PI);
            prop_assert!(forward == -backward || (forward == PI && backward == PI));
        }

        /// Any range shorter than a turn, wherever it is: no jump between the stops, and still the same rotation.
        #[test]
        fn between_the_stops_there_is_no_leap(zero in 0_u32..4096, first in 0_u32..4096, span in 1_u32..4000, reversed: bool) {
            let range = SensorRange { first_counts: first as u16, span_counts: span };
            let known = SensorCalibration { range: Some(range), ..sensor(((first + zero % (span + 1)) % 4096) as u16, reversed) };
            let unknown = SensorCalibration { range: None, ..known };
            let mut before = None;
            for on in 0..=span {
                let counts = ((first + on) % 4096) as u16;
                let angle = known.angle(counts, 4096).unwrap();
                if let Some(before) = before {
                    prop_assert!((f64::abs(angle - before) - TAU / 4096.0).abs() < 1e-12);
                }
                before = Some(angle);
                let turns = (angle - unknown.angle(counts, 4096).unwrap()) / TAU;
                prop_assert!((turns - turns.round()).abs() < 1e-9);
                for calibration in [known, unknown] {
                    let exact = calibration.angle(counts, 4096).unwrap();
                    let between = calibration.angle_of(f64::from(counts) + 3.0 * 4096.0, 4096).unwrap();
                    prop_assert!((exact - between).abs() < 1e-9 || (exact.abs() - PI).abs() < 1e-9);
                }
            }
            prop_assert!(known.angle(known.zero_counts.unwrap(), 4096) == Some(0.0));
        }

        #[test]
        fn a_step_over_the_wrap_is_still_one_step(zero in 0_u16..16384, counts in 0_u16..16384) {
            let next = (counts + 1) % 16384;
            let a = sensor(zero, false).angle(counts, 16384).unwrap();
            let b = sensor(zero, false).angle(next, 16384).unwrap();
            let step = (b - a).rem_euclid(2.0 * PI);
            prop_assert!((step - 2.0 * PI / 16384.0).abs() < 1e-12);
        }
    }
}
