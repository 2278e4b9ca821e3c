//! Real meshes and skeletons are read completely.

#![expect(clippy::float_cmp, reason = "positions are copied, not computed")]

use std::collections::BTreeMap;

use armature_formats::model::Model;
use armature_formats::read_model;
use armature_formats::skeleton::{read_tgf, skeleton_from_graph};
use armature_test_support::shared_bytes;

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

fn shared_model(name: &str) -> Option<Model> {
    let bytes = shared_bytes(name)?;
    Some(read_model(name, &bytes, &none).unwrap_or_else(|error| panic!("{error}")))
}

/// Edges by how many triangles touch them, in their two directions.
fn is_closed(model: &Model) -> bool {
    let mut balance: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for t in &model.mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    balance.values().all(|&b| b == 0)
}

#[test]
fn shared_meshes_have_their_known_sizes() {
    for (name, vertices, triangles, closed) in [
        ("armadillo.obj", 43_243, 86_482, true),
        ("elephant.obj", 6_034, 12_064, true),
        ("arm.obj", 8_311, 16_618, true),
        ("cow.off", 2_762, 5_520, true),
        ("spot.obj", 2_930, 5_856, true),
        ("truck.obj", 2_956, 4_770, false),
        ("woody.obj", 694, 1_267, false),
    ] {
        let Some(model) = shared_model(name) else { return };
        assert_eq!((model.mesh.vertices.len(), model.mesh.triangles.len()), (vertices, triangles), "{name}");
        assert_eq!(is_closed(&model), closed, "{name}");
        assert_eq!(model.name, name.split('.').next().unwrap());
    }
}

/// Volume enclosed by a surface, by the divergence theorem.
fn enclosed(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> f64 {
    let v = |i: u32| glam::DVec3::from(vertices[i as usize]);
    triangles.iter().map(|t| v(t[0]).dot(v(t[1]).cross(v(t[2]))) / 6.0).sum()
}

#[test]
fn shared_volumes_have_their_known_sizes() {
    for (name, vertices, triangles, tetrahedra) in
        [("hand.mesh", 7_234, 9_556, 29_998), ("octopus-low.mesh", 452, 898, 1_140)]
    {
        let Some(model) = shared_model(name) else { return };
        let volume = model.tetrahedra.as_ref().unwrap();
        assert_eq!(volume.vertices, model.mesh.vertices);
        assert_eq!(
            (volume.vertices.len(), model.mesh.triangles.len(), volume.tetrahedra.len()),
            (vertices, triangles, tetrahedra),
            "{name}"
        );
        assert!(is_closed(&model), "{name}");
        let v = |i: u32| glam::DVec3::from(volume.vertices[i as usize]);
        let volumes = volume
            .tetrahedra
            .iter()
            .map(|t| (v(t[1]) - v(t[0])).dot((v(t[2]) - v(t[0])).cross(v(t[3]) - v(t[0]))) / 6.0);
        assert!(volumes.clone().all(|volume| volume >= 0.0), "{name}");
        let (inside, by_surface) = (volumes.sum::<f64>(), enclosed(&volume.vertices, &model.mesh.triangles));
        assert!((inside - by_surface).abs() < 1e-9 * inside.abs(), "{name}: {inside} {by_surface}");
    }
}

#[test]
fn spot_stays_welded_and_keeps_its_texture_coordinates() {
    let Some(model) = shared_model("spot.obj") else { return };
    let flat = model.split_at_seams();
    assert_eq!(model.drawn_vertex_count(), 3_225);
    assert_eq!(flat.mesh.vertices.len(), 3_225);
    assert_eq!(flat.texture_coordinates.as_ref().unwrap().len(), 3_225);
    for (drawn, welded) in flat.mesh.triangles.iter().zip(&model.mesh.triangles) {
        for (d, w) in drawn.iter().zip(welded) {
            assert_eq!(flat.mesh.vertices[*d as usize], model.mesh.vertices[*w as usize]);
        }
    }
}

#[test]
fn shared_graphs_become_skeletons() {
    for (name, points, bones, hub) in [
        ("armadillo.tgf", 24, 23, true),
        ("hand.tgf", 21, 20, false),
        ("elephant.tgf", 25, 24, true),
        ("arm.tgf", 5, 4, false),
    ] {
        let Some(bytes) = shared_bytes(name) else { return };
        let graph = read_tgf(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((graph.points.len(), graph.edges.len()), (points, bones), "{name}");
        let made = skeleton_from_graph(&graph, None).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(made.skeleton.len(), bones + usize::from(hub), "{name}");
        let segments = made.skeleton.rest_segments();
        for (edge, &bone) in made.bone_of_edge.iter().enumerate() {
            let ends = graph.edges[edge].map(|p| glam::DVec3::from(graph.points[p]).as_vec3());
            let (head, tail) = segments[bone];
            let off =
                (head.distance(ends[0]) + tail.distance(ends[1])).min(head.distance(ends[1]) + tail.distance(ends[0]));
            assert!(off < 1e-4, "{name}, edge {edge}: {off}");
        }
    }
}
