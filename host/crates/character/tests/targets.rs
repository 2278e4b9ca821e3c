//! Points of a character that are dragged while joints drive the rest of it.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::sync::LazyLock;

use armature_character::Character;
use armature_character::inverse_kinematics::{BoneRole, InverseKinematics, anatomical_limits};
use armature_character::own::{human, spider};
use armature_rig::{
    BoneQuality, BoneStatus, Pose, PoseCompletion, PoseMoment, Skeleton, Target, TargetError, TargetPoint,
};
use glam::{Affine3A, Quat, Vec3};

static HUMAN: LazyLock<Character> = LazyLock::new(|| human().unwrap());
const OVER: u32 = 200_000;
const STEP: u64 = 5_000;

/// A character whose joints drive a few bones, sample by sample.
struct Stage {
    ik: InverseKinematics,
    skeleton: Skeleton,
    driven: Vec<usize>,
    micros: u64,
    pose: Pose,
}

impl Stage {
    fn new(character: &Character, driven: &[&str], pins: &[&str], limited: bool) -> Self {
        let pins: Vec<_> = pins.iter().map(|pin| pin.parse().unwrap()).collect();
        let mut ik = InverseKinematics::new(character, &pins).unwrap();
        if limited {
            ik.limit_all(&anatomical_limits(&character.skeleton)).unwrap();
        }
        let skeleton = character.skeleton.clone();
        let driven = driven.iter().map(|name| skeleton.find(name).unwrap()).collect();
        Self { ik, pose: skeleton.rest_pose(), skeleton, driven, micros: 0 }
    }

    fn human(driven: &[&str], pins: &[&str]) -> Self {
        Self::new(&HUMAN, driven, pins, true)
    }

    /// The next sample, in which the joints bend their bones by so much. Returns the largest turn of a bone since the last,
    /// radians, and the largest way of a bone's head.
    fn step(&mut self, bend: f32) -> (f32, f32) {
        let quality = |bone: usize| if self.driven.contains(&bone) { BoneQuality::Live } else { BoneQuality::Unmapped };
        let status: Vec<_> =
            (0..self.skeleton.len()).map(|bone| BoneStatus { quality: quality(bone), held_samples: 0 }).collect();
        let before = self.frames();
        self.pose = self.skeleton.rest_pose();
        for &bone in &self.driven {
            self.pose.parent_from_bone[bone].rotation *= Quat::from_rotation_x(bend);
        }
        self.micros += STEP;
        let moment = PoseMoment { device_micros: self.micros, offset: Vec3::ZERO };
        self.ik.complete(moment, &status, &mut self.pose);
        let after = self.frames();
        assert!(after.iter().all(Affine3A::is_finite));
        let turn = |frame: &Affine3A| frame.to_scale_rotation_translation().1;
        let turned = before.iter().zip(&after).map(|(a, b)| angle(turn(a), turn(b))).fold(0.0, f32::max);
        let moved = before.iter().zip(&after).map(|(a, b)| Vec3::from(a.translation - b.translation).length());
        (turned, moved.fold(0.0, f32::max))
    }

    fn settle(&mut self, steps: usize) -> (f32, f32) {
        (0..steps).map(|_| self.step(0.2)).fold((0.0, 0.0), |worst, step| (step.0.max(worst.0), step.1.max(worst.1)))
    }

    fn frames(&self) -> Vec<Affine3A> {
        let mut frames = vec![Affine3A::IDENTITY; self.skeleton.len()];
        self.pose.forward_kinematics(&self.skeleton, &mut frames);
        frames
    }

    fn bone(&self, name: &str) -> usize {
        self.skeleton.find(name).unwrap()
    }

    fn head(&self, name: &str) -> Vec3 {
        self.frames()[self.bone(name)].translation.into()
    }

    fn tail(&self, name: &str) -> Vec3 {
        let bone = self.bone(name);
        self.frames()[bone].transform_point3(self.skeleton.bones()[bone].tail)
    }

    fn drag(&mut self, name: &str, to: Vec3) {
        let point = TargetPoint::Head(self.bone(name));
        self.ik.set_target(place(point, to, 1.0), OVER).unwrap();
    }

    fn missed(&self, name: &str) -> f32 {
        self.ik.missed().find(|missed| missed.name == name).unwrap().distance
    }

    /// Bones have the lengths that they have at rest.
    fn check_lengths(&self) {
        for (bone, local) in self.skeleton.bones().iter().zip(&self.pose.parent_from_bone) {
            assert!(bone.parent.is_none() || local.translation == bone.rest.translation, "{}", bone.name);
        }
    }
}

/// Exact for small angles too.
fn angle(a: Quat, b: Quat) -> f32 {
    2.0 * (a.inverse() * b).xyz().length().min(1.0).asin()
}

fn place(point: TargetPoint, to: Vec3, strength: f32) -> Target {
    Target { point, position: Some(to), orientation: None, strength }
}

const TORSO: [&str; 3] = ["Spine", "Chest", "Head"];

#[test]
fn a_hand_is_dragged_where_it_can_reach_and_goes_back_without_a_jump() {
    let mut stage = Stage::human(&TORSO, &[]);
    stage.settle(3);
    let rest = stage.frames();
    let to = stage.head("LeftHand") + Vec3::new(-0.25, 0.1, 0.35);
    stage.drag("LeftHand", to);
    assert_eq!(stage.ik.roles()[stage.bone("LeftLowerArm")], BoneRole::Solved);
    let (first, moved) = stage.step(0.2);
    assert!(first < 1e-3 && moved < 1e-3, "taking hold moves nothing: {first} {moved}");
    let (turned, _) = stage.settle(60);
    assert!(turned < 0.12, "no jump on the way: {turned}");
    assert!(stage.head("LeftHand").distance(to) < 1e-4, "{}", stage.head("LeftHand").distance(to));
    assert!(stage.missed("LeftHand") < 1e-4);
    stage.check_lengths();
    for name in TORSO {
        let bone = stage.bone(name);
        let rotation = |frames: &[Affine3A]| frames[bone].to_scale_rotation_translation().1;
        assert!(angle(rotation(&stage.frames()), rotation(&rest)) < 1e-3, "{name} is driven by its joint");
    }
    stage.ik.release(TargetPoint::Head(stage.bone("LeftHand")), OVER);
    let (first, moved) = stage.step(0.2);
    assert!(first < 1e-3 && moved < 1e-3, "letting go moves nothing: {first} {moved}");
    let (turned, _) = stage.settle(60);
    assert!(turned < 0.12, "{turned}");
    for (is, was) in stage.frames().iter().zip(&rest) {
        assert!(is.abs_diff_eq(*was, 1e-3), "back where the joints alone put it: {is} {was}");
    }
}

#[test]
fn tails_points_of_the_skin_and_several_targets_are_held_together() {
    let mut stage = Stage::human(&TORSO, &["LeftFoot", "RightFoot"]);
    stage.settle(3);
    let skin = HUMAN.surface.influences.clone();
    let elbow = stage.bone("RightLowerArm");
    // The vertex that follows the right forearm most.
    let vertex = (0..skin.vertex_count())
        .max_by(|&a, &b| {
            let weight = |v: usize| -> f32 {
                skin.of_vertex(v).filter(|(bone, _)| usize::from(*bone) == elbow).map(|(_, weight)| weight).sum()
            };
            weight(a).total_cmp(&weight(b))
        })
        .unwrap() as u32;
    let on_skin = TargetPoint::Skin { vertices: [vertex; 3], barycentric: [1.0, 0.0, 0.0] };
    let at = Vec3::from(HUMAN.surface.mesh.vertices[vertex as usize].map(|c| c as f32));
    let tail = TargetPoint::Tail(stage.bone("LeftHand"));
    let to = stage.tail("LeftHand") + Vec3::new(-0.15, 0.1, 0.2);
    stage.ik.set_target(place(tail, to, 1.0), OVER).unwrap();
    stage.ik.set_target(place(on_skin, at + Vec3::new(0.1, 0.05, 0.15), 1.0), OVER).unwrap();
    let (turned, _) = stage.settle(80);
    assert!(turned < 0.15, "{turned}");
    assert!(stage.tail("LeftHand").distance(to) < 1e-3, "{}", stage.tail("LeftHand").distance(to));
    // Where the posed skin itself is.
    let frames = stage.frames();
    let rest = stage.skeleton.rest_model_from_bone();
    let posed: Vec3 = skin
        .of_vertex(vertex as usize)
        .map(|(bone, weight)| {
            let bone = usize::from(bone);
            weight * (frames[bone] * rest[bone].inverse()).transform_point3(at)
        })
        .sum();
    assert!(posed.distance(at + Vec3::new(0.1, 0.05, 0.15)) < 1e-3, "{posed} {at}");
    for missed in stage.ik.missed() {
        assert!(missed.distance < 1e-3, "{missed:?}");
    }
}

#[test]
fn an_orientation_is_taken_and_a_joint_has_the_last_word() {
    let mut stage = Stage::human(&TORSO, &[]);
    stage.settle(3);
    let hand = stage.bone("LeftHand");
    let wanted = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.4);
    let target = |point, strength| Target { point, position: None, orientation: Some(wanted), strength };
    stage.ik.set_target(target(TargetPoint::Head(hand), 1.0), OVER).unwrap();
    let (first, _) = stage.step(0.2);
    assert!(first < 1e-3, "{first}");
    stage.settle(60);
    let turn = |stage: &Stage, bone: usize| stage.frames()[bone].to_scale_rotation_translation().1;
    assert!(angle(turn(&stage, hand), wanted) < 2e-3);
    let head = stage.bone("Head");
    let before = turn(&stage, head);
    stage.ik.set_target(target(TargetPoint::Head(head), 1.0), OVER).unwrap();
    stage.settle(60);
    assert!(angle(turn(&stage, head), before) < 2e-3, "the joint of the head says how it is turned");
}

#[test]
fn a_soft_target_gives_way_and_the_more_the_softer_it_is() {
    let mut off = Vec::new();
    for strength in [0.02, 0.2, 0.8, 1.0] {
        let mut stage = Stage::human(&TORSO, &[]);
        stage.settle(3);
        let to = stage.head("LeftHand") + Vec3::new(-0.2, -0.1, 0.3);
        stage.ik.set_target(place(TargetPoint::Head(stage.bone("LeftHand")), to, strength), OVER).unwrap();
        stage.settle(100);
        off.push(stage.head("LeftHand").distance(to));
    }
    assert!(off.is_sorted_by(|a, b| a > b) && off[3] < 1e-4 && off[0] > 0.02, "{off:?}");
}

#[test]
fn a_dragged_root_takes_the_whole_character_along_and_comes_back() {
    let mut stage = Stage::human(&TORSO, &[]);
    stage.settle(3);
    let rest = stage.frames();
    let way = Vec3::new(0.4, 0.3, -0.2);
    let to = stage.head("Hips") + way;
    stage.drag("Hips", to);
    assert!(stage.ik.holds_root());
    stage.settle(60);
    for (is, was) in stage.frames().iter().zip(&rest) {
        assert!(Vec3::from(is.translation - was.translation).distance(way) < 1e-3);
    }
    stage.ik.release(TargetPoint::Head(stage.bone("Hips")), OVER);
    assert!(!stage.ik.holds_root());
    let (_, moved) = stage.step(0.2);
    assert!(moved < 1e-3, "{moved}");
    stage.settle(60);
    assert!(stage.frames().iter().zip(&rest).all(|(is, was)| is.abs_diff_eq(*was, 1e-3)));
}

#[test]
fn a_pinned_foot_is_dragged_off_its_pin_and_returns_to_it() {
    let mut stage = Stage::human(&["Hips"], &["LeftFoot", "RightFoot", "Hips:upright"]);
    stage.settle(5);
    let at = stage.head("LeftFoot");
    stage.drag("LeftFoot", at + Vec3::new(0.1, 0.25, 0.2));
    let (turned, _) = stage.settle(60);
    assert!(turned < 0.2, "{turned}");
    assert!(stage.missed("LeftFoot") < 1e-3, "{}", stage.missed("LeftFoot"));
    assert!(stage.missed("RightFoot") < 1e-3);
    stage.ik.release(TargetPoint::Head(stage.bone("LeftFoot")), OVER);
    let (first, moved) = stage.step(0.2);
    assert!(first < 2e-3 && moved < 1e-3, "{first} {moved}");
    stage.settle(80);
    assert!(stage.head("LeftFoot").distance(at) < 1e-3);
}

/// The way out of reach and back, at 1.2 m/s: no bone turns by more than 3° in 5 ms, without limits too.
#[test]
fn what_is_out_of_reach_is_approached_smoothly() {
    for limited in [true, false] {
        let mut stage = Stage::new(&HUMAN, &["Spine", "Chest", "UpperChest", "LeftShoulder"], &[], limited);
        stage.settle(3);
        let from = stage.head("LeftHand") + Vec3::new(-0.1, 0.05, 0.25);
        stage.drag("LeftHand", from);
        stage.settle(80);
        let (mut worst, mut second, mut before) = (0.0_f32, 0.0_f32, 0.0);
        for step in 0..400_i16 {
            let out = 0.006 * f32::from(if step < 200 { step } else { 400 - step });
            let point = TargetPoint::Head(stage.bone("LeftHand"));
            stage.ik.set_target(place(point, from + Vec3::new(out, 0.0, 0.2 * out), 1.0), 0).unwrap();
            let (turned, _) = stage.step(0.2);
            worst = worst.max(turned);
            if step > 0 {
                second = second.max((turned - before).abs());
            }
            before = turned;
        }
        println!(
            "limited {limited}: {:.2}° a step at most, changing by {:.2}°",
            worst.to_degrees(),
            second.to_degrees()
        );
        assert!(worst.to_degrees() < 3.0, "{limited}: {}", worst.to_degrees());
        stage.check_lengths();
    }
}

#[test]
fn the_same_samples_and_targets_give_the_same_bits_also_after_a_restart() {
    let run = |stage: &mut Stage| {
        let mut poses = Vec::new();
        for step in 0..120_usize {
            if step == 10 {
                let to = Vec3::new(0.3, 1.2, 0.4);
                stage.drag("LeftHand", to);
            }
            if step == 40 {
                stage.drag("Hips", Vec3::new(0.0, 0.8, 0.1));
            }
            if step == 70 {
                stage.ik.release(TargetPoint::Head(stage.bone("LeftHand")), OVER);
            }
            stage.step(0.01 * step as f32);
            let bits = |local: &armature_rig::Transform| {
                (local.rotation.to_array().map(f32::to_bits), local.translation.to_array().map(f32::to_bits))
            };
            poses.push(stage.pose.parent_from_bone.iter().map(bits).collect::<Vec<_>>());
        }
        poses
    };
    let mut stage = Stage::human(&TORSO, &[]);
    let first = run(&mut stage);
    stage.ik.restart();
    assert_eq!(stage.ik.targets().count(), 0);
    stage.micros = 0;
    assert!(run(&mut stage) == first);
    assert!(run(&mut Stage::human(&TORSO, &[])) == first);
}

#[test]
fn wishes_that_cannot_be_are_named_and_change_nothing() {
    let mut stage = Stage::human(&TORSO, &[]);
    stage.settle(100);
    let hand = TargetPoint::Head(stage.bone("LeftHand"));
    let mut refused = |target: Target| stage.ik.set_target(target, OVER).unwrap_err();
    assert_eq!(refused(place(hand, Vec3::NAN, 1.0)), TargetError::NotFinite);
    assert_eq!(refused(place(hand, Vec3::splat(f32::INFINITY), 1.0)), TargetError::NotFinite);
    assert_eq!(refused(place(hand, Vec3::splat(1e30), 1.0)), TargetError::NotFinite);
    assert_eq!(refused(place(hand, Vec3::ZERO, 0.0)), TargetError::Strength);
    assert_eq!(refused(place(hand, Vec3::ZERO, f32::NAN)), TargetError::Strength);
    assert_eq!(
        refused(place(TargetPoint::Tail(999), Vec3::ZERO, 1.0)),
        TargetError::NoSuchBone { bone: 999, bones: 52 }
    );
    let skin = |vertex: u32, share: f32| TargetPoint::Skin { vertices: [vertex; 3], barycentric: [share, 0.0, 0.0] };
    assert!(matches!(refused(place(skin(u32::MAX, 1.0), Vec3::ZERO, 1.0)), TargetError::NoSuchPoint { .. }));
    assert!(matches!(refused(place(skin(0, f32::NAN), Vec3::ZERO, 1.0)), TargetError::NoSuchPoint { .. }));
    assert_eq!(refused(Target { position: None, ..place(hand, Vec3::ZERO, 1.0) }), TargetError::Nothing);
    let orientation = Some(Quat::from_xyzw(0.0, 0.0, 0.0, f32::NAN));
    assert_eq!(refused(Target { orientation, ..place(hand, Vec3::ZERO, 1.0) }), TargetError::NotFinite);
    let before = stage.frames();
    stage.ik.release(hand, OVER);
    stage.settle(2);
    assert!(stage.frames().iter().zip(&before).all(|(a, b)| a.abs_diff_eq(*b, 1e-4)));
    assert_eq!(stage.ik.targets().count(), 0);
}

/// Two ends of one hand in places that exclude each other, a pin and a target on one bone, both hands at the ends of the
/// world: finite, smooth, and the misses are named.
#[test]
fn targets_that_contradict_each_other_are_compromised_on() {
    let mut stage = Stage::human(&TORSO, &["LeftFoot", "RightFoot", "LeftHand:turning"]);
    stage.settle(3);
    let (hand, right) = (stage.bone("LeftHand"), stage.bone("RightHand"));
    let targets = [
        (TargetPoint::Head(hand), Vec3::new(0.5, 1.5, 0.4)),
        (TargetPoint::Tail(hand), Vec3::new(0.5, 0.2, -0.4)),
        (TargetPoint::Head(right), Vec3::new(-9e5, 9e5, 0.0)),
        (TargetPoint::Tail(stage.bone("Head")), Vec3::new(4e5, 0.0, 9e5)),
    ];
    for (point, to) in targets {
        stage.ik.set_target(place(point, to, 1.0), OVER).unwrap();
    }
    let (turned, _) = stage.settle(200);
    assert!(turned < 0.5, "{turned}");
    stage.check_lengths();
    let missed: Vec<_> = stage.ik.missed().filter(|missed| missed.distance > 0.01).collect();
    assert!(missed.len() >= 3 && missed.iter().all(|missed| missed.distance.is_finite()), "{missed:?}");
    let (still, _) = stage.settle(50);
    assert!(still < 0.01, "it comes to rest: {still}");
}

#[test]
fn any_bone_of_any_character_can_be_dragged() {
    for character in [&*HUMAN, &spider().unwrap()] {
        for (bone, found) in character.skeleton.bones().iter().enumerate() {
            for point in [TargetPoint::Head(bone), TargetPoint::Tail(bone)] {
                let mut stage = Stage::new(character, &[], &[], true);
                stage.settle(2);
                let at = match point {
                    TargetPoint::Tail(_) => stage.tail(&found.name),
                    _ => stage.head(&found.name),
                };
                let turned_to = Quat::from_rotation_z(0.2) * stage.frames()[bone].to_scale_rotation_translation().1;
                let target = Target {
                    point,
                    position: Some(at + Vec3::new(0.02, 0.01, 0.02)),
                    orientation: (bone % 2 == 0).then_some(turned_to),
                    strength: if bone % 3 == 0 { 0.5 } else { 1.0 },
                };
                stage.ik.set_target(target, OVER).unwrap();
                let (first, moved) = stage.step(0.0);
                assert!(first < 5e-3 && moved < 5e-3, "{} {point:?}: {first} {moved}", found.name);
                stage.settle(5);
                stage.ik.release(point, OVER);
                let (first, moved) = stage.step(0.0);
                assert!(first < 0.02 && moved < 0.02, "{} {point:?}: {first} {moved}", found.name);
                stage.settle(3);
            }
            if bone > 24 {
                break;
            }
        }
    }
}
