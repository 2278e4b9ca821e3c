//! Motions on other skeletons: real motion capture of two actors.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

use std::ops::ControlFlow;

use armature_formats::motion::read_bvh;
use armature_rig::{
    Bone, HumanoidBone, HumanoidPart, Motion, RetargetError, RetargetSettings, Retargeted, Side, Skeleton, Transform,
    recognise, retarget,
};
use armature_test_support::shared_bytes;
use glam::{Affine3A, Quat, Vec3};

fn actor(name: &str) -> Option<Motion> {
    Some(read_bvh(&shared_bytes(&format!("mocap/{name}.bvh"))?).unwrap().motion)
}

fn moved(source: &Motion, target: &Skeleton, settings: RetargetSettings) -> Retargeted {
    retarget(source, target, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

/// Where the heads of bones are in every frame.
fn heads(motion: &Motion) -> Vec<Vec<Vec3>> {
    let mut frames = vec![Affine3A::IDENTITY; motion.skeleton.len()];
    let of = |pose: &armature_rig::Pose| {
        pose.forward_kinematics(&motion.skeleton, &mut frames);
        frames.iter().map(|frame| Vec3::from(frame.translation)).collect()
    };
    motion.frames.iter().map(of).collect()
}

fn size(skeleton: &Skeleton) -> f32 {
    let heads = skeleton.rest_segments();
    let (low, high) = heads
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (head, _)| (low.min(*head), high.max(*head)));
    (high - low).length()
}

/// The same bones with axes of their own, so that nothing is the same but the shape.
fn with_other_axes(skeleton: &Skeleton) -> Skeleton {
    let axes = |bone: usize| Quat::from_euler(glam::EulerRot::XYZ, 0.3 + bone as f32, 0.7 * bone as f32, -0.2);
    let bones = skeleton.bones().iter().enumerate().map(|(index, bone)| {
        let above = bone.parent.map_or(Quat::IDENTITY, axes);
        let rest = Transform {
            translation: above.inverse() * bone.rest.translation,
            rotation: (above.inverse() * bone.rest.rotation * axes(index)).normalize(),
            scale: Vec3::ONE,
        };
        Bone { rest, tail: axes(index).inverse() * bone.tail, ..bone.clone() }
    });
    Skeleton::new(bones.collect()).unwrap()
}

#[test]
fn the_same_body_moves_exactly_alike() {
    for name in ["freebvh", "mocapbank"] {
        let Some(motion) = actor(name) else { return };
        for contacts in [false, true] {
            let settings = RetargetSettings { contacts, ..RetargetSettings::default() };
            for target in [motion.skeleton.clone(), with_other_axes(&motion.skeleton)] {
                let back = moved(&motion, &target, settings);
                assert!((back.report.scale - 1.0).abs() < 1e-5, "{:?}", back.report);
                let (ours, theirs) = (heads(&back.motion), heads(&motion));
                let off = ours.iter().flatten().zip(theirs.iter().flatten()).map(|(a, b)| a.distance(*b));
                let off = off.fold(0.0, f32::max) / size(&motion.skeleton);
                println!("{name}, contacts {contacts}: heads off by {off:.2e} of the size, {:?}", back.report.notes);
                assert!(off < 1e-5, "{name}: {off}");
            }
        }
    }
}

/// A limb by its side: from the head of one bone to that of the next.
fn limbs(skeleton: &Skeleton) -> Vec<(String, [usize; 2])> {
    let recognition = recognise(skeleton);
    let chains = [
        (HumanoidPart::UpperArm, HumanoidPart::LowerArm),
        (HumanoidPart::LowerArm, HumanoidPart::Hand),
        (HumanoidPart::UpperLeg, HumanoidPart::LowerLeg),
        (HumanoidPart::LowerLeg, HumanoidPart::Foot),
    ];
    let mut out = Vec::new();
    for (part, next) in chains {
        for side in [Side::Left, Side::Right].map(Some) {
            let find = |part| recognition.find(HumanoidBone { part, side }).unwrap();
            out.push((HumanoidBone { part, side }.to_string(), [find(part), find(next)]));
        }
    }
    out
}

/// The worst angle between the same limbs of two motions in all frames, degrees, of arms and of legs; and the mean of legs.
fn apart(a: &Motion, b: &Motion) -> [f32; 3] {
    let (ours, theirs) = (heads(a), heads(b));
    let mut worst = [0.0_f32; 3];
    let mut count = 0.0;
    for ((name, [from, to]), (_, [other_from, other_to])) in limbs(&a.skeleton).iter().zip(&limbs(&b.skeleton)) {
        for (own, other) in ours.iter().zip(&theirs) {
            let angle = (own[*to] - own[*from]).angle_between(other[*other_to] - other[*other_from]).to_degrees();
            let slot = usize::from(name.contains("Leg"));
            worst[slot] = worst[slot].max(angle);
            if slot == 1 {
                worst[2] += angle;
                count += 1.0;
            }
        }
    }
    worst[2] /= count;
    worst
}

/// How fast feet go while those of `source` stand, in legs a second: the mean of both motions.
fn slides(source: &Motion, target: &Motion) -> [f64; 2] {
    let foot = |skeleton: &Skeleton, side| {
        recognise(skeleton).find(HumanoidBone { part: HumanoidPart::Foot, side: Some(side) }).unwrap()
    };
    let leg = |motion: &Motion| {
        let heads: Vec<Vec3> = motion.skeleton.rest_segments().iter().map(|(head, _)| *head).collect();
        let of = limbs(&motion.skeleton);
        let length =
            |name: &str| of.iter().find(|(known, _)| known == name).map(|(_, [a, b])| heads[*a].distance(heads[*b]));
        f64::from(length("leftUpperLeg").unwrap() + length("leftLowerLeg").unwrap())
    };
    let (legs, others) = (leg(source), leg(target));
    let (ours, theirs) = (heads(source), heads(target));
    let mut sums = [0.0_f64; 2];
    let mut count = 0.0_f64;
    for side in [Side::Left, Side::Right] {
        let (own, other) = (foot(&source.skeleton, side), foot(&target.skeleton, side));
        for frame in 1..ours.len() {
            let speed = f64::from(ours[frame][own].distance(ours[frame - 1][own])) / legs / source.frame_seconds;
            if speed < 0.2 {
                sums[0] += speed;
                sums[1] +=
                    f64::from(theirs[frame][other].distance(theirs[frame - 1][other])) / others / source.frame_seconds;
                count += 1.0;
            }
        }
    }
    sums.map(|sum| sum / count.max(1.0))
}

#[test]
fn limbs_point_alike_and_feet_do_not_slide_more() {
    let (Some(free), Some(bank)) = (actor("freebvh"), actor("mocapbank")) else { return };
    for (name, source, target) in [("freebvh to mocapbank", &free, &bank), ("mocapbank to freebvh", &bank, &free)] {
        let plain =
            moved(source, &target.skeleton, RetargetSettings { contacts: false, ..RetargetSettings::default() });
        let [arms, legs, _] = apart(source, &plain.motion);
        println!("{name}, by turns alone: arms off by {arms:.4}°, legs by {legs:.4}°, {:?}", plain.report);
        assert!(arms < 0.05 && legs < 0.05, "{name}: {arms} and {legs}");
        let planted = moved(source, &target.skeleton, RetargetSettings::default());
        let [arms, legs, mean] = apart(source, &planted.motion);
        let (before, after) = (slides(source, &plain.motion), slides(source, &planted.motion));
        println!(
            "{name}, feet kept {} times, missed by {:.2e}: legs off by {legs:.3}° at worst, {mean:.3}° on average",
            planted.report.contacts, planted.report.missed
        );
        println!(
            "  slides in legs a second: source {:.5}, by turns alone {:.5}, kept {:.5}",
            after[0], before[1], after[1]
        );
        // A leg that is nearly straight bends by degrees for millimetres of its foot.
        assert!(arms < 0.05 && legs < 10.0 && mean < 2.0, "{name}: {arms}, {legs} and {mean}");
        assert!(planted.report.contacts > 0 && after[1] <= 1.05 * after[0], "{name}: {after:?}");
    }
}

#[test]
fn nonsense_is_named() {
    let stone = Bone { name: "stone".into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::Y };
    let stones: Vec<Bone> = (0..5).map(|k| Bone { name: format!("s{k}"), ..stone.clone() }).collect();
    let stones = Skeleton::new(stones).unwrap();
    let others: Vec<Bone> = (0..5).map(|k| Bone { name: format!("t{k}"), ..stone.clone() }).collect();
    let others = Skeleton::new(others).unwrap();
    let still = Motion::new(stones.clone(), 0.04, vec![stones.rest_pose(); 3]).unwrap();
    let tried = |motion: &Motion, target: &Skeleton, settings: RetargetSettings| {
        retarget(motion, target, &settings, &mut |_, _| ControlFlow::Continue(()))
    };
    let plain = RetargetSettings::default();
    assert!(matches!(tried(&still, &others, plain), Err(RetargetError::TooFewPairs { pairs: 0, .. })));
    assert!(tried(&still, &stones, plain).is_ok());
    let none = Motion { frames: Vec::new(), ..still.clone() };
    assert!(matches!(tried(&none, &stones, plain), Err(RetargetError::NoFrames)));
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let bad = tried(&still, &stones, RetargetSettings { scale: Some(scale), ..plain });
        assert!(matches!(bad, Err(RetargetError::BadScale(_))));
    }
    let stopped = retarget(&still, &stones, &plain, &mut |_, _| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(RetargetError::Cancelled)));
    let Some(free) = actor("freebvh") else { return };
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let fox = armature_formats::read_model("Fox.glb", &bytes, &|name| Err(name.to_owned())).unwrap();
    let other = tried(&free, &fox.rig.unwrap().skeleton, plain);
    assert!(matches!(other, Err(RetargetError::OtherFigure { .. } | RetargetError::TooFewPairs { .. })), "{other:?}");
}
