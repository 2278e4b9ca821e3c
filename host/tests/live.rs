//! The window's engine on its own thread, with real lines: what the window asks for is done while others still wait.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

#[cfg(target_os = "linux")]
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use armature::engine::command::{CharacterChoice, Command};
use armature::engine::drive::drive;
use armature::engine::event::EngineEvent;
use armature::engine::link::{AppLink, link};
use armature::engine::machine::{Engine, EngineSettings};
use armature::engine::playback::Play;
use armature::engine::sources::{LiveSettings, LiveSource};
use armature::files::Overwrite;
use armature::takes::exports::Target;
use armature::takes::orders::ExportOrder;
use armature_rig::{Calibration, PartUid, RawSample, SensorState, propose, skeleton_puppet};
use armature_sim::serve::{Background, Options, Place, ServeSettings};
use armature_take::{Edit, EditList, FrameRate, Header, TakeWriter};

/// Long enough for a loaded machine, and shorter than it takes to give up on a connection.
const PATIENCE: Duration = Duration::from_secs(20);

/// A window's end of a running engine.
struct Desk {
    window: AppLink,
    engine: JoinHandle<()>,
    heard: Vec<EngineEvent>,
}

impl Desk {
    fn open() -> Self {
        let (window, engine) = link(|| ());
        let engine = std::thread::spawn(move || {
            let (inbox, mut window) = engine.into_parts();
            // No calibration of the user's is read or written.
            let mut source = LiveSource::new(inbox, LiveSettings::default()).unwrap();
            drive(&mut Engine::new(EngineSettings::default()), &mut source, [], &mut window);
        });
        Self { window, engine, heard: Vec::new() }
    }

    fn ask(&self, command: Command) {
        assert!(self.window.send(command));
    }

    /// Waits for an event that satisfies this.
    fn hears(&mut self, what: &str, is: impl Fn(&EngineEvent) -> bool) {
        let start = Instant::now();
        loop {
            while let Some(event) = self.window.next_event() {
                let found = is(&event);
                self.heard.push(event);
                if found {
                    return;
                }
            }
            assert!(start.elapsed() < PATIENCE, "no {what} among {:?}", self.heard);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn close(self) {
        self.ask(Command::Quit);
        self.engine.join().unwrap();
    }
}

/// A file with a skeleton of two bones.
fn bones() -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("live-bones.bvh");
    let joint = "JOINT Arm { OFFSET 0 1 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 1 0 } }";
    let hips = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";
    let text = format!("HIERARCHY\nROOT Hips {{ OFFSET 0 0 0 {hips} {joint} }}\nMOTION\nFrames: 1\nFrame Time: 0.01\n");
    std::fs::write(&path, text + &["0"; 9].join(" ") + "\n").unwrap();
    path
}

/// An address that neither accepts nor refuses: its queue of callers is full. Keeps it that way.
#[cfg(target_os = "linux")]
fn full_queue() -> (SocketAddr, TcpListener, Vec<TcpStream>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let mut callers = Vec::new();
    while let Ok(caller) = TcpStream::connect_timeout(&address, Duration::from_millis(300)) {
        callers.push(caller);
        assert!(callers.len() < 10_000, "the queue has no end");
    }
    (address, listener, callers)
}

#[cfg(target_os = "linux")]
#[test]
fn a_puppet_that_does_not_answer_holds_nothing_up() {
    let (address, _listener, _callers) = full_queue();
    let mut desk = Desk::open();
    desk.ask(Command::Connect(format!("tcp:{address}")));
    desk.hears("Connecting", |event| matches!(event, EngineEvent::Connecting { .. }));
    desk.ask(Command::LoadCharacter(CharacterChoice::File(bones())));
    desk.hears("character", |event| matches!(event, EngineEvent::CharacterLoaded(c) if c.skeleton.len() == 2));
    desk.ask(Command::Zero);
    desk.ask(Command::StartRecording);
    desk.hears("problem", |event| matches!(event, EngineEvent::Problem(p) if p.what.contains("no puppet to record")));
    desk.ask(Command::Disconnect);
    desk.hears("end of it", |event| matches!(event, EngineEvent::Disconnected { problem: None }));
    assert!(!desk.heard.iter().any(|event| matches!(event, EngineEvent::LineOpened { .. })), "it never answered");
    desk.close();
}

#[test]
fn a_puppet_moves_the_character_is_given_up_and_connected_again() {
    let options = Options { puppet: "hand".into(), seed: 3, rest: 0.2, ..Options::default() };
    let served =
        Background::start(options.puppet().unwrap(), Place::Tcp("127.0.0.1:0".into()), ServeSettings::default());
    let served = served.unwrap();
    let mut desk = Desk::open();
    for _ in 0..2 {
        // The second time the character is loaded before its puppet.
        desk.ask(Command::Connect(served.address().into()));
        desk.hears("handshake", |event| matches!(event, EngineEvent::Connected { .. }));
        if desk.heard.iter().all(|event| !matches!(event, EngineEvent::CharacterLoaded(_))) {
            desk.ask(Command::LoadCharacter(CharacterChoice::File(bones())));
        }
        desk.hears("topology", |event| matches!(event, EngineEvent::Topology { .. }));
        desk.hears("zero", |event| matches!(event, EngineEvent::Zeroed { unreadable: 0, .. }));
        let is_moving = |event: &EngineEvent| {
            matches!(event, EngineEvent::Frame(frame)
                if frame.stats.samples > 20 && frame.bones.len() == 2 && frame.stats.latency_p99_micros > 0.0)
        };
        desk.hears("frame", is_moving);
        desk.ask(Command::Disconnect);
        desk.hears("end of it", |event| matches!(event, EngineEvent::Disconnected { problem: None }));
    }
    desk.close();
    let report = served.finish().unwrap();
    println!("{report:?}");
}

/// A folder with a skeleton and a take of it, of two seconds.
fn takes() -> (PathBuf, PathBuf) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("live-takes");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let figure = folder.join("bones.bvh");
    std::fs::copy(bones(), &figure).unwrap();
    let skeleton = armature::files::inputs::skeleton(&figure).unwrap();
    let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8 + 1; 12])).unwrap();
    let sample = |step: u16| RawSample {
        device_micros: 10_000 * u64::from(step),
        sequence: step.into(),
        epoch: 0,
        counts: vec![2048 + step; tree.sensor_count()],
        states: vec![SensorState::Ok; tree.sensor_count()],
    };
    let mut calibration = Calibration::for_tree(&tree);
    calibration.zero(&tree, &sample(0)).unwrap();
    let header = Header { character_name: "bones.bvh".into(), ..Header::default() };
    let mut writer = TakeWriter::new(Vec::new(), &header).unwrap();
    writer.skeleton(&skeleton).unwrap();
    writer.topology(0, &tree).unwrap();
    writer.calibration(&calibration).unwrap();
    writer.mapping(&propose(&tree, &skeleton).mapping).unwrap();
    (0..=200).for_each(|step| writer.sample(&sample(step), None).unwrap());
    let take = folder.join("walk.take");
    std::fs::write(&take, writer.finish().unwrap()).unwrap();
    (folder, take)
}

#[test]
fn a_take_is_opened_played_trimmed_exported_and_thrown_away() {
    let (folder, take) = takes();
    let mut desk = Desk::open();
    desk.ask(Command::OpenTake(folder.join("none.take")));
    desk.hears("problem", |event| matches!(event, EngineEvent::Problem(p) if p.what.contains("none.take")));
    desk.ask(Command::OpenTake(take.clone()));
    desk.hears("take", |event| {
        matches!(event, EngineEvent::TakeOpened(take) if (take.span().1 - 2.0).abs() < 1e-9 && take.character.name == "bones.bvh")
    });
    desk.ask(Command::Play(Play::Start));
    desk.hears("motion", |event| matches!(event, EngineEvent::Playback(now) if now.playing && now.seconds > 0.05));
    let mut list = EditList::new("walk.take");
    list.add([Edit::Trim { from: 0.5, to: 1.5 }]);
    desk.ask(Command::EditTake(list.clone()));
    desk.hears(
        "trimmed take",
        |event| matches!(event, EngineEvent::TakeOpened(take) if (take.span().1 - 1.0).abs() < 1e-9),
    );
    assert_eq!(EditList::read(&std::fs::read_to_string(folder.join("walk.edit")).unwrap()).unwrap(), list);
    let to = folder.join("Exports").join("walk.bvh");
    let (rate, overwrite) = (FrameRate::whole(24).unwrap(), Overwrite::default());
    let order = ExportOrder { take: take.clone(), target: Target::Bvh, rate, range: None, to, overwrite };
    desk.ask(Command::Export(order.clone()));
    desk.hears(
        "export",
        |event| matches!(event, EngineEvent::Exported(made) if made.contents.starts_with("25 frames")),
    );
    assert!(std::fs::read_to_string(&order.to).unwrap().contains("Frames: 25"));
    desk.ask(Command::Export(order));
    desk.hears("refusal", |event| matches!(event, EngineEvent::Problem(p) if p.what.contains("already there")));
    desk.ask(Command::Discard(take.clone()));
    desk.hears("bin", |event| matches!(event, EngineEvent::Discarded { path } if path.exists()));
    assert!(!take.exists() && folder.join("Bin").join("walk.edit").exists());
    desk.close();
}
