//! The puppet on a virtual clock: what it sends, when, and that it sends the same every time.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_sim::{
    Body, Faults, JointTrack, Motion, NoiseBurst, Puppet, PuppetSettings, SensorFault, SensorFaultKind, SettingsError,
    TrackEnd, Unplugging, rotation,
};
use firmware_protocol::{
    Decoder, DecoderCounters, DeviceMessage, Encode, FrameBuffer, HostMessage, PartRecord, RefusalReason, SensorState,
};

/// What a host received, message by message.
#[derive(Clone, Debug, PartialEq)]
enum Got {
    Hello,
    Topology(u16, Vec<PartRecord>),
    Changed(u16),
    Sample { micros: u64, sequence: u32, epoch: u16, counts: Vec<u16>, states: Vec<SensorState> },
    Rate(u32),
    Done(u8),
    Pong(u64, u64),
    Refused(u8, RefusalReason),
}

struct Host {
    puppet: Puppet,
    decoder: Decoder,
    wire: Vec<u8>,
}

impl Host {
    fn new(settings: PuppetSettings) -> Self {
        Self { puppet: Puppet::new(settings).unwrap(), decoder: Decoder::new(), wire: Vec::new() }
    }

    fn step(&mut self, now: u64, message: Option<HostMessage>) -> Vec<Got> {
        let request = message.map_or_else(Vec::new, |m| frame(&m));
        self.raw(now, &request)
    }

    fn raw(&mut self, now: u64, bytes: &[u8]) -> Vec<Got> {
        let mut out = Vec::new();
        self.puppet.step(now, bytes, &mut out);
        self.wire.extend_from_slice(&out);
        let mut bytes = out.as_slice();
        let mut got = Vec::new();
        while let Some(frame) = self.decoder.next_frame(&mut bytes) {
            got.push(match DeviceMessage::parse(frame).unwrap() {
                DeviceMessage::Hello(_) => Got::Hello,
                DeviceMessage::Topology(chunk) => Got::Topology(chunk.epoch, chunk.records().collect()),
                DeviceMessage::TopologyChanged(changed) => Got::Changed(changed.epoch),
                DeviceMessage::Sample(s) => Got::Sample {
                    micros: s.device_micros,
                    sequence: s.sequence,
                    epoch: s.epoch,
                    counts: s.counts().collect(),
                    states: s.states().collect(),
                },
                DeviceMessage::RateSet(rate) => Got::Rate(rate.rate_millihertz),
                DeviceMessage::Acknowledge(done) => Got::Done(done.request),
                DeviceMessage::Pong(pong) => Got::Pong(pong.token, pong.received_micros),
                DeviceMessage::Refuse(refuse) => Got::Refused(refuse.request, refuse.reason),
            });
        }
        got
    }
}

fn frame(message: &impl Encode) -> Vec<u8> {
    FrameBuffer::new().encode(message).unwrap().to_vec()
}

fn human(motion: Motion) -> PuppetSettings {
    PuppetSettings { motion, seed: 11, ..PuppetSettings::new(Body::preset("human", 11).unwrap()) }
}

fn samples(got: &[Got]) -> Vec<(u64, u32)> {
    got.iter()
        .filter_map(|g| if let Got::Sample { micros, sequence, .. } = g { Some((*micros, *sequence)) } else { None })
        .collect()
}

#[test]
fn a_conversation() {
    let mut host = Host::new(human(Motion::Rest));
    assert_eq!(host.step(5_000_000, None), [Got::Hello], "one hello after power-up");
    assert_eq!(host.wire[0], 0, "a sender begins with a delimiter");
    assert_eq!(host.step(5_000_100, Some(HostMessage::HELLO_REQUEST)), [Got::Hello]);
    let got = host.step(5_000_200, Some(HostMessage::TopologyRequest));
    let Got::Topology(0, records) = &got[0] else { panic!("{got:?}") };
    assert_eq!(records.len(), host.puppet.body().parts().len());
    assert_eq!(host.step(5_000_300, Some(HostMessage::SetRate { rate_millihertz: 500_000 })), [Got::Rate(500_000)]);
    let too_fast = HostMessage::SetRate { rate_millihertz: u32::MAX };
    assert_eq!(host.step(5_000_300, Some(too_fast)), [Got::Rate(1_000_000)]);
    assert_eq!(host.step(5_000_300, Some(HostMessage::SetRate { rate_millihertz: 0 })), [Got::Rate(1)]);
    assert_eq!(host.step(5_000_300, Some(HostMessage::SetRate { rate_millihertz: 300_000 })), [Got::Rate(300_000)]);
    assert_eq!(host.step(5_000_400, Some(HostMessage::Ping { token: 9 })), [Got::Pong(9, 400)]);
    let uid = records[3].uid;
    let blink = HostMessage::Blink { uid, duration_millis: 50 };
    assert_eq!(host.step(5_000_500, Some(blink)), [Got::Done(7)]);
    assert_eq!(host.puppet.blinking_part(), Some(uid));
    let stranger = HostMessage::Blink { uid: firmware_protocol::PartUid([9; 12]), duration_millis: 50 };
    assert_eq!(host.step(5_060_000, Some(stranger)), [Got::Refused(7, RefusalReason::NoSuchPart)]);
    assert_eq!(host.puppet.blinking_part(), None);

    let got = host.step(6_000_000, Some(HostMessage::Start));
    assert_eq!(got[0], Got::Done(4));
    assert_eq!(samples(&got), [(1_000_000, 0)], "the first sample comes at once");
    let got = host.step(6_010_000, Some(HostMessage::Start));
    assert_eq!(
        samples(&got),
        [(1_003_333, 1), (1_006_666, 2), (1_010_000, 3)],
        "thirds of a millisecond do not add up"
    );
    assert!(matches!(got.last(), Some(Got::Done(4))), "samples due come before the answer");
    let got = host.step(6_015_000, Some(HostMessage::Stop));
    assert_eq!(samples(&got), [(1_013_333, 4)]);
    assert_eq!(got.last(), Some(&Got::Done(5)), "the acknowledgement of stop follows the last sample");
    assert!(host.step(7_000_000, None).is_empty());
    assert_eq!(samples(&host.step(7_000_000, Some(HostMessage::Start))), [(2_000_000, 0)]);
    let got = host.step(7_000_001, Some(HostMessage::HELLO_REQUEST));
    assert_eq!(got, [Got::Hello]);
    assert!(!host.puppet.is_streaming(), "a hello stops the stream");
}

#[test]
fn what_it_does_not_understand_is_refused() {
    struct Odd(u8, &'static [u8]);
    impl Encode for Odd {
        fn message_type(&self) -> u8 {
            self.0
        }
        fn write_payload(
            &self,
            writer: &mut firmware_protocol::FrameWriter<'_>,
        ) -> Result<(), firmware_protocol::EncodeError> {
            writer.put_bytes(self.1);
            Ok(())
        }
    }
    let mut host = Host::new(human(Motion::Rest));
    host.step(0, None);
    assert_eq!(host.raw(1, &frame(&Odd(0x33, &[]))), [Got::Refused(0x33, RefusalReason::UnknownRequest)]);
    assert_eq!(host.raw(2, &frame(&Odd(0x03, &[1]))), [Got::Refused(3, RefusalReason::Malformed)]);
    assert!(host.raw(3, &frame(&Odd(0x88, &[1, 1]))).is_empty(), "its own kind of message is an echo");
    assert!(host.raw(4, &[7; 5000]).is_empty());
    let mut late = vec![0];
    late.extend(frame(&HostMessage::Ping { token: 3 }));
    assert_eq!(host.raw(5, &late[..9]), []);
    assert_eq!(host.raw(6, &late[9..]), [Got::Pong(3, 6)], "requests may come in pieces");
    assert_eq!(host.puppet.truth().requests_refused, 2);
}

#[test]
fn the_same_seed_gives_the_same_bytes_however_it_is_stepped() {
    let faults = Faults {
        bit_flip: 1e-3,
        byte_drop: 1e-3,
        byte_duplicate: 1e-3,
        outlier: 0.01,
        clock_drift_ppm: 80.0,
        unplugged: vec![Unplugging { part: 4, at_micros: 700_000, for_micros: Some(300_000) }],
        ..Faults::default()
    };
    let settings = PuppetSettings { noise_counts: 0.7, faults, ..human(Motion::WalkAndWave) };
    let run = |settings: &PuppetSettings, interval: u64| {
        let mut host = Host::new(settings.clone());
        host.step(0, Some(HostMessage::Start));
        (1..=2_000_000 / interval).for_each(|i| drop(host.step(i * interval, None)));
        (host.wire, host.puppet.truth())
    };
    let (bytes, truth) = run(&settings, 1_000);
    assert_eq!((bytes.clone(), truth), run(&settings, 1_000));
    assert_eq!(bytes, run(&settings, 250_000).0, "the caller's step does not matter");
    assert_ne!(bytes, run(&PuppetSettings { seed: 12, ..settings.clone() }, 1_000).0);
    assert!(truth.bits_flipped > 0 && truth.bytes_dropped > 0 && truth.bytes_duplicated > 0 && truth.outliers > 0);
}

#[test]
fn counts_are_the_angles_within_half_a_count() {
    for (bits, motion) in [(14, Motion::WalkAndWave), (10, Motion::Wave), (16, Motion::Wiggle)] {
        let counts_per_turn = 1 << bits;
        let settings = PuppetSettings { counts_per_turn, reversed_sensors: vec![2, 7], ..human(motion) };
        let mut host = Host::new(settings);
        let first = host.step(0, Some(HostMessage::Start));
        let Some(Got::Sample { counts: zero, .. }) = first.last() else { panic!("{first:?}") };
        let mut largest = 0.0_f64;
        for millis in (1..4000).step_by(37) {
            let at = millis * 1000;
            let got = host.step(at, None);
            let Some(Got::Sample { micros, counts, .. }) = got.last() else { continue };
            let angles = host.puppet.true_angles(*micros);
            for (sensor, angle) in angles.iter().enumerate() {
                let sign = if [2, 7].contains(&sensor) { -1.0 } else { 1.0 };
                let turned = f64::from(counts[sensor]) - f64::from(zero[sensor]);
                let step = std::f64::consts::TAU / f64::from(counts_per_turn);
                let off = rotation::wrapped(sign * turned * step - angle).abs() / step;
                // Half a count of this reading and half a count of the zero; true time is read to 1 µs.
                assert!(off <= 1.0 + 0.01, "sensor {sensor} at {micros}: {off} counts");
                largest = largest.max(off);
            }
        }
        assert!(largest > 0.4, "the error is a real quantisation: {largest}");
    }
}

#[test]
fn the_rest_pose_is_held_until_it_has_been_zeroed() {
    let mut host = Host::new(human(Motion::Walk));
    host.step(0, Some(HostMessage::Start));
    assert!(host.puppet.true_angles(999_999).iter().all(|a| *a == 0.0));
    assert!(host.puppet.true_angles(1_400_000).iter().any(|a| a.abs() > 0.1));
    let forever = PuppetSettings { rest_micros: u64::MAX, ..human(Motion::Walk) };
    let mut host = Host::new(forever);
    host.step(0, Some(HostMessage::Start));
    host.step(9_000_000, None);
    assert!(host.puppet.true_angles(9_500_000).iter().all(|a| *a == 0.0));
    host.puppet.begin_motion();
    assert!(host.puppet.true_angles(9_500_000).iter().any(|a| a.abs() > 0.1));
    host.puppet.hold_rest();
    assert!(host.puppet.true_angles(9_500_000).iter().all(|a| *a == 0.0));
}

#[test]
fn damage_is_counted_exactly() {
    for seed in 0..20 {
        let faults = Faults {
            bit_flip: 2e-4,
            byte_drop: 2e-4,
            byte_duplicate: 2e-4,
            noise: vec![
                NoiseBurst { start_micros: 400_000, duration_micros: 100_000 },
                NoiseBurst { start_micros: 450_000, duration_micros: 100_000 },
            ],
            ..Faults::default()
        };
        let mut host = Host::new(PuppetSettings { seed, faults, ..human(Motion::Walk) });
        let mut got = host.step(0, Some(HostMessage::SetRate { rate_millihertz: 1_000_000 }));
        got.extend(host.step(0, Some(HostMessage::Start)));
        for millis in 1..=2000 {
            got.extend(host.step(millis * 1000, None));
        }
        let truth = host.puppet.truth();
        assert_eq!(got.len() as u64, truth.frames_sent - truth.frames_damaged, "seed {seed}: {truth:?}");
        assert_eq!(samples(&got).len() as u64, truth.samples_sent - truth.samples_damaged, "seed {seed}");
        assert_eq!(truth.samples_taken, 2001);
        assert_eq!(truth.noise_bytes, 15_000, "150 ms at 100 kB/s; overlapping bursts are one");
        assert!(truth.frames_damaged > 150);
        let DecoderCounters { frames, .. } = host.decoder.counters();
        assert_eq!(frames, got.len() as u64);
        let bytes = host.wire.len() as u64;
        assert!(bytes > 200_000 && truth.bits_flipped + truth.bytes_dropped + truth.bytes_duplicated > 20);
    }
}

#[test]
fn sensors_fail_as_told() {
    let fault = |sensor, kind| SensorFault { sensor, kind, start_micros: 1_200_000, duration_micros: 500_000 };
    let faults = Faults {
        sensors: vec![
            fault(0, SensorFaultKind::Stuck),
            fault(1, SensorFaultKind::NoData),
            fault(2, SensorFaultKind::MagnetWeak),
        ],
        outlier: 0.02,
        ..Faults::default()
    };
    let mut host = Host::new(PuppetSettings { faults, ..human(Motion::Walk) });
    host.step(0, Some(HostMessage::Start));
    let got = host.step(2_000_000, None);
    let mut inside = Vec::new();
    let (mut missing, mut weak, mut outliers) = (0, 0, 0);
    for message in &got {
        let Got::Sample { micros, counts, states, .. } = message else { panic!() };
        let during = (1_200_000..1_700_000).contains(micros);
        assert_eq!(states[1] == SensorState::NoData, during);
        assert_eq!(states[2] == SensorState::MagnetWeak, during);
        if during {
            inside.push(counts[0]);
        }
        missing += u64::from(states[1] == SensorState::NoData);
        weak += u64::from(states[2] == SensorState::MagnetWeak);
        outliers += states.iter().filter(|s| **s == SensorState::Outlier).count() as u64;
    }
    assert!(inside.windows(2).all(|w| w[0] == w[1]), "a stuck sensor keeps its count");
    let truth = host.puppet.truth();
    assert_eq!(truth.stuck_readings, inside.len() as u64);
    assert_eq!((truth.missing_readings, truth.weak_readings), (missing, weak));
    assert!(outliers > 100 && truth.outliers >= outliers && truth.outliers - outliers < 10, "but for the first sample");
}

#[test]
fn a_pulled_out_arm_changes_the_tree_and_comes_back() {
    let body = Body::preset("human", 11).unwrap();
    let elbow = body.find("left_elbow").unwrap();
    let below = (0..body.parts().len()).filter(|&p| body.is_below(p, elbow)).count();
    let faults = Faults {
        unplugged: vec![
            Unplugging { part: elbow, at_micros: 500_000, for_micros: Some(500_000) },
            // Part of the same arm: nothing more is missing, and it comes back with the elbow.
            Unplugging { part: elbow + 1, at_micros: 600_000, for_micros: Some(100_000) },
        ],
        ..Faults::default()
    };
    let mut host = Host::new(PuppetSettings { faults, ..human(Motion::Walk) });
    let all = body.sensor_count();
    let whole = host.step(0, Some(HostMessage::TopologyRequest));
    host.step(0, Some(HostMessage::Start));
    let got = host.step(600_000, Some(HostMessage::TopologyRequest));
    assert_eq!(got.iter().filter(|g| matches!(g, Got::Changed(1))).count(), 1);
    for message in &got {
        if let Got::Sample { micros, epoch, counts, .. } = message {
            assert_eq!((*epoch, counts.len()), if *micros < 500_000 { (0, all) } else { (1, all - 5) });
        }
    }
    let Some(Got::Topology(1, records)) = got.last() else { panic!() };
    assert_eq!(records.len(), body.parts().len() - below);
    for (index, record) in records.iter().enumerate() {
        assert!(record.parent.is_none_or(|p| usize::from(p) < index));
    }
    let got = host.step(1_100_000, Some(HostMessage::TopologyRequest));
    assert!(got.contains(&Got::Changed(2)));
    let (Some(Got::Topology(2, back)), Some(Got::Topology(0, first))) = (got.last(), whole.last()) else { panic!() };
    assert_eq!(back, first);
    assert_eq!(host.puppet.truth().topology_changes, 2);
}

#[test]
fn without_its_root_a_puppet_has_no_parts() {
    let unplugged = vec![Unplugging { part: 0, at_micros: 0, for_micros: None }];
    let faults = Faults { unplugged, ..Faults::default() };
    let mut host = Host::new(PuppetSettings { faults, ..human(Motion::Walk) });
    let got = host.step(0, Some(HostMessage::TopologyRequest));
    assert_eq!(got, [Got::Hello, Got::Changed(1), Got::Topology(1, vec![])]);
}

#[test]
fn the_clock_drifts_and_a_restart_begins_anew() {
    let faults = Faults { clock_drift_ppm: 1000.0, restarts: vec![1_500_000], ..Faults::default() };
    let mut host = Host::new(PuppetSettings { faults, ..human(Motion::Rest) });
    host.step(0, Some(HostMessage::Start));
    assert_eq!(host.step(1_000_000, Some(HostMessage::Ping { token: 0 })).last(), Some(&Got::Pong(0, 1_001_000)));
    let got = host.step(2_000_000, None);
    assert_eq!(got.last(), Some(&Got::Hello), "it restarts, says so and waits");
    assert_eq!(samples(&got).last().unwrap().0, 1_500_000, "180 intervals of its own clock fit");
    assert_eq!(host.step(2_500_000, Some(HostMessage::Ping { token: 1 })), [Got::Pong(1, 1_001_000)]);
    assert_eq!(host.puppet.truth().restarts, 1);
    assert!(!host.puppet.is_streaming());
}

#[test]
fn a_new_rate_takes_over_from_the_latest_sample() {
    let mut host = Host::new(human(Motion::Rest));
    host.step(0, Some(HostMessage::SetRate { rate_millihertz: 100_000 }));
    host.step(0, Some(HostMessage::Start));
    let got = host.step(24_000, Some(HostMessage::SetRate { rate_millihertz: 200_000 }));
    assert_eq!(samples(&got), [(10_000, 1), (20_000, 2)]);
    assert_eq!(samples(&host.step(30_000, None)), [(25_000, 3), (30_000, 4)]);
}

#[test]
fn any_bytes_may_come() {
    let mut host = Host::new(human(Motion::Wave));
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    let requests: Vec<u8> =
        [HostMessage::Start, HostMessage::Ping { token: 1 }, HostMessage::TopologyRequest, HostMessage::HELLO_REQUEST]
            .iter()
            .flat_map(frame)
            .collect();
    for round in 0..3000 {
        // Plain noise, alternating with requests in which one byte is wrong.
        let bytes: Vec<u8> = if round % 2 == 0 {
            (0..usize::from(next())).map(|_| next()).collect()
        } else {
            let at = usize::from(next()) % requests.len();
            requests.iter().enumerate().map(|(i, &b)| if i == at { next() } else { b }).collect()
        };
        host.raw(round * 700, &bytes);
    }
    let truth = host.puppet.truth();
    assert!(truth.requests >= 1500 * 2, "the requests that are whole get through: {truth:?}");
}

#[test]
fn a_slow_line_limits_the_rate() {
    let body = Body::preset("joints:32", 0).unwrap();
    let limit = |baud| {
        let settings = PuppetSettings {
            line_baud: Some(baud),
            max_rate_millihertz: 2_000_000,
            ..PuppetSettings::new(body.clone())
        };
        Puppet::new(settings).unwrap().max_rate_millihertz()
    };
    // 244 bytes per sample.
    assert_eq!(limit(2_440_000), 950_000);
    assert!(limit(3_000_000) > 1_000_000);
    assert_eq!(limit(1), 1);
}

#[test]
fn a_step_over_years_does_not_take_years() {
    let mut host = Host::new(human(Motion::Walk));
    host.step(0, Some(HostMessage::Start));
    let got = host.step(u64::MAX / 4, None);
    let truth = host.puppet.truth();
    assert!(truth.samples_skipped > 0 && samples(&got).len() as u64 + truth.samples_skipped + 1 == truth.samples_taken);
    let back = host.step(5, Some(HostMessage::Ping { token: 0 }));
    assert!(matches!(back[..], [Got::Pong(0, at)] if at > 5), "time does not run backwards");
}

#[test]
fn a_track_turns_evenly_between_its_frames() {
    let body = Body::preset("human", 1).unwrap();
    let part = body.find("left_shoulder").unwrap();
    let ends = [rotation::IDENTITY, rotation::product(rotation::about(2, 1.0), rotation::about(0, 0.4))];
    let track = |end| JointTrack { frame_seconds: 0.5, parts: vec![part], rotations: ends.to_vec(), end };
    for (end, millis, expected) in [
        (TrackEnd::Hold, 250, rotation::between(ends[0], ends[1], 0.5)),
        (TrackEnd::Hold, 500, ends[1]),
        (TrackEnd::Hold, 7_000, ends[1]),
        (TrackEnd::Repeat, 1_000, ends[0]),
        (TrackEnd::Repeat, 750, rotation::between(ends[1], ends[0], 0.5)),
    ] {
        let motion = Motion::Track(track(end));
        let mut puppet =
            Puppet::new(PuppetSettings { motion, rest_micros: 0, ..PuppetSettings::new(body.clone()) }).unwrap();
        puppet.step(0, &frame(&HostMessage::Start), &mut Vec::new());
        let angles = puppet.true_angles(millis * 1000);
        let mut own = [0.0; 3];
        own.copy_from_slice(&angles[body.sensors(part)]);
        let turn = rotation::from_sensor_angles(firmware_protocol::PartKind::TwistBendTwist, own);
        let dot: f64 = turn.iter().zip(expected).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 1.0 - 1e-12, "{end:?} {millis}: {turn:?} {expected:?}");
    }
}

/// A track that begins and ends far from rest: as `--device sim:FILE.bvh` plays it, no sensor jumps, neither from rest
/// into it nor where it begins again.
#[test]
fn a_track_is_reached_from_rest_without_a_jump() {
    let body = Body::preset("human", 1).unwrap();
    let part = body.find("left_shoulder").unwrap();
    let away = |angle| rotation::product(rotation::about(2, angle), rotation::about(0, 1.4));
    let rotations = vec![away(0.9), away(1.0), away(-1.2)];
    let motion = Motion::Track(JointTrack { frame_seconds: 0.5, parts: vec![part], rotations, end: TrackEnd::Repeat });
    let settings = PuppetSettings { motion, leads: true, rest_micros: 500_000, ..PuppetSettings::new(body.clone()) };
    let mut puppet = Puppet::new(settings).unwrap();
    puppet.step(0, &frame(&HostMessage::Start), &mut Vec::new());
    let lead = puppet.lead_in_seconds();
    assert!((0.3..2.0).contains(&lead), "{lead}");
    let own = |micros: u64| puppet.true_angles(micros)[body.sensors(part)].to_vec();
    let turn = |seconds: f64| {
        let own = own((seconds * 1e6) as u64);
        rotation::from_sensor_angles(firmware_protocol::PartKind::TwistBendTwist, [own[0], own[1], own[2]])
    };
    assert_eq!(own(499_999), [0.0; 3]);
    let dot: f64 = turn(0.5 + lead).iter().zip(away(0.9)).map(|(a, b)| a * b).sum();
    assert!(dot.abs() > 1.0 - 1e-9, "the first frame comes after the lead-in");
    let mut before = own(0);
    for micros in (0..20_000_000).step_by(8_333) {
        let now = own(micros);
        for (a, b) in before.iter().zip(&now) {
            let step = rotation_wrapped(b - a).abs();
            assert!(step < 0.08, "{micros} µs: a sensor goes {step} rad in one sample");
        }
        before = now;
    }
}

fn rotation_wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

#[test]
fn impossible_settings_are_named() {
    let with = |change: fn(&mut PuppetSettings)| {
        let mut settings = human(Motion::Rest);
        change(&mut settings);
        Puppet::new(settings).err()
    };
    assert!(matches!(with(|s| s.faults.bit_flip = f64::NAN), Some(SettingsError::Chance { what: "bit flips", .. })));
    assert!(matches!(with(|s| s.counts_per_turn = 1), Some(SettingsError::Resolution { .. })));
    assert!(matches!(with(|s| s.noise_counts = -1.0), Some(SettingsError::Noise { .. })));
    assert!(matches!(with(|s| s.faults.clock_drift_ppm = f64::INFINITY), Some(SettingsError::ClockDrift { .. })));
    assert!(matches!(with(|s| s.line_baud = Some(0)), Some(SettingsError::Rate)));
    assert!(matches!(with(|s| s.reversed_sensors.push(45)), Some(SettingsError::NoSuchSensor { sensor: 45, .. })));
    let unplug = |s: &mut PuppetSettings| {
        s.faults.unplugged.push(Unplugging { part: 99, at_micros: 0, for_micros: None });
    };
    assert!(matches!(with(unplug), Some(SettingsError::NoSuchPart { part: 99, .. })));
    let odd = |s: &mut PuppetSettings| {
        let rotations = vec![rotation::IDENTITY; 3];
        s.motion = Motion::Track(JointTrack { frame_seconds: 1.0, parts: vec![1, 2], rotations, end: TrackEnd::Hold });
    };
    assert_eq!(with(odd), Some(SettingsError::Track));
}
