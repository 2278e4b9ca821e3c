//! Puppets on real lines, in real time: connecting, listening and loading run alongside the engine, and all of it
//! arrives in its single inbox.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use armature_device::servo::ServoSettings;
use armature_device::{Connection, ConnectionSettings, DeviceAddress, DeviceProblem, PartUid};
use armature_rig::{Calibration, PuppetHints};
use tokio::runtime::Runtime;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

use super::Source;
use super::address::{parse_address, problem_failure, served_address};
use super::arms::shared_calibration;
use super::loading::Loads;
use super::second_process::SimulatedPuppet;
use super::simulated::{self, SimulatedArgs};
use super::working::Works;
use crate::characters::skin::SkinArgs;
use crate::descriptors;
use crate::engine::command::Command;
use crate::engine::event::{FoundDevice, Problem};
use crate::engine::inbox::{Inbox, InboxSender};
use crate::engine::input::{Input, LineId, LineNews, OpenLine, Request};
use crate::failure::Failure;
use crate::settings;
use crate::terminal::on_request_to_end;

/// How lines are opened.
#[derive(Clone, Debug, Default)]
pub struct LiveSettings {
    /// What simulated puppets do.
    pub simulated: SimulatedArgs,
    /// What may be done to a servo arm.
    pub servos: ServoSettings,
    /// Whether each puppet gets the calibration saved for this user, and new ones are saved there.
    pub keeps_calibration: bool,
    /// Whether Ctrl-C, once a line is open, makes the engine quit instead of ending the program. A second one ends the
    /// program at once.
    pub catches_interrupt: bool,
    /// How the skins of characters that are loaded follow their bones; `None` as their files say.
    pub skin: SkinArgs,
}

/// Puppets on real lines. A simulated one runs in a second process, which ends with its line.
#[derive(Debug)]
pub struct LiveSource {
    inbox: Inbox,
    opener: Opener,
    loads: Loads,
    works: Works,
}

/// What a thread that opens a line needs.
#[derive(Clone, Debug)]
struct Opener {
    settings: LiveSettings,
    runtime: Arc<Runtime>,
    began: Instant,
    inbox: InboxSender,
    lines: Arc<Mutex<Lines>>,
}

#[derive(Debug, Default)]
struct Lines {
    open: BTreeMap<LineId, LineHandle>,
    interrupt_is_caught: bool,
}

#[derive(Debug)]
struct LineHandle {
    wishes: UnboundedSender<Wish>,
    calibration_file: Option<PathBuf>,
}

/// An open line that nothing listens to yet.
struct Opened {
    connection: Connection,
    process: Option<SimulatedPuppet>,
    calibration_file: Option<PathBuf>,
    line: OpenLine,
}

#[derive(Clone, Copy, Debug)]
enum Wish {
    Stream { rate_millihertz: u32 },
    Blink { uid: PartUid, millis: u16 },
    Close,
}

impl LiveSource {
    /// A source that feeds the engine from this inbox. Its time starts now.
    pub fn new(inbox: Inbox, settings: LiveSettings) -> Result<Self, Failure> {
        descriptors::check()?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .thread_name("device")
            .build()
            .map_err(|e| Failure::device(format!("no thread for the device: {e}"), "close other programs"))?;
        let opener = Opener {
            settings,
            runtime: Arc::new(runtime),
            began: Instant::now(),
            inbox: inbox.sender(),
            lines: Arc::default(),
        };
        Ok(Self { inbox, opener, loads: Loads::default(), works: Works::default() })
    }

    fn wish(&self, line: LineId, wish: Wish) {
        let lines = self.opener.lines.lock().unwrap_or_else(PoisonError::into_inner);
        // A line that has ended needs no more requests.
        if lines.open.get(&line).is_none_or(|handle| handle.wishes.send(wish).is_err()) {
            tracing::debug!(?line, ?wish, "the line has ended");
        }
    }
}

impl Source for LiveSource {
    fn next(&mut self, until: Option<f64>) -> Input {
        let patience = until.map(|until| (until - self.now()).max(0.0));
        let patience = patience.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        self.inbox.next(patience).unwrap_or(Input::Tick)
    }

    fn is_stopped(&mut self) -> bool {
        self.inbox.is_stopped()
    }

    fn now(&self) -> f64 {
        self.opener.began.elapsed().as_secs_f64()
    }

    fn age(&self, at: f64) -> Option<Duration> {
        Some(Duration::try_from_secs_f64(self.now() - at).unwrap_or_default())
    }

    fn fulfil(&mut self, request: Request) {
        match request {
            Request::Connect { line, address } => {
                let opener = self.opener.clone();
                std::thread::spawn(move || opener.connect(line, &address));
            }
            Request::Stream { line, samples_per_second } => {
                let rate_millihertz = (samples_per_second * 1000.0).round() as u32;
                self.wish(line, Wish::Stream { rate_millihertz });
            }
            Request::Blink { line, uid, millis } => self.wish(line, Wish::Blink { uid, millis }),
            Request::Close(line) => {
                self.wish(line, Wish::Close);
                self.opener.lines.lock().unwrap_or_else(PoisonError::into_inner).open.remove(&line);
            }
            Request::Load { load, source } => {
                self.loads.begin(load, source, self.opener.settings.skin, self.opener.inbox.clone());
            }
            Request::CancelLoad(load) => self.loads.cancel(load),
            Request::Work { work, order } => self.works.begin(work, order, self.opener.inbox.clone()),
            Request::CancelWork(work) => self.works.cancel(work),
            Request::ListDevices => {
                let inbox = self.opener.inbox.clone();
                std::thread::spawn(move || inbox.send(Input::Listed(list_devices())));
            }
        }
    }

    fn keep_calibration(&mut self, line: LineId, calibration: &Calibration) -> Result<(), Failure> {
        let lines = self.opener.lines.lock().unwrap_or_else(PoisonError::into_inner);
        let path = lines.open.get(&line).and_then(|handle| handle.calibration_file.clone());
        drop(lines);
        path.map_or(Ok(()), |path| settings::write_calibration(&path, calibration))
    }
}

impl Opener {
    /// Opens a line and listens to it until it is closed. Blocks until it is open.
    fn connect(&self, line: LineId, address: &str) {
        let opened = match self.open(address) {
            Ok(opened) => opened,
            Err(failure) => {
                self.inbox.send(Input::Connected { line, outcome: Err(failure) });
                return;
            }
        };
        let (wishes, heeded) = unbounded_channel();
        let handle = LineHandle { wishes, calibration_file: opened.calibration_file };
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.open.insert(line, handle);
        let catches_interrupt =
            self.settings.catches_interrupt && !std::mem::replace(&mut lines.interrupt_is_caught, true);
        drop(lines);
        if catches_interrupt {
            let inbox = self.inbox.clone();
            on_request_to_end(move || inbox.send(Input::Command(Command::Quit)));
        }
        // The line's news comes after this.
        self.inbox.send(Input::Connected { line, outcome: Ok(opened.line) });
        self.runtime.spawn(carry(line, opened.connection, opened.process, heeded, self.inbox.clone()));
    }

    /// What is known of a puppet before it describes itself.
    fn hints(&self, device: &DeviceAddress) -> PuppetHints {
        if let DeviceAddress::Sim { name } = device {
            return simulated::hints(&self.settings.simulated.options(name));
        }
        PuppetHints::default()
    }

    fn open(&self, device: &str) -> Result<Opened, Failure> {
        let parsed = parse_address(device)?;
        let (address, process) = match &parsed {
            DeviceAddress::Sim { name } => {
                let process = SimulatedPuppet::start(name, &self.settings.simulated)?;
                (served_address(&process, name)?, Some(process))
            }
            other => (other.clone(), None),
        };
        // The simulated puppet's process is ours: when its line is gone, so is the puppet.
        let settings = ConnectionSettings {
            servos: self.settings.servos,
            reopen: process.is_none(),
            ..ConnectionSettings::default()
        };
        let opening = Connection::open(self.runtime.handle(), &address, settings);
        let connection = self.runtime.block_on(opening).map_err(|e| problem_failure(&e))?;
        let kept = settings::calibration_file().filter(|_| process.is_none());
        let calibration = self
            .settings
            .keeps_calibration
            .then(|| kept.as_deref().map_or_else(|| Ok(Calibration::default()), settings::read_calibration));
        // One that cannot be read is not overwritten.
        let calibration_file = kept.filter(|_| matches!(calibration, Some(Ok(_))));
        let line = OpenLine {
            doubts: doubts(&address, calibration.as_ref().and_then(|read| read.as_ref().ok())),
            address: address.to_string(),
            process: process.as_ref().map(SimulatedPuppet::process_id),
            began: connection.began().saturating_duration_since(self.began).as_secs_f64(),
            calibration,
            hints: self.hints(&parsed),
        };
        Ok(Opened { connection, process, calibration_file, line })
    }
}

/// What to say of an address before anything is known of the device there.
fn doubts(address: &DeviceAddress, kept: Option<&Calibration>) -> Vec<Problem> {
    let shared = shared_calibration(address, kept, &|| armature_device::list_devices().devices);
    shared.into_iter().chain(ambiguous_link(address)).collect()
}

/// A link by a board's serial number, where another board has the same.
fn ambiguous_link(address: &DeviceAddress) -> Option<Problem> {
    let path = std::path::Path::new(address.serial_path()?);
    let port = std::fs::canonicalize(path).ok().filter(|real| path.is_symlink() && real != path)?;
    let is_about = |problem: &&DeviceProblem| {
        let DeviceProblem::OneSerialNumber { ports, .. } = problem else { return false };
        ports.split(" and ").any(|one| std::path::Path::new(one) == port)
    };
    armature_device::list_devices().problems.iter().find(is_about).map(|problem| Problem::of(problem))
}

/// Passes on a line's news and fulfils the engine's requests until it is to be closed.
async fn carry(
    line: LineId,
    mut connection: Connection,
    process: Option<SimulatedPuppet>,
    mut wishes: UnboundedReceiver<Wish>,
    inbox: InboxSender,
) {
    let mut is_over = false;
    loop {
        tokio::select! {
            biased;
            wish = wishes.recv() => match wish {
                Some(Wish::Stream { rate_millihertz }) => connection.start(rate_millihertz),
                Some(Wish::Blink { uid, millis }) => connection.blink(uid, millis),
                Some(Wish::Close) | None => break,
            },
            event = connection.next(), if !is_over => {
                is_over = event.is_none();
                let news = event.map_or(LineNews::Over, LineNews::Event);
                let counters = connection.counters();
                if !inbox.send_from_device(Input::Device { line, counters, news }).await {
                    break;
                }
            }
        }
    }
    let counters = connection.close().await;
    drop(process);
    inbox.send(Input::Device { line, counters, news: LineNews::Closed });
}

fn list_devices() -> Result<Vec<FoundDevice>, Failure> {
    let plugged = armature_device::list_devices();
    if let Some(problem) = plugged.problems.first().filter(|_| plugged.devices.is_empty()) {
        return Err(problem_failure(problem));
    }
    let found = plugged.devices.into_iter().map(|device| {
        let board = device.board().map(|board| board.name.to_owned());
        let address = device.guessed_address().to_string();
        let product = device.usb.and_then(|usb| usb.product);
        FoundDevice { address, label: board.or(product).unwrap_or_else(|| "serial port".into()) }
    });
    Ok(found.collect())
}
