//! Properties of the tetrahedra before any of them is removed.

use std::ops::ControlFlow;

use super::*;
use crate::TriangleMesh;
use crate::delaunay::triangulate;
use crate::search::TriangleHierarchy;
use crate::support::shared_triangles;
use crate::volume::closed_winding::closed_winding;
use crate::volume::field::Field;
use crate::volume::sites::place;
use crate::volume::{Resolution, VolumeInput};
use crate::winding::FastWindingNumber;

fn tessellation_of(mesh: &TriangleMesh) -> Tessellation {
    let shell = Shell::new(mesh, &[], Resolution::Conforming, &mut |_| ControlFlow::Continue(())).unwrap();
    let field =
        Field { surface: TriangleHierarchy::new(mesh).unwrap(), winding: FastWindingNumber::precompute(mesh).unwrap() };
    let input = VolumeInput { surface: mesh, segments: &[], points: &[] };
    let sites = place(&shell, &field, &input, Resolution::Conforming, 2.0);
    let bulk = triangulate(&sites.positions, &mut |_| ControlFlow::Continue(())).unwrap();
    tessellate(bulk, &shell, &sites, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Facets inside that are not locked, and those of them that are not locally Delaunay.
fn delaunay_violations(t: &Tessellation) -> (usize, usize) {
    let triangulation = &t.bulk.triangulation;
    let (mut all, mut bad) = (0, 0);
    for tet in (0..triangulation.slots()).filter(|&tet| triangulation.is_alive(tet)) {
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
        let corners = |t: &Tessellation| -> Vec<[u32; 4]> {
            (0..t.bulk.triangulation.slots()).map(|tet| t.bulk.triangulation.corners(tet)).collect()
        };
        let before = corners(&t);
        t.bulk.triangulation.list_all_as_changed();
        let constraints = &t.constraints;
        t.bulk.triangulation.restore_delaunay(|a, b| constraints.needs_edge(a, b));
        assert_eq!(corners(&t), before, "{name}: something was left to flip");
    }
}

#[test]
fn a_missing_facet_leaves_the_winding_number_unknown_only_near_it() {
    // A dent, so that something is outside.
    let mut ball = crate::support::sphere(3);
    ball.vertices[0] = ball.vertices[0].map(|c| 0.5 * c);
    let gap = ball.triangles.iter().position(|t| t.contains(&0)).unwrap();
    let mut t = tessellation_of(&ball);
    let evaluate = |_: [f64; 3]| panic!("everything but the gap is reached from the hull");
    let winding = |t: &mut Tessellation| {
        let (triangles, of) = (t.triangles.clone(), t.constraint_of.clone());
        closed_winding(&mut t.bulk.triangulation, &t.constraints, &t.elements, &triangles, &of, &evaluate)
    };
    let whole = winding(&mut t).unwrap();
    assert!(whole.contains(&Some(0.0)) && whole.contains(&Some(1.0)) && !whole.contains(&None));
    t.constraints.state[gap] = State::GivenUp;
    let gapped = winding(&mut t).unwrap();
    let unknown = gapped.iter().filter(|w| w.is_none()).count();
    assert!((2..gapped.len() / 10).contains(&unknown), "{unknown} of {}", gapped.len());
    assert!(gapped.iter().zip(&whole).all(|(w, whole)| w.is_none() || w == whole), "the gap leaks");
    let at_gap = t
        .elements
        .tetrahedra
        .iter()
        .zip(&gapped)
        .filter(|(corners, _)| t.constraints.triangles[gap].iter().all(|v| corners.contains(v)));
    assert!(at_gap.map(|(_, w)| w).eq([&None, &None]));
    // An open surface has no such number.
    t.triangles.pop();
    assert_eq!(winding(&mut t), None);
}
