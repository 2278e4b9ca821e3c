//! Converts a rigged glTF or a BVH file to GLB or BVH, and writes what another program should find in it.
//!
//! `cargo run -p armature-formats --example convert -- IN.glb OUT.bvh [EXPECTED.json]`
//!
//! The third file is what `tests/blender_check.py` compares an import in Blender with.

use std::error::Error;
use std::path::Path;

use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, write_glb};
use armature_formats::motion::{read_bvh, write_bvh};
use armature_formats::read_model;
use armature_rig::Motion;
use glam::Affine3A;
use serde_json::{Map, Value, json};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, rest @ ..] = arguments.as_slice() else {
        return Err("usage: convert IN.glb|IN.gltf|IN.bvh OUT.glb|OUT.bvh [EXPECTED.json]".into());
    };
    let bytes = std::fs::read(input)?;
    let folder = Path::new(input).parent().unwrap_or(Path::new("."));
    let beside = |name: &str| std::fs::read(folder.join(name)).map_err(|error| error.to_string());

    let (model, motions) = if is_bvh(input) {
        let read = read_bvh(&bytes).map_err(|error| error.in_file(input))?;
        for warning in &read.warnings {
            eprintln!("{input}: {warning}");
        }
        (None, vec![("motion".to_owned(), read.motion)])
    } else {
        let model = read_model(input, &bytes, &beside)?;
        for warning in &model.warnings {
            eprintln!("{input}: {warning}");
        }
        let motions = model.motions.clone();
        (Some(model), motions)
    };
    let (name, first) = motions.first().ok_or("there is no motion in the file")?;
    let written: &[(String, Motion)] = if is_bvh(output) {
        std::fs::write(output, write_bvh(first)?)?;
        println!("{output}: {name}, {} bones, {} frames", first.skeleton.len(), first.frames.len());
        &motions[..1]
    } else {
        let scene = GlbScene {
            name: model.as_ref().map_or("motion", |m| m.name.as_str()),
            skeleton: &first.skeleton,
            mesh: model.as_ref().map(GlbMesh::of_model),
            clips: motions.iter().map(|(name, motion)| GlbClip::of_motion(name, motion)).collect(),
        };
        std::fs::write(output, write_glb(&scene)?)?;
        println!("{output}: {} bones, {} clips", first.skeleton.len(), motions.len());
        &motions
    };
    if let Some(expected) = rest.first() {
        let clips: Vec<Value> = written.iter().map(|(name, motion)| expected_clip(name, motion)).collect();
        let bones: Vec<&str> = first.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
        std::fs::write(expected, serde_json::to_vec_pretty(&json!({ "bones": bones, "clips": clips }))?)?;
    }
    Ok(())
}

fn is_bvh(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bvh"))
}

/// Bone heads at the first, a middle and the last frame.
fn expected_clip(name: &str, motion: &Motion) -> Value {
    let last = motion.frames.len().saturating_sub(1);
    let samples: Vec<Value> = [0, last / 3, last]
        .iter()
        .filter(|&&frame| frame < motion.frames.len())
        .map(|&frame| {
            let mut world = vec![Affine3A::IDENTITY; motion.skeleton.len()];
            motion.frames[frame].forward_kinematics(&motion.skeleton, &mut world);
            let heads: Map<String, Value> = motion
                .skeleton
                .bones()
                .iter()
                .zip(&world)
                .map(|(bone, frame)| (bone.name.clone(), json!(frame.translation.to_array())))
                .collect();
            json!({ "frame": frame, "heads": heads })
        })
        .collect();
    json!({ "name": name, "frames": motion.frames.len(), "frame_seconds": motion.frame_seconds, "samples": samples })
}
