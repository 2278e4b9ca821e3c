//! Devices that lie, and lines at the wrong speed: named, explained, survived.

mod common;

use armature_device::{DeviceNotice, DeviceProblem, Event, MAX_PARTS, TopologyProblem};
use common::{World, puppet};
use firmware_protocol::{Encode, EncodeError, FrameWriter, HostMessage, message_type};

/// A session with a device that tells the truth from its third second on.
fn repented(mut world: World, repent: impl FnOnce(&mut World)) -> World {
    world.session.start(100_000);
    world.run(3_000);
    repent(&mut world);
    let before = world.session.counters().samples;
    world.run(3_000);
    let since = world.session.counters().samples - before;
    assert!(since > 100, "it is used as soon as it tells the truth: {since} samples");
    world
}

#[test]
fn trees_that_cannot_be_are_named_explained_and_survived() {
    let cyclic = {
        let mut parts = puppet(7);
        // Six hangs on seven and seven on six.
        (parts[6].parent, parts[7].parent) = (Some(7), Some(6));
        (parts, TopologyProblem::ParentAfterChild { part: 6, parent: 7 })
    };
    let own_parent = {
        let mut parts = puppet(3);
        parts[2].parent = Some(2);
        (parts, TopologyProblem::ParentAfterChild { part: 2, parent: 2 })
    };
    let twins = {
        let mut parts = puppet(3);
        parts[3].uid = parts[1].uid;
        let uid = parts[1].uid;
        (parts, TopologyProblem::DuplicateUid { uid })
    };
    for (parts, problem) in [cyclic, own_parent, twins] {
        let world = repented(World::new(parts), |world| world.device.parts = puppet(3));
        assert_eq!(world.problems(), [&DeviceProblem::TopologyInvalid(problem)]);
        let words = world.problems()[0].to_string();
        assert!(words.contains("unplug and replug that part, or update the device's firmware"), "{words}");
    }
}

/// Ten thousand splitters, as far as a message goes.
struct Many {
    first: u16,
}

impl Encode for Many {
    fn message_type(&self) -> u8 {
        message_type::TOPOLOGY
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_bytes(&1_u16.to_le_bytes());
        writer.put_bytes(&10_000_u16.to_le_bytes());
        writer.put_bytes(&self.first.to_le_bytes());
        writer.put_bytes(&[46, 22]);
        for index in self.first..self.first + 46 {
            let parent = index.checked_sub(1).unwrap_or(u16::MAX);
            let mut record = [0; 22];
            (record[0], record[3]) = (4, 1);
            record[4..6].copy_from_slice(&parent.to_le_bytes());
            record[6..8].copy_from_slice(&index.to_le_bytes());
            writer.put_bytes(&record);
        }
        Ok(())
    }
}

#[test]
fn ten_thousand_parts_are_refused_at_the_first_message() {
    let mut world = World::new(puppet(3));
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.session.start(100_000);
    world.run(100);
    for first in (0..9_900).step_by(46) {
        world.device.say(&Many { first });
    }
    let world = repented(world, |world| world.device.deaf_to.clear());
    let problem = DeviceProblem::TopologyInvalid(TopologyProblem::TooManyParts { part_count: 10_000 });
    assert_eq!(world.problems(), [&problem]);
    assert!(problem.to_string().contains(&format!("{MAX_PARTS} are possible")), "{problem}");
}

#[test]
fn samples_of_an_epoch_that_is_never_described_are_named() {
    let mut world = World::new(puppet(3));
    world.device.claimed_epoch = Some(99);
    let world = repented(world, |world| world.device.claimed_epoch = None);
    assert_eq!(world.problems(), [&DeviceProblem::UnknownEpoch { sample: 99, tree: 1 }]);
    assert!(world.problems()[0].to_string().contains("firmware"));
    let asked = world.device.heard.iter().filter(|message| matches!(message, HostMessage::TopologyRequest)).count();
    assert!(asked < 200, "it is not asked without end: {asked} times in three seconds");
    let counters = world.session.counters();
    assert_eq!(counters.samples + counters.lost_samples, u64::from(world.device.taken), "all are accounted for");
}

#[test]
fn a_clock_that_runs_backwards_is_named_once_and_survived() {
    let mut world = World::new(puppet(3));
    // Half a second of its clock, then a jump back by a second, again and again.
    world.device.clock = |sequence, micros| 100_000_000 + micros - u64::from(sequence / 50) * 1_000_000;
    world.session.start(100_000);
    world.run(20_000);
    let problems = world.problems();
    assert!(matches!(problems[..], [DeviceProblem::ClockRunsBackwards { times: 4, .. }]), "{problems:?}");
    assert!(problems[0].to_string().contains("power supply"), "{}", problems[0]);
    assert!(world.sample_sequences().len() > 500, "what comes between is used: {}", world.sample_sequences().len());
    let mut last = 0;
    for event in &world.events {
        match event {
            Event::Restarted => last = 0,
            Event::Sample(sample) => {
                assert!(sample.device_micros >= last, "between restarts time does not go back");
                last = sample.device_micros;
            }
            _ => {}
        }
    }
    world.device.clock = |_, micros| 200_000_000 + micros;
    world.events.clear();
    world.run(30_000);
    assert!(world.problems().is_empty() && world.sample_sequences().len() > 2_900);
}

/// A stream of ten seconds at 100 Hz from a device with this clock, and its samples.
fn with_clock(clock: fn(u32, u64) -> u64) -> (World, Vec<armature_device::Sample>) {
    let mut world = World::new(puppet(3));
    world.device.clock = clock;
    world.session.start(100_000);
    world.run(10_000);
    let mut samples = Vec::new();
    for event in &world.events {
        if let Event::Sample(sample) = event {
            samples.push(sample.clone());
        }
    }
    (world, samples)
}

/// From the first to the last sample by their own times, seconds.
fn lasted(samples: &[armature_device::Sample]) -> f64 {
    (samples[samples.len() - 1].device_micros - samples[0].device_micros) as f64 * 1e-6
}

#[test]
fn one_leap_of_the_clock_costs_its_sample_and_nothing_else() {
    for clock in [
        |sequence, micros| micros + if sequence == 500 { 1 << 32 } else { 0 },
        |sequence, micros| micros + if sequence == 500 { 1 << 63 } else { 0 },
    ] {
        let (world, samples) = with_clock(clock);
        assert!((lasted(&samples) - 9.9).abs() < 0.1, "{}", lasted(&samples));
        assert!(samples.iter().all(|sample| sample.sequence != 500));
        let counters = world.session.counters();
        assert_eq!((counters.clock_faults, counters.lost_samples, counters.restarts), (1, 1, 0));
        assert_eq!(world.lost(), 1, "the take hears of it too");
        let leaps = world.events.iter().filter(|e| matches!(e, Event::Notice(DeviceNotice::ClockLeaps { .. })));
        assert_eq!(leaps.count(), 1);
    }
}

#[test]
fn a_clock_that_stands_or_steps_back_is_named_and_times_are_rebuilt() {
    let (stands, samples) = with_clock(|sequence, micros| if sequence < 100 { micros } else { 1_000_000 });
    assert!((lasted(&samples) - 9.9).abs() < 0.1, "{}", lasted(&samples));
    let notices = |world: &World| world.events.iter().filter(|e| matches!(e, Event::Notice(_))).count();
    assert_eq!((notices(&stands), stands.session.counters().restarts, stands.lost()), (1, 0, 0));
    assert!(stands.events.iter().any(|e| matches!(e, Event::Notice(DeviceNotice::ClockStands { .. }))));
    let (back, samples) = with_clock(|sequence, micros| 5_000_000 + micros - if sequence < 500 { 0 } else { 900_000 });
    assert!((lasted(&samples) - 9.9).abs() < 0.1, "{}", lasted(&samples));
    assert_eq!((notices(&back), back.session.counters().restarts, back.lost()), (1, 0, 0));
    assert!(back.events.iter().any(|e| matches!(e, Event::Notice(DeviceNotice::ClockStepsBack { .. }))));
    let steps = samples.windows(2).map(|pair| pair[1].device_micros - pair[0].device_micros);
    assert!(steps.into_iter().all(|step| step == 10_000));
}

#[test]
fn what_cannot_be_used_is_reported_as_lost_just_as_it_is_counted() {
    // A sample in a hundred has a sensor too many.
    let mut world = World::new(puppet(3));
    world.device.extra_sensor_every = Some(100);
    world.session.start(100_000);
    world.run(10_000);
    let counters = world.session.counters();
    assert!(counters.unusable_samples >= 9, "{counters:?}");
    assert_eq!(world.lost(), counters.lost_samples);
    // In mid-stream the tree becomes one that cannot be, until somebody puts it right.
    let mut parts = puppet(3);
    parts[2].parent = Some(2);
    world.device.extra_sensor_every = None;
    world.device.change_tree(parts);
    world.run(5_000);
    world.device.change_tree(puppet(3));
    world.run(5_000);
    // Those that still wait for their tree are given up with the device.
    world.device.restart(world.now);
    world.run(2_000);
    let counters = world.session.counters();
    assert!(counters.unusable_samples > 300, "{counters:?}");
    assert_eq!(world.lost(), counters.lost_samples);
}

#[test]
fn a_rate_of_a_million_is_named_and_a_flood_fills_no_memory() {
    let mut world = World::new(puppet(1));
    world.device.max_rate_millihertz = 1_000_000_000;
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.session.start(1_000_000_000);
    world.run(1);
    // The tree arrives, so the stream is requested; then the tree changes without notice.
    world.device.deaf_to.clear();
    world.run(600);
    let notices: Vec<_> = world.events.iter().filter(|event| matches!(event, Event::Notice(_))).collect();
    let [Event::Notice(notice @ DeviceNotice::ImpossibleRate { .. })] = notices[..] else { panic!("{notices:?}") };
    assert!(notice.to_string().contains("1000000 samples a second"), "{notice}");
    // At a million a second every sample that came was handed on.
    let counters = world.session.counters();
    assert!(counters.samples > 50_000, "{counters:?}");
    assert_eq!(counters.samples, u64::from(world.device.taken));
    world.events.clear();
    world.device.claimed_epoch = Some(7);
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.run(100);
    let counters = world.session.counters();
    assert!(counters.unusable_samples > 90_000, "those that wait are bounded: {counters:?}");
}

/// What a UART at one speed reads of what another one sends at another: 8N1, lowest bit first, sampled in the middle.
struct WrongSpeed {
    sent: Vec<bool>,
    ratio: f64,
}

impl WrongSpeed {
    fn hear(&mut self, bytes: &[u8]) -> Vec<u8> {
        for byte in bytes {
            self.sent.push(false);
            self.sent.extend((0..8).map(|bit| byte >> bit & 1 == 1));
            self.sent.push(true);
        }
        let level = |at: f64| self.sent.get(at as usize).copied().unwrap_or(true);
        let (mut heard, mut at) = (Vec::new(), 0.0);
        while (at as usize) < self.sent.len() {
            if level(at) {
                at += 0.25;
                continue;
            }
            let bit = |number: f64| level(at + (number + 0.5) * self.ratio);
            let byte = (0..8).fold(0, |byte, number| byte | u8::from(bit(f64::from(number) + 1.0)) << number);
            heard.push(byte);
            at += 9.5 * self.ratio;
        }
        self.sent.clear();
        heard
    }
}

#[test]
fn a_device_that_answers_at_the_wrong_speed_is_named_and_explained() {
    for ratio in [0.5, 2.0, 3_000_000.0 / 921_600.0, 115_200.0 / 1_000_000.0] {
        let mut world = World::new(puppet(17));
        // It was started by a program that knew its speed, and still streams.
        world.device.streaming = true;
        world.device.sequence = 77;
        world.device.deaf_to = vec![message_type::HELLO_REQUEST];
        world.session.start(100_000);
        let mut line = WrongSpeed { sent: Vec::new(), ratio };
        world.run_with(5_000, |bytes| line.hear(&bytes));
        let [DeviceProblem::Garbage { .. }] = world.problems()[..] else { panic!("{ratio}: {:?}", world.problems()) };
        let words = world.problems()[0].to_string();
        assert!(words.contains("the line speed is wrong") && words.contains("@BAUD"), "{words}");
        assert_eq!(world.session.counters().frames, 0, "{ratio}: nothing is invented");
    }
}

/// Bytes come in clumps, as from a USB adapter that holds them back for 16 ms: every sample is handed on with the read
/// that brought its last byte, and its time is the device's own, not that of the clump.
#[test]
fn jitter_delays_no_sample_and_is_not_in_its_time() {
    let mut world = World::new(puppet(6));
    world.session.start(500_000);
    let (mut clump, mut at) = (Vec::new(), 0_u64);
    world.run_with(20_000, |bytes| {
        clump.extend(bytes);
        at += 1;
        if at.is_multiple_of(16) { std::mem::take(&mut clump) } else { Vec::new() }
    });
    let clock = world.session.clock().expect("pings were answered");
    let mut samples = Vec::new();
    for event in &world.events {
        if let Event::Sample(sample) = event {
            // This device's clock shows the world's time.
            let truth = sample.device_micros as f64 * 1e-6;
            samples.push((sample.received.as_secs_f64(), clock.session_seconds(sample.device_micros), truth));
        }
    }
    assert!(samples.len() > 9_000, "{}", samples.len());
    for pair in samples.windows(2) {
        let (taken, period) = (pair[1].1, pair[1].1 - pair[0].1);
        assert!((period - 0.002).abs() < 1e-5, "evenly taken: {period}");
        let truth = pair[1].2;
        assert!((taken - truth).abs() <= clock.error_seconds(taken), "{taken}");
        assert!(pair[1].0 >= truth - 1e-9 && pair[1].0 - truth < 0.0161, "handed on with its clump: {pair:?}");
    }
    assert_eq!((world.lost(), world.session.counters().restarts), (0, 0));
}
