//! Which bones a puppet's joints drive, for pairs of puppet and character, as a person would choose: `mapping.txt`.

use std::collections::BTreeMap;

use armature::engine::bridge::{Bridge, hints_of_servos};
use armature_device::servo::ServoArm;
use armature_device::{Part, Topology};
use armature_rig::{JointTree, PartUid, Proposal, PuppetHints, Skeleton, propose_with};
use armature_sim::Body;
use armature_sim::serve::Options;
use armature_test_support::{shared, shared_bytes};
use armature_tests::bones_of;

const TABLE: &str = include_str!("mapping.txt");

/// A puppet, what its parts are called, and what a host knows of it.
struct Puppet {
    tree: JointTree,
    labels: BTreeMap<PartUid, String>,
    hints: PuppetHints,
}

fn tree_of(body: &Body) -> JointTree {
    let part = |part: &armature_sim::BodyPart| Part {
        kind: part.kind,
        sensor_count: part.kind.sensor_count().unwrap(),
        outlet: part.outlet,
        outlet_count: part.outlets,
        parent: part.parent.map(|parent| parent as u16),
        uid: part.uid,
        counts_per_turn: 16_384,
    };
    let topology = Topology::new(0, body.parts().iter().map(part).collect()).unwrap();
    Bridge::new(&topology).unwrap().tree().clone()
}

/// The puppet of this name; `None` where its file is not there. With ` (bare)` behind it, its tree is all that is known.
fn puppet(name: &str) -> Option<Puppet> {
    if let Some(known) = name.strip_suffix(" (bare)") {
        return Some(Puppet { hints: PuppetHints::default(), ..puppet(known)? });
    }
    if let Some(arm) = ServoArm::presets().into_iter().find(|arm| arm.name == name) {
        let topology = arm.topology(1).unwrap();
        let hints = hints_of_servos(&topology).unwrap();
        return Some(Puppet {
            tree: Bridge::new(&topology).unwrap().tree().clone(),
            labels: hints.names.clone(),
            hints,
        });
    }
    let puppet = match name.strip_suffix(".bvh") {
        Some(file) => shared(&format!("cases/mapping/{file}.bvh"))?.display().to_string(),
        None => name.to_owned(),
    };
    let options = Options { puppet, ..Options::default() };
    let body = options.puppet_settings().unwrap().body;
    let labels = body.parts().iter().map(|part| (PartUid(part.uid.0), part.label.clone())).collect();
    Some(Puppet { tree: tree_of(&body), labels, hints: options.hints().unwrap() })
}

fn character(name: &str) -> Option<Skeleton> {
    let motion = |path: String| {
        shared_bytes(&path).map(|bytes| armature_formats::motion::read_bvh(&bytes).unwrap().motion.skeleton.clone())
    };
    match name {
        "human" | "spider" | "hand" => Some(bones_of(name).skeleton.clone()),
        "fox" => Some(
            armature::characters::find(shared("Fox.glb")?.to_str()?, &mut |_, _| std::ops::ControlFlow::Continue(()))
                .unwrap()
                .character
                .skeleton,
        ),
        "freebvh" | "mocapbank" => motion(format!("mocap/{name}.bvh")),
        file => motion(format!("cases/mapping/{file}.bvh")),
    }
}

/// `mixamorig:LeftArm` → `LeftArm`.
fn short(bone: &str) -> &str {
    bone.rsplit(':').next().unwrap_or(bone)
}

/// Which bone each joint drives, by their names; `-` for none.
fn found(puppet: &Puppet, proposal: &Proposal) -> BTreeMap<String, String> {
    let joints = puppet.tree.parts().iter().filter(|part| !part.kind.axes().is_empty());
    let bone = |uid| proposal.mapping.entries.iter().find(|entry| entry.part == uid);
    joints
        .map(|part| {
            (puppet.labels[&part.uid].clone(), bone(part.uid).map_or("-", |entry| short(&entry.bone)).to_owned())
        })
        .collect()
}

#[test]
fn joints_drive_the_bones_that_a_person_would_choose() {
    let (mut pairs, mut wrong) = (0, Vec::new());
    let mut proposals: BTreeMap<String, (BTreeMap<String, String>, Vec<String>)> = BTreeMap::new();
    let mut pair: Option<&str> = None;
    for line in TABLE.lines() {
        let Some(expected) = line.strip_prefix("    ") else {
            pair = None;
            let (name, skeleton) = line.split_once(" > ").unwrap_or_else(|| panic!("{line:?} is no pair"));
            let (Some(puppet), Some(skeleton)) = (puppet(name), character(skeleton)) else { continue };
            let proposal = propose_with(&puppet.tree, &skeleton, &puppet.hints);
            proposals.insert(line.to_owned(), (found(&puppet, &proposal), proposal.ambiguities));
            (pair, pairs) = (Some(line), pairs + 1);
            continue;
        };
        let Some((found, doubts)) = pair.map(|pair| &proposals[pair]) else { continue };
        if let Some(doubt) = expected.strip_prefix("doubt: ") {
            if !doubts.iter().any(|said| said.contains(doubt)) {
                wrong.push(format!("{}: the doubt is not reported, only {doubts:?}", pair.unwrap()));
            }
            continue;
        }
        for (joint, bone) in expected.split(' ').map(|pair| pair.split_once('=').unwrap()) {
            if found.get(joint).map(String::as_str) != Some(bone) {
                wrong.push(format!("{}: {joint} drives {:?}, not {bone}", pair.unwrap(), found.get(joint)));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(pairs >= 40 || shared("cases/mapping").is_none(), "{pairs} pairs");
}

const PUPPETS: [&str; 20] = [
    "human",
    "human8",
    "spider",
    "hand",
    "human (bare)",
    "human8 (bare)",
    "spider (bare)",
    "hand (bare)",
    "bird.bvh",
    "bird.bvh (bare)",
    "h9.bvh",
    "h9.bvh (bare)",
    "headroot.bvh",
    "headroot.bvh (bare)",
    "legs.bvh (bare)",
    "quad.bvh (bare)",
    "quad_chest.bvh (bare)",
    "snake.bvh (bare)",
    "so101-leader",
    "gello-franka",
];

#[test]
fn no_limb_is_on_a_tail_while_a_limb_is_free_and_no_bone_is_heaped_with_joints() {
    for (name, limbs) in [
        (
            "fox",
            [
                "b_LeftLeg",
                "b_RightLeg",
                "b_LeftUpperArm,b_LeftForeArm,b_LeftHand",
                "b_RightUpperArm,b_RightForeArm,b_RightHand",
            ],
        ),
        ("quad", ["hl", "hr", "fl", "fr"]),
    ] {
        let Some(skeleton) = character(name) else { continue };
        for puppet_name in PUPPETS {
            let Some(puppet) = puppet(puppet_name) else { continue };
            let found = found(&puppet, &propose_with(&puppet.tree, &skeleton, &puppet.hints));
            let driven =
                |starts: &str| found.values().any(|bone| starts.split(',').any(|start| bone.starts_with(start)));
            let free = limbs.iter().filter(|limb| !driven(limb)).count();
            for (joint, bone) in &found {
                let is_tail = bone.starts_with("b_Tail") || (name == "quad" && bone.starts_with('t'));
                assert!(!is_tail || free == 0, "{puppet_name} > {name}: {joint} on {bone}, {free} limbs are free");
                let on_it = found.values().filter(|other| *other == bone && *bone != "-").count();
                assert!(on_it <= 3, "{puppet_name} > {name}: {on_it} joints on {bone}");
            }
        }
    }
}

#[test]
fn left_stays_left() {
    let side = |name: &str| {
        let name = name.to_lowercase();
        [name.contains("left"), name.contains("right")]
    };
    let mut compared = 0;
    for puppet_name in ["human", "human8", "spider"] {
        for bare in ["", " (bare)"] {
            let puppet = puppet(&format!("{puppet_name}{bare}")).unwrap();
            for name in ["human", "spider", "fox", "freebvh", "mocapbank"] {
                let Some(skeleton) = character(name) else { continue };
                for (joint, bone) in found(&puppet, &propose_with(&puppet.tree, &skeleton, &puppet.hints)) {
                    let both = [side(&joint), side(&bone)];
                    if both.iter().all(|sides| sides[0] != sides[1]) {
                        assert_eq!(both[0], both[1], "{puppet_name}{bare} > {name}: {joint} on {bone}");
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 50, "{compared} joints of a side on bones of a side");
}
