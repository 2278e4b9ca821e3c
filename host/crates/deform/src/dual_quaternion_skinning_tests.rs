use glam::{Quat, Vec3};

use super::*;

/// Numbers in [-1, 1), the same in every run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 / (1 << 23) as f32) - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.roll(), self.roll(), self.roll())
    }

    fn motion(&mut self) -> Affine3A {
        let turn = Quat::from_xyzw(self.roll(), self.roll(), self.roll(), self.roll()).normalize();
        Affine3A::from_rotation_translation(turn, 2.0 * self.vector())
    }
}

struct Scene {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    influences: Influences,
    rest: Vec<Affine3A>,
}

fn scene(vertex_count: usize, bone_count: usize, per_vertex: usize, dice: &mut Dice) -> Scene {
    let slots = vertex_count * per_vertex;
    let bones = (0..slots).map(|i| ((i / per_vertex * 7 + i % per_vertex * 3) % bone_count) as u16).collect();
    let weights = (0..slots).map(|i| if i % per_vertex == 0 { 1.1 + dice.roll() } else { dice.roll().max(0.0) });
    Scene {
        influences: Influences::new(per_vertex, bones, weights.collect(), bone_count).unwrap(),
        positions: (0..vertex_count).map(|_| dice.vector().to_array()).collect(),
        normals: (0..vertex_count).map(|_| dice.motion().transform_vector3(Vec3::Y).to_array()).collect(),
        rest: (0..bone_count).map(|_| dice.motion()).collect(),
    }
}

impl Scene {
    fn skin(&self, pose: &[Affine3A]) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let mut skin =
            DualQuaternionSkin::precompute(&self.positions, &self.normals, &self.influences, &self.rest).unwrap();
        let mut out = (vec![[f32::NAN; 3]; self.positions.len()], vec![[f32::NAN; 3]; self.positions.len()]);
        skin.solve(pose, &mut out.0, &mut out.1).unwrap();
        out
    }
}

/// The rigid motion that the formula gives a vertex, in f64: blended `q` and `½ t q`, divided by the length of the
/// real part.
fn naive(scene: &Scene, pose: &[Affine3A], vertex: usize) -> (DQuat, DVec3) {
    let parts = |bone: u16| {
        let moved = widen(&pose[usize::from(bone)]) * widen(&scene.rest[usize::from(bone)]).inverse();
        let real = DQuat::from_mat3(&moved.matrix3).normalize();
        (real, DQuat::from_vec4(moved.translation.extend(0.0)) * real * 0.5)
    };
    let (pivot, _) = parts(scene.influences.of_vertex(vertex).next().unwrap().0);
    let (mut real, mut dual) = (DQuat::from_array([0.0; 4]), DQuat::from_array([0.0; 4]));
    for (bone, weight) in scene.influences.of_vertex(vertex) {
        let (r, d) = parts(bone);
        let weight = f64::from(weight) * if r.dot(pivot) < 0.0 { -1.0 } else { 1.0 };
        (real, dual) = (real + r * weight, dual + d * weight);
    }
    let length = real.length();
    let (real, dual) = (real * (1.0 / length), dual * (1.0 / length));
    let shift = dual * 2.0 * real.conjugate();
    (real, DVec3::new(shift.x, shift.y, shift.z))
}

#[test]
fn agrees_with_the_formula_in_f64() {
    let dice = &mut Dice(4);
    for (vertex_count, per_vertex) in [(2000, 1), (1003, 2), (2001, 4), (500, 8)] {
        let scene = scene(vertex_count, 17, per_vertex, dice);
        let pose: Vec<Affine3A> = (0..17).map(|_| dice.motion()).collect();
        let (positions, normals) = scene.skin(&pose);
        for vertex in 0..vertex_count {
            let (turn, shift) = naive(&scene, &pose, vertex);
            let at = turn * Vec3::from(scene.positions[vertex]).as_dvec3() + shift;
            let off = at.distance(Vec3::from(positions[vertex]).as_dvec3());
            assert!(off < 1e-5, "vertex {vertex} of {per_vertex}: {off}");
            let normal = turn * Vec3::from(scene.normals[vertex]).as_dvec3();
            assert!(normal.distance(Vec3::from(normals[vertex]).as_dvec3()) < 1e-5);
        }
    }
}

#[test]
fn the_rest_pose_and_rigid_motions_are_reproduced() {
    let dice = &mut Dice(5);
    let scene = scene(500, 9, 4, dice);
    for motion in [Affine3A::IDENTITY, dice.motion(), dice.motion()] {
        let pose: Vec<Affine3A> = scene.rest.iter().map(|rest| motion * *rest).collect();
        let (positions, normals) = scene.skin(&pose);
        for vertex in 0..positions.len() {
            let expected = motion.transform_point3(scene.positions[vertex].into());
            assert!(expected.distance(positions[vertex].into()) < 1e-5);
            let expected = motion.transform_vector3(scene.normals[vertex].into());
            assert!(expected.distance(normals[vertex].into()) < 1e-5);
        }
    }
}

#[test]
fn a_twisted_joint_keeps_its_girth() {
    // Between two bones twisted by nearly half a turn, where linear blending would collapse to the axis.
    let scene = Scene {
        positions: vec![[1.0, 0.0, 0.0], [0.0, 3.0, 1.0]],
        normals: vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        influences: Influences::new(2, vec![0, 1, 0, 1], vec![0.5; 4], 2).unwrap(),
        rest: vec![Affine3A::IDENTITY; 2],
    };
    for angle in [0.5_f32, 2.0, 3.0, -3.0] {
        let (positions, normals) = scene.skin(&[Affine3A::IDENTITY, Affine3A::from_rotation_y(angle)]);
        let half = Affine3A::from_rotation_y(0.5 * angle);
        for vertex in 0..2 {
            let expected = half.transform_point3(scene.positions[vertex].into());
            assert!(expected.distance(positions[vertex].into()) < 1e-6);
            assert!(half.transform_vector3(scene.normals[vertex].into()).distance(normals[vertex].into()) < 1e-6);
        }
    }
}

#[test]
fn scale_is_ignored_but_origins_are_followed() {
    let dice = &mut Dice(6);
    let scene = scene(64, 3, 1, dice);
    let motions: Vec<Affine3A> = (0..3).map(|_| dice.motion()).collect();
    let scaled: Vec<Affine3A> = motions.iter().map(|m| *m * Affine3A::from_scale(Vec3::splat(2.5))).collect();
    let (expected, got) = (scene.skin(&motions), scene.skin(&scaled));
    for vertex in 0..64 {
        assert!(Vec3::from(expected.0[vertex]).distance(got.0[vertex].into()) < 1e-5);
        assert!(Vec3::from(expected.1[vertex]).distance(got.1[vertex].into()) < 1e-5);
    }
    let collapsed: Vec<Affine3A> = motions.iter().map(|m| *m * Affine3A::from_scale(Vec3::ZERO)).collect();
    assert!(scene.skin(&collapsed).0.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn many_vertices_give_the_same_as_few_and_nonsense_is_named() {
    let dice = &mut Dice(7);
    let big = scene(crate::in_chunks::PARALLEL_FROM + 1234, 13, 4, dice);
    let pose: Vec<Affine3A> = (0..13).map(|_| dice.motion()).collect();
    let mut skin = DualQuaternionSkin::precompute(&big.positions, &big.normals, &big.influences, &big.rest).unwrap();
    let count = big.positions.len();
    let (mut positions, mut normals) = (vec![[9.0; 3]; count], vec![[9.0; 3]; count]);
    let mut bad = pose.clone();
    bad[11].translation.y = f32::INFINITY;
    assert_eq!(skin.solve(&bad, &mut positions, &mut normals), Err(SkinError::PoseNotFinite { bone: 11 }));
    assert!(positions.iter().flatten().all(|c| c.to_bits() == 9.0_f32.to_bits()));
    assert!(matches!(skin.solve(&pose[1..], &mut positions, &mut normals), Err(SkinError::Length { .. })));
    skin.solve(&pose, &mut positions, &mut normals).unwrap();
    assert_eq!(big.skin(&pose), (positions.clone(), normals));
    for vertex in [0, 1, 4095, 4096, count - 1] {
        let (turn, shift) = naive(&big, &pose, vertex);
        let at = turn * Vec3::from(big.positions[vertex]).as_dvec3() + shift;
        assert!(at.distance(Vec3::from(positions[vertex]).as_dvec3()) < 1e-5);
    }
}
