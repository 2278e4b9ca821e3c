//! What holds of the tetrahedra before any of them is taken away.

use std::ops::ControlFlow;

use super::*;
use crate::support::shared_triangles;
use crate::volume::Resolution;
use crate::{FastWindingNumber, TriangleHierarchy, TriangleMesh};

fn tessellation_of(mesh: &TriangleMesh) -> Tessellation {
    let shell = Shell::new(mesh, Resolution::Conforming, &mut |_| ControlFlow::Continue(())).unwrap();
    let field =
        Field { surface: TriangleHierarchy::new(mesh).unwrap(), winding: FastWindingNumber::precompute(mesh).unwrap() };
    let input = VolumeInput { surface: mesh, segments: &[], points: &[] };
    tessellate(&shell, &field, &input, 2.0, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

/// Facets inside that are not locked, and those of them that are not locally Delaunay.
fn delaunay_violations(t: &Tessellation) -> (usize, usize) {
    let triangulation = &t.bulk.triangulation;
    let (mut all, mut bad) = (0, 0);
    for tet in (0..triangulation.corners.len() as u32).filter(|&tet| triangulation.is_alive(tet)) {
        for slot in 0..4 {
            all += usize::from(!triangulation.is_locked(tet, slot));
            bad += usize::from(triangulation.violates(tet, slot));
        }
    }
    (all, bad)
}

#[test]
fn facets_are_recovered_and_the_rest_is_delaunay_up_to_them() {
    for (name, whole, violating) in [
        ("armadillo.obj", 0.999, 0.005),
        ("elephant.obj", 0.999, 0.01),
        ("spot.obj", 1.0, 0.005),
        ("arm.obj", 0.99, 0.03),
        ("cow.off", 0.97, 0.06),
        ("truck.obj", 0.8, 0.2),
    ] {
        let Some(mesh) = shared_triangles(name) else { continue };
        let mut t = tessellation_of(&mesh);
        let share = t.report.facets_whole as f64 / t.report.facets as f64;
        assert!(share >= whole, "{name}: only {share} of the facets are whole");
        let (all, bad) = delaunay_violations(&t);
        assert!(bad as f64 <= violating * all as f64, "{name}: {bad} of {all} facets are not locally Delaunay");
        // No flip that leaves the surface alone would make it more Delaunay.
        let before = t.bulk.triangulation.corners.clone();
        t.bulk.triangulation.changed = (0..before.len() as u32).collect();
        let constraints = &t.constraints;
        t.bulk.triangulation.restore_delaunay(|a, b| constraints.needs_edge(a, b));
        assert_eq!(t.bulk.triangulation.corners, before, "{name}: something was left to flip");
    }
}
