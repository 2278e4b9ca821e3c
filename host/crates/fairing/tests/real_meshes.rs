//! Holes cut in real meshes and filled: how much nearer the volume that binding computes its weights on comes to that of the
//! whole mesh.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod support;

use armature_fairing::PatchSettings;
use armature_fairing::holes::{fill_holes, find_holes};
use armature_geometry::TriangleMesh;
use armature_geometry::surface::diagnose;
use armature_geometry::volume::{Resolution, VolumeInput, VolumeSettings, volume};
use armature_test_support::{read_obj, shared};
use glam::DVec3;
use support::{cut, go};

/// Holes cut in each.
const HOLES: usize = 6;

/// The volume that binding makes of a surface.
fn enclosed(mesh: &TriangleMesh) -> f64 {
    let input = VolumeInput { surface: mesh, segments: &[], points: &[] };
    let settings = VolumeSettings { resolution: Resolution::Embedded { vertices: 5000 }, ..VolumeSettings::default() };
    volume(&input, &settings, &mut go).unwrap().report.volume
}

#[test]
fn filled_meshes_enclose_what_the_whole_ones_do() {
    for name in ["armadillo.obj", "elephant.obj", "spot.obj"] {
        let Some(path) = shared(name) else { return };
        let read = read_obj(&path);
        let whole = TriangleMesh { vertices: read.vertices, triangles: read.triangles };
        let (low, high) = whole.bounds().unwrap();
        let size = DVec3::from(low).distance(high.into());
        // At places all over the surface.
        let mut torn = whole.clone();
        for k in 0..HOLES {
            torn = cut(&torn, whole.vertices[(2 * k + 1) * whole.vertices.len() / (2 * HOLES)], 0.05 * size);
        }
        let holes = find_holes(&torn).unwrap();
        let all: Vec<usize> = (0..holes.holes.len()).collect();
        let filled = fill_holes(&torn, &holes, &all, &PatchSettings::default(), &mut go).unwrap();
        // Pieces that the cuts cut off are closed as well.
        let d = diagnose(&filled.mesh).unwrap();
        assert!(filled.patches.iter().all(|p| p.outcome.is_filled()), "{name}: {:?}", filled.patches);
        assert!(d.boundary_edges == 0 && d.non_manifold_edges == 0, "{name}: {d:?}");
        let [before, after, right] = [&torn, &filled.mesh, &whole].map(enclosed);
        let off = |v: f64| (v / right - 1.0).abs();
        println!(
            "{name:14} {} holes: volume off by {:.2} % open, {:.2} % filled; {} intersections (whole mesh {})",
            holes.holes.len(),
            100.0 * off(before),
            100.0 * off(after),
            d.self_intersections,
            diagnose(&whole).unwrap().self_intersections,
        );
        assert!(off(after) < off(before), "{name}");
    }
}
