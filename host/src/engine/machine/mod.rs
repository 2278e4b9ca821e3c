//! The engine: everything that a session does with its puppet, character and take, as one state machine.
//!
//! [`Engine::handle`] takes one [`Input`] at a time and answers through the [`Shell`]. It starts no thread, opens
//! nothing and reads no clock, so a list of inputs and their times replays a session. `line` handles lines, `tasks`
//! what the user asked for (runs, recordings, calibration), `taking` what is done with takes that are there.

mod line;
#[cfg(test)]
mod script;
mod taking;
#[cfg(test)]
mod taking_tests;
mod tasks;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::sync::Arc;

use armature_rig::{Calibration, Mapping, PuppetHints, StepTimes, TargetChange};

use self::line::Line;
use self::taking::Taking;
use super::calibrating::CalibrationPlan;
use super::command::Command;
use super::event::{EngineEvent, Problem};
use super::frames::{self, FrameClock};
use super::input::{Input, LoadId, LoadNews, Request, Shell, TakeFile, TakeName};
use super::pipeline::Pipeline;
use super::puppet_rest::PuppetRest;
use super::puppeteer::{Puppeteer, ZeroPolicy};
use super::run::{Run, STATUS_SECONDS};
use super::run_summary::RunSummary;
use crate::characters::LoadedCharacter;
use crate::characters::dynamics::DynamicsArgs;
use crate::characters::ground::GroundArgs;
use crate::characters::inverse_kinematics::IkArgs;
use crate::characters::shapes::ShapeWeight;
use crate::characters::targets::TargetArgs;
use crate::failure::Failure;
use crate::takes::orders::TakeOrder;

/// Frames are drawn at most this often; a faster puppet moves the character all the same.
const FRAME_SECONDS: f64 = 0.003;
const BLINK_MILLIS: u16 = 2_000;
/// The rate that the window requests from a puppet.
const SAMPLES_PER_SECOND: f64 = 250.0;

/// How an engine should work. The default is the window's.
#[derive(Clone, Debug)]
pub struct EngineSettings {
    /// The rate requested from puppets.
    pub samples_per_second: f64,
    /// When the rest pose is taken.
    pub zero_policy: ZeroPolicy,
    /// As chosen by the user; `None`: proposed for each puppet.
    pub mapping: Option<Mapping>,
    /// The pose in which the puppet is zeroed.
    pub puppet_rest: PuppetRest,
    /// What is known about the joints of puppets whose line has no calibration of its own.
    pub calibration: Calibration,
    /// What happens to bones without a joint.
    pub ik: IkArgs,
    /// How the roots follow the feet.
    pub ground: GroundArgs,
    /// What swings.
    pub dynamics: DynamicsArgs,
    /// Shapes of the character that are set from the start.
    pub shapes: Vec<ShapeWeight>,
    /// What is dragged, and when.
    pub targets: TargetArgs,
    /// The durations of calibration steps.
    pub step_times: StepTimes,
    /// Whether frames are drawn.
    pub draws: bool,
}

impl Default for EngineSettings {
    fn default() -> Self {
        Self {
            samples_per_second: SAMPLES_PER_SECOND,
            zero_policy: ZeroPolicy::WhenUnknown,
            mapping: None,
            puppet_rest: PuppetRest::default(),
            calibration: Calibration::default(),
            ik: IkArgs::default(),
            ground: GroundArgs::default(),
            dynamics: DynamicsArgs::default(),
            shapes: Vec::new(),
            targets: TargetArgs::default(),
            step_times: StepTimes::default(),
            draws: true,
        }
    }
}

/// A character that is being loaded.
#[derive(Debug)]
struct Loading {
    load: LoadId,
    cancelled: bool,
}

/// The state machine; see the [module](self).
#[derive(Debug)]
pub struct Engine {
    settings: EngineSettings,
    pipeline: Option<Pipeline<Box<dyn TakeFile>>>,
    line: Line,
    lines: u32,
    loading: Option<Loading>,
    loads: u32,
    /// The path of the take being recorded.
    recording: Option<PathBuf>,
    run: Option<Run>,
    /// A run's result, until its line is closed.
    run_over: Option<Result<RunSummary, Failure>>,
    calibration_plan: Option<CalibrationPlan>,
    taking: Taking,
    /// What was last reported about a calibration step.
    calibration_reported: Option<(bool, &'static str, u64)>,
    frame_clock: FrameClock,
    /// There is a pose that has not been drawn yet.
    frame_waits: bool,
    last_frame: f64,
    last_input: f64,
    quitting: bool,
}

impl Engine {
    /// An engine without a character or puppet.
    pub fn new(settings: EngineSettings) -> Self {
        Self {
            settings,
            pipeline: None,
            line: Line::Off,
            lines: 0,
            loading: None,
            loads: 0,
            recording: None,
            run: None,
            run_over: None,
            calibration_plan: None,
            taking: Taking::default(),
            calibration_reported: None,
            frame_clock: FrameClock::default(),
            frame_waits: false,
            last_frame: f64::NEG_INFINITY,
            last_input: 0.0,
            quitting: false,
        }
    }

    /// Applies one input. `now`: the time, seconds; never less than before.
    pub fn handle(&mut self, now: f64, input: Input, shell: &mut dyn Shell) {
        self.last_input = now;
        let handled = match input {
            Input::Command(command) => {
                if let Err(failure) = self.obey(now, command, shell) {
                    shell.tell(EngineEvent::Problem(Problem::from(&failure)));
                }
                Ok(())
            }
            Input::Device { line, counters, news } => self.hear_line(now, line, counters, news, shell),
            Input::Loaded { load, news } => self.hear_load(now, load, news, shell),
            Input::Worked { work, news } => {
                self.hear_work(now, work, news, shell);
                Ok(())
            }
            Input::Connected { line, outcome } => self.hear_connected(line, outcome, shell),
            Input::Listed(Ok(devices)) => {
                shell.tell(EngineEvent::Devices(devices));
                Ok(())
            }
            Input::Listed(Err(failure)) => {
                shell.tell(EngineEvent::Problem(Problem::from(&failure)));
                Ok(())
            }
            Input::Tick => Ok(()),
        };
        if let Err(failure) = handled.and_then(|()| self.look_at_clock(now, shell)) {
            self.fail(now, failure, shell);
        }
    }

    /// When the engine needs an [`Input::Tick`], if nothing else happens until then; `None`: it can wait.
    pub fn wakes_at(&self) -> Option<f64> {
        let run = self.run.as_ref().filter(|_| self.pipeline.is_some()).map(Run::wakes_at);
        let calibration = self.is_calibrating().then_some(self.last_input + STATUS_SECONDS / 2.0);
        let frame = self.frame_waits.then_some(self.last_frame + FRAME_SECONDS);
        [run, calibration, frame, self.taking_wakes_at()].into_iter().flatten().min_by(f64::total_cmp)
    }

    /// Whether it has quit: every take is finished and every line closed.
    pub fn is_over(&self) -> bool {
        self.quitting && matches!(self.line, Line::Off | Line::Connecting { .. })
    }

    /// The character and what moves it; `None` before one is loaded.
    pub fn puppeteer(&self) -> Option<&Puppeteer> {
        self.pipeline.as_ref().map(Pipeline::puppeteer)
    }

    fn obey(&mut self, now: f64, command: Command, shell: &mut dyn Shell) -> Result<(), Failure> {
        match command {
            Command::Connect(address) => self.connect(address, shell),
            Command::Disconnect => self.disconnect(None, shell),
            Command::ListDevices => shell.ask(Request::ListDevices),
            Command::Zero | Command::Calibrate(_) if self.recording.is_some() => {
                return Err(recording_goes_on("calibrate"));
            }
            Command::Zero => self.pipeline.iter_mut().for_each(Pipeline::request_zero),
            Command::Calibrate(step) => self.begin_calibration_step(now, step)?,
            Command::CalibrateAll(steps) => self.calibration_plan = Some(CalibrationPlan::new(steps)),
            Command::Run(plan) => self.run = Some(Run::new(*plan)),
            Command::StartRecording => self.start_recording(now, shell)?,
            Command::RecordAfter(seconds) => self.record_after(now, seconds, shell)?,
            Command::RecordAgain => self.record_again(now, shell)?,
            Command::Overdub { bones } => self.overdub(now, &bones, shell)?,
            Command::ListTakes => self.list_takes(shell),
            Command::OpenTake(path) => self.open_take(path, shell)?,
            Command::CloseTake => self.close_take(shell),
            Command::Play(play) => self.play(now, play, shell),
            Command::EditTake(list) => self.edit_take(list, shell)?,
            Command::Annotate { take, note, rating } => self.work(TakeOrder::Annotate { take, note, rating }, shell),
            Command::Discard(take) => self.discard(take, shell)?,
            Command::Restore(take) => self.work(TakeOrder::Restore(take), shell),
            Command::Export(order) => self.work(TakeOrder::Export(order), shell),
            Command::StopRecording => self.stop_recording(shell),
            Command::LoadCharacter(choice) => self.load(choice.source(), shell)?,
            Command::SetShape(shape) => {
                if let Some(pipeline) = &mut self.pipeline {
                    pipeline.set_shape(&shape)?;
                    self.frame_waits |= self.settings.draws;
                }
            }
            Command::SetTarget { target, over_micros } => {
                self.change_target(TargetChange::Set { target, over_micros })?;
            }
            Command::ReleaseTarget { point, over_micros } => {
                self.change_target(TargetChange::Release { point, over_micros })?;
            }
            Command::Cancel => self.cancel(shell),
            Command::Blink(uid) => {
                if let Line::Open(open) = &self.line {
                    let uid = armature_device::PartUid(uid.0);
                    shell.ask(Request::Blink { line: open.line, uid, millis: BLINK_MILLIS });
                }
            }
            Command::Quit => self.quit(now, shell),
        }
        Ok(())
    }

    fn change_target(&mut self, change: TargetChange) -> Result<(), Failure> {
        let none = || Failure::usage("there is no character to drag", "open one first");
        self.pipeline.as_mut().ok_or_else(none)?.change_target(change)
    }

    fn quit(&mut self, now: f64, shell: &mut dyn Shell) {
        self.quitting = true;
        if self.run.is_some() {
            self.end_run(now, None, shell);
        }
        if self.calibration_plan.is_some() {
            self.fail(now, Failure::usage("calibrating was interrupted; nothing was changed", ""), shell);
        }
        self.disconnect(None, shell);
    }

    fn cancel(&mut self, shell: &mut dyn Shell) {
        if let Some(loading) = &mut self.loading {
            loading.cancelled = true;
            shell.ask(Request::CancelLoad(loading.load));
        }
        if self.calibration_plan.take().is_some() {
            let failure = Failure::usage("calibrating was cancelled; nothing was changed", "");
            shell.tell(EngineEvent::CalibrationOver(Err(failure)));
        }
        self.end_calibration_step(shell);
        self.cancel_work(shell);
    }

    /// Whatever is waiting ends with the failure; otherwise it is reported, and the session continues.
    fn fail(&mut self, now: f64, failure: Failure, shell: &mut dyn Shell) {
        if self.run.is_some() {
            self.end_run(now, Some(failure), shell);
        } else if self.calibration_plan.take().is_some() {
            self.end_calibration_step(shell);
            shell.tell(EngineEvent::CalibrationOver(Err(failure)));
        } else if self.recording_broke() {
            shell.tell(EngineEvent::RecordingFailed(Problem::from(&failure)));
        } else {
            shell.tell(EngineEvent::Problem(Problem::from(&failure)));
        }
    }

    fn look_at_clock(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        self.look_after_run(now, shell)?;
        self.look_after_calibration(now, shell)?;
        self.look_after_takes(now, shell)?;
        if self.frame_waits && now - self.last_frame >= FRAME_SECONDS {
            self.tell_frame(now, shell);
        }
        Ok(())
    }

    fn load(&mut self, source: String, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Err(recording_goes_on("change the character"));
        }
        if let Some(former) = self.loading.take() {
            shell.ask(Request::CancelLoad(former.load));
        }
        self.loads += 1;
        let load = LoadId(self.loads);
        self.loading = Some(Loading { load, cancelled: false });
        shell.ask(Request::Load { load, source });
        Ok(())
    }

    fn hear_load(&mut self, now: f64, load: LoadId, news: LoadNews, shell: &mut dyn Shell) -> Result<(), Failure> {
        // Another one was chosen meanwhile, unless a subcommand brought the character along, which the engine never
        // asked for.
        let is_awaited = self.loading.as_ref().is_some_and(|loading| loading.load == load);
        if !is_awaited && load != LoadId::BROUGHT_ALONG {
            return Ok(());
        }
        match news {
            LoadNews::Progress { stage, done } => {
                shell.tell(EngineEvent::Busy { task: stage, fraction: Some(done as f32) });
                Ok(())
            }
            LoadNews::Over(outcome) => {
                let cancelled = self.loading.take().is_some_and(|loading| loading.cancelled);
                shell.tell(EngineEvent::Idle);
                match outcome {
                    Ok((character, warnings)) => {
                        warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
                        self.enter(now, character, shell)
                    }
                    Err(_) if cancelled => Ok(()),
                    Err(failure) => Err(failure),
                }
            }
        }
    }

    /// Replaces the character; the puppet stays connected.
    fn enter(&mut self, now: f64, character: Arc<LoadedCharacter>, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Err(recording_goes_on("change the character"));
        }
        let calibration = match (&self.pipeline, &self.line) {
            (Some(pipeline), _) => pipeline.puppeteer().calibration(),
            (None, Line::Open(open)) => &open.calibration,
            (None, _) => &self.settings.calibration,
        };
        let hints = if let Line::Open(open) = &self.line { open.hints.clone() } else { PuppetHints::default() };
        let EngineSettings { mapping, zero_policy, puppet_rest, ik, ground, dynamics, shapes, targets, .. } =
            &self.settings;
        let puppeteer = Puppeteer::new(character.clone(), mapping.clone(), calibration.clone(), *zero_policy)?
            .with_puppet_rest(*puppet_rest)
            .with_hints(hints)
            .with_inverse_kinematics(ik)?
            .with_ground(ground)?
            .with_dynamics(dynamics)?
            .with_shapes(shapes)?
            .with_targets(targets)?;
        shell.tell(EngineEvent::CharacterLoaded(character));
        self.frame_waits = false;
        match &mut self.pipeline {
            Some(pipeline) => {
                let is_told = puppeteer.prepares_long();
                let cancelled = line::preparing(is_told, shell, |progress| {
                    pipeline.replace_puppeteer(puppeteer, progress);
                    pipeline.puppeteer().ik_problem().cloned()
                });
                line::tell_unprepared(cancelled, shell);
            }
            None => self.pipeline = Some(Pipeline::new(puppeteer)),
        }
        self.tell_topology(shell);
        self.introduce_puppet(now, shell)
    }

    fn tell_topology(&self, shell: &mut dyn Shell) {
        let Some(pipeline) = &self.pipeline else { return };
        let Some(tree) = pipeline.tree() else { return };
        shell.tell(EngineEvent::Topology { tree: Arc::new(tree.clone()) });
        shell.tell(EngineEvent::Mapping {
            bone_of_part: frames::bone_of_part(tree, pipeline.puppeteer()),
            solved: frames::solved_bones(pipeline.puppeteer()),
        });
    }

    fn tell_frame(&mut self, now: f64, shell: &mut dyn Shell) {
        self.frame_waits = false;
        self.last_frame = now;
        if self.tell_take_frame(shell) {
            self.tell_recorded(shell);
            return;
        }
        let (Some(pipeline), Line::Open(open)) = (&self.pipeline, &self.line) else { return };
        let mut frame = shell.frame_buffer();
        frames::fill(&mut frame, pipeline, self.frame_clock.stats(&open.counters));
        shell.tell(EngineEvent::Frame(frame));
        self.tell_recorded(shell);
    }

    fn tell_recorded(&self, shell: &mut dyn Shell) {
        if let Some(recorded) = self.pipeline.as_ref().and_then(Pipeline::recorded) {
            let seconds = recorded.micros as f64 * 1e-6;
            shell.tell(EngineEvent::Recording { seconds, samples: recorded.samples });
        }
    }
}

fn recording_goes_on(before: &str) -> Failure {
    Failure::usage("a take is being recorded", format!("stop recording before you {before}"))
}
