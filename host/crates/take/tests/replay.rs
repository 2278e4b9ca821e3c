//! Replay: the recorded poses come out again, bit for bit, and any difference is named.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;

use armature_rig::{MappingError, PartUid, RawSample, SensorState, SolveError, StreamSolver};
use armature_take::{Difference, Record, ReplayError, Take, TakeWriter, Verification, replay, solve_again, verify};
use glam::Quat;
use proptest::prelude::*;
use support::{arm, arm_calibration, arm_mapping, arm_tree, bits, header, pose, raw, read};

fn go_on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn check(take: &Take) -> Verification {
    verify(take, &mut go_on).unwrap()
}

/// What can happen while recording.
#[derive(Clone, Debug)]
enum Step {
    Sample(RawSample),
    /// Zero everything at this sample's counts.
    Zero(RawSample),
    Flip,
    /// Mount the wrist at this angle.
    Mount(f32),
    /// Plug the second part in or out.
    Plug(bool),
}

/// Records as the live program does: every change and every sample goes to both solver and writer.
struct Studio {
    solver: StreamSolver,
    writer: TakeWriter<Vec<u8>>,
    epoch: u16,
    unsolved: u64,
}

impl Studio {
    fn new() -> Self {
        let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
        writer.skeleton(&arm()).unwrap();
        let mut studio = Self { solver: StreamSolver::new(arm()), writer, epoch: 0, unsolved: 0 };
        studio.topology(true);
        studio.solver.set_calibration(arm_calibration());
        studio.writer.calibration(&arm_calibration()).unwrap();
        studio.solver.set_mapping(arm_mapping());
        studio.writer.mapping(&arm_mapping()).unwrap();
        studio
    }

    fn topology(&mut self, both: bool) {
        self.epoch += 1;
        let parts = arm_tree().parts()[..if both { 2 } else { 1 }].to_vec();
        let tree = armature_rig::JointTree::new(parts).unwrap();
        self.writer.topology(self.epoch, &tree).unwrap();
        self.solver.set_topology(self.epoch, tree);
    }

    fn sample(&mut self, mut sample: RawSample) {
        let sensors = self.solver.topology().unwrap().1.sensor_count();
        sample.counts.truncate(sensors);
        sample.states.truncate(sensors);
        sample.epoch = self.epoch;
        self.writer.sample(&sample, None).unwrap();
        match self.solver.solve(&sample) {
            Ok(pose) => self.writer.pose(sample.sequence, sample.device_micros, pose).unwrap(),
            Err(_) => self.unsolved += 1,
        }
    }

    fn step(&mut self, step: &Step) {
        let mut calibration = self.solver.calibration().clone();
        let mut mapping = self.solver.mapping().unwrap().clone();
        match step {
            Step::Sample(sample) => return self.sample(sample.clone()),
            Step::Plug(both) => return self.topology(*both),
            Step::Zero(sample) => {
                calibration.zero(&arm_tree(), sample).unwrap();
            }
            Step::Flip => {
                calibration.flip(PartUid([1; 12]), 1);
            }
            Step::Mount(angle) => mapping.entries[1].mounting = Quat::from_rotation_z(*angle),
        }
        self.writer.calibration(&calibration).unwrap();
        self.solver.set_calibration(calibration);
        self.writer.mapping(&mapping).unwrap();
        self.solver.set_mapping(mapping);
    }
}

fn any_step() -> impl Strategy<Value = Step> {
    let sample = (prop::collection::vec((any::<u16>(), support::any_state()), 4), 0_u32..9).prop_map(|(sensors, n)| {
        let (counts, states) = sensors.into_iter().unzip();
        RawSample { device_micros: 1000 * u64::from(n), sequence: n, epoch: 0, counts, states }
    });
    let sample = sample.boxed();
    prop_oneof![
        8 => sample.clone().prop_map(Step::Sample),
        1 => sample.prop_map(Step::Zero),
        1 => Just(Step::Flip),
        1 => (-3.0_f32..3.0).prop_map(Step::Mount),
        1 => any::<bool>().prop_map(Step::Plug),
    ]
}

proptest! {
    /// Held readings, changes of everything in mid-take, samples repeated or out of order.
    #[test]
    fn any_session_replays_bit_for_bit(steps in prop::collection::vec(any_step(), 1..60)) {
        let mut studio = Studio::new();
        for step in &steps {
            studio.step(step);
        }
        let poses = studio.writer.totals().poses;
        let take = read(&studio.writer.finish().unwrap());
        let verification = check(&take);
        prop_assert_eq!(verification.identical, poses);
        prop_assert_eq!(verification.different + verification.without_sample, 0);
        prop_assert_eq!(verification.replay.unsolved, studio.unsolved);
        prop_assert_eq!(verification.is_exact(), poses > 0);
        let (again, summary) = solve_again(&take, None, &mut go_on).unwrap();
        prop_assert_eq!(summary.solved, poses);
        prop_assert!(take.poses().eq(again.iter()));
    }
}

#[test]
fn a_calibration_in_mid_take_changes_what_follows_and_nothing_before() {
    let mut studio = Studio::new();
    let bent = RawSample { counts: vec![2048, 3000, 2048, 2500], ..raw(0, 0) };
    studio.sample(bent.clone());
    studio.step(&Step::Zero(bent.clone()));
    studio.sample(RawSample { sequence: 1, device_micros: 10_000, ..bent });
    let take = read(&studio.writer.finish().unwrap());
    assert!(check(&take).is_exact());
    let poses: Vec<_> = take.poses().map(|packed| take.unpack(packed)).collect();
    let turned = |pose: &armature_rig::Pose, bone: usize| {
        pose.parent_from_bone[bone].rotation.angle_between(arm().bones()[bone].rest.rotation)
    };
    let counts_as_angle = |counts: f32| counts / 4096.0 * std::f32::consts::TAU;
    assert!((turned(&poses[0], 0) - counts_as_angle(952.0)).abs() < 1e-5);
    assert!((turned(&poses[0], 2) - counts_as_angle(452.0)).abs() < 1e-5);
    assert!(turned(&poses[1], 0) < 1e-3 && turned(&poses[1], 2) < 1e-3);
}

#[test]
fn the_first_difference_is_named_to_the_bone() {
    let mut studio = Studio::new();
    (0..5).for_each(|n| studio.sample(raw(n, u64::from(n) * 1000)));
    let take = read(&studio.writer.finish().unwrap());
    let mut forged = TakeWriter::new(Vec::new(), take.header()).unwrap();
    let mut honest = None;
    for record in take.records() {
        match record {
            Record::Pose(packed) if packed.sequence >= 3 => {
                let mut pose = take.unpack(packed);
                honest.get_or_insert(pose.parent_from_bone[2]);
                let rotation = &mut pose.parent_from_bone[2].rotation;
                rotation.w = f32::from_bits(rotation.w.to_bits() ^ 1);
                forged.pose(packed.sequence, packed.device_micros, &pose).unwrap();
            }
            other => forged.record(other).unwrap(),
        }
    }
    let verification = check(&read(&forged.finish().unwrap()));
    assert_eq!((verification.identical, verification.different), (3, 2));
    assert!(!verification.is_exact());
    let Difference { sequence, device_micros, bone, bone_name, recorded, solved, .. } =
        verification.first_difference.unwrap();
    assert_eq!((sequence, device_micros, bone, bone_name.as_str()), (3, 3000, 2, "hand"));
    assert_eq!(Some(solved), honest);
    assert_ne!(recorded, solved);
}

#[test]
fn samples_without_a_pose_are_counted_with_the_reason() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.sample(&raw(0, 0), None).unwrap();
    writer.skeleton(&arm()).unwrap();
    writer.topology(1, &arm_tree()).unwrap();
    writer.sample(&raw(1, 1), None).unwrap();
    let mut mapping = arm_mapping();
    mapping.entries[0].bone = "Upper".into();
    writer.mapping(&mapping).unwrap();
    writer.sample(&raw(2, 2), None).unwrap();
    writer.mapping(&arm_mapping()).unwrap();
    writer.sample(&RawSample { epoch: 9, ..raw(3, 3) }, None).unwrap();
    writer.sample(&RawSample { counts: vec![], states: vec![], ..raw(4, 4) }, None).unwrap();
    writer.sample(&raw(5, 5), None).unwrap();
    let take = read(&writer.finish().unwrap());
    let mut reasons = Vec::new();
    let summary = replay(&take, None, &mut |_, replayed| {
        if let armature_take::Replayed::Sample { pose, .. } = replayed {
            reasons.push(pose.err());
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(matches!(
        &reasons[..],
        [
            Some(SolveError::NoTopology),
            Some(SolveError::NoMapping),
            Some(SolveError::Mapping(MappingError::UnknownBone { .. })),
            Some(SolveError::OtherEpoch { sample: 9, topology: 1 }),
            Some(SolveError::Sample(_)),
            None
        ]
    ));
    assert_eq!((summary.solved, summary.unsolved), (1, 5));
    assert_eq!(summary.first_unsolved, Some((0, SolveError::NoTopology)));
}

#[test]
fn poses_whose_sample_was_destroyed_are_counted_apart() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&arm()).unwrap();
    writer.pose(7, 7, &pose(7)).unwrap();
    let verification = check(&read(&writer.finish().unwrap()));
    assert_eq!(verification.without_sample, 1);
    assert!(!verification.is_exact());
}

#[test]
fn a_replay_needs_a_skeleton_and_can_be_cancelled() {
    let writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    let take = read(&writer.finish().unwrap());
    assert_eq!(verify(&take, &mut go_on), Err(ReplayError::NoSkeleton));
    let mut studio = Studio::new();
    studio.sample(raw(0, 0));
    let take = read(&studio.writer.finish().unwrap());
    assert_eq!(verify(&take, &mut |_, _| ControlFlow::Break(())), Err(ReplayError::Cancelled));
}

#[test]
fn a_sensor_without_data_holds_across_a_change_of_the_puppet() {
    let mut studio = Studio::new();
    studio.sample(RawSample { counts: vec![2048, 2600, 2048, 2300], ..raw(0, 0) });
    let before = studio.solver.pose().clone();
    studio.step(&Step::Plug(false));
    studio.step(&Step::Plug(true));
    studio.sample(RawSample { states: vec![SensorState::NoData; 4], ..raw(1, 1000) });
    assert_eq!(bits(studio.solver.pose()), bits(&before));
    assert!(check(&read(&studio.writer.finish().unwrap())).is_exact());
}
