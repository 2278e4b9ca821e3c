//! Promises of every method.

use armature_deform::skin::SkinError;
use glam::{Affine3A, Vec3};

use super::{Character, Dice, Evaluator, METHODS, Method, Poses, Rest, apart, rigid_pose};

pub(crate) fn the_rest_pose_returns_the_rest_shape(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(1);
    for method in METHODS {
        let near = evaluator.bound(if method == Method::LinearBlend { 1e-6 } else { 1e-5 });
        for vertices in [0, 1, 7, 8, 9, 1003] {
            let mut character = Character::new(vertices, 11, 4, dice);
            if method == Method::LinearBlend {
                character.frames = (0..11).map(|_| dice.frame()).collect();
            }
            let (positions, normals) = one_or_none(evaluator, &character, method, Affine3A::IDENTITY);
            for vertex in 0..vertices {
                let (position, normal) = (character.positions[vertex], character.normals[vertex]);
                assert!(apart(positions[vertex], Vec3::from(position).as_dvec3()) < near, "{method:?} {vertex}");
                assert!(apart(normals[vertex], Vec3::from(normal).as_dvec3()) < near, "{method:?} {vertex}");
            }
        }
    }
}

/// Without vertices an evaluator may have no poses to show.
fn one_or_none(
    evaluator: &mut dyn Evaluator,
    character: &Character,
    method: Method,
    motion: Affine3A,
) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let poses = rigid_pose(character, method, motion);
    evaluator.skin(character.rest(), method, &poses).expect("a sound character").pop().unwrap_or_default()
}

pub(crate) fn a_rigid_motion_of_all_bones_moves_everything_rigidly(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(2);
    for method in METHODS {
        let near = evaluator.bound(if method == Method::LinearBlend { 3e-6 } else { 1e-5 });
        let character = Character::new(500, 9, 4, dice);
        for motion in [dice.rigid(), dice.rigid()] {
            let (positions, normals) = evaluator.one(&character, method, &rigid_pose(&character, method, motion));
            for vertex in 0..500 {
                let expected = motion.transform_point3(character.positions[vertex].into());
                assert!(apart(positions[vertex], expected.as_dvec3()) < near, "{method:?}");
                let expected = motion.transform_vector3(character.normals[vertex].into());
                assert!(apart(normals[vertex], expected.as_dvec3()) < near, "{method:?}");
            }
        }
    }
}

pub(crate) fn a_vertex_without_a_normal_stays_without_one(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(8);
    for method in METHODS {
        let mut character = Character::new(10, 5, 2, dice);
        character.normals[3] = [0.0; 3];
        let (_, normals) = evaluator.one(&character, method, &rigid_pose(&character, method, dice.rigid()));
        assert_eq!(normals[3].map(f32::to_bits), [0; 3], "{method:?}");
    }
}

pub(crate) fn what_cannot_be_skinned_is_named(evaluator: &mut dyn Evaluator) {
    let character = Character::new(20, 3, 2, &mut Dice(7));
    let rest = character.rest();
    let mut refused = |rest: Rest<'_>, method: Method| {
        let poses = rigid_pose(&character, method, Affine3A::IDENTITY);
        evaluator.skin(rest, method, &poses).expect_err("it is wrong")
    };
    for method in METHODS {
        let few = Rest { frames: &rest.frames[..2], segments: &rest.segments[..2], ..rest };
        assert!(matches!(refused(few, method), SkinError::BoneOutOfRange { bone: 2, bone_count: 2, .. }));
        let short = Rest { normals: &rest.normals[..19], ..rest };
        assert!(matches!(refused(short, method), SkinError::Length { what: "rest normals", got: 19, expected: 20 }));
        let mut normals = character.normals.clone();
        normals[4][1] = f32::INFINITY;
        let holed = Rest { normals: &normals, ..rest };
        assert_eq!(refused(holed, method), SkinError::VertexNotFinite { vertex: 4 });
        let (mut frames, mut segments) = (character.frames.clone(), character.segments.clone());
        frames[1] = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        segments[1].end.x = f32::NAN;
        let flat = Rest { frames: &frames, segments: &segments, ..rest };
        assert_eq!(refused(flat, method), SkinError::RestNotInvertible { bone: 1 });
        if let Method::StretchTwist(_) = method {
            let short = Rest { ends: &rest.ends[1..], ..rest };
            assert!(matches!(refused(short, method), SkinError::Length { what: "end weights", .. }));
            let mut ends = character.ends.clone();
            ends[7] = f32::NAN;
            assert_eq!(refused(Rest { ends: &ends, ..rest }, method), SkinError::VertexNotFinite { vertex: 3 });
        }
    }
}

pub(crate) fn poses_that_are_not_finite_are_named(evaluator: &mut dyn Evaluator) {
    let character = Character::new(20, 3, 2, &mut Dice(9));
    for method in METHODS {
        let good = rigid_pose(&character, method, Affine3A::IDENTITY);
        let mut twice = good.clone();
        match (&mut twice, &good) {
            (Poses::Frames(twice), Poses::Frames(good)) => {
                twice.extend(good);
                twice[5].translation.y = f32::NAN;
            }
            (Poses::Stretched(twice), Poses::Stretched(good)) => {
                twice.extend(good);
                twice[5].twist[1] = f32::NAN;
            }
            _ => unreachable!("a clone is of its kind"),
        }
        let refused = evaluator.skin(character.rest(), method, &twice).expect_err("the last bone of the second pose");
        assert_eq!(refused, SkinError::PoseNotFinite { bone: 2 }, "{method:?}");
        let mut short = good.clone();
        match &mut short {
            Poses::Frames(frames) => frames.truncate(2),
            Poses::Stretched(poses) => poses.truncate(2),
        }
        let refused = evaluator.skin(character.rest(), method, &short).expect_err("a bone is missing");
        assert_eq!(refused, SkinError::Length { what: "posed bones", got: 2, expected: 3 }, "{method:?}");
    }
    let mut pose = super::stretched_pose(3, 1.0, 0.5, &mut Dice(3));
    pose[2].turn = glam::Quat::from_array([0.0; 4]);
    for method in &METHODS[2..] {
        let refused = evaluator.skin(character.rest(), *method, &Poses::Stretched(pose.clone()));
        assert_eq!(refused.expect_err("no rotation"), SkinError::PoseNotFinite { bone: 2 });
    }
}
