//! Volumes as a user makes them: files that can be read again, pictures, text, JSON, errors that help.

use std::fmt::Write as _;

use crate::common::{Place, TUBE_TGF, tube_obj};
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_test_support::shared;
use serde_json::Value;

fn read(place: &Place, name: &str) -> Model {
    let none = |name: &str| Err(format!("{name} is not expected to be asked for"));
    read_model(name, &place.read(name), &none).unwrap()
}

fn volume_of(model: &Model) -> f64 {
    let mesh = model.tetrahedra.as_ref().unwrap();
    let at = |v: u32| glam::DVec3::from(mesh.vertices[v as usize]);
    let six = |t: &[u32; 4]| {
        let [a, b, c, d] = t.map(at);
        (b - a).dot((c - a).cross(d - a))
    };
    assert!(mesh.tetrahedra.iter().all(|t| six(t) > 0.0));
    mesh.tetrahedra.iter().map(six).sum::<f64>() / 6.0
}

/// A prism with twelve sides and a radius of a quarter, two high.
fn tube_volume() -> f64 {
    2.0 * 12.0 * 0.5 * 0.25 * 0.25 * (std::f64::consts::TAU / 12.0).sin()
}

#[test]
fn a_conforming_volume_keeps_every_vertex() {
    let place = Place::new("volume-conforming");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    let ran = place.done(&["volume", "tube.obj", "--skeleton", "bones.tgf", "--conforming", "-o", "tube.mesh"]);
    for word in ["tube.mesh: ", "vertices", "tetrahedra", "1 piece", "winding error", "dihedral angles", "2 bones"] {
        assert!(ran.out.contains(word), "{word}: {ran:?}");
    }
    let model = read(&place, "tube.mesh");
    assert!((volume_of(&model) / tube_volume() - 1.0).abs() < 1e-5);
    let vertices = &model.tetrahedra.as_ref().unwrap().vertices;
    let tube = read(&place, "tube.obj");
    assert!(tube.mesh.vertices.iter().all(|v| vertices.contains(v)), "every vertex is kept to the last bit");
    // The ends of the bones too.
    let nearest = |p: [f64; 3]| vertices.iter().map(|v| glam::DVec3::from(*v).distance(p.into())).fold(9.0, f64::min);
    assert!([[0.0, 0.05, 0.0], [0.0, 1.0, 0.0], [0.0, 1.95, 0.0]].into_iter().all(|p| nearest(p) < 1e-6));
    // The same again, and quietly.
    let before = place.read("tube.mesh");
    let again =
        ["volume", "tube.obj", "--skeleton", "bones.tgf", "--conforming", "-o", "tube.mesh", "--force", "--quiet"];
    assert_eq!(place.done(&again).out, "");
    assert!(place.read("tube.mesh") == before);
}

#[test]
fn scripts_get_json_and_a_picture() {
    let place = Place::new("volume-json");
    place.write("tube.obj", tube_obj());
    place.write("points.tgf", "1 0 0.5 0\n2 0.1 1.5 0\n#\n");
    let arguments = ["volume", "tube.obj", "--vertices", "600", "--points", "points.tgf", "-o", "tube.vtu", "--json"];
    let ran =
        place.done(&[&arguments[..], &["--slice", "tube.png", "--slice-axis", "x", "--slice-at", "0.4"]].concat());
    let value: Value = serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {ran:?}"));
    assert_eq!((&value["kind"], &value["file"]), (&"volume".into(), &"tube.vtu".into()));
    assert_eq!((&value["points"], &value["pieces"], &value["bones_apart"]), (&2.into(), &1.into(), &0.into()));
    let volume = value["volume"].as_f64().unwrap();
    assert!((volume / tube_volume() - 1.0).abs() < 0.1, "{volume}");
    assert!(value["tetrahedra"].as_u64().unwrap() > 300 && value["warnings"].is_array(), "{value}");
    assert!(place.read("tube.png").starts_with(b"\x89PNG"));
    assert!(place.read("tube.vtu").starts_with(b"<?xml"));
    let written = place.done(&["volume", "tube.obj", "--vertices", "600", "-o", "tube.msh"]);
    assert!(written.out.starts_with("tube.msh: ") && place.read("tube.msh").starts_with(b"$MeshFormat\n4.1 0 8"));
}

#[test]
fn a_flat_figure_is_filled_with_triangles() {
    let Some(woody) = shared("woody.obj") else { return };
    let place = Place::new("volume-flat");
    let ran = place.done(&["volume", woody.to_str().unwrap(), "-o", "woody.mesh", "--slice", "woody.png"]);
    assert!(ran.out.contains("a flat figure") && ran.out.contains("triangles"), "{ran:?}");
    let model = read(&place, "woody.mesh");
    assert!(model.tetrahedra.is_none() && model.mesh.triangles.len() > 1000);
    let area: f64 = armature_geometry::surface::triangle_areas(&model.mesh).unwrap().iter().sum();
    assert!((area / 70_032.0 - 1.0).abs() < 1e-9, "{area}");
    // Coarser on request.
    let coarse = ["volume", woody.to_str().unwrap(), "-o", "coarse.mesh", "--vertices", "5000", "--json"];
    let value: Value = serde_json::from_str(&place.done(&coarse).out).unwrap();
    let vertices = value["vertices"].as_u64().unwrap();
    assert!((2500..=10_000).contains(&vertices), "{vertices}");
}

#[test]
fn what_has_no_volume_is_3() {
    let place = Place::new("volume-none");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.write("far.tgf", "1 900 0.05 0\n2 900 1 0\n#\n1 2\n");
    place.write("nan.obj", tube_obj().replacen("v 0 2 0", "v 0 nan 0", 1));
    place.write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n");
    place.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    for name in ["nan.obj", "points.obj", "line.obj", "missing.obj"] {
        let ran = place.fails(3, name, &["volume", name, "-o", "none.mesh"]);
        assert_eq!(ran.out, "", "{name}");
    }
    place.fails(3, "far.tgf", &["volume", "tube.obj", "-s", "far.tgf", "-o", "none.mesh"]);
    place.fails(3, "missing.tgf", &["volume", "tube.obj", "-s", "missing.tgf", "-o", "none.mesh"]);
    place.fails(2, "bones.obj", &["volume", "tube.obj", "--points", "bones.obj", "-o", "none.mesh"]);
    assert!(!place.path("none.mesh").exists(), "no file for a volume that could not be made");
}

/// A mesh with edges from 1e-7 to 1e34, flat up to rounding, and a solid one: the volume stays near the number of vertices
/// requested.
#[test]
fn coordinates_of_all_magnitudes_do_not_make_a_volume_of_half_a_million_vertices() {
    let Some(flat) = shared("cases/device/volume_500k_vertices.ply") else { return };
    let place = Place::new("volume-magnitudes");
    // A tetrahedron with specks inside, a million times smaller.
    let mut solid = String::new();
    for (piece, (at, size)) in [(0.0, 1.0), (0.1, 1e-6), (0.2, 1e-6), (0.3, 1e-6)].into_iter().enumerate() {
        for corner in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let [x, y, z] = corner.map(|c| at + size * c);
            writeln!(solid, "v {x} {y} {z}").unwrap();
        }
        for face in [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]] {
            let [a, b, c] = face.map(|corner| corner + 4 * piece);
            writeln!(solid, "f {a} {b} {c}").unwrap();
        }
    }
    place.write("solid.obj", solid);
    for (mesh, more) in [(flat.to_str().unwrap(), &["--vertices", "200"][..]), ("solid.obj", &["--conforming"])] {
        let ran = place.done(&[&["volume", mesh, "--json", "-o", "small.mesh", "--force"][..], more].concat());
        let value: Value = serde_json::from_str(&ran.out).unwrap();
        println!("{value}");
        assert!(value["vertices"].as_u64().unwrap() < 2_000, "{value}");
        let warnings = value["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|w| w.as_str().unwrap().contains("differ so much in length")), "{value}");
    }
}

/// Two balls that pass through each other.
#[test]
fn what_is_left_out_where_surfaces_cross_is_counted() {
    let Some(balls) = shared("cases/mesh/two-spheres.obj") else { return };
    let place = Place::new("volume-left-out");
    let arguments = ["volume", balls.to_str().unwrap(), "--conforming", "-o", "balls.mesh", "--force"];
    let told = place.done(&arguments).out;
    let line =
        told.lines().find(|line| line.trim_start().starts_with("left out: ")).unwrap_or_else(|| panic!("{told}"));
    let value: Value = serde_json::from_str(&place.done(&[&arguments[..], &["--json"]].concat()).out).unwrap();
    let counts = [
        ("flat_elements_left_out", "flat elements at the boundary"),
        ("pieces_left_out", "stray pieces of next to no volume"),
    ];
    for (key, words) in counts {
        let count = value[key].as_u64().unwrap();
        assert!(count > 1 && line.contains(&format!("{count} {words}")), "{key} is {count}, but: {line}");
    }
    assert_eq!((&value["slivers_left_out"], &value["pieces"]), (&0.into(), &1.into()), "{value}");
    assert!(!line.contains("sliver"), "{line}");
    // Nothing is said where nothing was left out.
    let Some(cow) = shared("spot.obj") else { return };
    let whole = ["volume", cow.to_str().unwrap(), "--vertices", "3000", "-o", "cow.mesh", "--force"];
    let told = place.done(&whole).out;
    assert!(!told.contains("left out"), "{told}");
}

/// A tube with a spike, and one with a rough surface: both have a small volume, and a warning that says what was done.
#[test]
fn spikes_and_roughness_are_named() {
    let place = Place::new("volume-warnings");
    let moved = |far: &dyn Fn(usize) -> Option<String>| {
        let line = |(index, line): (usize, &str)| far(index).unwrap_or_else(|| line.to_owned());
        tube_obj().lines().enumerate().map(line).collect::<Vec<_>>().join("\n")
    };
    place.write("spike.obj", moved(&|line| (line == 101).then(|| "v 65536 1 0".to_owned())));
    let arguments = ["volume", "spike.obj", "-o", "spike.mesh", "--json"];
    let value: Value = serde_json::from_str(&place.done(&arguments).out).unwrap();
    assert!(value["vertices"].as_u64().unwrap() < 2_000, "{value}");
    assert!(value["edges_left_long"].as_u64().unwrap() > 0, "{value}");
    let warnings = value["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w.as_str().unwrap().contains("are long beside narrow triangles")), "{value}");
    assert!(value["roughness_smoothed"].is_null(), "{value}");
}
