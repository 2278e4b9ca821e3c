//! Calibration steps one after the other, whatever the puppet and whatever the clock.

use std::io::Sink;

use armature_device::{DeviceProblem, Event};
use armature_rig::{CalibrationStep, Progress, StepError, StepReport, StepTimes};

use super::live::problem_failure;
use super::perform::{Next, Source};
use super::performance::Performance;
use super::stage::Stage;
use crate::failure::Failure;

/// Before the first sample the program waits at most so long, session's time.
const PATIENCE_SECONDS: f64 = 12.0;

/// Steps that are done, and what the puppet was driving meanwhile.
#[derive(Debug)]
pub struct Calibrated {
    /// With the calibration as it is now.
    pub performance: Performance,
    /// One a step.
    pub reports: Vec<StepReport>,
}

/// Does the steps in this order. `told` hears where each stands, whenever there was something to listen to.
///
/// A step that came to nothing ends it: what the steps before it found is in the error's place, in
/// [`Calibrated`], only if all went well.
pub fn calibrate<S: Source>(
    mut source: S,
    performance: Performance,
    steps: &[CalibrationStep],
    times: StepTimes,
    told: &mut dyn FnMut(CalibrationStep, Progress),
) -> Result<Calibrated, Failure> {
    let mut stage: Stage<Sink> = Stage::new(performance);
    let mut reports = Vec::with_capacity(steps.len());
    let outcome = wait_for_samples(&mut source, &mut stage).and_then(|()| {
        steps.iter().try_for_each(|&step| {
            reports.push(one_step(&mut source, &mut stage, step, times, told)?);
            Ok(())
        })
    });
    source.close();
    outcome.map(|()| Calibrated { performance: stage.into_performance(), reports })
}

fn wait_for_samples(source: &mut impl Source, stage: &mut Stage<Sink>) -> Result<(), Failure> {
    while stage.latest_sample().is_none() {
        if source.now() > PATIENCE_SECONDS {
            let remedy = "unplug it, plug it in again, and look at `armature devices`";
            return Err(Failure::device("the puppet sends no samples", remedy));
        }
        listen(source, stage)?;
    }
    Ok(())
}

fn one_step(
    source: &mut impl Source,
    stage: &mut Stage<Sink>,
    step: CalibrationStep,
    times: StepTimes,
    told: &mut dyn FnMut(CalibrationStep, Progress),
) -> Result<StepReport, Failure> {
    stage.begin_calibration(step, times, source.now());
    loop {
        let mut finished = listen(source, stage)?;
        let now = source.now();
        match stage.calibration_progress(now) {
            // Without samples nobody else ends it.
            Some(Progress::Over) => finished = stage.calibrate(now)?,
            Some(progress) => told(step, progress),
            None => {}
        }
        if let Some(finished) = finished {
            return finished.map_err(|error| step_failure(&error));
        }
    }
}

/// Lets one event take effect; a step that is over with it.
fn listen(source: &mut impl Source, stage: &mut Stage<Sink>) -> Result<Option<Result<StepReport, StepError>>, Failure> {
    if source.interrupted() {
        return Err(Failure::usage("calibrating was interrupted; nothing was changed", ""));
    }
    match source.next() {
        Next::Event(Event::Problem(problem @ (DeviceProblem::Refused { .. } | DeviceProblem::NoAnswer { .. }))) => {
            tracing::warn!("{problem}");
            Ok(None)
        }
        Next::Event(Event::Problem(problem)) => Err(problem_failure(&problem)),
        Next::Event(event) => {
            if let Event::Notice(notice) = &event {
                tracing::warn!("{notice}");
            }
            Ok(stage.handle(&event)?.calibrated)
        }
        Next::Quiet => Ok(None),
        Next::Over => Err(problem_failure(&DeviceProblem::Disconnected { reason: "the line was closed".into() })),
    }
}

/// A step's trouble as the program tells it.
pub fn step_failure(error: &StepError) -> Failure {
    let remedy = match error {
        StepError::NoSamples { .. } => "look at the cable and at `armature devices`, and do the step again",
        StepError::TreeChanged { .. } => "",
        StepError::Calibration(_) => "remove the part's entry from the calibration file",
    };
    Failure::device(error.to_string(), remedy)
}
