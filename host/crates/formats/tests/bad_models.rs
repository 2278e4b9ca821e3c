//! Models that are awkward or hostile: 2,000 bones, names that are none, weights that do not sum to one.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use armature_formats::fbx::{FbxNotes, write_fbx};
use armature_formats::gltf::{GlbMesh, GlbScene, write_glb};
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Skeleton, Transform};
use glam::Vec3;
use serde_json::{Value, json};

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

/// A zigzag of triangles along chains of at most 100 bones, each vertex on a bone of its own.
fn chain(bones: usize) -> (Skeleton, TriangleMesh, Influences) {
    let bone = |number: usize| Bone {
        name: format!("bone {number}"),
        parent: if number.is_multiple_of(100) { number.checked_sub(100) } else { Some(number - 1) },
        rest: Transform { translation: Vec3::X * 0.01, ..Transform::IDENTITY },
        tail: Vec3::X * 0.01,
    };
    let skeleton = Skeleton::new((0..bones).map(bone).collect()).unwrap();
    let vertices = (0..bones).map(|k| [0.01 * k as f64, 0.1 * (k % 2) as f64, 0.0]).collect();
    let triangles = (2..bones as u32).map(|k| [k - 2, k - 1, k]).collect();
    let influences = Influences::new(1, (0..bones as u16).collect(), vec![1.0; bones], bones).unwrap();
    (skeleton, TriangleMesh { vertices, triangles }, influences)
}

fn scene((skeleton, mesh, influences): &(Skeleton, TriangleMesh, Influences)) -> GlbScene<'_> {
    let mesh = GlbMesh {
        mesh,
        split: None,
        normals: None,
        texture_coordinates: None,
        vertex_colors: None,
        influences: Some(influences),
        parts: &[],
        morph_targets: &[],
        skins: &[],
        materials: &[],
    };
    GlbScene { name: "chain", skeleton, mesh: Some(mesh), clips: Vec::new() }
}

/// A GLB with its JSON, or its numbers, changed.
fn changed(glb: &[u8], change: impl Fn(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut root: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let mut numbers = glb[20 + length + 8..].to_vec();
    change(&mut root, &mut numbers);
    let mut text = serde_json::to_vec(&root).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |number: usize| (number as u32).to_le_bytes();
    let (total, json) = (28 + text.len() + numbers.len(), word(text.len()));
    let head = [&glb[..8], &word(total), &json, b"JSON", &text].concat();
    [head.as_slice(), &word(numbers.len()), b"BIN\0", &numbers].concat()
}

fn names(model: &Model) -> Vec<&str> {
    model.rig.as_ref().unwrap().skeleton.bones().iter().map(|bone| bone.name.as_str()).collect()
}

#[test]
fn two_thousand_bones_come_through() {
    let made = chain(2000);
    for (name, bytes) in [
        ("chain.glb", write_glb(&scene(&made)).unwrap()),
        ("chain.fbx", write_fbx(&scene(&made), &FbxNotes::default()).unwrap().bytes),
    ] {
        let model = read_model(name, &bytes, &none).unwrap();
        let rig = model.rig.as_ref().unwrap();
        assert_eq!(rig.skeleton.len(), 2000, "{name}");
        let heads = |skeleton: &Skeleton| skeleton.rest_segments().into_iter().map(|(head, _)| head);
        let off = heads(&made.0).zip(heads(&rig.skeleton)).map(|(a, b)| a.distance(b)).fold(0.0, f32::max);
        // Sums of many lengths in single precision.
        assert!(off < 1e-2, "{name}: {off}");
        assert!(rig.unbound.is_empty() && model.warnings.is_empty(), "{name}: {:?}", model.warnings);
    }
}

#[test]
fn names_are_kept_where_they_are_some_and_given_where_not() {
    let given = ["", "", "arm", "arm", "mixamorig:Hips", "left upper arm", "左腕", "рука", " ", "a\"b\\c/d"];
    let glb = write_glb(&scene(&chain(given.len()))).unwrap();
    let renamed = changed(&glb, |root, _| {
        for node in root["nodes"].as_array_mut().unwrap() {
            let bone = node["name"].as_str().unwrap().strip_prefix("bone ").and_then(|number| number.parse().ok());
            let number: Option<usize> = bone;
            if let Some(number) = number {
                node["name"] = json!(given[number]);
            }
        }
    });
    let model = read_model("names.glb", &renamed, &none).unwrap();
    let found = names(&model);
    assert_eq!(found.len(), given.len());
    for name in &given[4..8] {
        assert!(found.contains(name), "{name} is missing: {found:?}");
    }
    let mut once = found.clone();
    once.sort_unstable();
    once.dedup();
    assert!(once.len() == found.len() && !found.contains(&""), "{found:?}");
    // And through our own writers.
    let rig = model.rig.as_ref().unwrap();
    let own =
        GlbScene { name: "names", skeleton: &rig.skeleton, mesh: Some(GlbMesh::of_model(&model)), clips: Vec::new() };
    let again = read_model("again.glb", &write_glb(&own).unwrap(), &none).unwrap();
    assert_eq!(names(&again), found);
}

#[test]
fn weights_that_sum_to_something_else_or_to_nothing() {
    let glb = write_glb(&scene(&chain(4))).unwrap();
    let weighed = changed(&glb, |root, numbers| {
        let accessor = root["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"].as_u64().unwrap() as usize;
        assert_eq!(root["accessors"][accessor]["componentType"], 5126, "floats");
        let view = root["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        let start = root["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize;
        for (vertex, weight) in [(0, 3.0_f32), (1, 0.0), (2, 0.25)] {
            numbers[start + 16 * vertex..][..4].copy_from_slice(&weight.to_le_bytes());
        }
    });
    let model = read_model("weights.glb", &weighed, &none).unwrap();
    let rig = model.rig.as_ref().unwrap();
    for vertex in 0..4 {
        let sum: f32 = rig.influences.of_vertex(vertex).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-6, "vertex {vertex}: {sum}");
    }
    assert_eq!(rig.unbound, [1]);
    assert!(model.warnings.iter().any(|text| text.contains("1 vertex follows no joint")), "{:?}", model.warnings);
    // The list of what is unbound goes with the vertices.
    assert_eq!(model.split_at_seams().rig.unwrap().unbound.len(), 1);
}
