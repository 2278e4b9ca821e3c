//! From angles to counts, with every sensor fault.

use std::f64::consts::TAU;

use firmware_protocol::SensorState;

use super::settings::PuppetSettings;
use crate::body::Body;
use crate::faults::{SensorFaultKind, Truth};
use crate::motion::Player;
use crate::random::Random;

/// Standard deviation of a reading with a weak magnet, counts, on top of the normal noise.
const WEAK_NOISE_COUNTS: f64 = 20.0;

/// All sensors of a puppet and what moves them.
#[derive(Clone, Debug)]
pub(super) struct Sensors {
    player: Player,
    /// Where in its turn each magnet is glued in, counts with fractions.
    zeros: Vec<f64>,
    reversed: Vec<bool>,
    stuck_at: Vec<Option<u16>>,
    angles: Vec<f64>,
    random: Random,
    counted: Truth,
}

impl Sensors {
    pub(super) fn new(settings: &PuppetSettings) -> Self {
        let count = settings.body.sensor_count();
        let mut magnets = Random::new(settings.seed, 1);
        let turn = f64::from(settings.counts_per_turn);
        Self {
            player: Player::new(settings.motion.clone(), &settings.body, settings.leads),
            zeros: (0..count).map(|_| if settings.random_zeros { turn * magnets.unit() } else { 0.0 }).collect(),
            reversed: (0..count).map(|sensor| settings.reversed_sensors.contains(&sensor)).collect(),
            stuck_at: vec![None; count],
            angles: Vec::with_capacity(count),
            random: Random::new(settings.seed, 3),
            counted: Truth::default(),
        }
    }

    pub(super) fn lead_in_seconds(&self) -> f64 {
        self.player.lead_in_seconds()
    }

    pub(super) fn true_angles(&self, body: &Body, seconds: Option<f64>, angles: &mut Vec<f64>) {
        self.player.sensor_angles(body, seconds, angles);
    }

    pub(super) fn add_to(&self, truth: &mut Truth) {
        truth.outliers = self.counted.outliers;
        truth.hidden_outliers = self.counted.hidden_outliers;
        truth.stuck_readings = self.counted.stuck_readings;
        truth.missing_readings = self.counted.missing_readings;
        truth.weak_readings = self.counted.weak_readings;
    }

    /// Reads the sensors of a sample: `seconds` after the motion began, `micros` after the emulation's first step.
    pub(super) fn read(
        &mut self,
        settings: &PuppetSettings,
        layout: &[usize],
        seconds: Option<f64>,
        micros: f64,
        counts: &mut Vec<u16>,
        states: &mut Vec<SensorState>,
    ) {
        self.player.sensor_angles(&settings.body, seconds, &mut self.angles);
        counts.clear();
        states.clear();
        for &sensor in layout {
            let (count, state) = self.reading(settings, sensor, micros);
            counts.push(count);
            states.push(state);
        }
    }

    fn reading(&mut self, settings: &PuppetSettings, sensor: usize, micros: f64) -> (u16, SensorState) {
        let fault = settings.faults.sensors.iter().find(|fault| {
            let since = micros - fault.start_micros as f64;
            fault.sensor == sensor && since >= 0.0 && since < fault.duration_micros as f64
        });
        let kind = fault.map(|fault| fault.kind);
        let weak = if kind == Some(SensorFaultKind::MagnetWeak) { WEAK_NOISE_COUNTS } else { 0.0 };
        let count = self.count(settings, sensor, settings.noise_counts + weak);
        if kind != Some(SensorFaultKind::Stuck) {
            self.stuck_at[sensor] = None;
        }
        match kind {
            Some(SensorFaultKind::Stuck) => {
                self.counted.stuck_readings += 1;
                (*self.stuck_at[sensor].get_or_insert(count), SensorState::Ok)
            }
            Some(SensorFaultKind::NoData) => {
                self.counted.missing_readings += 1;
                (0, SensorState::NoData)
            }
            Some(SensorFaultKind::MagnetWeak) => {
                self.counted.weak_readings += 1;
                (count, SensorState::MagnetWeak)
            }
            None if self.random.chance(settings.faults.outlier) => {
                self.counted.outliers += 1;
                (self.wild(settings), SensorState::Outlier)
            }
            None if self.random.chance(settings.faults.hidden_outlier) => {
                self.counted.hidden_outliers += 1;
                (self.wild(settings), SensorState::Ok)
            }
            None => (count, SensorState::Ok),
        }
    }

    fn wild(&mut self, settings: &PuppetSettings) -> u16 {
        (self.random.next_u64() % u64::from(settings.counts_per_turn)) as u16
    }

    /// The whole count nearest to the magnet's position.
    fn count(&mut self, settings: &PuppetSettings, sensor: usize, noise: f64) -> u16 {
        let turn = f64::from(settings.counts_per_turn);
        let angle = if self.reversed[sensor] { -self.angles[sensor] } else { self.angles[sensor] };
        let jitter = if noise > 0.0 { noise * self.random.normal() } else { 0.0 };
        let stands = libm::round(self.zeros[sensor] + angle * turn / TAU + jitter);
        (stands - turn * libm::floor(stands / turn)) as u16
    }
}
