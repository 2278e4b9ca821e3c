//! Files that real exporters wrote, through the whole program: each opens, keeps its rig or is bound, moves under a puppet
//! and is exported; Blender poses what came out as the program did.
//!
//! Blender makes most of them (`ARMATURE_BPY_PYTHON`), gltfpack some (`ARMATURE_GLTF_VALIDATOR` names the folder that has it
//! too); `ARMATURE_SAMPLE_MODELS` names the folder of models of Debian's package `assimp-testmodels`: sample models of
//! Khronos, and FBX files that 3ds Max, Maya and Blender wrote. Without them the test prints that it is skipped; in CI it
//! fails.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use armature_character::bind::BindSettings;
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_rig::Motion;
use armature_take::Take;
use glam::Affine3A;

use crate::common::Place;
use crate::exports::{motion_of, node_modules, script, tool};

const FRAMES_A_SECOND: f64 = 30.0;

/// From `assimp-testmodels`, and whether they have a rig.
const SAMPLES: [(&str, bool); 11] = [
    ("FBX/animation_with_skeleton.fbx", true),
    ("FBX/huesitos.fbx", true),
    ("FBX/spider.fbx", false),
    ("FBX/box.fbx", false),
    ("FBX/cubes_with_mirroring_and_pivot.fbx", false),
    ("FBX/maxPbrMaterial_metalRough.fbx", false),
    ("FBX/embedded_ascii/box.FBX", false),
    ("glTF2/simple_skin/simple_skin.gltf", true),
    ("glTF2/glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf", false),
    ("glTF2/BoxTextured-glTF-Binary/BoxTextured.glb", false),
    ("glTF2/textureTransform/TextureTransformTest.gltf", false),
];

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}\n{said}");
    said
}

fn model_of(file: &Path) -> Model {
    let beside = |name: &str| std::fs::read(file.with_file_name(name)).map_err(|error| format!("{name}: {error}"));
    read_model(&file.display().to_string(), &std::fs::read(file).unwrap(), &beside).unwrap()
}

/// A model with a rig as a character.
fn opened(file: &Path) -> armature_character::Character {
    let settings = BindSettings::default();
    armature_character::bind::bind(model_of(file), None, &settings, &mut |_, _| std::ops::ControlFlow::Continue(()))
        .unwrap()
}

/// A chain of three bones through the longest side of a model without a rig.
fn bones_through(file: &Path) -> String {
    let (low, high) = model_of(file).mesh.bounds().unwrap();
    let sides: Vec<f64> = (0..3).map(|k| high[k] - low[k]).collect();
    let longest = (0..3).max_by(|&a, &b| sides[a].total_cmp(&sides[b])).unwrap();
    let node = |number: usize| {
        let share = 0.05 + 0.3 * number as f64;
        let at = |k: usize| low[k] + sides[k] * if k == longest { share } else { 0.5 };
        format!("{} {} {} {}\n", number + 1, at(0), at(1), at(2))
    };
    (0..4).map(node).collect::<String>() + "#\n1 2\n2 3\n3 4\n"
}

/// Where the program poses the vertices at the first, the middle and the last frame.
fn posed(character: &armature_character::Character, motion: &Motion) -> (Vec<usize>, Vec<u8>) {
    let last = motion.frames.len() - 1;
    let frames = vec![0, last / 2, last];
    let mut skin = character.linear_skin().unwrap();
    let mut bytes = Vec::new();
    let mut world = vec![Affine3A::IDENTITY; motion.skeleton.len()];
    for &frame in &frames {
        motion.frames[frame].forward_kinematics(&motion.skeleton, &mut world);
        let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
        skin.solve(&world, &mut positions, &mut normals).unwrap();
        bytes.extend(positions.iter().flatten().flat_map(|c| c.to_le_bytes()));
    }
    (frames, bytes)
}

/// Moves a file's character for two seconds and exports it, and says how many bones the puppet moved.
fn perform(place: &Place, file: &Path, name: &str, has_rig: bool) -> usize {
    let path = file.to_str().unwrap();
    let bound = format!("{name}.armature");
    let character_file = if has_rig {
        path.to_owned()
    } else {
        place.write(&format!("{name}.tgf"), bones_through(file));
        let skeleton = format!("{name}.tgf");
        place.done(&["bind", path, "--skeleton", &skeleton, "--method", "heat", "-o", &bound]);
        bound
    };
    // A dog has a puppet of its own: its motion.
    let own_motion = file.with_extension("bvh");
    let own = format!("sim:{}", own_motion.display());
    let (device, motion) = if !has_rig {
        ("sim:joints:3", &["--motion", "wiggle"][..])
    } else if own_motion.exists() {
        (own.as_str(), &[][..])
    } else {
        ("sim:human", &[][..])
    };
    let take = format!("{name}.take");
    let command = ["run", "--device", device, "--character", &character_file, "--record", &take];
    place.done(&[&command[..], motion, &["--virtual-clock", "--seconds", "2", "--rate", "60"]].concat());
    let exported = format!("{name}.glb");
    place.done(&["export", &take, "--to", &exported, "--fps", "30", "--character", &character_file]);
    let motion = motion_of(&Take::read(&place.read(&take)).unwrap().0, FRAMES_A_SECOND, false);
    let character = if has_rig {
        opened(file)
    } else {
        armature_character::cache::from_bytes(&place.read(&character_file)).unwrap()
    };
    assert_eq!(character.skeleton, motion.skeleton, "{name}");
    let (frames, points) = posed(&character, &motion);
    let vertices = character.surface.mesh.vertices.len();
    place.write(&format!("{name}.frames"), format!("{} {} {} {vertices}", frames[0], frames[1], frames[2]));
    place.write(&format!("{name}.points"), points);
    let turns = |frame: usize| motion.frames[frame].parent_from_bone.iter().map(|t| t.rotation);
    turns(0).zip(turns(motion.frames.len() - 1)).filter(|(a, b)| a.angle_between(*b) > 1e-2).count()
}

/// The shirt and the trousers of this file come without weights.
fn assert_clothes_are_bound(place: &Place, file: &str) {
    let ran = place.done(&["bind", file, "-o", "dressed.armature", "--influences", "4"]);
    for said in ["shirt: takes its weights", "trousers: takes its weights", "stay as they are: body, hair"] {
        assert!(ran.err.contains(said), "{said:?} is not said: {ran:?}");
    }
    let dressed = armature_character::cache::from_bytes(&place.read("dressed.armature")).unwrap();
    let shirt = dressed.surface.parts.iter().find(|part| part.name == "shirt").unwrap();
    let rows = shirt.vertices.clone().map(|vertex| dressed.surface.influences.of_vertex(vertex as usize).count());
    let most = rows.max().unwrap();
    assert!((2..=4).contains(&most), "{most} bones at most");
    place.fails(2, "no part \"hat\"", &["bind", file, "-o", "hat.armature", "--transfer", "hat"]);
}

#[test]
fn files_of_real_exporters_are_performed_and_exported() {
    let Some(python) = tool("ARMATURE_BPY_PYTHON", "Blender") else { return };
    let Some(node) = tool("ARMATURE_GLTF_VALIDATOR", "gltfpack") else { return };
    let Some(samples) = tool("ARMATURE_SAMPLE_MODELS", "the sample models") else { return };
    let place = Place::new("exporters");
    let made = place.path("made");
    std::fs::create_dir(&made).unwrap();
    run(Command::new(&python).arg(script("blender_models.py")).arg(&made).arg(node_modules(&node)));
    run(Command::new(&python).arg(script("blender_figures.py")).arg(&made));
    let is_model =
        |path: &PathBuf| path.extension().is_some_and(|e| ["glb", "gltf", "fbx", "vrm"].iter().any(|x| e == *x));
    let mut files: BTreeMap<String, (PathBuf, bool)> = BTreeMap::new();
    let found = std::fs::read_dir(&made).unwrap().map(|entry| entry.unwrap().path()).filter(is_model);
    for path in found {
        files.insert(path.file_name().unwrap().to_string_lossy().replace('.', "_"), (path, true));
    }
    for (name, has_rig) in SAMPLES {
        let path = samples.join(name);
        assert!(path.exists(), "{}: is {} the folder of assimp-testmodels?", path.display(), samples.display());
        files.insert(name.replace(['/', '.'], "_"), (path, has_rig));
    }
    assert!(files.len() >= 37, "{files:?}");
    assert_clothes_are_bound(&place, made.join("loose_clothes.glb").to_str().unwrap());
    for (name, (path, has_rig)) in &files {
        let moved = perform(&place, path, name, *has_rig);
        assert!(moved >= 1, "{name}: nothing moves");
        println!("{name}: {moved} bones moved");
    }
    println!("{}", run(Command::new(&python).arg(script("blender_poses.py")).arg(&place.folder)));
}
