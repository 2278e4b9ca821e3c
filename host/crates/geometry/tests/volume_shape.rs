//! The shape of an embedded volume's elements: on real models, where bones lie near the surface, and on surfaces that
//! are rough or have spikes.
#![allow(clippy::unwrap_used, reason = "a test that finds no value has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::volume::{Resolution, Volume, VolumeInput, VolumeSettings, volume};
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_test_support::{read_tgf, shared};
use glam::DVec3;
use support::{rough_sphere, shared_triangles, sphere, spiked_tube};

fn embedded(surface: &TriangleMesh, segments: &[[[f64; 3]; 2]], vertices: usize) -> Volume {
    let settings = VolumeSettings { resolution: Resolution::Embedded { vertices }, ..VolumeSettings::default() };
    volume(&VolumeInput { surface, segments, points: &[] }, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

fn corners(mesh: &TetrahedralMesh, t: [u32; 4]) -> [DVec3; 4] {
    t.map(|v| DVec3::from(mesh.vertices[v as usize]))
}

fn longest_edge(p: [DVec3; 4]) -> f64 {
    (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max)
}

/// Elements with six times their volume below a thousandth of the cube of their longest edge, which weights leave out.
fn flat(mesh: &TetrahedralMesh) -> usize {
    let is_flat = |t: &&[u32; 4]| {
        let p = corners(mesh, **t);
        (p[1] - p[0]).dot((p[2] - p[0]).cross(p[3] - p[0])) < 1e-3 * longest_edge(p).powi(3)
    };
    mesh.tetrahedra.iter().filter(is_flat).count()
}

fn smallest_degrees(made: &Volume) -> f64 {
    made.report.dihedral_angles.as_ref().unwrap().smallest.to_degrees()
}

#[test]
fn no_angle_is_small_where_the_shape_allows() {
    for model in ["cow.off", "spot.obj", "elephant.obj", "armadillo.obj", "arm.obj", "cases/mesh/two-spheres.obj"] {
        let Some(surface) = shared_triangles(model) else { continue };
        let has_bones = ["elephant.obj", "armadillo.obj", "arm.obj"].contains(&model);
        let skeleton = has_bones.then(|| shared(&model.replace(".obj", ".tgf"))).flatten();
        let bones = skeleton.map_or_else(Vec::new, |path| read_tgf(&path));
        let made = embedded(&surface, &bones, 5000);
        let smallest = smallest_degrees(&made);
        assert!(smallest >= 5.0, "{model}: {smallest}°");
        assert_eq!(flat(&made.mesh), 0, "{model}");
        assert_eq!((made.report.pieces, made.report.bones_apart), (1, 0), "{model}");
        // The boundary gave way by less than half an edge of the shell.
        let (low, high) = surface.bounds().unwrap();
        let size = DVec3::from(low).distance(DVec3::from(high));
        let farthest = made.surface.distance.iter().copied().fold(0.0, f64::max);
        assert!(farthest < 0.01 * size, "{model}: a vertex is {farthest} outside of {size}");
    }
    // Sheets of metal that cross each other: angles are as the shape has them in a few places.
    if let Some(truck) = shared_triangles("truck.obj") {
        let made = embedded(&truck, &[], 5000);
        let below = made.report.dihedral_angles.as_ref().unwrap().share_below(5);
        assert!(below < 2e-3, "{below} of the truck's angles are below 5°");
    }
}

#[test]
fn a_spike_is_left_a_spike() {
    let bones = [[[0.0, 0.05, 0.0], [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 1.95, 0.0]]];
    for spike in [1e3, 65536.0, 1e7] {
        let made = embedded(&spiked_tube(17, 12, spike), &bones, 5000);
        let (report, mesh) = (&made.report, &made.mesh);
        assert!(mesh.vertices.len() < 2000, "{spike}: {} vertices", mesh.vertices.len());
        assert!(100 * flat(mesh) < mesh.tetrahedra.len(), "{spike}: {} of {}", flat(mesh), mesh.tetrahedra.len());
        assert!(report.edges_left_long > 0 && report.bones_apart == 0, "{spike}: {report:?}");
        let below = report.dihedral_angles.as_ref().unwrap().share_below(5);
        assert!(below < 0.01, "{spike}: {below} of the angles are below 5°");
        // The tube is there.
        assert!(report.volume > 0.9 * 0.375, "{spike}: {}", report.volume);
    }
    let made = embedded(&spiked_tube(17, 12, 0.3), &bones, 5000);
    assert_eq!(made.report.edges_left_long, 0);
}

#[test]
fn roughness_finer_than_an_element_is_smoothed() {
    let rough = rough_sphere(81, 128, 0.05);
    let made = embedded(&rough, &[], 1500);
    let report = &made.report;
    assert_eq!((report.pieces, report.shortfall), (1, None), "{report:?}");
    assert!(made.mesh.vertices.len() < 2000, "{} vertices", made.mesh.vertices.len());
    assert!(smallest_degrees(&made) >= 5.0, "{}°", smallest_degrees(&made));
    let moved = report.roughness_smoothed.unwrap();
    // Nearly five deviations occur among ten thousand.
    assert!((0.1..0.4).contains(&moved), "{moved}");
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((report.volume - ball).abs() < 0.04 * ball, "{}", report.volume);
    for smooth in [rough_sphere(81, 128, 0.0), sphere(5)] {
        assert_eq!(embedded(&smooth, &[], 1500).report.roughness_smoothed, None);
    }
}

#[test]
fn what_is_thin_stays_thin() {
    // Two spheres, one in the other: a wall of a twentieth of its edges.
    let mut wall = sphere(4);
    let inner = sphere(4);
    let offset = wall.vertices.len() as u32;
    wall.vertices.extend(inner.vertices.iter().map(|v| v.map(|c| 0.996 * c)));
    wall.triangles.extend(inner.triangles.iter().map(|&[a, b, c]| [a + offset, c + offset, b + offset]));
    let signed = armature_geometry::surface::diagnose(&wall).unwrap().signed_volume;
    let made = embedded(&wall, &[], 5000);
    let share = made.report.volume / signed;
    println!("the wall has {share} of its volume");
    assert!((0.7..1.7).contains(&share), "{} of {signed}", made.report.volume);
    assert_eq!(made.report.pieces, 1);
}

/// The largest element at the vertices of a bone, by its longest edge.
fn largest_at(made: &Volume, bone: usize) -> f64 {
    let run = &made.segment_vertices[bone];
    let at = made.mesh.tetrahedra.iter().filter(|t| t.iter().any(|v| run.contains(v)));
    at.map(|&t| longest_edge(corners(&made.mesh, t))).fold(0.0, f64::max)
}

#[test]
fn elements_are_small_where_a_bone_is_near_the_surface() {
    let ball = sphere(5);
    // One bone in the middle, and one a fiftieth below the surface.
    let bones = [[[0.0; 3], [0.0, 0.3, 0.0]], [[-0.1, 0.97, 0.0], [0.1, 0.97, 0.0]]];
    let made = embedded(&ball, &bones, 2000);
    let (middle, near) = (largest_at(&made, 0), largest_at(&made, 1));
    assert!(near < 0.6 * middle, "{near} near the surface, {middle} in the middle");
    assert!(made.mesh.vertices.len() < 3000, "{} vertices", made.mesh.vertices.len());
    assert!(smallest_degrees(&made) >= 5.0, "{}°", smallest_degrees(&made));
}
