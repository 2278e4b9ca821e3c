//! The only loop: inputs from any source go into the engine here, and its events go to a listener.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use armature_rig::{Calibration, CalibrationStep, ShapeWeights, StepReport};
use glam::Affine3A;

use super::command::{Command, RunPlan};
use super::event::{EngineEvent, Frame};
use super::input::{Input, LineId, LoadId, LoadNews, NewTake, Request, Shell, TakeName};
use super::machine::Engine;
use super::run_summary::RunSummary;
use super::sources::Source;
use crate::characters::LoadedCharacter;
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::streams::Streams;
use crate::{settings, takes};

/// Receives what the engine reports.
pub trait Listener {
    /// Receives an event. `Break` makes the engine quit.
    fn hear(&mut self, event: EngineEvent) -> ControlFlow<()>;

    /// Sees each new pose and the weights of shapes. `seconds`: the device's clock. Must not take long.
    fn posed(&mut self, seconds: f64, model_from_bone: &[Affine3A], shapes: &ShapeWeights) {
        let _ = (seconds, model_from_bone, shapes);
    }

    /// A frame to fill, with the buffers of an earlier one if there is one.
    fn frame_buffer(&mut self) -> Box<Frame> {
        Box::default()
    }
}

impl<F: FnMut(EngineEvent) -> ControlFlow<()>> Listener for F {
    fn hear(&mut self, event: EngineEvent) -> ControlFlow<()> {
        self(event)
    }
}

/// Drives an engine until it is over: with the `first` inputs, then with those of the source.
pub fn drive<S: Source>(
    engine: &mut Engine,
    source: &mut S,
    first: impl IntoIterator<Item = Input>,
    listener: &mut dyn Listener,
) {
    let mut first = first.into_iter();
    let mut heard_enough = false;
    while !engine.is_over() {
        let input = if std::mem::take(&mut heard_enough) {
            Input::Command(Command::Quit)
        } else {
            first.next().unwrap_or_else(|| source.next(engine.wakes_at()))
        };
        let mut shell = Driver { source, listener, heard_enough: false };
        engine.handle(shell.source.now(), input, &mut shell);
        heard_enough = shell.heard_enough;
    }
}

/// Drives a whole run of this character by a puppet. `heard` receives what is reported along the way, `streams` every
/// pose.
///
/// An error means that there is no result. Trouble along the way is in the summary.
pub fn drive_run<S: Source>(
    engine: &mut Engine,
    source: &mut S,
    character: Arc<LoadedCharacter>,
    device: &str,
    plan: RunPlan,
    streams: Option<&Streams>,
    heard: &mut dyn FnMut(EngineEvent),
) -> Result<RunSummary, Failure> {
    let first = with_puppet(Command::Run(Box::new(plan)), character, device);
    let mut audience = Audience { heard, streams, over: None };
    drive(engine, source, first, &mut audience);
    audience.over.unwrap_or_else(|| Err(ended_by_itself()))
}

/// Who follows a run.
struct Audience<'a> {
    heard: &'a mut dyn FnMut(EngineEvent),
    streams: Option<&'a Streams>,
    over: Option<Result<RunSummary, Failure>>,
}

impl Listener for Audience<'_> {
    fn hear(&mut self, event: EngineEvent) -> ControlFlow<()> {
        match event {
            EngineEvent::RunOver(outcome) => {
                self.over = Some(*outcome);
                ControlFlow::Break(())
            }
            event => {
                (self.heard)(event);
                ControlFlow::Continue(())
            }
        }
    }

    fn posed(&mut self, seconds: f64, model_from_bone: &[Affine3A], shapes: &ShapeWeights) {
        if let Some(streams) = self.streams {
            streams.pose(seconds, model_from_bone, shapes);
        }
    }
}

/// Drives calibration steps to the end of the last one; returns a report for each. `heard` receives what is reported
/// along the way.
///
/// A step without a result is an error, whatever the earlier steps found.
pub fn drive_calibration<S: Source>(
    engine: &mut Engine,
    source: &mut S,
    character: Arc<LoadedCharacter>,
    device: &str,
    steps: &[CalibrationStep],
    heard: &mut dyn FnMut(EngineEvent),
) -> Result<Vec<StepReport>, Failure> {
    let mut over = None;
    let first = with_puppet(Command::CalibrateAll(steps.to_vec()), character, device);
    drive(engine, source, first, &mut |event| match event {
        EngineEvent::CalibrationOver(outcome) => {
            over = Some(outcome);
            ControlFlow::Break(())
        }
        event => {
            heard(event);
            ControlFlow::Continue(())
        }
    });
    over.unwrap_or_else(|| Err(ended_by_itself()))
}

/// A task, and the character and puppet to do it with. The task comes first, so that it ends with whatever goes wrong.
fn with_puppet(task: Command, character: Arc<LoadedCharacter>, device: &str) -> [Input; 3] {
    let news = LoadNews::Over(Ok((character, Vec::new())));
    let loaded = Input::Loaded { load: LoadId::BROUGHT_ALONG, news };
    [Input::Command(task), loaded, Input::Command(Command::Connect(device.to_owned()))]
}

fn ended_by_itself() -> Failure {
    Failure::device("the engine ended by itself", "this is a defect; please report it")
}

struct Driver<'a, S> {
    source: &'a mut S,
    listener: &'a mut dyn Listener,
    heard_enough: bool,
}

impl<S: Source> Shell for Driver<'_, S> {
    fn tell(&mut self, event: EngineEvent) {
        self.heard_enough |= self.listener.hear(event).is_break();
    }

    fn ask(&mut self, request: Request) {
        self.source.fulfil(request);
    }

    fn posed(&mut self, seconds: f64, model_from_bone: &[Affine3A], shapes: &ShapeWeights) {
        self.listener.posed(seconds, model_from_bone, shapes);
    }

    fn age(&self, at: f64) -> Option<Duration> {
        self.source.age(at)
    }

    fn is_stopped(&mut self) -> bool {
        self.heard_enough || self.source.is_stopped()
    }

    fn frame_buffer(&mut self) -> Box<Frame> {
        self.listener.frame_buffer()
    }

    fn create_take(&mut self, name: TakeName) -> Result<NewTake, Failure> {
        let (path, overwrite) = match name {
            TakeName::Path { path, overwrite } => (path, overwrite),
            TakeName::After(character) => {
                (takes::free_name(&settings::takes_folder()?, &character), Overwrite::default())
            }
            TakeName::Beside(take) => {
                let name = format!("{} over", take.file_stem().unwrap_or_default().to_string_lossy());
                let folder = take.parent().unwrap_or(std::path::Path::new(""));
                (takes::free_name(folder, &name), Overwrite::default())
            }
        };
        let file = Box::new(takes::create(&path, overwrite)?);
        let on_real_clock = self.source.age(0.0).is_some();
        Ok(NewTake { path, file, unix_micros: on_real_clock.then(settings::unix_micros).flatten() })
    }

    fn keep_calibration(&mut self, line: LineId, calibration: &Calibration) -> Result<(), Failure> {
        self.source.keep_calibration(line, calibration)
    }
}
