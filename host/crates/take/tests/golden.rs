//! A take that was written once and must stay readable forever.
//!
//! `ARMATURE_UPDATE_GOLDEN=1 cargo test -p armature-take --test golden` rewrites it; do that only while the format has
//! not been released, or for a new minor version alongside the old file.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::path::Path;
use std::sync::LazyLock;

use armature_rig::{
    Bone, Calibration, JointAxis, JointTree, Mapping, MappingEntry, Part, PartKind, PartUid, Pose, RawSample,
    SensorCalibration, SensorState, Skeleton, Transform,
};
use armature_take::{Event, EventKind, Header, Record, RecordKind, Take, TakeWriter, verify};
use glam::{Quat, Vec3};
use support::bits;

fn header() -> Header {
    Header {
        program_version: "0.1.0".into(),
        character_name: "Käfer".into(),
        character_hash: std::array::from_fn(|i| 255 - i as u8),
        nominal_samples_per_second: Some(120.0),
        seed: Some(0x0123_4567_89AB_CDEF),
        virtual_clock: true,
        unix_micros: Some(-1),
        inverse_kinematics: None,
    }
}

/// Everything a record can hold, with numbers that a 32-bit float represents exactly.
fn skeleton() -> Skeleton {
    let rest = |x: f32, scale: f32| Transform {
        translation: Vec3::new(x, 0.25, -0.5),
        rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 1.0),
        scale: Vec3::splat(scale),
    };
    Skeleton::new(vec![
        Bone { name: "body".into(), parent: None, rest: rest(0.0, 1.0), tail: Vec3::ZERO },
        Bone { name: "left leg".into(), parent: Some(0), rest: rest(1.5, 1.0), tail: Vec3::new(0.0, -0.75, 0.0) },
        Bone { name: "Fühler".into(), parent: Some(0), rest: rest(-1.5, 2.0), tail: Vec3::new(0.0, 0.125, 0.0) },
    ])
    .unwrap()
}

fn tree() -> JointTree {
    let part = |uid: u8, kind, parent, outlet, counts_per_turn| Part {
        uid: PartUid(std::array::from_fn(|i| uid + i as u8)),
        kind,
        parent,
        outlet,
        counts_per_turn,
    };
    JointTree::new(vec![
        part(0x10, PartKind::Splitter { outlets: 5 }, None, 0, 0),
        part(0x20, PartKind::TwistBendTwist, Some(0), 4, 4096),
        part(0x30, PartKind::Bend, Some(0), 0, 16384),
        part(0x40, PartKind::Twist, Some(2), 0, 65536),
    ])
    .unwrap()
}

fn calibration() -> Calibration {
    let mut calibration = Calibration::for_tree(&tree());
    let sensor = |zero_counts, reversed, axis| SensorCalibration { zero_counts, reversed, axis, range: None };
    let uid = tree().parts()[1].uid;
    calibration.set_part(
        uid,
        vec![
            sensor(Some(17), false, JointAxis::Twist),
            sensor(Some(4095), true, JointAxis::Bend),
            sensor(None, true, JointAxis::Bend),
        ],
    );
    calibration
}

fn mapping() -> Mapping {
    let mut antenna = MappingEntry::new(tree().parts()[2].uid, "Fühler");
    antenna.mounting = Quat::from_xyzw(0.0, 1.0, 0.0, 0.0);
    Mapping { entries: vec![MappingEntry::new(tree().parts()[1].uid, "left leg"), antenna], ..Mapping::default() }
}

fn samples() -> [(RawSample, Option<f64>); 2] {
    let sample = |sequence, device_micros, states| RawSample {
        device_micros,
        sequence,
        epoch: 3,
        counts: vec![0, 1, 256, 65535, 2048],
        states,
    };
    let states = vec![
        SensorState::Ok,
        SensorState::NoData,
        SensorState::MagnetWeak,
        SensorState::Outlier,
        SensorState::MagnetWeak,
    ];
    [
        (sample(41, 5_000_000_000, vec![SensorState::Ok; 5]), None),
        (sample(u32::MAX, 5_000_008_333, states), Some(0.0625)),
    ]
}

fn moved_pose() -> Pose {
    let mut pose = skeleton().rest_pose();
    pose.parent_from_bone[0].translation = Vec3::new(-0.0, 0.25, 3.5);
    pose.parent_from_bone[1].rotation = Quat::from_xyzw(0.5, -0.5, 0.5, 0.5);
    pose.parent_from_bone[2].rotation = Quat::from_xyzw(0.0, 0.0, 1.0, 0.0);
    pose.parent_from_bone[2].scale = Vec3::new(2.0, 2.5, 2.0);
    pose
}

fn events() -> Vec<Event> {
    let kinds = [
        EventKind::LostSamples { count: 3, after_sequence: 41 },
        EventKind::Noise { crc_errors: 2, discarded_bytes: 70_000 },
        EventKind::Restart,
        EventKind::Reconnect,
        EventKind::TopologyChange { epoch: 4 },
        EventKind::Marker { text: "schön!".into() },
    ];
    let time = |i: usize| ((i.is_multiple_of(2)).then_some(5_000_008_333), (i.is_multiple_of(3)).then_some(0.5));
    kinds
        .into_iter()
        .enumerate()
        .map(|(i, kind)| Event { device_micros: time(i).0, host_seconds: time(i).1, kind })
        .collect()
}

fn write() -> Vec<u8> {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&skeleton()).unwrap();
    writer.topology(3, &tree()).unwrap();
    writer.calibration(&calibration()).unwrap();
    writer.mapping(&mapping()).unwrap();
    for (sample, host) in samples() {
        writer.sample(&sample, host).unwrap();
    }
    writer.pose(41, 5_000_000_000, &skeleton().rest_pose()).unwrap();
    writer.pose(u32::MAX, 5_000_008_333, &moved_pose()).unwrap();
    for event in events() {
        writer.event(&event).unwrap();
    }
    writer.finish().unwrap()
}

static GOLDEN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/version-1.0.take");
    if std::env::var_os("ARMATURE_UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, write()).unwrap();
    }
    std::fs::read(path).unwrap()
});

#[test]
fn the_golden_take_holds_what_it_always_held() {
    let (take, report) = Take::read(&GOLDEN).unwrap();
    assert!(report.is_whole(), "{report}");
    assert_eq!(take.header(), &header());
    assert_eq!(take.skeleton(), Some(&skeleton()));
    let kinds: Vec<u16> = take.records().iter().map(|record| record.kind().code()).collect();
    assert_eq!(kinds, [2, 3, 4, 5, 6, 6, 7, 7, 8, 8, 8, 8, 8, 8]);
    assert!(matches!(&take.records()[1], Record::Topology(t) if t.epoch == 3 && t.tree == tree()));
    assert_eq!(take.records()[2], Record::Calibration(calibration()));
    assert_eq!(take.records()[3], Record::Mapping(mapping()));
    let read: Vec<_> = take.samples().map(|s| (s.raw.clone(), s.host_receive_seconds)).collect();
    assert_eq!(read, samples());
    let poses: Vec<_> = take.poses().map(|packed| bits(&take.unpack(packed))).collect();
    assert_eq!(poses, [bits(&skeleton().rest_pose()), bits(&moved_pose())]);
    assert!(take.events().cloned().eq(events()));
    let end = take.end().unwrap();
    assert_eq!((end.records, end.samples, end.poses, end.events), (15, 2, 2, 6));
}

#[test]
fn writing_it_again_gives_the_same_bytes() {
    let bytes = GOLDEN.as_slice();
    assert_eq!(write(), bytes);
    assert_eq!(Take::read(bytes).unwrap().0.write(Vec::new()).unwrap(), bytes);
}

/// Byte positions taken from the table in the documentation, read without the crate.
#[test]
fn its_bytes_stand_where_the_table_says() {
    let bytes = GOLDEN.as_slice();
    assert_eq!(bytes[..16], [0x8A, 0x54, 0x41, 0x4B, 0x45, 0x0D, 0x0A, 0x0A, 1, 0, 0, 0, 0xE7, 0xEF, 0xC0, 0x47]);
    assert_eq!(bytes[16..18], RecordKind::Header.code().to_le_bytes());
    assert_eq!(bytes[22..26], 0b1111_u32.to_le_bytes(), "flags");
    assert_eq!(bytes[26..34], 120.0_f64.to_le_bytes(), "rate");
    assert_eq!(bytes[34..42], 0x0123_4567_89AB_CDEF_u64.to_le_bytes(), "seed");
    assert_eq!(bytes[42..50], (-1_i64).to_le_bytes(), "wall-clock time");
    assert_eq!((bytes[50], bytes[81]), (255, 224), "hash");
    assert_eq!(bytes[82..90], *b"\x06\0K\xC3\xA4fer");
    assert_eq!(bytes[90..97], *b"\x05\x000.1.0");
}

/// Its poses were made up, so a replay must report that they differ, and where first.
#[test]
fn its_poses_differ_from_a_replay_as_they_should() {
    let (take, _) = Take::read(&GOLDEN).unwrap();
    let verification = verify(&take, &mut |_, _| std::ops::ControlFlow::Continue(())).unwrap();
    assert_eq!((verification.identical, verification.different, verification.without_sample), (0, 2, 0));
    let first = verification.first_difference.unwrap();
    assert_eq!((first.record, first.sequence, first.bone_name.as_str()), (6, 41, "left leg"));
}
