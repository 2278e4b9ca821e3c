//! Motion files against forward kinematics computed here from the raw numbers, and round trips.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use armature_formats::motion::{read_bvh, write_bvh};
use armature_rig::{Bone, Motion, Pose, Skeleton, Transform};
use armature_test_support::shared_bytes;
use glam::{Affine3A, DAffine3, DMat3, DVec3, EulerRot, Quat, Vec3};

/// A second, naive BVH reader: world matrices of every joint at one frame. Walks the hierarchy recursively on tokens
/// and turns angles into matrices axis by axis.
struct Naive<'t> {
    tokens: Vec<&'t str>,
    at: usize,
    values: Vec<f64>,
    used: usize,
    world: Vec<DAffine3>,
}

impl<'t> Naive<'t> {
    fn frame(text: &'t str, frame: usize) -> Vec<DAffine3> {
        let (hierarchy, motion) = text.split_once("MOTION").unwrap();
        let line = motion.lines().filter(|l| !l.trim().is_empty()).nth(2 + frame).unwrap();
        let mut naive = Naive {
            tokens: hierarchy.split_whitespace().skip(1).collect(),
            at: 0,
            values: line.split_whitespace().map(|w| w.parse().unwrap()).collect(),
            used: 0,
            world: Vec::new(),
        };
        while naive.at < naive.tokens.len() {
            naive.joint(DAffine3::IDENTITY);
        }
        assert_eq!(naive.used, naive.values.len());
        naive.world
    }

    fn next(&mut self) -> &'t str {
        self.at += 1;
        self.tokens[self.at - 1]
    }

    fn joint(&mut self, parent: DAffine3) {
        while self.next() != "{" {}
        let mut local = DAffine3::IDENTITY;
        let mut world = None;
        loop {
            match self.next() {
                "OFFSET" => local.translation = DVec3::from_array([0; 3].map(|_: i32| self.next().parse().unwrap())),
                "CHANNELS" => {
                    for _ in 0..self.next().parse::<usize>().unwrap() {
                        let (axis, kind) = self.next().split_at(1);
                        let value = self.values[self.used];
                        self.used += 1;
                        let direction = DVec3::AXES["XYZ".find(axis).unwrap()];
                        match kind {
                            "position" => local.translation += direction * (value - local.translation.dot(direction)),
                            "rotation" => local.matrix3 *= DMat3::from_axis_angle(direction, value.to_radians()),
                            _ => panic!("{kind}"),
                        }
                    }
                    world = Some(parent * local);
                    self.world.push(parent * local);
                }
                "JOINT" => self.joint(world.unwrap()),
                "End" => while self.next() != "}" {},
                "}" => return,
                other => panic!("{other}"),
            }
        }
    }
}

fn world_at(motion: &Motion, frame: usize) -> Vec<Affine3A> {
    let mut world = vec![Affine3A::IDENTITY; motion.skeleton.len()];
    motion.frames[frame].forward_kinematics(&motion.skeleton, &mut world);
    world
}

fn degrees_between(a: DMat3, b: DMat3) -> f64 {
    // The chord is well conditioned near zero, the trace is not.
    let chord: f64 = a.to_cols_array().iter().zip(b.to_cols_array()).map(|(x, y)| (x - y) * (x - y)).sum();
    (2.0 * ((chord / 8.0).sqrt().min(1.0)).asin()).to_degrees()
}

fn double(m: &Affine3A) -> (DMat3, DVec3) {
    (glam::Mat3::from(m.matrix3).as_dmat3(), Vec3::from(m.translation).as_dvec3())
}

#[test]
fn real_motion_agrees_with_naive_kinematics() {
    for (name, bones, frames) in [("mocap/freebvh.bvh", 55, 69), ("mocap/mocapbank.bvh", 19, 455)] {
        let Some(bytes) = shared_bytes(name) else { return };
        let motion = read_bvh(&bytes).unwrap().motion;
        let text = std::str::from_utf8(&bytes).unwrap();
        println!(
            "{name}: {} bones, {} frames of {} s",
            motion.skeleton.len(),
            motion.frames.len(),
            motion.frame_seconds
        );
        assert_eq!((motion.skeleton.len(), motion.frames.len()), (bones, frames), "{name}");
        assert!((motion.frame_seconds - 1.0 / 30.0).abs() < 1e-3);
        for frame in [0, frames / 2, frames - 1] {
            for (ours, naive) in world_at(&motion, frame).iter().zip(Naive::frame(text, frame)) {
                let (turn, place) = double(ours);
                assert!(place.distance(naive.translation) < 1e-3, "{name} {frame}: {place} {}", naive.translation);
                assert!(degrees_between(turn, naive.matrix3) < 1e-4, "{name}, frame {frame}");
            }
        }
    }
}

#[test]
fn real_motion_survives_writing() {
    for name in ["mocap/freebvh.bvh", "mocap/mocapbank.bvh"] {
        let Some(bytes) = shared_bytes(name) else { return };
        let motion = read_bvh(&bytes).unwrap().motion;
        let again = read_bvh(write_bvh(&motion).unwrap().as_bytes()).unwrap().motion;
        assert_eq!(again.skeleton.bones(), motion.skeleton.bones());
        assert_eq!(again.frames.len(), motion.frames.len());
        assert!((again.frame_seconds - motion.frame_seconds).abs() < 1e-12);
        for (a, b) in again.frames.iter().zip(&motion.frames) {
            for (a, b) in a.parent_from_bone.iter().zip(&b.parent_from_bone) {
                assert!(a.translation.distance(b.translation) < 1e-4);
                let (a, b) = (DMat3::from_quat(a.rotation.as_dquat()), DMat3::from_quat(b.rotation.as_dquat()));
                assert!(degrees_between(a, b) < 1e-4, "{}", degrees_between(a, b));
            }
        }
    }
}

/// A small deterministic stream of numbers in -1..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 8_388_608.0 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn rotation(&mut self) -> Quat {
        let mut angle = || self.next() * 3.0;
        Quat::from_euler(EulerRot::XYZ, angle(), angle(), angle())
    }
}

/// Rest rotations everywhere, a hub without length, bones that are not depth first, two roots, awkward names.
fn awkward(noise: &mut Noise, move_bones: bool) -> Motion {
    let parents = [None, Some(0), None, Some(1), Some(0), Some(2), Some(3), Some(4), Some(4)];
    let bones: Vec<Bone> = parents
        .iter()
        .enumerate()
        .map(|(index, &parent)| Bone {
            name: ["a b", "a_b", "{c}", "d\t", "e", "ümlaut", "g:h", "i", ""][index].to_owned(),
            parent,
            rest: Transform {
                translation: if index == 1 { Vec3::ZERO } else { noise.vector() },
                rotation: noise.rotation(),
                scale: Vec3::ONE,
            },
            tail: if index == 1 { Vec3::ZERO } else { noise.vector() },
        })
        .collect();
    let skeleton = Skeleton::new(bones).unwrap();
    let frames = (0..20)
        .map(|_| {
            let mut pose: Pose = skeleton.rest_pose();
            for (local, bone) in pose.parent_from_bone.iter_mut().zip(skeleton.bones()) {
                local.rotation *= noise.rotation();
                if bone.parent.is_none() || move_bones {
                    local.translation += noise.vector();
                }
            }
            pose
        })
        .collect();
    Motion::new(skeleton, 1.0 / 24.0, frames).unwrap()
}

#[test]
fn rest_rotations_are_baked() {
    let mut noise = Noise(7);
    for move_bones in [false, true] {
        let motion = awkward(&mut noise, move_bones);
        let text = write_bvh(&motion).unwrap();
        assert!(text.contains("JOINT e\n\t{\n\t\tOFFSET"), "{text}");
        assert_eq!(text.matches("CHANNELS 6").count(), if move_bones { 9 } else { 2 });
        let again = read_bvh(text.as_bytes()).unwrap().motion;
        assert_eq!(again.skeleton.len(), motion.skeleton.len());
        // Depth first: 0 1 3 6 4 7 8, then 2 5.
        let ours = [0, 1, 3, 6, 4, 7, 8, 2, 5];
        assert_eq!(again.skeleton.bones()[0].name, "a_b");
        assert_eq!(again.skeleton.bones()[1].name, "a_b_2");
        let rest = (motion.skeleton.rest_model_from_bone(), again.skeleton.rest_model_from_bone());
        for frame in 0..motion.frames.len() {
            let (before, after) = (world_at(&motion, frame), world_at(&again, frame));
            for (theirs, &ours) in ours.iter().enumerate() {
                let (a, b) = (double(&before[ours]), double(&after[theirs]));
                assert!(a.1.distance(b.1) < 1e-5, "frame {frame} bone {ours}: {} {}", a.1, b.1);
                // What a limb attached to the bone does: its rotation away from rest.
                let turn_before = a.0 * double(&rest.0[ours]).0.inverse();
                let turn_after = b.0 * double(&rest.1[theirs]).0.inverse();
                assert!(degrees_between(turn_before, turn_after) < 1e-3);
            }
        }
    }
}

#[test]
fn straight_up_is_no_trouble() {
    // The middle angle at ±90°, where two of three angles coincide.
    let bone = |name: &str, parent| Bone {
        name: name.to_owned(),
        parent,
        rest: Transform { translation: Vec3::Y, ..Transform::IDENTITY },
        tail: Vec3::Y,
    };
    let skeleton = Skeleton::new(vec![bone("a", None), bone("b", Some(0))]).unwrap();
    let turns = [(90.0_f32, 30.0_f32), (-90.0, -40.0), (90.0, 0.0), (89.9999, 170.0)];
    let frames: Vec<Pose> = turns
        .iter()
        .map(|(x, y)| {
            let mut pose = skeleton.rest_pose();
            pose.parent_from_bone[0].rotation =
                Quat::from_rotation_x(x.to_radians()) * Quat::from_rotation_y(y.to_radians());
            pose.parent_from_bone[1].rotation = pose.parent_from_bone[0].rotation;
            pose
        })
        .collect();
    let motion = Motion::new(skeleton, 0.1, frames).unwrap();
    let again = read_bvh(write_bvh(&motion).unwrap().as_bytes()).unwrap().motion;
    for (a, b) in motion.frames.iter().zip(&again.frames) {
        for (a, b) in a.parent_from_bone.iter().zip(&b.parent_from_bone) {
            let (a, b) = (DMat3::from_quat(a.rotation.as_dquat()), DMat3::from_quat(b.rotation.as_dquat()));
            assert!(degrees_between(a, b) < 1e-4, "{}", degrees_between(a, b));
        }
    }
}
