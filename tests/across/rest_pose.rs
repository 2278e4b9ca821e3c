//! A puppet that is zeroed in a T moves characters that rest in another pose: their limbs point where the puppet's do.

use std::collections::BTreeMap;
use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::engine::puppet_rest::PuppetRest;
use armature_formats::settings::{read_mapping, write_mapping};
use armature_formats::skeleton::{read_tgf, skeleton_from_graph};
use armature_rig::{Bone, LEAST_REST_TURN, Mapping, PartUid, Pose, RestPose, Skeleton, Transform};
use armature_sim::serve::hints_of;
use armature_take::{Record, verify};
use armature_test_support::{shared, shared_bytes};
use armature_tests::{Run, Setup, character, keep_going, options, perform};
use glam::{Affine3A, Vec3};

const SAMPLES: u32 = 150;
const RATE: f64 = 100.0;
const SEED: u64 = 4;

/// What a rig calls its bones.
struct Names {
    middle: [&'static str; 6],
    /// Shoulder, upper arm, lower arm, hand, upper leg, lower leg, foot; `*` is the side.
    limbs: [&'static str; 7],
    sides: [&'static str; 2],
}

const MIXAMO: Names = Names {
    middle: [
        "mixamorig:Hips",
        "mixamorig:Spine",
        "mixamorig:Spine1",
        "mixamorig:Spine2",
        "mixamorig:Neck",
        "mixamorig:Head",
    ],
    limbs: [
        "mixamorig:*Shoulder",
        "mixamorig:*Arm",
        "mixamorig:*ForeArm",
        "mixamorig:*Hand",
        "mixamorig:*UpLeg",
        "mixamorig:*Leg",
        "mixamorig:*Foot",
    ],
    sides: ["Left", "Right"],
};

const VROID: Names = Names {
    middle: ["J_Bip_C_Hips", "J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest", "J_Bip_C_Neck", "J_Bip_C_Head"],
    limbs: [
        "J_Bip_*_Shoulder",
        "J_Bip_*_UpperArm",
        "J_Bip_*_LowerArm",
        "J_Bip_*_Hand",
        "J_Bip_*_UpperLeg",
        "J_Bip_*_LowerLeg",
        "J_Bip_*_Foot",
    ],
    sides: ["L", "R"],
};

/// A person whose left arm and leg rest in these directions.
fn person(names: &Names, arm: Vec3, thigh: Vec3) -> Skeleton {
    let mut ends: Vec<(String, Option<usize>, Vec3, Vec3)> = Vec::new();
    let heights = [0.95, 1.05, 1.17, 1.29, 1.47, 1.55, 1.75];
    for (k, name) in names.middle.iter().enumerate() {
        let at = |y| Vec3::new(0.0, y, 0.0);
        ends.push(((*name).to_owned(), k.checked_sub(1), at(heights[k]), at(heights[k + 1])));
    }
    let (arm, thigh) = (arm.normalize(), thigh.normalize());
    let shoulder = Vec3::new(0.17, 1.43, 0.0);
    let hip = Vec3::new(0.1, 0.9, 0.0);
    let knee = hip + 0.42 * thigh;
    let ankle = knee - 0.4 * Vec3::Y;
    let places = [
        (3, Vec3::new(0.03, 1.43, 0.0), shoulder),
        (6, shoulder, shoulder + 0.27 * arm),
        (7, shoulder + 0.27 * arm, shoulder + 0.52 * arm),
        (8, shoulder + 0.52 * arm, shoulder + 0.62 * arm),
        (0, hip, knee),
        (10, knee, ankle),
        (11, ankle, ankle + Vec3::new(0.0, -0.05, 0.12)),
    ];
    for (side, x) in names.sides.iter().zip([1.0, -1.0]) {
        let first = ends.len();
        for (name, (parent, head, tail)) in names.limbs.iter().zip(places) {
            let parent = if parent < 6 { parent } else { parent - 6 + first };
            let turned = |v: Vec3| Vec3::new(x * v.x, v.y, v.z);
            ends.push((name.replace('*', side), Some(parent), turned(head), turned(tail)));
        }
    }
    let bone = |(name, parent, head, tail): &(String, Option<usize>, Vec3, Vec3)| Bone {
        name: name.clone(),
        parent: *parent,
        rest: Transform { translation: *head - parent.map_or(Vec3::ZERO, |p| ends[p].2), ..Transform::IDENTITY },
        tail: *tail - *head,
    };
    Skeleton::new(ends.iter().map(bone).collect()).unwrap()
}

fn bare(skeleton: Skeleton) -> Arc<LoadedCharacter> {
    Arc::new(LoadedCharacter::bare("person", "person", skeleton))
}

fn performed(character: &Arc<LoadedCharacter>, puppet_rest: PuppetRest, mapping: Option<Mapping>) -> Run {
    let setup = Setup { puppet_rest, mapping, ..Setup::samples(SAMPLES, RATE) };
    perform(options("human", SEED).puppet().unwrap(), character, &setup)
}

fn poses(run: &Run) -> Vec<Pose> {
    let poses = run.take.records().iter();
    poses
        .filter_map(|record| if let Record::Pose(pose) = record { Some(run.take.unpack(pose)) } else { None })
        .collect()
}

/// Where the limbs of the puppet's parts point, by the parts' names: from each bone's head to that of the next driven
/// bone below it, or along the bone.
fn limbs(skeleton: &Skeleton, mapping: &Mapping, pose: &Pose) -> BTreeMap<String, Vec3> {
    let body = options("human", SEED).puppet_settings().unwrap().body;
    let hints = hints_of(&body);
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    let bone_of = |uid: PartUid| {
        let entry = mapping.entries.iter().find(|entry| entry.part == uid);
        entry.and_then(|entry| skeleton.find(&entry.bone))
    };
    let driven: Vec<usize> = mapping.entries.iter().filter_map(|entry| skeleton.find(&entry.bone)).collect();
    let is_below = |bone: usize, above: usize| {
        std::iter::successors(skeleton.bones()[bone].parent, |&b| skeleton.bones()[b].parent).any(|b| b == above)
    };
    let limb = |(uid, _): (&PartUid, &Vec3)| {
        let bone = bone_of(*uid)?;
        let next = driven.iter().copied().filter(|&other| is_below(other, bone)).min();
        let head = Vec3::from(frames[bone].translation);
        let end = next.map_or_else(
            || frames[bone].transform_point3(skeleton.bones()[bone].tail),
            |next| frames[next].translation.into(),
        );
        Some((hints.names[uid].clone(), (end - head).normalize()))
    };
    hints.rest.iter().filter_map(limb).collect()
}

/// The largest angle between the limbs of two performances by the same puppet, in degrees.
fn apart(a: (&Skeleton, &Run), b: (&Skeleton, &Run)) -> f32 {
    let mut most = 0.0_f32;
    for (one, other) in poses(a.1).iter().zip(&poses(b.1)) {
        let (one, other) = (limbs(a.0, a.1.mapping(), one), limbs(b.0, b.1.mapping(), other));
        assert!(one.len() >= 8 && one.keys().eq(other.keys()), "{one:?} {other:?}");
        for (name, direction) in &one {
            most = most.max(direction.angle_between(other[name]).to_degrees());
        }
    }
    most
}

#[test]
fn limbs_point_where_the_puppets_do_whatever_the_rest_pose() {
    let down = Vec3::NEG_Y;
    for names in [&MIXAMO, &VROID] {
        let reference = person(names, Vec3::X, down);
        let by_t = performed(&bare(reference.clone()), PuppetRest::Mapping, None);
        assert!(by_t.mapping().rest.is_empty(), "a T is a T: {:?}", by_t.mapping().rest);
        let rests = [
            ("an A", Vec3::new(1.0, -1.0, 0.0), down, 2),
            ("arms that hang", Vec3::new(0.1, -1.0, 0.05), down, 2),
            ("arms up", Vec3::new(0.2, 1.0, 0.1), down, 2),
            ("sitting", Vec3::new(1.0, -1.0, 0.3), Vec3::new(0.1, -0.1, 1.0), 4),
        ];
        for (what, arm, thigh, least) in rests {
            let skeleton = person(names, arm, thigh);
            let character = bare(skeleton.clone());
            let run = performed(&character, PuppetRest::Mapping, None);
            assert!(run.mapping().rest.len() >= least, "{what}: {:?}", run.mapping().rest);
            let off = apart((&skeleton, &run), (&reference, &by_t));
            println!("{what}: {} bones turned, limbs off by {off:.3}° at most", run.mapping().rest.len());
            assert!(off < 0.1, "{what}: limbs are off by {off}°");
            assert!(verify(&run.take, &mut keep_going).unwrap().is_exact());

            // The saved mapping says the same, without it the character keeps its own rest pose, bit for bit.
            let saved = read_mapping(write_mapping(run.mapping()).as_bytes()).unwrap();
            assert_eq!(saved.rest, run.mapping().rest);
            let again = performed(&character, PuppetRest::Mapping, Some(saved.clone()));
            assert_eq!(poses(&again), poses(&run), "{what}");
            let plain = performed(&character, PuppetRest::Character, None);
            assert!(plain.mapping().rest.is_empty());
            let old = Mapping { rest: Vec::new(), ..saved };
            assert_eq!(poses(&performed(&character, PuppetRest::Mapping, Some(old))), poses(&plain), "{what}");
            let unmatched = apart((&skeleton, &plain), (&reference, &by_t));
            assert!(unmatched > 30.0, "{what}: without it, limbs are off by {unmatched}°");
            // A puppet of which nothing is known but that it is zeroed in a T.
            let told = performed(&character, PuppetRest::Pose(RestPose::T), None);
            assert!(apart((&skeleton, &told), (&reference, &by_t)) < LEAST_REST_TURN as f32, "{what}");
        }
    }
}

/// Between a segment and a point.
fn distance([from, to]: [Vec3; 2], point: Vec3) -> f32 {
    let way = to - from;
    let t = ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
    (from + t * way).distance(point)
}

/// As proposed, but that its left arm has a collarbone like the right one.
fn armadillo_mapping(proposed: &Mapping) -> Mapping {
    let body = options("human", SEED).puppet_settings().unwrap().body;
    let names = hints_of(&body).names;
    let mut mapping = Mapping { carried: Vec::new(), ..proposed.clone() };
    for entry in &mut mapping.entries {
        let bone = match names[&entry.part].as_str() {
            "left_shoulder" => "bone_6",
            "left_elbow" | "left_forearm" => "bone_7",
            "left_wrist" => "bone_8",
            _ => continue,
        };
        bone.clone_into(&mut entry.bone);
    }
    mapping
}

/// Its arms are up, and no bone has a name: what its bones are is known from the puppet alone.
#[test]
fn the_armadillo_brings_no_arm_through_its_face() {
    let Some(bytes) = shared_bytes("armadillo.tgf") else { return };
    let skeleton = skeleton_from_graph(&read_tgf(&bytes).unwrap(), None).unwrap().skeleton;
    let corrected = armadillo_mapping(performed(&bare(skeleton.clone()), PuppetRest::Character, None).mapping());
    let run = performed(&bare(skeleton.clone()), PuppetRest::Puppet, Some(corrected.clone()));
    let mapping = run.mapping();
    assert!(mapping.rest.len() >= 4, "{:?}", mapping.rest);
    let rested = mapping.rested(&skeleton).unwrap();
    let at_rest = limbs(&rested, mapping, &rested.rest_pose());
    for (part, direction) in &at_rest {
        let wanted = match part.split_once('_').unwrap() {
            ("left", "shoulder" | "elbow" | "forearm" | "wrist") => Vec3::X,
            ("right", "shoulder" | "elbow" | "forearm" | "wrist") => Vec3::NEG_X,
            _ => Vec3::NEG_Y,
        };
        let off = direction.angle_between(wanted).to_degrees();
        println!("{part}: off by {off:.2}°");
        assert!(off < LEAST_REST_TURN as f32 + 0.1, "{part} is off by {off}°");
    }
    // The middle of its head, and how near its forearms and hands come to it.
    let head = skeleton.find("bone_4").unwrap();
    let nearest = |run: &Run| {
        let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
        let mut least = f32::INFINITY;
        for pose in poses(run) {
            pose.forward_kinematics(&skeleton, &mut frames);
            let ends = |bone: usize| {
                [frames[bone].translation.into(), frames[bone].transform_point3(skeleton.bones()[bone].tail)]
            };
            let face = 0.5 * (ends(head)[0] + ends(head)[1]);
            for name in ["bone_7", "bone_8", "bone_11", "bone_12"] {
                least = least.min(distance(ends(skeleton.find(name).unwrap()), face));
            }
        }
        least
    };
    let (matched, plain) =
        (nearest(&run), nearest(&performed(&bare(skeleton.clone()), PuppetRest::Character, Some(corrected))));
    println!("forearms and hands come as near to the head as {matched}; with the character's own rest, {plain}");
    assert!(matched > 0.2 && plain < 0.18, "an arm comes as near to the face as {matched}, or {plain}");
    // Beside a person who rests in a T. Its trunk leans otherwise, and takes the limbs along.
    let reference = bare(person(&MIXAMO, Vec3::X, Vec3::NEG_Y));
    let by_t = performed(&reference, PuppetRest::Mapping, None);
    let mut most = 0.0_f32;
    for (one, other) in poses(&run).iter().zip(&poses(&by_t)) {
        let (one, other) = (limbs(&skeleton, mapping, one), limbs(&reference.skeleton, by_t.mapping(), other));
        for (name, direction) in one.iter().filter(|(name, _)| name.contains("shoulder") || name.contains("hip")) {
            most = most.max(direction.angle_between(other[name]).to_degrees());
        }
    }
    println!("upper arms and legs differ by {most:.1}° at most from those of the person");
    assert!(most < 35.0, "{most}");
}

/// A fox stands on what a person holds out: its legs keep their own rest pose, and the program says so.
#[test]
fn a_quadruped_keeps_its_rest_pose() {
    let Some(fox) = shared("Fox.glb") else { return };
    let fox = character(fox.to_str().unwrap());
    let fox = Arc::new(LoadedCharacter::bare("fox", "fox", fox.skeleton.clone()));
    let known = performed(&fox, PuppetRest::Mapping, None);
    assert!(known.mapping().rest.is_empty(), "{:?}", known.mapping().rest);
    assert_eq!(poses(&known), poses(&performed(&fox, PuppetRest::Character, None)));
}
