//! Rigs of many programs: which bone is which, by names as they are documented (`recognise_rigs.txt`) and by shape.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::collections::BTreeMap;

use armature_rig::{Bone, Evidence, Figure, Skeleton, Transform, recognise};
use glam::Vec3;

const RIGS: &str = include_str!("recognise_rigs.txt");

struct Rig {
    name: String,
    /// The name of a bone, its parent's, and what it is.
    bones: Vec<(String, Option<String>, Option<String>)>,
}

fn rigs() -> Vec<Rig> {
    let mut rigs: Vec<Rig> = Vec::new();
    let mut sides = (String::new(), String::new());
    for line in RIGS.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if let Some((name, rest)) = line.strip_prefix('[').and_then(|line| line.split_once(']')) {
            let rest = rest.trim().strip_prefix("sides ").unwrap();
            let mut words: Vec<String> = rest.split('"').map(str::trim).map(str::to_owned).collect();
            words.retain(|word| !word.is_empty());
            sides = match &words[..] {
                [left, right] => (format!(" {left} "), format!(" {right} ")),
                [both] => both.split_once(' ').map(|(left, right)| (left.to_owned(), right.to_owned())).unwrap(),
                _ => panic!("{line}"),
            };
            rigs.push(Rig { name: name.to_owned(), bones: Vec::new() });
            continue;
        }
        let rig = rigs.last_mut().unwrap();
        for right in [false, true] {
            let mut parent: Option<String> = None;
            for entry in line.split(" > ") {
                let (name, role) = entry.split_once('=').map_or((entry, None), |(name, role)| (name, Some(role)));
                let named_left = role.is_some_and(|role| role.starts_with("left"));
                let unnamed_left = role.is_none() && line.contains("=left") && says(name, &sides.0);
                let (name, role) = match (right, named_left || unnamed_left || is_left(rig, name, &sides.0)) {
                    (true, true) => (
                        mirrored(name, &sides),
                        role.map(|role| role.strip_prefix("left").map_or(role.into(), |part| format!("right{part}"))),
                    ),
                    _ => (name.to_owned(), role.map(str::to_owned)),
                };
                if !rig.bones.iter().any(|(known, ..)| *known == name) {
                    rig.bones.push((name.clone(), parent.clone(), role.filter(|role| role != "-")));
                }
                parent = Some(name);
            }
        }
    }
    rigs
}

/// Whether the bone was on the left when it was named first, or its name says so.
fn is_left(rig: &Rig, name: &str, left: &str) -> bool {
    let known = rig.bones.iter().find(|(known, ..)| known == name);
    let role = known.and_then(|(_, _, role)| role.as_deref());
    role.map_or(says(name, left), |role| role.starts_with("left"))
}

/// A single letter begins the name.
fn says(name: &str, side: &str) -> bool {
    if side.len() == 1 { name.starts_with(side) } else { name.contains(side) }
}

fn mirrored(name: &str, (left, right): &(String, String)) -> String {
    match name.strip_prefix("Left") {
        Some(rest) => format!("Right{rest}"),
        None => name.replacen(left.as_str(), right, 1),
    }
}

/// Where the bones of a person who holds the arms out begin. Z up to the toes is forward.
fn place(role: &str) -> Option<Vec3> {
    let (side, part) = match (role.strip_prefix("left"), role.strip_prefix("right")) {
        (Some(part), _) => (1.0, part),
        (_, Some(part)) => (-1.0, part),
        _ => (0.0, role),
    };
    let (x, y, z) = match part {
        "hips" => (0.0, 1.0, 0.0),
        "spine" => (0.0, 1.1, 0.0),
        "chest" => (0.0, 1.2, 0.0),
        "upperChest" => (0.0, 1.3, 0.0),
        "neck" => (0.0, 1.5, 0.0),
        "head" => (0.0, 1.6, 0.0),
        "jaw" => (0.0, 1.62, 0.05),
        "Eye" => (0.03, 1.68, 0.08),
        "UpperLeg" => (0.1, 0.95, 0.0),
        "LowerLeg" => (0.1, 0.5, 0.0),
        "Foot" => (0.1, 0.08, 0.0),
        "Toes" => (0.1, 0.02, 0.12),
        "Shoulder" => (0.03, 1.45, 0.0),
        "UpperArm" => (0.18, 1.45, 0.0),
        "LowerArm" => (0.45, 1.45, 0.0),
        "Hand" => (0.7, 1.45, 0.0),
        finger => {
            let at = ["Thumb", "Index", "Middle", "Ring", "Little"].iter().position(|name| finger.starts_with(name))?;
            let segment = match finger {
                part if part.ends_with("Distal") => 2.0,
                part if part.ends_with("Intermediate") || part == "ThumbProximal" => 1.0,
                _ => 0.0,
            };
            (0.74 + 0.03 * segment, 1.45, 0.04 - 0.02 * at as f32)
        }
    };
    Some(Vec3::new(side * x, y, z))
}

fn skeleton(rig: &Rig) -> Skeleton {
    // Parents come first in every rig of the table.
    let index: BTreeMap<&str, usize> =
        rig.bones.iter().enumerate().map(|(at, (name, ..))| (name.as_str(), at)).collect();
    let mut heads: Vec<Vec3> = Vec::new();
    for (name, parent, role) in &rig.bones {
        let above = parent.as_ref().map_or(Vec3::new(0.0, 1.0, 0.0), |parent| heads[index[parent.as_str()]]);
        let nudge = Vec3::new(0.0, 0.002 + 0.0001 * name.len() as f32, 0.001);
        heads.push(role.as_deref().and_then(place).unwrap_or(above + nudge));
    }
    let tail = |bone: usize| {
        let child = rig.bones.iter().position(|(_, parent, _)| parent.as_deref() == Some(&rig.bones[bone].0));
        child.map_or(Vec3::new(0.0, 0.02, 0.0), |child| heads[child] - heads[bone])
    };
    let bones = rig.bones.iter().enumerate().map(|(at, (name, parent, _))| {
        let parent = parent.as_ref().map(|parent| index[parent.as_str()]);
        let origin = parent.map_or(Vec3::ZERO, |parent| heads[parent]);
        Bone {
            name: name.clone(),
            parent,
            rest: Transform { translation: heads[at] - origin, ..Transform::IDENTITY },
            tail: tail(at),
        }
    });
    Skeleton::new(bones.collect()).unwrap()
}

#[test]
fn the_bones_of_rigs_of_many_programs_are_recognised() {
    let rigs = rigs();
    assert!(rigs.len() >= 20);
    let (mut right, mut all, mut wrong) = (0, 0, Vec::new());
    for rig in &rigs {
        let skeleton = skeleton(rig);
        let recognition = recognise(&skeleton);
        assert_eq!(recognition.figure, Figure::Human, "{}", rig.name);
        for ((name, _, role), found) in rig.bones.iter().zip(&recognition.bones) {
            let found = found.map(|found| found.bone.to_string());
            let side =
                |role: &Option<String>| role.as_ref().map(|role| (role.starts_with("left"), role.starts_with("right")));
            if let (Some(own), Some(other)) = (side(role), side(&found)) {
                assert!(own == other, "{}: {name} is taken for {found:?}", rig.name);
            }
            all += usize::from(role.is_some());
            if *role == found {
                right += usize::from(role.is_some());
            } else {
                wrong.push(format!("{}: {name} is {role:?}, taken for {found:?}", rig.name));
            }
        }
    }
    println!("{right} of {all} bones of {} rigs; {} wrong", rigs.len(), wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_names_do_not_say_is_less_sure() {
    let rigs = rigs();
    let sure = |name: &str, bone: &str| {
        let rig = rigs.iter().find(|rig| rig.name == name).unwrap();
        let recognition = recognise(&skeleton(rig));
        recognition.bones.iter().flatten().find(|found| found.bone.to_string() == bone).copied().unwrap()
    };
    let (named, placed) = (sure("Unreal Mannequin", "leftLowerLeg"), sure("Mixamo", "leftLowerLeg"));
    let shaped = sure("A skeleton without names", "leftLowerLeg");
    assert_eq!([named, placed, shaped].map(|f| f.evidence), [Evidence::Name, Evidence::NameAndPlace, Evidence::Shape]);
    assert!(named.confidence > placed.confidence && placed.confidence > shaped.confidence);
}

/// Left and right follow the names, even of a character that looks backwards.
#[test]
fn names_decide_about_sides() {
    for rig in rigs().iter().filter(|rig| rig.name != "A skeleton without names") {
        let forward = skeleton(rig);
        let turned = forward.bones().iter().map(|bone| {
            let turn = |v: Vec3| Vec3::new(-v.x, v.y, -v.z);
            let rest = Transform { translation: turn(bone.rest.translation), ..bone.rest };
            Bone { name: bone.name.clone(), parent: bone.parent, rest, tail: turn(bone.tail) }
        });
        let turned = Skeleton::new(turned.collect()).unwrap();
        let names =
            |skeleton: &Skeleton| recognise(skeleton).bones.iter().map(|f| f.map(|f| f.bone)).collect::<Vec<_>>();
        assert_eq!(names(&forward), names(&turned), "{}", rig.name);
    }
}

#[test]
fn nothing_is_recognised_in_what_is_no_figure() {
    let bone = |at: usize| Bone {
        name: format!("segment_{at}"),
        parent: at.checked_sub(1),
        rest: Transform { translation: Vec3::new(0.0, 0.0, if at == 0 { 0.0 } else { 0.1 }), ..Transform::IDENTITY },
        tail: Vec3::new(0.0, 0.0, 0.1),
    };
    for count in [0, 1, 12] {
        let recognition = recognise(&Skeleton::new((0..count).map(bone).collect()).unwrap());
        assert_eq!((recognition.figure, recognition.count()), (Figure::Other, 0));
    }
}
