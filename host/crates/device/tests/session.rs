//! The session against a device on virtual time: the way it should go, and everything that goes wrong.

mod common;

use std::time::Duration;

use armature_device::{
    DeviceNotice, DeviceProblem, Event, PartKind, PartUid, RefusalReason, RequestKind, SensorState, Session,
    SessionSettings, Topology, TopologyProblem,
};
use common::{Noise, World, expected_count, part, puppet};
use firmware_protocol::{HostMessage, message_type};

#[test]
fn hello_topology_rate_and_samples_follow_each_other() {
    let mut world = World::new(puppet(17));
    world.session.start(200_000);
    world.run(1_000);
    let [
        Event::Connected(info),
        Event::Topology(topology),
        Event::RateGranted { asked_millihertz: 200_000, granted_millihertz: 200_000 },
        Event::Started,
    ] = world.milestones()[..]
    else {
        panic!("{:?}", world.milestones())
    };
    assert_eq!((info.name.as_str(), info.uid, info.firmware), ("fake", common::UID, [1, 2, 3]));
    assert_eq!((topology.parts.len(), topology.sensor_count, topology.epoch), (18, 51, 1));
    assert_eq!(world.session.topology(), Some(topology));
    let sequences = world.sample_sequences();
    assert_eq!(sequences, (0..world.device.taken).collect::<Vec<_>>(), "every sample the device took");
    assert!(sequences.len() > 190);
    for event in &world.events {
        if let Event::Sample(sample) = event {
            assert_eq!(sample.device_micros, sample.received.as_micros() as u64);
            assert!(sample.states.iter().all(|&state| state == SensorState::Ok));
            let expected: Vec<u16> = (0..51).map(|sensor| expected_count(sample.sequence, sensor)).collect();
            assert_eq!(sample.counts, expected);
        }
    }
    let counters = world.session.counters();
    assert_eq!((counters.samples, counters.lost_samples), (u64::from(world.device.taken), 0));
    assert_eq!((counters.connections, counters.repeated_requests, counters.checksum_errors), (1, 0, 0));
}

#[test]
fn stop_is_clean_and_start_works_again() {
    let mut world = World::streaming(puppet(3));
    world.session.stop();
    world.run(100);
    assert_eq!(world.milestones(), [&Event::Stopped]);
    assert!(matches!(world.events.last(), Some(Event::Stopped | Event::Clock(_))), "nothing comes behind the stop");
    assert!(!world.session.is_streaming() && !world.device.streaming);
    world.events.clear();
    world.session.start(100_000);
    world.run(500);
    assert_eq!(world.lost(), 0);
    assert_eq!(world.sample_sequences()[..3], [0, 1, 2]);
}

#[test]
fn start_right_behind_stop_waits_for_the_stop() {
    let mut world = World::streaming(puppet(3));
    world.session.stop();
    world.session.tick(world.now, &mut world.events);
    world.session.start(100_000);
    world.run(500);
    assert_eq!(world.milestones(), [&Event::Stopped, &Event::Started]);
    assert_eq!((world.lost(), world.session.counters().restarts), (0, 0));
}

#[test]
fn the_rate_can_change_in_mid_stream_and_is_the_one_granted() {
    let mut world = World::streaming(puppet(3));
    world.session.start(5_000_000);
    world.run(200);
    let granted = Event::RateGranted { asked_millihertz: 5_000_000, granted_millihertz: 1_000_000 };
    assert_eq!(world.milestones(), [&granted]);
    assert_eq!(world.lost(), 0);
    assert!(world.sample_sequences().len() > 150);
}

#[test]
fn a_name_moves_no_cursor() {
    let mut world = World::new(puppet(1));
    world.device.name = "\u{1b}[2JMine\n\u{7}";
    world.session.start(100_000);
    world.run(100);
    assert_eq!(world.session.device().unwrap().name, "\u{fffd}[2JMine\u{fffd}\u{fffd}");
}

/// As of a modular puppet whose root has no power: the guide tells what to do.
#[test]
fn a_puppet_without_a_single_part_is_described_as_that() {
    let mut world = World::new(Vec::new());
    world.session.start(100_000);
    world.run(500);
    let topology = world.session.topology().expect("a tree without parts is a tree");
    assert_eq!((topology.parts.len(), topology.sensor_count), (0, 0));
    assert_eq!(world.problems(), Vec::<&DeviceProblem>::new());
    // The root answers at last.
    world.device.change_tree(puppet(2));
    world.run(500);
    assert_eq!(world.session.topology().map(|tree| tree.parts.len()), Some(3));
}

#[test]
fn a_silent_device_is_named_once_and_asked_on() {
    let mut world = World::new(puppet(1));
    world.run_with(10_000, |_| Vec::new());
    assert_eq!(world.problems(), [&DeviceProblem::Silent { seconds: 4 }]);
    let asked = world.device.heard.iter().filter(|message| matches!(message, HostMessage::HelloRequest { .. })).count();
    assert!((35..=41).contains(&asked), "one hello request each quarter of a second: {asked}");
    world.run(300);
    assert!(world.session.device().is_some(), "it is found when it speaks at last");
}

#[test]
fn a_boot_loader_that_comes_first_is_waited_for_and_the_session_says_so() {
    let mut world = World::new(puppet(1));
    world.session.start(100_000);
    // It says something of its own at another speed, and hears nothing.
    let mut noise = Noise(1);
    for millis in [700, 700, 700] {
        world.run_with(millis, |_| Vec::new());
        world.run_with(1, |_| noise.bytes(3));
        world.device.heard.clear();
        (world.device.streaming, world.device.sequence) = (false, 0);
    }
    assert_eq!(world.events, [Event::Notice(DeviceNotice::WaitsForStart)], "2.1 s are no problem, and told once");
    // What the boot loader said last costs the first answer.
    world.run(600);
    assert!(world.session.is_streaming());
    assert_eq!(world.problems(), Vec::<&DeviceProblem>::new());
    // The same again after the cable was out.
    world.events.clear();
    let now = world.now;
    world.session.line_opened(now, &mut world.events);
    world.run_with(3_000, |_| Vec::new());
    assert_eq!(world.milestones(), [&Event::Restarted, &Event::Notice(DeviceNotice::WaitsForStart)]);
}

#[test]
fn garbage_is_named_and_gives_no_silence() {
    let mut world = World::new(puppet(1));
    let mut noise = Noise(1);
    world.run_with(5_000, |_| noise.bytes(11));
    let [DeviceProblem::Garbage { bytes, seconds: 4 }] = world.problems()[..] else { panic!("{:?}", world.problems()) };
    assert!((40_000..45_000).contains(bytes), "{bytes}");
    assert_eq!(world.session.counters().frames, 0);
    world.run(300);
    assert!(world.session.device().is_some(), "it is found when the noise ends");
}

#[test]
fn another_major_version_is_named_and_left_alone() {
    for major in [0, 2] {
        let mut world = World::new(puppet(1));
        world.device.major = major;
        world.session.start(100_000);
        world.run(1_000);
        let problem = DeviceProblem::WrongMajor { theirs: major, ours: 1 };
        assert_eq!(world.problems(), [&problem]);
        let update = if major > 1 { "update this program" } else { "update the device's firmware" };
        assert!(problem.to_string().ends_with(update), "{problem}");
        assert_eq!(world.device.heard.len(), 1, "nothing but the first hello request is sent");
        world.device.major = 1;
        world.device.restart(world.now);
        world.run(500);
        assert!(world.session.is_streaming(), "after an update it is taken");
    }
}

#[test]
fn a_second_of_noise_costs_just_the_samples_it_covers() {
    for seed in 1..20 {
        let mut world = World::streaming(puppet(6));
        let before = world.device.taken;
        let mut noise = Noise(seed);
        world.run_with(1_000, |bytes| if bytes.is_empty() { noise.bytes(3) } else { noise.bytes(bytes.len()) });
        let missing = world.device.taken - before;
        world.run(1_000);
        let arrived = world.sample_sequences();
        let [Event::Lost { count, next_sequence }] = world
            .milestones()
            .into_iter()
            .filter(|event| !matches!(event, Event::Noise { .. }))
            .collect::<Vec<_>>()[..]
        else {
            panic!("seed {seed}: {:?}", world.milestones())
        };
        // The first frame behind the noise may be lost with it.
        assert!(*count == missing || *count == missing + 1, "seed {seed}: {count} of {missing}");
        assert_eq!(arrived.first(), Some(next_sequence));
        assert_eq!(arrived.len() as u32 + count, world.device.taken - before, "seed {seed}: each is lost or here");
        let counters = world.session.counters();
        assert_eq!(counters.samples + counters.lost_samples, u64::from(world.device.taken));
        assert_eq!((counters.restarts, counters.connections), (0, 1));
        assert!(counters.discarded_bytes > 1_000 && counters.framing_errors > 0);
        assert!(world.problems().is_empty(), "{:?}", world.problems());
    }
}

#[test]
fn single_damaged_frames_are_counted_exactly_and_in_place() {
    let mut world = World::streaming(puppet(6));
    let before = world.device.taken;
    let mut samples = 0;
    world.run_with(1_000, |mut bytes| {
        if bytes.len() > 60 {
            samples += 1;
            if samples % 10 == 0 {
                bytes[30] ^= 0x04;
            }
        }
        bytes
    });
    world.run(20);
    assert_eq!(world.lost(), 10);
    assert_eq!(world.session.counters().checksum_errors + world.session.counters().framing_errors, 10);
    assert_eq!(world.sample_sequences().len() as u32 + 10, world.device.taken - before);
    let milestones = world.milestones();
    for pair in milestones.chunks(2) {
        assert!(matches!(pair, [Event::Noise { bytes: 66.., .. }, Event::Lost { count: 1, .. }]), "{pair:?}");
    }
}

#[test]
fn repeated_bytes_give_no_sample_twice() {
    let mut world = World::streaming(puppet(2));
    world.run_with(1_000, |bytes| [bytes.as_slice(), &bytes].concat());
    let sequences = world.sample_sequences();
    assert!(sequences.is_sorted_by(|a, b| a < b));
    let counters = world.session.counters();
    assert_eq!((world.lost(), counters.restarts), (0, 0));
    assert_eq!(counters.duplicate_samples, sequences.len() as u64);
}

#[test]
fn a_part_plugged_in_while_streaming_costs_no_sample() {
    let mut world = World::streaming(puppet(4));
    let before = world.device.taken;
    world.device.change_tree(puppet(5));
    world.run(500);
    let [Event::Topology(Topology { epoch: 2, sensor_count: 15, .. })] = world.milestones()[..] else {
        panic!("{:?}", world.milestones())
    };
    assert_eq!(world.sample_sequences().len() as u32, world.device.taken - before);
    samples_fit_their_topology(&world.events);
}

#[test]
fn a_tree_that_changes_unannounced_is_noticed_by_its_samples() {
    let mut world = World::streaming(puppet(4));
    let before = world.device.taken;
    (world.device.parts, world.device.epoch) = (puppet(2), 9);
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.run(300);
    assert!(world.sample_sequences().is_empty(), "samples wait for their topology");
    world.device.deaf_to.clear();
    world.run(700);
    assert_eq!(world.sample_sequences().len() as u32, world.device.taken - before, "and come late, but all");
    samples_fit_their_topology(&world.events);
}

#[test]
fn samples_that_wait_too_long_for_their_topology_are_lost_and_counted() {
    let mut world = World::new(puppet(1));
    world.session.start(1_000_000);
    world.run(500);
    let before = world.session.counters().samples;
    assert_eq!(before, u64::from(world.device.taken));
    world.device.parts = puppet(2);
    world.device.epoch = 2;
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.run(3_000);
    world.device.deaf_to.clear();
    world.run(1_500);
    let counters = world.session.counters();
    assert_eq!(counters.samples + counters.lost_samples, u64::from(world.device.taken));
    assert!((900..1_600).contains(&counters.unusable_samples), "{counters:?}");
}

/// Every sample comes behind a topology of its epoch and has its length.
fn samples_fit_their_topology(events: &[Event]) {
    let mut known: Option<&Topology> = None;
    for event in events {
        match event {
            Event::Topology(topology) => known = Some(topology),
            Event::Sample(sample) => {
                if let Some(topology) = known {
                    assert_eq!((sample.epoch, sample.counts.len()), (topology.epoch, topology.sensor_count));
                }
            }
            _ => {}
        }
    }
}

#[test]
fn a_device_that_restarts_is_taken_up_again() {
    let mut world = World::streaming(puppet(4));
    world.device.restart(world.now);
    world.run(1_000);
    assert!(
        matches!(
            world.milestones()[..],
            [Event::Restarted, Event::Connected(_), Event::Topology(_), Event::RateGranted { .. }, Event::Started]
        ),
        "{:?}",
        world.milestones()
    );
    assert_eq!((world.lost(), world.session.counters().restarts), (0, 1));
    assert!(world.session.clock().is_some_and(|clock| (clock.offset_seconds + 1.0).abs() < 0.01));
}

#[test]
fn a_restart_whose_hello_is_lost_is_noticed_all_the_same() {
    for keeps_streaming in [false, true] {
        let mut world = World::streaming(puppet(4));
        world.device.restart(world.now);
        world.device.streaming = keeps_streaming;
        world.device.take_outgoing();
        world.run(3_000);
        assert!(world.session.is_streaming() && world.device.streaming);
        assert_eq!(world.session.counters().restarts, 1, "keeps streaming: {keeps_streaming}");
        assert!(world.sample_sequences().len() > 100);
        samples_fit_their_topology(&world.events);
    }
}

#[test]
fn a_hello_answered_twice_is_no_restart() {
    let mut world = World::new(puppet(2));
    world.session.start(100_000);
    let mut delayed = std::collections::VecDeque::from(vec![Vec::new(); 400]);
    world.run_with(1_500, |bytes| {
        delayed.push_back(bytes);
        delayed.pop_front().unwrap_or_default()
    });
    assert_eq!((world.session.counters().restarts, world.session.counters().connections), (0, 1));
}

#[test]
fn every_answer_lost_once_is_asked_for_again() {
    let mut dropped = Vec::new();
    let mut world = World::new(puppet(2));
    world.session.start(100_000);
    world.run_with(3_000, |bytes| {
        let mut decoder = firmware_protocol::Decoder::new();
        let first = decoder.next_frame(&mut bytes.as_slice()).map(|frame| frame.message_type);
        match first {
            Some(kind) if kind != message_type::SAMPLE && !dropped.contains(&kind) => {
                dropped.push(kind);
                Vec::new()
            }
            _ => bytes,
        }
    });
    assert_eq!(dropped.len(), 5, "hello, topology, rate, start and pong: {dropped:02x?}");
    assert!(world.session.is_streaming());
    assert!(world.session.counters().repeated_requests >= 3);
    assert!(world.problems().is_empty(), "{:?}", world.problems());
    let total = world.sample_sequences().len() as u64 + world.lost();
    assert_eq!(total, u64::from(world.device.taken), "also the samples dropped with the start's answer are counted");
}

#[test]
fn a_request_never_answered_is_named() {
    let mut world = World::new(puppet(2));
    world.device.deaf_to = vec![message_type::SET_RATE];
    world.session.start(100_000);
    world.run(3_000);
    let problem = DeviceProblem::NoAnswer { request: RequestKind::SetRate };
    assert_eq!(world.problems(), [&problem]);
    world.device.deaf_to.clear();
    world.run(1_000);
    assert!(world.session.is_streaming());
}

#[test]
fn refusals_are_told_once_and_tried_again_slowly() {
    let mut world = World::new(puppet(2));
    world.device.refuses = vec![(message_type::START, RefusalReason::SensorBusFailed)];
    world.session.start(100_000);
    world.run(5_000);
    let problem = DeviceProblem::Refused { request: RequestKind::Start, reason: RefusalReason::SensorBusFailed };
    assert_eq!(world.problems(), [&problem]);
    world.device.refuses.clear();
    world.run(1_500);
    assert!(!world.sample_sequences().is_empty());
}

#[test]
fn parts_blink_and_unknown_ones_are_refused() {
    let mut world = World::streaming(puppet(2));
    world.session.blink(PartUid([1; 12]), 500);
    world.run(50);
    assert_eq!(world.milestones(), [&Event::Blinking { uid: PartUid([1; 12]) }]);
    world.events.clear();
    world.session.blink(PartUid([99; 12]), 500);
    world.run(50);
    let refused = DeviceProblem::Refused { request: RequestKind::Blink, reason: RefusalReason::NoSuchPart };
    assert_eq!(world.problems(), [&refused]);
    world.device.deaf_to = vec![message_type::BLINK];
    world.session.blink(PartUid([1; 12]), 500);
    world.run(4_000);
    assert_eq!(world.session.counters().connections, 1, "a blink without answer disturbs nothing");
    assert_eq!(world.lost(), 0);
}

#[test]
fn a_tree_that_cannot_be_is_named_and_asked_for_again() {
    let mut parts = puppet(3);
    parts[2].outlet = 0;
    let mut world = World::new(parts);
    world.session.start(100_000);
    world.run(3_000);
    let problem = TopologyProblem::OutletTaken { part: 2, parent: 0, outlet: 0 };
    assert_eq!(world.problems(), [&DeviceProblem::TopologyInvalid(problem)]);
    world.device.parts = puppet(3);
    world.run(1_500);
    assert!(world.session.is_streaming(), "it goes on when the tree is right");
}

#[test]
fn a_tree_of_many_messages_is_put_together() {
    let mut parts = puppet(140);
    parts.extend((0..10).map(|n| part(PartKind::Other(50), Some(140 + n), 0, 200 + n as u8)));
    let mut world = World::new(parts.clone());
    world.session.start(100_000);
    world.run(500);
    assert_eq!(world.session.topology().map(|tree| (tree.parts.len(), tree.sensor_count)), Some((151, 420)));
    assert_eq!(world.session.topology().map(|tree| &tree.parts), Some(&parts));
}

#[test]
fn a_puppet_without_parts_streams_empty_samples() {
    let mut world = World::streaming(vec![]);
    world.run(500);
    assert_eq!(world.sample_sequences().len(), 50);
}

#[test]
fn samples_of_the_wrong_length_are_not_handed_on() {
    let mut world = World::streaming(puppet(4));
    world.device.parts = puppet(3);
    world.device.deaf_to = vec![message_type::TOPOLOGY_REQUEST];
    world.run(500);
    assert!(world.sample_sequences().is_empty());
    let problem = DeviceProblem::SampleDoesNotFit { epoch: 1, expected: 12, found: 9 };
    assert_eq!(world.problems(), [&problem]);
    world.device.deaf_to.clear();
    world.run(1_000);
    assert!(world.sample_sequences().len() > 50, "the tree was asked for again");
}

#[test]
fn messages_of_later_versions_are_skipped_and_counted() {
    use firmware_protocol::{Encode, EncodeError, FrameWriter};
    struct Later(u8, &'static [u8]);
    impl Encode for Later {
        fn message_type(&self) -> u8 {
            self.0
        }
        fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
            writer.put_bytes(self.1);
            Ok(())
        }
    }
    let mut world = World::streaming(puppet(2));
    world.device.say(&Later(0xC0, b"battery"));
    world.device.say(&Later(message_type::SAMPLE, b"short"));
    world.device.say(&Later(message_type::TOPOLOGY, &[0; 8]));
    world.run(100);
    let counters = world.session.counters();
    assert_eq!((counters.unknown_messages, counters.malformed_messages), (1, 2));
    assert!(world.milestones().is_empty() && world.lost() == 0);
}

#[test]
fn any_bytes_from_a_device_do_no_harm() {
    let mut noise = Noise(99);
    let golden: Vec<Vec<u8>> = include_str!("../../../../firmware-protocol/golden.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once(" = "))
        .map(|(_, hex)| (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect())
        .collect();
    let mut session = Session::new(SessionSettings::default());
    let mut events = Vec::new();
    session.start(1);
    for step in 0..200_000u64 {
        let frame = &golden[noise.next() as usize % golden.len()];
        let now = Duration::from_micros(step * 700);
        session.receive(now, frame, &mut events);
        if noise.next().is_multiple_of(50) {
            session.receive(now, &noise.bytes(20), &mut events);
        }
        session.tick(now, &mut events);
        session.take_outgoing();
        events.clear();
    }
    assert!(session.counters().frames > 190_000);
}

#[test]
fn the_same_bytes_at_the_same_times_give_the_same_events() {
    let run = || {
        let mut noise = Noise(3);
        let mut world = World::new(puppet(5));
        world.session.start(250_000);
        world.run_with(2_000, |mut bytes| {
            if let (true, Some(byte)) = (noise.next().is_multiple_of(20), bytes.last_mut()) {
                *byte ^= 0x10;
            }
            bytes
        });
        (world.events, world.session.counters())
    };
    assert_eq!(run(), run());
}

/// A program that died has left the device streaming.
#[test]
fn a_device_that_already_streams_is_stopped_and_asked_properly() {
    let mut world = World::new(puppet(3));
    world.device.streaming = true;
    world.device.sequence = 5_000;
    world.device.step(Duration::from_secs(2));
    let cut = world.device.take_outgoing().split_off(25);
    world.device.say_bytes(&cut);
    world.session.start(100_000);
    world.run(1_000);
    assert!(matches!(world.events.first(), Some(Event::Connected(_))));
    assert_eq!((world.lost(), world.session.counters().restarts), (0, 0));
    assert!(world.session.counters().stale_samples > 100);
    assert_eq!(world.sample_sequences().first(), Some(&0));
}
