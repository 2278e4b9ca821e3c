//! The steps for calibrating a puppet, as state machines fed with samples and the time.
//!
//! Each step has a name and is independent of the others: it counts down, measures, and returns the whole calibration
//! with its findings applied. Nothing changes before it is over, and what it could not measure never changes.

use glam::Quat;

use super::measure::{Held, HeldStill, Swept};
use super::report::{StepReport, heading_report, mounting_report, sweep_report, zero_report};
use super::step::CalibrationStep;
use crate::calibration::{Calibration, CalibrationError};
use crate::mapping::Mapping;
use crate::puppet::{JointTree, Part, PartUid, RawSample, SensorState};

/// How long a step takes, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTimes {
    /// To get ready, before anything is measured.
    pub countdown: f64,
    /// How long a pose is held.
    pub hold: f64,
    /// For the sweep.
    pub sweep: f64,
}

impl Default for StepTimes {
    fn default() -> Self {
        Self { countdown: 3.0, hold: 0.5, sweep: 20.0 }
    }
}

/// The state of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Nothing is measured yet.
    Countdown {
        /// How much longer.
        seconds_left: f64,
        /// What the user should do by then.
        instruction: &'static str,
    },
    /// The puppet is being measured.
    Measuring {
        /// How much longer.
        seconds_left: f64,
        /// What the user should do meanwhile.
        instruction: &'static str,
    },
    /// It is over: [`CalibrationRun::finish`] returns the result.
    Over,
}

/// The input of a step.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// The time, seconds.
    pub now: f64,
    /// The sample.
    pub sample: &'a RawSample,
    /// The joint tree that numbers its sensors.
    pub tree: &'a JointTree,
    /// The rotation of the root's bone, from [`PoseSolver::root_turn`](crate::PoseSolver::root_turn).
    pub root_turn: Option<(PartUid, Quat)>,
}

/// Why a step failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StepError {
    /// No sample arrived while it measured.
    #[error("no sample arrived while the {step} step was measuring; is the puppet still connected?")]
    NoSamples {
        /// The step.
        step: CalibrationStep,
    },
    /// Something was plugged in or out.
    #[error("parts were plugged in or out during the {step} step; run it again")]
    TreeChanged {
        /// The step.
        step: CalibrationStep,
    },
    /// The calibration does not fit the puppet.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// A step in progress.
#[derive(Clone, Debug)]
pub struct CalibrationRun {
    step: CalibrationStep,
    times: StepTimes,
    began: f64,
    tree: Option<JointTree>,
    tree_changed: bool,
    /// For each held pose, one entry per sensor.
    held: Vec<Vec<Held>>,
    swept: Vec<Swept>,
    /// The root's part, and the summed sine and cosine of its bone's heading.
    heading: Option<(PartUid, f64, f64)>,
}

impl CalibrationRun {
    /// Starts with the countdown.
    pub fn begin(step: CalibrationStep, times: StepTimes, now: f64) -> Self {
        Self {
            step,
            times,
            began: now,
            tree: None,
            tree_changed: false,
            held: vec![Vec::new(); step.instructions().len()],
            swept: Vec::new(),
            heading: None,
        }
    }

    /// The step.
    pub fn step(&self) -> CalibrationStep {
        self.step
    }

    /// Its progress at this time.
    pub fn progress(&self, now: f64) -> Progress {
        self.place(now).1
    }

    /// Which of the poses is current, and its progress.
    fn place(&self, now: f64) -> (usize, Progress) {
        let measure = if self.step == CalibrationStep::Sweep { self.times.sweep } else { self.times.hold };
        let mut ends = self.began;
        for (pose, &instruction) in self.step.instructions().iter().enumerate() {
            ends += self.times.countdown;
            if now < ends {
                return (pose, Progress::Countdown { seconds_left: ends - now, instruction });
            }
            ends += measure;
            if now < ends {
                return (pose, Progress::Measuring { seconds_left: ends - now, instruction });
            }
        }
        (0, Progress::Over)
    }

    /// Takes a sample. Samples before or after the measurement are ignored.
    pub fn take(&mut self, reading: &Reading<'_>) {
        let (pose, Progress::Measuring { .. }) = self.place(reading.now) else { return };
        let tree = self.tree.get_or_insert_with(|| reading.tree.clone());
        self.tree_changed |= tree != reading.tree;
        let sensors = tree.sensor_count();
        if self.tree_changed || reading.sample.counts.len() != sensors || reading.sample.states.len() != sensors {
            return;
        }
        if self.step == CalibrationStep::Sweep {
            self.swept.resize(sensors, Swept::default());
        } else {
            self.held[pose].resize(sensors, Held::default());
        }
        for (slot, turn) in turns(tree).into_iter().enumerate() {
            let (counts, state) = (reading.sample.counts[slot], reading.sample.states[slot]);
            match self.step {
                CalibrationStep::Sweep if state == SensorState::Ok => self.swept[slot].add(counts, turn),
                CalibrationStep::Sweep => {}
                _ => self.held[pose][slot].add(counts, state, turn),
            }
        }
        if let (CalibrationStep::Heading, Some((part, turn))) = (self.step, reading.root_turn) {
            let (sin, cos) = libm::sincos(heading_of(turn));
            let (_, sines, cosines) = self.heading.get_or_insert((part, 0.0, 0.0));
            (*sines, *cosines) = (*sines + sin, *cosines + cos);
        }
    }

    /// The result: `calibration` with everything that was measured applied to it. `mapping`: its mountings are applied
    /// on top of those found here.
    pub fn finish(self, calibration: &Calibration, mapping: Option<&Mapping>) -> Result<StepReport, StepError> {
        let step = self.step;
        if self.tree_changed {
            return Err(StepError::TreeChanged { step });
        }
        let tree = self.tree.ok_or(StepError::NoSamples { step })?;
        for part in 0..tree.parts().len() {
            calibration.checked_part(&tree, part)?;
        }
        let mut calibration = calibration.clone();
        calibration.add_missing(&tree);
        let mut poses: Vec<Vec<HeldStill>> = Vec::new();
        for held in &self.held {
            let turn_of = turns(&tree);
            poses.push(held.iter().zip(&turn_of).map(|(held, &turn)| held.outcome(turn)).collect());
        }
        match step {
            CalibrationStep::Zero => Ok(zero_report(&tree, calibration, poses.first().map_or(&[], Vec::as_slice))),
            CalibrationStep::Sweep => Ok(sweep_report(&tree, calibration, &self.swept)),
            CalibrationStep::Mounting => {
                // A pose without a single sample says nothing about any sensor.
                if poses.iter().any(Vec::is_empty) && tree.sensor_count() > 0 {
                    return Err(StepError::NoSamples { step });
                }
                Ok(mounting_report(&tree, calibration, mapping, &poses))
            }
            CalibrationStep::Heading => {
                let heading = self.heading.map(|(part, sines, cosines)| (part, libm::atan2(sines, cosines)));
                Ok(heading_report(&tree, calibration, heading))
            }
        }
    }
}

/// Counts per turn of each sensor.
fn turns(tree: &JointTree) -> Vec<u32> {
    let sensors = |part: &Part| std::iter::repeat_n(part.counts_per_turn, part.kind.axes().len());
    tree.parts().iter().flat_map(sensors).collect()
}

/// How far a rotation turns about the vertical: the twist part of its swing-twist decomposition about +Y.
fn heading_of(turn: Quat) -> f64 {
    2.0 * libm::atan2(f64::from(turn.y), f64::from(turn.w))
}
