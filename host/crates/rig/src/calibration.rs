//! What a raw count means as an angle, for each sensor of each part.

use std::collections::BTreeMap;

use crate::{JointAxis, JointTree, PartUid, RawSample, SensorState};

/// How one sensor's counts become an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorCalibration {
    /// The count in the rest pose; `None` until the sensor was zeroed.
    pub zero_counts: Option<u16>,
    /// Whether rising counts turn the joint the negative way.
    pub reversed: bool,
    /// The axis it turns about; the part's own unless somebody mounted the sensor differently.
    pub axis: JointAxis,
}

impl SensorCalibration {
    /// A sensor nobody has zeroed.
    pub fn unzeroed(axis: JointAxis) -> Self {
        Self { zero_counts: None, reversed: false, axis }
    }

    /// The angle in (-π, π] radians, or `None` before zeroing.
    ///
    /// A magnet is glued in at any angle, so the count of a sensor that was never zeroed says nothing about
    /// the joint; rather than throw the character into a random pose, such a sensor has no angle at all.
    /// Counts beyond a full turn are taken modulo the turn.
    pub fn angle(&self, counts: u16, counts_per_turn: u32) -> Option<f64> {
        let zero = i64::from(self.zero_counts?);
        let turn = i64::from(counts_per_turn.max(1));
        let forward = i64::from(counts) - zero;
        let turned = (if self.reversed { -forward } else { forward }).rem_euclid(turn);
        let shortest = if 2 * turned > turn { turned - turn } else { turned };
        Some(shortest as f64 * std::f64::consts::TAU / turn as f64)
    }
}

/// Calibration of every part ever seen, by the part's own number: it stays true wherever a part is plugged in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Calibration {
    parts: BTreeMap<PartUid, Vec<SensorCalibration>>,
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
    /// Those that keep their former zero, if they had one.
    pub skipped: Vec<SkippedSensor>,
}

/// Why a calibration does not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrationError {
    /// The sample is numbered by another tree.
    #[error("the sample has {counts} counts and {states} states, the puppet has {sensors} sensors; take a new sample")]
    SampleLength {
        /// Counts in the sample.
        counts: usize,
        /// States in the sample.
        states: usize,
        /// Sensors of the tree.
        sensors: usize,
    },
    /// The stored entry has another number of sensors than the part.
    #[error(
        "the calibration of part {part} has {got} sensors, the part has {expected}; remove its entry and zero again"
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

    /// Adds the parts of the tree that are not known yet; leaves all others as they are.
    pub fn add_missing(&mut self, tree: &JointTree) {
        for part in tree.parts().iter().filter(|part| !part.kind.axes().is_empty()) {
            self.parts
                .entry(part.uid)
                .or_insert_with(|| part.kind.axes().iter().map(|&axis| SensorCalibration::unzeroed(axis)).collect());
        }
    }

    /// All parts in the order of their numbers, whether plugged in or not.
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

    /// Forgets a part; `false` if it was not known.
    pub fn remove_part(&mut self, uid: PartUid) -> bool {
        self.parts.remove(&uid).is_some()
    }

    /// One sensor, to change its sign, axis or zero.
    pub fn sensor_mut(&mut self, uid: PartUid, sensor: usize) -> Option<&mut SensorCalibration> {
        self.parts.get_mut(&uid)?.get_mut(sensor)
    }

    /// Turns the sign of one sensor round; `false` if there is no such sensor.
    pub fn flip(&mut self, uid: PartUid, sensor: usize) -> bool {
        let found = self.sensor_mut(uid, sensor);
        found.map(|sensor| sensor.reversed = !sensor.reversed).is_some()
    }

    /// The sensors of a part of the tree, `None` if nobody calibrated it yet.
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

    /// Takes the sample as the rest pose. Only sensors whose state is [`SensorState::Ok`] get a new zero;
    /// the others are reported and keep what they had. Nothing changes if an error is returned.
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
    use crate::{Part, PartKind};

    fn sensor(zero: u16, reversed: bool) -> SensorCalibration {
        SensorCalibration { zero_counts: Some(zero), reversed, axis: JointAxis::Bend }
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
