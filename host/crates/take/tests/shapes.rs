//! Blend shapes in takes: set by hand and by joints, solved again to the bit, edited, exported.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]
#![allow(clippy::float_cmp, reason = "a replay gives the same bits")]

mod support;

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_formats::gltf::GlbMesh;
use armature_formats::model::{MeshPart, MorphTarget};
use armature_formats::read_model;
use armature_rig::{DriveAxis, Mapping, PartUid, ShapeDrive, SharedJoint, Sharing};
use armature_take::{
    Edit, EditList, ExportSettings, KeySettings, Record, ShapeSetting, ShapeTrack, Surface, Take, TakeWriter,
    apply_edits, export_bvh, export_glb, verify,
};
use armature_test_support::shared_bytes;
use support::{arm_mapping, begun, header, raw, read};

fn go_on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn drives() -> Mapping {
    let drive = |shape: &str, axis| ShapeDrive {
        shape: shape.into(),
        part: PartUid([1; 12]),
        axis,
        degrees: [0.0, 30.0],
        weights: [0.0, 1.0],
    };
    Mapping { shapes: vec![drive("jaw", DriveAxis::Twist), drive("smile_L", DriveAxis::EndTwist)], ..arm_mapping() }
}

fn setting(name: &str, weight: f32) -> ShapeSetting {
    ShapeSetting { device_micros: Some(1_400_000), name: name.into(), weight }
}

/// A second and a half at 100 samples a second, and the weights that were live with each sample.
fn recorded() -> (Take, Vec<[Option<f32>; 3]>) {
    let (mut writer, mut solver) = begun(&header());
    writer.mapping(&drives()).unwrap();
    solver.set_mapping(drives());
    let mut live = Vec::new();
    for n in 0..=150 {
        if n == 40 || n == 90 {
            let weight = if n == 40 { 0.75 } else { 0.125 };
            writer.shape(&setting("blink", weight)).unwrap();
            solver.set_shape("blink", weight).unwrap();
        }
        let sample = raw(n, 1_000_000 + 10_000 * u64::from(n));
        writer.sample(&sample, None).unwrap();
        writer.pose(n, sample.device_micros, solver.solve(&sample).unwrap()).unwrap();
        live.push(["jaw", "smile_L", "blink"].map(|name| solver.shapes().get(name)));
    }
    (read(&writer.finish().unwrap()), live)
}

fn at(track: &ShapeTrack, seconds: f64, shape: &str) -> Option<f32> {
    track.at(seconds).find(|(name, _)| *name == shape).map(|(_, weight)| weight)
}

#[test]
fn weights_are_solved_again_to_the_bit() {
    let (take, live) = recorded();
    assert!(verify(&take, &mut go_on).unwrap().is_exact());
    let track = ShapeTrack::of(&take).unwrap();
    assert_eq!(track.names(), ["jaw", "smile_L", "blink"]);
    for (n, row) in live.iter().enumerate() {
        for (name, weight) in ["jaw", "smile_L", "blink"].into_iter().zip(row) {
            assert_eq!(at(&track, n as f64 * 0.01, name), *weight, "{name} at sample {n}");
        }
    }
    assert_eq!(at(&track, 0.39, "blink"), None, "until a hand sets it, it is the character's own");
    assert!(live[100][0].unwrap() > 0.25 && live[100][0] != live[101][0], "the joint moves: {:?}", live[100]);
    let middle = at(&track, 0.205, "jaw").unwrap();
    assert!((middle - 0.5 * (live[20][0].unwrap() + live[21][0].unwrap())).abs() < 1e-6, "on the line between");
    let none = read(&support::small_take(5));
    assert!(ShapeTrack::of(&none).is_none());
}

#[test]
fn settings_and_mappings_come_back_as_they_were_written() {
    let (take, _) = recorded();
    assert_eq!(take.write(Vec::new()).unwrap(), read(&take.write(Vec::new()).unwrap()).write(Vec::new()).unwrap());
    let set: Vec<&ShapeSetting> =
        take.records().iter().filter_map(|r| if let Record::Shape(s) = r { Some(s) } else { None }).collect();
    assert_eq!(set, [&setting("blink", 0.75), &setting("blink", 0.125)]);
    let share = |sharing, share| SharedJoint {
        part: PartUid([1; 12]),
        sharing,
        bones: vec![("upper".into(), share), ("lower".into(), 1.0 - share)],
    };
    for mapping in [
        drives(),
        Mapping { shared: vec![share(Sharing::Chain, 0.25)], ..arm_mapping() },
        Mapping { shared: vec![share(Sharing::Curl, -1.5)], ..drives() },
    ] {
        let (mut writer, _) = begun(&header());
        writer.mapping(&mapping).unwrap();
        let take = read(&writer.finish().unwrap());
        assert_eq!(take.records().last(), Some(&Record::Mapping(mapping)));
    }
    let refused = TakeWriter::new(Vec::new(), &header()).unwrap().shape(&setting("blink", f32::NAN));
    assert!(refused.unwrap_err().to_string().contains("blink"));
}

fn edited(edits: Vec<Edit>) -> ShapeTrack {
    let (take, _) = recorded();
    let mut list = EditList::new("body.take");
    list.add(edits);
    let other = |_: &str| Err::<Arc<Take>, String>("there is no other take".into());
    apply_edits(&list, &take, &other, None, &mut go_on).unwrap().shapes.unwrap()
}

#[test]
fn edits_of_time_move_weights_along() {
    let (_, live) = recorded();
    let jaw = |n: usize| live[n][0].unwrap();
    let trimmed = edited(vec![Edit::Trim { from: 0.505, to: 1.0 }]);
    assert!((at(&trimmed, 0.0, "jaw").unwrap() - 0.5 * (jaw(50) + jaw(51))).abs() < 1e-6);
    assert_eq!(at(&trimmed, 0.495, "jaw"), Some(jaw(100)));
    assert_eq!(at(&trimmed, 9.0, "jaw"), Some(jaw(100)), "nothing after the end");
    let faster = edited(vec![Edit::Retime { speed: 2.0 }]);
    assert_eq!(at(&faster, 0.25, "jaw"), Some(jaw(50)));
    let looped = edited(vec![Edit::Loop { times: 2, blend: 0.0 }]);
    assert_eq!(at(&looped, 1.5 + 0.2, "jaw"), Some(jaw(20)));
    let smooth = edited(vec![Edit::Loop { times: 3, blend: 0.5 }]);
    for step in 0..300 {
        let [a, b] = [step, step + 1].map(|n| at(&smooth, f64::from(n) * 0.01, "jaw").unwrap());
        assert!((a - b).abs() < 0.1, "{step}: {a} and {b}");
    }
    let slow = edited(vec![Edit::Filter { filter: "one-euro:0.5,0".into() }]);
    assert!(at(&slow, 1.0, "jaw").unwrap() < jaw(100) - 0.05, "the filter holds for shapes as well");
}

#[test]
fn bvh_says_what_it_leaves_out_and_a_glb_has_the_weights_of_every_frame() {
    let (take, live) = recorded();
    let settings = ExportSettings::default();
    let bvh = export_bvh(&take, &settings, &mut go_on).unwrap();
    assert_eq!(bvh.missing_shapes, ["jaw", "smile_L", "blink"]);
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let mut fox = read_model("a.glb", &bytes, &|name| Err(format!("no {name}"))).unwrap();
    let drawn = fox.split.as_ref().map_or(fox.mesh.vertices.len(), |split| split.mesh_vertex.len());
    let triangles = fox.split.as_ref().map_or(fox.mesh.triangles.len(), |split| split.triangles.len());
    let (vertices, triangles) = (0..drawn as u32, 0..triangles as u32);
    fox.parts = vec![MeshPart { name: "fox".into(), vertices, triangles, material: Some(0), skin: None }];
    fox.morph_targets = vec![MorphTarget {
        name: "jaw".into(),
        part: 0,
        default_weight: 0.0,
        positions: vec![[0.0, -1.0, 0.0]; drawn],
        normals: Vec::new(),
    }];
    // The fox's bones and our weights: a take of its motion whose puppet is ours.
    let (skeleton, motion) = (fox.rig.as_ref().unwrap().skeleton.clone(), fox.motions[0].1.clone());
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&skeleton).unwrap();
    let mut mapping = drives();
    mapping.entries.clear();
    for record in take.records() {
        match record {
            Record::Skeleton(_) | Record::Pose(_) => {}
            Record::Mapping(_) => writer.mapping(&mapping).unwrap(),
            Record::Sample(sample) => {
                writer.record(record).unwrap();
                let pose = &motion.frames[sample.raw.sequence as usize % motion.frames.len()];
                writer.pose(sample.raw.sequence, sample.raw.device_micros, pose).unwrap();
            }
            other => writer.record(other).unwrap(),
        }
    }
    let take = read(&writer.finish().unwrap());
    let surface = Surface { skeleton: &skeleton, mesh: GlbMesh::of_model(&fox), expressions: &[] };
    for keys in [None, Some(KeySettings::default())] {
        let settings = ExportSettings { keys, ..settings };
        let glb = export_glb(&take, Some(&surface), "take", &settings, &mut go_on).unwrap();
        assert_eq!(glb.missing_shapes, ["smile_L", "blink"]);
        let (json, binary) = pieces(&glb.file);
        let clip = &json["animations"][0];
        let channel = clip["channels"].as_array().unwrap().iter().find(|c| c["target"]["path"] == "weights").unwrap();
        let output = clip["samplers"][channel["sampler"].as_u64().unwrap() as usize]["output"].as_u64().unwrap();
        let accessor = &json["accessors"][output as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap_or(0) + accessor["byteOffset"].as_u64().unwrap_or(0);
        let frames = accessor["count"].as_u64().unwrap() as usize;
        assert_eq!(frames, glb.motion.resampled.motion.frames.len());
        for frame in (0..frames).step_by(3) {
            let at = start as usize + 4 * frame;
            let weight = f32::from_le_bytes(binary[at..at + 4].try_into().unwrap());
            assert!((weight - live[frame / 3 * 10][0].unwrap()).abs() < 1e-6, "frame {frame}");
        }
    }
}

fn pieces(glb: &[u8]) -> (serde_json::Value, &[u8]) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&glb[20..20 + length]).unwrap(), &glb[28 + length..])
}
