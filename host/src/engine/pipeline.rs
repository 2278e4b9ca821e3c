//! What each event of a puppet passes through: from wire types to the rig's, into a pose, a calibration step, a take.

use std::io::Write;
use std::time::Duration;

use armature_device::Event;
use armature_rig::{
    Calibration, CalibrationRun, CalibrationStep, JointTree, Progress, PuppetHints, RawSample, Reading, StepError,
    StepReport, StepTimes, TargetChange, ZeroReport,
};
use armature_take::Header;

use super::bridge::{Bridge, hints_of_servos, take_events};
use super::puppeteer::{Puppeteer, Step, unheard};
use super::take_recorder::{RecordedTake, TakeRecorder};
use crate::characters::shapes::ShapeWeight;
use crate::failure::Failure;

/// What an event led to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The character has a new pose.
    pub posed: bool,
    /// The rest pose was taken.
    pub zeroed: Option<ZeroReport>,
    /// The puppet is now plugged together differently.
    pub new_topology: bool,
    /// A calibration step is over.
    pub calibrated: Option<Result<StepReport, StepError>>,
}

/// Where a puppet's events go, one after the other: [`Bridge`], [`Puppeteer`], calibration step, [`TakeRecorder`].
#[derive(Debug)]
pub struct Pipeline<W: Write> {
    puppeteer: Puppeteer,
    bridge: Option<Bridge>,
    recorder: Option<TakeRecorder<W>>,
    recording_from: f64,
    calibrating: Option<CalibrationRun>,
}

impl<W: Write> Pipeline<W> {
    /// A pipeline without a puppet.
    pub fn new(puppeteer: Puppeteer) -> Self {
        Self { puppeteer, bridge: None, recorder: None, recording_from: 0.0, calibrating: None }
    }

    /// Applies an event.
    pub fn handle(&mut self, event: &Event) -> Result<Outcome, Failure> {
        self.handle_with(event, &mut unheard)
    }

    /// The same; `progress` hears how far the character is prepared for another puppet.
    pub fn handle_with(
        &mut self,
        event: &Event,
        progress: armature_character::Progress<'_>,
    ) -> Result<Outcome, Failure> {
        match event {
            Event::Topology(topology) => {
                let bridge = Bridge::new(topology)?;
                if let Some(hints) = hints_of_servos(topology) {
                    self.puppeteer.set_hints(hints);
                }
                self.puppeteer.set_topology(bridge.epoch(), bridge.tree().clone(), progress);
                self.bridge = Some(bridge);
                self.record(TakeRecorder::topology)?;
                Ok(Outcome { new_topology: true, ..Outcome::default() })
            }
            Event::Sample(sample) => {
                let Some(raw) = self.bridge.as_mut().and_then(|b| b.sample(sample)) else {
                    return Ok(Outcome::default());
                };
                let step = self.puppeteer.follow(raw)?;
                let host_seconds = sample.received.as_secs_f64() - self.recording_from;
                if let Some(recorder) = &mut self.recorder
                    && let Err(failure) = recorder.step(raw, &step, &self.puppeteer, Some(host_seconds))
                {
                    self.give_up_recording();
                    return Err(failure);
                }
                let Step::Posed { zeroed, .. } = step else { return Ok(Outcome::default()) };
                let calibrated = self.calibrate(sample.received.as_secs_f64())?;
                Ok(Outcome { posed: true, zeroed, calibrated, ..Outcome::default() })
            }
            event => {
                let is_back = matches!(event, Event::Restarted);
                if is_back {
                    self.puppeteer.engage_all();
                }
                self.record(|recorder, _| {
                    take_events(event).try_for_each(|kind| recorder.event(kind))?;
                    if is_back { recorder.engagement(true) } else { Ok(()) }
                })?;
                Ok(Outcome::default())
            }
        }
    }

    /// How long the latest sample took from its last byte until the character was posed, for the take's receipt; `None` on
    /// a virtual clock.
    pub fn posed(&mut self, latency: Option<Duration>) {
        if let (Some(recorder), Some(latency)) = (&mut self.recorder, latency) {
            recorder.posed(latency);
        }
    }

    /// Writes into the take, if one is being recorded. If that fails, the recording ends: what was written until
    /// then can be read.
    fn record(
        &mut self,
        write: impl FnOnce(&mut TakeRecorder<W>, &Puppeteer) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Some(recorder) = &mut self.recorder else { return Ok(()) };
        write(recorder, &self.puppeteer).inspect_err(|_| self.give_up_recording())
    }

    fn give_up_recording(&mut self) {
        self.recorder = None;
        self.puppeteer.end_take();
    }

    /// Starts a calibration step, replacing any current one. `now`: the session's time, seconds.
    pub fn begin_calibration(&mut self, step: CalibrationStep, times: StepTimes, now: f64) {
        self.calibrating = Some(CalibrationRun::begin(step, times, now));
    }

    /// Cancels the current calibration step; nothing has been changed yet.
    pub fn cancel_calibration(&mut self) {
        self.calibrating = None;
    }

    /// The current calibration step and its progress.
    pub fn calibrating(&self, now: f64) -> Option<(CalibrationStep, Progress)> {
        self.calibrating.as_ref().map(|run| (run.step(), run.progress(now)))
    }

    /// Shows the latest sample to the current calibration step, and ends the step when its time is over. Must be called
    /// from time to time even without samples.
    pub fn calibrate(&mut self, now: f64) -> Result<Option<Result<StepReport, StepError>>, Failure> {
        let Some(run) = &mut self.calibrating else { return Ok(None) };
        if run.progress(now) != Progress::Over {
            if let Some((sample, bridge)) = self.bridge.as_ref().and_then(|bridge| Some((bridge.latest()?, bridge))) {
                let root_turn = self.puppeteer.root_turn();
                run.take(&Reading { now, sample, tree: bridge.tree(), root_turn });
            }
            return Ok(None);
        }
        let Some(run) = self.calibrating.take() else { return Ok(None) };
        let finished = run.finish(self.puppeteer.calibration(), self.puppeteer.mapping());
        if let Ok(report) = &finished {
            self.puppeteer.set_calibration(report.calibration.clone());
            self.record(TakeRecorder::calibration)?;
        }
        Ok(Some(finished))
    }

    /// Whether the puppet is known and zeroed, so that a take can start.
    pub fn is_ready(&self) -> bool {
        self.bridge.is_some() && !self.puppeteer.waits_for_zero()
    }

    /// Starts a take. `now`: the session's time, seconds; host times in the take count from here.
    pub fn start_recording(&mut self, out: W, name: &str, header: &Header, now: f64) -> Result<(), Failure> {
        self.recorder = Some(TakeRecorder::begin(out, name, header, &mut self.puppeteer)?);
        self.recording_from = now;
        Ok(())
    }

    /// Ends the take, if one is being recorded.
    pub fn stop_recording(&mut self) -> Result<Option<(W, RecordedTake)>, Failure> {
        self.puppeteer.end_take();
        self.recorder.take().map(TakeRecorder::finish).transpose()
    }

    /// The take so far.
    pub fn recorded(&self) -> Option<RecordedTake> {
        self.recorder.as_ref().map(TakeRecorder::so_far)
    }

    /// The next good sample becomes the rest pose.
    pub fn request_zero(&mut self) {
        self.puppeteer.request_zero();
    }

    /// Blends the character towards one of its shapes.
    pub fn set_shape(&mut self, shape: &ShapeWeight) -> Result<(), Failure> {
        self.puppeteer.set_shape(shape)?;
        self.record(|recorder, _| recorder.shape(&shape.name, shape.weight))
    }

    /// Drags a point of the character, or lets it go.
    pub fn change_target(&mut self, change: TargetChange) -> Result<(), Failure> {
        self.puppeteer.change_target(change)
    }

    /// The character and its pose.
    pub fn puppeteer(&self) -> &Puppeteer {
        &self.puppeteer
    }

    /// The puppeteer alone.
    pub fn into_puppeteer(self) -> Puppeteer {
        self.puppeteer
    }

    /// Poses another character from now on; the puppet stays connected. A recording must be ended first.
    /// `progress` hears how far the new one is prepared for the puppet.
    pub fn replace_puppeteer(&mut self, puppeteer: Puppeteer, progress: armature_character::Progress<'_>) {
        self.puppeteer = puppeteer;
        if let Some(bridge) = &self.bridge {
            self.puppeteer.set_topology(bridge.epoch(), bridge.tree().clone(), progress);
        }
    }

    /// The puppet is gone.
    pub fn forget_puppet(&mut self) {
        self.bridge = None;
    }

    /// Another puppet is connected; this is what is known about its joints.
    pub fn expect_puppet(&mut self, calibration: Calibration, hints: PuppetHints) {
        self.bridge = None;
        self.puppeteer.expect_puppet(calibration, hints);
    }

    /// The puppet's tree.
    pub fn tree(&self) -> Option<&JointTree> {
        self.bridge.as_ref().map(Bridge::tree)
    }

    /// The latest sample in the tree's order.
    pub fn latest_sample(&self) -> Option<&RawSample> {
        self.bridge.as_ref().and_then(Bridge::latest)
    }

    /// How many parts of the puppet are of a kind unknown to this version.
    pub fn unknown_parts(&self) -> usize {
        self.bridge.as_ref().map_or(0, Bridge::unknown_parts)
    }
}
