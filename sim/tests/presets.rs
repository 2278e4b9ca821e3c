//! The presets on skeletons of the same creatures: the mapping proposed from shapes is what a person would choose.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_rig::{
    Bone, Calibration, JointTree, Part, PartKind, PartUid, Pose, PoseSolver, SensorCalibration, SensorState, Skeleton,
    Transform, propose,
};
use armature_sim::{Body, Motion, Puppet, PuppetSettings};
use firmware_protocol::{FrameBuffer, HostMessage};
use glam::Vec3;

/// Bones as (name, parent, head, tail) in model space.
struct Bones(Vec<Bone>, Vec<Vec3>);

impl Bones {
    fn add(&mut self, name: &str, parent: &str, head: [f32; 3], tail: [f32; 3]) {
        let (head, tail) = (Vec3::from(head), Vec3::from(tail));
        let parent = self.0.iter().position(|b| b.name == parent);
        let translation = head - parent.map_or(Vec3::ZERO, |p| self.1[p]);
        let rest = Transform { translation, ..Transform::IDENTITY };
        self.0.push(Bone { name: name.into(), parent, rest, tail: tail - head });
        self.1.push(head);
    }

    fn chain(&mut self, names: &[String], parent: &str, points: &[[f32; 3]]) {
        let mut parent = parent.to_owned();
        for (name, ends) in names.iter().zip(points.windows(2)) {
            self.add(name, &parent, ends[0], ends[1]);
            parent.clone_from(name);
        }
    }
}

fn tree_of(body: &Body) -> JointTree {
    let part = |part: &armature_sim::BodyPart| Part {
        uid: PartUid(part.uid.0),
        kind: match part.kind {
            firmware_protocol::PartKind::Bend => PartKind::Bend,
            firmware_protocol::PartKind::Twist => PartKind::Twist,
            firmware_protocol::PartKind::TwistBendTwist => PartKind::TwistBendTwist,
            _ => PartKind::Splitter { outlets: part.outlets },
        },
        parent: part.parent,
        outlet: part.outlet,
        counts_per_turn: 16_384,
    };
    JointTree::new(body.parts().iter().map(part).collect()).unwrap()
}

fn check(preset: &str, bones: Bones, bone_of: impl Fn(&str) -> String) {
    let body = Body::preset(preset, 1).unwrap();
    let proposal = propose(&tree_of(&body), &Skeleton::new(bones.0).unwrap());
    for part in body.parts().iter().filter(|p| p.kind.sensor_count() != Some(0)) {
        let entry = proposal.mapping.entries.iter().find(|entry| entry.part.0 == part.uid.0);
        let got = entry.map(|entry| entry.bone.clone());
        assert_eq!(got, Some(bone_of(&part.label)), "{}: {:#?}", part.label, proposal.ambiguities);
    }
}

const FINGERS: [&str; 5] = ["Thumb", "Index", "Middle", "Ring", "Little"];
const SEGMENTS: [&str; 3] = ["Proximal", "Intermediate", "Distal"];

/// Fingers of a hand at `wrist`: `along` the fingers, `thumb` towards the thumb's side.
fn fingers(bones: &mut Bones, side: &str, wrist: Vec3, along: Vec3, thumb: Vec3) {
    for (number, finger) in FINGERS.into_iter().enumerate() {
        let across = [0.030, 0.024, 0.003, -0.017, -0.036][number];
        let reach = if number == 0 { [0.028, 0.060, 0.092, 0.118] } else { [0.092, 0.136, 0.162, 0.184] };
        let shorter = [1.0, 0.98, 1.0, 0.97, 0.86][number];
        let spread = if number == 0 { 0.6 } else { 0.0 };
        let points = reach.map(|r| (wrist + along * (r * shorter) + thumb * (across + spread * r)).to_array());
        let names = SEGMENTS.map(|segment| format!("{side}{finger}{segment}"));
        bones.chain(&names, &format!("{side}Hand"), &points);
    }
}

fn human_bones() -> Bones {
    let mut bones = Bones(Vec::new(), Vec::new());
    let trunk = ["Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"].map(str::to_owned);
    let heights = [0.955, 1.045, 1.165, 1.285, 1.465, 1.545, 1.735].map(|y| [0.0, y, -0.01]);
    bones.chain(&trunk, "", &heights);
    for (side, s) in [("Left", 1.0_f32), ("Right", -1.0)] {
        let names = |list: [&str; 4]| list.map(|name| format!("{side}{name}"));
        let arm = [
            [0.025, 1.428, -0.014],
            [0.172, 1.425, -0.014],
            [0.441, 1.425, -0.02],
            [0.692, 1.425, -0.01],
            [0.784, 1.425, -0.01],
        ];
        bones.chain(
            &names(["Shoulder", "UpperArm", "LowerArm", "Hand"]),
            "UpperChest",
            &arm.map(|p| [p[0] * s, p[1], p[2]]),
        );
        let leg = [
            [0.094, 0.905, 0.0],
            [0.104, 0.49, 0.008],
            [0.11, 0.085, -0.024],
            [0.122, 0.022, 0.122],
            [0.124, 0.016, 0.172],
        ];
        bones.chain(&names(["UpperLeg", "LowerLeg", "Foot", "Toes"]), "Hips", &leg.map(|p| [p[0] * s, p[1], p[2]]));
        fingers(&mut bones, side, Vec3::new(0.692 * s, 1.425, -0.01), Vec3::X * s, Vec3::Z);
    }
    bones
}

#[test]
fn human() {
    check("human", human_bones(), |label| {
        let (side, joint) = label.split_once('_').unwrap_or(("", label));
        let side = match side {
            "left" => "Left",
            "right" => "Right",
            _ => "",
        };
        let bone = match joint {
            "hips" => "Hips",
            "spine" => "Chest",
            "chest" => "UpperChest",
            "neck" => "Neck",
            "head" => "Head",
            "hip" => "UpperLeg",
            "knee" => "LowerLeg",
            "ankle" => "Foot",
            "shoulder" => "UpperArm",
            "elbow" | "forearm" => "LowerArm",
            _ => "Hand",
        };
        format!("{side}{bone}")
    });
}

#[test]
fn hand() {
    let mut bones = Bones(Vec::new(), Vec::new());
    let arm = ["LeftLowerArm", "LeftHand"].map(str::to_owned);
    bones.chain(&arm, "", &[[0.0, 0.03, 0.0], [0.0, 0.29, 0.0], [-0.012, 0.65, 0.0]]);
    let scale = 3.95;
    fingers(&mut bones, "Left", Vec3::new(0.0, 0.29, 0.0), Vec3::Y * scale, Vec3::NEG_X * scale);
    check("hand", bones, |label| {
        let Some((finger, joint)) = label.split_once('_') else { return "LeftHand".into() };
        let finger = FINGERS.iter().find(|name| name.to_lowercase() == finger).unwrap();
        format!("Left{finger}{}", SEGMENTS[joint.parse::<usize>().unwrap() - 1])
    });
}

#[test]
fn spider() {
    let mut bones = Bones(Vec::new(), Vec::new());
    bones.add("Body", "", [0.0, 0.3, -0.02], [0.0, 0.3, 0.2]);
    bones.add("Abdomen", "Body", [0.0, 0.305, -0.085], [0.0, 0.34, -0.43]);
    for (side, s) in [("Left", 1.0_f32), ("Right", -1.0)] {
        let legs = [
            (0.50_f32, [0.070, 0.175], [0.215, 0.430, 0.560]),
            (1.13, [0.092, 0.115], [0.200, 0.385, 0.500]),
            (1.82, [0.092, 0.050], [0.195, 0.370, 0.485]),
            (2.50, [0.072, -0.005], [0.235, 0.470, 0.610]),
        ];
        for (number, (angle, hip, out)) in legs.into_iter().enumerate() {
            let (sin, cos) = libm::sincosf(angle);
            let point = |way: f32, y: f32| [s * (hip[0] + sin * way), y, hip[1] + cos * way];
            let points = [point(0.0, 0.29), point(out[0], 0.485), point(out[1], 0.235), point(out[2], 0.01)];
            let names = ["Femur", "Tibia", "Tarsus"].map(|segment| format!("{side}Leg{}{segment}", number + 1));
            bones.chain(&names, "Body", &points);
        }
    }
    check("spider", bones, |label| {
        let words: Vec<&str> = label.split('_').collect();
        let [side, leg, joint] = words[..] else { return "Body".into() };
        let side = if side == "left" { "Left" } else { "Right" };
        let segment = match joint {
            "hip" => "Femur",
            "knee" => "Tibia",
            _ => "Tarsus",
        };
        format!("{side}Leg{leg}{segment}")
    });
}

/// Where the tails of some bones are while the preset moves, in model space.
fn tails(motion: Motion, millis: u64, names: &[&str]) -> Vec<Vec3> {
    let body = Body::preset("human", 1).unwrap();
    let tree = tree_of(&body);
    let skeleton = Skeleton::new(human_bones().0).unwrap();
    let settings = PuppetSettings { motion, rest_micros: 0, ..PuppetSettings::new(body) };
    let mut puppet = Puppet::new(settings).unwrap();
    let mut wire = FrameBuffer::new();
    puppet.step(0, wire.encode(&HostMessage::Start).unwrap(), &mut Vec::new());
    let mut calibration = Calibration::default();
    for part in tree.parts().iter().filter(|part| !part.kind.axes().is_empty()) {
        let zeroed = |&axis| SensorCalibration { zero_counts: Some(0), ..SensorCalibration::unzeroed(axis) };
        calibration.set_part(part.uid, part.kind.axes().iter().map(zeroed).collect());
    }
    let turn = 16_384.0 / std::f64::consts::TAU;
    let angles = puppet.true_angles(millis * 1000);
    let counts: Vec<u16> = angles.iter().map(|a| libm::round(a * turn).rem_euclid(16_384.0) as u16).collect();
    let mapping = propose(&tree, &skeleton).mapping;
    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &counts, &vec![SensorState::Ok; counts.len()], &mut pose).unwrap();
    let mut frames = skeleton.rest_model_from_bone();
    pose.forward_kinematics(&skeleton, &mut frames);
    let tail = |name: &&str| {
        let bone = skeleton.find(name).unwrap();
        frames[bone].transform_point3(skeleton.bones()[bone].tail)
    };
    names.iter().map(tail).collect()
}

#[test]
fn a_walker_looks_like_one() {
    let (mut least, mut most) = ([f32::MAX; 4], [f32::MIN; 4]);
    for millis in (1000..3200).step_by(20) {
        let names = ["LeftHand", "RightHand", "LeftFoot", "RightFoot", "LeftUpperArm", "LeftUpperLeg", "LeftLowerLeg"];
        let at = tails(Motion::Walk, millis, &names);
        assert!(at[0].y < 1.15 && at[1].y < 1.15, "hands hang down: {at:?}");
        assert!(at[0].x > 0.1 && at[1].x < -0.1 && at[0].x < 0.6, "each on its side: {at:?}");
        let (upper, lower) = (at[4] - Vec3::new(0.172, 1.425, -0.014), at[0] - at[4]);
        assert!(upper.cross(lower).x < 0.0, "elbows bend forwards: {at:?}");
        for (limb, point) in at[..4].iter().enumerate() {
            least[limb] = least[limb].min(point.z);
            most[limb] = most[limb].max(point.z);
        }
        // The shin never points forward of the thigh.
        let (hip, knee, foot) = (Vec3::new(0.094, 0.905, 0.0), at[5], at[6]);
        let (thigh, shin) = ((knee - hip).normalize(), (foot - knee).normalize());
        assert!(thigh.cross(shin).x > -0.12, "knees bend backwards: {at:?}");
    }
    for limb in 0..4 {
        assert!(most[limb] - least[limb] > 0.2, "limb {limb} swings: {least:?} {most:?}");
    }
    // Arms swing against the legs.
    let at = tails(Motion::Walk, 1389, &["LeftHand", "RightHand", "LeftFoot", "RightFoot"]);
    assert!((at[0].z - at[1].z) * (at[2].z - at[3].z) < 0.0, "{at:?}");
}

#[test]
fn a_waving_hand_is_up() {
    for millis in (1000..3000).step_by(50) {
        let at = tails(Motion::WalkAndWave, millis, &["RightHand", "RightUpperArm", "LeftHand"]);
        assert!(at[0].y > 1.6 && at[0].y > at[1].y && at[2].y < 1.15, "{at:?}");
    }
}

#[test]
fn exercises_look_like_what_they_are_called() {
    use armature_sim::Exercise;
    // Arms come down from the T-pose first.
    const LEAD_MILLIS: u64 = 660;
    let names = ["LeftFoot", "RightFoot", "LeftHand", "RightHand", "Head", "LeftLowerLeg", "LeftUpperLeg"];
    let at = |exercise: Exercise, share: f64| {
        let millis = LEAD_MILLIS + (share * exercise.seconds() * 1e3) as u64;
        tails(Motion::Exercise(exercise), millis, &names)
    };
    for (name, exercise) in Exercise::ALL {
        let start = at(exercise, 0.0);
        assert!(start[0].y < 0.1 && start[2].y < 1.1 && start[3].y < 1.1, "{name} begins standing: {start:?}");
    }
    let squat = at(Exercise::Squat, 0.5);
    assert!(squat[0].y > 0.3 && squat[1].y > 0.3, "feet come up to still hips: {squat:?}");
    assert!((squat[5].z - 0.0).abs() < 0.12 && squat[6].z > 0.25, "ankles under the hips, knees forward: {squat:?}");
    let sit = at(Exercise::Sit, 0.5);
    assert!(sit[6].z > 0.35 && sit[0].y > 0.3, "thighs forward: {sit:?}");
    let kick = at(Exercise::Kick, 0.55);
    assert!(kick[0].z > 0.5 && kick[0].y > 0.4 && kick[1].y < 0.1, "one foot forward and up, one down: {kick:?}");
    let reach = at(Exercise::Reach, 0.5);
    assert!(reach[3].z > 0.6 && reach[4].z > 0.3, "a hand and the head far forward: {reach:?}");
    let wheel = at(Exercise::Cartwheel, 0.5);
    assert!(wheel[4].y < 0.5 && wheel[0].y > 1.2 && wheel[2].y < 0.2, "upside down on the hands: {wheel:?}");
    assert!(at(Exercise::Cartwheel, 0.35)[2].y < at(Exercise::Cartwheel, 0.35)[3].y, "over the left hand first");
}
