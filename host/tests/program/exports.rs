//! Exported takes in the tools that people use: the Khronos validator and a real Blender.
//!
//! `ARMATURE_GLTF_VALIDATOR` names a folder with the npm package `gltf-validator`, `ARMATURE_BPY_PYTHON` a Python that
//! has `bpy`. Without them a check prints that it is skipped; in CI it fails.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::Place;
use armature_rig::Motion;
use armature_take::{ExportSettings, FrameRate, ResampleSettings, Take, take_motion};
use armature_test_support::shared;
use serde_json::{Value, json};

const FRAMES_A_SECOND: f64 = 30.0;

pub(crate) fn tool(variable: &str, what: &str) -> Option<PathBuf> {
    let path = std::env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    if path.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "{variable} must be set in CI: {what} was not run");
        println!("SKIPPED: {variable} is not set, so {what} was not run");
    }
    path
}

pub(crate) fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests").join(name)
}

fn assert_runs(command: &mut Command) {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{text}");
    assert!(output.status.success(), "{command:?}\n{text}");
}

/// The package's own folder, the `node_modules` around it, or the folder around that.
pub(crate) fn node_modules(given: &Path) -> PathBuf {
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
pub(crate) fn motion_of(take: &Take, frames_per_second: f64, low_pass: bool) -> Motion {
    let resample = ResampleSettings { frames_per_second, low_pass, ..ResampleSettings::default() };
    let settings = ExportSettings { resample, ..ExportSettings::default() };
    take_motion(take, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap().resampled.motion
}

/// Where we expect the bones at three frames.
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

/// Exports a take both ways and gives the files to the tools that are present.
fn check_exports(place: &Place, name: &str, character: &str) {
    let take_file = format!("{name}.take");
    let motion = motion_of(&Take::read(&place.read(&take_file)).unwrap().0, FRAMES_A_SECOND, false);
    let turns = |frame: usize| motion.frames[frame].parent_from_bone.iter().map(|t| t.rotation);
    let moved = turns(0).zip(turns(motion.frames.len() / 2)).filter(|(a, b)| a.angle_between(*b) > 1e-2).count();
    assert!(moved >= 8, "{name}: only {moved} bones have moved by the middle");
    let expected = place.write(&format!("{name}.json"), expectation(&motion).to_string());
    for extension in ["glb", "bvh", "fbx", "usda", "usdz"] {
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
    // Without --character it is the take's own.
    place.done(&["export", "human.take", "--to", "again.glb", "--fps", "30"]);
    assert!(place.read("again.glb") == place.read("human.glb"));
    place.done(&["export", "human.take", "--to", "again.fbx", "--fps", "30"]);
    assert!(place.read("again.fbx") == place.read("human.fbx"));
    // What is already there stays, and no half file is left beside it.
    place.fails(2, "again.fbx", &["export", "human.take", "--to", "again.fbx", "--fps", "24"]);
    assert!(place.read("again.fbx") == place.read("human.fbx"));
    a_take_of_bones_alone(&place);
}

/// A skeleton without a mesh, given by an absolute path: it becomes an armature in Blender, and no file contains the
/// path.
fn a_take_of_bones_alone(place: &Place) {
    let bones = place.path("human.bvh");
    let bones = bones.to_str().unwrap();
    let device = format!("sim:{bones}");
    let run = ["run", "--device", &device, "--character", bones, "--record", "bones.take"];
    // A simulated puppet stands still and goes from rest into the motion before it plays a file.
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "8", "--rate", "100"]].concat());
    check_exports(place, "bones", bones);
    // The character is found next to the take.
    place.done(&["export", "bones.take", "--to", "bones-again.glb", "--fps", "30"]);
    assert!(place.read("bones-again.glb") == place.read("bones.glb"));
    let folder = place.folder.to_str().unwrap().as_bytes();
    for file in ["bones.take", "bones.glb", "bones.bvh", "bones.fbx", "bones.usdz"] {
        let bytes = place.read(file);
        assert!(!bytes.windows(folder.len()).any(|part| part == folder), "{file} contains the path on this machine");
    }
}

/// An artist's rig: its own skeleton, weights and texture, moved by a puppet with its own joints.
#[test]
fn a_take_of_the_fox() {
    let Some(fox) = shared("Fox.glb") else { return };
    let place = Place::new("exports-fox");
    let model = armature_formats::read_model("Fox.glb", &std::fs::read(&fox).unwrap(), &no_neighbours).unwrap();
    let (_, survey) = &model.motions[0];
    place.write("survey.bvh", armature_formats::motion::write_bvh(survey).unwrap());
    let fox = fox.to_str().unwrap();
    let run = ["run", "--device", "sim:survey.bvh", "--character", fox, "--record", "fox.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "3", "--rate", "100"]].concat());
    check_exports(&place, "fox", fox);

    let read = |name: &str| armature_formats::read_model(name, &place.read(name), &no_neighbours).unwrap();
    let exported = read("fox.glb");
    assert_eq!(exported.rig.as_ref().unwrap().skeleton.len(), model.rig.as_ref().unwrap().skeleton.len());
    assert!(exported.materials[0].base_color_map.is_some());
    assert_eq!(exported.materials, model.materials, "its texture must come along unchanged");
}

/// The rates of film and video, smoothed, with timecode, with all keys and with few: the tools find the bones where they
/// were, at the true times.
#[test]
fn a_take_at_the_rates_of_film() {
    let place = Place::new("exports-film");
    let run = ["run", "--device", "sim:hand", "--character", "hand", "--record", "hand.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "2.5", "--rate", "200"]].concat());
    let take = Take::read(&place.read("hand.take")).unwrap().0;
    let few = ["--reduce-keys", "0.02"];
    let splines = ["--reduce-keys", "0.02", "--splines"];
    for (fps, start) in [("24", "10:00:00:00"), ("29.97df", "00:00:59;28"), ("60", "01:02:03:04")] {
        let rate: FrameRate = fps.parse().unwrap();
        let motion = motion_of(&take, rate.frames_per_second(), true);
        let expected = place.write("expected.json", expectation(&motion).to_string());
        for (file, more) in [
            ("film.glb", &[][..]),
            ("few.glb", &few[..]),
            ("splines.glb", &splines[..]),
            ("film.bvh", &[]),
            ("film.fbx", &[]),
            ("film.usdz", &[]),
        ] {
            let export = ["export", "hand.take", "--to", file, "--fps", fps, "--low-pass", "--start-timecode", start];
            let ran = place.done(&[&export[..], more, &["--receipt", "receipt.json", "--force"]].concat());
            let timecode = format!("timecode {start} to ");
            assert!(ran.out.contains(&timecode) && ran.out.contains(&format!("{rate} a second")), "{ran:?}");
            assert!(ran.out.contains("receipt: 200.000 samples a second (200 asked for)"), "{ran:?}");
            let receipt: Value = serde_json::from_slice(&place.read("receipt.json")).unwrap();
            let (numerator, denominator) = rate.fraction();
            assert_eq!(receipt["export"]["frames_per_second"], json!([numerator, denominator]));
            assert_eq!(receipt["export"]["frames"], motion.frames.len());
            assert_eq!(receipt["export"]["timecode"][0], start);
            assert_eq!(receipt["lost_samples"], 0);
            let bytes = place.read(file);
            let text = String::from_utf8_lossy(&bytes);
            if file == "film.bvh" {
                let period: f64 =
                    text.lines().find_map(|line| line.strip_prefix("Frame Time: ")).unwrap().parse().unwrap();
                assert!((period * f64::from(numerator) / f64::from(denominator) - 1.0).abs() < 1e-15, "{period}");
                assert!(ran.err.contains("BVH has no place for timecode"), "{ran:?}");
            } else if file == "film.fbx" || file == "film.usdz" {
                assert!(text.contains("start_timecode") && text.contains(start), "{fps}");
            } else {
                assert!(text.contains(&format!("\"start_timecode\":\"{start}\"")), "{fps}");
                validate(&place.path(file));
                let keys = &receipt["export"]["keys"];
                assert_eq!(keys.is_null(), more.is_empty());
                assert!(more.is_empty() || keys["keys"].as_u64() < keys["keys_before"].as_u64(), "{receipt}");
                assert!(more.is_empty() || keys["rotation_off_degrees"].as_f64().unwrap() <= 0.02, "{receipt}");
            }
            if file == "splines.glb" {
                // Blender's import ignores the tangents of cubic splines.
                assert!(ran.err.contains("Blender's import puts its own"), "{ran:?}");
            } else {
                import_in_blender(&place.path(file), &expected);
            }
        }
    }
    place.fails(2, "BVH", &["export", "hand.take", "--to", "few.bvh", "--reduce-keys"]);
    place.fails(2, "three angles", &["export", "hand.take", "--to", "few.fbx", "--reduce-keys"]);
    place.fails(2, "29.98", &["export", "hand.take", "--to", "a.bvh", "--fps", "29.98df"]);
    place.fails(
        2,
        "00:01:00;00",
        &["export", "hand.take", "--to", "a.bvh", "--fps", "29.97df", "--start-timecode", "00:01:00;00"],
    );
    place.fails(
        2,
        "12.5",
        &["export", "hand.take", "--to", "a.bvh", "--fps", "12.5", "--start-timecode", "00:00:00:00"],
    );
    assert!(!place.path("a.bvh").exists() && !place.path("few.bvh").exists() && !place.path("few.fbx").exists());
    // An inspection prints the same receipt.
    let inspected = place.done(&["inspect", "hand.take"]);
    assert!(inspected.out.contains("receipt: 200.000 samples a second"), "{inspected:?}");
    let json: Value = serde_json::from_str(&place.done(&["inspect", "hand.take", "--json"]).out).unwrap();
    assert!((json["receipt"]["samples_per_second"].as_f64().unwrap() - 200.0).abs() < 1e-6, "{json}");
}

fn no_neighbours(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} is not expected to be read"))
}
