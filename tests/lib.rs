//! Helpers shared by the cross-room tests.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use armature::engine::actor::Actor;
use armature::engine::completion::{IkArgs, IkMode};
use armature::engine::perform::{self, Next, Plan, Source, Summary};
use armature::engine::performance::{Performance, ZeroPolicy};
use armature::engine::virtual_clock::VirtualPuppet;
use armature_device::{Event, SessionCounters};
use armature_rig::{Calibration, Mapping};
use armature_sim::serve::Options;
use armature_sim::{Puppet, Truth};
use armature_take::{Header, Record, Take};

/// A file of the shared test data, which lies beside the repository. Without it a test says loudly that it is
/// skipped, and fails where `ARMATURE_REQUIRE_SHARED_DATA` is set.
pub fn shared(name: &str) -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = here.ancestors().map(|folder| folder.join("shared/data").join(name)).find(|file| file.exists());
    if file.is_none() {
        assert!(std::env::var_os("ARMATURE_REQUIRE_SHARED_DATA").is_none(), "shared/data/{name} is missing");
        println!("SKIPPED: shared/data/{name} is not here");
    }
    file
}

/// For work that asks whether to go on.
pub fn go_on<T>(_: T) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A preset or motion file as `--device sim:NAME` makes it, walking and waving unless it brings a motion.
pub fn options(puppet: &str, seed: u64) -> Options {
    let brings_motion = Path::new(puppet).extension().is_some();
    let motion = (!brings_motion).then(|| "walk+wave".to_string());
    Options { puppet: puppet.into(), motion, seed, rest: 0.1, ..Options::default() }
}

/// The character or skeleton of this name, as `--character NAME` finds it.
pub fn actor(name: &str) -> Arc<Actor> {
    let found = armature::characters::find(name, &mut go_on).unwrap_or_else(|failure| panic!("{name}: {failure}"));
    Arc::new(found.actor)
}

/// The bones of one of our own characters without its mesh, which takes no time to pose.
pub fn bones_of(name: &str) -> Arc<Actor> {
    Arc::new(Actor::bare(name, name, actor(name).skeleton.clone()))
}

/// A performance and what everybody says about it.
#[derive(Debug)]
pub struct Run {
    /// The take's file.
    pub bytes: Vec<u8>,
    /// The take; it was read whole.
    pub take: Take,
    /// What the program says at the end.
    pub summary: Summary,
    /// What the session reported, from the first event on.
    pub events: Vec<Event>,
    /// What the simulator did.
    pub truth: Truth,
}

impl Run {
    /// The events that came after the sample before the take's first one, which zeroed the puppet: those of which the
    /// take has to know.
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
    /// every event of the session has been handed on.
    pub seconds: f64,
    /// What the take says of itself.
    pub header: Header,
    /// What becomes of bones without a joint.
    pub ik: IkArgs,
}

impl Setup {
    /// So many whole samples; bones without a joint stay at rest.
    pub fn samples(count: u32, rate: f64) -> Self {
        Self {
            rate,
            seconds: (f64::from(count) + 0.5) / rate,
            header: Header::default(),
            ik: IkArgs { ik: IkMode::Off, ..IkArgs::default() },
        }
    }
}

/// Lets a simulated puppet perform on the virtual clock of the program, from the first hello to the finished take.
pub fn perform(puppet: Puppet, actor: &Arc<Actor>, setup: &Setup) -> Run {
    perform_from(VirtualPuppet::of(puppet, setup.rate), |source| source.puppet().truth(), actor, setup)
}

/// The same with a source of the test's own.
pub fn perform_from<S: Source>(source: S, truth: fn(&S) -> Truth, actor: &Arc<Actor>, setup: &Setup) -> Run {
    let folder = tempfile::tempdir().expect("a folder for the take");
    let path = folder.path().join("run.take");
    let heard = Rc::new(RefCell::new((Vec::new(), Truth::default())));
    let source = Overheard { source, truth, heard: heard.clone() };
    let plan = Plan { seconds: Some(setup.seconds), record: Some(path.clone()), header: setup.header.clone() };
    let performance = Performance::new(actor.clone(), None, Calibration::default(), ZeroPolicy::AtStart)
        .and_then(|performance| performance.with_inverse_kinematics(&setup.ik));
    let performed = perform::perform(source, performance.expect("the character can be skinned"), &plan, &mut |_, _| ());
    let (_, summary) = performed.unwrap_or_else(|failure| panic!("{failure}"));
    let bytes = std::fs::read(&path).expect("the take is there");
    let (take, report) = Take::read(&bytes).expect("the take can be read");
    assert!(report.is_whole(), "{report}");
    let (events, truth) = heard.take();
    Run { bytes, take, summary, events, truth }
}

/// A source that remembers all it handed on, and at the end asks for the truth.
struct Overheard<S> {
    source: S,
    truth: fn(&S) -> Truth,
    heard: Rc<RefCell<(Vec<Event>, Truth)>>,
}

impl<S: Source> Source for Overheard<S> {
    fn next(&mut self) -> Next {
        let next = self.source.next();
        if let Next::Event(event) = &next {
            self.heard.borrow_mut().0.push(event.clone());
        }
        next
    }

    fn now(&self) -> f64 {
        self.source.now()
    }

    fn age(&self, received: Duration) -> Option<Duration> {
        self.source.age(received)
    }

    fn counters(&self) -> SessionCounters {
        self.source.counters()
    }

    fn interrupted(&self) -> bool {
        self.source.interrupted()
    }

    fn close(self) -> SessionCounters {
        self.heard.borrow_mut().1 = (self.truth)(&self.source);
        self.source.close()
    }
}
