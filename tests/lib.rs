//! Helpers shared by the tests across crates.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use armature::characters::LoadedCharacter;
use armature::characters::ground::GroundArgs;
use armature::characters::inverse_kinematics::{IkArgs, IkMode};
use armature::characters::targets::TargetArgs;
use armature::engine::command::RunPlan;
use armature::engine::drive::drive_run;
use armature::engine::input::{Input, LineNews, Request};
use armature::engine::machine::{Engine, EngineSettings};
use armature::engine::puppet_rest::PuppetRest;
use armature::engine::puppeteer::ZeroPolicy;
use armature::engine::run_summary::RunSummary;
use armature::engine::sources::{Source, VirtualSource};
use armature_device::Event;
use armature_rig::{Calibration, Filter, Mapping};
use armature_sim::serve::Options;
use armature_sim::{Puppet, Truth};
use armature_take::{Header, Record, Take};

/// For work that asks whether to go on.
pub fn keep_going(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A preset or motion file as `--device sim:NAME` makes it, walking and waving unless it has its own motion.
pub fn options(puppet: &str, seed: u64) -> Options {
    let brings_motion = Path::new(puppet).extension().is_some();
    let motion = (!brings_motion).then(|| "walk+wave".to_string());
    Options { puppet: puppet.into(), motion, seed, rest: 0.1, ..Options::default() }
}

/// The character or skeleton of this name, as `--character NAME` finds it.
pub fn character(name: &str) -> Arc<LoadedCharacter> {
    let found = armature::characters::find(name, &mut keep_going).unwrap_or_else(|failure| panic!("{name}: {failure}"));
    Arc::new(found.character)
}

/// The bones of one of our own characters without its mesh, which takes no time to pose.
pub fn bones_of(name: &str) -> Arc<LoadedCharacter> {
    Arc::new(LoadedCharacter::bare(name, name, character(name).skeleton.clone()))
}

/// A performance, and what every side reports about it.
#[derive(Debug)]
pub struct Run {
    /// The take's file.
    pub bytes: Vec<u8>,
    /// The take, read whole.
    pub take: Take,
    /// What the program reports at the end.
    pub summary: RunSummary,
    /// What the session reported, from the first event on.
    pub events: Vec<Event>,
    /// What the simulator did.
    pub truth: Truth,
}

impl Run {
    /// The events after the sample that zeroed the puppet, which comes just before the take's first one: the events
    /// that the take must contain.
    pub fn events_of_take(&self) -> &[Event] {
        let first = self.take.samples().next().map(|s| (s.raw.sequence, s.raw.device_micros));
        let is_first =
            |event: &Event| matches!(event, Event::Sample(s) if Some((s.sequence, s.device_micros)) == first);
        let first = self.events.iter().position(is_first).expect("the take's first sample is among the events");
        let before = self.events[..first].iter().rposition(|event| matches!(event, Event::Sample(_)));
        &self.events[before.map_or(first, |before| before + 1)..]
    }

    /// The mapping that the take begins with.
    pub fn mapping(&self) -> &Mapping {
        let mapping = self.take.records().iter().find_map(|r| if let Record::Mapping(m) = r { Some(m) } else { None });
        mapping.expect("a take begins with a mapping")
    }
}

/// How to perform.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Samples a second.
    pub rate: f64,
    /// From the sample after zeroing. Half a sample period more than whole samples ends between two of them, so that
    /// every event of the session has been passed on.
    pub seconds: f64,
    /// The take's header.
    pub header: Header,
    /// What happens to bones without a joint.
    pub ik: IkArgs,
    /// How the roots follow the feet.
    pub ground: GroundArgs,
    /// What is dragged, and when.
    pub targets: TargetArgs,
    /// What is done to readings.
    pub filter: Filter,
    /// Which joint drives which bone; `None`: as is proposed.
    pub mapping: Option<Mapping>,
    /// The pose in which the puppet is zeroed.
    pub puppet_rest: PuppetRest,
}

impl Setup {
    /// This many whole samples; bones without a joint stay at rest.
    pub fn samples(count: u32, rate: f64) -> Self {
        Self {
            rate,
            seconds: (f64::from(count) + 0.5) / rate,
            header: Header::default(),
            ik: IkArgs { ik: IkMode::Off, ..IkArgs::default() },
            ground: GroundArgs::default(),
            targets: TargetArgs::default(),
            filter: Filter::None,
            mapping: None,
            puppet_rest: PuppetRest::default(),
        }
    }
}

/// Lets a simulated puppet perform on the program's virtual clock, from the first hello to the finished take.
pub fn perform(puppet: Puppet, character: &Arc<LoadedCharacter>, setup: &Setup) -> Run {
    perform_from(VirtualSource::of(puppet, setup.rate), character, setup)
}

/// The same with a source of the test's own.
pub fn perform_from(source: VirtualSource, character: &Arc<LoadedCharacter>, setup: &Setup) -> Run {
    let folder = tempfile::tempdir().expect("a folder for the take");
    let path = folder.path().join("run.take");
    let mut source = Overheard { source, events: Vec::new(), truth: Truth::default() };
    let plan = RunPlan {
        seconds: Some(setup.seconds),
        record: Some(path.clone()),
        header: setup.header.clone(),
        ..RunPlan::default()
    };
    let mut calibration = Calibration::default();
    calibration.filter = setup.filter;
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: setup.rate,
        zero_policy: ZeroPolicy::AtStart,
        calibration,
        mapping: setup.mapping.clone(),
        puppet_rest: setup.puppet_rest,
        ik: setup.ik.clone(),
        ground: setup.ground.clone(),
        targets: setup.targets.clone(),
        draws: false,
        ..EngineSettings::default()
    });
    let performed = drive_run(&mut engine, &mut source, character.clone(), "sim:puppet", plan, None, &mut |_| ());
    let summary = performed.unwrap_or_else(|failure| panic!("{failure}"));
    let bytes = std::fs::read(&path).expect("the take is there");
    let (take, report) = Take::read(&bytes).expect("the take can be read");
    assert!(report.is_whole(), "{report}");
    Run { bytes, take, summary, events: source.events, truth: source.truth }
}

/// A source that remembers everything it passed on, and the truth at the end.
struct Overheard {
    source: VirtualSource,
    events: Vec<Event>,
    truth: Truth,
}

impl Source for Overheard {
    fn next(&mut self, until: Option<f64>) -> Input {
        let input = self.source.next(until);
        if let Input::Device { news: LineNews::Event(event), .. } = &input {
            self.events.push(event.clone());
        }
        input
    }

    fn now(&self) -> f64 {
        self.source.now()
    }

    fn age(&self, at: f64) -> Option<Duration> {
        self.source.age(at)
    }

    fn fulfil(&mut self, request: Request) {
        if matches!(request, Request::Close(_)) {
            self.truth = self.source.puppet().truth();
        }
        self.source.fulfil(request);
    }
}
