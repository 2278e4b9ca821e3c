//! A human posed by a few of its bones.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use armature_character::Character;
use armature_character::inverse_kinematics::{
    BoneRole, Comfort, IkBones, IkEnergy, IkError, IkSettings, InverseKinematics, PinnedBone, RefitCost,
};
use armature_character::own::human;
use armature_formats::model::Skin;
use armature_rig::{BoneQuality, BoneStatus, Pose, PoseCompletion, PoseMoment, Skeleton};
use glam::{Affine3A, Mat3, Quat, Vec3};

static HUMAN: LazyLock<Character> = LazyLock::new(|| human().unwrap());
const DRIVEN: [&str; 8] = [
    "UpperChest",
    "Head",
    "LeftUpperArm",
    "RightUpperArm",
    "LeftLowerArm",
    "RightLowerArm",
    "LeftUpperLeg",
    "RightUpperLeg",
];

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is passed to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn pins(names: &[&str]) -> Vec<PinnedBone> {
    names.iter().map(|name| name.parse().unwrap()).collect()
}

fn status(skeleton: &Skeleton) -> Vec<BoneStatus> {
    let of = |name: &str| BoneStatus {
        quality: if DRIVEN.contains(&name) { BoneQuality::Live } else { BoneQuality::Unmapped },
        held_samples: 0,
    };
    skeleton.bones().iter().map(|bone| of(&bone.name)).collect()
}

/// The puppet on its way from rest through `size` of a bend of all its joints.
fn puppet_pose(skeleton: &Skeleton, size: f32) -> Pose {
    let mut pose = skeleton.rest_pose();
    for (number, name) in DRIVEN.into_iter().enumerate() {
        let bone = skeleton.find(name).unwrap();
        let axis = Vec3::new((number as f32).sin(), (3.0 * number as f32).cos(), 0.5).normalize();
        pose.parent_from_bone[bone].rotation *= Quat::from_axis_angle(axis, 0.8 * size);
    }
    pose
}

fn frames(skeleton: &Skeleton, pose: &Pose) -> Vec<Affine3A> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames
}

fn turn(frame: &Affine3A) -> Quat {
    frame.to_scale_rotation_translation().1
}

#[test]
fn who_does_what_in_a_human_of_eight_joints() {
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap();
    let mut pose = HUMAN.skeleton.rest_pose();
    ik.complete(PoseMoment::default(), &status(&HUMAN.skeleton), &mut pose);
    let role = |name: &str| ik.roles()[HUMAN.skeleton.find(name).unwrap()];
    assert_eq!(role("Hips"), BoneRole::Held);
    for name in ["Spine", "Chest", "Neck", "LeftShoulder", "RightShoulder"] {
        assert_eq!(role(name), BoneRole::Solved, "{name}");
    }
    for name in ["LeftHand", "RightIndexProximal", "LeftLowerLeg", "RightToes"] {
        assert_eq!(role(name), BoneRole::Follows, "{name}");
    }
    assert!(DRIVEN.iter().all(|name| role(name) == BoneRole::Driven));
    let rest = frames(&HUMAN.skeleton, &HUMAN.skeleton.rest_pose());
    for (is, was) in frames(&HUMAN.skeleton, &pose).iter().zip(rest) {
        assert!(is.abs_diff_eq(was, 2e-3), "at rest nothing may move: {is} {was}");
    }
}

/// Lying down at twice its size when it was bound: it moves as the one that was bound in its rest pose.
#[test]
fn a_part_that_was_bound_in_another_pose_is_solved_in_its_rest_pose() {
    let lying = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    let bound = Affine3A::from_scale_rotation_translation(Vec3::splat(2.0), lying, Vec3::new(3.0, 0.5, 1.0));
    let mut elsewhere = HUMAN.clone();
    let surface = Arc::make_mut(&mut elsewhere.surface);
    for vertex in &mut surface.mesh.vertices {
        *vertex = bound.transform_point3(Vec3::from(vertex.map(|c| c as f32))).as_dvec3().to_array();
    }
    surface.normals.iter_mut().for_each(|normal| *normal = (lying * Vec3::from(*normal)).to_array());
    surface.parts[0].skin = Some(0);
    let frames_then = HUMAN.skeleton.rest_model_from_bone().into_iter().map(|frame| bound * frame).collect();
    elsewhere.skins = vec![Skin { name: "lying".into(), bound_model_from_bone: frames_then }];
    elsewhere.check_parts().unwrap();
    let near = |a: [f32; 3], b: [f32; 3]| Vec3::from(a).distance(Vec3::from(b)) < 1e-4;
    let rest = elsewhere.positions_in_rest_pose().unwrap();
    assert!(rest.iter().zip(HUMAN.rest_positions()).all(|(a, b)| near(*a, b)), "at rest it stands");

    let solved = |character: &Character| {
        let mut ik = InverseKinematics::new(character, &pins(&["LeftFoot", "RightFoot"])).unwrap();
        let mut pose = puppet_pose(&HUMAN.skeleton, 0.4);
        ik.complete(PoseMoment::default(), &status(&HUMAN.skeleton), &mut pose);
        pose
    };
    let (expected, got) = (solved(&HUMAN), solved(&elsewhere));
    for (a, b) in expected.parent_from_bone.iter().zip(&got.parent_from_bone) {
        assert!(a.rotation.angle_between(b.rotation) < 5e-3, "{a:?} {b:?}");
    }
}

#[test]
fn driven_bones_turn_exactly_and_bones_keep_their_lengths() {
    for pinned in [&[][..], &["LeftFoot", "RightFoot"], &["LeftHand"]] {
        let skeleton = &HUMAN.skeleton;
        let mut ik = InverseKinematics::new(&HUMAN, &pins(pinned)).unwrap();
        let status = status(skeleton);
        let rest = frames(skeleton, &skeleton.rest_pose());
        for step in 0..40 {
            let plain = puppet_pose(skeleton, 0.025 * step as f32);
            let mut pose = plain.clone();
            ik.complete(PoseMoment::default(), &status, &mut pose);
            let (is, was) = (frames(skeleton, &pose), frames(skeleton, &plain));
            for name in DRIVEN {
                let bone = skeleton.find(name).unwrap();
                assert!(turn(&is[bone]).dot(turn(&was[bone])).abs() > 1.0 - 1e-6, "{pinned:?} {name}");
            }
            for (index, (local, bone)) in pose.parent_from_bone.iter().zip(skeleton.bones()).enumerate() {
                assert!(local.is_finite() && local.rotation.is_normalized());
                assert!(index == 0 || local.translation == bone.rest.translation);
            }
            for name in pinned {
                let bone = skeleton.find(name).unwrap();
                let slid = is[bone].translation.distance(rest[bone].translation);
                assert!((slid - ik.worst_pin()).abs() < 1e-2 && slid < 0.02, "{name} slid by {slid} in step {step}");
            }
        }
    }
}

#[test]
fn a_bone_that_prefers_its_rest_turns_less() {
    let skeleton = &HUMAN.skeleton;
    let neck = skeleton.find("Neck").unwrap();
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap();
    let mut angle = |comfort: Option<Comfort>| {
        ik.prefer(neck, comfort).unwrap();
        ik.restart();
        let mut pose = puppet_pose(skeleton, 1.0);
        ik.complete(PoseMoment::default(), &status(skeleton), &mut pose);
        pose.parent_from_bone[neck].rotation.angle_between(skeleton.bones()[neck].rest.rotation)
    };
    let free = angle(None);
    let stiff = angle(Some(Comfort { stiffness: 1.0, limit: None }));
    let limited = angle(Some(Comfort { stiffness: 0.0, limit: Some((0.05, [-0.05, 0.05])) }));
    let again = angle(None);
    assert!(free > 0.15 && stiff < 0.5 * free && limited < 0.12, "{free} {stiff} {limited}");
    assert!((again - free).abs() < 1e-3, "{free} {again}");
    assert!(ik.prefer(neck, Some(Comfort { stiffness: -1.0, limit: None })).is_err());
    assert!(ik.prefer(neck, Some(Comfort { stiffness: 0.0, limit: Some((f64::NAN, [0.0; 2])) })).is_err());
    assert!(ik.prefer(skeleton.len(), None).is_err());
}

#[test]
fn a_restart_forgets_and_a_frame_allocates_nothing() {
    let skeleton = &HUMAN.skeleton;
    let status = status(skeleton);
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&["LeftFoot", "RightFoot"])).unwrap();
    let mut pose = skeleton.rest_pose();
    let mut run = |ik: &mut InverseKinematics| -> Vec<Pose> {
        let poses = (0..30).map(|step| {
            pose = puppet_pose(skeleton, 0.03 * step as f32);
            let before = ALLOCATIONS.with(Cell::get);
            ik.complete(PoseMoment::default(), &status, &mut pose);
            let made = ALLOCATIONS.with(Cell::get) - before;
            assert!(made == 0 || step == 0, "{made} allocations in step {step}");
            pose.clone()
        });
        poses.collect()
    };
    let first = run(&mut ik);
    ik.restart();
    let second = run(&mut ik);
    assert_eq!(first, second);
    let mut fresh = InverseKinematics::new(&HUMAN, &pins(&["LeftFoot", "RightFoot"])).unwrap();
    assert_eq!(first, run(&mut fresh));
}

#[test]
fn unknown_pins_are_named() {
    let wrong = InverseKinematics::new(&HUMAN, &pins(&["leftfoot"])).unwrap_err();
    assert_eq!(wrong, IkError::UnknownBone { name: "leftfoot".into(), nearest: Some("LeftFoot".into()) });
    assert!(wrong.to_string().contains("did you mean \"LeftFoot\"?"));
}

#[test]
fn preparing_can_be_cancelled() {
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap();
    let driven: Vec<bool> = HUMAN.skeleton.bones().iter().map(|b| DRIVEN.contains(&b.name.as_str())).collect();
    assert!(ik.drive(&driven, &mut |_, _| ControlFlow::Break(())).is_err());
    assert!(!ik.is_needed() && ik.problem().is_some());
    let mut pose = puppet_pose(&HUMAN.skeleton, 1.0);
    ik.complete(PoseMoment::default(), &status(&HUMAN.skeleton), &mut pose);
    assert_eq!(pose, puppet_pose(&HUMAN.skeleton, 1.0), "an unsolved pose stays as the joints made it");
}

#[test]
fn a_pose_that_is_no_number_spoils_no_later_one() {
    let skeleton = &HUMAN.skeleton;
    let status = status(skeleton);
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&["LeftFoot", "RightFoot", "Hips:upright"])).unwrap();
    let good = puppet_pose(skeleton, 0.5);
    for broken in [f32::NAN, f32::INFINITY, 1e30] {
        let mut pose = good.clone();
        let arm = skeleton.find("LeftUpperArm").unwrap();
        pose.parent_from_bone[arm].rotation = Quat::from_xyzw(broken, 0.0, 0.0, 1.0);
        ik.complete(PoseMoment::default(), &status, &mut pose);
        let mut pose = good.clone();
        ik.complete(PoseMoment::default(), &status, &mut pose);
        assert!(pose.parent_from_bone.iter().all(|t| t.is_finite() && t.rotation.is_normalized()), "after {broken}");
    }
}

/// The pose of the human by these settings, and what it costs.
fn posed_by(settings: IkSettings) -> (Pose, RefitCost) {
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap().with_settings(settings);
    let mut pose = puppet_pose(&HUMAN.skeleton, 1.0);
    ik.complete(PoseMoment::default(), &status(&HUMAN.skeleton), &mut pose);
    assert_eq!(ik.problem(), None);
    let cost = ik.refit_cost(&pose).unwrap();
    (pose, cost)
}

#[test]
fn rigid_bones_cost_energy_and_loose_ones_little() {
    let (rigid, of_rigid) = posed_by(IkSettings::default());
    let (loose, of_loose) = posed_by(IkSettings { bones: IkBones::Loose, ..IkSettings::default() });
    println!("{of_rigid:?} {of_loose:?}");
    assert!((of_rigid.minimiser / of_loose.minimiser - 1.0).abs() < 1e-6, "the same minimiser");
    assert!(of_rigid.posed >= of_rigid.minimiser * 0.999 && of_loose.posed >= of_loose.minimiser * 0.999);
    assert!(of_loose.posed < of_rigid.posed, "{of_rigid:?} {of_loose:?}");
    let lengths = |pose: &Pose| {
        let rest = HUMAN.skeleton.rest_pose();
        let bones = pose.parent_from_bone.iter().zip(&rest.parent_from_bone).skip(1);
        bones.map(|(now, rest)| (now.translation.length() - rest.translation.length()).abs()).fold(0.0_f32, f32::max)
    };
    assert_eq!(lengths(&rigid).to_bits(), 0);
    assert!(lengths(&loose) > 1e-4 && lengths(&loose) < 0.2, "{}", lengths(&loose));
    assert!(loose.parent_from_bone.iter().all(|t| t.scale.min_element() > 0.3 && t.scale.max_element() < 3.0));
    let driven = frames(&HUMAN.skeleton, &rigid);
    for (name, frame) in DRIVEN.iter().map(|name| (name, HUMAN.skeleton.find(name).unwrap())) {
        let is = frames(&HUMAN.skeleton, &loose)[frame];
        let [is, was] = [turn(&is), turn(&driven[frame])].map(|turn| Mat3::from_quat(turn));
        assert!(is.abs_diff_eq(was, 1e-4), "{name} is turned as its joint turns it: {is} {was}");
    }
}

#[test]
fn the_volume_inside_resists_as_well() {
    let volume = IkSettings { energy: IkEnergy::Volume, ..IkSettings::default() };
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap().with_settings(volume.clone());
    let mut pose = HUMAN.skeleton.rest_pose();
    ik.complete(PoseMoment::default(), &status(&HUMAN.skeleton), &mut pose);
    let rest = frames(&HUMAN.skeleton, &HUMAN.skeleton.rest_pose());
    for (is, was) in frames(&HUMAN.skeleton, &pose).iter().zip(rest) {
        assert!(is.abs_diff_eq(was, 2e-3), "at rest nothing may move: {is} {was}");
    }
    let (by_volume, cost) = posed_by(volume.clone());
    let (by_surface, _) = posed_by(IkSettings::default());
    assert!(cost.minimiser > 0.0 && cost.posed < 3.0 * cost.minimiser, "{cost:?}");
    let spine = HUMAN.skeleton.find("Spine").unwrap();
    let [a, b] = [&by_volume, &by_surface].map(|pose| pose.parent_from_bone[spine].rotation);
    assert!(a.angle_between(b) > 1e-3 && a.angle_between(b) < 0.6, "{}", a.angle_between(b));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| posed_by(volume).0), by_volume, "the same bits on one thread");
}

#[test]
fn preparing_the_volume_can_be_cancelled() {
    let settings = IkSettings { energy: IkEnergy::Volume, ..IkSettings::default() };
    let mut ik = InverseKinematics::new(&HUMAN, &pins(&[])).unwrap().with_settings(settings);
    let driven: Vec<bool> = status(&HUMAN.skeleton).iter().map(|s| s.quality == BoneQuality::Live).collect();
    let (mut calls, mut last) = (0, 0.0);
    let cancelled = ik.drive(&driven, &mut |_, done| {
        assert!(done >= last && done <= 1.0, "{last} {done}");
        (calls, last) = (calls + 1, done);
        if calls == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(cancelled.is_err() && calls == 5, "{cancelled:?}");
    let mut last = 0.0;
    ik.drive(&driven, &mut |stage, done| {
        assert!(done >= last - 1e-9, "{stage}: {last} {done}");
        last = done;
        ControlFlow::Continue(())
    })
    .unwrap();
}
