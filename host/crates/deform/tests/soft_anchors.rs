//! Points that pull a shape towards their targets.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::ops::ControlFlow;

use armature_deform::arap::{
    Anchor, AnchorPoint, ArapEnergy, ArapError, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint,
    ReducedArap,
};
use glam::{Affine3A, Vec3};

const TRIANGLES: [[u32; 3]; 4] = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
const POSITIONS: [[f64; 3]; 5] =
    [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A pyramid without a base that follows the handles at these points.
fn pyramid(weights: &[f64], handle_points: &[[f64; 3]]) -> ReducedArap {
    let shape = ArapShape {
        positions: &POSITIONS,
        energy: ArapEnergy::SpokesAndRims(&TRIANGLES),
        weights: ArapWeights::Matrix(weights),
        handle_points,
        joints: &[],
    };
    ReducedArap::precompute(&shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap()
}

fn on_handle(handle: usize, at: [f64; 3], strength: Option<f64>) -> Anchor {
    Anchor { point: AnchorPoint::OnHandles(vec![(handle, 1.0, at)]), strength }
}

/// With its turn given, a single handle goes where two springs balance: the mean of their wishes by strength.
#[test]
fn two_springs_meet_at_their_weighted_mean() {
    let mut arap = pyramid(&[1.0; 5], &[[0.0; 3]]);
    let corner = Anchor { strength: Some(3.0), ..Anchor::on_shape([0; 3], [1.0, 0.0, 0.0]) };
    arap.constrain(&[HandleConstraint::Orientation], &[corner, on_handle(0, [0.0, 0.0, 1.0], Some(1.0))]).unwrap();
    let (to_corner, to_top) = (Vec3::new(3.0, -1.0, 0.0), Vec3::new(0.0, 8.0, 1.0));
    arap.solve(&[Affine3A::IDENTITY], &[to_corner, to_top], ArapStop::default()).unwrap();
    let moved = arap.transforms()[0].transform_point3(Vec3::ZERO);
    assert!(moved.distance(Vec3::new(3.0, 2.0, 0.0)) < 1e-5, "{moved}");
}

/// Two handles, of which one is held: the stronger the spring on the other, the nearer it comes, and the result tends to
/// that of an anchor which holds. The energy of the shape and its spring together is the least at the solution.
#[test]
fn a_spring_comes_nearer_with_strength_and_tends_to_a_hard_anchor() {
    let weights = [1.0, 0.0, 0.2, 0.8, 0.1, 0.9, 0.8, 0.2, 0.5, 0.5];
    let mut arap = pyramid(&weights, &[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    let kinds = [HandleConstraint::Full, HandleConstraint::Free];
    let (targets, pull) = ([Affine3A::IDENTITY; 2], [Vec3::new(1.4, 0.5, 0.3)]);
    let stop = ArapStop { iterations: 4000, tolerance: 1e-7 };
    let end = Vec3::new(1.0, 0.0, 0.0);
    let mut solve = |strength: Option<f64>| {
        arap.constrain(&kinds, &[on_handle(1, end.as_dvec3().to_array(), strength)]).unwrap();
        arap.restart();
        let mut before = f64::INFINITY;
        for _ in 0..50 {
            let report = arap.solve(&targets, &pull, ArapStop { iterations: 2, ..stop }).unwrap();
            assert!(report.energy <= before + 1e-6, "{strength:?}: {} after {before}", report.energy);
            before = report.energy;
        }
        let report = arap.solve(&targets, &pull, stop).unwrap();
        (arap.transforms()[1].transform_point3(end), report.energy)
    };
    let (hard, energy_of_hard) = solve(None);
    assert!(hard.distance(pull[0]) < 1e-5, "{hard}");
    let (mut off, mut energy) = (f32::INFINITY, 0.0);
    for strength in [0.01, 0.1, 1.0, 10.0, 1000.0] {
        let (at, least) = solve(Some(strength));
        assert!(at.distance(pull[0]) < off && least >= energy && least <= energy_of_hard, "{strength}: {at} {least}");
        (off, energy) = (at.distance(pull[0]), least);
    }
    assert!(off < 1e-3 && (energy_of_hard - energy) < 1e-3 * energy_of_hard, "{off} {energy} {energy_of_hard}");
}

#[test]
fn anchors_that_cannot_be_used_are_refused() {
    let mut arap = pyramid(&[1.0; 5], &[[0.0; 3]]);
    let mut constrain = |anchor| arap.constrain(&[HandleConstraint::Free], &[anchor]);
    assert!(matches!(constrain(on_handle(1, [0.0; 3], None)), Err(ArapError::HandleOutOfRange { .. })));
    for strength in [-1.0, f64::NAN, 1e9] {
        assert!(matches!(constrain(on_handle(0, [0.0; 3], Some(strength))), Err(ArapError::NotFinite { .. })));
    }
    assert!(constrain(on_handle(0, [f64::NAN; 3], None)).is_err());
}
