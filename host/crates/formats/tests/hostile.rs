//! Damaged, truncated and made-up files: every reader ends with a model or an error, never with a panic.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::LazyLock;

use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, read_gltf_skeleton, write_glb};
use armature_formats::model::Model;
use armature_formats::motion::{read_bvh, write_bvh};
use armature_formats::skeleton::{read_tgf, skeleton_from_graph};
use armature_formats::{FormatError, Place, read_model};
use armature_rig::{Bone, Motion, Skeleton, Transform};
use glam::Vec3;
use proptest::prelude::*;

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

const OBJ: &str = "mtllib a.mtl\no x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl m\n\
    f 1/1/1 2/2/1 3/1/1 4/2/1\nf -1 -2 -3\n";
const OFF: &str =
    "STNOFF\n4 2 0\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n4 0 1 2 3 255 0 0\n3 0 1 3\n";
const PLY: &str = "ply\nformat ascii 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\nproperty double z\n\
    property float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n3 0 1 2\n";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid a\n";
const MESH: &str = "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTriangles\n1\n1 2 3 0\n\
    Tetrahedra\n1\n1 2 3 4 0\nEnd\n";
const TGF: &str = "1 0 0 0\n2 1 0 0 9\n3 1 1 0\n#\n1 2\n2 3 0\n#\n";
const BVH: &str = "HIERARCHY\nROOT a\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
    JOINT b\n {\n OFFSET 0 1 0\n CHANNELS 3 Zrotation Xrotation Yrotation\n End Site\n {\n OFFSET 0 1 0\n }\n }\n}\n\
    MOTION\nFrames: 2\nFrame Time: 0.04\n0 0 0 10 20 30 5 5 5\n1 1 1 -10 -20 -30 6 6 6\n";

fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    bytes.push(3);
    bytes.extend([0_i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend([0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend([0, 0]);
    bytes
}

/// A small rigged, animated, textured character as GLB.
fn glb() -> Vec<u8> {
    let bone = |name: &str, parent| Bone {
        name: name.to_owned(),
        parent,
        rest: Transform { translation: Vec3::Y, ..Transform::IDENTITY },
        tail: Vec3::Y,
    };
    let skeleton = Skeleton::new(vec![bone("a", None), bone("b", Some(0))]).unwrap();
    let mut pose = skeleton.rest_pose();
    pose.parent_from_bone[1].rotation = glam::Quat::from_rotation_x(1.0);
    let frames = vec![skeleton.rest_pose(), pose];
    let motion = Motion::new(skeleton.clone(), 0.1, frames).unwrap();
    let mut model = read_model("a.obj", OBJ.as_bytes(), &none).unwrap();
    let pixel = armature_formats::model::Texture {
        mime: "image/png".into(),
        bytes: b"\x89PNG\r\n\x1a\n".to_vec(),
        wrap: Default::default(),
    };
    model.first_material().base_color_map = Some(std::sync::Arc::new(pixel));
    let influences = armature_geometry::Influences::new(1, vec![0, 1, 1, 0], vec![1.0; 4], 2).unwrap();
    let mesh = GlbMesh { influences: Some(&influences), ..GlbMesh::of_model(&model) };
    let clips = vec![GlbClip::of_motion("nod", &motion)];
    write_glb(&GlbScene { name: "x", skeleton: &skeleton, mesh: Some(mesh), clips }).unwrap()
}

/// The same as JSON with the buffer inside.
fn gltf() -> Vec<u8> {
    let glb = glb();
    let length = u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    json["buffers"][0]["uri"] = "bytes.bin".into();
    serde_json::to_vec(&json).unwrap()
}

/// Every kind of file, small and complete.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    static SAMPLES: LazyLock<Vec<(&str, Vec<u8>)>> = LazyLock::new(make_samples);
    SAMPLES.clone()
}

fn make_samples() -> Vec<(&'static str, Vec<u8>)> {
    let mut out: Vec<(&str, Vec<u8>)> = [
        ("a.obj", OBJ),
        ("a.off", OFF),
        ("a.ply", PLY),
        ("a.stl", STL),
        ("a.mesh", MESH),
        ("a.tgf", TGF),
        ("a.bvh", BVH),
    ]
    .map(|(name, text)| (name, text.as_bytes().to_vec()))
    .to_vec();
    out.extend([
        ("draco.glb", include_bytes!("compressed/draco.glb").to_vec()),
        ("meshopt.glb", include_bytes!("compressed/meshopt.glb").to_vec()),
    ]);
    out.extend([("b.ply", binary_ply()), ("b.stl", binary_stl()), ("a.glb", glb()), ("a.gltf", gltf())]);
    out
}

/// Reads by name and checks what every caller relies on.
fn read(name: &str, bytes: &[u8]) -> Result<(), FormatError> {
    static BINARY: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let glb = glb();
        let length = u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
        glb[20 + length + 8..].to_vec()
    });
    let extension = name.rsplit('.').next();
    let outcome = if extension == Some("bvh") {
        read_bvh(bytes).map(|read| drop(write_bvh(&read.motion)))
    } else if extension == Some("tgf") {
        read_tgf(bytes).map(|graph| drop(skeleton_from_graph(&graph, None)))
    } else {
        let resolver = |_: &str| Ok(BINARY.clone());
        let skeleton = read_gltf_skeleton(name, bytes, &resolver);
        assert!(skeleton.is_err() || skeleton.is_ok_and(|read| !read.skeleton.is_empty()), "{name}");
        read_model(name, bytes, &resolver).map(|model| check(&model))
    };
    if let Err(error) = &outcome {
        assert!(!error.what.is_empty() && !error.remedy.is_empty(), "{error}");
        assert!(error.to_string().len() < 500, "{error}");
        match error.place {
            Place::Line(line) => assert!(line >= 1 && line <= bytes.len() + 1, "{error}"),
            Place::Byte(byte) => assert!(byte <= bytes.len(), "{error}"),
            Place::Whole => {}
        }
    }
    outcome
}

fn check(model: &Model) {
    assert_eq!(model.mesh.validate(), Ok(()));
    let drawn = model.drawn_vertex_count();
    assert!(model.normals.as_ref().is_none_or(|n| n.len() == drawn));
    assert!(model.texture_coordinates.as_ref().is_none_or(|t| t.len() == drawn));
    assert_eq!(model.drawn_triangles().len(), model.mesh.triangles.len());
    assert!(model.drawn_triangles().iter().flatten().all(|&v| (v as usize) < drawn));
    if let Some(rig) = &model.rig {
        assert_eq!(rig.influences.vertex_count(), model.mesh.vertices.len());
    }
    let flat = model.split_at_seams();
    assert_eq!(flat.mesh.vertices.len(), drawn);
}

#[test]
fn whole_samples_are_read() {
    for (name, bytes) in samples() {
        read(name, &bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn truncation_at_every_byte() {
    for (name, bytes) in samples() {
        let mut errors = 0;
        for end in 0..bytes.len() {
            errors += usize::from(read(name, &bytes[..end]).is_err());
        }
        println!("{name}: {errors} of {} truncations are errors", bytes.len());
        // A text may lose its last line end, or whole last faces.
        assert!(errors * 10 > bytes.len() * 5, "{name}: {errors} of {}", bytes.len());
    }
}

#[test]
fn every_name_meets_every_content() {
    for (_, bytes) in samples() {
        for (name, _) in samples() {
            let _ = read(name, &bytes);
        }
        let _ = read("nothing", &bytes);
        let _ = read("a.unknown", &bytes);
    }
    for (name, _) in samples() {
        for bytes in [b"".as_slice(), b"\0", b"\xFF\xFE\x00", b"\n\n\n", &[0; 1000], &[0xFF; 1000]] {
            assert!(read(name, bytes).is_err(), "{name} {bytes:?}");
        }
    }
}

#[test]
fn announced_counts_are_not_believed() {
    for huge in ["4294967295", "9223372036854775807", "18446744073709551615", "99999999999999999999", "-1"] {
        for (name, text, from) in [
            ("a.off", OFF, "4 2 0"),
            ("a.ply", PLY, "vertex 4"),
            ("a.ply", PLY, "face 2"),
            ("a.mesh", MESH, "Vertices\n4"),
            ("a.mesh", MESH, "Tetrahedra\n1"),
            ("a.bvh", BVH, "Frames: 2"),
            ("a.bvh", BVH, "CHANNELS 3"),
            ("a.obj", OBJ, "f -1"),
        ] {
            let at = from.trim_end_matches(|c: char| c.is_ascii_digit());
            let to = if from == "4 2 0" { format!("{huge} 2 0") } else { format!("{at}{huge}") };
            let damaged = text.replacen(from, &to, 1);
            assert_ne!(damaged, text);
            if !(name == "a.obj" && huge == "-1") {
                assert!(read(name, damaged.as_bytes()).is_err(), "{name}: {to}");
            }
        }
        let json = String::from_utf8(gltf()).unwrap();
        for field in
            ["\"count\":", "\"byteLength\":", "\"byteOffset\":", "\"bufferView\":", "\"mesh\":", "\"POSITION\":"]
        {
            for (at, _) in json.match_indices(field) {
                let end = at + field.len();
                let rest = json[end..].trim_start_matches(|c: char| c.is_ascii_digit());
                let _ = read("a.gltf", format!("{}{huge}{rest}", &json[..end]).as_bytes());
            }
        }
    }
}

#[test]
fn numbers_that_are_none() {
    for (name, bytes) in samples() {
        let Ok(text) = String::from_utf8(bytes) else { continue };
        let digits: Vec<usize> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(at, _)| at).collect();
        for at in digits {
            for bad in ["nan", "inf", "-", "1e999", "1e308", "0x1", "1.2.3", "\u{fffd}"] {
                let _ = read(name, format!("{}{bad}{}", &text[..at], &text[at + 1..]).as_bytes());
            }
        }
    }
}

/// Paths of all numbers, texts and lists in a JSON value.
fn places(value: &serde_json::Value, path: &str, out: &mut Vec<String>) {
    out.push(path.to_owned());
    match value {
        serde_json::Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| places(item, &format!("{path}/{i}"), out));
        }
        serde_json::Value::Object(fields) => {
            fields.iter().for_each(|(key, item)| places(item, &format!("{path}/{key}"), out));
        }
        _ => {}
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_damage(
        sample in 0_usize..11,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..12),
    ) {
        let (name, mut bytes) = samples().swap_remove(sample);
        for (at, value, kind) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => { bytes.remove(at); }
                _ => bytes.insert(at, value),
            }
        }
        let _ = read(name, &bytes);
    }

    /// Well-formed JSON that says something else: numbers changed, parts moved to the places of others.
    #[test]
    fn random_gltf_meaning(
        edits in prop::collection::vec(
            (any::<prop::sample::Index>(), any::<prop::sample::Index>(), -2_i64..70, 0_u8..4),
            1..6,
        ),
    ) {
        let mut json: serde_json::Value = serde_json::from_slice(&gltf()).unwrap();
        for (to, from, number, kind) in edits {
            let mut paths = Vec::new();
            places(&json, "", &mut paths);
            let part = json.pointer(from.get(paths.as_slice()).as_str()).cloned().unwrap();
            let numbers: Vec<&String> = paths.iter().filter(|p| json.pointer(p).unwrap().is_number()).collect();
            let path = if kind == 3 { to.get(&paths).clone() } else { (*to.get(&numbers)).clone() };
            let slot = json.pointer_mut(&path).unwrap();
            *slot = if kind == 3 { part } else { number.into() };
            if !json.is_object() {
                return Ok(());
            }
        }
        let _ = read("a.gltf", &serde_json::to_vec(&json).unwrap());
    }

    #[test]
    fn random_words(
        sample in 0_usize..7,
        words in prop::collection::vec("[ \n#{}/.a-z0-9-]{0,12}", 1..40),
        keep in 0_usize..200,
    ) {
        let (name, mut bytes) = samples().swap_remove(sample);
        bytes.truncate(keep);
        bytes.extend(words.join(" ").bytes());
        let _ = read(name, &bytes);
    }

    #[test]
    fn random_bytes(sample in 0_usize..11, bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let (name, _) = samples().swap_remove(sample);
        let _ = read(name, &bytes);
    }
}
