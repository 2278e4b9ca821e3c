//! A world for the engine that consists of lists, and a puppet of one joint.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use armature_character::{Character, Provenance, SkinKind, Surface};
use armature_device::{DeviceInfo, Event, PartKind, PartUid, Sample, SensorState, SessionCounters, Topology};
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Skeleton, Transform};
use armature_take::Take;
use glam::Vec3;

use super::*;
use crate::engine::event::Frame;
use crate::engine::input::{LineId, LineNews, NewTake, OpenLine};

/// A take's file in memory, and how often it was settled; and how many bytes there is room for.
#[derive(Clone)]
pub(super) struct MemoryTake(pub(super) Arc<Mutex<(Vec<u8>, usize)>>, usize);

impl Write for MemoryTake {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut take = self.0.lock().unwrap();
        if take.0.len() + bytes.len() > self.1 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        take.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl TakeFile for MemoryTake {
    fn settle(&mut self, succeeded: bool) -> io::Result<Option<PathBuf>> {
        self.0.lock().unwrap().1 += 1;
        Ok((!succeeded).then(|| "run.take.part".into()))
    }
}

/// Remembers what the engine says and asks for.
#[derive(Default)]
pub(super) struct Script {
    pub(super) told: Vec<EngineEvent>,
    pub(super) asked: Vec<Request>,
    pub(super) kept: Vec<(LineId, Calibration)>,
    pub(super) takes: Vec<MemoryTake>,
    /// Calibrations cannot be saved.
    pub(super) keeps_nothing: bool,
    /// How many bytes of a take the disk has room for; `None`: any number.
    pub(super) room: Option<usize>,
    /// Someone wants to cancel.
    pub(super) stops: bool,
}

impl Shell for Script {
    fn tell(&mut self, event: EngineEvent) {
        self.told.push(event);
    }

    fn ask(&mut self, request: Request) {
        self.asked.push(request);
    }

    fn age(&self, _: f64) -> Option<Duration> {
        Some(Duration::from_micros(150))
    }

    fn is_stopped(&mut self) -> bool {
        self.stops
    }

    fn frame_buffer(&mut self) -> Box<Frame> {
        Box::default()
    }

    fn create_take(&mut self, name: TakeName) -> Result<NewTake, Failure> {
        let path = match name {
            TakeName::Path { path, .. } => path,
            TakeName::After(name) => format!("{name}-{}.take", self.takes.len()).into(),
            TakeName::Beside(take) => take.with_file_name(format!("over-{}.take", self.takes.len())),
        };
        let take = MemoryTake(Arc::default(), self.room.unwrap_or(usize::MAX));
        self.takes.push(take.clone());
        Ok(NewTake { path, file: Box::new(take), unix_micros: Some(7) })
    }

    fn keep_calibration(&mut self, line: LineId, calibration: &Calibration) -> Result<(), Failure> {
        self.kept.push((line, calibration.clone()));
        if self.keeps_nothing { Err(Failure::input("calibration.toml: read-only", "")) } else { Ok(()) }
    }
}

/// An engine, what it said, and all that happened to it.
pub(super) struct Session {
    pub(super) engine: Engine,
    pub(super) script: Script,
    pub(super) happened: Vec<(f64, Input)>,
    pub(super) sequence: u32,
    line: LineId,
    began: f64,
}

pub(super) const ADDRESS: &str = "tcp:puppet:1";

impl Session {
    pub(super) fn new(settings: EngineSettings) -> Self {
        let (script, happened) = (Script::default(), Vec::new());
        Self { engine: Engine::new(settings), script, happened, sequence: 0, line: LineId(1), began: 0.0 }
    }

    /// With a character, a puppet of one joint, and a zero.
    pub(super) fn ready() -> Self {
        let mut session = Self::new(EngineSettings::default());
        session.load(0.0);
        session.connect(0.0);
        session.sample(0.1, 1000);
        session
    }

    /// Lets something happen; returns what it led to.
    pub(super) fn at(&mut self, now: f64, input: Input) -> &[EngineEvent] {
        let first = self.script.told.len();
        self.happened.push((now, input.clone()));
        self.engine.handle(now, input, &mut self.script);
        &self.script.told[first..]
    }

    pub(super) fn ask(&mut self, now: f64, command: Command) -> &[EngineEvent] {
        self.at(now, Input::Command(command))
    }

    pub(super) fn tick(&mut self, now: f64) -> &[EngineEvent] {
        self.at(now, Input::Tick)
    }

    pub(super) fn load(&mut self, now: f64) -> &[EngineEvent] {
        self.at(now, Input::Loaded { load: LoadId::BROUGHT_ALONG, news: LoadNews::Over(Ok((arm(), Vec::new()))) })
    }

    pub(super) fn event(&mut self, now: f64, event: Event) -> &[EngineEvent] {
        self.news(now, LineNews::Event(event))
    }

    pub(super) fn news(&mut self, now: f64, news: LineNews) -> &[EngineEvent] {
        let counters = SessionCounters { samples: u64::from(self.sequence), ..SessionCounters::default() };
        self.at(now, Input::Device { line: self.line, counters, news })
    }

    pub(super) fn open(&mut self, now: f64) -> &[EngineEvent] {
        self.began = now;
        self.ask(now, Command::Connect(ADDRESS.into()));
        let opened = OpenLine { address: ADDRESS.into(), began: now, ..OpenLine::default() };
        self.at(now, Input::Connected { line: self.line, outcome: Ok(opened) })
    }

    /// Opens the line; the puppet says who it is.
    pub(super) fn connect(&mut self, now: f64) -> &[EngineEvent] {
        self.open(now);
        self.event(now, Event::Connected(info()));
        self.event(now, Event::Topology(topology()))
    }

    pub(super) fn sample(&mut self, now: f64, counts: u16) -> &[EngineEvent] {
        self.sequence += 1;
        let sample = Sample {
            device_micros: (now * 1e6) as u64,
            sequence: self.sequence,
            epoch: 1,
            counts: vec![counts],
            states: vec![SensorState::Ok],
            received: Duration::from_secs_f64(now - self.began),
        };
        self.event(now, Event::Sample(sample))
    }

    pub(super) fn asked(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.script.asked)
    }

    pub(super) fn take(&self, index: usize) -> Take {
        let file = self.script.takes[index].0.lock().unwrap();
        assert_eq!(file.1, 1, "the end of a take is settled once");
        let (take, report) = Take::read(&file.0).unwrap();
        assert!(report.is_whole(), "{report}");
        take
    }
}

pub(super) fn arm() -> Arc<LoadedCharacter> {
    let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::Y };
    Arc::new(LoadedCharacter::bare("arm", "arm.bvh", Skeleton::new(vec![bone]).unwrap()))
}

/// A rope of this many bones, with a mesh.
pub(super) fn rope(bones: usize) -> Arc<LoadedCharacter> {
    let bone = |index: usize| Bone {
        name: format!("bone {index}"),
        parent: index.checked_sub(1),
        rest: Transform { translation: if index > 0 { Vec3::Y } else { Vec3::ZERO }, ..Transform::IDENTITY },
        tail: Vec3::Y,
    };
    let corner = |index: u32| {
        let (sin, cos) = (std::f64::consts::TAU / 3.0 * f64::from(index % 3)).sin_cos();
        [0.3 * cos, f64::from(index / 3), 0.3 * sin]
    };
    let vertices: Vec<[f64; 3]> = (0..3 * bones as u32 + 3).map(corner).collect();
    let side = |index: u32| {
        let next = index / 3 * 3 + (index + 1) % 3;
        [[index, index + 3, next], [next, index + 3, next + 3]]
    };
    let owner = |vertex: usize| (vertex / 3).min(bones - 1) as u16;
    let influences: Vec<u16> = (0..vertices.len()).map(owner).collect();
    let influences = Influences::new(1, influences, vec![1.0; vertices.len()], bones).unwrap();
    let mesh = TriangleMesh { vertices, triangles: (0..3 * bones as u32).flat_map(side).collect() };
    let surface = Surface {
        normals: vec![[0.0, 0.0, 1.0]; mesh.vertices.len()],
        texture_coordinates: None,
        vertex_colors: None,
        endpoints: None,
        influences,
        parts: vec![Surface::one_part(&mesh)],
        morph_targets: Vec::new(),
        mesh,
    };
    let character = Character {
        name: "rope".into(),
        surface: Arc::new(surface),
        materials: Vec::new(),
        skeleton: Skeleton::new((0..bones).map(bone).collect()).unwrap(),
        skins: Vec::new(),
        avatar: None,
        skin: SkinKind::Linear,
        provenance: Provenance::Artist,
        warnings: Vec::new(),
    };
    Arc::new(LoadedCharacter::bound("rope.glb", character).0)
}

pub(super) fn info() -> DeviceInfo {
    DeviceInfo {
        name: "Arm".into(),
        uid: PartUid([9; 12]),
        protocol: [1, 0],
        firmware: [0, 3, 0],
        features: 0,
        max_rate_millihertz: 1_000_000,
    }
}

pub(super) fn topology() -> Topology {
    let part = armature_device::Part {
        kind: PartKind::Bend,
        sensor_count: 1,
        outlet: 0,
        outlet_count: 1,
        parent: None,
        uid: PartUid([3; 12]),
        counts_per_turn: 4096,
    };
    Topology::new(1, vec![part]).unwrap()
}
