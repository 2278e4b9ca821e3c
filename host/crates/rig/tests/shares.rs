//! Joints that turn several bones, and joints that blend shapes.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use armature_rig::{
    Calibration, DriveAxis, JointAxis, JointTree, Mapping, MappingEntry, MappingError, Pose, PoseSolver, RawSample,
    SensorState, ShapeDrive, SharedJoint, Sharing, Skeleton, StreamSolver, joint_rotation, propose,
};
use common::{BEND, TBT, puppet, rich_human, skeleton, uid};
use glam::Quat;

const TURN: u16 = 16384;
const OK: [SensorState; 3] = [SensorState::Ok; 3];

fn tail() -> Skeleton {
    skeleton(&[
        ("a", "", [0.0, 1.0, 0.0]),
        ("b", "a", [0.0, 1.1, -0.3]),
        ("b side", "a", [0.2, 1.0, 0.0]),
        ("c", "b", [0.1, 1.0, -0.6]),
        ("d", "c", [0.1, 1.2, -0.9]),
    ])
}

fn zeroed(tree: &JointTree) -> Calibration {
    let mut calibration = Calibration::for_tree(tree);
    let count = tree.sensor_count();
    let sample = RawSample { counts: vec![0; count], states: vec![SensorState::Ok; count], ..RawSample::default() };
    calibration.zero(tree, &sample).unwrap();
    calibration
}

fn shared(sharing: Sharing, bones: &[(&str, f64)]) -> Mapping {
    let bones = bones.iter().map(|(bone, share)| ((*bone).to_owned(), *share)).collect();
    Mapping {
        entries: vec![MappingEntry { mounting: Quat::from_rotation_y(0.7), ..MappingEntry::new(uid(0), "b") }],
        shared: vec![SharedJoint { part: uid(0), sharing, bones }],
        ..Mapping::default()
    }
}

fn model_rotations(skeleton: &Skeleton, pose: &Pose) -> Vec<Quat> {
    let mut model: Vec<Quat> = Vec::new();
    for (bone, own) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
        model.push(bone.parent.map_or(Quat::IDENTITY, |parent| model[parent]) * own.rotation);
    }
    model
}

fn solved(tree: &JointTree, mapping: &Mapping, skeleton: &Skeleton, counts: &[u16]) -> Pose {
    let mut solver = PoseSolver::new(tree, &zeroed(tree), mapping, skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, counts, &OK[..counts.len()], &mut pose).unwrap();
    pose
}

#[test]
fn the_last_bone_of_a_chain_turns_by_the_whole_rotation_and_the_others_part_of_it_about_the_same_axis() {
    let tree = puppet(&[("tail", TBT, "")]);
    let skeleton = tail();
    let whole = shared(Sharing::Chain, &[("b", 1.0)]);
    let mapping = shared(Sharing::Chain, &[("d", 0.5), ("b", 0.2), ("c", 0.3)]);
    for counts in [[0, 0, 0], [900, 2500, 60000], [100, 7000, 300], [0, TURN / 4, 0]] {
        // The same joint on one bone alone: what everything below it turns by.
        let alone = model_rotations(&skeleton, &solved(&tree, &whole, &skeleton, &counts));
        let turned = model_rotations(&skeleton, &solved(&tree, &mapping, &skeleton, &counts));
        let rest = model_rotations(&skeleton, &skeleton.rest_pose());
        let turn = |model: &[Quat], bone: usize| (model[bone] * rest[bone].inverse()).normalize();
        let (axis, angle) = turn(&alone, 1).to_axis_angle();
        assert!(turn(&turned, 4).dot(turn(&alone, 4)).abs() > 1.0 - 1e-6, "{counts:?}: the end turns wholly");
        for (bone, part) in [(1, 0.2), (3, 0.5)] {
            let expected = Quat::from_axis_angle(axis, angle * part);
            assert!(turn(&turned, bone).dot(expected).abs() > 1.0 - 1e-6, "{counts:?}: bone {bone} by {part}");
        }
        assert!(turn(&turned, 2).dot(Quat::IDENTITY).abs() > 1.0 - 1e-6, "what hangs above it stays");
    }
}

#[test]
fn curled_bones_turn_about_their_own_axes() {
    let tree = puppet(&[("fingers", BEND, "")]);
    let skeleton = tail();
    let mapping = shared(Sharing::Curl, &[("b", 1.0), ("c", -0.5), ("d", 2.0)]);
    let counts = [1500];
    let pose = solved(&tree, &mapping, &skeleton, &counts);
    let frames = skeleton.rest_model_from_bone();
    let angle = 1500.0 * std::f64::consts::TAU / f64::from(TURN);
    for (bone, curl) in [(1, 1.0), (3, -0.5), (4, 2.0)] {
        let f = skeleton.bone_from_joint(bone, &frames) * Quat::from_rotation_y(0.7);
        let expected = f * joint_rotation(&[JointAxis::Bend], &[angle * curl]) * f.inverse();
        let turn = skeleton.bones()[bone].rest.rotation.inverse() * pose.parent_from_bone[bone].rotation;
        assert!(turn.dot(expected).abs() > 1.0 - 1e-6, "bone {bone}");
    }
}

#[test]
fn shares_that_cannot_be_are_named() {
    let tree = puppet(&[("tail", TBT, "")]);
    let skeleton = tail();
    let refused = |sharing, bones: &[(&str, f64)]| {
        let made = PoseSolver::new(&tree, &zeroed(&tree), &shared(sharing, bones), &skeleton);
        let error = made.expect_err("it cannot be used");
        assert!(matches!(error, MappingError::BadShares { .. }), "{error:?}");
        error.to_string()
    };
    for (bones, why) in [
        (&[("b", 0.5), ("c", 0.4)][..], "sum to 0.9"),
        (&[("b", 0.5), ("b side", 0.5)], "does not hang below"),
        (&[("b", 0.5), ("tip", 0.5)], "no bone \"tip\""),
        (&[("b", 0.5), ("b", 0.5)], "two shares"),
        (&[("c", 0.5), ("d", 0.5)], "its own bone \"b\" has no share"),
        (&[("b", f64::NAN), ("c", 0.5)], "has the share NaN"),
        (&[("b", 1.5), ("c", -0.5)], "more than 0 and at most 1"),
        (&[], "its own bone"),
    ] {
        let said = refused(Sharing::Chain, bones);
        assert!(said.contains(why), "{said}");
    }
    assert!(refused(Sharing::Curl, &[("b", 1.0), ("c", 5.0)]).contains("from -4 to 4"));
    let mut mapping = shared(Sharing::Chain, &[("b", 1.0)]);
    mapping.shared.push(mapping.shared[0].clone());
    assert!(PoseSolver::new(&tree, &zeroed(&tree), &mapping, &skeleton).unwrap_err().to_string().contains("twice"));
    mapping.shared.truncate(1);
    mapping.entries.clear();
    assert!(PoseSolver::new(&tree, &zeroed(&tree), &mapping, &skeleton).unwrap_err().to_string().contains("no bone"));
}

#[test]
fn the_only_joint_of_a_spine_is_proposed_for_all_its_bones_and_two_joints_keep_theirs() {
    let parts = [
        ("hips", TBT, ""),
        ("pelvis", common::split(3), "hips"),
        ("left hip", TBT, "pelvis"),
        ("spine", TBT, "pelvis"),
        ("right hip", TBT, "pelvis"),
        ("left knee", BEND, "left hip"),
        ("left ankle", TBT, "left knee"),
        ("right knee", BEND, "right hip"),
        ("right ankle", TBT, "right knee"),
        ("shoulders", common::split(3), "spine"),
        ("left shoulder", TBT, "shoulders"),
        ("neck", TBT, "shoulders"),
        ("right shoulder", TBT, "shoulders"),
        ("left elbow", BEND, "left shoulder"),
        ("left wrist", TBT, "left elbow"),
        ("right elbow", BEND, "right shoulder"),
        ("right wrist", TBT, "right elbow"),
        ("head", TBT, "neck"),
    ];
    let (tree, skeleton) = (puppet(&parts), rich_human());
    let proposal = propose(&tree, &skeleton);
    let [joint] = proposal.mapping.shared.as_slice() else { panic!("{:#?}", proposal.mapping) };
    assert_eq!((joint.part, joint.sharing), (uid(3), Sharing::Chain));
    let names: Vec<&str> = joint.bones.iter().map(|(bone, _)| bone.as_str()).collect();
    assert_eq!(names, ["Spine", "Spine1", "Spine2"]);
    assert!(!proposal.unmapped_bones.iter().any(|bone| bone.starts_with("Spine")), "{:?}", proposal.unmapped_bones);
    // The shoulders turn as they did when one bone had it all.
    let mut counts = vec![0; tree.sensor_count()];
    counts[tree.sensors(3).start + 1] = 2000;
    let solve = |mapping: &Mapping| {
        let mut solver = PoseSolver::new(&tree, &zeroed(&tree), mapping, &skeleton).unwrap();
        let mut pose = Pose::default();
        solver.solve(0, &counts, &vec![SensorState::Ok; counts.len()], &mut pose).unwrap();
        model_rotations(&skeleton, &pose)
    };
    let [with, without] = [proposal.mapping.shared.clone(), Vec::new()]
        .map(|shared| solve(&Mapping { shared, ..proposal.mapping.clone() }));
    let at = |name: &str| skeleton.find(name).unwrap();
    for name in ["Spine2", "Neck", "LeftArm"] {
        assert!(with[at(name)].dot(without[at(name)]).abs() > 1.0 - 1e-6, "{name}");
    }
    assert!(with[at("Spine1")].angle_between(without[at("Spine1")]) > 0.1);
    let two = propose(&puppet(&common::HUMAN[..21]), &skeleton);
    assert!(two.mapping.shared.is_empty(), "{:#?}", two.mapping.shared);
}

fn jaw(degrees: [f64; 2], weights: [f64; 2]) -> ShapeDrive {
    ShapeDrive { shape: "jaw".into(), part: uid(1), axis: DriveAxis::Bend, degrees, weights }
}

fn face(drive: ShapeDrive) -> StreamSolver {
    let tree = puppet(&[("head", TBT, ""), ("jaw", BEND, "head")]);
    let mut solver = StreamSolver::new(tail());
    solver.set_calibration(zeroed(&tree));
    solver.set_topology(0, tree);
    let entries = vec![MappingEntry::new(uid(0), "a")];
    solver.set_mapping(Mapping { entries, shapes: vec![drive], ..Mapping::default() });
    solver
}

fn sample(micros: u64, degrees: f64, state: SensorState) -> RawSample {
    let counts = (degrees / 360.0 * f64::from(TURN)).rem_euclid(f64::from(TURN)).round() as u16;
    let states = vec![SensorState::Ok, SensorState::Ok, SensorState::Ok, state];
    RawSample { device_micros: micros, counts: vec![0, 0, 0, counts], states, ..RawSample::default() }
}

#[test]
fn a_joint_blends_a_shape_between_two_angles_and_no_further() {
    let mut solver = face(jaw([5.0, 25.0], [0.0, 1.0]));
    assert_eq!(solver.shapes().get("jaw"), None, "nothing was read yet");
    for (degrees, weight) in [(0.0, 0.0), (5.0, 0.0), (15.0, 0.5), (25.0, 1.0), (90.0, 1.0), (-90.0, 0.0)] {
        solver.solve(&sample(0, degrees, SensorState::Ok)).unwrap();
        let shown = solver.shapes().get("jaw").unwrap();
        assert!((shown - weight).abs() < 2e-3, "{degrees}°: {shown}");
    }
    // Falling, beyond 1, and from high to low angles.
    let mut solver = face(jaw([20.0, -20.0], [1.5, -0.5]));
    solver.solve(&sample(0, 10.0, SensorState::Ok)).unwrap();
    assert!((solver.shapes().get("jaw").unwrap() - 1.0).abs() < 2e-3);
}

#[test]
fn a_shape_keeps_its_weight_without_readings_and_is_set_by_hand_where_no_joint_drives_it() {
    let mut solver = face(jaw([0.0, 20.0], [0.0, 1.0]));
    solver.solve(&sample(0, 10.0, SensorState::NoData)).unwrap();
    assert_eq!(solver.shapes().get("jaw"), None, "never read");
    solver.solve(&sample(5_000, 10.0, SensorState::Ok)).unwrap();
    solver.solve(&sample(10_000, 0.0, SensorState::NoData)).unwrap();
    assert!((solver.shapes().get("jaw").unwrap() - 0.5).abs() < 2e-3, "the last reading holds");
    solver.set_shape("blink", 0.25).unwrap();
    solver.set_shape("jaw", 0.9).unwrap();
    assert_eq!(solver.shapes().get("jaw"), Some(0.9));
    solver.solve(&sample(15_000, 21.0, SensorState::Ok)).unwrap();
    let all: Vec<(&str, f32)> = solver.shapes().iter().collect();
    assert_eq!(all, [("jaw", 1.0), ("blink", 0.25)], "the joint has the last word");
    let error = solver.set_shape("blink", f32::NAN).unwrap_err().to_string();
    assert!(error.contains("blink") && solver.shapes().get("blink") == Some(0.25), "{error}");
}

#[test]
fn a_shape_whose_joint_is_plugged_in_again_glides_to_what_it_reads() {
    let mut solver = face(jaw([0.0, 20.0], [0.0, 1.0]));
    solver.engage(250_000, false);
    solver.solve(&sample(0, 0.0, SensorState::Ok)).unwrap();
    let whole = solver.topology().unwrap().1.clone();
    solver.set_topology(1, puppet(&[("head", TBT, "")]));
    let short = RawSample { epoch: 1, counts: vec![0; 3], states: OK.to_vec(), ..RawSample::default() };
    solver.solve(&short).unwrap();
    assert_eq!(solver.shapes().get("jaw"), Some(0.0), "it is away and keeps its weight");
    solver.set_topology(2, whole);
    let mut before = 0.0;
    for step in 0..=60 {
        let back = RawSample { epoch: 2, ..sample(1_000_000 + 5_000 * step, 21.0, SensorState::Ok) };
        solver.solve(&back).unwrap();
        let shown = solver.shapes().get("jaw").unwrap();
        assert!((0.0..0.05).contains(&(shown - before)), "{step}: {before} to {shown}");
        before = shown;
    }
    assert!((before - 1.0).abs() < 1e-6);
}

#[test]
fn shapes_that_cannot_be_driven_are_named() {
    let refused = |drive: ShapeDrive| {
        let mut solver = face(drive);
        solver.solve(&sample(0, 0.0, SensorState::Ok)).unwrap_err().to_string()
    };
    assert!(refused(jaw([10.0, 10.0], [0.0, 1.0])).contains("two different angles"));
    assert!(refused(jaw([f64::NAN, 10.0], [0.0, 1.0])).contains("two different angles"));
    assert!(refused(jaw([0.0, 10.0], [0.0, f64::INFINITY])).contains("give -10 to 10"));
    let twist = ShapeDrive { axis: DriveAxis::EndTwist, ..jaw([0.0, 10.0], [0.0, 1.0]) };
    assert!(refused(twist).contains("no sensor for end-twist"));
    let mut away = face(ShapeDrive { part: uid(7), ..jaw([0.0, 10.0], [0.0, 1.0]) });
    away.solve(&sample(0, 0.0, SensorState::Ok)).unwrap();
    assert_eq!(away.shapes().get("jaw"), None, "its part may be plugged in later");
}
