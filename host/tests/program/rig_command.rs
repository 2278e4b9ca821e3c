//! Skeletons for meshes that have none, as a user gets them.

use crate::common::{Place, TUBE_TGF, tube_obj};
use armature_formats::motion::read_bvh;
use armature_formats::skeleton::read_tgf;
use serde_json::Value;

fn tube(name: &str) -> Place {
    let place = Place::new(name);
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place
}

#[test]
fn a_skeleton_is_fitted_written_drawn_and_bound_to() {
    let place = tube("rig");
    let usual = ["rig", "tube.obj", "--template", "bones.tgf"];
    let told = place.done(&[&usual[..], &["-o", "tube.bvh", "--picture", "tube.png", "--json"]].concat());
    let told: Value = serde_json::from_str(&told.out).unwrap();
    let bones = told["bones"].as_array().unwrap();
    assert_eq!(bones.len(), 2);
    for bone in bones {
        assert!(bone["certainty"].as_f64().unwrap() > 0.5, "{told}");
        // The tube stands on the origin, as wide as a tenth of its height.
        assert!(
            bone["head"][0].as_f64().unwrap().abs() < 0.1 && bone["head"][2].as_f64().unwrap().abs() < 0.1,
            "{told}"
        );
    }
    assert!(place.read("tube.png").starts_with(b"\x89PNG"));
    let read = read_bvh(&place.read("tube.bvh")).unwrap();
    assert_eq!(read.motion.skeleton.len(), 2);
    // The other formats, and text.
    let words = place.done(&[&usual[..], &["-o", "tube.tgf"]].concat());
    assert!(words.out.contains("2 bones") && words.out.contains("% sure"), "{words:?}");
    assert_eq!(read_tgf(&place.read("tube.tgf")).unwrap().edges.len(), 2);
    place.done(&[&usual[..], &["-o", "tube.glb", "--quiet"]].concat());
    // Bound to the file, and in one command.
    place.done(&["bind", "tube.obj", "-s", "tube.bvh", "--method", "heat", "-o", "a.armature", "--quiet"]);
    place.done(&["bind", "tube.obj", "-t", "bones.tgf", "--method", "heat", "-o", "b.armature", "--quiet"]);
    let again = place.done(&["bind", "tube.obj", "-t", "bones.tgf", "--method", "heat", "-o", "c.armature"]);
    assert!(again.out.contains("from the cache"), "{again:?}");
}

#[test]
fn wrong_templates_files_and_directions_are_named() {
    let place = tube("rig-wrong");
    place.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("fly.tgf", "1 0 0 0\n#\n");
    place.fails(2, "choose human, quadruped, hand, spider", &["rig", "tube.obj", "-t", "dragon"]);
    place.fails(2, "skeletons are written as", &["rig", "tube.obj", "-t", "human", "-o", "tube.obj"]);
    place.fails(3, "the mesh is flat", &["rig", "flat.obj", "-t", "human", "-o", "flat.bvh"]);
    place.fails(3, "no edges", &["rig", "tube.obj", "-t", "fly.tgf", "-o", "fly.bvh"]);
    place.fails(2, "give x, y, z", &["rig", "tube.obj", "-t", "human", "--up", "0,0,0"]);
    let along = ["rig", "tube.obj", "-t", "human", "-o", "along.bvh", "--up", "y", "--front", "-y"];
    place.fails(2, "give --front across --up", &along);
    place.fails(2, "cannot be used with", &["bind", "tube.obj", "-s", "bones.tgf", "-t", "human"]);
    place.fails(2, "give x, y, z", &["rig", "tube.obj", "-t", "human", "--front", "0,o,1,0"]);
    place.fails(2, "--template", &["bind", "tube.obj", "-s", "bones.tgf", "--up", "z"]);
    // A tube is no human, and it is said.
    let tube = place.done(&["rig", "tube.obj", "-t", "human", "-o", "human.bvh"]);
    assert!(tube.err.contains("less than 50 % sure"), "{tube:?}");
}
