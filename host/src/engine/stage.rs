//! A session's events, one after the other, moving a character and going into a take.

use std::io::Write;

use armature_device::Event;
use armature_rig::{
    CalibrationRun, CalibrationStep, JointTree, Progress, RawSample, Reading, StepError, StepReport, StepTimes,
    ZeroReport,
};
use armature_take::Header;

use super::bridge::{Bridge, take_events};
use super::performance::{Performance, Step};
use super::recorder::{RecordedTake, Recorder};
use crate::failure::Failure;

/// What an event led to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The character has a new pose.
    pub posed: bool,
    /// The rest pose was taken.
    pub zeroed: Option<ZeroReport>,
    /// The puppet is plugged together differently now.
    pub new_topology: bool,
    /// A calibration step is over.
    pub calibrated: Option<Result<StepReport, StepError>>,
}

/// A performance, fed by a device and recorded.
#[derive(Debug)]
pub struct Stage<W: Write> {
    performance: Performance,
    bridge: Option<Bridge>,
    recorder: Option<Recorder<W>>,
    recording_from: f64,
    calibrating: Option<CalibrationRun>,
}

impl<W: Write> Stage<W> {
    /// A stage without a puppet.
    pub fn new(performance: Performance) -> Self {
        Self { performance, bridge: None, recorder: None, recording_from: 0.0, calibrating: None }
    }

    /// Lets an event take effect.
    pub fn handle(&mut self, event: &Event) -> Result<Outcome, Failure> {
        match event {
            Event::Topology(topology) => {
                let bridge = Bridge::new(topology)?;
                self.performance.set_topology(bridge.epoch(), bridge.tree().clone());
                self.bridge = Some(bridge);
                if let Some(recorder) = &mut self.recorder {
                    recorder.topology(&self.performance)?;
                }
                Ok(Outcome { new_topology: true, ..Outcome::default() })
            }
            Event::Sample(sample) => {
                let Some(raw) = self.bridge.as_mut().and_then(|b| b.sample(sample)) else {
                    return Ok(Outcome::default());
                };
                let step = self.performance.perform(raw)?;
                if let Some(recorder) = &mut self.recorder {
                    let host_seconds = sample.received.as_secs_f64() - self.recording_from;
                    recorder.step(raw, &step, &self.performance, Some(host_seconds))?;
                }
                let Step::Posed { zeroed } = step else { return Ok(Outcome::default()) };
                let calibrated = self.calibrate(sample.received.as_secs_f64())?;
                Ok(Outcome { posed: true, zeroed, calibrated, ..Outcome::default() })
            }
            event => {
                let is_back = matches!(event, Event::Restarted);
                if is_back {
                    self.performance.engage_all();
                }
                if let Some(recorder) = &mut self.recorder {
                    take_events(event).try_for_each(|kind| recorder.event(kind))?;
                    if is_back {
                        recorder.engagement(true)?;
                    }
                }
                Ok(Outcome::default())
            }
        }
    }

    /// Begins a calibration step, in place of one that is under way. `now`: the session's time, seconds.
    pub fn begin_calibration(&mut self, step: CalibrationStep, times: StepTimes, now: f64) {
        self.calibrating = Some(CalibrationRun::begin(step, times, now));
    }

    /// Gives up the calibration step that is under way; nothing was changed yet.
    pub fn cancel_calibration(&mut self) {
        self.calibrating = None;
    }

    /// Where the calibration step that is under way stands.
    pub fn calibration_progress(&self, now: f64) -> Option<Progress> {
        self.calibrating.as_ref().map(|run| run.progress(now))
    }

    /// Lets the calibration step that is under way see the latest sample, and ends it when its time is over. Without
    /// samples, somebody has to call this from time to time.
    pub fn calibrate(&mut self, now: f64) -> Result<Option<Result<StepReport, StepError>>, Failure> {
        let Some(run) = &mut self.calibrating else { return Ok(None) };
        if run.progress(now) != Progress::Over {
            if let Some((sample, bridge)) = self.bridge.as_ref().and_then(|bridge| Some((bridge.latest()?, bridge))) {
                let root_turn = self.performance.root_turn();
                run.take(&Reading { now, sample, tree: bridge.tree(), root_turn });
            }
            return Ok(None);
        }
        let Some(run) = self.calibrating.take() else { return Ok(None) };
        let finished = run.finish(self.performance.calibration(), self.performance.mapping());
        if let Ok(report) = &finished {
            self.performance.set_calibration(report.calibration.clone());
            if let Some(recorder) = &mut self.recorder {
                recorder.calibration(&self.performance)?;
            }
        }
        Ok(Some(finished))
    }

    /// Whether the puppet is known and zeroed, so that a take can begin.
    pub fn is_ready(&self) -> bool {
        self.bridge.is_some() && !self.performance.waits_for_zero()
    }

    /// Begins a take. `now`: the session's time, seconds; host times in the take count from here.
    pub fn start_recording(&mut self, out: W, name: &str, header: &Header, now: f64) -> Result<(), Failure> {
        self.recorder = Some(Recorder::begin(out, name, header, &mut self.performance)?);
        self.recording_from = now;
        Ok(())
    }

    /// Ends the take, if one is being recorded.
    pub fn stop_recording(&mut self) -> Result<Option<(W, RecordedTake)>, Failure> {
        self.performance.end_take();
        self.recorder.take().map(Recorder::finish).transpose()
    }

    /// The take so far.
    pub fn recorded(&self) -> Option<RecordedTake> {
        self.recorder.as_ref().map(Recorder::so_far)
    }

    /// The next good sample becomes the rest pose.
    pub fn request_zero(&mut self) {
        self.performance.request_zero();
    }

    /// The character and its pose.
    pub fn performance(&self) -> &Performance {
        &self.performance
    }

    /// The performance by itself, after the show.
    pub fn into_performance(self) -> Performance {
        self.performance
    }

    /// Puts another character on the stage; the puppet stays connected. A running recording has to be ended first.
    pub fn replace_performance(&mut self, performance: Performance) {
        self.performance = performance;
        if let Some(bridge) = &self.bridge {
            self.performance.set_topology(bridge.epoch(), bridge.tree().clone());
        }
    }

    /// The puppet went away.
    pub fn forget_puppet(&mut self) {
        self.bridge = None;
    }

    /// The puppet's tree.
    pub fn tree(&self) -> Option<&JointTree> {
        self.bridge.as_ref().map(Bridge::tree)
    }

    /// The latest sample in the tree's order.
    pub fn latest_sample(&self) -> Option<&RawSample> {
        self.bridge.as_ref().and_then(Bridge::latest)
    }

    /// How many parts of the puppet are of a kind this version does not know.
    pub fn unknown_parts(&self) -> usize {
        self.bridge.as_ref().map_or(0, Bridge::unknown_parts)
    }
}
