//! What the window and the engine say to each other, and the link that carries it.
//!
//! The engine (device session → rig → skin) runs on its own thread and owns every file, port and clock; the window
//! only shows the latest [`EngineEvent`]s and sends [`Command`]s. A recorded list of events replays a whole session.
//!
//! The way from engine to window never grows without bound: of frames, busy notes and recording clocks only the
//! newest waits, a problem that waits already is not queued twice, and beyond [`EVENT_CAPACITY`] the oldest waiting
//! event gives way (and is counted).

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use armature_geometry::Influences;
use armature_rig::{CalibrationStep, JointTree, PartUid, SensorState, Skeleton};

/// How many events may wait for the window.
pub const EVENT_CAPACITY: usize = 256;

/// What the window asks of the engine.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Connect to a device address: `sim:human`, `sim:spider`, `sim:hand`, `serial:PATH`, `tcp:HOST:PORT`.
    /// A connection that stands is closed first.
    Connect(String),
    /// Close the connection; a recording is finished and saved first.
    Disconnect,
    /// Look for serial ports; answered by [`EngineEvent::Devices`].
    ListDevices,
    /// The puppet is in the rest pose now: make this zero.
    Zero,
    /// Begin a calibration step: [`EngineEvent::Busy`] tells what the person is to do, [`EngineEvent::Calibrated`] what
    /// came of it.
    Calibrate(CalibrationStep),
    /// Begin a take; the engine chooses the file's name.
    StartRecording,
    /// Finish the take; answered by [`EngineEvent::Saved`].
    StopRecording,
    /// Make or read a character and show it.
    LoadCharacter(CharacterChoice),
    /// Give up the long work that [`EngineEvent::Busy`] told of.
    Cancel,
    /// Let one part blink, so that a hand can find it.
    Blink(PartUid),
    /// The window closes: finish a recording, close the connection, end the thread.
    Quit,
}

/// Which character to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CharacterChoice {
    /// Our own human figure.
    Human,
    /// Our own spider.
    Spider,
    /// Our own hand.
    Hand,
    /// A rigged or unrigged mesh file.
    File(PathBuf),
}

/// What the engine tells the window: all there is.
#[derive(Clone, Debug)]
pub enum EngineEvent {
    /// A connection is being made.
    Connecting {
        /// The device address.
        address: String,
    },
    /// The handshake succeeded.
    Connected {
        /// The device address.
        address: String,
        /// What the device calls itself, firmware and protocol version: one line for people.
        device: String,
    },
    /// There is no connection (any more).
    Disconnected {
        /// Why, when nobody asked for it.
        problem: Option<Problem>,
    },
    /// The puppet as it is plugged together now; comes again whenever a part is plugged or unplugged.
    Topology {
        /// Parts and sensors; [`Frame::angles`] and [`Frame::states`] are in its sensor order.
        tree: Arc<JointTree>,
    },
    /// Which bone follows which part; comes again with a new topology or character.
    Mapping {
        /// One entry a part: index of the bone in the character's skeleton.
        bone_of_part: Vec<Option<usize>>,
        /// For each bone of the skeleton whether inverse kinematics turns it; empty where it is off.
        solved: Vec<bool>,
    },
    /// The newest pose.
    Frame(Box<Frame>),
    /// Zero was taken.
    Zeroed {
        /// How many sensors have a zero now.
        sensors: usize,
        /// How many sensors could not be zeroed because they gave no good reading.
        unreadable: usize,
    },
    /// A calibration step is over.
    Calibrated {
        /// The step.
        step: CalibrationStep,
        /// Sensors or parts that it measured.
        measured: usize,
        /// Those that it could not measure; they keep what they had.
        failed: usize,
    },
    /// A take is being written.
    Recording {
        /// Device time since the take began.
        seconds: f64,
        /// Samples written.
        samples: u64,
    },
    /// A take is complete on disk.
    Saved {
        /// The file.
        path: PathBuf,
        /// Its length.
        seconds: f64,
        /// Samples in it.
        samples: u64,
        /// Samples that never arrived meanwhile.
        lost: u64,
    },
    /// The character to draw from now on; frames that follow belong to it.
    CharacterLoaded(Arc<CharacterView>),
    /// The serial ports (and other devices) found.
    Devices(Vec<FoundDevice>),
    /// Long work is going on.
    Busy {
        /// What, in the words of a person: "Computing weights".
        task: String,
        /// How much is done, 0 to 1, where that is known.
        fraction: Option<f32>,
    },
    /// The long work is over.
    Idle,
    /// Something went wrong; the session goes on.
    Problem(Problem),
}

/// What went wrong and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// One sentence: "The puppet stopped answering."
    pub what: String,
    /// One sentence: "Check the cable, then connect again."
    pub remedy: String,
}

/// A device somebody could connect to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// For [`Command::Connect`].
    pub address: String,
    /// Product name or the like.
    pub label: String,
}

/// All of a character that the window draws; never changes once loaded.
#[derive(Clone, Debug, Default)]
pub struct CharacterView {
    /// For the title: "Human", "Fox".
    pub name: String,
    /// The bones.
    pub skeleton: Skeleton,
    /// n rest positions, mesh units, +Y up, looking along +Z.
    pub positions: Vec<[f32; 3]>,
    /// n unit normals.
    pub normals: Vec<[f32; 3]>,
    /// m vertex triples, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// n texture coordinates as in glTF (origin at the upper left), or none.
    pub uv: Vec<[f32; 2]>,
    /// The base colour texture, if there is one.
    pub texture: Option<Texture>,
    /// sRGB, 0 to 1; multiplies the texture. `None`: the window's own clay.
    pub base_color: Option<[f32; 3]>,
    /// The weights, to show what follows a selected bone; may be absent.
    pub influences: Option<Influences>,
}

/// An image in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 4·width·height bytes, sRGB and alpha, rows from the top.
    pub rgba: Vec<u8>,
}

/// One moment of the puppet and the character. Buffers are kept and reused: see [`EngineLink::frame_buffer`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// n skinned positions in model space (empty: the rest positions).
    pub positions: Vec<[f32; 3]>,
    /// n skinned unit normals.
    pub normals: Vec<[f32; 3]>,
    /// Head and tail of every bone in model space.
    pub bones: Vec<([f32; 3], [f32; 3])>,
    /// Calibrated angle of every sensor in radians; meaningless where the state is `NoData`.
    pub angles: Vec<f32>,
    /// State of every sensor.
    pub states: Vec<SensorState>,
    /// How well the stream does.
    pub stats: Stats,
}

/// Counters since the connection was made; rates and percentiles over about the last second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Samples a second.
    pub samples_per_second: f32,
    /// Samples received.
    pub samples: u64,
    /// Samples that never arrived, by their running number.
    pub lost_samples: u64,
    /// Frames thrown away because of their checksum.
    pub crc_errors: u64,
    /// Pieces of the stream that were no frame; the decoder went on with the next frame.
    pub resyncs: u64,
    /// Last byte of a sample → skinned character: median.
    pub latency_p50_micros: f32,
    /// The same, 99th percentile.
    pub latency_p99_micros: f32,
}

/// Makes the two ends. `wake` is called after every event sent (from the engine's thread) so that the window draws.
pub fn link(wake: impl Fn() + Send + Sync + 'static) -> (AppLink, EngineLink) {
    let (command_sender, command_receiver) = mpsc::channel();
    let mailbox = Arc::new(Mailbox::default());
    let app = AppLink { commands: command_sender, mailbox: mailbox.clone() };
    let engine = EngineLink { outbox: EngineOutbox { mailbox, wake: Arc::new(wake) }, commands: command_receiver };
    (app, engine)
}

/// The window's end.
#[derive(Debug)]
pub struct AppLink {
    commands: Sender<Command>,
    mailbox: Arc<Mailbox>,
}

impl AppLink {
    /// Asks the engine for something. Returns whether an engine is there to hear it.
    pub fn send(&self, command: Command) -> bool {
        self.commands.send(command).is_ok()
    }

    /// The oldest event that waits.
    pub fn next_event(&self) -> Option<EngineEvent> {
        self.mailbox.lock().events.pop_front()
    }

    /// Gives a frame's buffers back for reuse.
    pub fn recycle(&self, frame: Box<Frame>) {
        self.mailbox.recycle(frame);
    }

    /// How many events had to give way because the window did not keep up.
    pub fn overflowed(&self) -> u64 {
        self.mailbox.lock().overflowed
    }
}

/// The engine's end: commands in, events out. [`EngineLink::outbox`] may be cloned to other threads.
#[derive(Debug)]
pub struct EngineLink {
    outbox: EngineOutbox,
    commands: Receiver<Command>,
}

impl EngineLink {
    /// Sends an event to the window; never blocks.
    pub fn send(&self, event: EngineEvent) {
        self.outbox.send(event);
    }

    /// A frame to fill, with the buffers of an earlier one where there is one.
    pub fn frame_buffer(&self) -> Box<Frame> {
        self.outbox.frame_buffer()
    }

    /// The sending half, for work on other threads (loading a character, a tokio task).
    pub fn outbox(&self) -> EngineOutbox {
        self.outbox.clone()
    }

    /// The next command, if one waits. [`Command::Quit`] when the window is gone.
    pub fn try_command(&self) -> Option<Command> {
        match self.commands.try_recv() {
            Ok(command) => Some(command),
            Err(mpsc::TryRecvError::Empty) => None,
            Err(mpsc::TryRecvError::Disconnected) => Some(Command::Quit),
        }
    }

    /// The next command, waiting for it at most so long. [`Command::Quit`] when the window is gone.
    pub fn wait_for_command(&self, timeout: Duration) -> Option<Command> {
        match self.commands.recv_timeout(timeout) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Command::Quit),
        }
    }
}

/// The sending half of the engine's end.
#[derive(Clone)]
pub struct EngineOutbox {
    mailbox: Arc<Mailbox>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl std::fmt::Debug for EngineOutbox {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EngineOutbox").finish_non_exhaustive()
    }
}

impl EngineOutbox {
    /// Sends an event to the window; never blocks.
    pub fn send(&self, event: EngineEvent) {
        self.mailbox.push(event);
        (self.wake)();
    }

    /// A frame to fill, with the buffers of an earlier one where there is one.
    pub fn frame_buffer(&self) -> Box<Frame> {
        self.mailbox.lock().spare_frames.pop().unwrap_or_default()
    }
}

#[derive(Debug, Default)]
struct Mailbox {
    queue: Mutex<Queue>,
}

#[derive(Debug, Default)]
struct Queue {
    events: VecDeque<EngineEvent>,
    #[expect(clippy::vec_box, reason = "frames travel in boxes; unpacking them here would allocate on every frame")]
    spare_frames: Vec<Box<Frame>>,
    overflowed: u64,
}

/// One is being filled, one waits, one is drawn.
const SPARE_FRAMES: usize = 3;

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // Every change below leaves the queue whole, so a panic elsewhere does not make it unusable.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn recycle(&self, frame: Box<Frame>) {
        let mut queue = self.lock();
        if queue.spare_frames.len() < SPARE_FRAMES {
            queue.spare_frames.push(frame);
        }
    }

    fn push(&self, event: EngineEvent) {
        let superseded = {
            let mut queue = self.lock();
            let superseded = queue.take_superseded(&event);
            if queue.events.len() >= EVENT_CAPACITY {
                queue.events.pop_front();
                queue.overflowed += 1;
            }
            queue.events.push_back(event);
            superseded
        };
        if let Some(EngineEvent::Frame(frame)) = superseded {
            self.recycle(frame);
        }
    }
}

impl Queue {
    /// Removes the waiting event that the new one makes pointless.
    fn take_superseded(&mut self, new: &EngineEvent) -> Option<EngineEvent> {
        let index = self.events.iter().rposition(|waiting| match (waiting, new) {
            (EngineEvent::Frame(_), EngineEvent::Frame(_))
            | (EngineEvent::Recording { .. }, EngineEvent::Recording { .. })
            | (EngineEvent::Busy { .. }, EngineEvent::Busy { .. })
            | (EngineEvent::Devices(_), EngineEvent::Devices(_)) => true,
            (EngineEvent::Problem(waiting), EngineEvent::Problem(new)) => waiting == new,
            _ => false,
        })?;
        self.events.remove(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(samples: u64) -> Box<Frame> {
        Box::new(Frame { stats: Stats { samples, ..Stats::default() }, ..Frame::default() })
    }

    #[test]
    fn the_latest_frame_wins_and_its_predecessor_is_reused() {
        let (app, engine) = link(|| {});
        for samples in 0..1000 {
            let mut buffer = engine.frame_buffer();
            if samples > 1 {
                assert!(buffer.positions.capacity() >= 100, "the buffer of an earlier frame comes back");
            }
            buffer.positions.resize(100, [0.0; 3]);
            buffer.stats.samples = samples;
            engine.send(EngineEvent::Frame(buffer));
        }
        let Some(EngineEvent::Frame(latest)) = app.next_event() else { panic!("a frame waits") };
        assert_eq!(latest.stats.samples, 999);
        assert!(app.next_event().is_none());
    }

    #[test]
    fn other_events_keep_their_order_around_frames() {
        let (app, engine) = link(|| {});
        engine.send(EngineEvent::Frame(frame(1)));
        engine.send(EngineEvent::CharacterLoaded(Arc::default()));
        engine.send(EngineEvent::Frame(frame(2)));
        assert!(matches!(app.next_event(), Some(EngineEvent::CharacterLoaded(_))));
        assert!(matches!(app.next_event(), Some(EngineEvent::Frame(f)) if f.stats.samples == 2));
    }

    #[test]
    fn a_window_that_sleeps_does_not_fill_the_memory() {
        let (app, engine) = link(|| {});
        for number in 0..EVENT_CAPACITY + 10 {
            let problem = Problem { what: format!("problem {number}"), remedy: String::new() };
            engine.send(EngineEvent::Problem(problem.clone()));
            engine.send(EngineEvent::Problem(problem));
        }
        assert_eq!(app.overflowed(), 10);
        assert_eq!(std::iter::from_fn(|| app.next_event()).count(), EVENT_CAPACITY);
    }

    #[test]
    fn an_engine_without_a_window_is_told_to_quit() {
        let (app, engine) = link(|| {});
        assert!(app.send(Command::Zero));
        drop(app);
        assert_eq!(engine.try_command(), Some(Command::Zero));
        assert_eq!(engine.try_command(), Some(Command::Quit));
        assert_eq!(engine.wait_for_command(Duration::from_millis(1)), Some(Command::Quit));
    }

    #[test]
    fn a_window_without_an_engine_knows_it() {
        let (app, engine) = link(|| {});
        drop(engine);
        assert!(!app.send(Command::Zero));
    }
}
