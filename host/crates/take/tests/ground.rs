//! How a character stands is part of its take.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::ops::ControlFlow;

use armature_rig::{
    Bone, Calibration, Footing, Ground, GroundMode, PartUid, RawSample, SensorState, Skeleton, StreamSolver, Transform,
    propose, skeleton_puppet,
};
use armature_take::{Header, PayloadError, Problem, Record, RecordKind, Take, TakeWriter, solve_on_ground, verify};
use glam::Vec3;

fn keep_going(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn leg() -> Skeleton {
    let down = Vec3::new(0.0, -0.5, 0.0);
    let bone = |name: &str, parent, translation| Bone {
        name: name.into(),
        parent,
        rest: Transform { translation, ..Transform::IDENTITY },
        tail: down,
    };
    Skeleton::new(vec![bone("thigh", None, Vec3::Y), bone("shin", Some(0), down)]).unwrap()
}

/// A bending knee, with or without a floor.
fn take(ground: Option<&Ground>) -> Vec<u8> {
    let skeleton = leg();
    let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8; 12])).unwrap();
    let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
    let (mapping, mut calibration) = (propose(&tree, &skeleton).mapping, Calibration::for_tree(&tree));
    let rest = RawSample { counts: vec![0; 6], states: vec![SensorState::Ok; 6], ..RawSample::default() };
    calibration.zero(&tree, &rest).unwrap();
    writer.skeleton(&skeleton).unwrap();
    if let Some(ground) = ground {
        writer.ground(Some(ground)).unwrap();
    }
    writer.topology(0, &tree).unwrap();
    writer.calibration(&calibration).unwrap();
    writer.mapping(&mapping).unwrap();
    let mut solver = StreamSolver::new(skeleton);
    solver.set_topology(0, tree);
    solver.set_calibration(calibration);
    solver.set_mapping(mapping);
    solver.set_ground(ground.cloned()).unwrap();
    for step in 0..60_u16 {
        let counts = vec![0, 0, 0, 0, 8 * step, 0];
        let states = vec![SensorState::Ok; counts.len()];
        let device_micros = 8_333 * u64::from(step);
        let sample = RawSample { device_micros, sequence: step.into(), epoch: 0, counts, states };
        writer.sample(&sample, None).unwrap();
        writer.pose(sample.sequence, device_micros, solver.solve_completed(&sample, None).unwrap()).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn a_take_with_ground_reads_writes_and_replays_bit_for_bit() {
    let ground = Ground::of_skeleton(&leg(), GroundMode::Walk, &[1]).unwrap();
    let bytes = take(Some(&ground));
    let (read, report) = Take::read(&bytes).unwrap();
    assert!(report.is_whole(), "{report}");
    assert_eq!(read.ground(), Some(&ground));
    assert_eq!(read.write(Vec::new()).unwrap(), bytes);
    let verification = verify(&read, &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{verification:?}");
    let root = |take: &Take| take.unpack(take.poses().last().unwrap()).parent_from_bone[0].translation;
    assert!((root(&read) - Vec3::Y).length() > 0.02, "a knee that bends moves the root: {}", root(&read));
}

#[test]
fn old_takes_stand_when_asked_to_and_others_no_longer() {
    let ground = Ground::of_skeleton(&leg(), GroundMode::Walk, &[1]).unwrap();
    let [with, without] = [Some(&ground), None].map(|ground| Take::read(&take(ground)).unwrap().0);
    assert_eq!(without.ground(), None);
    let standing = solve_on_ground(&without, Some(&ground), None, &mut keep_going).unwrap();
    assert_eq!(standing.records(), with.records());
    let floating = solve_on_ground(&with, None, None, &mut keep_going).unwrap();
    assert_eq!(floating.records(), without.records());
    let stopped = solve_on_ground(&with, None, None, &mut |_, _| ControlFlow::Break(()));
    assert!(stopped.is_err());
}

#[test]
fn a_floor_for_another_skeleton_is_named_and_passed_over() {
    let ground = Ground::of_skeleton(&leg(), GroundMode::Stand, &[1]).unwrap();
    let wrong = [
        Ground { contacts: vec![7], ..ground.clone() },
        Ground { contacts: Vec::new(), ..ground.clone() },
        Ground { floor: f32::NAN, ..ground.clone() },
        Ground { points: Vec::new(), ..ground.clone() },
    ];
    for ground in wrong {
        let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
        writer.skeleton(&leg()).unwrap();
        writer.record(&Record::Ground(Some(ground))).unwrap();
        let (read, report) = Take::read(&writer.finish().unwrap()).unwrap();
        let named = matches!(
            report.problems[..],
            [Problem::Unusable { kind: RecordKind::Ground, reason: PayloadError::Ground(_), .. }]
        );
        assert!(named && read.ground().is_none(), "{report}");
    }
}

/// Written by the program that first had a floor; never to be renewed.
#[test]
fn takes_of_the_first_floor_replay_bit_for_bit() {
    for bytes in [&include_bytes!("golden/ground-1-walk.take")[..], include_bytes!("golden/ground-1-stand.take")] {
        let (read, report) = Take::read(bytes).unwrap();
        assert!(report.is_whole(), "{report}");
        let ground = read.ground().unwrap();
        assert_eq!((ground.footing, ground.is_held), (Footing::Point, false));
        assert_eq!(read.write(Vec::new()).unwrap(), bytes);
        let verification = verify(&read, &mut keep_going).unwrap();
        assert!(verification.is_exact(), "{verification:?}");
        // With soles it is another motion.
        let sole = Ground { footing: Footing::Sole, ..ground.clone() };
        let again = solve_on_ground(&read, Some(&sole), None, &mut keep_going).unwrap();
        assert!(verify(&again, &mut keep_going).unwrap().is_exact());
        assert!(!again.poses().eq(read.poses()));
        let held = Ground { is_held: true, ..sole };
        let written = solve_on_ground(&read, Some(&held), None, &mut keep_going).unwrap().write(Vec::new()).unwrap();
        assert_eq!(Take::read(&written).unwrap().0.ground(), Some(&held));
    }
}
