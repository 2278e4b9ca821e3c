//! Targets are part of a take.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_rig::{Bone, Skeleton, Target, TargetChange, TargetError, TargetPoint, Transform};
use armature_take::{Header, InverseKinematicsHeader, PayloadError, Problem, Record, RecordKind, Take, TakeWriter};
use glam::{Quat, Vec3};

fn skeleton() -> Skeleton {
    let bone = |name: &str, parent| Bone { name: name.into(), parent, rest: Transform::IDENTITY, tail: Vec3::Y };
    Skeleton::new(vec![bone("arm", None), bone("hand", Some(0))]).unwrap()
}

fn set(point: TargetPoint, position: Option<Vec3>, orientation: Option<Quat>) -> TargetChange {
    TargetChange::Set { target: Target { point, position, orientation, strength: 0.75 }, over_micros: 250_000 }
}

fn written(records: impl IntoIterator<Item = Record>) -> Vec<u8> {
    let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
    writer.skeleton(&skeleton()).unwrap();
    records.into_iter().for_each(|record| writer.record(&record).unwrap());
    writer.finish().unwrap()
}

#[test]
fn targets_of_every_kind_are_read_as_they_were_written() {
    let skin = TargetPoint::Skin { vertices: [3, 7, 70_000], barycentric: [0.5, 0.25, 0.25] };
    let ik = InverseKinematicsHeader {
        pins: vec!["arm:fixed".into()],
        preferences: vec!["hand:stiff=1".into()],
        limits: vec!["hand:bend=0..90".into()],
        settings: vec!["factor=64".into()],
    };
    let changes = [
        set(TargetPoint::Head(1), Some(Vec3::new(1.0, -2.0, 0.5)), None),
        set(TargetPoint::Tail(0), None, Some(Quat::from_rotation_x(0.3))),
        set(skin, Some(Vec3::ZERO), None),
        set(TargetPoint::Head(1), Some(Vec3::X), Some(Quat::IDENTITY)),
        TargetChange::Release { point: skin, over_micros: 7 },
        TargetChange::Release { point: TargetPoint::Tail(0), over_micros: 0 },
    ];
    let records: Vec<Record> =
        std::iter::once(Record::InverseKinematics(ik.clone())).chain(changes.map(Record::Target)).collect();
    let bytes = written(records.clone());
    let (take, report) = Take::read(&bytes).unwrap();
    assert!(report.is_whole(), "{report}");
    assert_eq!(take.records()[1..], records[..]);
    assert_eq!(take.inverse_kinematics(), Some(&ik));
    assert_eq!(take.write(Vec::new()).unwrap(), bytes);
}

#[test]
fn targets_that_mean_nothing_are_named_and_passed_over() {
    for (change, why) in [
        (set(TargetPoint::Head(9), Some(Vec3::X), None), TargetError::NoSuchBone { bone: 9, bones: 2 }),
        (set(TargetPoint::Head(0), Some(Vec3::NAN), None), TargetError::NotFinite),
        (set(TargetPoint::Head(0), None, None), TargetError::Nothing),
    ] {
        let (take, report) = Take::read(&written([Record::Target(change)])).unwrap();
        let [Problem::Unusable { kind: RecordKind::Target, reason: PayloadError::Target(found), .. }] =
            &report.problems[..]
        else {
            panic!("{report}")
        };
        assert_eq!(*found, why);
        assert_eq!(take.records().len(), 1);
    }
}
