//! Skinning on the CPU: what every evaluator promises, and what only these kernels do.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

#[macro_use]
mod skin_suite;

use armature_deform::skin::bones::BoneBinding;
use armature_deform::skin::{BoneBlend, DualQuaternionSkin, LinearBlendSkin, SkinError, StretchTwistSkin};
use glam::Affine3A;
use skin_suite::{
    Character, Cpu, Dice, Evaluator, METHODS, Method, Poses, Skinned, rigid_pose, sheared_frames, stretched,
    stretched_pose,
};

skin_suite!(Some(Cpu));

fn bits(skinned: &Skinned) -> Vec<u32> {
    skinned.0.iter().chain(&skinned.1).flatten().map(|c| c.to_bits()).collect()
}

#[test]
fn without_twist_the_underlying_method_is_met_bit_for_bit() {
    let dice = &mut Dice(2);
    for count in [5, 500, 1003] {
        let character = Character::new(count, 9, 4, dice);
        let mut pose = stretched_pose(9, 0.0, 0.0, dice);
        pose[3].twist = [-0.0, 0.0];
        for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
            let got = Cpu.one(&character, Method::StretchTwist(blend), &Poses::Stretched(pose.clone()));
            let expected = stretched::underlying(&mut Cpu, &character, &pose, blend);
            assert_eq!(bits(&got), bits(&expected), "{blend:?}");
        }
    }
}

#[test]
fn a_twist_leaves_alone_who_does_not_follow_it() {
    let dice = &mut Dice(12);
    let character = Character::in_order(640, dice);
    let mut pose = stretched_pose(9, 0.0, 0.0, dice);
    pose[8].twist = [0.4, 1.9];
    pose[7].stretch = 1.3;
    for blend in [BoneBlend::Linear, BoneBlend::DualQuaternion] {
        let got = Cpu.one(&character, Method::StretchTwist(blend), &Poses::Stretched(pose.clone()));
        let base = stretched::underlying(&mut Cpu, &character, &pose, blend);
        let follows = |vertex: usize| character.influences.of_vertex(vertex).any(|(bone, _)| bone >= 7);
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

/// From this many vertices on, threads share the work.
const MANY: usize = 32_768;

#[test]
fn many_vertices_give_the_same_as_few() {
    let dice = &mut Dice(5);
    for method in METHODS {
        let big = Character::new(MANY + 1234, 13, 4, dice);
        let poses = match method {
            Method::LinearBlend => Poses::Frames(sheared_frames(13, 4, dice)[39..].to_vec()),
            Method::DualQuaternion => Poses::Frames(sheared_frames(13, 1, dice)),
            Method::StretchTwist(_) => Poses::Stretched(stretched_pose(13, 2.0, 0.5, dice)),
        };
        let all = Cpu.one(&big, method, &poses);
        assert_eq!(bits(&Cpu.one(&big, method, &poses)), bits(&all), "{method:?}");
        // Vertices are computed in blocks of eight, each independently.
        for first in [0, 4096, MANY] {
            let part = part_of(&big, first, 1000);
            let few = Cpu.one(&part, method, &poses);
            let same = (all.0[first..first + 1000].to_vec(), all.1[first..first + 1000].to_vec());
            assert_eq!(bits(&few), bits(&same), "{method:?} from {first}");
        }
    }
}

fn part_of(whole: &Character, first: usize, count: usize) -> Character {
    let (bones, weights) = (whole.influences.bones(), whole.influences.weights());
    let slots = 4 * first..4 * (first + count);
    Character {
        positions: whole.positions[first..first + count].to_vec(),
        normals: whole.normals[first..first + count].to_vec(),
        influences: armature_geometry::Influences::restore(
            4,
            bones[slots.clone()].to_vec(),
            weights[slots.clone()].to_vec(),
            13,
        )
        .unwrap(),
        ends: whole.ends[slots].to_vec(),
        ..whole.clone()
    }
}

#[test]
fn what_is_refused_leaves_the_room_untouched() {
    let character = Character::new(20, 3, 2, &mut Dice(7));
    let Character { positions: p, normals: n, influences: w, ends, frames, segments } = &character;
    let mut linear = LinearBlendSkin::precompute(p, n, w, frames).unwrap();
    let mut dual = DualQuaternionSkin::precompute(p, n, w, frames).unwrap();
    let mut twisted = StretchTwistSkin::precompute(p, n, w, ends, segments, BoneBlend::Linear).unwrap();
    let Poses::Frames(mut bad) = rigid_pose(&character, Method::LinearBlend, Affine3A::IDENTITY) else { panic!() };
    bad[2].translation.y = f32::INFINITY;
    let mut twist = stretched_pose(3, 1.0, 0.5, &mut Dice(8));
    twist[2].start.x = f32::NAN;
    let mut room: Skinned = (vec![[9.0; 3]; 20], vec![[9.0; 3]; 20]);
    let refused = Err(SkinError::PoseNotFinite { bone: 2 });
    assert_eq!(linear.solve(&bad, &mut room.0, &mut room.1), refused);
    assert_eq!(dual.solve(&bad, &mut room.0, &mut room.1), refused);
    assert_eq!(twisted.solve(&twist, &mut room.0, &mut room.1), refused);
    assert_eq!(room, (vec![[9.0; 3]; 20], vec![[9.0; 3]; 20]));
    let short = |outcome| matches!(outcome, Err(SkinError::Length { what: "output positions", got: 3, .. }));
    assert!(short(linear.solve(frames, &mut room.0[..3], &mut room.1)));
    assert!(short(dual.solve(frames, &mut room.0[..3], &mut room.1)));
    assert!(short(twisted.solve(&stretched_pose(3, 1.0, 0.5, &mut Dice(8)), &mut room.0[..3], &mut room.1)));
}

#[test]
fn vertices_bound_in_different_poses_meet_when_posed() {
    let dice = &mut Dice(21);
    // The same vertices twice: at rest, and moved rigidly by another pose.
    let once = Character::new(40, 3, 2, dice);
    let moved: Vec<Affine3A> = (0..3).map(|_| dice.rigid()).collect();
    let bindings: Vec<BoneBinding> = (0..6)
        .map(|k| BoneBinding {
            bone: k % 3,
            rest_model_from_bone: [&once.frames, &moved][k as usize / 3][k as usize % 3],
        })
        .collect();
    // Each vertex follows one bone, so its bind pose is that bone's frame.
    let bones: Vec<u16> = (0..40).map(|v| v % 3).collect();
    let since_rest = |vertex: usize| moved[vertex % 3] * once.frames[vertex % 3].inverse();
    let point = |v: usize| since_rest(v).transform_point3(once.positions[v].into()).to_array();
    let arrow = |v: usize| since_rest(v).transform_vector3(once.normals[v].into()).to_array();
    let positions: Vec<[f32; 3]> = once.positions.iter().copied().chain((0..40).map(point)).collect();
    let normals: Vec<[f32; 3]> = once.normals.iter().copied().chain((0..40).map(arrow)).collect();
    let slots = bones.iter().copied().chain(bones.iter().map(|bone| bone + 3)).collect();
    let influences = armature_geometry::Influences::new(1, slots, vec![1.0; 80], 6).unwrap();
    let mut skin = LinearBlendSkin::precompute_bound(&positions, &normals, &influences, &bindings, 3).unwrap();
    assert_eq!(skin.bone_count(), 3);
    let mut out: Skinned = (positions.clone(), normals.clone());
    for _ in 0..5 {
        let pose: Vec<Affine3A> = (0..3).map(|_| dice.rigid()).collect();
        skin.solve(&pose, &mut out.0, &mut out.1).unwrap();
        for vertex in 0..40 {
            for all in [&out.0, &out.1] {
                let apart = glam::Vec3::from(all[vertex]).distance(all[vertex + 40].into());
                assert!(apart < 1e-5, "{vertex}: {apart}");
            }
        }
    }
    let bind = |bindings: &[BoneBinding]| {
        LinearBlendSkin::precompute_bound(&positions, &normals, &influences, bindings, 3).map(|_| ())
    };
    assert!(matches!(bind(&bindings[..5]), Err(SkinError::BoneOutOfRange { bone: 5, bone_count: 5, .. })));
    // Even where no vertex uses it.
    let missing = [&bindings[..], &[BoneBinding { bone: 3, ..bindings[5] }]].concat();
    assert_eq!(bind(&missing), Err(SkinError::BindingOutOfRange { binding: 6, bone: 3, bone_count: 3 }));
    let flat = Affine3A::from_scale(glam::Vec3::new(1.0, 0.0, 1.0));
    let flattened = [&bindings[..5], &[BoneBinding { bone: 2, rest_model_from_bone: flat }]].concat();
    assert_eq!(bind(&flattened), Err(SkinError::RestNotInvertible { bone: 2 }));
}
