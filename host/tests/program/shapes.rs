//! Blend shapes and materials of a character from a file, in exports and pictures.

use std::sync::Arc;

use armature_character::Character;
use armature_formats::gltf::{GlbMesh, GlbScene, write_glb};
use armature_formats::model::{Material, Model, MorphTarget};

use crate::common::Place;

/// The hand with a shape that puffs it up, a quarter of which is there from the start.
fn puffed_hand() -> (Character, Vec<u8>) {
    let mut hand = armature_character::own::hand().unwrap();
    let surface = Arc::make_mut(&mut hand.surface);
    let positions: Vec<[f32; 3]> = surface.normals.iter().map(|normal| normal.map(|c| 0.02 * c)).collect();
    surface.morph_targets =
        vec![MorphTarget { name: "puff".into(), default_weight: 0.25, positions, ..MorphTarget::default() }];
    let materials = [Material { metallic: 1.0, roughness: 0.3, ..hand.materials[0].clone() }];
    let mesh = GlbMesh { materials: &materials, ..hand.glb_mesh() };
    let scene = GlbScene { name: "hand", skeleton: &hand.skeleton, mesh: Some(mesh), clips: Vec::new() };
    let file = write_glb(&scene).unwrap();
    (hand, file)
}

fn model(bytes: &[u8]) -> Model {
    armature_formats::read_model("shape.glb", bytes, &|name| Err(format!("{name} does not exist"))).unwrap()
}

/// How far apart two surfaces are in the mean.
fn apart(a: &Model, b: &Model) -> f64 {
    let pairs = a.mesh.vertices.iter().zip(&b.mesh.vertices);
    let sum: f64 = pairs.map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()).sum();
    sum / a.mesh.vertices.len() as f64
}

#[test]
fn a_shape_is_set_by_name() {
    let place = Place::new("shapes");
    let (hand, file) = puffed_hand();
    place.write("puffed.glb", &file);
    let listed = place.done(&["inspect", "puffed.glb"]);
    assert!(listed.out.contains("1 blend shape: puff"), "{listed:?}");
    place.done(&["bind", "puffed.glb", "-o", "puffed.armature"]);
    let listed = place.done(&["inspect", "puffed.armature"]);
    assert!(listed.out.contains("1 shape: puff"), "{listed:?}");
    let run = ["run", "--device", "sim:hand", "--character", "puffed.armature", "--record", "hand.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "0.5"]].concat());

    let export = |to: &str, shapes: &[&str]| {
        place.done(&[&["export", "hand.take", "--to", to][..], shapes].concat());
        model(&place.read(to))
    };
    let plain = export("plain.glb", &[]);
    let full = export("full.glb", &["--shape", "puff=1"]);
    let weights = [&plain, &full].map(|model| model.morph_targets[0].default_weight);
    assert_eq!(weights.map(f32::to_bits), [0.25, 1.0].map(f32::to_bits));
    let offsets: f64 = 0.75 * 0.02;
    assert!((apart(&plain, &full) - offsets).abs() < 1e-4, "{} instead of {offsets}", apart(&plain, &full));
    assert_eq!(plain.morph_targets[0].positions.len(), hand.surface.mesh.vertices.len());

    let picture = |to: &str, shapes: &[&str]| {
        let replay = ["replay", "hand.take", "--at", "0.3", "--picture", to];
        place.done(&[&replay[..], shapes].concat());
        place.read(to)
    };
    assert_ne!(picture("plain.png", &[]), picture("puffed.png", &["--shape", "puff=4"]));

    for (arguments, said) in [
        (["--to", "x.glb", "--shape", "smile=1"], "choose puff"),
        (["--to", "x.glb", "--shape", "puff"], "smile=0.7"),
        (["--to", "x.bvh", "--shape", "puff=1"], "export a .glb, .fbx or .usdz"),
    ] {
        let refused = place.run(&[&["export", "hand.take"][..], &arguments].concat());
        assert!(refused.code != 0 && refused.err.contains(said), "{refused:?}");
    }
}
