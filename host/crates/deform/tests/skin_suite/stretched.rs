//! Bones that stretch and twist, over either method.

use armature_deform::skin::{BoneBlend, BoneSegment, StretchTwist};
use glam::{Affine3A, DVec3, Quat, Vec3};

use super::character::influences;
use super::formulas::{dual_quaternion_blend, stretched_terms};
use super::{Character, Dice, Evaluator, Method, Poses, Skinned, apart, stretched_pose, wide};

const BLENDS: [BoneBlend; 2] = [BoneBlend::Linear, BoneBlend::DualQuaternion];

fn skin(evaluator: &mut dyn Evaluator, character: &Character, pose: &[StretchTwist], blend: BoneBlend) -> Skinned {
    evaluator.one(character, Method::StretchTwist(blend), &Poses::Stretched(pose.to_vec()))
}

pub(crate) fn stretching_and_twisting_agree_with_the_formulas(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(1);
    let scenes = [
        (Character::new(1003, 9, 4, dice), 2.0),
        (Character::in_order(1003, dice), 2.0),
        (Character::in_order(1003, dice), 20.0),
    ];
    for (character, twist) in scenes {
        agree_with_the_formulas(evaluator, &character, &stretched_pose(9, twist, 0.9, dice));
    }
}

fn agree_with_the_formulas(evaluator: &mut dyn Evaluator, character: &Character, pose: &[StretchTwist]) {
    let [linear, dual] = BLENDS.map(|blend| skin(evaluator, character, pose, blend));
    let near = evaluator.bound(1e-5);
    for vertex in 0..character.positions.len() {
        let p = wide(character.positions[vertex]);
        let terms = stretched_terms(character, pose, vertex);
        let blended: DVec3 = terms.iter().map(|(weight, turn, shift)| *weight * (*turn * p + *shift)).sum();
        assert!(apart(linear.0[vertex], blended) < near, "{vertex}");
        let (turn, shift) = dual_quaternion_blend(&terms);
        let off = apart(dual.0[vertex], turn * p + shift);
        assert!(off < near, "{vertex}: {off}");
        assert!(apart(dual.1[vertex], turn * wide(character.normals[vertex])) < near);
    }
}

/// The underlying method's result for the same frames.
pub(crate) fn underlying(
    evaluator: &mut dyn Evaluator,
    character: &Character,
    pose: &[StretchTwist],
    blend: BoneBlend,
) -> Skinned {
    let frames = character.segments.iter().map(|bone| Affine3A::from_translation(bone.start)).collect();
    let moved = pose.iter().map(|bone| Affine3A::from_rotation_translation(bone.turn, bone.start)).collect();
    let method = if blend == BoneBlend::Linear { Method::LinearBlend } else { Method::DualQuaternion };
    evaluator.one(&Character { frames, ..character.clone() }, method, &Poses::Frames(moved))
}

pub(crate) fn bones_at_their_length_without_twist_give_the_underlying_method(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(2);
    for count in [5, 500, 1003] {
        let character = Character::new(count, 9, 4, dice);
        let mut pose = stretched_pose(9, 0.0, 0.0, dice);
        pose[3].twist = [-0.0, 0.0];
        for blend in BLENDS {
            let got = skin(evaluator, &character, &pose, blend);
            let expected = underlying(evaluator, &character, &pose, blend);
            for (got, expected) in got.0.iter().chain(&got.1).zip(expected.0.iter().chain(&expected.1)) {
                assert!(apart(*got, wide(*expected)) <= evaluator.bound(0.0), "{blend:?}");
            }
        }
    }
}

pub(crate) fn vertices_in_order_of_their_bones_agree_with_those_in_none(evaluator: &mut dyn Evaluator) {
    // The same vertices in another order are blended bone by bone rather than influence by influence.
    let dice = &mut Dice(13);
    let character = Character::in_order(640, dice);
    let pose = stretched_pose(9, 2.0, 0.9, dice);
    let order: Vec<usize> = (0..640).map(|i| i % 8 * 80 + i / 8).collect();
    let slots = || order.iter().flat_map(|v| 4 * v..4 * v + 4);
    let (bones, weights) = (character.influences.bones(), character.influences.weights());
    let shuffled = Character {
        positions: order.iter().map(|&v| character.positions[v]).collect(),
        normals: order.iter().map(|&v| character.normals[v]).collect(),
        influences: influences(4, slots().map(|s| bones[s]).collect(), slots().map(|s| weights[s]).collect(), 9),
        ends: slots().map(|slot| character.ends[slot]).collect(),
        ..character.clone()
    };
    for blend in BLENDS {
        let expected = skin(evaluator, &character, &pose, blend);
        let got = skin(evaluator, &shuffled, &pose, blend);
        for (place, &vertex) in order.iter().enumerate() {
            assert!(apart(got.0[place], wide(expected.0[vertex])) < evaluator.bound(1e-5), "{blend:?} {vertex}");
        }
    }
}

pub(crate) fn five_and_more_influences_count(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(5);
    let four = Character::new(203, 9, 4, dice);
    let pose = stretched_pose(9, 2.0, 0.9, dice);
    // Every influence twice, with half its weight and the same place along its bone: nothing may change.
    let (bones, weights) = (four.influences.bones(), four.influences.weights());
    let twice = |slot: usize| 4 * (slot / 8) + slot % 8 / 2;
    let slots = || 0..8 * 203_usize;
    let eight = Character {
        influences: influences(
            8,
            slots().map(|slot| bones[twice(slot)]).collect(),
            slots().map(|slot| 0.5 * weights[twice(slot)]).collect(),
            9,
        ),
        ends: slots().map(|slot| four.ends[twice(slot)]).collect(),
        ..four.clone()
    };
    for blend in BLENDS {
        let (expected, got) = (skin(evaluator, &four, &pose, blend), skin(evaluator, &eight, &pose, blend));
        for vertex in 0..203 {
            assert!(apart(got.0[vertex], wide(expected.0[vertex])) < evaluator.bound(1e-5), "{blend:?} {vertex}");
        }
    }
}

pub(crate) fn twist_spreads_along_a_bone_and_stretch_ends_with_it(evaluator: &mut dyn Evaluator) {
    // Points along and beyond a bone on x: halfway it is half twisted, beyond its end it moves as one.
    let character = Character {
        positions: [0.0, 1.0, 2.0, 3.0, 5.0].map(|x| [x, 1.0, 0.0]).to_vec(),
        normals: vec![[0.0, 1.0, 0.0]; 5],
        influences: influences(1, vec![0; 5], vec![1.0; 5], 1),
        ends: vec![0.0, 0.25, 0.5, 0.75, 1.0],
        segments: vec![BoneSegment { start: Vec3::ZERO, end: Vec3::new(4.0, 0.0, 0.0) }],
        ..Character::new(5, 1, 1, &mut Dice(11))
    };
    let pose = [StretchTwist { start: Vec3::ZERO, turn: Quat::IDENTITY, stretch: 1.5, twist: [0.0, 3.0] }];
    let near = evaluator.bound(2e-6);
    for blend in BLENDS {
        let (positions, normals) = skin(evaluator, &character, &pose, blend);
        for vertex in 0..5 {
            let (e, x) = (character.ends[vertex], character.positions[vertex][0]);
            let expected = Vec3::new(x + 2.0 * e, (3.0 * e).cos(), (3.0 * e).sin());
            let at = positions[vertex];
            assert!(apart(at, expected.as_dvec3()) < near, "{blend:?}: {expected} {at:?}");
            assert!(apart(normals[vertex], Vec3::new(0.0, expected.y, expected.z).as_dvec3()) < near);
        }
    }
}

pub(crate) fn a_bone_without_length_neither_twists_nor_stretches(evaluator: &mut dyn Evaluator) {
    let dice = &mut Dice(14);
    let mut character = Character::new(40, 1, 1, dice);
    character.segments[0].end = character.segments[0].start;
    let pose = stretched_pose(1, 3.0, 0.9, dice);
    for blend in BLENDS {
        let got = skin(evaluator, &character, &pose, blend);
        for vertex in 0..40 {
            let arm = Vec3::from(character.positions[vertex]) - character.segments[0].start;
            let expected = pose[0].start + pose[0].turn * arm;
            assert!(apart(got.0[vertex], expected.as_dvec3()) < evaluator.bound(1e-5), "{blend:?}");
        }
    }
}
