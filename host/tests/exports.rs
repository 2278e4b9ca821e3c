//! Exported takes in the tools of those who use them: the Khronos validator, and a real Blender.
//!
//! `ARMATURE_GLTF_VALIDATOR` names a folder with the npm package `gltf-validator`, `ARMATURE_BPY_PYTHON` a Python that
//! has `bpy`. Without them a check says loudly that it is skipped; in CI that is a failure.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use armature_rig::Motion;
use armature_take::{ExportSettings, ResampleSettings, Take, take_motion};
use common::{Place, shared};
use serde_json::{Value, json};

const FRAMES_A_SECOND: f64 = 30.0;

fn tool(variable: &str, what: &str) -> Option<PathBuf> {
    let path = std::env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    if path.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "{variable} has to be set in CI: {what} is not asked");
        println!("SKIPPED: {variable} is not set, so {what} is not asked");
    }
    path
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests").join(name)
}

fn assert_runs(command: &mut Command) {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{text}");
    assert!(output.status.success(), "{command:?}\n{text}");
}

/// The package's own folder, the `node_modules` around it, or the folder around that.
fn node_modules(given: &Path) -> PathBuf {
    let around = given.ancestors().find(|folder| folder.ends_with("node_modules"));
    around.map_or_else(|| given.join("node_modules"), Path::to_path_buf)
}

fn validate(glb: &Path) {
    let Some(validator) = tool("ARMATURE_GLTF_VALIDATOR", "the Khronos validator") else { return };
    let modules = node_modules(&validator);
    assert_runs(Command::new("node").arg(script("validate_gltf.mjs")).arg(glb).env("NODE_MODULES", modules));
}

fn import_in_blender(file: &Path, expected: &Path) {
    let Some(python) = tool("ARMATURE_BPY_PYTHON", "Blender") else { return };
    assert_runs(Command::new(python).arg(script("blender_check.py")).args([file, expected]));
}

/// What the take moves, at the rate of the export, by the library.
fn motion_of(take: &Take) -> Motion {
    let resample = ResampleSettings { frames_per_second: FRAMES_A_SECOND, ..ResampleSettings::default() };
    let settings = ExportSettings { resample, ..ExportSettings::default() };
    take_motion(take, &settings, &mut |_| ControlFlow::Continue(())).unwrap().resampled.motion
}

/// Where we say that the bones are at three frames.
fn expectation(motion: &Motion) -> Value {
    let last = motion.frames.len() - 1;
    let mut frames = motion.skeleton.rest_model_from_bone();
    let sample = |frame: usize| {
        motion.frames[frame].forward_kinematics(&motion.skeleton, &mut frames);
        let head =
            |bone: usize| (motion.skeleton.bones()[bone].name.clone(), json!(frames[bone].translation.to_array()));
        let heads: serde_json::Map<String, Value> = (0..motion.skeleton.len()).map(head).collect();
        json!({"frame": frame, "heads": heads})
    };
    let samples: Vec<Value> = [0, last / 2, last].into_iter().map(sample).collect();
    let bones: Vec<&str> = motion.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
    json!({"bones": bones, "clips": [
        {"name": "take", "frames": motion.frames.len(), "frame_seconds": motion.frame_seconds, "samples": samples}
    ]})
}

/// Exports a take both ways and shows the files to whoever is there.
fn check_exports(place: &Place, name: &str, character: &str) {
    let take_file = format!("{name}.take");
    let motion = motion_of(&Take::read(&place.read(&take_file)).unwrap().0);
    let turns = |frame: usize| motion.frames[frame].parent_from_bone.iter().map(|t| t.rotation);
    let moved = turns(0).zip(turns(motion.frames.len() / 2)).filter(|(a, b)| a.angle_between(*b) > 1e-2).count();
    assert!(moved >= 8, "{name}: only {moved} bones have moved by the middle");
    let expected = place.write(&format!("{name}.json"), expectation(&motion).to_string());
    for extension in ["glb", "bvh"] {
        let file = format!("{name}.{extension}");
        let ran = place.done(&["export", &take_file, "--to", &file, "--fps", "30", "--character", character]);
        let said = format!("{file}: {} frames at 30 a second, {} bones", motion.frames.len(), motion.skeleton.len());
        assert!(ran.out.starts_with(&said), "{ran:?}");
        let path = place.path(&file);
        if extension == "glb" {
            validate(&path);
        }
        import_in_blender(&path, &expected);
    }
}

#[test]
fn a_take_of_the_human() {
    let place = Place::new("exports-human");
    let run = ["run", "--device", "sim:human", "--character", "human", "--record", "human.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "2.5", "--rate", "100"]].concat());
    check_exports(&place, "human", "human");
    // Without --character it is the one of the take.
    place.done(&["export", "human.take", "--to", "again.glb", "--fps", "30"]);
    assert!(place.read("again.glb") == place.read("human.glb"));
}

/// An artist's rig: its own skeleton, weights and texture, moved by a puppet with its own joints.
#[test]
fn a_take_of_the_fox() {
    let Some(fox) = shared("Fox.glb") else { return };
    let place = Place::new("exports-fox");
    let model = armature_formats::read_model("Fox.glb", &std::fs::read(&fox).unwrap(), &no_neighbours).unwrap();
    let (_, survey) = &model.motions[0];
    place.write("survey.bvh", armature_formats::write_bvh(survey).unwrap());
    let fox = fox.to_str().unwrap();
    let run = ["run", "--device", "sim:survey.bvh", "--character", fox, "--record", "fox.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "3", "--rate", "100"]].concat());
    check_exports(&place, "fox", fox);

    let read = |name: &str| armature_formats::read_model(name, &place.read(name), &no_neighbours).unwrap();
    let exported = read("fox.glb");
    assert_eq!(exported.rig.as_ref().unwrap().skeleton.len(), model.rig.as_ref().unwrap().skeleton.len());
    assert_eq!(exported.texture.map(|t| t.bytes), model.texture.map(|t| t.bytes), "its texture came along untouched");
}

fn no_neighbours(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} is not expected to be asked for"))
}
