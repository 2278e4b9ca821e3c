//! Surfaces as a user fills, joins and edits them.

use std::fmt::Write as _;

use crate::common::Place;
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_geometry::surface::diagnose;
use serde_json::Value;

fn read(place: &Place, name: &str) -> Model {
    let none = |name: &str| Err(format!("{name} is not expected to be asked for"));
    read_model(name, &place.read(name), &none).unwrap()
}

/// A closed tube with rounded ends, without some squares of its grid.
fn torn_ball(gone: impl Fn(u32, u32) -> bool) -> String {
    let (around, along) = (24_u32, 16_u32);
    let mut text = String::new();
    for j in 1..along {
        let (s, c) = (std::f64::consts::PI * f64::from(j) / f64::from(along)).sin_cos();
        for i in 0..around {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(around)).sin_cos();
            writeln!(text, "v {} {} {}", s * cos, c, -s * sin).unwrap();
        }
    }
    text.push_str("v 0 1 0\nv 0 -1 0\n");
    let at = |i: u32, j: u32| (j - 1) * around + i % around + 1;
    let (top, bottom) = ((along - 1) * around + 1, (along - 1) * around + 2);
    for i in 0..around {
        writeln!(text, "f {top} {} {}", at(i, 1), at(i + 1, 1)).unwrap();
        writeln!(text, "f {bottom} {} {}", at(i + 1, along - 1), at(i, along - 1)).unwrap();
        for j in (1..along - 1).filter(|&j| !gone(i, j)) {
            writeln!(text, "f {} {} {} {}", at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)).unwrap();
        }
    }
    text
}

#[test]
fn holes_are_listed_filled_and_reported() {
    let place = Place::new("surface-fill");
    place.write("ball.obj", torn_ball(|i, j| (3..6).contains(&i) && (4..7).contains(&j)));
    let listed = place.done(&["surface", "fill", "ball.obj", "--list"]);
    assert!(listed.out.contains("1 hole") && listed.out.contains("hole 1: 12 edges"), "{listed:?}");
    let inspected = place.done(&["inspect", "ball.obj"]);
    assert!(inspected.out.contains("bind --fill-holes") && inspected.out.contains("hole 1: 12 edges"), "{inspected:?}");
    let ran = place.done(&["surface", "fill", "ball.obj", "-o", "whole.obj"]);
    assert!(ran.out.contains("1 of 1 hole filled"), "{ran:?}");
    let (torn, whole) = (read(&place, "ball.obj"), read(&place, "whole.obj"));
    assert_eq!(whole.mesh.vertices[..torn.mesh.vertices.len()], torn.mesh.vertices[..]);
    assert_eq!(whole.mesh.triangles[..torn.mesh.triangles.len()], torn.mesh.triangles[..]);
    let d = diagnose(&whole.mesh).unwrap();
    assert!(d.closed && d.self_intersections == 0);
    assert!((d.signed_volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.04, "{}", d.signed_volume);
    for (name, options) in [("flat.obj", ["--angle", "-60"]), ("tangent.obj", ["--smooth", "tangent"])] {
        place.done(&["surface", "fill", "ball.obj", "-o", name, options[0], options[1]]);
        assert!(diagnose(&read(&place, name).mesh).unwrap().closed, "{name}");
    }
    let json = place.done(&["surface", "fill", "ball.obj", "-o", "whole.obj", "--force", "--json"]);
    let value: Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!(value["patches"][0]["outcome"], "settled");
    assert_eq!(value["holes"][0]["edges"], 12);
}

#[test]
fn openings_that_seem_to_be_meant_stay_open() {
    let place = Place::new("surface-meant");
    // Two eyes, mirrored at x = 0: columns i and 12 - i.
    let eye = |i: u32, j: u32| ([4, 5].contains(&i) || [6, 7].contains(&i)) && (4..6).contains(&j);
    let apart = |i: u32, j: u32| eye(i, j) && i != 5 && i != 6;
    place.write("mask.obj", torn_ball(apart));
    let listed = place.done(&["surface", "fill", "mask.obj", "--list"]);
    assert!(listed.out.contains("2 holes") && listed.out.contains("mirror image of hole 2"), "{listed:?}");
    let ran = place.done(&["surface", "fill", "mask.obj", "-o", "same.obj"]);
    assert!(ran.out.contains("0 of 2 holes filled") && ran.err.contains("may be meant"), "{ran:?}");
    place.done(&["surface", "fill", "mask.obj", "--all", "-o", "blind.obj"]);
    assert!(diagnose(&read(&place, "blind.obj").mesh).unwrap().closed);
    place.done(&["surface", "fill", "mask.obj", "--only", "2", "-o", "one.obj"]);
    assert_eq!(diagnose(&read(&place, "one.obj").mesh).unwrap().boundary_edges, 6);
}

#[test]
fn rims_are_joined_and_places_dragged() {
    let place = Place::new("surface-blend");
    let ball = torn_ball(|_, j| j > 11);
    place.write("upper.obj", &ball);
    let model = read(&place, "upper.obj");
    let mut lower = String::new();
    for [x, y, z] in &model.mesh.vertices {
        writeln!(lower, "v {x} {} {}", -1.9 - y, -z).unwrap();
    }
    for [a, b, c] in &model.mesh.triangles {
        writeln!(lower, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
    }
    place.write("lower.obj", lower);
    let listed = place.done(&["surface", "blend", "upper.obj", "lower.obj"]);
    assert!(listed.out.contains("name those to be joined with --holes"), "{listed:?}");
    let edges = "24 edges";
    let numbers: Vec<String> = listed
        .out
        .lines()
        .filter(|line| line.contains(edges))
        .filter_map(|line| Some(line.trim().strip_prefix("hole ")?.split(':').next()?.to_owned()))
        .collect();
    assert!(numbers.len() >= 2, "{listed:?}");
    let ends = numbers[..2].join(",");
    place.done(&["surface", "blend", "upper.obj", "lower.obj", "--holes", &ends, "-o", "both.obj"]);
    let before = diagnose(&model.mesh).unwrap();
    let after = diagnose(&read(&place, "both.obj").mesh).unwrap();
    assert!(after.boundary_edges < 2 * before.boundary_edges && after.non_manifold_edges == 0);

    // The same as a function on a cylinder, wide at one rim, written as GLB.
    let pair = ["surface", "blend", "upper.obj", "lower.obj", "--holes", &ends, "-o", "waist.glb"];
    let domain = ["--domain", "cylinder", "--angle", "30", "--second-angle", "-20", "--json"];
    let ran = place.done(&[&pair[..], &domain].concat());
    let json: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(json["outcome"], "settled", "{ran:?}");
    assert!(json["residual"].as_f64().unwrap() < 1e-12, "{ran:?}");
    let waist = diagnose(&read(&place, "waist.glb").mesh).unwrap();
    assert_eq!((waist.boundary_edges, waist.non_manifold_edges), (after.boundary_edges, 0));

    place.write("nose.txt", "within 0.8\ndrag 0 0 1 by 0 0 0.5   # forward\n");
    place.write("ball.obj", torn_ball(|_, _| false));
    let ran = place.done(&["surface", "edit", "ball.obj", "nose.txt", "-o", "nose.obj"]);
    assert!(ran.out.contains("followed 1 dragged vertex"), "{ran:?}");
    let (old, new) = (read(&place, "ball.obj").mesh, read(&place, "nose.obj").mesh);
    let moved = old.vertices.iter().zip(&new.vertices).map(|(a, b)| b[2] - a[2]);
    let most = moved.clone().fold(0.0, f64::max);
    assert!((most - 0.5).abs() < 1e-9 && moved.filter(|d| *d == 0.0).count() > 100);
}

#[test]
fn what_cannot_be_done_is_said() {
    let place = Place::new("surface-bad");
    place.write("ball.obj", torn_ball(|i, j| i < 3 && j == 8));
    place.write("bad.txt", "within 1\npull 0 0 1\n");
    place.write("all.txt", "region 0 0 0 9\ndrag 0 0 1 by 0 0 1\ndrag 0 0 1 by 1 0 0\n");
    for (arguments, code, words) in [
        (vec!["surface", "fill", "ball.obj", "-o", "x.stl"], 2, "written as .obj or .glb"),
        (vec!["surface", "blend", "ball.obj", "--holes", "1", "--domain", "annulus", "-o", "x.obj"], 2, "--angle"),
        (
            vec!["surface", "blend", "ball.obj", "--holes", "1", "--domain", "annulus", "--angle", "0", "-o", "x.obj"],
            2,
            "joins two rims, not 1",
        ),
        (vec!["surface", "fill", "ball.obj", "--only", "7"], 2, "no hole 7; there are 1"),
        (vec!["surface", "fill", "ball.obj", "--only", "0"], 2, "the first is 1"),
        (vec!["surface", "fill", "nowhere.obj"], 3, "nowhere.obj"),
        (vec!["surface", "blend", "ball.obj", "--holes", "1", "-o", "x.obj"], 2, "two rims or more"),
        (vec!["surface", "edit", "ball.obj", "bad.txt", "-o", "x.obj"], 3, "line 2: \"pull\" is no condition"),
        (vec!["surface", "edit", "ball.obj", "all.txt", "-o", "x.obj"], 3, "dragged in two ways"),
        (vec!["surface", "edit", "ball.obj", "none.txt", "-o", "x.obj"], 3, "none.txt"),
    ] {
        let ran = place.run(&arguments);
        assert_eq!(ran.code, code, "{ran:?}");
        assert!(ran.err.contains(words), "{words}: {ran:?}");
        assert!(!place.path("x.obj").exists());
    }
}
