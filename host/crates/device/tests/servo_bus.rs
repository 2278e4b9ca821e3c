//! Sessions with emulated arms on virtual time: normal operation, its speed, and everything that can go wrong.

mod arm;

use std::time::Duration;

use arm::{World, faults, sixteen};
use armature_device::servo::{EepromConsent, ReadMode, ServoArm, ServoProtocol, ServoSettings};
use armature_device::{DeviceNotice, DeviceProblem, Event, SensorState};
use armature_sim::servo::{BusKind, ServoBusSettings, SimulatedServo};
use armature_sim::{NoiseBurst, SensorFault, SensorFaultKind, Unplugging};

const SECOND: u64 = 1_000_000;

fn silence(servo: usize, from_seconds: u64, seconds: u64) -> SensorFault {
    let (start_micros, duration_micros) = (from_seconds * SECOND, seconds * SECOND);
    SensorFault { sensor: servo, kind: SensorFaultKind::NoData, start_micros, duration_micros }
}

#[test]
fn every_arm_comes_up_freely_movable_and_tells_where_its_joints_are() {
    for preset in ServoArm::presets() {
        let mut world = World::preset(&preset.name, |_| ());
        world.session.start(200_000);
        world.run(2.0);
        let milestones = world.milestones();
        assert!(
            matches!(milestones[0], Event::Connected(info) if info.name.starts_with(&preset.title)),
            "{milestones:?}"
        );
        assert!(matches!(milestones[1], Event::Topology(tree) if tree.parts.len() == preset.joints.len()));
        assert!(matches!(milestones[2..], [Event::RateGranted { .. }, Event::Started]), "{milestones:?}");
        let torque = if preset.protocol == ServoProtocol::Feetech { 40 } else { 64 };
        for servo in 0..preset.joints.len() {
            assert_eq!(world.bus.register(servo, torque), Some(0), "{}: no joint is held", preset.name);
        }
        assert_eq!(world.bus.truth().eeprom_writes, 0);
        assert_eq!(world.bus.truth().bytes_at_wrong_speed, 0);
        world.assert_readings_are_true();
        assert!(world.samples().count() > 100, "{}: {}", preset.name, world.samples().count());
        assert_eq!(world.session.counters().repeated_requests, 0);
    }
}

#[test]
fn sixteen_servos_reach_the_bound_of_the_wire() {
    let rates = [
        (BusKind::Dynamixel, true, ReadMode::Fast, 602.0),
        (BusKind::Dynamixel, false, ReadMode::Sync, 370.0),
        (BusKind::Feetech, true, ReadMode::Sync, 658.0),
    ];
    for (kind, knows_fast_reads, mode, bound) in rates {
        let (settings, arm) = sixteen(kind);
        let mut world = World::new(ServoBusSettings { knows_fast_reads, ..settings }, arm, ServoSettings::default());
        world.session.start(2_000_000);
        world.run(2.0);
        assert_eq!(world.session.read_mode(), mode);
        let before = world.samples().count();
        world.run(10.0);
        let rate = (world.samples().count() - before) as f64 / 10.0;
        println!("{kind:?} {mode:?}: {rate:.1} readings of 16 servos a second, the wire allows {bound}");
        assert!(rate >= 0.95 * bound && rate < 1.01 * bound, "{kind:?} {mode:?}: {rate}");
        world.assert_readings_are_true();
        let told_slower = |e: &&Event| matches!(e, Event::Notice(DeviceNotice::SlowerReads { .. }));
        assert_eq!(
            world.milestones().iter().filter(|e| told_slower(e)).count(),
            usize::from(!knows_fast_reads && kind == BusKind::Dynamixel)
        );
    }
}

#[test]
fn a_missing_servo_never_stops_the_others_and_is_taken_back() {
    for name in ["so101-leader", "koch-leader"] {
        let mut world = World::preset(name, |bus| bus.faults = faults(vec![silence(2, 3, 4)]));
        world.session.start(100_000);
        world.run(12.0);
        world.assert_readings_are_true();
        let during = |from: f64, to: f64| {
            let inside = move |at: Duration| at.as_secs_f64() >= from && at.as_secs_f64() < to;
            world.samples().filter(move |sample| inside(sample.received)).collect::<Vec<_>>()
        };
        assert!(during(3.0, 3.5).len() > 35, "{name}: {}", during(3.0, 3.5).len());
        let missing = during(3.5, 7.0);
        assert!(missing.len() > 310, "{name}: {} of 350", missing.len());
        let good = |state: &SensorState| *state == SensorState::Ok;
        for sample in &missing {
            assert_eq!(sample.states[2], SensorState::NoData);
            let others = sample.states.iter().enumerate().filter(|(servo, _)| *servo != 2);
            assert!(others.clone().all(|(_, state)| good(state)), "{name}: {:?}", sample.states);
        }
        let back = during(7.8, 12.0);
        assert!(back.len() > 400 && back.iter().all(|sample| sample.states.iter().all(good)), "{name}");
        let told: Vec<_> = world.notices().collect();
        assert!(
            matches!(told[..], [DeviceNotice::ServoMissing { id: 3, .. }, DeviceNotice::ServoBack { id: 3, .. }]),
            "{name}: {told:?}"
        );
    }
}

#[test]
fn an_arm_without_power_is_told_and_goes_on_when_it_is_back() {
    let pull = Unplugging { part: 0, at_micros: 2 * SECOND, for_micros: Some(5 * SECOND) };
    let mut world = World::preset("so101-leader", |bus| bus.faults.unplugged = vec![pull]);
    world.session.start(100_000);
    world.run(12.0);
    let problems: Vec<_> = world.problems().collect();
    assert!(matches!(problems[..], [DeviceProblem::NoServos { .. }]), "{problems:?}");
    assert!(problems[0].to_string().contains("power supply"), "{}", problems[0]);
    world.assert_readings_are_true();
    let last = world.samples().last().map(|sample| sample.received.as_secs_f64());
    assert!(last.is_some_and(|at| at > 11.9), "{last:?}");
    assert_eq!(world.session.counters().connections, 1, "the engine sees one device");
}

#[test]
fn noise_costs_readings_and_invents_none() {
    for (name, seeds) in [("so101-leader", 0..12), ("koch-leader", 0..12)] {
        for seed in seeds {
            let mut world = World::preset(name, |bus| {
                bus.seed = seed;
                bus.faults.bit_flip = 0.002;
                bus.faults.byte_drop = 0.001;
                bus.faults.byte_duplicate = 0.001;
                bus.faults.noise = vec![NoiseBurst { start_micros: 4 * SECOND, duration_micros: SECOND / 2 }];
            });
            world.session.start(200_000);
            world.run(10.0);
            let readings = world.assert_readings_are_true();
            assert!(readings > 6 * 1_000, "{name}, seed {seed}: {readings} good readings");
            let last = world.samples().last().map(|sample| sample.received.as_secs_f64());
            assert!(last.is_some_and(|at| at > 9.9), "{name}, seed {seed}: {last:?}");
        }
    }
}

#[test]
fn another_speed_is_found_and_told() {
    for (name, baud) in [("so101-leader", 115_200), ("koch-leader", 57_600), ("gello", 4_000_000)] {
        let mut world = World::preset(name, |bus| bus.baud = baud);
        let asked = world.session.line_baud();
        world.session.start(50_000);
        world.run(8.0);
        let told: Vec<_> = world.notices().collect();
        assert!(
            matches!(told[..], [DeviceNotice::FoundAtBaud { asked: a, found: f }] if (*a, *f) == (asked, baud)),
            "{told:?}"
        );
        assert!(world.samples().count() > 100, "{name}: {}", world.samples().count());
        assert_eq!(world.bus.truth().eeprom_writes, 0);
        world.assert_readings_are_true();
    }
}

#[test]
fn return_delay_is_diagnosed_and_changed_only_with_consent() {
    for kind in [BusKind::Feetech, BusKind::Dynamixel] {
        let (mut settings, arm) = sixteen(kind);
        settings.servos.iter_mut().for_each(|servo| servo.return_delay_units = 250);
        settings.knows_fast_reads = false;
        let delay_register = if kind == BusKind::Feetech { 7 } else { 9 };
        let mut world = World::new(settings.clone(), arm.clone(), ServoSettings::default());
        world.session.start(2_000_000);
        world.run(4.0);
        let told: Vec<_> = world.notices().collect();
        let micros = told
            .iter()
            .find_map(|n| if let DeviceNotice::ReturnDelay { micros, .. } = n { Some(*micros) } else { None });
        assert_eq!(micros, Some(500), "{told:?}");
        assert_eq!(world.bus.truth().eeprom_writes, 0, "no consent, no write");
        let slow = world.rate_between(2.0, 4.0);
        let eeprom = EepromConsent::ReturnDelayZero;
        let mut world = World::new(settings, arm, ServoSettings { eeprom, ..ServoSettings::default() });
        world.session.start(2_000_000);
        world.run(4.0);
        assert!((0..16).all(|servo| world.bus.register(servo, delay_register) == Some(0)));
        assert_eq!(world.bus.truth().eeprom_writes, 16, "one register of each servo");
        assert!(kind != BusKind::Feetech || world.bus.register(0, 55) == Some(1), "locked again");
        let quick = world.rate_between(2.0, 4.0);
        println!("{kind:?}: {slow:.0} a second with 500 us of return delay, {quick:.0} without");
        assert!(slow < 110.0 && quick > 3.0 * slow, "{kind:?}: {slow} and {quick}");
        assert!(!world.notices().any(|notice| matches!(notice, DeviceNotice::ReturnDelay { .. })));
    }
}

#[test]
fn a_slow_adapter_is_diagnosed_and_lived_with() {
    let mut world = World::preset("so101-leader", |bus| bus.adapter_latency_micros = 16_000);
    world.session.start(200_000);
    world.run(4.0);
    let told: Vec<_> = world.notices().collect();
    assert!(
        matches!(told[..], [DeviceNotice::AdapterLatency { millis, .. }] if (15.0..18.0).contains(millis)),
        "{told:?}"
    );
    assert!(told[0].to_string().contains("latency_timer"), "{}", told[0]);
    let rate = world.rate_between(2.0, 4.0);
    assert!((50.0..62.0).contains(&rate), "{rate}");
    assert_eq!(world.session.counters().repeated_requests, 0);
}

#[test]
fn an_adapter_that_echoes_is_no_servo() {
    for name in ["so101-leader", "koch-leader"] {
        let mut world = World::preset(name, |bus| bus.echo = true);
        world.session.start(200_000);
        world.run(3.0);
        assert!(world.notices().next().is_none(), "{:?}", world.notices().collect::<Vec<_>>());
        assert!(world.assert_readings_are_true() > 2_000);
        assert_eq!(world.session.counters().repeated_requests, 0);
    }
}

#[test]
fn foreign_servos_are_named_and_left_out() {
    let mut world = World::preset("so101-leader", |bus| bus.servos[4] = SimulatedServo::new(5, 1284));
    world.session.start(100_000);
    world.run(3.0);
    let told: Vec<_> = world.notices().collect();
    assert!(
        matches!(told[..], [DeviceNotice::ServoModel { id: 5, found: 1284, expected: 777, usable: false, .. }]),
        "{told:?}"
    );
    assert!(world.samples().count() > 200);
    assert!(
        world.samples().all(|sample| sample.states[4] == SensorState::NoData && sample.states[5] == SensorState::Ok)
    );
    let mut world = World::preset("so101-leader", |bus| bus.servos.iter_mut().for_each(|servo| servo.model = 1284));
    world.session.start(100_000);
    world.run(20.0);
    assert!(world.problems().any(|problem| matches!(problem, DeviceProblem::ForeignServos { model: 1284, .. })));
    assert_eq!(world.samples().count(), 0);
}

#[test]
fn a_stuck_servo_repeats_itself_and_a_position_across_the_turn_wraps() {
    let stuck = SensorFault { kind: SensorFaultKind::Stuck, ..silence(0, 2, 2) };
    let mut world = World::preset("koch-leader", |bus| {
        bus.faults = faults(vec![stuck]);
        bus.servos[0].middle_counts = -100.0;
        bus.servos[1].middle_counts = 4_000.0;
        bus.servos[1].swing_counts = 500.0;
    });
    world.session.start(100_000);
    world.run(3.9);
    let held: Vec<u16> = world.samples().filter(|s| s.received.as_secs_f64() > 2.1).map(|s| s.counts[0]).collect();
    assert!(held.len() > 100 && held.iter().all(|&counts| counts == held[0]));
    assert!(world.samples().all(|sample| sample.counts.iter().all(|&counts| counts < 4_096)));
    assert!(world.samples().all(|sample| sample.states[1] == SensorState::Ok), "wrapping is not a jump");
}

#[test]
fn stop_is_clean_and_start_works_again() {
    let mut world = World::preset("so101-leader", |_| ());
    world.session.start(100_000);
    world.run(2.0);
    world.session.stop();
    world.run(0.1);
    assert!(matches!(world.events.last(), Some(Event::Stopped)) && !world.session.is_streaming());
    let requests = world.bus.truth().requests;
    world.run(1.0);
    assert_eq!(world.bus.truth().requests, requests, "the bus is left alone");
    world.session.start(100_000);
    world.run(1.0);
    assert_eq!(world.samples().filter(|sample| sample.sequence == 0).count(), 2, "numbers start over");
    assert!(world.samples().last().is_some_and(|sample| sample.sequence > 80));
}

#[test]
fn one_seed_gives_one_session() {
    let run = |seed| {
        let mut world = World::preset("so101-leader", |bus| {
            bus.seed = seed;
            bus.faults.bit_flip = 0.002;
        });
        world.session.start(200_000);
        world.run(3.0);
        world.events
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

mod hostile {
    use armature_device::servo::ServoSession;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn any_bytes_at_any_time_are_survived(
            pieces in prop::collection::vec((0_u64..30_000, prop::collection::vec(prop_oneof![Just(0xFF_u8), 0_u8..8, any::<u8>()], 0..40)), 0..60),
            feetech in any::<bool>(),
        ) {
            let name = if feetech { "so101-leader" } else { "koch-leader" };
            let mut session = ServoSession::new(name.parse().unwrap(), None, ServoSettings::default()).unwrap();
            session.start(500_000);
            let (mut now, mut events) = (0, Vec::new());
            for (wait, bytes) in pieces {
                now += wait;
                session.receive(Duration::from_micros(now), &bytes, &mut events);
                session.tick(Duration::from_micros(now), &mut events);
                prop_assert!(session.take_outgoing().len() < 4_096);
            }
        }
    }
}
