//! Takes in all formats, several at once, in other programs' dress, and motions on other characters.

use crate::common::Place;
use armature_formats::motion::read_bvh;
use armature_rig::{HumanoidBone, HumanoidPart, Side, recognise};
use armature_take::Take;
use armature_test_support::shared;
use glam::Vec3;

fn recorded(name: &str) -> Place {
    let place = Place::new(name);
    let run = ["run", "--device", "sim:human", "--character", "human", "--virtual-clock", "--rate", "100", "--quiet"];
    place.done(&[&run[..], &["--seconds", "1.5", "--record", "a.take"]].concat());
    place
}

#[test]
fn every_format_is_written() {
    let place = recorded("travel");
    let begins = |file: &str, bytes: &[u8]| {
        let found = place.read(file);
        assert!(found.starts_with(bytes), "{file}: {:?}", &found[..8]);
    };
    for extension in ["usda", "usdz", "vrma", "csv", "npz", "mcap"] {
        let file = format!("a.{extension}");
        let ran = place.done(&["export", "a.take", "--to", &file, "--fps", "24"]);
        assert!(ran.out.contains("receipt: 100.000 samples a second"), "{ran:?}");
        let has_samples = ["csv", "npz", "mcap"].contains(&extension);
        assert_eq!(ran.out.contains("samples at the device's times"), has_samples, "{ran:?}");
        // What is there stays.
        place.fails(2, &file, &["export", "a.take", "--to", &file]);
    }
    begins("a.usda", b"#usda 1.0");
    begins("a.usdz", b"PK");
    begins("a.vrma", b"glTF");
    begins("a.csv", b"time,sequence,device_micros,count:");
    begins("a.npz", b"PK");
    begins("a.mcap", b"\x89MCAP0");
    let take = Take::read(&place.read("a.take")).unwrap().0;
    let rows = String::from_utf8(place.read("a.csv")).unwrap().lines().count();
    assert_eq!(rows, take.samples().count() + 1);
    // An edited take has frames in place of samples.
    place.done(&["edit", "a.edit", "new", "a.take"]);
    place.done(&["edit", "a.edit", "trim", "0.5", "1.0"]);
    for extension in ["csv", "npz", "mcap", "usdz"] {
        let file = format!("edited.{extension}");
        let ran = place.done(&["export", "a.edit", "--to", &file, "--fps", "24"]);
        assert!(ran.out.contains("13 frames at 24 a second"), "{ran:?}");
    }
    // Those that cannot be are refused before anything is written.
    for (why, more) in [
        ("no mesh", &["--shape", "smile=1", "--to", "b.csv"][..]),
        ("list of keys", &["--reduce-keys", "--to", "b.usdz"]),
        ("says its own", &["--unit", "cm", "--to", "b.glb"]),
        ("holds the take as it is", &["--rest", "t", "--to", "b.mcap"]),
        ("vrma", &["--to", "b.xyz"]),
    ] {
        place.fails(2, why, &[&["export", "a.take"], more].concat());
    }
    for file in ["b.csv", "b.usdz", "b.glb", "b.mcap"] {
        assert!(!place.path(file).exists(), "{file}");
    }
    place.fails(3, "not recognised as a human", &{
        let run = ["run", "--device", "sim:spider", "--character", "spider", "--virtual-clock", "--quiet"];
        place.done(&[&run[..], &["--seconds", "1", "--record", "spider.take"]].concat());
        ["export", "spider.take", "--to", "spider.vrma"]
    });
}

#[test]
fn several_takes_go_into_a_folder() {
    let place = recorded("travel-several");
    std::fs::copy(place.path("a.take"), place.path("b.take")).unwrap();
    place.fails(2, "one file", &["export", "a.take", "b.take", "--to", "both.glb"]);
    std::fs::create_dir(place.path("out")).unwrap();
    place.fails(2, "--format", &["export", "a.take", "b.take", "--to", "out"]);
    place.fails(2, "would both become", &["export", "a.take", "a.take", "--to", "out", "--format", "bvh"]);
    place.done(&["export", "a.take", "b.take", "--to", "out", "--format", "bvh"]);
    assert!(place.read("out/a.bvh") == place.read("out/b.bvh"));
    // One that is damaged does not keep the others from being written.
    place.write("broken.take", "no take");
    let force = ["--to", "out", "--format", "bvh", "--force"];
    let ran = place.fails(3, "broken.take", &[&["export", "broken.take", "b.take"], &force[..]].concat());
    assert!(ran.out.contains("b.bvh"), "{ran:?}");
    assert!(!place.path("out/broken.bvh").exists());
}

#[test]
fn skeletons_as_other_programs_want_them() {
    let place = recorded("travel-dress");
    let export = ["export", "a.take", "--fps", "30", "--to"];
    place.done(&[&export[..], &["plain.bvh"]].concat());
    let dress = ["--names", "mixamo", "--rest", "t", "--rest-first", "--unit", "cm", "--rotation-order", "xyz"];
    place.done(&[&export[..], &["dressed.bvh"], &dress[..]].concat());
    let text = String::from_utf8(place.read("dressed.bvh")).unwrap();
    assert!(text.contains("mixamorig:Hips") && text.contains("Xrotation Yrotation Zrotation"), "{}", &text[..300]);
    let read = |file: &str| read_bvh(&place.read(file)).unwrap().motion;
    let (plain, dressed) = (read("plain.bvh"), read("dressed.bvh"));
    assert_eq!(dressed.frames.len(), plain.frames.len() + 1);
    // At rest the arms are straight out; then everything is where it was, in centimetres.
    let heads = |motion: &armature_rig::Motion, frame: usize| {
        let mut frames = motion.skeleton.rest_model_from_bone();
        motion.frames[frame].forward_kinematics(&motion.skeleton, &mut frames);
        frames.iter().map(|frame| Vec3::from(frame.translation)).collect::<Vec<_>>()
    };
    let recognised = recognise(&dressed.skeleton);
    let find = |part| recognised.find(HumanoidBone { part, side: Some(Side::Left) }).unwrap();
    let rest = heads(&dressed, 0);
    let arm = (rest[find(HumanoidPart::LowerArm)] - rest[find(HumanoidPart::UpperArm)]).normalize();
    assert!(arm.distance(Vec3::X) < 1e-3, "{arm}");
    for frame in [0, 10, plain.frames.len() - 1] {
        let (before, after) = (heads(&plain, frame), heads(&dressed, frame + 1));
        let off = before.iter().zip(&after).map(|(a, b)| (100.0 * *a).distance(*b)).fold(0.0, f32::max);
        assert!(off < 0.01, "frame {frame}: {off} cm");
    }
    // A mesh follows as before: it is bound where it was.
    for file in ["dressed.glb", "dressed.fbx", "dressed.usdz"] {
        place.done(&[&export[..], &[file, "--rest", "t", "--names", "unreal"]].concat());
    }
    place.done(&[&export[..], &["plain.glb"]].concat());
    let model =
        |file: &str| armature_formats::read_model(file, &place.read(file), &|name| Err(name.to_owned())).unwrap();
    let (plain, dressed) = (model("plain.glb"), model("dressed.glb"));
    assert!(dressed.rig.as_ref().unwrap().skeleton.find("upperarm_l").is_some());
    assert_eq!(plain.mesh.triangles.len(), dressed.mesh.triangles.len());
    let skinned = |model: &armature_formats::model::Model, frame: usize| {
        let (rig, motion) = (model.rig.as_ref().unwrap(), &model.motions[0].1);
        let rest: Vec<_> = rig.skeleton.rest_model_from_bone().iter().map(glam::Affine3A::inverse).collect();
        let mut frames = rig.skeleton.rest_model_from_bone();
        motion.frames[frame].forward_kinematics(&rig.skeleton, &mut frames);
        let place = |vertex: usize| {
            let shown = Vec3::from(model.mesh.vertices[vertex].map(|c| c as f32));
            let moved = |(bone, weight): (u16, f32)| {
                weight * (frames[usize::from(bone)] * rest[usize::from(bone)]).transform_point3(shown)
            };
            rig.influences.of_vertex(vertex).map(moved).sum::<Vec3>()
        };
        (0..model.mesh.vertices.len()).map(place).collect::<Vec<_>>()
    };
    let (before, after) = (skinned(&plain, 20), skinned(&dressed, 20));
    if before.len() == after.len() {
        let mut off: Vec<f32> = before.iter().zip(&after).map(|(a, b)| a.distance(*b)).collect();
        off.sort_by(f32::total_cmp);
        println!("median {} of {} vertices, worst {}", off[off.len() / 2], off.len(), off[off.len() - 1]);
        assert!(off[off.len() / 2] < 1e-4, "the mesh moves otherwise");
    }
}

#[test]
fn motions_move_other_characters() {
    let Some(walk) = shared("mocap/freebvh.bvh") else { return };
    let place = Place::new("travel-retarget");
    let walk = walk.to_str().unwrap();
    let ran = place.done(&["retarget", walk, "--character", "human", "-o", "human.take"]);
    assert!(ran.out.contains("bones moved, the way scaled by") && ran.out.contains("feet kept in place"), "{ran:?}");
    let take = Take::read(&place.read("human.take")).unwrap().0;
    assert_eq!((take.header().character_name.as_str(), take.poses().count()), ("human", 69));
    // It is a take like any other, but has no samples.
    for extension in ["glb", "usdz", "bvh", "csv"] {
        let ran = place.done(&["export", "human.take", "--to", &format!("human.{extension}"), "--fps", "30"]);
        assert!(ran.out.contains("69 frames at 30 a second"), "{ran:?}");
    }
    place.fails(3, "no samples", &["replay", "human.take"]);
    place.done(&["replay", "human.take", "--at", "1", "--picture", "human.png"]);
    // Directly into a format, at the motion's own rate.
    let direct = place.done(&["retarget", walk, "--character", "human", "-o", "direct.glb"]);
    assert!(direct.out.contains("69 frames at 30 a second"), "{direct:?}");
    // Motion files are exported like takes.
    let ran = place.done(&["export", walk, "--to", "plain.usda", "--fps", "30"]);
    assert!(ran.out.contains("69 frames at 30 a second"), "{ran:?}");
    // And a take moves another character.
    std::fs::copy(shared("mocap/mocapbank.bvh").unwrap(), place.path("actor.bvh")).unwrap();
    place.done(&["retarget", "human.take", "--character", "actor.bvh", "-o", "actor.bvh.take", "--fps", "25"]);
    place.fails(2, "xyz", &["retarget", walk, "--character", "human", "-o", "a.xyz"]);
    place.fails(2, "one motion", &["retarget", walk, "--character", "human", "--clip", "walk", "-o", "a.take"]);
    place.fails(3, "go together", &["retarget", walk, "--character", "spider", "-o", "spider.take"]);
    if let Some(fox) = shared("Fox.glb") {
        let fox = fox.to_str().unwrap();
        let run = ["retarget", fox, "--character", fox, "--clip", "Run", "-o", "run.take"];
        place.done(&run);
        place.fails(2, "Survey", &["retarget", fox, "--character", fox, "--clip", "Fly", "-o", "fly.take"]);
        place.fails(3, "quadruped", &["retarget", fox, "--character", "human", "-o", "no.take"]);
        place.done(&["export", fox, "--to", "fox.usdz", "--fps", "24"]);
    }
    assert!(!place.path("a.take").exists() && !place.path("no.take").exists());
}
