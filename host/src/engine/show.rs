//! The window's engine: a thread that owns the puppet, the character and the take, and tells the window.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use armature_device::{DeviceProblem, Event};
use armature_rig::{Calibration, Progress, StepError, StepReport, StepTimes};
use armature_take::Header;

use super::actor::Actor;
use super::calibrating::step_failure;
use super::completion::IkArgs;
use super::live::{Live, parse_address};
use super::perform::{Next, Source};
use super::performance::{Performance, ZeroPolicy};
use super::recorder::{create_take, free_take_name};
use super::stage::Stage;
use super::{frames, frames::FrameClock};
use crate::app::engine::{CharacterChoice, Command, EngineEvent, EngineLink, FoundDevice, Problem};
use crate::characters::{self, Found};
use crate::engine::simulated::SimulatedArgs;
use crate::failure::Failure;
use crate::{files, settings};

/// How long one look for an event or a command may take.
const PATIENCE: Duration = Duration::from_millis(8);
/// Events handled before commands are looked at again.
const EVENTS_AT_ONCE: usize = 256;
const SAMPLES_PER_SECOND: f64 = 250.0;
const BLINK_MILLIS: u16 = 2_000;

/// The character that a name or path on the command line means.
pub fn choice(character: &str) -> CharacterChoice {
    match character {
        "human" => CharacterChoice::Human,
        "spider" => CharacterChoice::Spider,
        "hand" => CharacterChoice::Hand,
        file => CharacterChoice::File(file.into()),
    }
}

fn source_of(choice: &CharacterChoice) -> String {
    match choice {
        CharacterChoice::Human => "human".into(),
        CharacterChoice::Spider => "spider".into(),
        CharacterChoice::Hand => "hand".into(),
        CharacterChoice::File(path) => path.display().to_string(),
    }
}

/// Starts the engine's thread; it ends at [`Command::Quit`].
pub fn spawn(link: EngineLink) -> JoinHandle<()> {
    std::thread::spawn(move || {
        Show { link, stage: None, live: None, connecting: None, loading: None, clock: FrameClock::default() }.run();
    })
}

type Pending<T> = Receiver<Result<T, Failure>>;

struct Loading {
    found: Pending<Found>,
    cancel: Arc<AtomicBool>,
}

struct Connected {
    live: Live,
    address: String,
    calibration_file: Option<PathBuf>,
    take: Option<PathBuf>,
}

/// What one round of listening to the puppet brought.
#[derive(Default)]
struct Heard {
    posed: bool,
    new_topology: bool,
    told: Vec<EngineEvent>,
    calibrated: Option<Result<StepReport, StepError>>,
    ended: Option<DeviceProblem>,
}

struct Show {
    link: EngineLink,
    stage: Option<Stage<BufWriter<File>>>,
    live: Option<Connected>,
    connecting: Option<(String, Pending<Live>)>,
    loading: Option<Loading>,
    clock: FrameClock,
}

impl Show {
    fn run(&mut self) {
        loop {
            let command =
                if self.live.is_some() { self.link.try_command() } else { self.link.wait_for_command(PATIENCE) };
            match command {
                Some(Command::Quit) => break,
                Some(command) => {
                    if let Err(failure) = self.obey(command) {
                        self.tell_problem(&failure);
                    }
                }
                None => {}
            }
            self.look_after_loading();
            self.look_after_connecting();
            if let Err(failure) = self.look_after_puppet() {
                self.tell_problem(&failure);
            }
        }
        if let Err(failure) = self.disconnect(None) {
            tracing::error!("{failure}");
        }
    }

    fn tell_problem(&self, failure: &Failure) {
        self.link.send(EngineEvent::Problem(problem(failure)));
    }

    fn obey(&mut self, command: Command) -> Result<(), Failure> {
        match command {
            Command::Connect(address) => self.connect(address),
            Command::Disconnect => self.disconnect(None),
            Command::ListDevices => self.list_devices(),
            Command::Zero => {
                self.stage.iter_mut().for_each(Stage::request_zero);
                Ok(())
            }
            Command::Calibrate(step) => {
                if let (Some(stage), Some(connected)) = (&mut self.stage, &self.live) {
                    stage.begin_calibration(step, StepTimes::default(), connected.live.now());
                }
                Ok(())
            }
            Command::StartRecording => self.start_recording(),
            Command::StopRecording => self.stop_recording(),
            Command::LoadCharacter(choice) => self.load(&choice),
            Command::Cancel => {
                if let Some(loading) = &self.loading {
                    loading.cancel.store(true, Ordering::Relaxed);
                }
                self.end_calibration();
                Ok(())
            }
            Command::Blink(uid) => {
                if let Some(connected) = &self.live {
                    connected.live.blink(armature_device::PartUid(uid.0), BLINK_MILLIS);
                }
                Ok(())
            }
            Command::Quit => Ok(()),
        }
    }

    fn connect(&mut self, address: String) -> Result<(), Failure> {
        self.disconnect(None)?;
        self.link.send(EngineEvent::Connecting { address: address.clone() });
        let (sender, receiver) = mpsc::channel();
        let asked = address.clone();
        std::thread::spawn(move || {
            // Nobody waits any more if the user changed their mind.
            let _ = sender.send(Live::connect(&asked, &SimulatedArgs::default()));
        });
        self.connecting = Some((address, receiver));
        Ok(())
    }

    fn look_after_connecting(&mut self) {
        let Some((address, pending)) = &self.connecting else { return };
        let outcome = match pending.try_recv() {
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err(Failure::device("connecting ended by itself", "try again")),
            Ok(outcome) => outcome,
        };
        let address = address.clone();
        self.connecting = None;
        match outcome {
            Ok(live) => {
                live.start(SAMPLES_PER_SECOND);
                self.clock = FrameClock::default();
                let simulated =
                    parse_address(&address).is_ok_and(|a| matches!(a, armature_device::DeviceAddress::Sim { .. }));
                let calibration_file = settings::calibration_file().filter(|_| !simulated);
                self.live = Some(Connected { live, address, calibration_file, take: None });
                if let Err(failure) = self.take_calibration() {
                    self.tell_problem(&failure);
                }
            }
            Err(failure) => self.link.send(EngineEvent::Disconnected { problem: Some(problem(&failure)) }),
        }
    }

    /// Puts the character on a fresh stage with the calibration that belongs to the puppet.
    fn take_calibration(&mut self) -> Result<(), Failure> {
        let Some(actor) = self.stage.as_ref().map(|s| s.performance().actor().clone()) else { return Ok(()) };
        let performance = Performance::new(actor, None, self.kept_calibration()?, ZeroPolicy::WhenUnknown)?;
        self.stage = Some(Stage::new(performance.with_inverse_kinematics(&IkArgs::default())?));
        Ok(())
    }

    /// The calibration that is kept for the connected puppet; empty for a simulated one.
    fn kept_calibration(&self) -> Result<Calibration, Failure> {
        let file = self.live.as_ref().and_then(|c| c.calibration_file.as_deref());
        Ok(file.map(settings::read_calibration).transpose()?.unwrap_or_default())
    }

    fn disconnect(&mut self, why: Option<Problem>) -> Result<(), Failure> {
        self.connecting = None;
        self.end_calibration();
        let saved = self.stop_recording();
        if let Some(connected) = self.live.take() {
            connected.live.close();
            self.stage.iter_mut().for_each(Stage::forget_puppet);
            self.link.send(EngineEvent::Disconnected { problem: why });
        }
        saved
    }

    fn list_devices(&self) -> Result<(), Failure> {
        let plugged = armature_device::list_devices();
        if let Some(problem) = plugged.problems.first().filter(|_| plugged.devices.is_empty()) {
            return Err(Failure::device(problem.to_string(), ""));
        }
        let found = plugged.devices.into_iter().map(|device| {
            let product = device.usb.and_then(|usb| usb.product);
            FoundDevice { address: device.address.to_string(), label: product.unwrap_or_else(|| "serial port".into()) }
        });
        self.link.send(EngineEvent::Devices(found.collect()));
        Ok(())
    }

    fn load(&mut self, choice: &CharacterChoice) -> Result<(), Failure> {
        if self.stage.as_ref().and_then(Stage::recorded).is_some() {
            return Err(Failure::usage("a take is being recorded", "stop recording before you change the character"));
        }
        if let Some(former) = self.loading.take() {
            former.cancel.store(true, Ordering::Relaxed);
        }
        let source = source_of(choice);
        let (sender, found) = mpsc::channel();
        let cancel = Arc::new(AtomicBool::new(false));
        let (outbox, cancelled) = (self.link.outbox(), cancel.clone());
        std::thread::spawn(move || {
            let mut progress = |p: armature_character::BindProgress| {
                outbox.send(EngineEvent::Busy { task: p.stage.to_string(), fraction: Some(p.done as f32) });
                if cancelled.load(Ordering::Relaxed) {
                    std::ops::ControlFlow::Break(())
                } else {
                    std::ops::ControlFlow::Continue(())
                }
            };
            let found = characters::find(&source, &mut progress);
            // Nobody waits any more if another character was chosen meanwhile.
            let _ = sender.send(found);
        });
        self.loading = Some(Loading { found, cancel });
        Ok(())
    }

    fn look_after_loading(&mut self) {
        let Some(loading) = &self.loading else { return };
        let outcome = match loading.found.try_recv() {
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => {
                Err(Failure::input("loading ended by itself", "choose the character again"))
            }
            Ok(outcome) => outcome,
        };
        let cancelled = loading.cancel.load(Ordering::Relaxed);
        self.loading = None;
        self.link.send(EngineEvent::Idle);
        let entered = outcome.and_then(|found| {
            for warning in &found.warnings {
                tracing::warn!("{warning}");
            }
            self.enter(&Arc::new(found.actor))
        });
        match entered {
            Err(failure) if !cancelled => self.tell_problem(&failure),
            _ => {}
        }
    }

    fn enter(&mut self, actor: &Arc<Actor>) -> Result<(), Failure> {
        let calibration = match &self.stage {
            Some(stage) => stage.performance().calibration().clone(),
            None => self.kept_calibration()?,
        };
        let performance = Performance::new(actor.clone(), None, calibration, ZeroPolicy::WhenUnknown)?
            .with_inverse_kinematics(&IkArgs::default())?;
        self.link.send(EngineEvent::CharacterLoaded(Arc::new(frames::view_of(actor))));
        match &mut self.stage {
            Some(stage) => stage.replace_performance(performance),
            None => self.stage = Some(Stage::new(performance)),
        }
        self.tell_topology();
        Ok(())
    }

    fn tell_topology(&self) {
        let Some(stage) = &self.stage else { return };
        let Some(tree) = stage.tree() else { return };
        self.link.send(EngineEvent::Topology { tree: Arc::new(tree.clone()) });
        self.link.send(EngineEvent::Mapping {
            bone_of_part: frames::bone_of_part(tree, stage.performance()),
            solved: frames::solved_bones(stage.performance()),
        });
    }

    fn look_after_puppet(&mut self) -> Result<(), Failure> {
        let mut heard = Heard::default();
        let listened = self.listen(&mut heard);
        if let Some(finished) = heard.calibrated.take() {
            self.calibrated(finished)?;
        }
        heard.told.into_iter().for_each(|event| self.link.send(event));
        if heard.new_topology {
            self.tell_topology();
        }
        if heard.posed {
            self.tell_frame();
        }
        listened?;
        self.look_after_calibration()?;
        match heard.ended {
            Some(trouble) => self.disconnect(Some(Problem { what: trouble.to_string(), remedy: String::new() })),
            None => Ok(()),
        }
    }

    /// Tells where the calibration step that is under way stands; ends it where no sample comes to do so.
    fn look_after_calibration(&mut self) -> Result<(), Failure> {
        let (Some(stage), Some(connected)) = (&mut self.stage, &self.live) else { return Ok(()) };
        let now = connected.live.now();
        let (words, left, instruction) = match stage.calibration_progress(now) {
            Some(Progress::Countdown { seconds_left, instruction }) => ("Get ready", seconds_left, instruction),
            Some(Progress::Measuring { seconds_left, instruction }) => ("Measuring", seconds_left, instruction),
            Some(Progress::Over) => {
                return match stage.calibrate(now)? {
                    Some(finished) => self.calibrated(finished),
                    None => Ok(()),
                };
            }
            None => return Ok(()),
        };
        let task = format!("{words}, {:.0} s: {instruction}", left.ceil());
        self.link.send(EngineEvent::Busy { task, fraction: None });
        Ok(())
    }

    fn calibrated(&mut self, finished: Result<StepReport, StepError>) -> Result<(), Failure> {
        self.link.send(EngineEvent::Idle);
        let report = finished.map_err(|error| step_failure(&error))?;
        let failed = report.findings.iter().filter(|found| found.finding.is_bad()).count();
        let measured = report.findings.len() - failed;
        self.link.send(EngineEvent::Calibrated { step: report.step, measured, failed });
        match (&self.live, &self.stage) {
            (Some(connected), Some(stage)) => save_calibration(connected, stage),
            _ => Ok(()),
        }
    }

    /// Gives up the calibration step that is under way.
    fn end_calibration(&mut self) {
        let Some(stage) = &mut self.stage else { return };
        if stage.calibration_progress(0.0).is_some() {
            stage.cancel_calibration();
            self.link.send(EngineEvent::Idle);
        }
    }

    /// Lets the events that wait take effect.
    fn listen(&mut self, heard: &mut Heard) -> Result<(), Failure> {
        let (Some(connected), Some(stage)) = (&mut self.live, &mut self.stage) else { return Ok(()) };
        for _ in 0..EVENTS_AT_ONCE {
            let patience = if heard.posed { Duration::ZERO } else { PATIENCE };
            let event = match connected.live.next_within(patience) {
                Next::Event(event) => event,
                Next::Quiet => return Ok(()),
                Next::Over => {
                    heard.ended = Some(DeviceProblem::Disconnected { reason: "the line was closed".into() });
                    return Ok(());
                }
            };
            let outcome = stage.handle(&event)?;
            heard.posed |= outcome.posed;
            if let Some(finished) = outcome.calibrated {
                heard.calibrated = Some(finished);
            }
            if let Some(report) = &outcome.zeroed {
                heard.told.push(EngineEvent::Zeroed { sensors: report.zeroed, unreadable: report.skipped.len() });
                save_calibration(connected, stage)?;
            }
            match event {
                Event::Sample(sample) => {
                    self.clock.sample(connected.live.age(sample.received).unwrap_or_default(), Instant::now());
                }
                Event::Connected(info) => heard.told.push(EngineEvent::Connected {
                    address: connected.address.clone(),
                    device: frames::device_line(&info),
                }),
                Event::Problem(problem @ DeviceProblem::Disconnected { .. }) => {
                    heard.ended = Some(problem);
                    return Ok(());
                }
                Event::Notice(notice) => {
                    heard.told.push(EngineEvent::Problem(Problem { what: notice.to_string(), remedy: String::new() }));
                }
                Event::Problem(trouble) => {
                    heard.told.push(EngineEvent::Problem(Problem { what: trouble.to_string(), remedy: String::new() }));
                }
                _ => {}
            }
            if outcome.new_topology {
                heard.new_topology = true;
                return Ok(());
            }
        }
        Ok(())
    }

    fn tell_frame(&mut self) {
        let (Some(stage), Some(connected)) = (&self.stage, &self.live) else { return };
        let mut frame = self.link.frame_buffer();
        frames::fill(&mut frame, stage, &self.clock, &connected.live.counters());
        self.link.send(EngineEvent::Frame(frame));
        if let Some(recorded) = stage.recorded() {
            self.link
                .send(EngineEvent::Recording { seconds: recorded.micros as f64 * 1e-6, samples: recorded.samples });
        }
    }

    fn start_recording(&mut self) -> Result<(), Failure> {
        let (Some(connected), Some(stage)) = (&mut self.live, &mut self.stage) else {
            return Err(Failure::usage("there is no puppet to record", "connect one first"));
        };
        if stage.recorded().is_some() {
            return Ok(());
        }
        if !stage.is_ready() {
            return Err(Failure::usage(
                "the rest pose is not known yet",
                "hold the puppet in its rest pose and press Zero",
            ));
        }
        let actor = stage.performance().actor().clone();
        let name = files::name_of(std::path::Path::new(&actor.name));
        let path = free_take_name(&settings::takes_folder(), &name);
        let header = Header {
            program_version: env!("CARGO_PKG_VERSION").into(),
            character_name: actor.source.clone(),
            character_hash: actor.content_hash(),
            nominal_samples_per_second: Some(SAMPLES_PER_SECOND),
            unix_micros: settings::unix_micros(),
            ..Header::default()
        };
        stage.start_recording(create_take(&path)?, &path.display().to_string(), &header, connected.live.now())?;
        connected.take = Some(path);
        self.link.send(EngineEvent::Recording { seconds: 0.0, samples: 0 });
        Ok(())
    }

    fn stop_recording(&mut self) -> Result<(), Failure> {
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let Some((out, recorded)) = stage.stop_recording()? else { return Ok(()) };
        let path = self.live.as_mut().and_then(|c| c.take.take()).unwrap_or_default();
        let written = out.into_inner().map_err(std::io::IntoInnerError::into_error).and_then(|file| file.sync_all());
        written.map_err(|e| Failure::input(format!("{}: {e}", path.display()), "make room on the disk"))?;
        let seconds = recorded.micros as f64 * 1e-6;
        self.link.send(EngineEvent::Saved { path, seconds, samples: recorded.samples, lost: recorded.lost });
        Ok(())
    }
}

fn save_calibration(connected: &Connected, stage: &Stage<BufWriter<File>>) -> Result<(), Failure> {
    let Some(path) = &connected.calibration_file else { return Ok(()) };
    settings::write_calibration(path, stage.performance().calibration())
}

fn problem(failure: &Failure) -> Problem {
    Problem { what: failure.what.clone(), remedy: failure.remedy.clone() }
}
