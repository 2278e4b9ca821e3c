//! The foot on the floor stays, the roots move.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_rig::{Bone, Ground, GroundContact, GroundError, GroundMode, Pose, Skeleton, Transform};
use glam::{Affine3A, Quat, Vec3};

/// Joints turn all bones.
const DRIVEN: [bool; 7] = [true; 7];
const SAMPLE_MICROS: u64 = 5_000;
/// Of thigh and shin together.
const LEG: f32 = 0.9;
/// The furthest that an ankle is before or behind its hip, and how far below it while it is on the floor.
const STRIDE: f32 = 0.3;
const HIPS: f32 = 0.83;
/// The part of the time that a foot is on the floor.
const ON_FLOOR: f32 = 0.55;

/// Hips with two legs that stand on feet of 0.2, 1.1 high.
fn legs() -> Skeleton {
    let bone = |name: String, parent, at: [f32; 3], tail: [f32; 3]| Bone {
        name,
        parent,
        rest: Transform { translation: at.into(), ..Transform::IDENTITY },
        tail: tail.into(),
    };
    let mut bones = vec![bone("hips".into(), None, [0.0, 1.0, 0.0], [0.0, 0.1, 0.0])];
    for (side, x) in [("left", 0.1), ("right", -0.1)] {
        let (hips, down) = (bones.len(), [0.0, -0.5 * LEG, 0.0]);
        bones.push(bone(format!("{side} thigh"), Some(0), [x, 0.0, 0.0], down));
        bones.push(bone(format!("{side} shin"), Some(hips), down, down));
        bones.push(bone(format!("{side} foot"), Some(hips + 1), down, [0.0, -0.1, 0.15]));
    }
    Skeleton::new(bones).unwrap()
}

fn ground(mode: GroundMode) -> (Skeleton, GroundContact) {
    let skeleton = legs();
    let feet = Ground::feet(&skeleton);
    assert_eq!(feet, [3, 6], "the feet are recognised by their names");
    let ground = Ground::of_skeleton(&skeleton, mode, &feet).unwrap();
    assert!(ground.floor.abs() < 1e-3, "{}", ground.floor);
    let contact = GroundContact::new(&skeleton, ground).unwrap();
    (skeleton, contact)
}

/// Where an ankle is below its hip, forward and down, at a share of a step: on the floor it moves back evenly for more than
/// half of the time, in the air it swings forward.
fn ankle(at: f32) -> (f32, f32) {
    let at = at.rem_euclid(1.0);
    if at < ON_FLOOR {
        return (STRIDE * (1.0 - 2.0 * at / ON_FLOOR), HIPS);
    }
    let swing = (at - ON_FLOOR) / (1.0 - ON_FLOOR);
    let lift = (std::f32::consts::PI * swing).sin().powi(2);
    (-STRIDE * (std::f32::consts::PI * swing).cos(), HIPS - 0.1 * lift)
}

/// Both legs at a share of a step, feet level; as a puppet says it, with still hips.
fn walking(skeleton: &Skeleton, at: f32) -> Pose {
    let mut pose = skeleton.rest_pose();
    for (leg, (forward, down)) in [(1, ankle(at)), (4, ankle(at + 0.5))] {
        let bend = 2.0 * (forward.hypot(down) / LEG).acos();
        let thigh = forward.atan2(down) + 0.5 * bend;
        pose.parent_from_bone[leg].rotation = Quat::from_rotation_x(-thigh);
        pose.parent_from_bone[leg + 1].rotation = Quat::from_rotation_x(bend);
        pose.parent_from_bone[leg + 2].rotation = Quat::from_rotation_x(thigh - bend);
    }
    pose
}

/// All points of a pose that was moved.
fn places(skeleton: &Skeleton, contact: &GroundContact, pose: &Pose) -> Vec<Vec3> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    contact.ground().points.iter().map(|point| frames[point.bone].transform_point3(point.at)).collect()
}

#[test]
fn a_walk_leads_as_far_as_its_steps_and_the_foot_on_the_floor_stays() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    let (cycles, samples_a_cycle) = (4_u16, 200_u16);
    let mut held: Option<(usize, Vec3)> = None;
    let (mut changes, mut slide, mut longest, mut lowest) = (0, 0.0_f32, 0.0_f32, 0.0_f32);
    let mut before: Option<Vec3> = None;
    for sample in 0..cycles * samples_a_cycle {
        let mut pose = walking(&skeleton, f32::from(sample) / f32::from(samples_a_cycle));
        contact.follow(SAMPLE_MICROS * u64::from(sample), &skeleton, &DRIVEN, &mut pose);
        let places = places(&skeleton, &contact, &pose);
        let point = contact.standing().next().expect("a foot carries");
        let bone = contact.ground().points[point].bone;
        held = match held {
            Some((same, place)) if same == point => {
                slide = slide.max((places[point] - place).with_y(0.0).length());
                held
            }
            _ => {
                changes += u32::from(held.is_none_or(|(last, _)| contact.ground().points[last].bone != bone));
                Some((point, places[point]))
            }
        };
        let low = places.iter().fold(f32::INFINITY, |low, place| low.min(place.y));
        lowest = lowest.max((low - contact.ground().floor).abs());
        let root = pose.parent_from_bone[0].translation;
        longest = before.map_or(0.0, |before| longest.max((root - before).length()));
        before = Some(root);
    }
    let travel = contact.offset().z;
    let a_cycle = 2.0 * STRIDE / ON_FLOOR;
    let expected = f32::from(cycles) * a_cycle;
    println!("{travel} of {expected}, {changes} changes of foot, slide {slide}, longest step of the root {longest}");
    assert!((travel / expected - 1.0).abs() < 0.045, "{travel} of {expected}");
    let steps = 2 * u32::from(cycles);
    assert!((steps..=steps + 1).contains(&changes), "{changes} changes of foot");
    assert!(slide < 1e-5 && lowest < 1e-5, "the foot slides by {slide}, the lowest point is off the floor by {lowest}");
    // Nothing jumps where the feet change.
    let evenly = a_cycle / f32::from(samples_a_cycle);
    assert!(longest < 1.5 * evenly, "{longest} in a sample of a walk of {evenly} a sample");
}

#[test]
fn standing_comes_back_to_its_spot() {
    let (skeleton, mut contact) = ground(GroundMode::Stand);
    for sample in 0..1600_u64 {
        // Steps, then both feet on the floor, one before the other.
        contact.follow(
            SAMPLE_MICROS * sample,
            &skeleton,
            &DRIVEN,
            &mut walking(&skeleton, sample.min(205) as f32 / 200.0),
        );
        assert!(contact.offset().with_y(0.0).length() < 1.5, "{}", contact.offset());
        if sample > 1500 {
            assert!(contact.offset().with_y(0.0).length() < 0.03, "{}", contact.offset());
        }
    }
}

#[test]
fn the_same_again_after_a_restart_to_the_last_bit() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    let mut run = || {
        contact.restart();
        let poses = (0..300_u64).map(|sample| {
            let mut pose = walking(&skeleton, sample as f32 * 0.007);
            contact.follow(SAMPLE_MICROS * sample, &skeleton, &DRIVEN, &mut pose);
            pose
        });
        poses.collect::<Vec<Pose>>()
    };
    assert_eq!(run(), run());
}

#[test]
fn nonsense_moves_nothing_and_is_named() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    contact.follow(0, &skeleton, &DRIVEN, &mut walking(&skeleton, 0.03));
    let before = contact.offset();
    let mut broken = walking(&skeleton, 0.04);
    broken.parent_from_bone[2].rotation.x = f32::NAN;
    contact.follow(u64::MAX, &skeleton, &DRIVEN, &mut broken);
    assert_eq!(contact.offset(), before);
    // A clock that goes back, and one that leaps.
    for micros in [5, u64::MAX, 0] {
        let mut pose = walking(&skeleton, 0.04);
        contact.follow(micros, &skeleton, &DRIVEN, &mut pose);
        assert!(pose.parent_from_bone.iter().all(Transform::is_finite));
    }
    let of = |contacts: &[usize]| Ground::of_skeleton(&skeleton, GroundMode::Walk, contacts);
    assert_eq!(of(&[]), Err(GroundError::NoContacts));
    assert_eq!(of(&[99]), Err(GroundError::NoBone { bone: 99, count: 7 }));
    let none = Ground::of_points(&skeleton, GroundMode::Walk, &[3], &[(0, Vec3::ZERO)]);
    assert_eq!(none, Err(GroundError::NoPlace { name: "left foot".into() }));
    let nan = Ground { floor: f32::NAN, ..of(&[3]).unwrap() };
    assert!(GroundContact::new(&skeleton, nan).is_err());
}

/// Where both ends of the feet are, and the knees' bend, radians.
fn feet(skeleton: &Skeleton, pose: &Pose) -> ([Vec3; 4], [f32; 2]) {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    let ends = [3, 6].map(|foot| [Vec3::ZERO, skeleton.bones()[foot].tail].map(|at| frames[foot].transform_point3(at)));
    let bends = [2, 5].map(|shin| {
        let (axis, angle) = pose.parent_from_bone[shin].rotation.to_axis_angle();
        angle * axis.x.signum()
    });
    ([ends[0][0], ends[0][1], ends[1][0], ends[1][1]], bends)
}

#[test]
fn legs_without_joints_bend_under_hips_that_a_joint_turns() {
    for mode in [GroundMode::Stand, GroundMode::Walk] {
        let (skeleton, mut contact) = ground(mode);
        let driven = [true, false, false, false, false, false, false];
        let rest = feet(&skeleton, &skeleton.rest_pose()).0;
        let (mut before, mut quickest, mut lowest) = (None, 0.0_f32, f32::INFINITY);
        for sample in 0..800_u64 {
            let at = sample as f32 * 0.01;
            let mut pose = skeleton.rest_pose();
            let turn = Quat::from_rotation_y(0.5 * (0.7 * at).sin()) * Quat::from_rotation_z(0.25 * at.sin());
            pose.parent_from_bone[0].rotation = turn * Quat::from_rotation_x(0.3 * (1.3 * at).sin());
            let given = pose.parent_from_bone[0].rotation;
            contact.follow(SAMPLE_MICROS * sample, &skeleton, &driven, &mut pose);
            assert_eq!(pose.parent_from_bone[0].rotation, given, "the joint is obeyed");
            let (ends, bends) = feet(&skeleton, &pose);
            for (end, rest) in ends.iter().zip(rest) {
                assert!(end.distance(rest) < 6e-4, "{sample}: a foot is {} away", end.distance(rest));
            }
            assert!(bends.iter().all(|bend| *bend > -0.01), "{sample}: {bends:?}");
            assert_eq!(contact.standing().count(), 2);
            if let Some(before) = before.replace(bends) {
                let quick = [0, 1].map(|knee: usize| (bends[knee] - before[knee]).abs());
                quickest = quickest.max(quick[0]).max(quick[1]);
            }
            lowest = lowest.min(pose.parent_from_bone[0].translation.y);
        }
        println!("{mode:?}: a knee bends by {quickest} in a sample at most, the hips sink to {lowest}");
        assert!(quickest < 0.1 && (0.85..0.999).contains(&lowest));
    }
}

#[test]
fn a_standing_foot_faces_where_it_did_while_the_hips_turn() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    let mut first = None;
    for sample in 0..400_u64 {
        let at = sample as f32 * 0.01;
        let mut pose = walking(&skeleton, 0.3);
        // The right foot is up.
        pose.parent_from_bone[4].rotation = Quat::from_rotation_x(-0.6);
        pose.parent_from_bone[0].rotation = Quat::from_rotation_y(0.6 * at.sin());
        contact.follow(SAMPLE_MICROS * sample, &skeleton, &DRIVEN, &mut pose);
        let ends = feet(&skeleton, &pose).0;
        let there = *first.get_or_insert(ends);
        let slid = ends[0].distance(there[0]).max(ends[1].distance(there[1]));
        assert!(slid < 1e-4, "{sample}: the foot that carries turns or slides by {slid}");
    }
}

#[test]
fn roots_that_something_else_places_are_only_raised() {
    let (skeleton, contact) = ground(GroundMode::Walk);
    let held = Ground { is_held: true, ..contact.ground().clone() };
    let mut contact = GroundContact::new(&skeleton, held).unwrap();
    for (sample, (moved, expected)) in [(0.3, 0.3), (0.0, 0.0), (-0.2, 0.0)].into_iter().enumerate() {
        let mut pose = skeleton.rest_pose();
        pose.parent_from_bone[0].translation += Vec3::new(0.4, moved, -0.1);
        contact.follow(SAMPLE_MICROS * sample as u64, &skeleton, &DRIVEN, &mut pose);
        let root = pose.parent_from_bone[0].translation;
        assert!(root.distance(Vec3::new(0.4, 1.0 + expected, -0.1)) < 1e-5, "{moved}: {root}");
    }
    assert_eq!(contact.standing().count(), 0);
}

#[test]
fn a_floor_above_the_hips_is_doubted_and_finite() {
    let skeleton = legs();
    assert_eq!(Ground::of_skeleton(&skeleton, GroundMode::Walk, &[3, 6]).unwrap().doubt(&skeleton), None);
    let upside_down = Ground { floor: 3.0, ..Ground::of_skeleton(&skeleton, GroundMode::Walk, &[3]).unwrap() };
    assert!(upside_down.doubt(&skeleton).unwrap().contains("left foot"));
    let mut contact = GroundContact::new(&skeleton, upside_down).unwrap();
    let mut before: Option<Vec3> = None;
    for sample in 0..100_u64 {
        let mut pose = walking(&skeleton, sample as f32 * 0.005);
        contact.follow(SAMPLE_MICROS * sample, &skeleton, &DRIVEN, &mut pose);
        let root = pose.parent_from_bone[0].translation;
        assert!(root.is_finite() && before.is_none_or(|before| before.distance(root) < 0.05), "{root}");
        before = Some(root);
    }
    // No feet at all: nothing to stand on, and said so.
    assert!(Ground::of_skeleton(&skeleton, GroundMode::Walk, &[]).is_err());
}

#[test]
fn feet_are_let_go_and_put_down_without_a_jump_when_joints_come_and_go() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    let mut before: Option<[Vec3; 4]> = None;
    for sample in 0..600_u64 {
        let mut pose = skeleton.rest_pose();
        pose.parent_from_bone[0].rotation = Quat::from_rotation_z(0.15 * (sample as f32 * 0.02).sin());
        let mut driven = DRIVEN;
        if !(200..400).contains(&sample) {
            driven[1..].fill(false);
        }
        contact.follow(SAMPLE_MICROS * sample, &skeleton, &driven, &mut pose);
        let ends = feet(&skeleton, &pose).0;
        if let Some(before) = before.replace(ends) {
            let moved = ends.iter().zip(before).map(|(a, b)| a.distance(b)).fold(0.0, f32::max);
            assert!(moved < 0.015, "{sample}: a foot jumps by {moved}");
        }
    }
}
