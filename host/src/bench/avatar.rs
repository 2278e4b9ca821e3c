//! An avatar as people have them: layers of clothes over a body, 60,000 triangles and 40 blend shapes in a VRM file. How
//! long it takes to open, compared with Blender's importer of glTF if `bpy` is installed, and what its shapes cost a frame,
//! compared with a plain skin of the same size.

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_character::Character;
use armature_character::bind::{BindSettings, bind};
use armature_deform::skin::SkinError;
use armature_formats::gltf::{GlbScene, write_glb};
use armature_formats::model::{MeshPart, MorphTarget};
use armature_formats::{FormatError, read_model};
use armature_geometry::{Influences, TriangleMesh};
use glam::{Affine3A, Quat};
use serde_json::json;

use super::{Measurement, median, of_peer, python_peer, time_runs};
use crate::characters::LoadedCharacter;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &["avatar/open", "avatar/frame"];

const OPENINGS: usize = 5;
const FRAMES: usize = 200;
const TRIANGLES: usize = 60_000;
const SHAPES: usize = 40;
const PEER: &str = "Blender's importer";
const PEER_SCRIPT: &str = "blender_open.py";

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let file = avatar()?;
    let opened = time_runs(OPENINGS, || {
        let _ = open(&file);
    });
    let character = open(&file)?;
    let mut open = Measurement::new(NAMES[0], median(&opened), "s", OPENINGS);
    if let Some(python) = &args.bpy_python {
        let path = std::env::temp_dir().join(format!("armature-bench-avatar-{}.glb", std::process::id()));
        std::fs::write(&path, &file).map_err(|e| Failure::input(format!("{}: {e}", path.display()), ""))?;
        let peer = python_peer(python, PEER_SCRIPT, &[&path], "pip install bpy");
        // A left-over in the system's temporary folder does no harm.
        let _ = std::fs::remove_file(&path);
        open.peer = of_peer(&peer?, "seconds", PEER);
        if let Some((_, theirs)) = &open.peer {
            open.budget = Some(("at most a third of Blender's importer", 3.0 * open.value <= *theirs));
        }
    }
    let [plain, shaped] = frames(&character)?;
    let mut frame = Measurement::new(NAMES[1], shaped * 1e3, "ms", FRAMES);
    frame.budget = Some(("at most twice a plain skin", shaped <= 2.0 * plain));
    frame.peer = Some(("a plain skin".to_owned(), plain * 1e3));
    Ok(vec![open, frame])
}

/// From the bytes to what is posed and drawn.
fn open(file: &[u8]) -> Result<LoadedCharacter, Failure> {
    let alone = |name: &str| Err(format!("{name} is not there"));
    let model = read_model("avatar.vrm", file, &alone).map_err(|e| defect(&e.to_string()))?;
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    let character = bind(model, None, &BindSettings::default(), go_on).map_err(|e| defect(&e.to_string()))?;
    let (loaded, _) = LoadedCharacter::bound("avatar.vrm", character);
    loaded.precompute_skin()?;
    loaded.precompute_morphs()?;
    Ok(loaded)
}

/// Median seconds of a frame, of the skin alone and with all shapes changing as well.
fn frames(character: &LoadedCharacter) -> Result<[f64; 2], Failure> {
    let (Some(mut skin), Some(mut morphs)) = (character.precompute_skin()?, character.precompute_morphs()?) else {
        return Err(defect("the avatar has no shapes"));
    };
    let Some(shape) = &character.shape else { return Err(defect("the avatar has no mesh")) };
    let (mut positions, mut normals) = (shape.positions.clone(), shape.normals().to_vec());
    let mut world = vec![Affine3A::IDENTITY; character.skeleton.len()];
    let mut number = 0.0_f32;
    let mut outcome: Result<(), SkinError> = Ok(());
    let mut weights = vec![0.0; morphs.target_count()];
    let [plain, shaped] = [false, true].map(|with_shapes| {
        median(&time_runs(FRAMES, || {
            number += 0.01;
            let mut pose = character.skeleton.rest_pose();
            pose.parent_from_bone.iter_mut().for_each(|local| local.rotation *= Quat::from_rotation_x(number.sin()));
            pose.forward_kinematics(&character.skeleton, &mut world);
            let mut solve = || -> Result<(), SkinError> {
                if with_shapes {
                    weights.iter_mut().zip(0..).for_each(|(weight, k)| *weight = (number + k as f32).sin().abs());
                    if morphs.solve(&weights)? {
                        skin.set_rest(&morphs)?;
                    }
                }
                skin.solve(&world, &mut positions, &mut normals)
            };
            outcome = outcome.clone().and(solve());
        }))
    });
    outcome.map_err(|e| defect(&e.to_string()))?;
    Ok([plain, shaped])
}

/// The program's human in as many layers as it takes, with shapes of its face, as a VRM 1.0 file.
fn avatar() -> Result<Vec<u8>, Failure> {
    let human = armature_character::own::human().map_err(|e| defect(&e.to_string()))?;
    let layers = TRIANGLES.div_ceil(human.surface.mesh.triangles.len());
    let layered = layered(&human, layers)?;
    let mesh = Some(layered.glb_mesh());
    let scene = GlbScene { name: "avatar", skeleton: &layered.skeleton, mesh, clips: Vec::new() };
    let glb = write_glb(&scene).map_err(|e: FormatError| defect(&e.to_string()))?;
    with_avatar(&glb).ok_or_else(|| defect("the file is no GLB"))
}

fn layered(human: &Character, layers: usize) -> Result<Character, Failure> {
    let own = &*human.surface;
    let (vertices, triangles) = (own.mesh.vertices.len() as u32, own.mesh.triangles.len() as u32);
    let (low, high) = own.mesh.bounds().unwrap_or_default();
    let height = high[1] - low[1];
    let mut mesh = TriangleMesh::default();
    let mut surface = own.clone();
    (surface.parts, surface.morph_targets, surface.normals) = (Vec::new(), Vec::new(), Vec::new());
    for layer in 0..layers as u32 {
        let out = 0.004 * height * f64::from(layer);
        let moved = own.mesh.vertices.iter().zip(&own.normals);
        mesh.vertices.extend(moved.map(|(p, n)| -> [f64; 3] { std::array::from_fn(|k| p[k] + out * f64::from(n[k])) }));
        mesh.triangles.extend(own.mesh.triangles.iter().map(|t| t.map(|v| v + layer * vertices)));
        surface.normals.extend(&own.normals);
        surface.parts.push(MeshPart {
            name: format!("layer {layer}"),
            vertices: layer * vertices..(layer + 1) * vertices,
            triangles: layer * triangles..(layer + 1) * triangles,
            material: Some(0),
            ..MeshPart::default()
        });
    }
    // Shapes of the face: the head of the innermost layer.
    for number in 0..SHAPES {
        let offset = |p: &[f64; 3]| {
            let up = (p[1] - low[1]) / height;
            if up < 0.86 { [0.0; 3] } else { [0.0, 0.01 * (40.0 * up + number as f64).sin() as f32, 0.005] }
        };
        let positions = own.mesh.vertices.iter().map(offset).collect();
        surface.morph_targets.push(MorphTarget {
            name: format!("shape {number}"),
            positions,
            ..MorphTarget::default()
        });
    }
    let influences = &own.influences;
    surface.influences = Influences::restore(
        influences.per_vertex(),
        influences.bones().repeat(layers),
        influences.weights().repeat(layers),
        human.skeleton.len(),
    )
    .map_err(|e| defect(&e.to_string()))?;
    surface.mesh = mesh;
    Ok(Character { surface: Arc::new(surface), ..human.clone() })
}

/// A GLB with an extension that says which node is the hips and what its expressions are.
fn with_avatar(glb: &[u8]) -> Option<Vec<u8>> {
    let length = u32::from_le_bytes(glb.get(12..16)?.try_into().ok()?) as usize;
    let mut root: serde_json::Value = serde_json::from_slice(glb.get(20..20 + length)?).ok()?;
    let nodes = root["nodes"].as_array()?;
    let skinned = nodes.iter().position(|node| node.get("mesh").is_some())?;
    let hips = root["skins"][0]["joints"][0].clone();
    let expression = |index: usize| {
        let bind = json!({ "node": skinned, "index": index, "weight": 1.0 });
        (format!("expression {index}"), json!({ "morphTargetBinds": [bind] }))
    };
    let custom: serde_json::Map<String, serde_json::Value> = (0..SHAPES).map(expression).collect();
    root["extensions"]["VRMC_vrm"] = json!({
        "specVersion": "1.0",
        "meta": { "name": "avatar", "authors": ["armature"], "licenseUrl": "https://vrm.dev/licenses/1.0/" },
        "humanoid": { "humanBones": { "hips": { "node": hips } } },
        "expressions": { "custom": custom },
    });
    root["extensionsUsed"] = json!(["VRMC_vrm"]);
    let mut text = serde_json::to_vec(&root).ok()?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[20 + length..];
    let word = |number: usize| (number as u32).to_le_bytes();
    let head = [&glb[..8], &word(20 + text.len() + rest.len()), &word(text.len()), b"JSON"].concat();
    Some([head.as_slice(), &text, rest].concat())
}

fn defect(what: &str) -> Failure {
    Failure::not_converged(what.to_owned(), "this is a defect; please report it")
}
