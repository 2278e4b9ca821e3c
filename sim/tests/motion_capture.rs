//! Real motion capture through the emulated puppet and back to poses: sensors, wire, calibration, mapping.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_rig::{
    Calibration, JointTree, Motion, Part, PartKind, PartUid, Pose, PoseSolver, RawSample, SensorState, Skeleton,
    propose,
};
use armature_sim::{Body, JointTrack, PuppetSettings, Retargeted, puppet_from_motion, retarget};
use armature_test_support::shared_bytes;
use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, HostMessage, PartRecord};
use glam::{DQuat, DVec3};

fn clips() -> Vec<(&'static str, Motion)> {
    ["mocap/freebvh.bvh", "mocap/mocapbank.bvh"]
        .into_iter()
        .filter_map(|name| {
            shared_bytes(name).map(|bytes| (name, armature_formats::motion::read_bvh(&bytes).unwrap().motion))
        })
        .collect()
}

fn tree_of(records: &[PartRecord]) -> JointTree {
    let part = |record: &PartRecord| Part {
        uid: PartUid(record.uid.0),
        kind: match record.kind {
            firmware_protocol::PartKind::Bend => PartKind::Bend,
            firmware_protocol::PartKind::Twist => PartKind::Twist,
            firmware_protocol::PartKind::TwistBendTwist => PartKind::TwistBendTwist,
            _ => PartKind::Splitter { outlets: record.outlet_count },
        },
        parent: record.parent.map(usize::from),
        outlet: record.outlet,
        counts_per_turn: record.counts_per_turn,
    };
    JointTree::new(records.iter().map(part).collect()).unwrap()
}

fn raw(sample: &firmware_protocol::Sample<'_>) -> RawSample {
    let state = |state| match state {
        firmware_protocol::SensorState::Ok => SensorState::Ok,
        firmware_protocol::SensorState::NoData => SensorState::NoData,
        firmware_protocol::SensorState::MagnetWeak => SensorState::MagnetWeak,
        firmware_protocol::SensorState::Outlier => SensorState::Outlier,
    };
    RawSample {
        device_micros: sample.device_micros,
        sequence: sample.sequence,
        epoch: sample.epoch,
        counts: sample.counts().collect(),
        states: sample.states().map(state).collect(),
    }
}

/// The tree and all samples of a puppet that plays for this long.
fn perform(settings: PuppetSettings, seconds: f64) -> (JointTree, Vec<RawSample>) {
    let mut puppet = armature_sim::Puppet::new(settings).unwrap();
    let mut wire = FrameBuffer::new();
    let mut bytes = Vec::new();
    for request in [HostMessage::TopologyRequest, HostMessage::SetRate { rate_millihertz: 240_000 }, HostMessage::Start]
    {
        puppet.step(0, wire.encode(&request).unwrap(), &mut bytes);
    }
    puppet.step((seconds * 1e6) as u64, &[], &mut bytes);
    let (mut records, mut samples) = (Vec::new(), Vec::new());
    let mut decoder = Decoder::new();
    let mut bytes = bytes.as_slice();
    while let Some(frame) = decoder.next_frame(&mut bytes) {
        match DeviceMessage::parse(frame).unwrap() {
            DeviceMessage::Topology(chunk) => records.extend(chunk.records()),
            DeviceMessage::Sample(sample) => samples.push(raw(&sample)),
            _ => {}
        }
    }
    (tree_of(&records), samples)
}

fn degrees_apart(a: DQuat, b: DQuat) -> f64 {
    let d = a.inverse() * b;
    2.0 * libm::atan2(DVec3::new(d.x, d.y, d.z).length(), d.w.abs()).to_degrees()
}

/// The source's local rotation at a time, turning uniformly between frames.
fn source_rotation(motion: &Motion, bone: usize, seconds: f64) -> DQuat {
    let last = motion.frames.len() - 1;
    let at = (seconds / motion.frame_seconds).clamp(0.0, last as f64);
    let frame = libm::floor(at) as usize;
    let rotation = |frame: usize| motion.frames[frame.min(last)].parent_from_bone[bone].rotation.as_dquat().normalize();
    rotation(frame).slerp(rotation(frame + 1), at - libm::floor(at)).normalize()
}

#[test]
fn every_joint_comes_back_within_a_tenth_of_a_degree() {
    for (name, motion) in clips() {
        let (body, track) = puppet_from_motion(&motion, 5).unwrap();
        let settings = PuppetSettings {
            motion: armature_sim::Motion::Track(track),
            seed: 5,
            reversed_sensors: vec![1, 5],
            ..PuppetSettings::new(body)
        };
        let (tree, samples) = perform(settings, 1.0 + motion.duration_seconds());
        let mut calibration = Calibration::for_tree(&tree);
        for (part, sensor) in [(0, 1), (1, 2)] {
            let with_sensors = tree.parts().iter().filter(|p| !p.kind.axes().is_empty()).nth(part).unwrap();
            assert!(calibration.flip(with_sensors.uid, sensor), "sensors 1 and 5 count backwards");
        }
        let report = calibration.zero(&tree, &samples[0]).unwrap();
        assert_eq!((report.zeroed, report.skipped.len()), (tree.sensor_count(), 0));
        let proposal = propose(&tree, &motion.skeleton);
        assert_eq!(proposal.mapping.entries.len(), motion.skeleton.len(), "{name}: every bone has a joint");
        let mut solver = PoseSolver::new(&tree, &calibration, &proposal.mapping, &motion.skeleton).unwrap();
        let mut pose = Pose::default();
        let mut worst = 0.0_f64;
        let mut compared = 0;
        for sample in samples.iter().filter(|sample| sample.device_micros >= 1_000_000) {
            solver.solve(sample.device_micros, &sample.counts, &sample.states, &mut pose).unwrap();
            // Exact except for what the wire's whole microseconds hide.
            let seconds = (sample.device_micros - 1_000_000) as f64 * 1e-6;
            for bone in 0..motion.skeleton.len() {
                let got = pose.parent_from_bone[bone].rotation.as_dquat().normalize();
                worst = worst.max(degrees_apart(got, source_rotation(&motion, bone, seconds)));
                compared += 1;
            }
        }
        println!("{name}: {compared} joint rotations of {} bones, worst {worst:.4}°", motion.skeleton.len());
        assert!(worst < 0.1, "{name}: {worst}°");
        assert!(samples.len() > motion.frames.len() * 8 - 20);
    }
}

/// Directions of the bones in model space, by bone name.
fn direction(motion: &Motion, name: &str, frame: usize) -> DVec3 {
    let skeleton: &Skeleton = &motion.skeleton;
    let bone = skeleton.find(name).unwrap();
    let mut frames = skeleton.rest_model_from_bone();
    motion.frames[frame].forward_kinematics(skeleton, &mut frames);
    frames[bone].transform_vector3(skeleton.bones()[bone].tail).as_dvec3().normalize()
}

/// The model-space turns that the track gives each label, composed along the puppet.
fn played(body: &Body, track: &JointTrack, label: &str, frame: usize) -> DQuat {
    let mut chain = Vec::new();
    let mut part = body.find(label);
    while let Some(p) = part {
        chain.push(p);
        part = body.parts()[p].parent;
    }
    chain.iter().rev().fold(DQuat::IDENTITY, |above, part| {
        let Some(column) = track.parts.iter().position(|p| p == part) else { return above };
        let turn = DQuat::from_array(track.rotations[frame * track.parts.len() + column]);
        let f = model_from_joint(&body.parts()[*part].label);
        above * f * turn * f.inverse()
    })
}

/// The joint frame in T-pose, by the documented rule.
fn model_from_joint(label: &str) -> DQuat {
    let arm = ["shoulder", "elbow", "forearm", "wrist"].iter().any(|word| label.ends_with(word));
    let leg = ["hip", "knee"].iter().any(|word| label.ends_with(word)) && label.contains('_');
    let y = match label {
        _ if label.ends_with("ankle") => DVec3::new(0.0, -0.5, 0.87).normalize(),
        _ if arm && label.starts_with("left") => DVec3::X,
        _ if arm => DVec3::NEG_X,
        _ if leg => DVec3::NEG_Y,
        _ => DVec3::Y,
    };
    let x = DVec3::Z.cross(y).normalize();
    DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y)))
}

#[test]
fn limbs_of_another_figure_point_the_same_way() {
    for (name, motion) in clips() {
        let body = Body::preset("human", 1).unwrap();
        let Retargeted { track, matched, unmatched } = retarget(&motion, &body).unwrap();
        assert!(unmatched.is_empty(), "{name}: {unmatched:?}");
        let mut worst = 0.0_f64;
        for frame in 0..motion.frames.len() {
            for (label, bone) in &matched {
                let t_pose = match *label {
                    "left_shoulder" | "left_elbow" => DVec3::X,
                    "right_shoulder" | "right_elbow" => DVec3::NEG_X,
                    "left_hip" | "left_knee" | "right_hip" | "right_knee" => DVec3::NEG_Y,
                    _ => continue,
                };
                let got = played(&body, &track, label, frame) * t_pose;
                let off = got.dot(direction(&motion, bone, frame)).clamp(-1.0, 1.0).acos().to_degrees();
                // A nearly straight limb does not define where its hinge points, and is then off by less than its bend.
                let hinge = label.ends_with("elbow") || label.ends_with("knee");
                assert!(off < if hinge { 20.0 } else { 0.1 }, "{name}: {label} at frame {frame} is off by {off}°");
                worst = worst.max(off);
            }
        }
        println!("{name}: worst direction {worst:.2}°, {matched:?}");
        let settings = PuppetSettings { motion: armature_sim::Motion::Track(track), ..PuppetSettings::new(body) };
        let (tree, samples) = perform(settings, 2.0);
        assert_eq!(tree.sensor_count(), 45);
        assert_ne!(samples[0].counts, samples.last().unwrap().counts);
    }
}

#[test]
fn a_figure_without_known_names_is_refused() {
    let bone = |i: usize| armature_rig::Bone {
        name: format!("b{i}"),
        parent: i.checked_sub(1),
        rest: armature_rig::Transform::IDENTITY,
        tail: glam::Vec3::Y,
    };
    let motion = |count: usize| {
        let skeleton = Skeleton::new((0..count).map(bone).collect()).unwrap();
        let frames = vec![skeleton.rest_pose()];
        Motion::new(skeleton, 0.1, frames).unwrap()
    };
    let body = Body::preset("human", 1).unwrap();
    assert!(retarget(&motion(3), &body).unwrap_err().to_string().contains("3 bones"));
    assert!(puppet_from_motion(&motion(0), 1).is_err());
    assert!(puppet_from_motion(&motion(200), 1).unwrap_err().to_string().contains("600 sensors"));
}

#[test]
fn the_human_preset_finds_its_bones_in_real_skeletons() {
    let mixamo = "hips Hips, spine Spine1, chest Spine2, neck Neck, head Head, left_hip LeftUpLeg, left_knee LeftLeg, \
                  left_ankle LeftFoot, right_hip RightUpLeg, right_knee RightLeg, right_ankle RightFoot, \
                  left_shoulder LeftArm, left_elbow LeftForeArm, left_forearm LeftForeArm, left_wrist LeftHand, \
                  right_shoulder RightArm, right_elbow RightForeArm, right_forearm RightForeArm, right_wrist RightHand";
    let bank = "hips Hips, spine Chest, chest Chest2, neck Neck, head Head, left_hip LeftHip, left_knee LeftKnee, \
                left_ankle LeftAnkle, right_hip RightHip, right_knee RightKnee, right_ankle RightAnkle, \
                left_shoulder LeftShoulder, left_elbow LeftElbow, left_forearm LeftElbow, left_wrist LeftWrist, \
                right_shoulder RightShoulder, right_elbow RightElbow, right_forearm RightElbow, right_wrist RightWrist";
    let body = Body::preset("human", 1).unwrap();
    let (tree, _) = perform(PuppetSettings::new(body.clone()), 0.0);
    for (name, motion) in clips() {
        let proposal = propose(&tree, &motion.skeleton);
        let expected = if name.contains("freebvh") { mixamo } else { bank };
        for pair in expected.split(',') {
            let (label, bone) = pair.trim().split_once(' ').unwrap();
            let uid = PartUid(body.parts()[body.find(label).unwrap()].uid.0);
            let entry = proposal.mapping.entries.iter().find(|entry| entry.part == uid);
            let got = entry.map(|entry| entry.bone.rsplit(':').next().unwrap());
            assert_eq!(got, Some(bone), "{name}: {label}; {:#?}", proposal.ambiguities);
        }
        println!("{name}: {:?}\n{:#?}", proposal.confidence, proposal.ambiguities);
    }
}
