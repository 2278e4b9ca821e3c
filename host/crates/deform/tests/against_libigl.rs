//! With every vertex its own handle, reduced deformation is the full method: compared with shapes deformed by libigl.
//!
//! `libigl/arap.py` made the fixtures: vertices at rest (v), elements (e), held vertices and where they go (h), and
//! where libigl's `arap_solve` took all of them (p).

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::ops::ControlFlow;

use armature_deform::arap::{
    ArapEnergy, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
};
use glam::{Affine3A, DVec3, Vec3};

struct Fixture<const K: usize> {
    rest: Vec<[f64; 3]>,
    elements: Vec<[u32; K]>,
    held: Vec<(usize, [f64; 3])>,
    posed: Vec<[f64; 3]>,
}

fn read<const K: usize>(text: &str) -> Fixture<K> {
    let mut out = Fixture { rest: Vec::new(), elements: Vec::new(), held: Vec::new(), posed: Vec::new() };
    for line in text.lines() {
        let (key, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<f64> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
        let point = |from: usize| [numbers[from], numbers[from + 1], numbers[from + 2]];
        match key {
            "v" => out.rest.push(point(0)),
            "e" => out.elements.push(std::array::from_fn(|i| numbers[i] as u32)),
            "h" => out.held.push((numbers[0] as usize, point(1))),
            "p" => out.posed.push(point(0)),
            _ => panic!("{line}"),
        }
    }
    assert!(out.rest.len() > 20 && out.rest.len() == out.posed.len() && !out.held.is_empty());
    out
}

/// The largest distance from libigl's result, in sizes of the model (half its diagonal).
fn apart<const K: usize>(fixture: &Fixture<K>, energy: ArapEnergy) -> f64 {
    let n = fixture.rest.len();
    let weights: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i / n == i % n))).collect();
    let shape = ArapShape {
        positions: &fixture.rest,
        energy,
        weights: ArapWeights::Matrix(&weights),
        handle_points: &fixture.rest,
        joints: &[],
    };
    let settings = ArapSettings { clusters: Some(usize::MAX), ..ArapSettings::default() };
    let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let mut kinds = vec![HandleConstraint::Free; n];
    let mut targets = vec![Affine3A::IDENTITY; n];
    for &(vertex, to) in &fixture.held {
        kinds[vertex] = HandleConstraint::Position;
        let shift = DVec3::from(to) - DVec3::from(fixture.rest[vertex]);
        targets[vertex] = Affine3A::from_translation(shift.as_vec3());
    }
    arap.constrain(&kinds, &[]).unwrap();
    let report = arap.solve(&targets, &[], ArapStop { iterations: 2000, tolerance: 2e-7 }).unwrap();
    assert_eq!(report.warnings.contradiction, None);
    let low = fixture.rest.iter().fold(DVec3::INFINITY, |low, p| low.min(DVec3::from(*p)));
    let high = fixture.rest.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(DVec3::from(*p)));
    let mut worst = 0.0_f64;
    for (vertex, expected) in fixture.posed.iter().enumerate() {
        let rest = Vec3::from_array(fixture.rest[vertex].map(|c| c as f32));
        let at = arap.transforms()[vertex].transform_point3(rest).as_dvec3();
        worst = worst.max(at.distance(DVec3::from(*expected)));
    }
    eprintln!("{:e} after {} iterations", worst / (0.5 * high.distance(low)), report.iterations);
    worst / (0.5 * high.distance(low))
}

#[test]
fn spokes_agree() {
    let fixture = read::<3>(include_str!("libigl/spokes.txt"));
    assert!(apart(&fixture, ArapEnergy::Spokes(&fixture.elements)) < 1e-4);
}

#[test]
fn spokes_and_rims_agree() {
    let fixture = read::<3>(include_str!("libigl/spokes-and-rims.txt"));
    assert!(apart(&fixture, ArapEnergy::SpokesAndRims(&fixture.elements)) < 1e-4);
}

#[test]
fn tetrahedra_agree() {
    let fixture = read::<4>(include_str!("libigl/tetrahedra.txt"));
    assert!(apart(&fixture, ArapEnergy::Tetrahedra(&fixture.elements)) < 1e-4);
}

#[test]
fn planar_triangles_agree() {
    let fixture = read::<3>(include_str!("libigl/planar.txt"));
    assert!(apart(&fixture, ArapEnergy::PlanarTriangles(&fixture.elements)) < 1e-4);
}
