//! USD files that we write, read by USD itself and by Blender.
//!
//! `ARMATURE_USD_PYTHON` names a Python that has `usd-core`, `ARMATURE_BPY_PYTHON` one that has Blender's module. Without
//! them a check prints that it is skipped; in CI it fails.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod figure;

use std::path::{Path, PathBuf};
use std::process::Command;

use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, GlbTimes};
use armature_formats::model::{MeshPart, Model};
use armature_formats::usd::{write_usda, write_usdz};
use armature_rig::Skeleton;
use figure::{FRAME_SECONDS, Noise, bpy, character, expectation, motion, skeleton};

fn usd() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_USD_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_USD_PYTHON must be set in CI: USD was not run");
        println!("SKIPPED: ARMATURE_USD_PYTHON is not set, so USD was not run");
    }
    python
}

fn check(python: &Path, script: &str, file: &Path, expected: &Path) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests").join(script);
    let output = Command::new(python).arg(script).args([file, expected]).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{said}");
    assert!(output.status.success(), "{}: {said}", file.display());
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn usd_finds_bones_weights_shapes_and_curves() {
    let Some(python) = usd() else { return };
    let folder = folder("usd");
    for (k, frame_seconds) in FRAME_SECONDS.into_iter().enumerate() {
        let mut noise = Noise(k as u64 + 3);
        let skeleton = skeleton(&mut noise, false);
        let (model, influences, skins) = character(&mut noise, &skeleton);
        let motion = motion(&mut noise, &skeleton, frame_seconds, false);
        let mesh = GlbMesh { influences: Some(&influences), skins: &skins, ..GlbMesh::of_model(&model) };
        let clips = vec![GlbClip::of_motion("take", &motion)];
        let scene = GlbScene { name: "figure", skeleton: &skeleton, mesh: Some(mesh), clips };
        let expected = folder.join(format!("{k}.json"));
        std::fs::write(&expected, expectation(&motion, &model, &influences, &skins).to_string()).unwrap();
        let text = write_usda(&scene, &[]).unwrap();
        assert!(text.left_out.len() == 1 && text.left_out[0].contains("images"), "{:?}", text.left_out);
        let package = write_usdz(&scene, &[("start_timecode".to_owned(), "01:00:00:00".to_owned())]).unwrap();
        assert!(package.left_out.is_empty(), "{:?}", package.left_out);
        for (extension, file) in [("usda", text), ("usdz", package)] {
            let path = folder.join(format!("{k}.{extension}"));
            std::fs::write(&path, file.bytes).unwrap();
            check(&python, "usd_check.py", &path, &expected);
        }
    }
}

/// Scales of bones are kept in half precision, and that is said.
#[test]
fn scaled_bones_lose_digits_and_that_is_said() {
    let mut noise = Noise(3);
    let skeleton = skeleton(&mut noise, true);
    let motion = motion(&mut noise, &skeleton, 0.04, true);
    let clips = vec![GlbClip::of_motion("take", &motion)];
    let file = write_usda(&GlbScene { name: "figure", skeleton: &skeleton, mesh: None, clips }, &[]).unwrap();
    assert!(file.left_out.len() == 1 && file.left_out[0].contains("half precision"), "{:?}", file.left_out);
}

#[test]
fn blender_finds_bones_weights_shapes_and_curves() {
    let Some(python) = bpy() else { return };
    let folder = folder("usd-blender");
    for (k, frame_seconds) in FRAME_SECONDS.into_iter().enumerate() {
        let mut noise = Noise(k as u64 + 3);
        let skeleton = skeleton(&mut noise, false);
        let (model, influences, _) = character(&mut noise, &skeleton);
        let parts: Vec<MeshPart> = model.parts.iter().map(|part| MeshPart { skin: None, ..part.clone() }).collect();
        let motion = motion(&mut noise, &skeleton, frame_seconds, false);
        let mesh = GlbMesh { influences: Some(&influences), parts: &parts, ..GlbMesh::of_model(&model) };
        let clips = vec![GlbClip::of_motion("take", &motion)];
        let scene = GlbScene { name: "figure", skeleton: &skeleton, mesh: Some(mesh), clips };
        let expected = folder.join(format!("{k}.json"));
        std::fs::write(&expected, expectation(&motion, &model, &influences, &[]).to_string()).unwrap();
        let path = folder.join(format!("{k}.usdz"));
        std::fs::write(&path, write_usdz(&scene, &[]).unwrap().bytes).unwrap();
        check(&python, "blender_check.py", &path, &expected);
    }
}

#[test]
fn bones_alone_a_mesh_alone_and_nonsense() {
    let mut noise = Noise(5);
    let skeleton = skeleton(&mut noise, false);
    let rest = vec![skeleton.rest_pose()];
    let clips = vec![GlbClip { name: "rest\n\"1\"", times: GlbTimes::EverySeconds(0.5), poses: &rest, weights: &[] }];
    let bones = GlbScene { name: "7 \" {x}", skeleton: &skeleton, mesh: None, clips: clips.clone() };
    let text = String::from_utf8(write_usda(&bones, &[]).unwrap().bytes).unwrap();
    assert!(text.contains("defaultPrim = \"_7____x_\"") && text.contains("displayName = \"rest \\\"1\\\"\""), "{text}");

    let empty = Skeleton::default();
    let (model, ..) = character(&mut noise, &skeleton);
    let plain = Model { parts: Vec::new(), morph_targets: Vec::new(), ..model.clone() };
    let still = GlbScene { name: "still", skeleton: &empty, mesh: Some(GlbMesh::of_model(&plain)), clips: Vec::new() };
    let text = String::from_utf8(write_usda(&still, &[]).unwrap().bytes).unwrap();
    assert!(text.contains("def Xform \"still\"") && !text.contains("Skel"), "{text}");
    let parts: Vec<MeshPart> = model.parts.iter().map(|part| MeshPart { skin: None, ..part.clone() }).collect();
    let shaped = GlbScene { mesh: Some(GlbMesh { parts: &parts, ..GlbMesh::of_model(&model) }), ..still.clone() };
    let left_out = write_usda(&shaped, &[]).unwrap().left_out;
    assert!(left_out.iter().any(|said| said.contains("blend shapes only with a skeleton")), "{left_out:?}");

    let fails = |scene: &GlbScene| write_usda(scene, &[]).unwrap_err().to_string();
    let nothing = GlbScene { name: "x", skeleton: &empty, mesh: None, clips: Vec::new() };
    assert!(fails(&nothing).starts_with("USD: there is neither"), "{}", fails(&nothing));
    let unbound = GlbScene { skeleton: &skeleton, ..still.clone() };
    assert!(fails(&unbound).contains("follows no bones"));
    let mut wild = rest.clone();
    wild[0].parent_from_bone[1].translation.x = f32::NAN;
    let times = |times, poses| vec![GlbClip { name: "c", times, poses, weights: &[] }];
    for clips in [
        times(GlbTimes::EverySeconds(f64::NAN), &rest[..]),
        times(GlbTimes::EverySeconds(0.5), &wild[..]),
        times(GlbTimes::EverySeconds(0.5), &[][..]),
        times(GlbTimes::At(&[1e300]), &rest[..]),
    ] {
        assert!(fails(&GlbScene { clips, ..bones.clone() }).starts_with("USD: "));
    }
}
