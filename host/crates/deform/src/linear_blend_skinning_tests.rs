use glam::{DMat3, Mat3, Quat, Vec3};

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

    fn rotation(&mut self) -> Quat {
        Quat::from_xyzw(self.roll(), self.roll(), self.roll(), self.roll()).normalize()
    }

    fn frame(&mut self) -> Affine3A {
        let scale = Vec3::splat(1.2) + 0.7 * self.vector();
        let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.3 * self.roll(), 1.0, 0.0), Vec3::Z);
        Affine3A::from_mat3_translation(
            Mat3::from_quat(self.rotation()) * Mat3::from_diagonal(scale) * shear,
            3.0 * self.vector(),
        )
    }
}

struct Scene {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    influences: Influences,
    rest: Vec<Affine3A>,
}

fn scene(vertex_count: usize, bone_count: usize, per_vertex: usize, dice: &mut Dice) -> Scene {
    let mut bones = Vec::new();
    let mut weights = Vec::new();
    for vertex in 0..vertex_count {
        for slot in 0..per_vertex {
            bones.push(((vertex * 7 + slot * 3) % bone_count) as u16);
            // Some slots stay empty, the first never.
            let weight = dice.roll();
            weights.push(if slot == 0 { 1.1 + weight } else { weight.max(0.0) });
        }
    }
    Scene {
        positions: (0..vertex_count).map(|_| dice.vector().to_array()).collect(),
        normals: (0..vertex_count).map(|_| (dice.rotation() * Vec3::Y).to_array()).collect(),
        influences: Influences::new(per_vertex, bones, weights, bone_count).unwrap(),
        rest: (0..bone_count).map(|_| dice.frame()).collect(),
    }
}

impl Scene {
    fn skin(&self, pose: &[Affine3A]) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let mut skin =
            LinearBlendSkin::precompute(&self.positions, &self.normals, &self.influences, &self.rest).unwrap();
        let mut positions = vec![[f32::NAN; 3]; self.positions.len()];
        let mut normals = positions.clone();
        skin.solve(pose, &mut positions, &mut normals).unwrap();
        (positions, normals)
    }

    /// The formula, word for word, in f64, with an explicit inverse transpose.
    fn naive(&self, pose: &[Affine3A]) -> (Vec<DVec3>, Vec<DVec3>) {
        let maps: Vec<DAffine3> = pose.iter().zip(&self.rest).map(|(p, r)| widen(p) * widen(r).inverse()).collect();
        let mut positions = Vec::new();
        let mut normals = Vec::new();
        for vertex in 0..self.positions.len() {
            let p = Vec3::from(self.positions[vertex]).as_dvec3();
            let mut moved = DVec3::ZERO;
            let mut blended = DMat3::ZERO;
            for (bone, weight) in self.influences.of_vertex(vertex) {
                moved += f64::from(weight) * maps[usize::from(bone)].transform_point3(p);
                blended += maps[usize::from(bone)].matrix3 * f64::from(weight);
            }
            let n = Vec3::from(self.normals[vertex]).as_dvec3();
            let turned = blended.inverse().transpose() * n * blended.determinant().signum();
            positions.push(moved);
            normals.push(turned.normalize());
        }
        (positions, normals)
    }
}

fn distance(a: [f32; 3], b: DVec3) -> f64 {
    Vec3::from(a).as_dvec3().distance(b)
}

#[test]
fn the_rest_pose_returns_the_rest_shape() {
    let dice = &mut Dice(1);
    for vertex_count in [0, 1, 7, 8, 9, 1003] {
        let scene = scene(vertex_count, 11, 4, dice);
        let (positions, normals) = scene.skin(&scene.rest);
        for vertex in 0..vertex_count {
            assert!(Vec3::from(positions[vertex]).distance(scene.positions[vertex].into()) < 1e-6);
            assert!(Vec3::from(normals[vertex]).distance(scene.normals[vertex].into()) < 1e-6);
        }
    }
}

#[test]
fn a_rigid_motion_of_all_bones_moves_everything_rigidly() {
    let dice = &mut Dice(2);
    let scene = scene(500, 9, 4, dice);
    let motion = Affine3A::from_rotation_translation(dice.rotation(), dice.vector());
    let pose: Vec<Affine3A> = scene.rest.iter().map(|rest| motion * *rest).collect();
    let (positions, normals) = scene.skin(&pose);
    for vertex in 0..positions.len() {
        let expected = motion.transform_point3(scene.positions[vertex].into());
        assert!(expected.distance(positions[vertex].into()) < 3e-6);
        let expected = motion.transform_vector3(scene.normals[vertex].into());
        assert!(expected.distance(normals[vertex].into()) < 3e-6);
    }
}

#[test]
fn normals_of_an_affine_map_are_those_of_the_moved_triangles() {
    let dice = &mut Dice(3);
    for round in 0..50 {
        let corners = [dice.vector(), dice.vector(), dice.vector()];
        let normal = |c: [Vec3; 3]| (c[1] - c[0]).cross(c[2] - c[0]).normalize();
        let mut map = dice.frame();
        if round % 2 == 1 {
            map.matrix3.x_axis = -map.matrix3.x_axis;
        }
        let scene = Scene {
            positions: corners.map(Into::into).to_vec(),
            normals: vec![normal(corners).to_array(); 3],
            influences: Influences::new(1, vec![0; 3], vec![1.0; 3], 1).unwrap(),
            rest: vec![Affine3A::IDENTITY],
        };
        let (positions, normals) = scene.skin(&[map]);
        let moved = normal([positions[0].into(), positions[1].into(), positions[2].into()]);
        assert!(moved.distance(normals[0].into()) < 1e-3, "round {round}: {moved} and {:?}", normals[0]);
    }
}

/// Half the diagonal of the box around some points.
fn size(points: impl Iterator<Item = DVec3> + Clone) -> f64 {
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    0.5 * low.distance(high)
}

#[test]
fn rigid_bones_agree_with_the_formula_to_a_part_of_the_model() {
    let dice = &mut Dice(14);
    for per_vertex in [1, 2, 4, 8] {
        let mut scene = scene(2000, 17, per_vertex, dice);
        let mut rigid =
            || (0..17).map(|_| Affine3A::from_rotation_translation(dice.rotation(), dice.vector())).collect();
        scene.rest = rigid();
        let pose: Vec<Affine3A> = rigid();
        let model = size(scene.positions.iter().map(|p| Vec3::from(*p).as_dvec3()));
        let (positions, _) = scene.skin(&pose);
        for (position, expected) in positions.iter().zip(scene.naive(&pose).0) {
            assert!(distance(*position, expected) < 1e-6 * model, "{}", distance(*position, expected) / model);
        }
    }
}

#[test]
fn agrees_with_the_naive_formula() {
    let dice = &mut Dice(4);
    for per_vertex in [1, 2, 4, 8] {
        let scene = scene(2000, 17, per_vertex, dice);
        let pose: Vec<Affine3A> = (0..17).map(|_| dice.frame()).collect();
        let (positions, normals) = scene.skin(&pose);
        let (expected_positions, expected_normals) = scene.naive(&pose);
        let posed = size(expected_positions.iter().copied());
        for vertex in 0..positions.len() {
            // These bones scale and shear by up to four, and what they blend is up to ten times the result.
            assert!(distance(positions[vertex], expected_positions[vertex]) < 1e-5 * posed);
            // Close to a fold the blended matrix is nearly singular and f32 decides little.
            if distance(normals[vertex], expected_normals[vertex]) > 1e-3 {
                let blended = scene.influences.of_vertex(vertex).fold(DMat3::ZERO, |sum, (bone, weight)| {
                    let map = widen(&pose[usize::from(bone)]) * widen(&scene.rest[usize::from(bone)]).inverse();
                    sum + map.matrix3 * f64::from(weight)
                });
                let size = blended.to_cols_array().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                assert!(blended.determinant().abs() < 1e-3 * size.powi(3), "vertex {vertex} of {per_vertex}");
            }
        }
    }
}

#[test]
fn many_vertices_give_the_same_as_few() {
    let dice = &mut Dice(5);
    let big = scene(crate::in_chunks::PARALLEL_FROM + 1234, 13, 4, dice);
    let pose: Vec<Affine3A> = (0..13).map(|_| dice.frame()).collect();
    let (positions, normals) = big.skin(&pose);
    let cut = 1000;
    let take = cut * 4;
    let small = Scene {
        positions: big.positions[..cut].to_vec(),
        normals: big.normals[..cut].to_vec(),
        influences: Influences::new(
            4,
            big.influences.bones()[..take].to_vec(),
            big.influences.weights()[..take].to_vec(),
            13,
        )
        .unwrap(),
        rest: big.rest.clone(),
    };
    let (few_positions, few_normals) = small.skin(&pose);
    for vertex in 0..cut {
        // Influences::new normalises again, which may turn the last bit of a weight.
        assert!(Vec3::from(positions[vertex]).distance(few_positions[vertex].into()) < 1e-5);
        assert!(Vec3::from(normals[vertex]).distance(few_normals[vertex].into()) < 1e-3);
    }
    assert_eq!(big.skin(&pose), (positions, normals));
}

#[test]
fn flattened_surfaces_keep_their_rest_normals() {
    let dice = &mut Dice(6);
    let scene = scene(300, 5, 3, dice);
    for scale in [Vec3::ZERO, Vec3::new(1e-30, 1e-30, 1e-30), Vec3::new(0.0, 0.0, 1.0), Vec3::splat(1e30)] {
        let pose: Vec<Affine3A> = scene.rest.iter().map(|r| Affine3A::from_scale(scale) * *r).collect();
        let (positions, normals) = scene.skin(&pose);
        assert!(positions.iter().flatten().all(|c| c.is_finite()));
        for (normal, rest) in normals.iter().zip(&scene.normals) {
            assert!((Vec3::from(*normal).length() - 1.0).abs() < 1e-5);
            if scale == Vec3::ZERO {
                assert!(Vec3::from(*normal).distance(Vec3::from(*rest)) < 1e-6);
            }
        }
    }
    // Half a turn apart and equal weights: the map collapses to the twist axis.
    let two = Scene {
        positions: vec![[1.0, 0.0, 0.0]],
        normals: vec![[1.0, 0.0, 0.0]],
        influences: Influences::new(2, vec![0, 1], vec![0.5, 0.5], 2).unwrap(),
        rest: vec![Affine3A::IDENTITY; 2],
    };
    let (_, normals) = two.skin(&[Affine3A::IDENTITY, Affine3A::from_rotation_y(std::f32::consts::PI)]);
    assert_eq!(normals, [[1.0, 0.0, 0.0]]);
}

#[test]
fn nonsense_is_named() {
    let dice = &mut Dice(7);
    let good = scene(20, 3, 2, dice);
    let precompute = |s: &Scene| LinearBlendSkin::precompute(&s.positions, &s.normals, &s.influences, &s.rest);
    let mut bad = Scene { rest: good.rest[..2].to_vec(), ..scene(20, 3, 2, dice) };
    assert!(matches!(precompute(&bad), Err(SkinError::BoneOutOfRange { bone: 2, bone_count: 2, .. })));
    bad.rest = good.rest.clone();
    bad.rest[1] = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    assert_eq!(precompute(&bad).unwrap_err(), SkinError::RestNotInvertible { bone: 1 });
    bad.rest = good.rest.clone();
    bad.normals[4][1] = f32::INFINITY;
    assert_eq!(precompute(&bad).unwrap_err(), SkinError::VertexNotFinite { vertex: 4 });
    bad.normals.pop();
    assert!(matches!(precompute(&bad), Err(SkinError::Length { what: "rest normals", got: 19, expected: 20 })));

    let mut skin = precompute(&good).unwrap();
    let mut room = (vec![[9.0; 3]; 20], vec![[9.0; 3]; 20]);
    let mut pose = good.rest.clone();
    pose[2].translation.y = f32::NAN;
    assert_eq!(skin.solve(&pose, &mut room.0, &mut room.1), Err(SkinError::PoseNotFinite { bone: 2 }));
    assert_eq!(room.0, [[9.0; 3]; 20]);
    assert!(matches!(skin.solve(&pose[..1], &mut room.0, &mut room.1), Err(SkinError::Length { .. })));
    assert!(matches!(skin.solve(&good.rest, &mut room.0[..3], &mut room.1), Err(SkinError::Length { .. })));
}

#[test]
fn a_vertex_without_a_normal_stays_without_one() {
    let scene = Scene {
        positions: vec![[1.0, 2.0, 3.0]],
        normals: vec![[0.0; 3]],
        influences: Influences::new(1, vec![0], vec![1.0], 1).unwrap(),
        rest: vec![Affine3A::IDENTITY],
    };
    assert_eq!(scene.skin(&[Affine3A::from_rotation_x(1.0)]).1, [[0.0; 3]]);
}
