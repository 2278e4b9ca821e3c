//! One sensor of a stream: its last usable reading, its filter, and how far it can be trusted.

use glam::Quat;

use super::status::BoneQuality;
use crate::calibration::SensorCalibration;
use crate::filter::{Filter, Smoother};
use crate::puppet::{JointAxis, SensorState, joint_rotation};

/// A sensor and its last usable reading.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
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

impl Sensor {
    /// `slot`: its place in a sample.
    pub(super) fn new(slot: usize, calibration: SensorCalibration, counts_per_turn: u32, filter: Filter) -> Self {
        Self {
            slot,
            calibration,
            counts_per_turn,
            filter,
            smoother: Smoother::default(),
            last_counts: None,
            last_micros: 0,
            held_samples: 0,
            weak: false,
            stale: false,
        }
    }

    /// Its place in a sample.
    pub(super) fn slot(&self) -> usize {
        self.slot
    }

    /// Takes over the readings of the sensor that this one replaces. `is_back`: whether its part was unplugged.
    pub(super) fn continue_from(&mut self, old: &Self, is_back: bool) {
        self.last_counts = old.last_counts;
        self.last_micros = old.last_micros;
        self.held_samples = old.held_samples;
        self.stale = old.stale;
        if self.filter == old.filter && !is_back {
            self.smoother = old.smoother;
        }
    }

    /// Smoothing starts over with the next reading.
    pub(super) fn forget_smoothing(&mut self) {
        self.smoother = Smoother::default();
    }

    /// How many samples in a row it has had no usable reading.
    pub(super) fn held_samples(&self) -> u32 {
        self.held_samples
    }

    /// The current lag of its filter.
    pub(super) fn lag_seconds(&self) -> f64 {
        match self.filter {
            Filter::OneEuro(_) => self.smoother.lag_seconds(),
            Filter::None | Filter::Hold { .. } => 0.0,
        }
    }

    /// Takes a reading at this time of the device's clock.
    pub(super) fn read(&mut self, micros: u64, counts: u16, state: SensorState) {
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

    /// Its angle after the filter, radians; 0 while it is not zeroed or has had no usable reading.
    pub(super) fn angle(&self) -> f64 {
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

    /// Records whether its filter's patience with missing readings is over at this time of the device's clock; returns
    /// whether that has just happened.
    pub(super) fn becomes_stale(&mut self, micros: u64) -> bool {
        let over = self.held_too_long(micros);
        let just_now = over && !self.stale;
        self.stale = over;
        just_now
    }

    fn held_too_long(&self, micros: u64) -> bool {
        let Filter::Hold { patience_seconds } = self.filter else { return false };
        let held = micros.saturating_sub(self.last_micros) as f64 * 1e-6;
        self.last_counts.is_some() && self.held_samples > 0 && held > patience_seconds
    }

    pub(super) fn quality(&self) -> BoneQuality {
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

/// The rotation of a part from the angles of its sensors, from the inlet outwards.
pub(super) fn rotation_of(sensors: &[Sensor]) -> Quat {
    let mut axes = [JointAxis::Twist; 3];
    let mut angles = [0.0; 3];
    let count = sensors.len().min(3);
    for (index, sensor) in sensors.iter().take(3).enumerate() {
        axes[index] = sensor.calibration.axis;
        angles[index] = sensor.angle();
    }
    joint_rotation(&axes[..count], &angles[..count])
}
