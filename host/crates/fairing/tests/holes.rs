//! Holes: found, told apart from what was meant, closed.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod support;

use armature_fairing::holes::{FillError, HoleOutcome, Meant, blend_on_domain, blend_rims, fill_holes, find_holes};
use armature_fairing::{Domain, DomainSettings, Join, PatchSettings, RimShape};
use armature_geometry::TriangleMesh;
use armature_geometry::surface::diagnose;
use glam::DVec3;
use support::{cut, go, sheet, sphere, together, tube};

const JOINS: [Join; 4] = [
    Join::Tangent,
    Join::Curvature,
    Join::Angle { degrees: 0.0, strength: 1.0 },
    Join::Bent { degrees: 0.0, strength: 1.0, curvature: 1.0 },
];

/// The original is unchanged and comes first.
fn check_kept(before: &TriangleMesh, after: &TriangleMesh) {
    assert_eq!(after.vertices[..before.vertices.len()], before.vertices[..]);
    assert_eq!(after.triangles[..before.triangles.len()], before.triangles[..]);
}

fn smallest_angle(mesh: &TriangleMesh, triangles: std::ops::Range<usize>) -> f64 {
    let angles = mesh.triangles[triangles].iter().flat_map(|t| {
        let p = t.map(|v| DVec3::from(mesh.vertices[v as usize]));
        (0..3).map(move |k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]).to_degrees())
    });
    angles.fold(180.0, f64::min)
}

#[test]
fn a_sphere_is_made_whole_again() {
    let whole = sphere(4);
    for (join, most) in JOINS.into_iter().zip([0.03, 0.01, 0.04, 0.06]) {
        let torn = cut(&whole, [0.3, 0.8, 0.52], 0.45);
        let holes = find_holes(&torn).unwrap();
        assert_eq!((holes.holes.len(), holes.broken.len()), (1, 0));
        assert_eq!(holes.holes[0].meant, None);
        let settings = PatchSettings { join, ..PatchSettings::default() };
        let filled = fill_holes(&torn, &holes, &[0], &settings, &mut go).unwrap();
        check_kept(&torn, &filled.mesh);
        let patch = &filled.patches[0];
        let radii = patch.vertices.clone().map(|v| DVec3::from(filled.mesh.vertices[v as usize]).length());
        let off = radii.map(|r| (r - 1.0).abs()).fold(0.0, f64::max);
        let d = diagnose(&filled.mesh).unwrap();
        let angle = smallest_angle(&filled.mesh, patch.triangles.clone());
        println!(
            "{join:?}: {} vertices, {} rounds, {:?}, off by {off:.4}, smallest angle {angle:.0}°, residual {:.1e}, {} intersections",
            patch.vertices.len(),
            patch.rounds,
            patch.outcome,
            patch.residual,
            d.self_intersections
        );
        assert!(d.closed && d.self_intersections == 0 && d.non_manifold_edges == 0);
        assert!(off < most, "{join:?}: {off}");
        assert!(angle > 12.0, "{join:?}: {angle}");
        assert!(patch.residual < 1e-9);
    }
}

#[test]
fn openings_that_were_meant_are_named() {
    let flat = find_holes(&sheet(6, 4)).unwrap();
    assert_eq!(flat.holes.len(), 1);
    assert_eq!(flat.holes[0].meant, Some(Meant::Sheet));
    assert!((flat.holes[0].length - 20.0).abs() < 1e-12);

    // Both ends of a tube along x are each other's mirror image.
    let mut sleeve = tube(24, 6, -2.0, 2.0);
    sleeve.vertices.iter_mut().for_each(|p| p.swap(0, 2));
    let ends = find_holes(&sleeve).unwrap();
    assert_eq!(ends.holes.len(), 2);
    assert_eq!(ends.holes[0].meant, Some(Meant::Mirrored { twin: 1 }));

    let torn = cut(&sphere(4), [0.0, 1.0, 0.0], 0.9);
    let mut island = cut(&sphere(4), [0.0, -1.0, 0.0], 1.85);
    island.vertices.iter_mut().for_each(|p| p[1] *= 1.0);
    let both = find_holes(&together(&torn, &island)).unwrap();
    let named: Vec<_> = both.holes.iter().map(|h| h.meant).collect();
    assert!(named.contains(&Some(Meant::Island { inside: 0 })), "{named:?}");
    assert_eq!(find_holes(&sphere(2)).unwrap().holes.len(), 0, "a closed mesh has none");
}

#[test]
fn rims_that_cannot_be_closed_are_named_and_the_rest_is_filled() {
    let torn = cut(&sphere(4), [0.0, 0.0, 1.0], 0.3);
    let mut messy = cut(&torn, [0.0, 0.0, -1.0], 0.3);
    // A fin on an edge of the surface: three triangles meet there.
    let [a, b, _] = messy.triangles[0];
    messy.vertices.push([2.0, 2.0, 2.0]);
    let tip = messy.vertices.len() as u32 - 1;
    messy.triangles.push([a, b, tip]);
    let holes = find_holes(&messy).unwrap();
    assert_eq!(holes.broken.len(), 1);
    let filled = fill_holes(&messy, &holes, &[0, 1], &PatchSettings::default(), &mut go).unwrap();
    check_kept(&messy, &filled.mesh);
    assert!(filled.patches.iter().all(|p| p.outcome.is_filled()), "{:?}", filled.patches);
    let left = find_holes(&filled.mesh).unwrap();
    assert_eq!((left.holes.len(), left.broken.len()), (0, 1));

    let nowhere = fill_holes(&messy, &holes, &[7], &PatchSettings::default(), &mut go).unwrap_err();
    assert_eq!(nowhere, FillError::NoSuchHole { index: 7, count: 2 });
    let alone = blend_rims(&messy, &holes, &[0], &PatchSettings::default(), &mut go).unwrap_err();
    assert_eq!(alone, FillError::TooFewRims { given: 1 });
    let mut stop = |_: &'static str, _: f64| std::ops::ControlFlow::Break(());
    let stopped = fill_holes(&messy, &holes, &[0], &PatchSettings::default(), &mut stop).unwrap_err();
    assert!(matches!(stopped, FillError::Cancelled { .. }));
}

#[test]
fn holes_that_touch_are_filled_each() {
    // Two opposite triangle fans around one vertex are missing.
    let mut torn = sheet(8, 8);
    let centre = |t: &[u32; 3]| -> [f64; 2] {
        std::array::from_fn(|k| t.iter().map(|&v| torn.vertices[v as usize][k] / 3.0).sum())
    };
    let gone = |t: &[u32; 3]| {
        let [x, y] = centre(t);
        (x > 2.0 && x < 4.0 && y > 2.0 && y < 4.0) || (x > 4.0 && x < 6.0 && y > 4.0 && y < 6.0)
    };
    let kept: Vec<[u32; 3]> = torn.triangles.iter().copied().filter(|t| !gone(t)).collect();
    torn.triangles = kept;
    let holes = find_holes(&torn).unwrap();
    assert_eq!(holes.holes.len(), 3, "the outer rim and two holes");
    assert!(holes.holes[1..].iter().all(|h| h.touches.len() == 1 && h.rim.len() == 8));
    let touching = blend_rims(&torn, &holes, &[1, 2], &PatchSettings::default(), &mut go).unwrap_err();
    assert!(matches!(touching, FillError::RimsTouch { .. }));
    let filled = fill_holes(&torn, &holes, &[1, 2], &PatchSettings::default(), &mut go).unwrap();
    assert!(filled.patches.iter().all(|p| p.outcome == HoleOutcome::Settled), "{:?}", filled.patches);
    let flat = filled.mesh.vertices.iter().all(|p| p[2].abs() < 1e-9);
    assert!(flat, "a flat sheet stays flat");
    let d = diagnose(&filled.mesh).unwrap();
    assert_eq!((d.non_manifold_edges, d.boundary_edges, d.self_intersections), (0, 32, 0));
}

#[test]
fn slivers_at_the_rim_are_survived() {
    let mut torn = cut(&sphere(4), [0.0, 0.0, 1.0], 0.35);
    let rim = find_holes(&torn).unwrap().holes[0].rim.clone();
    // Rim vertices almost at one place.
    let (a, b) = (rim[0] as usize, rim[1] as usize);
    torn.vertices[a] =
        std::array::from_fn(|k| torn.vertices[b][k] + 1e-7 * (torn.vertices[a][k] - torn.vertices[b][k]));
    let holes = find_holes(&torn).unwrap();
    for join in JOINS {
        let settings = PatchSettings { join, ..PatchSettings::default() };
        let filled = fill_holes(&torn, &holes, &[0], &settings, &mut go).unwrap();
        check_kept(&torn, &filled.mesh);
        let patch = &filled.patches[0];
        println!("{join:?}: {:?} {} vertices", patch.outcome, patch.vertices.len());
        assert!(patch.vertices.len() < 2000, "{join:?}");
        assert!(filled.mesh.vertices.iter().flatten().all(|x| x.abs() < 2.0), "{join:?}");
    }
}

#[test]
fn two_tubes_are_joined() {
    let pair = together(&tube(32, 4, -3.0, -1.0), &tube(32, 4, 1.0, 3.0));
    let holes = find_holes(&pair).unwrap();
    let inner: Vec<usize> = (0..4).filter(|&h| holes.holes[h].centre[2].abs() < 2.0).collect();
    for (join, most) in [(Join::Tangent, 0.12), (Join::Curvature, 0.12)] {
        let settings = PatchSettings { join, ..PatchSettings::default() };
        let joined = blend_rims(&pair, &holes, &inner, &settings, &mut go).unwrap();
        check_kept(&pair, &joined.mesh);
        let patch = &joined.patches[0];
        let off = patch.vertices.clone().map(|v| {
            let [x, y, _] = joined.mesh.vertices[v as usize];
            (x.hypot(y) - 1.0).abs()
        });
        let off = off.fold(0.0, f64::max);
        let d = diagnose(&joined.mesh).unwrap();
        println!(
            "{join:?}: {} vertices, {} rounds, {:?}, off by {off:.3}",
            patch.vertices.len(),
            patch.rounds,
            patch.outcome
        );
        assert_eq!((d.components, d.non_manifold_edges, d.self_intersections), (1, 0, 0));
        assert!(off < most, "{join:?}: {off}");
    }
}

/// Two tubes along z that end at -1 and 1, and their inner ends.
fn tubes_apart(around: [u32; 2]) -> (TriangleMesh, [usize; 2]) {
    let pair = together(&tube(around[0], 2, -2.0, -1.0), &tube(around[1], 2, 1.0, 2.0));
    let holes = find_holes(&pair).unwrap().holes;
    let end = |z: f64| holes.iter().position(|h| (h.centre[2] - z).abs() < 0.1).unwrap();
    let ends = [end(-1.0), end(1.0)];
    (pair, ends)
}

#[test]
fn a_blend_on_a_cylinder_is_the_biharmonic_function() {
    // x = cos s f(z) with (d²/dz² - 1)² f = 0, f = 1 and f' = 0 at both ends: f = A cosh z + B z sinh z.
    let (sinh, cosh) = (1.0_f64.sinh(), 1.0_f64.cosh());
    let b = -sinh / (cosh * (sinh + cosh) - sinh * sinh);
    let a = (1.0 - b * sinh) / cosh;
    let mut errors = Vec::new();
    for around in [[24, 24], [48, 48], [96, 80]] {
        let (pair, ends) = tubes_apart(around);
        let holes = find_holes(&pair).unwrap();
        let blend = blend_on_domain(&pair, &holes, ends, &DomainSettings::default(), &mut go).unwrap();
        check_kept(&pair, &blend.mesh);
        let d = diagnose(&blend.mesh).unwrap();
        assert_eq!((d.components, d.non_manifold_edges, d.self_intersections), (1, 0, 0));
        let off = blend.patches[0].vertices.clone().map(|v| {
            let [x, y, z] = blend.mesh.vertices[v as usize];
            (x.hypot(y) - (a * z.cosh() + b * z * z.sinh())).abs()
        });
        errors.push(off.fold(0.0, f64::max));
    }
    println!("narrowest {a:.4}; errors {errors:?}");
    // The error falls with the square of the edges, and is small beside what the tube narrows by.
    assert!(errors[1] < 0.4 * errors[0] && errors[2] < 0.02 * (1.0 - a), "{errors:?}");
}

#[test]
fn a_flat_ring_on_an_annulus_stays_flat_and_even() {
    let ring = |around: u32, radius: f64, out: f64| {
        let mut tube = tube(around, 2, 0.0, 1.0);
        for p in &mut tube.vertices {
            let factor = radius + (out - radius) * p[2];
            *p = [p[0] * factor, p[1] * factor, 0.0];
        }
        tube
    };
    let mut inner = ring(40, 1.0, 0.5);
    let outer = ring(70, 2.0, 3.0);
    // It narrows as the outer one widens: turned over, both face the same way.
    inner.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let pair = together(&inner, &outer);
    let holes = find_holes(&pair).unwrap();
    let tau = std::f64::consts::TAU;
    let rim = |length: f64| holes.holes.iter().position(|h| (h.length - length).abs() < 0.1).unwrap();
    for curvature in [None, Some(0.0)] {
        let shapes = [RimShape { curvature, ..RimShape::default() }; 2];
        let settings = DomainSettings { domain: Domain::Annulus, shapes, ..DomainSettings::default() };
        let blend = blend_on_domain(&pair, &holes, [rim(tau), rim(2.0 * tau)], &settings, &mut go).unwrap();
        let d = diagnose(&blend.mesh).unwrap();
        assert_eq!((d.components, d.non_manifold_edges), (1, 0));
        let patch = &blend.patches[0];
        let places: Vec<DVec3> = patch.vertices.clone().map(|v| DVec3::from(blend.mesh.vertices[v as usize])).collect();
        assert!(places.iter().all(|p| p.z.abs() < 1e-12));
        let radii = || places.iter().map(|p| p.length());
        let (low, high) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
        println!("{curvature:?}: {} vertices from {low:.3} to {high:.3}", places.len());
        assert!(low > 1.05 && high < 1.95, "no fold at the rims");
    }
}

#[test]
fn tangents_and_curvature_shape_a_blend_on_a_cylinder() {
    let (pair, ends) = tubes_apart([40, 40]);
    let holes = find_holes(&pair).unwrap();
    let radius_at = |shapes: [RimShape; 2], z: f64| {
        let settings = DomainSettings { shapes, ..DomainSettings::default() };
        let blend = blend_on_domain(&pair, &holes, ends, &settings, &mut go).unwrap();
        assert!(blend.patches[0].outcome.is_filled() && blend.patches[0].residual < 1e-12);
        let near = blend.patches[0].vertices.clone().map(|v| blend.mesh.vertices[v as usize]);
        let nearest = near.min_by(|p, q| (p[2] - z).abs().total_cmp(&(q[2] - z).abs())).unwrap();
        nearest[0].hypot(nearest[1])
    };
    let at = |degrees: f64, curvature: Option<f64>| RimShape { degrees, strength: 1.0, curvature };
    let straight = radius_at([at(0.0, None); 2], 0.0);
    let fuller = radius_at([at(40.0, None); 2], 0.0);
    assert!(fuller > straight + 0.2, "{straight} {fuller}");
    // One end is wide, the other narrow.
    let skew = [at(40.0, None), at(-40.0, None)];
    let (low, high) = (radius_at(skew, -0.5), radius_at(skew, 0.5));
    assert!(low > 1.05 && high < 0.95, "{low} {high}");
    let (flat, bulging) = (radius_at([at(0.0, Some(0.0)); 2], 0.0), radius_at([at(0.0, Some(3.0)); 2], 0.0));
    println!("{straight:.3} {fuller:.3} {flat:.3} {bulging:.3}");
    assert!((flat - bulging).abs() > 0.05, "{flat} {bulging}");
}

#[test]
fn three_tubes_are_joined() {
    let turned = |k: u32| {
        let mut arm = tube(20, 4, 2.0, 4.0);
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 3.0).sin_cos();
        for p in &mut arm.vertices {
            let [x, y, z] = *p;
            *p = [x, y * cos - z * sin, y * sin + z * cos];
        }
        arm
    };
    let arms = together(&together(&turned(0), &turned(1)), &turned(2));
    let holes = find_holes(&arms).unwrap();
    let inner: Vec<usize> = (0..6).filter(|&h| DVec3::from(holes.holes[h].centre).length() < 3.0).collect();
    assert_eq!(inner.len(), 3);
    let joined = blend_rims(&arms, &holes, &inner, &PatchSettings::default(), &mut go).unwrap();
    let d = diagnose(&joined.mesh).unwrap();
    println!("{:?}", joined.patches[0].outcome);
    assert!(joined.patches[0].outcome.is_filled());
    // A sphere with three holes, the outer ends.
    assert_eq!((d.components, d.non_manifold_edges, d.boundary_edges, d.euler_characteristic), (1, 0, 60, -1));
}
