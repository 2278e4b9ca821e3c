//! VRM animations of real motion capture, read by `@pixiv/three-vrm-animation`.
//!
//! `ARMATURE_GLTF_VALIDATOR` names a folder with npm packages. Without it a check prints that it is skipped; in CI it
//! fails.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

use std::path::{Path, PathBuf};
use std::process::Command;

use armature_formats::motion::{read_bvh, write_vrma};
use armature_rig::{HumanoidBone, HumanoidPart, Motion, Side, humanoid_motion, recognise};
use armature_test_support::shared_bytes;
use glam::Vec3;
use serde_json::{Map, Value, json};

fn node_modules() -> Option<PathBuf> {
    let given = std::env::var_os("ARMATURE_GLTF_VALIDATOR").filter(|value| !value.is_empty()).map(PathBuf::from);
    let Some(given) = given else {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_GLTF_VALIDATOR must be set in CI: three-vrm-animation was not run");
        println!("SKIPPED: ARMATURE_GLTF_VALIDATOR is not set, so three-vrm-animation was not run");
        return None;
    };
    Some(
        given
            .ancestors()
            .find(|f| f.ends_with("node_modules"))
            .map_or_else(|| given.join("node_modules"), Path::to_path_buf),
    )
}

/// Where the limbs of the motion itself point, by where its bones begin: nothing of a T-pose is in this.
fn expectation(motion: &Motion) -> Value {
    let recognition = recognise(&motion.skeleton);
    let find = |part, side| recognition.find(HumanoidBone { part, side });
    let hips = find(HumanoidPart::Hips, None).unwrap();
    let limbs = [
        (HumanoidPart::UpperArm, HumanoidPart::LowerArm),
        (HumanoidPart::LowerArm, HumanoidPart::Hand),
        (HumanoidPart::UpperLeg, HumanoidPart::LowerLeg),
        (HumanoidPart::LowerLeg, HumanoidPart::Foot),
    ];
    let mut frames = motion.skeleton.rest_model_from_bone();
    let last = motion.frames.len() - 1;
    let sample = |frame: usize| {
        motion.frames[frame].forward_kinematics(&motion.skeleton, &mut frames);
        let head = |bone: usize| Vec3::from(frames[bone].translation);
        let mut directions = Map::new();
        for (part, next) in limbs {
            for side in [Side::Left, Side::Right].map(Some) {
                let (from, to) = (find(part, side).unwrap(), find(next, side).unwrap());
                let direction = (head(to) - head(from)).normalize();
                directions.insert(HumanoidBone { part, side }.to_string(), json!(direction.to_array()));
            }
        }
        json!({"frame": frame, "hips": head(hips).to_array(), "limbs": directions})
    };
    let samples: Vec<Value> = [0, last / 4, last / 2, 3 * last / 4, last].into_iter().map(sample).collect();
    let human = humanoid_motion(motion).unwrap();
    let bones: Vec<&str> = human.skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
    json!({"frames": motion.frames.len(), "frame_seconds": motion.frame_seconds, "bones": bones, "samples": samples})
}

#[test]
fn limbs_point_where_those_of_the_motion_do() {
    for name in ["freebvh", "mocapbank"] {
        let Some(bytes) = shared_bytes(&format!("mocap/{name}.bvh")) else { return };
        let motion = read_bvh(&bytes).unwrap().motion;
        for (k, frame_seconds) in
            [motion.frame_seconds, 1.0 / 24.0, 1001.0 / 30_000.0, 1.0 / 60.0].into_iter().enumerate()
        {
            let motion = Motion { frame_seconds, ..motion.clone() };
            let file = write_vrma("actor", "take", &motion).unwrap();
            assert!(file.left_out.iter().all(|said| said.contains("share")), "{:?}", file.left_out);
            let Some(modules) = node_modules() else { return };
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vrma");
            std::fs::create_dir_all(&folder).unwrap();
            let (vrma, expected) = (folder.join(format!("{name}{k}.vrma")), folder.join(format!("{name}{k}.json")));
            std::fs::write(&vrma, file.bytes).unwrap();
            std::fs::write(&expected, expectation(&motion).to_string()).unwrap();
            let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/vrma_check.mjs");
            let output = Command::new("node")
                .arg(script)
                .args([&vrma, &expected])
                .env("NODE_MODULES", modules)
                .output()
                .unwrap();
            let said =
                format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            println!("{name}: {said}");
            assert!(output.status.success(), "{name}: {said}");
        }
    }
}

#[test]
fn what_is_no_human_is_refused() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let fox = armature_formats::read_model("Fox.glb", &bytes, &|name| Err(name.to_owned())).unwrap();
    let error = write_vrma("fox", "run", &fox.motions[0].1).unwrap_err();
    assert!(error.to_string().starts_with("VRMA: the skeleton is not recognised as a human"), "{error}");
}
