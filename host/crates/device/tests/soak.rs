//! A long performance on a bad line, on virtual time: 32 joints at 1,000 Hz, one byte in a thousand damaged, and a
//! subtree that is unplugged and plugged in again every five seconds. `ARMATURE_FULL_SOAK` makes it ten minutes.

use std::collections::BTreeMap;
use std::time::Duration;

use armature_device::{Event, Sample, SensorState, Session, SessionSettings, Topology};
use armature_sim::{Body, Faults, Motion, Puppet, PuppetSettings, Truth, Unplugging};

const STEP_MICROS: u64 = 1_000;
const EVERY_SECONDS: u64 = 5;
const AWAY_MICROS: u64 = 1_000_000;
const COUNTS_PER_TURN: f64 = 16_384.0;

fn seconds() -> u64 {
    if std::env::var_os("ARMATURE_FULL_SOAK").is_some() { 601 } else { 21 }
}

fn puppet(seed: u64, seconds: u64) -> Puppet {
    let body = Body::preset("joints:32", 1).expect("a body");
    let part = body.parts().len() / 2;
    let pull =
        |turn: u64| Unplugging { part, at_micros: turn * EVERY_SECONDS * 1_000_000, for_micros: Some(AWAY_MICROS) };
    let unplugged = (1..=seconds / EVERY_SECONDS).map(pull).collect();
    Puppet::new(PuppetSettings {
        motion: Motion::Wiggle,
        seed,
        rest_micros: 0,
        random_zeros: false,
        topology_records: 8,
        // Each damaged byte has one flipped bit.
        faults: Faults { bit_flip: 0.001, unplugged, ..Faults::default() },
        ..PuppetSettings::new(body)
    })
    .expect("a puppet")
}

/// Checks every sample as it arrives, so that nothing has to be kept.
struct Checker {
    /// For each part's number, its sensors in the whole puppet.
    sensors: BTreeMap<[u8; 12], std::ops::Range<usize>>,
    columns: Vec<usize>,
    epoch: u16,
    last: Option<(u32, u64)>,
    delivered: u64,
    whole: usize,
    /// Device time at which the subtree was plugged in, until its samples arrive.
    longest_recovery: u64,
    incomplete_since: Option<u64>,
}

impl Checker {
    fn topology(&mut self, topology: &Topology) {
        self.epoch = topology.epoch;
        self.columns = topology.parts.iter().flat_map(|part| self.sensors[&part.uid.0].clone()).collect();
        assert_eq!(self.columns.len(), topology.sensor_count);
    }

    fn sample(&mut self, now_micros: u64, sample: &Sample, puppet: &Puppet) {
        assert_eq!(sample.epoch, self.epoch);
        assert_eq!(sample.counts.len(), self.columns.len());
        assert!(sample.states.iter().all(|&state| state == SensorState::Ok));
        if let Some((sequence, micros)) = self.last {
            assert!(sample.sequence > sequence && sample.device_micros > micros, "in order, and exactly once");
        }
        self.last = Some((sample.sequence, sample.device_micros));
        self.delivered += 1;
        // Only some samples are checked in full, so that ten minutes of them stay cheap.
        if sample.sequence.is_multiple_of(17) {
            let angles = puppet.true_angles(sample.device_micros);
            for (&count, &sensor) in sample.counts.iter().zip(&self.columns) {
                let expected = (angles[sensor] * COUNTS_PER_TURN / std::f64::consts::TAU).rem_euclid(COUNTS_PER_TURN);
                let apart = (f64::from(count) - expected).rem_euclid(COUNTS_PER_TURN);
                assert!(apart.min(COUNTS_PER_TURN - apart) <= 0.51, "sensor {sensor}: {count} instead of {expected}");
            }
        }
        // A sample that had to wait for its tree was received long before it is passed on here.
        if sample.counts.len() == self.whole {
            // The latest time at which it was plugged in.
            let period = EVERY_SECONDS * 1_000_000;
            let into = now_micros.checked_sub(period + AWAY_MICROS).map(|since| since % period);
            if let Some(since) = self.incomplete_since.take().and(into) {
                self.longest_recovery = self.longest_recovery.max(since);
            }
        } else {
            self.incomplete_since = Some(now_micros);
        }
    }
}

fn soak(seed: u64, seconds: u64) -> (Checker, Truth, armature_device::SessionCounters) {
    let mut puppet = puppet(seed, seconds);
    let mut session = Session::new(SessionSettings::default());
    session.start(1_000_000);
    let body = puppet.body().clone();
    let sensors = body.parts().iter().enumerate().map(|(index, part)| (part.uid.0, body.sensors(index))).collect();
    let mut checker = Checker {
        sensors,
        columns: Vec::new(),
        epoch: 0,
        last: None,
        delivered: 0,
        whole: body.sensor_count(),
        longest_recovery: 0,
        incomplete_since: None,
    };
    let (mut bytes, mut events) = (Vec::new(), Vec::new());
    let mut early = 0;
    // A little more than whole seconds, so that nothing is in flight at the end.
    for micros in (0..seconds * 1_000_000 + 700_000).step_by(STEP_MICROS as usize) {
        if micros == seconds * 250_000 {
            early = resident_kib();
        }
        let now = Duration::from_micros(micros);
        session.tick(now, &mut events);
        bytes.clear();
        puppet.step(micros, &session.take_outgoing(), &mut bytes);
        session.receive(now, &bytes, &mut events);
        for event in events.drain(..) {
            match event {
                Event::Topology(topology) => checker.topology(&topology),
                Event::Sample(sample) => checker.sample(micros, &sample, &puppet),
                Event::Problem(problem) => panic!("seed {seed} at {now:?}: {problem}"),
                Event::Restarted => panic!("seed {seed} at {now:?}: nothing restarted"),
                _ => {}
            }
        }
    }
    let grown = resident_kib().saturating_sub(early);
    assert!(grown < 4_096, "seed {seed}: memory has grown by {grown} KiB over the last three quarters");
    (checker, puppet.truth(), session.counters())
}

/// Memory in use, KiB; 0 if the system does not report it.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|rest| rest.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

#[test]
fn every_intact_sample_comes_exactly_once_and_a_subtree_is_back_quickly() {
    let seconds = seconds();
    for seed in if seconds > 100 { 1..2 } else { 1..4 } {
        let (checker, truth, counters) = soak(seed, seconds);
        let intact = truth.samples_sent - truth.samples_damaged;
        println!(
            "seed {seed}, {seconds} s: {} samples taken, {intact} arrived intact, {} delivered, {} frames damaged, \
             {} reported as wrong, subtree back within {} ms",
            truth.samples_taken,
            checker.delivered,
            truth.frames_damaged,
            counters.checksum_errors + counters.framing_errors,
            checker.longest_recovery / 1_000,
        );
        assert_eq!(checker.delivered + counters.unusable_samples, intact, "seed {seed}");
        assert_eq!(counters.unusable_samples, 0, "seed {seed}: no intact sample is thrown away");
        assert_eq!(
            counters.samples + counters.lost_samples,
            truth.samples_taken - trailing(&checker, truth),
            "seed {seed}"
        );
        assert_eq!(truth.topology_changes, 2 * (seconds / EVERY_SECONDS), "seed {seed}");
        assert!(checker.longest_recovery <= 200_000, "seed {seed}: {} us", checker.longest_recovery);
        assert_eq!((counters.connections, counters.restarts), (1, 0), "seed {seed}");
    }
}

/// Samples after the last one delivered; nobody can know of them yet.
fn trailing(checker: &Checker, truth: Truth) -> u64 {
    truth.samples_taken - 1 - checker.last.map_or(0, |(sequence, _)| u64::from(sequence))
}
