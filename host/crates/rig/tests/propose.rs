//! Proposed mappings for puppets and skeletons whose right answer is known.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use armature_rig::{Bone, PartKind, PartUid, Skeleton, Transform, propose, skeleton_puppet};
use common::{BEND, HUMAN, TBT, puppet, rich_human, skeleton, split, uid};
use glam::{Quat, Vec3};
use proptest::prelude::*;

fn bone_of(proposal: &armature_rig::Proposal, part: PartUid) -> Option<&str> {
    proposal.mapping.entries.iter().find(|e| e.part == part).map(|e| e.bone.as_str())
}

fn check(parts: &[(&str, PartKind, &str)], skeleton: &Skeleton, expected: &[(&str, &str)]) {
    let proposal = propose(&puppet(parts), skeleton);
    let mut wrong = Vec::new();
    for &(label, bone) in expected {
        let part = uid(parts.iter().position(|p| p.0 == label).unwrap());
        if bone_of(&proposal, part) != Some(bone) {
            wrong.push(format!("{label}: {:?} instead of {bone}", bone_of(&proposal, part)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}\n{:#?}", proposal.ambiguities);
    assert_eq!(proposal.confidence.len(), proposal.mapping.entries.len());
    assert!(proposal.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
    assert_eq!(proposal.mapping.entries.len(), expected.len());
}

const HUMAN_ON_RICH: [(&str, &str); 19] = [
    ("hips", "Hips"),
    ("spine", "Spine1"),
    ("chest", "Spine2"),
    ("neck", "Neck"),
    ("head", "Head"),
    ("left hip", "LeftUpLeg"),
    ("left knee", "LeftLeg"),
    ("left ankle", "LeftFoot"),
    ("right hip", "RightUpLeg"),
    ("right knee", "RightLeg"),
    ("right ankle", "RightFoot"),
    ("left shoulder", "LeftArm"),
    ("left elbow", "LeftForeArm"),
    ("left forearm", "LeftForeArm"),
    ("left wrist", "LeftHand"),
    ("right shoulder", "RightArm"),
    ("right elbow", "RightForeArm"),
    ("right forearm", "RightForeArm"),
    ("right wrist", "RightHand"),
];

#[test]
fn a_human_finds_its_bones_among_fingers_and_toes() {
    check(&HUMAN[..21], &rich_human(), &HUMAN_ON_RICH);
}

#[test]
fn names_are_not_needed() {
    let named = rich_human();
    let plain: Vec<Bone> =
        named.bones().iter().enumerate().map(|(i, b)| Bone { name: format!("b{i}"), ..b.clone() }).collect();
    let expected: Vec<(&str, String)> =
        HUMAN_ON_RICH.iter().map(|&(part, bone)| (part, format!("b{}", named.find(bone).unwrap()))).collect();
    let expected: Vec<(&str, &str)> = expected.iter().map(|(part, bone)| (*part, bone.as_str())).collect();
    check(&HUMAN[..21], &Skeleton::new(plain).unwrap(), &expected);
}

#[test]
fn a_spine_in_the_wrong_outlet_is_still_the_spine() {
    let mut parts = HUMAN[..21].to_vec();
    parts.swap(2, 3);
    check(&parts, &rich_human(), &HUMAN_ON_RICH);
}

#[test]
fn collarbones_go_without_a_joint() {
    let mut bones = vec![
        ("Hips", "", [0.0, 1.0, 0.0]),
        ("Chest", "Hips", [0.0, 1.1, 0.0]),
        ("Chest2", "Chest", [0.0, 1.26, 0.0]),
        ("Neck", "Chest2", [0.0, 1.42, 0.0]),
        ("Head", "Neck", [0.0, 1.53, 0.04]),
    ];
    for (s, names) in [
        (1.0, ["LCollar", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle"]),
        (-1.0, ["RCollar", "RShoulder", "RElbow", "RWrist", "RHip", "RKnee", "RAnkle"]),
    ] {
        bones.push((names[0], "Chest2", [0.0, 1.42, 0.0]));
        bones.push((names[1], names[0], [0.16 * s, 1.39, 0.02]));
        bones.push((names[2], names[1], [0.18 * s, 1.14, 0.03]));
        bones.push((names[3], names[2], [0.2 * s, 0.92, 0.04]));
        bones.push((names[4], "Hips", [0.09 * s, 1.0, 0.0]));
        bones.push((names[5], names[4], [0.09 * s, 0.51, 0.0]));
        bones.push((names[6], names[5], [0.09 * s, 0.13, -0.03]));
    }
    let expected: Vec<(&str, &str)> = HUMAN_ON_RICH
        .iter()
        .map(|&(part, _)| part)
        .zip([
            "Hips",
            "Chest",
            "Chest2",
            "Neck",
            "Head",
            "LHip",
            "LKnee",
            "LAnkle",
            "RHip",
            "RKnee",
            "RAnkle",
            "LShoulder",
            "LElbow",
            "LElbow",
            "LWrist",
            "RShoulder",
            "RElbow",
            "RElbow",
            "RWrist",
        ])
        .collect();
    check(&HUMAN[..21], &skeleton(&bones), &expected);
}

#[test]
fn hubs_are_transparent() {
    // The pelvis hub carries the legs; the spine is on the root beside it.
    let bones = [
        ("root", "", [0.0, 1.0, 0.0]),
        ("pelvis", "root", [0.0, 1.0, 0.0]),
        ("spine", "root", [0.0, 1.0, 0.0]),
        ("left", "pelvis", [0.1, 1.0, 0.0]),
        ("right", "pelvis", [-0.1, 1.0, 0.0]),
        ("neck", "spine", [0.0, 1.5, 0.0]),
        ("left shin", "left", [0.1, 0.5, 0.0]),
        ("right shin", "right", [-0.1, 0.5, 0.0]),
    ];
    let parts = [
        ("body", split(3), ""),
        ("l", TBT, "body"),
        ("s", TBT, "body"),
        ("r", TBT, "body"),
        ("lk", BEND, "l"),
        ("rk", BEND, "r"),
        ("n", BEND, "s"),
    ];
    let mut skeleton = skeleton(&bones).bones().to_vec();
    skeleton[0].tail = Vec3::ZERO;
    skeleton[1].tail = Vec3::ZERO;
    let expected =
        [("l", "left"), ("s", "spine"), ("r", "right"), ("lk", "left shin"), ("rk", "right shin"), ("n", "neck")];
    check(&parts, &Skeleton::new(skeleton).unwrap(), &expected);
}

#[test]
fn eight_legs_run_left_front_to_back_then_right() {
    let mut bones = vec![("body".to_owned(), String::new(), [0.0, 0.3, 0.0])];
    let mut parts = vec![("body", TBT, ""), ("s0", split(2), "body"), ("sl", split(4), "s0"), ("sr", split(4), "s0")];
    let labels: Vec<[String; 3]> = (0..8).map(|leg| [0, 1, 2].map(|j| format!("leg {leg} joint {j}"))).collect();
    let mut expected = vec![("body", "body".to_owned())];
    for (leg, names) in labels.iter().enumerate() {
        let side = if leg < 4 { 1.0 } else { -1.0 };
        let (sin, cos) = libm::sincosf([50.0_f32, 17.0, -17.0, -50.0][leg % 4].to_radians());
        for (joint, reach) in [0.1_f32, 0.3, 0.6].into_iter().enumerate() {
            let parent = if joint == 0 { "body" } else { &names[joint - 1] };
            // The bones come in a different order from the legs.
            bones.push((names[joint].clone(), parent.to_owned(), [cos * reach * side, 0.3, sin * reach]));
            let above = if joint > 0 {
                &names[joint - 1]
            } else if leg < 4 {
                "sl"
            } else {
                "sr"
            };
            parts.push((&names[joint], if joint == 0 { TBT } else { BEND }, above));
            expected.push((&names[joint], names[joint].clone()));
        }
    }
    let bones: Vec<(&str, &str, [f32; 3])> = bones.iter().map(|b| (b.0.as_str(), b.1.as_str(), b.2)).collect();
    let expected: Vec<(&str, &str)> = expected.iter().map(|(a, b)| (*a, b.as_str())).collect();
    check(&parts, &skeleton(&bones), &expected);
}

#[test]
fn nothing_fits_nothing() {
    let none = puppet(&[]);
    assert!(propose(&none, &rich_human()).mapping.entries.is_empty());
    let proposal = propose(&puppet(&HUMAN[..21]), &Skeleton::default());
    assert_eq!(proposal.unmapped_parts.len(), 19);
    let one = skeleton(&[("only", "", [0.0, 1.0, 0.0])]);
    let proposal = propose(&puppet(&[("a", TBT, "")]), &one);
    assert_eq!(bone_of(&proposal, uid(0)), Some("only"));
}

/// The first puppet that somebody builds: branches that are all different say nothing of sides.
#[test]
fn two_joints_find_two_bones() {
    let parts = [("root", PartKind::Splitter { outlets: 3 }, ""), ("bend", BEND, "root"), ("three axes", TBT, "root")];
    let proposal = propose(&puppet(&parts), &rich_human());
    assert_eq!(proposal.mapping.entries.len(), 2, "{:#?}", proposal.mapping.entries);
    assert!(proposal.unmapped_parts.is_empty());
}

#[test]
fn equal_branches_are_mentioned() {
    let proposal = propose(&puppet(&HUMAN[..21]), &rich_human());
    let about_order = proposal.ambiguities.iter().filter(|s| s.contains("left to its right")).count();
    assert_eq!(about_order, 2, "legs and arms: {:#?}", proposal.ambiguities);
    assert!(proposal.unmapped_bones.iter().any(|b| b == "LeftToeBase"));
}

#[test]
fn a_huge_skeleton_is_refused_in_words() {
    let bone = |i: usize| Bone {
        name: i.to_string(),
        parent: (i > 0).then(|| i - 1),
        rest: Transform { translation: Vec3::Y, ..Transform::IDENTITY },
        tail: Vec3::Y,
    };
    let long = Skeleton::new((0..60_000).map(bone).collect()).unwrap();
    let (tree, _) = skeleton_puppet(&Skeleton::new((0..100).map(bone).collect()).unwrap(), 4096, uid).unwrap();
    let proposal = propose(&tree, &long);
    assert!(proposal.mapping.entries.is_empty() && proposal.ambiguities[0].contains("write a mapping file"));
    let wide = Skeleton::new((0..9_000).map(|i| Bone { parent: None, ..bone(i) }).collect()).unwrap();
    propose(&tree, &wide);
}

fn any_skeleton() -> impl Strategy<Value = Skeleton> {
    let bone = (any::<prop::sample::Index>(), prop::array::uniform3(-1.0_f32..1.0), 0_u8..10, any::<bool>());
    prop::collection::vec(bone, 1..30).prop_map(|seeds| {
        let bones = seeds.iter().enumerate().map(|(i, (parent, at, hub, root))| Bone {
            name: format!("bone {i}"),
            parent: (i > 0 && !(*root && i < 3)).then(|| parent.index(i)),
            rest: Transform {
                translation: Vec3::from(*at),
                rotation: Quat::from_euler(glam::EulerRot::XYZ, at[0] * 3.0, at[1] * 3.0, at[2]),
                scale: Vec3::ONE,
            },
            tail: if *hub == 0 { Vec3::ZERO } else { Vec3::new(at[2], at[0], at[1]) },
        });
        Skeleton::new(bones.collect()).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    #[test]
    fn a_puppet_built_from_a_skeleton_maps_onto_itself(skeleton in any_skeleton()) {
        let (tree, part_of_bone) = skeleton_puppet(&skeleton, 16384, uid).unwrap();
        let proposal = propose(&tree, &skeleton);
        for (bone, part) in part_of_bone.into_iter().enumerate() {
            let name = &skeleton.bones()[bone].name;
            prop_assert_eq!(bone_of(&proposal, tree.parts()[part].uid), Some(name.as_str()));
        }
        prop_assert!(proposal.unmapped_bones.is_empty() && proposal.unmapped_parts.is_empty());
    }

    #[test]
    fn any_two_trees_give_an_order_preserving_mapping(a in any_skeleton(), b in any_skeleton()) {
        let (tree, _) = skeleton_puppet(&a, 16384, uid).unwrap();
        let proposal = propose(&tree, &b);
        let above = |mut bone: Option<usize>, other: usize| {
            while let Some(i) = bone {
                if i == other { return true }
                bone = b.bones()[i].parent;
            }
            false
        };
        let bone_of_part = |part: usize| bone_of(&proposal, tree.parts()[part].uid).and_then(|name| b.find(name));
        for part in 0..tree.parts().len() {
            let Some(bone) = bone_of_part(part) else { continue };
            let mut parent = tree.parts()[part].parent;
            while let Some(p) = parent {
                if let Some(higher) = bone_of_part(p) {
                    prop_assert!(above(Some(bone), higher));
                }
                parent = tree.parts()[p].parent;
            }
        }
        prop_assert_eq!(proposal.clone(), propose(&tree, &b));
        let sensors = tree.parts().iter().filter(|p| !p.kind.axes().is_empty()).count();
        prop_assert_eq!(proposal.mapping.entries.len() + proposal.unmapped_parts.len(), sensors);
    }
}
