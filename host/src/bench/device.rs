//! The device crate: the cost of a session, a long performance on a bad line, unplugged cables, servo buses.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use armature_device::servo::{ServoArm, ServoJoint, ServoProtocol, ServoSession, ServoSettings};
use armature_device::{Connection, ConnectionSettings, DeviceAddress, Event, PartKind, Session, SessionSettings};
use armature_sim::serve::{Background, Place, ServeSettings};
use armature_sim::servo::{BusKind, ServoBus, ServoBusSettings, SimulatedServo};
use armature_sim::{Body, Faults, Motion, Puppet, PuppetSettings, Unplugging};

use super::{Measurement, median};
use crate::cli::args::BenchArgs;
use crate::engine::latency::percentile;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "device/session-p99",
    "device/soak-missing",
    "device/soak-recovery",
    "device/soak-memory",
    "device/replug-median",
    "device/replug-worst",
    "device/dynamixel-sync",
    "device/dynamixel-fast",
    "device/feetech-sync",
];

const MICROS: u64 = 1_000_000;
const STEP_MICROS: u64 = 1_000;
/// The subtree is unplugged this often, for a second each time.
const PULLED_EVERY: u64 = 5;
/// A cable that is not back after this is given up.
const PATIENCE: Duration = Duration::from_secs(20);

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let asked = |name: &str| args.what.as_deref().is_none_or(|what| name.contains(what));
    let mut measurements = Vec::new();
    if NAMES[..4].iter().any(|name| asked(name)) {
        measurements.extend(soak(args.soak_seconds)?);
    }
    if NAMES[4..6].iter().any(|name| asked(name)) {
        measurements.extend(replug(args.replugs)?);
    }
    for (name, kind, fast, bound, words) in [
        (NAMES[6], BusKind::Dynamixel, false, 370.0, "95 % of 370, what 1 Mbaud carries"),
        (NAMES[7], BusKind::Dynamixel, true, 602.0, "95 % of 602, what 1 Mbaud carries"),
        (NAMES[8], BusKind::Feetech, false, 658.0, "95 % of 658, what 1 Mbaud carries"),
    ] {
        if asked(name) {
            let (rate, readings) = servo_rate(kind, fast)?;
            measurements.push(Measurement::new(name, rate, "/s", readings).at_least(0.95 * bound, words));
        }
    }
    Ok(measurements)
}

fn defect(what: impl Into<String>) -> Failure {
    Failure::not_converged(what, "this is a defect; please report it")
}

/// 32 joints at 1,000 Hz, one byte in a thousand damaged, a subtree out for one second in five.
fn soak_puppet(seconds: u64) -> Result<Puppet, Failure> {
    let body = Body::preset("joints:32", 1).map_err(|e| defect(e.to_string()))?;
    let part = body.parts().len() / 2;
    let pull = |turn: u64| Unplugging { part, at_micros: turn * PULLED_EVERY * MICROS, for_micros: Some(MICROS) };
    let unplugged = (1..=seconds / PULLED_EVERY).map(pull).collect();
    let settings = PuppetSettings {
        motion: Motion::Wiggle,
        seed: 1,
        rest_micros: 0,
        topology_records: 8,
        faults: Faults { bit_flip: 0.001, unplugged, ..Faults::default() },
        ..PuppetSettings::new(body)
    };
    Puppet::new(settings).map_err(|e| defect(e.to_string()))
}

/// What the samples of a soak say, as they arrive.
#[derive(Default)]
struct Heard {
    last: Option<(u32, u64)>,
    delivered: u64,
    out_of_order: u64,
    whole: usize,
    incomplete: bool,
    longest_recovery: u64,
}

impl Heard {
    fn sample(&mut self, now: u64, sample: &armature_device::Sample) {
        self.delivered += 1;
        let place = (sample.sequence, sample.device_micros);
        self.out_of_order += u64::from(self.last.is_some_and(|last| place.0 <= last.0 || place.1 <= last.1));
        self.last = Some(place);
        self.whole = self.whole.max(sample.counts.len());
        if sample.counts.len() < self.whole {
            self.incomplete = true;
        } else if std::mem::take(&mut self.incomplete) {
            let period = PULLED_EVERY * MICROS;
            let back = now.saturating_sub(period + MICROS) % period;
            self.longest_recovery = self.longest_recovery.max(back);
        }
    }
}

fn soak(seconds: u64) -> Result<Vec<Measurement>, Failure> {
    let mut puppet = soak_puppet(seconds)?;
    let mut session = Session::new(SessionSettings::default());
    session.start(1_000_000);
    let (mut heard, mut bytes, mut events) = (Heard::default(), Vec::new(), Vec::new());
    // A little more than whole seconds, so that nothing is in flight at the end.
    let steps = (seconds * MICROS + 700_000) / STEP_MICROS;
    // Written once, so that all its memory is allocated before it is measured.
    let mut costs = vec![f64::MAX; usize::try_from(steps).unwrap_or(0)];
    let mut early = 0;
    for (step, cost) in (0..steps).zip(&mut costs) {
        let micros = step * STEP_MICROS;
        if micros >= seconds * MICROS / 4 && early == 0 {
            early = resident_kib();
        }
        let now = Duration::from_micros(micros);
        session.tick(now, &mut events);
        bytes.clear();
        puppet.step(micros, &session.take_outgoing(), &mut bytes);
        let began = Instant::now();
        session.receive(now, &bytes, &mut events);
        *cost = began.elapsed().as_secs_f64() * 1e6;
        for event in events.drain(..) {
            match event {
                Event::Sample(sample) => heard.sample(micros, &sample),
                Event::Problem(problem) => return Err(defect(format!("{now:?}: {problem}"))),
                Event::Restarted => return Err(defect(format!("{now:?}: nothing restarted"))),
                _ => {}
            }
        }
    }
    let grown = resident_kib().saturating_sub(early);
    if heard.out_of_order > 0 {
        return Err(defect(format!("{} samples arrived twice or out of order", heard.out_of_order)));
    }
    let truth = puppet.truth();
    let intact = truth.samples_sent - truth.samples_damaged;
    let samples = usize::try_from(intact).unwrap_or(usize::MAX);
    costs.sort_by(f64::total_cmp);
    let [p99, missing, recovery, memory] = [NAMES[0], NAMES[1], NAMES[2], NAMES[3]];
    let lacking = intact.abs_diff(heard.delivered) as f64;
    Ok(vec![
        Measurement::new(p99, percentile(&costs, 0.99), "µs", costs.len()).at_most(300.0, "at most 0.3 ms a sample"),
        Measurement::new(missing, lacking, "samples", samples).at_most(0.0, "every intact frame, exactly once"),
        Measurement::new(recovery, heard.longest_recovery as f64 / 1e3, "ms", (seconds / PULLED_EVERY) as usize)
            .at_most(200.0, "at most 200 ms"),
        Measurement::new(memory, grown as f64, "KiB", 1).at_most(1_024.0, "flat: less than 1 MiB in three quarters"),
    ])
}

/// Memory in use, KiB; 0 if the system does not report it.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|rest| rest.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// A path that leads to whatever is plugged in, as for a port.
struct Socket {
    folder: PathBuf,
}

impl Socket {
    fn new() -> Result<Self, Failure> {
        let folder = std::env::temp_dir().join(format!("armature-bench-{}", std::process::id()));
        let made = std::fs::create_dir_all(&folder);
        made.map_err(|e| Failure::input(format!("{}: {e}", folder.display()), "make room on the disk"))?;
        Ok(Self { folder })
    }

    fn path(&self) -> PathBuf {
        self.folder.join("port")
    }

    #[cfg(unix)]
    fn plug(&self) -> Result<Background, Failure> {
        let body = Body::preset("human", 1).map_err(|e| defect(e.to_string()))?;
        let puppet = Puppet::new(PuppetSettings::new(body)).map_err(|e| defect(e.to_string()))?;
        let served = Background::start(puppet, Place::Pty, ServeSettings::default());
        let served = served.map_err(|e| Failure::device(e.to_string(), "is a pseudo-terminal free?"))?;
        let port = served.address().strip_prefix("serial:").unwrap_or(served.address()).to_owned();
        let linked = std::os::unix::fs::symlink(port, self.path());
        linked.map_err(|e| Failure::input(format!("{}: {e}", self.path().display()), ""))?;
        Ok(served)
    }

    fn pull(&self, served: Background) -> Result<(), Failure> {
        let removed = std::fs::remove_file(self.path());
        removed.map_err(|e| Failure::input(format!("{}: {e}", self.path().display()), ""))?;
        served.finish().map(drop).map_err(|e| Failure::device(e.to_string(), ""))
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        // Whatever is left of it is in the temporary folder, which the system clears.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

#[cfg(not(unix))]
fn replug(_: usize) -> Result<Vec<Measurement>, Failure> {
    Ok(Vec::new())
}

/// Unplugs the cable of a real pseudo-terminal and plugs it in again, this many times.
#[cfg(unix)]
fn replug(times: usize) -> Result<Vec<Measurement>, Failure> {
    let socket = Socket::new()?;
    let mut served = socket.plug()?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(|e| Failure::device(format!("no thread for the device: {e}"), "close other programs"))?;
    let address =
        DeviceAddress::Serial { path: socket.path().display().to_string(), baud: armature_device::DEFAULT_BAUD };
    let opening = Connection::open(runtime.handle(), &address, ConnectionSettings::default());
    let mut connection = runtime.block_on(opening).map_err(|e| crate::engine::sources::address::problem_failure(&e))?;
    connection.start(500_000);
    let until = |connection: &mut Connection, wanted: fn(&Event) -> bool| -> Result<(), Failure> {
        runtime.block_on(async {
            loop {
                match tokio::time::timeout(PATIENCE, connection.next()).await {
                    Ok(Some(event)) if wanted(&event) => return Ok(()),
                    Ok(Some(_)) => {}
                    Ok(None) | Err(_) => return Err(defect("a cable that was plugged in again stays dead")),
                }
            }
        })
    };
    let is_sample = |event: &Event| matches!(event, Event::Sample(_));
    let is_lost = |event: &Event| matches!(event, Event::Notice(armature_device::DeviceNotice::LineLost { .. }));
    until(&mut connection, is_sample)?;
    let mut took = Vec::with_capacity(times);
    for _ in 0..times {
        socket.pull(served)?;
        until(&mut connection, is_lost)?;
        served = socket.plug()?;
        let back = Instant::now();
        until(&mut connection, is_sample)?;
        took.push(back.elapsed().as_secs_f64() * 1e3);
    }
    runtime.block_on(connection.close());
    socket.pull(served)?;
    took.sort_by(f64::total_cmp);
    let worst = took.last().copied().unwrap_or(f64::NAN);
    Ok(vec![
        Measurement::new(NAMES[4], median(&took), "ms", times).at_most(500.0, "streams again within 500 ms"),
        Measurement::new(NAMES[5], worst, "ms", times).at_most(500.0, "streams again within 500 ms"),
    ])
}

/// Readings per second of sixteen servos at 1 Mbaud without return delay, on virtual time.
fn servo_rate(kind: BusKind, knows_fast_reads: bool) -> Result<(f64, usize), Failure> {
    let (protocol, model) = match kind {
        BusKind::Feetech => (ServoProtocol::Feetech, 777),
        BusKind::Dynamixel => (ServoProtocol::Dynamixel, 1190),
    };
    let joint = |id: u8| ServoJoint { id, name: format!("joint_{id}"), kind: PartKind::Bend, model };
    let arm = ServoArm {
        name: "sixteen".into(),
        title: "Sixteen servos".into(),
        protocol,
        baud: 1_000_000,
        joints: (1..=16).map(joint).collect(),
    };
    let servos = (1..=16).map(|id| SimulatedServo::new(id, model)).collect();
    let settings = ServoBusSettings { knows_fast_reads, ..ServoBusSettings::new(kind, 1_000_000, servos) };
    let mut bus = ServoBus::new(settings).map_err(|e| defect(e.to_string()))?;
    let mut session = ServoSession::new(arm, None, ServoSettings::default()).map_err(|e| defect(e.to_string()))?;
    session.start(2_000_000);
    let (mut now_nanos, mut events, mut readings) = (0_u64, Vec::new(), 0);
    // Two seconds to start up, and ten to count.
    let (from, counted) = (Duration::from_secs(2), Duration::from_secs(10));
    let to = from + counted;
    while Duration::from_nanos(now_nanos) < to {
        let now = Duration::from_nanos(now_nanos);
        session.tick(now, &mut events);
        let (baud, to_bus, mut to_host) = (session.line_baud(), session.take_outgoing(), Vec::new());
        bus.step(now_nanos, baud, &to_bus, &mut to_host);
        if !to_host.is_empty() {
            session.receive(now, &to_host, &mut events);
            let to_bus = session.take_outgoing();
            bus.step(now_nanos, session.line_baud(), &to_bus, &mut Vec::new());
        }
        let in_time = |event: &Event| matches!(event, Event::Sample(sample) if sample.received >= from);
        readings += events.drain(..).filter(in_time).count();
        let due = session.next_due().map(|at| at.as_nanos() as u64);
        let next = [due, bus.next_due_nanos()].into_iter().flatten().min().unwrap_or(u64::MAX);
        now_nanos = next.clamp(now_nanos + 1, now_nanos + 20_000_000);
    }
    Ok((readings as f64 / counted.as_secs_f64(), readings))
}
