//! Bones that swing: against the pendulum, whatever the rate, and on awkward clocks.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use armature_rig::dynamics::{LONGEST_GAP_MICROS, STEP_MICROS};
use armature_rig::{
    Dynamics, DynamicsError, Pose, Skeleton, SpringBone, SpringBones, SpringChain, SpringCollider, Transform,
};
use common::skeleton;
use glam::{Affine3A, Quat, Vec3};

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

/// A root, and three bones of 0.1 behind it.
fn tail() -> Skeleton {
    skeleton(&[
        ("hips", "", [0.0, 1.0, 0.0]),
        ("tail1", "hips", [0.0, 1.0, -0.1]),
        ("tail2", "tail1", [0.0, 1.0, -0.2]),
        ("tail3", "tail2", [0.0, 1.0, -0.3]),
        ("end", "tail3", [0.0, 1.0, -0.4]),
    ])
}

fn spring(bone: usize) -> SpringBone {
    SpringBone {
        bone,
        tail: Vec3::new(0.0, 0.0, -0.1),
        stiffness: 1.0,
        drag: 0.4,
        gravity: 0.0,
        gravity_direction: Vec3::NEG_Y,
        radius: 0.0,
    }
}

fn of(bones: Vec<SpringBone>) -> Dynamics {
    Dynamics { chains: vec![SpringChain { bones, colliders: Vec::new() }], wind: Vec3::ZERO }
}

fn all() -> Dynamics {
    of((1..=3).map(spring).collect())
}

/// The hips turned and moved at a time, seconds.
fn moved(skeleton: &Skeleton, seconds: f64) -> Pose {
    let mut pose = skeleton.rest_pose();
    let swing = libm::sin(seconds * 7.0);
    pose.parent_from_bone[0].rotation = Quat::from_rotation_y(0.8 * swing as f32);
    pose.parent_from_bone[0].translation.x += 0.2 * libm::sin(seconds * 3.0) as f32;
    pose
}

fn frames(skeleton: &Skeleton, pose: &Pose) -> Vec<Affine3A> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames
}

fn free(_: usize) -> bool {
    false
}

fn largest_step(a: &Pose, b: &Pose) -> f32 {
    let turn = |(a, b): (&Transform, &Transform)| a.rotation.angle_between(b.rotation);
    a.parent_from_bone.iter().zip(&b.parent_from_bone).map(turn).fold(0.0, f32::max)
}

/// Where the tail ends at the end of two seconds, for samples this far apart.
fn end_after(skeleton: &Skeleton, dynamics: Dynamics, step_micros: impl Fn(u64) -> u64) -> Vec<Vec3> {
    let mut springs = SpringBones::new(skeleton, dynamics).unwrap();
    let (mut micros, mut sample) = (0, 0);
    let mut ends = Vec::new();
    let mut next = 200_000;
    while micros <= 2_000_000 {
        let mut pose = moved(skeleton, micros as f64 * 1e-6);
        springs.follow(5_000_000 + micros, skeleton, &mut pose, &free);
        if micros >= next {
            assert_eq!(micros, next, "the rates of the test meet here");
            ends.push(Vec3::from(frames(skeleton, &pose)[4].translation));
            next += 200_000;
        }
        micros = (micros + step_micros(sample)).min(next);
        sample += 1;
    }
    ends
}

#[test]
fn a_small_swing_has_the_frequency_of_the_pendulum() {
    let skeleton =
        skeleton(&[("root", "", [0.0, 1.0, 0.0]), ("rod", "root", [0.0, 1.0, 0.0]), ("end", "rod", [0.0, 0.5, 0.0])]);
    let rod =
        SpringBone { tail: Vec3::new(0.0, -0.5, 0.0), stiffness: 0.0, drag: 0.0, gravity: 9.81 / 60.0, ..spring(1) };
    let mut springs = SpringBones::new(&skeleton, of(vec![rod])).unwrap();
    // It begins beside the vertical and is let go.
    let angle_at = |springs: &mut SpringBones, micros: u64, held: f32| {
        let mut pose = skeleton.rest_pose();
        pose.parent_from_bone[1].rotation = Quat::from_rotation_x(held);
        springs.follow(micros, &skeleton, &mut pose, &free);
        let end = frames(&skeleton, &pose)[2].translation - frames(&skeleton, &pose)[1].translation;
        assert!((end.length() - 0.5).abs() < 1e-5, "a rod keeps its length");
        f64::from(end.z)
    };
    let mut before = angle_at(&mut springs, 0, 0.05);
    let amplitude = before.abs();
    let mut crossings = Vec::new();
    for step in 1..=2500_u64 {
        let now = angle_at(&mut springs, step * STEP_MICROS, 0.05);
        if before.signum() != now.signum() {
            crossings.push((step as f64 - now / (now - before)) * STEP_MICROS as f64 * 1e-6);
        }
        before = now;
    }
    let half = (crossings.last().unwrap() - crossings[0]) / (crossings.len() - 1) as f64;
    let expected = std::f64::consts::PI * (0.5_f64 / 9.81).sqrt();
    assert!((half / expected - 1.0).abs() < 2e-3, "{half} s, and a pendulum takes {expected} s");
    let swings = (2500..2800_u64).map(|step| (step, angle_at(&mut springs, step * STEP_MICROS, 0.05).abs()));
    let (step, late) = swings.fold((0, 0.0), |most, now| if now.1 > most.1 { now } else { most });
    // The rod's pull takes a little speed in every step, where nothing else does: g h / 2 l of the amplitude a second.
    let seconds = step as f64 * STEP_MICROS as f64 * 1e-6;
    let left = libm::exp(-9.81 * STEP_MICROS as f64 * 1e-6 / (2.0 * 0.5) * seconds);
    assert!((late / amplitude / left - 1.0).abs() < 0.02, "without drag it goes on: {late} of {amplitude}, not {left}");
}

#[test]
fn hanging_bones_come_to_rest_where_stiffness_and_gravity_balance() {
    let skeleton = tail();
    let heavy = SpringBone { gravity: 0.5, ..spring(1) };
    let mut springs = SpringBones::new(&skeleton, of(vec![heavy])).unwrap();
    let mut pose = skeleton.rest_pose();
    for step in 0..1000_u64 {
        pose = skeleton.rest_pose();
        springs.follow(step * 5_000, &skeleton, &mut pose, &free);
    }
    // Drawn back along -z by 1 and down by a half.
    let down = pose.parent_from_bone[1].rotation * Vec3::NEG_Z;
    assert!(down.distance(Vec3::new(0.0, -0.5, -1.0).normalize()) < 1e-4, "{down}");
    // In the wind it leans along, and no further than the wind blows.
    let wind = Dynamics { wind: Vec3::new(1.0, 0.0, 0.0), ..of(vec![spring(1)]) };
    let mut springs = SpringBones::new(&skeleton, wind).unwrap();
    for step in 0..1000_u64 {
        pose = skeleton.rest_pose();
        springs.follow(step * 5_000, &skeleton, &mut pose, &free);
    }
    let leans = pose.parent_from_bone[1].rotation * Vec3::NEG_Z;
    // In a step the air takes back a share of its way: the pull that holds against it is that over the step.
    let taken = 1.0 - libm::pow(0.6, 60.0 * STEP_MICROS as f64 * 1e-6);
    let pull = taken * STEP_MICROS as f64 * 1e-6 / (60.0 * (STEP_MICROS as f64 * 1e-6).powi(2));
    let expected = Vec3::new(pull as f32, 0.0, -1.0).normalize();
    assert!(leans.distance(expected) < 1e-4, "{leans} and {expected}");
}

#[test]
fn the_rate_of_samples_does_not_matter() {
    let skeleton = tail();
    let finest = end_after(&skeleton, all(), |_| 1_000);
    for (name, step) in [("500 Hz", 2_000), ("250 Hz", 4_000), ("125 Hz", 8_000), ("50 Hz", 20_000)] {
        let ends = end_after(&skeleton, all(), |_| step);
        assert_eq!(ends.len(), finest.len());
        let off = ends.iter().zip(&finest).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(off < 0.004, "{name}: off by {off} on a tail of 0.3");
    }
    let uneven = end_after(&skeleton, all(), |sample| [3_000, 11_000, 1_000, 7_000][sample as usize % 4]);
    let off = uneven.iter().zip(&finest).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(off < 0.004, "uneven: off by {off}");
    // It does swing.
    let still = end_after(&skeleton, Dynamics::default(), |_| 1_000);
    let swings = still.iter().zip(&finest).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(swings > 0.05, "{swings}");
}

#[test]
fn nothing_moves_what_is_at_rest_and_only_turns_change() {
    let skeleton = tail();
    let mut springs = SpringBones::new(&skeleton, all()).unwrap();
    for step in 0..200_u64 {
        let mut pose = skeleton.rest_pose();
        springs.follow(step * 5_000, &skeleton, &mut pose, &free);
        assert!(largest_step(&pose, &skeleton.rest_pose()) < 1e-3);
        for (own, rest) in pose.parent_from_bone.iter().zip(&skeleton.rest_pose().parent_from_bone) {
            assert_eq!((own.translation, own.scale), (rest.translation, rest.scale));
        }
    }
}

#[test]
fn awkward_clocks_and_poses_neither_jump_nor_break_anything() {
    let skeleton = tail();
    let mut springs = SpringBones::new(&skeleton, Dynamics { wind: Vec3::X, ..all() }).unwrap();
    let mut micros = 10_000_000_u64;
    let mut before = skeleton.rest_pose();
    for sample in 0..400_u64 {
        let mut pose = skeleton.rest_pose();
        micros = match sample {
            100 => micros + 3_600_000_000,
            150 => micros - 5_000_000,
            200 => 0,
            250 => micros,
            300 => u64::MAX - 1_000_000,
            301 => u64::MAX,
            302 => 5_000,
            330 => micros + LONGEST_GAP_MICROS,
            _ => micros + 5_000,
        };
        if sample == 120 {
            pose.parent_from_bone[1].rotation = Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0);
            let broken = pose.clone();
            springs.follow(micros, &skeleton, &mut pose, &free);
            assert_eq!(format!("{pose:?}"), format!("{broken:?}"), "a pose that is not finite stays as it is");
            continue;
        }
        springs.follow(micros, &skeleton, &mut pose, &free);
        assert!(pose.parent_from_bone.iter().all(Transform::is_finite), "sample {sample}");
        assert!(largest_step(&before, &pose) < 0.12, "sample {sample}: {}", largest_step(&before, &pose));
        before = pose;
    }
}

#[test]
fn a_storm_and_the_stiffest_springs_stay_finite() {
    let skeleton = tail();
    let extreme = |stiffness, drag, gravity, wind| Dynamics {
        wind,
        ..of((1..=3).map(|bone| SpringBone { stiffness, drag, gravity, ..spring(bone) }).collect())
    };
    for dynamics in [
        extreme(1e6, 0.0, 0.0, Vec3::ZERO),
        extreme(1e6, 1.0, 1e6, Vec3::splat(1e6)),
        extreme(0.0, 0.0, -1e6, Vec3::splat(-1e6)),
        extreme(0.0, 1.0, 0.0, Vec3::ZERO),
    ] {
        let mut springs = SpringBones::new(&skeleton, dynamics).unwrap();
        for step in 0..200_u64 {
            let mut pose = moved(&skeleton, step as f64 * 0.03);
            springs.follow(step * 30_000, &skeleton, &mut pose, &free);
            assert!(pose.parent_from_bone.iter().all(Transform::is_finite));
        }
    }
}

#[test]
fn tips_stay_out_of_spheres_and_capsules() {
    let skeleton = tail();
    for tail_end in [None, Some(Vec3::new(0.3, -0.12, -0.15))] {
        let mut dynamics = of((1..=3).map(|bone| SpringBone { gravity: 3.0, radius: 0.01, ..spring(bone) }).collect());
        let offset = Vec3::new(0.0, -0.12, -0.15);
        dynamics.chains[0].colliders = vec![SpringCollider { bone: 0, offset, tail: tail_end, radius: 0.08 }];
        let mut springs = SpringBones::new(&skeleton, dynamics).unwrap();
        let mut touched = false;
        for step in 0..400_u64 {
            let mut pose = skeleton.rest_pose();
            springs.follow(step * STEP_MICROS, &skeleton, &mut pose, &free);
            let frames = frames(&skeleton, &pose);
            let centre = frames[0].transform_point3(offset);
            // Of the first bone: those below it hang on where it is.
            let distance = Vec3::from(frames[2].translation).distance(centre);
            assert!(distance > 0.0899, "step {step}: {distance}");
            touched |= distance < 0.0905;
        }
        assert!(touched, "it lies on it");
    }
}

#[test]
fn a_bone_that_a_joint_drives_follows_it_and_carries_the_others() {
    let skeleton = tail();
    let mut springs = SpringBones::new(&skeleton, all()).unwrap();
    let mut swung = 0.0_f32;
    for step in 0..200_u64 {
        let mut pose = moved(&skeleton, step as f64 * 0.005);
        pose.parent_from_bone[2].rotation = Quat::from_rotation_x(libm::sin(step as f64 * 0.1) as f32);
        let driven = pose.parent_from_bone[2];
        springs.follow(step * 5_000, &skeleton, &mut pose, &|bone| bone == 2);
        assert_eq!(pose.parent_from_bone[2], driven);
        swung = swung.max(pose.parent_from_bone[3].rotation.angle_between(Quat::IDENTITY));
    }
    assert!(swung > 0.1, "{swung}");
}

#[test]
fn what_cannot_swing_is_named() {
    let skeleton = tail();
    let refused = |dynamics| SpringBones::new(&skeleton, dynamics).unwrap_err();
    assert_eq!(refused(of(vec![spring(9)])), DynamicsError::NoBone { bone: 9, bones: 5 });
    assert!(refused(of(vec![spring(1), spring(1)])).to_string().contains("\"tail1\""));
    for (bad, what) in [
        (SpringBone { stiffness: f64::NAN, ..spring(1) }, "stiffness"),
        (SpringBone { drag: 1.5, ..spring(1) }, "drag"),
        (SpringBone { tail: Vec3::ZERO, ..spring(1) }, "tail"),
        (SpringBone { gravity: f64::INFINITY, ..spring(1) }, "gravity"),
        (SpringBone { radius: -1.0, ..spring(1) }, "radius"),
    ] {
        assert!(refused(of(vec![bad])).to_string().contains(what), "{what}");
    }
    assert_eq!(refused(Dynamics { wind: Vec3::new(f32::NAN, 0.0, 0.0), ..all() }), DynamicsError::BadWind);
}

#[test]
fn following_allocates_nothing() {
    let skeleton = tail();
    let mut springs = SpringBones::new(&skeleton, all()).unwrap();
    let mut pose = moved(&skeleton, 0.3);
    let before = ALLOCATIONS.with(Cell::get);
    for step in 0..50_u64 {
        springs.follow(step * 7_000, &skeleton, &mut pose, &free);
    }
    assert_eq!(ALLOCATIONS.with(Cell::get), before);
}
