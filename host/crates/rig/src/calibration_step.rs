//! The steps by which a puppet is calibrated, as state machines fed with samples and the time.
//!
//! Each step is named and stands alone: it counts down, measures, and gives back the whole calibration with what it
//! found changed in it. Nothing is changed before it is over, and nothing of what it could not measure.

use std::fmt;
use std::str::FromStr;

use glam::Quat;

use crate::measure::{Held, HeldStill, Swept};
use crate::step_report::{StepReport, heading_report, mounting_report, sweep_report, zero_report};
use crate::{Calibration, CalibrationError, JointTree, Mapping, PartUid, RawSample, SensorState};

/// What is calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CalibrationStep {
    /// The counts of the rest pose.
    Zero,
    /// Range, direction and wrap-around of each sensor.
    Sweep,
    /// The full attitude in which each part is mounted.
    Mounting,
    /// Which way the puppet faces.
    Heading,
}

/// No step has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is no calibration step; there are zero, sweep, mounting and heading")]
pub struct UnknownStep {
    /// The text given.
    pub text: String,
}

impl CalibrationStep {
    /// All steps, in the order in which they make sense.
    pub const ALL: [Self; 4] = [Self::Zero, Self::Sweep, Self::Mounting, Self::Heading];

    /// What the person is to do, once for each time something is measured.
    pub fn instructions(self) -> &'static [&'static str] {
        match self {
            Self::Zero => &["hold the puppet still in its rest pose"],
            Self::Sweep => &[
                "from the rest pose, move every joint slowly to its stop: first forward (a twist: to the left, seen from \
                 its outlet), then the other way",
            ],
            Self::Mounting => &[
                "bend the joints forward by about 60° and hold still",
                "bring them back, twist the joints to the left by about 60° and hold still",
            ],
            Self::Heading => &["turn the puppet so that it faces forward, and hold still"],
        }
    }
}

impl fmt::Display for CalibrationStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Zero => "zero",
            Self::Sweep => "sweep",
            Self::Mounting => "mounting",
            Self::Heading => "heading",
        })
    }
}

impl FromStr for CalibrationStep {
    type Err = UnknownStep;

    fn from_str(text: &str) -> Result<Self, UnknownStep> {
        let found = Self::ALL.into_iter().find(|step| step.to_string() == text);
        found.ok_or_else(|| UnknownStep { text: text.to_owned() })
    }
}

/// How long a step takes, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTimes {
    /// To get ready, before anything is measured.
    pub countdown: f64,
    /// For which a pose is held.
    pub hold: f64,
    /// For the sweep.
    pub sweep: f64,
}

impl Default for StepTimes {
    fn default() -> Self {
        Self { countdown: 3.0, hold: 0.5, sweep: 20.0 }
    }
}

/// Where a step stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Nothing is measured yet.
    Countdown {
        /// How long that goes on.
        seconds_left: f64,
        /// What the person is to do by then.
        instruction: &'static str,
    },
    /// The puppet is being measured.
    Measuring {
        /// How long that goes on.
        seconds_left: f64,
        /// What the person is to do meanwhile.
        instruction: &'static str,
    },
    /// It is over: [`CalibrationRun::finish`] tells what came of it.
    Over,
}

/// What a step is fed with.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// The time, seconds.
    pub now: f64,
    /// The sample.
    pub sample: &'a RawSample,
    /// The puppet that numbers its sensors.
    pub tree: &'a JointTree,
    /// What the rotation of the root's bone is, as [`PoseSolver::root_turn`](crate::PoseSolver::root_turn) tells.
    pub root_turn: Option<(PartUid, Quat)>,
}

/// Why a step came to nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StepError {
    /// No sample came while it measured.
    #[error("no sample came while the {step} step measured; is the puppet still connected?")]
    NoSamples {
        /// The step.
        step: CalibrationStep,
    },
    /// Something was plugged in or out.
    #[error("the puppet was plugged together differently during the {step} step; do it again")]
    TreeChanged {
        /// The step.
        step: CalibrationStep,
    },
    /// The calibration does not fit the puppet.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// A step that is under way.
#[derive(Clone, Debug)]
pub struct CalibrationRun {
    step: CalibrationStep,
    times: StepTimes,
    began: f64,
    tree: Option<JointTree>,
    tree_changed: bool,
    /// For each pose that is held, one a sensor.
    held: Vec<Vec<Held>>,
    swept: Vec<Swept>,
    /// The root's part, and sine and cosine of its bone's heading, summed.
    heading: Option<(PartUid, f64, f64)>,
}

impl CalibrationRun {
    /// Begins with the countdown.
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

    /// Where it stands at this time.
    pub fn progress(&self, now: f64) -> Progress {
        self.place(now).1
    }

    /// Which of the poses it is about, and where that stands.
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

    /// Takes a sample. Those that come before or after the measuring are left alone.
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

    /// What came of it: `calibration` with all that was measured changed in it. `mapping`: what the mountings come
    /// beneath.
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
                // A pose of which not one sample came says nothing of any sensor.
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

/// Counts in a turn of each sensor.
fn turns(tree: &JointTree) -> Vec<u32> {
    let sensors = |part: &crate::Part| std::iter::repeat_n(part.counts_per_turn, part.kind.axes().len());
    tree.parts().iter().flat_map(sensors).collect()
}

/// How far a rotation turns about the vertical: the twist of its swing and twist about +Y.
fn heading_of(turn: Quat) -> f64 {
    2.0 * libm::atan2(f64::from(turn.y), f64::from(turn.w))
}
