//! Takes to test with.
#![allow(dead_code, reason = "every test file uses its own part of this")]

use armature_rig::{
    Bone, Calibration, JointTree, Mapping, MappingEntry, Part, PartKind, PartUid, Pose, RawSample, SensorState,
    Skeleton, StreamSolver, Transform,
};
use armature_take::{ClockFault, Event, EventKind, Header, Sample, Take, TakeWriter};
use glam::{Quat, Vec3};
use proptest::prelude::*;

pub(crate) fn header() -> Header {
    Header {
        program_version: "0.1.0".into(),
        character_name: "arm".into(),
        character_hash: std::array::from_fn(|i| i as u8),
        nominal_samples_per_second: Some(100.0),
        seed: Some(7),
        virtual_clock: true,
        unix_micros: None,
        inverse_kinematics: None,
    }
}

/// A take of the arm with everything that comes before its samples, and a solver that knows the same.
pub(crate) fn begun(header: &Header) -> (TakeWriter<Vec<u8>>, StreamSolver) {
    let mut writer = TakeWriter::new(Vec::new(), header).expect("memory can be written to");
    let mut solver = StreamSolver::new(arm());
    solver.set_topology(1, arm_tree());
    solver.set_calibration(arm_calibration());
    solver.set_mapping(arm_mapping());
    writer.skeleton(&arm()).expect("memory can be written to");
    writer.topology(1, &arm_tree()).expect("memory can be written to");
    writer.calibration(&arm_calibration()).expect("memory can be written to");
    writer.mapping(&arm_mapping()).expect("memory can be written to");
    (writer, solver)
}

pub(crate) fn bone(name: &str, parent: Option<usize>, at: [f32; 3], tail: [f32; 3]) -> Bone {
    Bone {
        name: name.into(),
        parent,
        rest: Transform { translation: at.into(), ..Transform::IDENTITY },
        tail: tail.into(),
    }
}

pub(crate) fn arm() -> Skeleton {
    Skeleton::new(vec![
        bone("upper", None, [0.0, 1.0, 0.0], [0.0, -0.5, 0.0]),
        bone("lower", Some(0), [0.0, -0.5, 0.0], [0.0, -0.4, 0.0]),
        bone("hand", Some(1), [0.0, -0.4, 0.0], [0.0, -0.1, 0.0]),
    ])
    .expect("a skeleton")
}

pub(crate) fn part(uid: u8, kind: PartKind, parent: Option<usize>) -> Part {
    Part { uid: PartUid([uid; 12]), kind, parent, outlet: 0, counts_per_turn: 4096 }
}

pub(crate) fn arm_tree() -> JointTree {
    JointTree::new(vec![part(1, PartKind::TwistBendTwist, None), part(2, PartKind::Bend, Some(0))]).expect("a tree")
}

/// Zeroed at 2048 everywhere, the bend sensor of the first part running backwards.
pub(crate) fn arm_calibration() -> Calibration {
    let mut calibration = Calibration::for_tree(&arm_tree());
    let rest = RawSample { counts: vec![2048; 4], states: vec![SensorState::Ok; 4], ..RawSample::default() };
    calibration.zero(&arm_tree(), &rest).expect("zeroed");
    calibration.flip(PartUid([1; 12]), 1);
    calibration
}

pub(crate) fn arm_mapping() -> Mapping {
    let mut wrist = MappingEntry::new(PartUid([2; 12]), "hand");
    wrist.mounting = Quat::from_rotation_y(0.5);
    Mapping { entries: vec![MappingEntry::new(PartUid([1; 12]), "upper"), wrist], ..Mapping::default() }
}

pub(crate) fn raw(sequence: u32, device_micros: u64) -> RawSample {
    let counts: Vec<u16> = (0..4).map(|sensor| (2048 + sequence * (sensor + 1)) as u16 % 4096).collect();
    RawSample { device_micros, sequence, epoch: 1, states: vec![SensorState::Ok; counts.len()], counts }
}

/// A pose in which the lower arm turns with the sequence number and the root walks.
pub(crate) fn pose(sequence: u32) -> Pose {
    let mut pose = arm().rest_pose();
    pose.parent_from_bone[0].translation += Vec3::Z * (sequence as f32 * 0.01);
    pose.parent_from_bone[1].rotation = Quat::from_rotation_x(sequence as f32 * 0.02);
    pose
}

pub(crate) fn event(kind: EventKind) -> Event {
    Event { device_micros: Some(1_030_000), host_seconds: Some(1.25), kind }
}

/// A finished take of everything: `samples` samples, a made-up pose for each, some events.
pub(crate) fn small_take(samples: u32) -> Vec<u8> {
    let mut writer = TakeWriter::new(Vec::new(), &header()).expect("header");
    writer.skeleton(&arm()).expect("skeleton");
    writer.topology(1, &arm_tree()).expect("topology");
    writer.calibration(&arm_calibration()).expect("calibration");
    writer.mapping(&arm_mapping()).expect("mapping");
    for sequence in 0..samples {
        let micros = 1_000_000 + 10_000 * u64::from(sequence);
        let mut sample = raw(sequence, micros);
        if sequence == 1 {
            sample.states = vec![SensorState::NoData, SensorState::Ok, SensorState::Outlier, SensorState::MagnetWeak];
        }
        writer.sample(&sample, (sequence % 2 == 0).then_some(0.5 + 0.01 * f64::from(sequence))).expect("sample");
        writer.pose(sequence, micros, &pose(sequence)).expect("pose");
        if sequence == 1 {
            writer.event(&event(EventKind::LostSamples { count: 3, after_sequence: 1 })).expect("event");
            writer.event(&event(EventKind::Noise { crc_errors: 2, discarded_bytes: 90 })).expect("event");
        }
    }
    writer.event(&event(EventKind::Marker { text: "gut so – nochmal".into() })).expect("marker");
    writer.finish().expect("end")
}

pub(crate) fn read(bytes: &[u8]) -> Take {
    let (take, report) = Take::read(bytes).expect("a take");
    assert!(report.is_whole(), "{report}");
    take
}

/// Any `f32`, NaN with payload included.
pub(crate) fn any_bits() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits)
}

pub(crate) fn any_state() -> impl Strategy<Value = SensorState> {
    prop_oneof![
        Just(SensorState::Ok),
        Just(SensorState::NoData),
        Just(SensorState::MagnetWeak),
        Just(SensorState::Outlier)
    ]
}

prop_compose! {
    pub(crate) fn any_sample()(
        sensors in prop::collection::vec((any::<u16>(), any_state()), 0..40),
        device_micros in any::<u64>(),
        sequence in any::<u32>(),
        epoch in any::<u16>(),
        host_receive_seconds in prop::option::of(-1e9..1e9),
    ) -> Sample {
        let (counts, states) = sensors.into_iter().unzip();
        Sample { raw: RawSample { device_micros, sequence, epoch, counts, states }, host_receive_seconds }
    }
}

prop_compose! {
    pub(crate) fn any_transform()(t in any_bits(), r in prop::array::uniform4(any_bits()), s in any_bits()) -> Transform {
        Transform { translation: Vec3::new(t, 0.0, -0.0), rotation: Quat::from_array(r), scale: Vec3::splat(s) }
    }
}

pub(crate) fn any_event() -> impl Strategy<Value = Event> {
    let kind = prop_oneof![
        (any::<u64>(), any::<u32>())
            .prop_map(|(count, after_sequence)| EventKind::LostSamples { count, after_sequence }),
        (any::<u64>(), any::<u64>())
            .prop_map(|(crc_errors, discarded_bytes)| EventKind::Noise { crc_errors, discarded_bytes }),
        Just(EventKind::Restart),
        any::<u64>().prop_map(|micros| EventKind::ClockFault { fault: ClockFault::WentBack, micros }),
        (any::<u32>(), any::<u32>(), any::<u32>()).prop_map(|(p50_micros, p99_micros, max_micros)| {
            EventKind::Posing { p50_micros, p99_micros, max_micros }
        }),
        Just(EventKind::Reconnect),
        any::<u16>().prop_map(|epoch| EventKind::TopologyChange { epoch }),
        ".{0,30}".prop_map(|text| EventKind::Marker { text }),
    ];
    (prop::option::of(any::<u64>()), prop::option::of(-1e9..1e9), kind)
        .prop_map(|(device_micros, host_seconds, kind)| Event { device_micros, host_seconds, kind })
}

/// Bits of every number of a pose.
pub(crate) fn bits(pose: &Pose) -> Vec<u32> {
    let numbers = |t: &Transform| {
        let mut all = t.translation.to_array().to_vec();
        all.extend(t.rotation.to_array());
        all.extend(t.scale.to_array());
        all
    };
    pose.parent_from_bone.iter().flat_map(numbers).map(f32::to_bits).collect()
}
