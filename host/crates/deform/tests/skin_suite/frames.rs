//! Linear blending and dual quaternions.

use glam::{Affine3A, DMat3, DVec3, Vec3};

use super::character::influences;
use super::formulas::{dual_quaternion_blend, linear_blend, rigid_terms};
use super::{Character, Dice, Evaluator, Method, Poses, apart, wide};

/// Half the diagonal of the bounding box of some points.
fn size(points: impl Iterator<Item = DVec3>) -> f64 {
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    0.5 * low.distance(high)
}

pub(crate) fn linear_blending_agrees_with_the_formula(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(4);
    for per_vertex in [1, 2, 4, 8] {
        let mut character = Character::new(2000, 17, per_vertex, dice);
        let pose: Vec<Affine3A> = (0..17).map(|_| dice.rigid()).collect();
        let model = size(character.positions.iter().map(|p| wide(*p)));
        let (positions, _) = evaluator.one(&character, Method::LinearBlend, &Poses::Frames(pose.clone()));
        for (vertex, position) in positions.iter().enumerate() {
            let off = apart(*position, linear_blend(&character, &pose, vertex).0) / model;
            assert!(off < evaluator.bound(1e-6), "{off}");
        }
        character.frames = (0..17).map(|_| dice.frame()).collect();
        let pose: Vec<Affine3A> = (0..17).map(|_| dice.frame()).collect();
        let (positions, normals) = evaluator.one(&character, Method::LinearBlend, &Poses::Frames(pose.clone()));
        let expected: Vec<(DVec3, DMat3)> = (0..2000).map(|vertex| linear_blend(&character, &pose, vertex)).collect();
        let posed = size(expected.iter().map(|e| e.0));
        for (vertex, (moved, blended)) in expected.into_iter().enumerate() {
            // These bones scale and shear by up to four, and the terms they blend are up to ten times the result.
            assert!(apart(positions[vertex], moved) < evaluator.bound(1e-5) * posed);
            let n = wide(character.normals[vertex]);
            let turned = (blended.inverse().transpose() * n * blended.determinant().signum()).normalize();
            // Close to a fold the blended matrix is nearly singular and f32 determines little.
            if apart(normals[vertex], turned) > 1e-3 {
                let size = blended.to_cols_array().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                assert!(blended.determinant().abs() < 1e-3 * size.powi(3), "vertex {vertex} of {per_vertex}");
            }
        }
    }
}

pub(crate) fn linear_blending_turns_normals_as_moved_triangles_do(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(3);
    for round in 0..50 {
        let corners = [dice.vector(), dice.vector(), dice.vector()];
        let normal = |c: [Vec3; 3]| (c[1] - c[0]).cross(c[2] - c[0]).normalize();
        let mut map = dice.frame();
        if round % 2 == 1 {
            map.matrix3.x_axis = -map.matrix3.x_axis;
        }
        let triangle = Character {
            positions: corners.map(Into::into).to_vec(),
            normals: vec![normal(corners).to_array(); 3],
            influences: influences(1, vec![0; 3], vec![1.0; 3], 1),
            frames: vec![Affine3A::IDENTITY],
            ..Character::new(3, 1, 1, dice)
        };
        let (positions, normals) = evaluator.one(&triangle, Method::LinearBlend, &Poses::Frames(vec![map]));
        let moved = normal([positions[0].into(), positions[1].into(), positions[2].into()]);
        assert!(apart(normals[0], moved.as_dvec3()) < 1e-3, "round {round}: {moved} and {:?}", normals[0]);
    }
}

pub(crate) fn flattened_surfaces_keep_their_rest_normals(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(6);
    let mut character = Character::new(300, 5, 3, dice);
    character.frames = (0..5).map(|_| dice.frame()).collect();
    for scale in [Vec3::ZERO, Vec3::new(1e-30, 1e-30, 1e-30), Vec3::new(0.0, 0.0, 1.0), Vec3::splat(1e30)] {
        let pose = character.frames.iter().map(|r| Affine3A::from_scale(scale) * *r).collect();
        let (positions, normals) = evaluator.one(&character, Method::LinearBlend, &Poses::Frames(pose));
        assert!(positions.iter().flatten().all(|c| c.is_finite()));
        for (normal, rest) in normals.iter().zip(&character.normals) {
            assert!((Vec3::from(*normal).length() - 1.0).abs() < 1e-5);
            if scale == Vec3::ZERO {
                assert!(apart(*normal, wide(*rest)) < 1e-6);
            }
        }
    }
    // Half a turn apart and equal weights: the map collapses to the twist axis.
    let two = Character {
        positions: vec![[1.0, 0.0, 0.0]],
        normals: vec![[1.0, 0.0, 0.0]],
        influences: influences(2, vec![0, 1], vec![0.5, 0.5], 2),
        frames: vec![Affine3A::IDENTITY; 2],
        ..Character::new(1, 2, 2, dice)
    };
    let pose = vec![Affine3A::IDENTITY, Affine3A::from_rotation_y(std::f32::consts::PI)];
    assert_eq!(evaluator.one(&two, Method::LinearBlend, &Poses::Frames(pose)).1, [[1.0, 0.0, 0.0]]);
}

pub(crate) fn dual_quaternions_agree_with_the_formula(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(5);
    let near = evaluator.bound(1e-5);
    for (vertices, per_vertex) in [(2000, 1), (1003, 2), (2001, 4), (500, 8)] {
        let character = Character::new(vertices, 17, per_vertex, dice);
        let pose: Vec<Affine3A> = (0..17).map(|_| dice.rigid()).collect();
        let (positions, normals) = evaluator.one(&character, Method::DualQuaternion, &Poses::Frames(pose.clone()));
        for vertex in 0..vertices {
            let (turn, shift) = dual_quaternion_blend(&rigid_terms(&character, &pose, vertex));
            let off = apart(positions[vertex], turn * wide(character.positions[vertex]) + shift);
            assert!(off < near, "vertex {vertex} of {per_vertex}: {off}");
            assert!(apart(normals[vertex], turn * wide(character.normals[vertex])) < near);
        }
    }
}

pub(crate) fn a_twisted_joint_keeps_its_girth(evaluator: &mut dyn Evaluator) {
    // Between two bones twisted by nearly half a turn, where linear blending would collapse to the axis.
    let character = Character {
        positions: vec![[1.0, 0.0, 0.0], [0.0, 3.0, 1.0]],
        normals: vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        influences: influences(2, vec![0, 1, 0, 1], vec![0.5; 4], 2),
        frames: vec![Affine3A::IDENTITY; 2],
        ..Character::new(2, 2, 2, &mut Dice(10))
    };
    let near = evaluator.bound(1e-6);
    for angle in [0.5_f32, 2.0, 3.0, -3.0] {
        let pose = vec![Affine3A::IDENTITY, Affine3A::from_rotation_y(angle)];
        let (positions, normals) = evaluator.one(&character, Method::DualQuaternion, &Poses::Frames(pose));
        let half = Affine3A::from_rotation_y(0.5 * angle);
        for vertex in 0..2 {
            let expected = half.transform_point3(character.positions[vertex].into());
            assert!(apart(positions[vertex], expected.as_dvec3()) < near);
            let expected = half.transform_vector3(character.normals[vertex].into());
            assert!(apart(normals[vertex], expected.as_dvec3()) < near);
        }
    }
}

pub(crate) fn scale_is_ignored_by_dual_quaternions_but_origins_are_followed(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(6);
    let character = Character::new(64, 3, 1, dice);
    let motions: Vec<Affine3A> = (0..3).map(|_| dice.rigid()).collect();
    let scaled = |by: f32| Poses::Frames(motions.iter().map(|m| *m * Affine3A::from_scale(Vec3::splat(by))).collect());
    let expected = evaluator.one(&character, Method::DualQuaternion, &scaled(1.0));
    let got = evaluator.one(&character, Method::DualQuaternion, &scaled(2.5));
    for vertex in 0..64 {
        assert!(apart(got.0[vertex], wide(expected.0[vertex])) < evaluator.bound(1e-5));
        assert!(apart(got.1[vertex], wide(expected.1[vertex])) < evaluator.bound(1e-5));
    }
    let collapsed = evaluator.one(&character, Method::DualQuaternion, &scaled(0.0));
    assert!(collapsed.0.iter().flatten().all(|c| c.is_finite()));
}
