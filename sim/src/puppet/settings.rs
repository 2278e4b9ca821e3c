//! All settings of an emulated puppet.

use firmware_protocol::MAX_RECORDS;

use crate::body::Body;
use crate::faults::Faults;
use crate::motion::Motion;

/// What to emulate.
#[derive(Clone, Debug, PartialEq)]
pub struct PuppetSettings {
    /// The parts.
    pub body: Body,
    /// What they do.
    pub motion: Motion,
    /// Whether a track that does not begin at rest is reached from there over a moment, after which it begins
    /// ([`Puppet::lead_in_seconds`](crate::Puppet::lead_in_seconds)), and its first frame from its last one where it is
    /// repeated; otherwise the puppet jumps.
    pub leads: bool,
    /// Decides magnets, noise and faults. Part numbers come with the body.
    pub seed: u64,
    /// How long the puppet holds the rest pose after each start of the stream, so that it can be zeroed; `u64::MAX`:
    /// until [`begin_motion`](crate::Puppet::begin_motion).
    pub rest_micros: u64,
    /// Resolution of the sensors, 2 to 65,536; a 14-bit sensor has 16,384.
    pub counts_per_turn: u32,
    /// Whether magnets are glued in at random angles, as real ones are; otherwise rest is count 0.
    pub random_zeros: bool,
    /// Sensors that count backwards, numbered over the whole puppet.
    pub reversed_sensors: Vec<usize>,
    /// Standard deviation of a reading's noise, counts.
    pub noise_counts: f64,
    /// The fastest sampling the sensors allow, samples per 1,000 seconds.
    pub max_rate_millihertz: u32,
    /// The speed of the line, bits per second with ten bits a byte; limits the rate. `None`: unlimited.
    pub line_baud: Option<u32>,
    /// Parts described in one message, 1 to 46. Long messages mean fewer of them; short ones get through noise.
    pub topology_records: usize,
    /// What goes wrong.
    pub faults: Faults,
}

impl PuppetSettings {
    /// A puppet at rest without faults: 14 bits, magnets at random angles, at most 1,000 samples a second.
    pub fn new(body: Body) -> Self {
        Self {
            body,
            motion: Motion::Rest,
            leads: false,
            seed: 0,
            rest_micros: 1_000_000,
            counts_per_turn: 16_384,
            random_zeros: true,
            reversed_sensors: Vec::new(),
            noise_counts: 0.0,
            max_rate_millihertz: 1_000_000,
            line_baud: None,
            topology_records: MAX_RECORDS,
            faults: Faults::default(),
        }
    }

    /// Reports the first impossible setting.
    pub(super) fn check(&self) -> Result<(), SettingsError> {
        let sensors = self.body.sensor_count();
        let parts = self.body.parts().len();
        let faults = &self.faults;
        let chances = [
            ("bit flips", faults.bit_flip),
            ("dropped bytes", faults.byte_drop),
            ("duplicated bytes", faults.byte_duplicate),
            ("outliers", faults.outlier),
            ("hidden outliers", faults.hidden_outlier),
        ];
        if let Some(&(what, value)) = chances.iter().find(|(_, p)| !(0.0..=1.0).contains(p)) {
            return Err(SettingsError::Chance { what, value });
        }
        if !(2..=65_536).contains(&self.counts_per_turn) {
            return Err(SettingsError::Resolution { counts_per_turn: self.counts_per_turn });
        }
        if !(self.noise_counts.is_finite() && self.noise_counts >= 0.0) {
            return Err(SettingsError::Noise { counts: self.noise_counts });
        }
        if !(-100_000.0..=100_000.0).contains(&faults.clock_drift_ppm) {
            return Err(SettingsError::ClockDrift { ppm: faults.clock_drift_ppm });
        }
        if self.max_rate_millihertz == 0 || self.line_baud == Some(0) {
            return Err(SettingsError::Rate);
        }
        let mut sensor_numbers = self.reversed_sensors.iter().chain(faults.sensors.iter().map(|f| &f.sensor));
        if let Some(&sensor) = sensor_numbers.find(|&&sensor| sensor >= sensors) {
            return Err(SettingsError::NoSuchSensor { sensor, sensors });
        }
        if let Some(part) = faults.unplugged.iter().map(|u| u.part).find(|&part| part >= parts) {
            return Err(SettingsError::NoSuchPart { part, parts });
        }
        if let Motion::Track(track) = &self.motion {
            let columns = track.parts.len();
            let time = track.frame_seconds.is_finite() && track.frame_seconds > 0.0;
            let finite = track.rotations.iter().flatten().all(|v| v.is_finite());
            let whole = columns > 0 && track.rotations.len() % columns == 0 || track.rotations.is_empty();
            if !time || !finite || !whole || track.parts.iter().any(|&part| part >= parts) {
                return Err(SettingsError::Track);
            }
        }
        Ok(())
    }
}

/// Why a puppet cannot be emulated.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingsError {
    /// A chance outside 0 to 1.
    Chance {
        /// Of what.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A resolution outside 2 to 65,536.
    Resolution {
        /// The value given.
        counts_per_turn: u32,
    },
    /// A standard deviation that is negative or NaN.
    Noise {
        /// The value given.
        counts: f64,
    },
    /// A drift of more than a tenth.
    ClockDrift {
        /// The value given.
        ppm: f64,
    },
    /// A rate or line speed of zero.
    Rate,
    /// A sensor that the puppet does not have.
    NoSuchSensor {
        /// The number given.
        sensor: usize,
        /// How many there are.
        sensors: usize,
    },
    /// A part that the puppet does not have.
    NoSuchPart {
        /// The number given.
        part: usize,
        /// How many there are.
        parts: usize,
    },
    /// A track whose frame time is not positive, with incomplete frames, parts that do not exist or rotations that are
    /// NaN.
    Track,
}

impl std::fmt::Display for SettingsError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Chance { what, value } => write!(f, "the chance of {what} is {value}, but must be 0 to 1"),
            Self::Resolution { counts_per_turn } => {
                write!(f, "{counts_per_turn} counts per turn are not possible; choose 2 to 65536")
            }
            Self::Noise { counts } => write!(f, "noise of {counts} counts is not possible; choose 0 or more"),
            Self::ClockDrift { ppm } => {
                write!(f, "a clock drift of {ppm} ppm is not possible; choose -100000 to 100000")
            }
            Self::Rate => write!(f, "a rate or line speed of 0 is not possible; choose 1 or more"),
            Self::NoSuchSensor { sensor, sensors } => {
                write!(f, "there is no sensor {sensor}; this puppet has {sensors}, counted from 0")
            }
            Self::NoSuchPart { part, parts } => {
                write!(f, "there is no part {part}; this puppet has {parts}, counted from 0")
            }
            Self::Track => write!(f, "the motion's track does not fit this puppet or is damaged"),
        }
    }
}

impl std::error::Error for SettingsError {}
