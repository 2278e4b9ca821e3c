//! Calibration steps one after the other: which one is next, and what they came to.

use std::collections::VecDeque;

use armature_device::{DeviceProblem, Event};
use armature_rig::{CalibrationStep, Progress, StepError, StepReport};

use super::sources::address::problem_failure;
use crate::failure::Failure;

/// Steps that were asked for together.
#[derive(Debug)]
pub(super) struct CalibrationPlan {
    waiting: VecDeque<CalibrationStep>,
    under_way: Option<CalibrationStep>,
    reports: Vec<StepReport>,
}

impl CalibrationPlan {
    pub(super) fn new(steps: Vec<CalibrationStep>) -> Self {
        Self { waiting: steps.into(), under_way: None, reports: Vec::new() }
    }

    /// The step to begin now, where none is under way.
    pub(super) fn next(&mut self) -> Option<CalibrationStep> {
        if self.under_way.is_none() {
            self.under_way = self.waiting.pop_front();
            return self.under_way;
        }
        None
    }

    /// A step has ended. Returns all the reports after the last one.
    pub(super) fn step_over(&mut self, report: StepReport) -> Option<Vec<StepReport>> {
        self.under_way = None;
        self.reports.push(report);
        self.waiting.is_empty().then(|| std::mem::take(&mut self.reports))
    }

    /// Whether an event of the puppet makes an end of it.
    pub(super) fn note(event: &Event) -> Result<(), Failure> {
        match event {
            Event::Problem(DeviceProblem::Refused { .. } | DeviceProblem::NoAnswer { .. }) => Ok(()),
            Event::Problem(problem) => Err(problem_failure(problem)),
            _ => Ok(()),
        }
    }
}

/// Where a step stands to the whole second: what is worth reporting when it changes.
pub(super) fn in_seconds(progress: Progress) -> Option<(bool, &'static str, u64)> {
    match progress {
        Progress::Countdown { seconds_left, instruction } => Some((false, instruction, seconds_left.ceil() as u64)),
        Progress::Measuring { seconds_left, instruction } => Some((true, instruction, seconds_left.ceil() as u64)),
        Progress::Over => None,
    }
}

/// A step's trouble as the program reports it.
pub(super) fn step_failure(error: &StepError) -> Failure {
    let remedy = match error {
        StepError::NoSamples { .. } => "look at the cable and at `armature devices`, and do the step again",
        StepError::TreeChanged { .. } => "",
        StepError::Calibration(_) => "remove the part's entry from the calibration file",
    };
    Failure::device(error.to_string(), remedy)
}

/// No sample came at all. `refused`: what the device refused.
pub(super) fn no_samples(refused: Option<&DeviceProblem>) -> Failure {
    if let Some(problem) = refused {
        return problem_failure(problem);
    }
    Failure::device("the puppet sends no samples", "unplug it, plug it in again, and look at `armature devices`")
}
