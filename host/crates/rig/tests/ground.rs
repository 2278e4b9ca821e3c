//! The foot on the floor stays, the roots move.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_rig::{Bone, Ground, GroundContact, GroundError, GroundMode, Pose, Skeleton, Transform};
use glam::{Affine3A, Quat, Vec3};

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
        contact.follow(SAMPLE_MICROS * u64::from(sample), &skeleton, &mut pose);
        let places = places(&skeleton, &contact, &pose);
        let (bone, point) = contact.anchor().expect("a foot carries");
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
        contact.follow(SAMPLE_MICROS * sample, &skeleton, &mut walking(&skeleton, sample.min(205) as f32 / 200.0));
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
            contact.follow(SAMPLE_MICROS * sample, &skeleton, &mut pose);
            pose
        });
        poses.collect::<Vec<Pose>>()
    };
    assert_eq!(run(), run());
}

#[test]
fn nonsense_moves_nothing_and_is_named() {
    let (skeleton, mut contact) = ground(GroundMode::Walk);
    contact.follow(0, &skeleton, &mut walking(&skeleton, 0.03));
    let before = contact.offset();
    let mut broken = walking(&skeleton, 0.04);
    broken.parent_from_bone[2].rotation.x = f32::NAN;
    contact.follow(u64::MAX, &skeleton, &mut broken);
    assert_eq!(contact.offset(), before);
    // A clock that goes back, and one that leaps.
    for micros in [5, u64::MAX, 0] {
        let mut pose = walking(&skeleton, 0.04);
        contact.follow(micros, &skeleton, &mut pose);
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
