//! From counts to poses.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::f32::consts::FRAC_PI_2;

use armature_rig::{
    BoneQuality, Calibration, JointAxis, JointTree, Mapping, MappingEntry, MappingError, PartSettings, Pose,
    PoseSolver, RawSample, SampleError, SensorCalibration, SensorState, Skeleton, joint_angles, joint_rotation,
    propose, skeleton_puppet,
};
use common::{BEND, HUMAN, TBT, TWIST, puppet, rich_human, skeleton, uid};
use glam::{Quat, Vec3};
use proptest::prelude::*;

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const QUARTER: u16 = 4096;

fn leg() -> (JointTree, Skeleton, Mapping) {
    let tree = puppet(&[("hip", TBT, ""), ("knee", BEND, "hip")]);
    let skeleton = skeleton(&[("thigh", "", [0.0, 1.0, 0.0]), ("shin", "thigh", [0.0, 0.5, 0.0])]);
    let mapping = propose(&tree, &skeleton).mapping;
    (tree, skeleton, mapping)
}

fn zeroed(tree: &JointTree, zero: &[u16]) -> Calibration {
    let mut calibration = Calibration::for_tree(tree);
    let states = vec![SensorState::Ok; zero.len()];
    let sample = RawSample { counts: zero.to_vec(), states, ..RawSample::default() };
    assert!(calibration.zero(tree, &sample).unwrap().skipped.is_empty());
    calibration
}

const OK: [SensorState; 4] = [SensorState::Ok; 4];

#[test]
fn a_bent_knee_takes_the_shin_backwards() {
    let (tree, skeleton, mapping) = leg();
    let zero = [100, 16000, 5, 16383];
    let mut solver = PoseSolver::new(&tree, &zeroed(&tree, &zero), &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &zero, &OK, &mut pose).unwrap();
    assert_eq!(pose, skeleton.rest_pose(), "at zero the pose is the rest pose, bit for bit");
    solver.solve(0, &[100, 16000, 5, (16383 + QUARTER) % 16384], &OK, &mut pose).unwrap();
    let mut frames = skeleton.rest_model_from_bone();
    pose.forward_kinematics(&skeleton, &mut frames);
    let shin = &skeleton.bones()[1];
    let end = frames[1].transform_point3(shin.tail);
    // About the joint's +X (the character's left), +Y (down the leg) turns to the joint's +Z, which is backwards.
    assert!(end.distance(Vec3::new(0.0, 0.5, -0.25)) < 1e-5, "{end}");
    assert!(solver.bone_status().iter().all(|s| s.quality == BoneQuality::Live));
}

#[test]
fn bad_readings_hold_and_are_told() {
    let (tree, skeleton, mapping) = leg();
    let mut solver = PoseSolver::new(&tree, &zeroed(&tree, &[0; 4]), &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    let knee = |state| [SensorState::Ok, SensorState::Ok, SensorState::Ok, state];
    solver.solve(0, &[0, 0, 0, 1], &knee(SensorState::NoData), &mut pose).unwrap();
    assert_eq!(pose, skeleton.rest_pose());
    assert_eq!(solver.bone_status()[1].quality, BoneQuality::NoReading);
    solver.solve(0, &[0, 0, 0, QUARTER], &knee(SensorState::MagnetWeak), &mut pose).unwrap();
    let bent = pose.clone();
    assert_eq!(solver.bone_status()[1].quality, BoneQuality::Weak);
    for held in 1..4 {
        let state = if held % 2 == 0 { SensorState::NoData } else { SensorState::Outlier };
        solver.solve(0, &[0, 0, 0, 9000], &knee(state), &mut pose).unwrap();
        assert_eq!(pose, bent);
        let status = solver.bone_status()[1];
        assert_eq!((status.quality, status.held_samples), (BoneQuality::Held, held));
    }
    assert_eq!(solver.bone_status()[0].quality, BoneQuality::Live);
    solver.solve(0, &[0; 4], &OK, &mut pose).unwrap();
    assert_eq!(pose, skeleton.rest_pose());
    assert_eq!(solver.bone_status()[1].held_samples, 0);
}

#[test]
fn what_was_never_zeroed_stays_at_rest() {
    let (tree, skeleton, mapping) = leg();
    let mut solver = PoseSolver::new(&tree, &Calibration::default(), &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &[1000, 2000, 3000, 4000], &OK, &mut pose).unwrap();
    assert_eq!(pose, skeleton.rest_pose());
    assert!(solver.bone_status().iter().all(|s| s.quality == BoneQuality::Unzeroed));
}

#[test]
fn an_unplugged_part_keeps_its_bone_where_it_was() {
    let (tree, skeleton, mapping) = leg();
    let calibration = zeroed(&tree, &[0; 4]);
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &[0, 0, 0, QUARTER], &OK, &mut pose).unwrap();
    let bent = pose.clone();
    let without_knee = JointTree::new(tree.parts()[..1].to_vec()).unwrap();
    let mut next = PoseSolver::new(&without_knee, &calibration, &mapping, &skeleton).unwrap();
    next.continue_from(&solver);
    next.solve(0, &[0; 3], &OK[..3], &mut pose).unwrap();
    assert_eq!(pose, bent);
    assert_eq!(next.bone_status()[1].quality, BoneQuality::Absent);
    let mut again = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    again.continue_from(&next);
    let mut states = OK;
    states[3] = SensorState::NoData;
    again.solve(0, &[0; 4], &states, &mut pose).unwrap();
    assert_eq!(again.bone_status()[1].quality, BoneQuality::NoReading);
}

/// Counts of the knee after this many milliseconds; everything else at rest.
fn knee_at(solver: &mut PoseSolver, millis: u64, counts: u16, state: SensorState) -> f32 {
    let mut pose = Pose::default();
    let states = [SensorState::Ok, SensorState::Ok, SensorState::Ok, state];
    solver.solve(millis * 1_000, &[0, 0, 0, counts], &states, &mut pose).unwrap();
    2.0 * pose.parent_from_bone[1].rotation.w.abs().min(1.0).acos()
}

#[test]
fn a_part_that_comes_back_takes_its_bone_along_over_a_moment() {
    let (tree, skeleton, mapping) = leg();
    let calibration = zeroed(&tree, &[0; 4]);
    let make = |tree: &JointTree| PoseSolver::new(tree, &calibration, &mapping, &skeleton).unwrap();
    let mut solver = make(&tree);
    solver.engage_over(250_000);
    assert!(knee_at(&mut solver, 0, 0, SensorState::Ok) < 1e-3);
    let mut out = make(&JointTree::new(tree.parts()[..1].to_vec()).unwrap());
    out.continue_from(&solver);
    let mut back = make(&tree);
    back.continue_from(&out);
    // It has no reading at first, and rebuilding the solver in between (when zeroing) changes nothing.
    assert!(knee_at(&mut back, 1_000, QUARTER, SensorState::NoData) < 1e-3);
    assert!(knee_at(&mut back, 1_010, QUARTER, SensorState::Ok) < 1e-3);
    let half = knee_at(&mut back, 1_135, QUARTER, SensorState::Ok);
    assert!((half - FRAC_PI_2 / 2.0).abs() < 0.02, "{half}");
    let mut again = make(&tree);
    again.continue_from(&back);
    let later = knee_at(&mut again, 1_140, QUARTER, SensorState::Ok);
    assert!(later > half && later < half + 0.1, "{later}");
    assert!((knee_at(&mut again, 1_261, QUARTER, SensorState::Ok) - FRAC_PI_2).abs() < 1e-3);
    again.engage_all();
    let (before, first) = (FRAC_PI_2, knee_at(&mut again, 9, 0, SensorState::Ok));
    assert!((before - first).abs() < 1e-3, "the whole puppet was away and its clock restarted");
    assert!(knee_at(&mut again, 260, 0, SensorState::Ok) < 1e-3);
}

#[test]
fn a_joint_that_is_silent_for_too_long_is_stale_and_comes_back_over_a_moment() {
    let (tree, skeleton, mapping) = leg();
    let mut calibration = zeroed(&tree, &[0; 4]);
    calibration.filter = "hold:100".parse().unwrap();
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    solver.engage_over(250_000);
    let quality = |solver: &PoseSolver| solver.bone_status()[1].quality;
    knee_at(&mut solver, 0, 0, SensorState::Ok);
    knee_at(&mut solver, 90, QUARTER, SensorState::Outlier);
    assert_eq!(quality(&solver), BoneQuality::Held);
    assert!((knee_at(&mut solver, 95, QUARTER, SensorState::Ok) - FRAC_PI_2).abs() < 1e-3, "a short gap has no effect");
    knee_at(&mut solver, 200, 0, SensorState::NoData);
    assert_eq!(quality(&solver), BoneQuality::Stale);
    assert!((knee_at(&mut solver, 210, 0, SensorState::Ok) - FRAC_PI_2).abs() < 1e-3, "no jump");
    assert_eq!(quality(&solver), BoneQuality::Live);
    let half = knee_at(&mut solver, 335, 0, SensorState::Ok);
    assert!((half - FRAC_PI_2 / 2.0).abs() < 0.02, "{half}");
    assert!(knee_at(&mut solver, 461, 0, SensorState::Ok) < 1e-3);
    assert_eq!(solver.lag_seconds(), (0.0, 0.0));
}

#[test]
fn a_filter_of_one_joint_calms_that_joint_alone_and_tells_its_lag() {
    let (tree, skeleton, mapping) = leg();
    let mut calibration = zeroed(&tree, &[0; 4]);
    let filter = "one-euro:1,0".parse().unwrap();
    calibration.set_part_settings(uid(1), PartSettings { filter: Some(filter), ..PartSettings::default() });
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    for step in 0..400_u64 {
        // Both turn across the wrap at a radian a second.
        let counts = ((16384 - 400 + step * 16384 / 1257) % 16384) as u16;
        solver.solve(step * 5_000, &[counts, 0, 0, counts], &OK, &mut pose).unwrap();
    }
    let turn = |counts: f32| counts * std::f32::consts::TAU / 16384.0;
    let reading = turn(399.0 * 16384.0 / 1257.0 - 400.0);
    let angle = |bone: usize| 2.0 * pose.parent_from_bone[bone].rotation.w.abs().min(1.0).acos();
    assert!((angle(0) - reading).abs() < 2e-3, "{} {reading}", angle(0));
    let (least, most) = solver.lag_seconds();
    assert!(least == 0.0 && (most - 1.0 / std::f64::consts::TAU).abs() < 1e-6, "{least} {most}");
    assert!((reading - angle(1) - most as f32).abs() < 5e-3, "{} behind {reading}", angle(1));
}

#[test]
fn mounting_and_heading_of_a_part_count_wherever_it_is_plugged_in() {
    let (tree, skeleton, mapping) = leg();
    let mut calibration = zeroed(&tree, &[0; 4]);
    let mounting = Quat::from_rotation_y(FRAC_PI_2);
    let heading = 0.6;
    calibration.set_part_settings(uid(0), PartSettings { heading, ..PartSettings::default() });
    calibration.set_part_settings(uid(1), PartSettings { mounting, ..PartSettings::default() });
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &[0, 0, 0, QUARTER], &OK, &mut pose).unwrap();
    let f = skeleton.bone_from_joint(1, &skeleton.rest_model_from_bone()) * mounting;
    let expected = f * Quat::from_rotation_x(FRAC_PI_2) * f.inverse();
    assert!(pose.parent_from_bone[1].rotation.dot(expected).abs() > 1.0 - 1e-6);
    let back = Quat::from_rotation_y(-heading as f32);
    assert!(pose.parent_from_bone[0].rotation.dot(back).abs() > 1.0 - 1e-6, "turned back about the vertical");
    let (part, turn) = solver.root_turn().unwrap();
    assert!(part == uid(0) && turn.dot(Quat::IDENTITY).abs() > 1.0 - 1e-6, "the turn is reported without the heading");
    calibration.set_part_settings(uid(1), PartSettings { mounting: mounting * 2.0, ..PartSettings::default() });
    let crooked = PoseSolver::new(&tree, &calibration, &mapping, &skeleton);
    assert!(matches!(crooked, Err(MappingError::BadMounting { .. })));
}

#[test]
fn two_parts_on_one_bone_compose_from_the_root_outwards() {
    let tree = puppet(&[("elbow", BEND, ""), ("forearm", TWIST, "elbow")]);
    let skeleton = skeleton(&[("forearm", "", [0.2, 1.0, 0.0])]);
    let twisted = Quat::from_rotation_y(0.4);
    // Listed in the wrong order on purpose: the tree decides.
    let mapping = Mapping {
        entries: vec![
            MappingEntry { mounting: twisted, ..MappingEntry::new(uid(1), "forearm") },
            MappingEntry::new(uid(0), "forearm"),
        ],
        ..Mapping::default()
    };
    let mut calibration = zeroed(&tree, &[0, 0]);
    assert!(calibration.flip(uid(1), 0));
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &[1000, 2000], &OK[..2], &mut pose).unwrap();
    let turn = std::f64::consts::TAU / 16384.0;
    let f = skeleton.bone_from_joint(0, &skeleton.rest_model_from_bone());
    let bend = joint_rotation(&[JointAxis::Bend], &[1000.0 * turn]);
    let twist = joint_rotation(&[JointAxis::Twist], &[-2000.0 * turn]);
    let g = f * twisted;
    let expected = f * bend * f.inverse() * g * twist * g.inverse();
    assert!(pose.parent_from_bone[0].rotation.angle_between(expected) < 1e-3);
    let dot = pose.parent_from_bone[0].rotation.dot(expected).abs();
    assert!(dot > 1.0 - 1e-6, "{dot}");
}

#[test]
fn an_axis_mounted_differently_is_used() {
    let (tree, skeleton, mapping) = leg();
    let mut calibration = zeroed(&tree, &[0; 4]);
    calibration.sensor_mut(uid(1), 0).unwrap().axis = JointAxis::Twist;
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &[0, 0, 0, QUARTER], &OK, &mut pose).unwrap();
    let along = pose.parent_from_bone[1].rotation * skeleton.bones()[1].tail;
    assert!(along.distance(skeleton.bones()[1].tail) < 1e-6, "a twist leaves the bone's direction");
    assert!(pose.parent_from_bone[1].rotation.angle_between(Quat::IDENTITY) - FRAC_PI_2 < 1e-3);
}

#[test]
fn mappings_that_cannot_be_are_named() {
    let (tree, skeleton, _) = leg();
    let calibration = Calibration::for_tree(&tree);
    let make = |entries: Vec<MappingEntry>| {
        PoseSolver::new(&tree, &calibration, &Mapping { entries, ..Mapping::default() }, &skeleton).err()
    };
    let unknown = make(vec![MappingEntry::new(uid(0), "rig:Thigh")]).unwrap();
    assert!(unknown.to_string().contains("did you mean \"thigh\""), "{unknown}");
    let twice = make(vec![MappingEntry::new(uid(0), "thigh"), MappingEntry::new(uid(0), "shin")]);
    assert!(matches!(twice, Some(MappingError::PartTwice { .. })));
    let crooked =
        MappingEntry { mounting: Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0), ..MappingEntry::new(uid(0), "thigh") };
    assert!(matches!(make(vec![crooked]), Some(MappingError::BadMounting { .. })));
    let splitter = puppet(&[("s", common::split(2), "")]);
    let mapping = Mapping { entries: vec![MappingEntry::new(uid(0), "thigh")], ..Mapping::default() };
    let refused = PoseSolver::new(&splitter, &calibration, &mapping, &skeleton);
    assert!(matches!(refused, Err(MappingError::Splitter { .. })));
    let mut short = calibration.clone();
    short.set_part(uid(0), vec![SensorCalibration::unzeroed(JointAxis::Bend)]);
    assert!(matches!(PoseSolver::new(&tree, &short, &mapping, &skeleton), Err(MappingError::Calibration(_))));
    let absent = Mapping { entries: vec![MappingEntry::new(uid(77), "thigh")], ..Mapping::default() };
    assert!(PoseSolver::new(&tree, &calibration, &absent, &skeleton).is_ok(), "a part may be unplugged");
}

#[test]
fn solving_allocates_nothing() {
    let tree = puppet(&HUMAN[..21]);
    let skeleton = rich_human();
    let counts = vec![123; tree.sensor_count()];
    let mut states = vec![SensorState::Ok; counts.len()];
    states[3] = SensorState::NoData;
    let mapping = propose(&tree, &skeleton).mapping;
    let mut solver = PoseSolver::new(&tree, &zeroed(&tree, &counts), &mapping, &skeleton).unwrap();
    let mut pose = skeleton.rest_pose();
    let before = ALLOCATIONS.with(Cell::get);
    for _ in 0..100 {
        solver.solve(0, &counts, &states, &mut pose).unwrap();
    }
    let wrong = solver.solve(0, &counts[1..], &states, &mut pose);
    assert_eq!(ALLOCATIONS.with(Cell::get), before);
    assert!(matches!(wrong, Err(SampleError::Length { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any pose, converted to counts by the inverse, comes back within the resolution of three sensors.
    #[test]
    fn poses_come_back_through_counts(turns in prop::collection::vec(prop::array::uniform4(-1.0_f32..1.0), 45), zero: u16) {
        let skeleton = rich_human();
        let (tree, part_of_bone) = skeleton_puppet(&skeleton, 16384, uid).unwrap();
        let zeros = vec![zero % 16384; tree.sensor_count()];
        let mapping = propose(&tree, &skeleton).mapping;
        let mut solver = PoseSolver::new(&tree, &zeroed(&tree, &zeros), &mapping, &skeleton).unwrap();
        let frames = skeleton.rest_model_from_bone();
        let mut counts = zeros.clone();
        let mut wanted = skeleton.rest_pose();
        for (bone, local) in wanted.parent_from_bone.iter_mut().enumerate() {
            let turn = Quat::from_array(turns[bone % turns.len()]);
            if turn.length() < 1e-2 { continue }
            let f = skeleton.bone_from_joint(bone, &frames);
            let delta = turn.normalize();
            local.rotation = (local.rotation * f * delta * f.inverse()).normalize();
            for (slot, angle) in tree.sensors(part_of_bone[bone]).zip(joint_angles(TBT, delta)) {
                let steps = libm::round(angle / std::f64::consts::TAU * 16384.0) as i64;
                counts[slot] = (i64::from(zeros[slot]) + steps).rem_euclid(16384) as u16;
            }
        }
        let mut pose = Pose::default();
        solver.solve(0, &counts, &vec![SensorState::Ok; counts.len()], &mut pose).unwrap();
        for (got, wanted) in pose.parent_from_bone.iter().zip(&wanted.parent_from_bone) {
            let d = got.rotation.as_dquat().inverse() * wanted.rotation.as_dquat();
            let apart = 2.0 * libm::atan2(libm::hypot(libm::hypot(d.x, d.y), d.z), d.w.abs()).to_degrees();
            prop_assert!(apart < 1.5 * 360.0 / 16384.0 + 1e-3, "{} degrees", apart);
            prop_assert!(got.rotation.is_normalized());
            prop_assert_eq!(got.translation, wanted.translation);
        }
        // Forward kinematics keeps lengths.
        let mut posed = frames.clone();
        pose.forward_kinematics(&skeleton, &mut posed);
        for (index, bone) in skeleton.bones().iter().enumerate() {
            if let Some(parent) = bone.parent {
                let (rest, now) = (frames[parent].translation.distance(frames[index].translation),
                    posed[parent].translation.distance(posed[index].translation));
                prop_assert!((rest - now).abs() < 1e-5);
            }
        }
    }
}
