use super::*;
use crate::nearest_rotation::LANES;
use crate::widest::{EightKernel, with_eight};
use crate::{DualQuaternionSkin, LinearBlendSkin};

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

    fn turn(&mut self) -> Quat {
        Quat::from_xyzw(self.roll(), self.roll(), self.roll(), self.roll()).normalize()
    }
}

struct Scene {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    influences: Influences,
    ends: Vec<f32>,
    rest: Vec<BoneSegment>,
}

fn scene(count: usize, dice: &mut Dice) -> Scene {
    let bones = (0..4 * count).map(|i| ((i / 4 * 7 + i % 4 * 3) % 9) as u16).collect();
    let weights = (0..4 * count).map(|i| if i % 4 == 0 { 1.1 } else { dice.roll().max(0.0) }).collect();
    Scene {
        influences: Influences::new(4, bones, weights, 9).unwrap(),
        ends: (0..4 * count).map(|_| 0.5 + 0.5 * dice.roll()).collect(),
        positions: (0..count).map(|_| dice.vector().to_array()).collect(),
        normals: (0..count).map(|_| (dice.turn() * Vec3::X).to_array()).collect(),
        rest: (0..9).map(|_| BoneSegment { start: dice.vector(), end: dice.vector() }).collect(),
    }
}

/// Neighbours follow the same bones, as they do on a character.
fn scene_in_order(count: usize, dice: &mut Dice) -> Scene {
    let bones = (0..4 * count).map(|i| ((i / 4 * 9 / count + i % 4) % 9) as u16).collect();
    let weights = (0..4 * count).map(|_| dice.roll().abs()).collect();
    Scene { influences: Influences::new(4, bones, weights, 9).unwrap(), ..scene(count, dice) }
}

type Arrays = (Vec<[f32; 3]>, Vec<[f32; 3]>);

impl Scene {
    fn skin(&self, pose: &[StretchTwist], blend: BoneBlend) -> Arrays {
        let (positions, normals) = (&self.positions, &self.normals);
        let mut skin =
            StretchTwistSkin::precompute(positions, normals, &self.influences, &self.ends, &self.rest, blend).unwrap();
        let mut out = (vec![[f32::NAN; 3]; positions.len()], vec![[f32::NAN; 3]; positions.len()]);
        skin.solve(pose, &mut out.0, &mut out.1).unwrap();
        out
    }

    /// Thesis eq. 6.5 for one vertex and one of its influences, in f64: rotation and translation.
    fn motion(&self, pose: &[StretchTwist], vertex: usize, slot: usize) -> (f64, DQuat, DVec3) {
        let at = 4 * vertex + slot;
        let bone = usize::from(self.influences.bones()[at]);
        let (weight, e) = (f64::from(self.influences.weights()[at]), f64::from(self.ends[at]));
        let (rest, pose) = (&self.rest[bone], &pose[bone]);
        let along = (rest.end - rest.start).as_dvec3();
        let [first, last] = pose.twist.map(f64::from);
        let twist = DQuat::from_axis_angle(along.normalize(), (1.0 - e) * first + e * last);
        let turn = pose.turn.as_dquat().normalize() * twist;
        let stretch = along * (f64::from(pose.stretch) - 1.0) * e;
        (weight, turn, pose.start.as_dvec3() + turn * (stretch - rest.start.as_dvec3()))
    }
}

fn pose(scene: &Scene, twist: f32, stretch: f32, dice: &mut Dice) -> Vec<StretchTwist> {
    let bone = |_: &BoneSegment| StretchTwist {
        start: dice.vector(),
        turn: dice.turn(),
        stretch: 1.0 + stretch * dice.roll(),
        twist: [twist * dice.roll(), twist * dice.roll()],
    };
    scene.rest.iter().map(bone).collect()
}

fn apart(a: [f32; 3], b: DVec3) -> f64 {
    Vec3::from(a).as_dvec3().distance(b)
}

#[test]
fn agrees_with_the_formulas_in_f64() {
    let dice = &mut Dice(1);
    for (scene, twist) in
        [(scene(1003, dice), 2.0), (scene_in_order(1003, dice), 2.0), (scene_in_order(1003, dice), 20.0)]
    {
        agrees_with_the_formula(&scene, &pose(&scene, twist, 0.9, dice));
    }
}

fn agrees_with_the_formula(scene: &Scene, pose: &[StretchTwist]) {
    let (linear, dual) = (scene.skin(pose, BoneBlend::Linear), scene.skin(pose, BoneBlend::DualQuaternion));
    for vertex in 0..1003 {
        let p = Vec3::from(scene.positions[vertex]).as_dvec3();
        let terms: Vec<_> = (0..4).map(|slot| scene.motion(pose, vertex, slot)).filter(|m| m.0 > 0.0).collect();
        let blended: DVec3 = terms.iter().map(|(weight, turn, shift)| *weight * (*turn * p + *shift)).sum();
        assert!(apart(linear.0[vertex], blended) < 1e-5, "{vertex}");
        let (mut real, mut part) = (DQuat::from_array([0.0; 4]), DQuat::from_array([0.0; 4]));
        for (weight, turn, shift) in &terms {
            let weight = if turn.dot(terms[0].1) < 0.0 { -weight } else { *weight };
            real += *turn * weight;
            part += DQuat::from_vec4(shift.extend(0.0)) * *turn * (0.5 * weight);
        }
        let length = real.length();
        let (real, part) = (real * (1.0 / length), part * (1.0 / length));
        let shift = part * 2.0 * real.conjugate();
        let at = real * p + DVec3::new(shift.x, shift.y, shift.z);
        assert!(apart(dual.0[vertex], at) < 1e-5, "{vertex}: {}", apart(dual.0[vertex], at));
        assert!(apart(dual.1[vertex], real * Vec3::from(scene.normals[vertex]).as_dvec3()) < 1e-5);
    }
}

/// What the underlying method gives for the same frames.
fn underlying(scene: &Scene, pose: &[StretchTwist], blend: BoneBlend) -> Arrays {
    let rest: Vec<Affine3A> = scene.rest.iter().map(|b| Affine3A::from_translation(b.start)).collect();
    let frames: Vec<Affine3A> = pose.iter().map(|p| Affine3A::from_rotation_translation(p.turn, p.start)).collect();
    let (p, n, w) = (&scene.positions, &scene.normals, &scene.influences);
    let mut out = (p.clone(), n.clone());
    match blend {
        BoneBlend::Linear => {
            LinearBlendSkin::precompute(p, n, w, &rest).unwrap().solve(&frames, &mut out.0, &mut out.1).unwrap();
        }
        BoneBlend::DualQuaternion => {
            DualQuaternionSkin::precompute(p, n, w, &rest).unwrap().solve(&frames, &mut out.0, &mut out.1).unwrap();
        }
    }
    out
}

fn bits(arrays: &Arrays) -> Vec<u32> {
    arrays.0.iter().chain(&arrays.1).flatten().map(|c| c.to_bits()).collect()
}

#[test]
fn bones_at_their_length_without_twist_give_the_underlying_method_bit_for_bit() {
    let dice = &mut Dice(2);
    for count in [5, 500, 1003] {
        let scene = scene(count, dice);
        let mut pose = pose(&scene, 0.0, 0.0, dice);
        pose[3].twist = [-0.0, 0.0];
        for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
            assert_eq!(bits(&scene.skin(&pose, blend)), bits(&underlying(&scene, &pose, blend)), "{blend:?}");
        }
    }
}

#[test]
fn a_twist_leaves_alone_who_does_not_follow_it() {
    let dice = &mut Dice(12);
    let scene = scene_in_order(640, dice);
    let mut pose = pose(&scene, 0.0, 0.0, dice);
    pose[8].twist = [0.4, 1.9];
    pose[7].stretch = 1.3;
    for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
        let (got, base) = (scene.skin(&pose, blend), underlying(&scene, &pose, blend));
        let follows = |vertex: usize| scene.influences.of_vertex(vertex).any(|(bone, _)| bone >= 7);
        let (mut exact, mut moved) = (0, 0);
        for vertex in 0..640 {
            let same = got.0[vertex].map(f32::to_bits) == base.0[vertex].map(f32::to_bits);
            if (vertex / 8 * 8..vertex / 8 * 8 + 8).any(follows) {
                moved += usize::from(!same);
            } else {
                assert!(same, "{blend:?} {vertex}");
                exact += 1;
            }
        }
        assert!(exact > 200 && moved > 200, "{exact} {moved}");
    }
}

#[test]
fn vertices_in_order_of_their_bones_agree_with_those_in_none() {
    // The same vertices in another order are blended bone by bone rather than influence by influence.
    let dice = &mut Dice(13);
    let scene = scene_in_order(640, dice);
    let pose = pose(&scene, 2.0, 0.9, dice);
    let order: Vec<usize> = (0..640).map(|i| i % 8 * 80 + i / 8).collect();
    let slots = || order.iter().flat_map(|v| 4 * v..4 * v + 4);
    let shuffled = Scene {
        positions: order.iter().map(|&v| scene.positions[v]).collect(),
        normals: order.iter().map(|&v| scene.normals[v]).collect(),
        influences: Influences::new(
            4,
            slots().map(|slot| scene.influences.bones()[slot]).collect(),
            slots().map(|slot| scene.influences.weights()[slot]).collect(),
            9,
        )
        .unwrap(),
        ends: slots().map(|slot| scene.ends[slot]).collect(),
        rest: scene.rest.clone(),
    };
    for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
        let (expected, got) = (scene.skin(&pose, blend), shuffled.skin(&pose, blend));
        for (place, &vertex) in order.iter().enumerate() {
            assert!(Vec3::from(expected.0[vertex]).distance(got.0[place].into()) < 1e-5, "{blend:?} {vertex}");
        }
    }
}

#[test]
fn five_and_more_influences_count() {
    let dice = &mut Dice(5);
    let four = scene(203, dice);
    let pose = pose(&four, 2.0, 0.9, dice);
    // Every influence twice, with half its weight and the same place along its bone: nothing may change.
    let (bones, weights) = (four.influences.bones(), four.influences.weights());
    let twice = |slot: usize| 4 * (slot / 8) + slot % 8 / 2;
    let eight = Scene {
        influences: Influences::new(
            8,
            (0..8 * 203).map(|slot| bones[twice(slot)]).collect(),
            (0..8 * 203).map(|slot| 0.5 * weights[twice(slot)]).collect(),
            9,
        )
        .unwrap(),
        ends: (0..8 * 203).map(|slot| four.ends[twice(slot)]).collect(),
        ..scene(203, &mut Dice(5))
    };
    for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
        let (expected, got) = (four.skin(&pose, blend), eight.skin(&pose, blend));
        for vertex in 0..203 {
            assert!(Vec3::from(expected.0[vertex]).distance(got.0[vertex].into()) < 1e-5, "{blend:?} {vertex}");
        }
    }
}

#[test]
fn twist_spreads_along_a_bone_and_stretch_ends_with_it() {
    // Points along and beyond a bone on x: half way it is half twisted, beyond its end it moves as one.
    let positions: Vec<[f32; 3]> = [0.0, 1.0, 2.0, 3.0, 5.0].map(|x| [x, 1.0, 0.0]).to_vec();
    let scene = Scene {
        normals: vec![[0.0, 1.0, 0.0]; 5],
        influences: Influences::new(1, vec![0; 5], vec![1.0; 5], 1).unwrap(),
        ends: vec![0.0, 0.25, 0.5, 0.75, 1.0],
        rest: vec![BoneSegment { start: Vec3::ZERO, end: Vec3::new(4.0, 0.0, 0.0) }],
        positions,
    };
    let pose = [StretchTwist { start: Vec3::ZERO, turn: Quat::IDENTITY, stretch: 1.5, twist: [0.0, 3.0] }];
    for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
        let (positions, normals) = scene.skin(&pose, blend);
        for vertex in 0..5 {
            let (e, x) = (scene.ends[vertex], scene.positions[vertex][0]);
            let expected = Vec3::new(x + 2.0 * e, (3.0 * e).cos(), (3.0 * e).sin());
            assert!(
                expected.distance(positions[vertex].into()) < 2e-6,
                "{blend:?}: {expected} {:?}",
                positions[vertex]
            );
            assert!(Vec3::new(0.0, expected.y, expected.z).distance(normals[vertex].into()) < 2e-6);
        }
    }
}

struct SineAndCosine(f32);

impl EightKernel for SineAndCosine {
    type Output = [f32; 2];

    #[inline(always)]
    fn run<E: Eight>(self) -> [f32; 2] {
        let (sine, cosine) = sine_and_cosine(E::splat(self.0));
        let mut lanes = [[0.0; LANES]; 2];
        sine.store(&mut lanes[0]);
        cosine.store(&mut lanes[1]);
        lanes.map(|lane| lane[3])
    }
}

#[test]
fn angles_of_any_size_turn_as_they_should() {
    for step in -4000..4000 {
        let angle = step as f32 * 0.01;
        let [sine, cosine] = with_eight(SineAndCosine(angle)).map(f64::from);
        let (s, c) = f64::from(angle).sin_cos();
        let sign = (s * sine + c * cosine).signum();
        assert!((sign * sine - s).abs() < 4e-7 && (sign * cosine - c).abs() < 4e-7, "{angle}: {sine} {cosine}");
    }
    assert_eq!(with_eight(SineAndCosine(0.0)).map(f32::to_bits), [0.0_f32, 1.0].map(f32::to_bits));
}

#[test]
fn nonsense_is_named() {
    let dice = &mut Dice(3);
    let scene = scene(20, dice);
    let (p, n, w) = (&scene.positions, &scene.normals, &scene.influences);
    let make =
        |ends: &[f32], rest: &[BoneSegment]| StretchTwistSkin::precompute(p, n, w, ends, rest, BoneBlend::Linear);
    assert!(matches!(make(&scene.ends[1..], &scene.rest), Err(SkinError::Length { what: "end weights", .. })));
    assert!(matches!(make(&scene.ends, &scene.rest[..5]), Err(SkinError::BoneOutOfRange { .. })));
    let mut skin = make(&scene.ends, &scene.rest).unwrap();
    let mut out = (p.clone(), n.clone());
    let mut bad = pose(&scene, 1.0, 0.5, dice);
    bad[3].twist[1] = f32::NAN;
    assert_eq!(skin.solve(&bad, &mut out.0, &mut out.1), Err(SkinError::PoseNotFinite { bone: 3 }));
    bad[2].turn = Quat::from_array([0.0; 4]);
    assert_eq!(skin.solve(&bad, &mut out.0, &mut out.1), Err(SkinError::PoseNotFinite { bone: 2 }));
    // A bone without length has no axis to twist about and nothing to stretch.
    let mut rest = scene.rest.clone();
    rest[4].end = rest[4].start;
    let good = pose(&scene, 1.0, 0.5, dice);
    make(&scene.ends, &rest).unwrap().solve(&good, &mut out.0, &mut out.1).unwrap();
    assert!(out.0.iter().chain(&out.1).flatten().all(|c| c.is_finite()));
}
