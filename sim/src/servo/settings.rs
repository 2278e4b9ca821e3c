//! Settings of an emulated bus.

use std::f64::consts::TAU;

use crate::faults::Faults;
use crate::random::Random;

/// Which wire format a bus speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusKind {
    /// Feetech STS/SMS.
    Feetech,
    /// Dynamixel protocol 2.0.
    Dynamixel,
}

impl BusKind {
    /// Its scheme in a device address.
    pub const fn scheme(self) -> &'static str {
        match self {
            Self::Feetech => "feetech",
            Self::Dynamixel => "dynamixel",
        }
    }
}

/// One servo and how it moves: back and forth about a middle position.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedServo {
    /// Its number on the bus, 0 to 252.
    pub id: u8,
    /// Its model number.
    pub model: u16,
    /// How long it waits before it answers, in units of 2 µs; 250 is the factory setting.
    pub return_delay_units: u8,
    /// Whether its motor holds torque when the bus is switched on.
    pub torque: bool,
    /// The middle of its motion, counts of 4,096 per turn; may be outside one turn.
    pub middle_counts: f64,
    /// How far it turns to either side, counts.
    pub swing_counts: f64,
    /// Swings per second.
    pub hertz: f64,
    /// Where in its swing it starts, turns.
    pub phase: f64,
}

impl SimulatedServo {
    /// A servo at rest in the middle of its turn.
    pub fn new(id: u8, model: u16) -> Self {
        Self {
            id,
            model,
            return_delay_units: 0,
            torque: false,
            middle_counts: 2_048.0,
            swing_counts: 0.0,
            hertz: 0.0,
            phase: 0.0,
        }
    }

    pub(super) fn counts_at(&self, nanos: u64) -> i32 {
        let turns = self.hertz * nanos as f64 * 1e-9 + self.phase;
        libm::round(self.middle_counts + self.swing_counts * libm::sin(TAU * turns)) as i32
    }
}

/// What to emulate.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoBusSettings {
    /// The name of an arm, or any other name.
    pub name: String,
    /// Its wire format.
    pub kind: BusKind,
    /// The speed its servos are set to, bits per second.
    pub baud: u32,
    /// The servos, in the order of the cable.
    pub servos: Vec<SimulatedServo>,
    /// Whether the adapter echoes what is written to it.
    pub echo: bool,
    /// Whether the servos support fast sync reads.
    pub knows_fast_reads: bool,
    /// How long the adapter holds every byte back; FTDI's 16 ms is 16,000.
    pub adapter_latency_micros: u64,
    /// Seed for the motion of presets and all faults.
    pub seed: u64,
    /// What goes wrong. Sensors and parts are servos by their place on the cable; a servo with no data is missing, and
    /// pulling out a part takes all behind it with it. Outliers, drift and restarts have no effect here.
    pub faults: Faults,
}

/// Why there is no such bus.
#[derive(Clone, Debug, PartialEq)]
pub enum ServoBusError {
    /// No arm of this name.
    UnknownArm {
        /// The name given.
        name: String,
    },
    /// No servo, more than 253, or two with the same number.
    Servos,
    /// A speed of 0.
    Baud,
    /// A chance outside 0 to 1.
    Chance {
        /// The number given.
        value: f64,
    },
}

impl std::fmt::Display for ServoBusError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::UnknownArm { name } => {
                let known: Vec<&str> = ARMS.iter().map(|arm| arm.0).collect();
                write!(f, "there is no arm called {name:?}; choose one of {}", known.join(", "))
            }
            Self::Servos => write!(f, "a bus needs 1 to 253 servos, each with its own number from 0 to 252"),
            Self::Baud => write!(f, "a line speed of 0 is not possible; choose 1 or more"),
            Self::Chance { value } => write!(f, "a chance of {value} is not possible; choose 0 to 1"),
        }
    }
}

impl std::error::Error for ServoBusError {}

/// The arms by name: bus, speed, and the model of each servo.
const ARMS: &[(&str, BusKind, u32, &[u16])] = &[
    ("so101-leader", BusKind::Feetech, 1_000_000, &[777; 6]),
    ("koch-leader", BusKind::Dynamixel, 1_000_000, &[1190; 6]),
    ("gello", BusKind::Dynamixel, 57_600, &[1200, 1200, 1200, 1200, 1200, 1200, 1190]),
    ("gello-franka", BusKind::Dynamixel, 57_600, &[1200, 1200, 1200, 1200, 1200, 1200, 1200, 1190]),
];

impl ServoBusSettings {
    /// A bus with the given servos and nothing wrong with it.
    pub fn new(kind: BusKind, baud: u32, servos: Vec<SimulatedServo>) -> Self {
        Self {
            name: kind.scheme().to_owned(),
            kind,
            baud,
            servos,
            echo: false,
            knows_fast_reads: true,
            adapter_latency_micros: 0,
            seed: 0,
            faults: Faults::default(),
        }
    }

    /// The names of the built-in arms.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        ARMS.iter().map(|arm| arm.0)
    }

    /// An arm by name, with ids from 1, each joint swinging slowly in its own way.
    pub fn preset(name: &str, seed: u64) -> Result<Self, ServoBusError> {
        let unknown = || ServoBusError::UnknownArm { name: name.to_owned() };
        let &(name, kind, baud, models) = ARMS.iter().find(|arm| arm.0 == name).ok_or_else(unknown)?;
        let mut random = Random::new(seed, 5);
        let servos = models.iter().zip(1..).map(|(&model, id)| SimulatedServo {
            torque: true,
            middle_counts: 1_500.0 + 1_000.0 * random.unit(),
            swing_counts: 200.0 + 400.0 * random.unit(),
            hertz: 0.2 + 0.6 * random.unit(),
            phase: random.unit(),
            ..SimulatedServo::new(id, model)
        });
        Ok(Self { name: name.to_owned(), seed, ..Self::new(kind, baud, servos.collect()) })
    }

    pub(super) fn check(&self) -> Result<(), ServoBusError> {
        let ids: std::collections::BTreeSet<u8> = self.servos.iter().map(|servo| servo.id).collect();
        if ids.is_empty() || ids.len() != self.servos.len() || ids.iter().any(|&id| id > 252) {
            return Err(ServoBusError::Servos);
        }
        if self.baud == 0 {
            return Err(ServoBusError::Baud);
        }
        let faults = &self.faults;
        let chances = [faults.bit_flip, faults.byte_drop, faults.byte_duplicate];
        match chances.into_iter().find(|chance| !(0.0..=1.0).contains(chance)) {
            Some(value) => Err(ServoBusError::Chance { value }),
            None => Ok(()),
        }
    }
}
