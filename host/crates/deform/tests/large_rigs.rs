//! Hundreds of handles: a global step by a sparse factor finds what the one by an inverse finds, and its work grows with
//! the number of handles.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

mod support;

use std::ops::ControlFlow;

use armature_deform::arap::{
    Anchor, ArapDynamics, ArapEnergy, ArapError, ArapOutcome, ArapSettings, ArapShape, ArapStop, ArapWeights,
    GlobalStep, HandleConstraint, ReducedArap, RotationLimit, SharedJoint, SoftJoint, WeightRows,
};
use glam::{Affine3A, DVec3, Quat, Vec3};
use support::{Dice, bar, boundary, smooth_weights};

use HandleConstraint::{Free, Full, Orientation, Position};

/// A bar along x with handles in a row that meet at joints.
struct Bar {
    positions: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    weights: Vec<f64>,
    points: Vec<[f64; 3]>,
    joints: Vec<SharedJoint>,
}

fn bar_of(handles: usize) -> Bar {
    let (positions, tetrahedra) = bar([2 * handles, 2, 2]);
    let points: Vec<[f64; 3]> = (0..handles).map(|i| [2.0 * i as f64 + 1.0, 1.0, 1.0]).collect();
    let joint = |i: usize| SharedJoint { handles: [i, i + 1], point: [2.0 * i as f64 + 2.0, 1.0, 1.0] };
    let weights = smooth_weights(&positions, &points);
    Bar { weights, positions, tetrahedra, points, joints: (0..handles - 1).map(joint).collect() }
}

fn both(shape: &ArapShape) -> [ReducedArap; 2] {
    [GlobalStep::Inverse, GlobalStep::Factor].map(|global_step| {
        let settings = ArapSettings { global_step, ..ArapSettings::default() };
        ReducedArap::precompute(shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
    })
}

/// The farthest that a vertex of one is from the same vertex of the other.
fn apart(positions: &[[f64; 3]], weights: &[f64], pair: &[ReducedArap; 2]) -> f64 {
    let blend = |arap: &ReducedArap, vertex: usize| {
        let maps = arap.transforms();
        let row = &weights[vertex * maps.len()..(vertex + 1) * maps.len()];
        let point = DVec3::from(positions[vertex]);
        row.iter().zip(maps).map(|(w, m)| *w * (m.matrix3.as_dmat3() * point + m.translation.as_dvec3())).sum::<DVec3>()
    };
    (0..positions.len()).fold(0.0_f64, |far, v| far.max(blend(&pair[0], v).distance(blend(&pair[1], v))))
}

fn targets(dice: &mut Dice, count: usize) -> Vec<Affine3A> {
    (0..count)
        .map(|_| {
            let turn =
                Quat::from_rotation_x(0.6 * dice.roll() as f32) * Quat::from_rotation_z(0.4 * dice.roll() as f32);
            Affine3A::from_rotation_translation(turn, 0.5 * DVec3::from(dice.vector()).as_vec3())
        })
        .collect()
}

#[test]
fn the_factor_finds_what_the_inverse_finds() {
    let bar = bar_of(9);
    let surface = boundary(&bar.tetrahedra);
    let dice = &mut Dice(11);
    let (corners, shares) = ([40, 41, 60], [0.2, 0.3, 0.5]);
    let anchor = Anchor::on_shape(corners, shares);
    for energy in [ArapEnergy::Tetrahedra(&bar.tetrahedra), ArapEnergy::SpokesAndRims(&surface)] {
        let shape = ArapShape {
            positions: &bar.positions,
            energy,
            weights: ArapWeights::Matrix(&bar.weights),
            handle_points: &bar.points,
            joints: &bar.joints,
        };
        let mut pair = both(&shape);
        assert_eq!(pair[0].cluster_count(), pair[1].cluster_count());
        for round in 0..16 {
            let kinds: Vec<_> = (0..9)
                .map(|_| [Free, Free, Position, Orientation, Full][((dice.roll() + 1.0) * 2.499) as usize])
                .collect();
            let anchors = match round % 3 {
                0 => vec![anchor.clone()],
                1 => vec![Anchor { strength: Some(2.0), ..anchor.clone() }],
                _ => Vec::new(),
            };
            let wanted = targets(dice, 9);
            let held_point = corners.iter().zip(shares);
            let at_rest: DVec3 = held_point.map(|(v, share)| share * DVec3::from(bar.positions[*v as usize])).sum();
            let held = vec![at_rest.as_vec3() + Vec3::new(0.2, -0.3, 0.1); anchors.len()];
            let reports = pair.each_mut().map(|arap| {
                arap.constrain(&kinds, &anchors).unwrap();
                arap.restart();
                arap.solve(&wanted, &held, ArapStop { iterations: 6, tolerance: 0.0 }).unwrap()
            });
            let off = apart(&bar.positions, &bar.weights, &pair);
            assert!(off < 1e-5 * 18.0, "{kinds:?}: {off}, {reports:?}");
            let difference = (reports[0].energy - reports[1].energy).abs();
            assert!(difference < 1e-4 * (1.0 + reports[0].energy), "{reports:?}");
            assert_eq!(reports[0].warnings.undetermined, reports[1].warnings.undetermined, "{kinds:?}");
        }
    }
}

#[test]
fn limits_and_momentum_too() {
    let bar = bar_of(8);
    let shape = ArapShape {
        positions: &bar.positions,
        energy: ArapEnergy::Tetrahedra(&bar.tetrahedra),
        weights: ArapWeights::Matrix(&bar.weights),
        handle_points: &bar.points,
        joints: &bar.joints,
    };
    let mut pair = both(&shape);
    let limit = RotationLimit { axis: [1.0, 0.0, 0.0], swing: 0.2, twist: [-0.1, 0.3], strength: 10.0 };
    let soft = [SoftJoint { handles: [2, 3], stiffness: 0.5, limit: Some(limit) }];
    let mut kinds = vec![Free; 8];
    (kinds[0], kinds[7]) = (Full, Position);
    for arap in &mut pair {
        arap.constrain(&kinds, &[]).unwrap();
        arap.soften(&soft).unwrap();
    }
    let mut wanted = vec![Affine3A::IDENTITY; 8];
    let dynamics = ArapDynamics { gravity: Vec3::new(0.0, -3.0, 0.0), ..ArapDynamics::default() };
    for frame in 0..40 {
        wanted[7] = Affine3A::from_translation(Vec3::new(-0.1 * frame as f32, 0.05 * frame as f32, 0.0));
        for arap in &mut pair {
            let stop = ArapStop { iterations: 8, tolerance: 0.0 };
            if frame < 20 {
                arap.solve(&wanted, &[], stop).unwrap();
            } else {
                arap.step(&dynamics, 0.01, &wanted, &[], stop).unwrap();
            }
        }
        let off = apart(&bar.positions, &bar.weights, &pair);
        assert!(off < 1e-5 * 16.0, "frame {frame}: {off}");
    }
}

#[test]
fn contradictions_are_met_halfway_and_told() {
    let bar = bar_of(4);
    // The second joint twice, and handles held where their joints do not allow it.
    let joints: Vec<SharedJoint> = bar.joints.iter().chain(&bar.joints[1..2]).copied().collect();
    let shape = ArapShape {
        positions: &bar.positions,
        energy: ArapEnergy::Tetrahedra(&bar.tetrahedra),
        weights: ArapWeights::Matrix(&bar.weights),
        handle_points: &bar.points,
        joints: &joints,
    };
    let mut pair = both(&shape);
    let wanted: Vec<Affine3A> = (0..4).map(|i| Affine3A::from_translation(Vec3::Y * (i * i) as f32)).collect();
    let reports = pair.each_mut().map(|arap| {
        arap.constrain(&[Full, Full, Position, Free], &[]).unwrap();
        arap.solve(&wanted, &[], ArapStop::default()).unwrap()
    });
    for report in reports {
        let missed = report.warnings.contradiction.unwrap();
        assert!((0.9..1.1).contains(&missed), "{report:?}");
    }
    assert!(pair[1].transforms().iter().all(Affine3A::is_finite));
    assert!(apart(&bar.positions, &bar.weights, &pair) < 1e-3);
}

/// Positions, triangles, weights, the handles' points and joints.
type Rig = (Vec<[f64; 3]>, Vec<[u32; 3]>, WeightRows, Vec<[f64; 3]>, Vec<SharedJoint>);

/// A trunk with chains of ten handles, each a tube of its own that shares a few vertices with the trunk.
fn chains(handles: usize) -> Rig {
    let (mut positions, mut triangles, mut weights) = (Vec::new(), Vec::new(), WeightRows::default());
    let (mut points, mut joints) = (Vec::new(), Vec::new());
    for handle in 0..handles {
        let (chain, along) = (handle / 10, handle % 10);
        let at = |ring: f64| [chain as f64 * 2.0, ring, (chain % 7) as f64];
        points.push(at(along as f64));
        let first = positions.len() as u32;
        for ring in 0..4 {
            for corner in 0..8 {
                let (sin, cos) = (std::f64::consts::TAU / 8.0 * f64::from(corner)).sin_cos();
                let [x, y, z] = at(along as f64 + f64::from(ring) / 3.0);
                positions.push([x + 0.3 * cos, y, z + 0.3 * sin]);
                let share = f64::from(ring) / 6.0;
                let above = if along > 0 { handle - 1 } else { handle.saturating_sub(10) };
                weights.push([(handle, 0.5 + share), (above, 0.5 - share)]);
                if ring > 0 {
                    let (a, b) = (first + 8 * ring + corner, first + 8 * ring + (corner + 1) % 8);
                    triangles.extend([[a - 8, a, b], [a - 8, b, b - 8]]);
                }
            }
        }
        if along > 0 {
            joints.push(SharedJoint { handles: [handle - 1, handle], point: at(along as f64) });
        } else if chain > 0 {
            joints.push(SharedJoint { handles: [handle - 10, handle], point: at(0.0) });
        }
    }
    (positions, triangles, weights, points, joints)
}

#[test]
fn work_grows_with_the_number_of_handles() {
    let numbers = [100, 300, 600].map(|handles| {
        let (positions, triangles, weights, points, joints) = chains(handles);
        let shape = ArapShape {
            positions: &positions,
            energy: ArapEnergy::SpokesAndRims(&triangles),
            weights: ArapWeights::Rows(&weights),
            handle_points: &points,
            joints: &joints,
        };
        let settings = ArapSettings { global_step: GlobalStep::Factor, ..ArapSettings::default() };
        let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let mut kinds = vec![Free; handles];
        kinds[0] = Full;
        (9..handles).step_by(10).for_each(|end| kinds[end] = Position);
        arap.constrain(&kinds, &[]).unwrap();
        let wanted: Vec<Affine3A> =
            (0..handles).map(|h| Affine3A::from_translation(Vec3::Z * if h % 20 == 9 { 1.0 } else { 0.0 })).collect();
        let report = arap.solve(&wanted, &[], ArapStop { iterations: 3000, tolerance: 1e-5 }).unwrap();
        assert!(matches!(report.outcome, ArapOutcome::Converged { .. }), "{report:?}");
        assert_eq!(report.warnings.contradiction, None);
        arap.numbers_per_iteration()
    });
    // Twice the handles of the whole, and not much more.
    let [hundred, three, six] = numbers.map(|n| n as f64);
    assert!(three < 3.3 * hundred && six < 6.6 * hundred, "{numbers:?}");
}

#[test]
fn weights_on_handles_that_do_not_exist_are_an_error() {
    let (positions, triangles, mut weights, points, joints) = chains(10);
    weights = {
        let mut changed = WeightRows::default();
        (0..positions.len()).for_each(|v| {
            let row = weights.of(v).iter().map(|(h, w)| (*h as usize + usize::from(v == 5) * 90, *w));
            changed.push(row);
        });
        changed
    };
    let shape = ArapShape {
        positions: &positions,
        energy: ArapEnergy::SpokesAndRims(&triangles),
        weights: ArapWeights::Rows(&weights),
        handle_points: &points,
        joints: &joints,
    };
    let made = ReducedArap::precompute(&shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(()));
    assert_eq!(made.unwrap_err(), ArapError::WeightOutOfRange { vertex: 5, handle: 90, handle_count: 10 });
}

#[test]
fn the_energy_of_what_was_solved_is_what_the_report_says() {
    let bar = bar_of(6);
    let shape = ArapShape {
        positions: &bar.positions,
        energy: ArapEnergy::Tetrahedra(&bar.tetrahedra),
        weights: ArapWeights::Matrix(&bar.weights),
        handle_points: &bar.points,
        joints: &bar.joints,
    };
    let dice = &mut Dice(3);
    for mut arap in both(&shape) {
        assert!(arap.energy_of(&[Affine3A::IDENTITY; 6]).unwrap().abs() < 1e-4, "nothing at rest");
        arap.constrain(&[Full, Free, Free, Free, Free, Position], &[]).unwrap();
        let wanted = targets(dice, 6);
        let report = arap.solve(&wanted, &[], ArapStop { iterations: 2000, tolerance: 1e-6 }).unwrap();
        let solved: Vec<Affine3A> = arap.transforms().to_vec();
        let energy = arap.energy_of(&solved).unwrap();
        assert!((energy - report.energy).abs() < 1e-3 * report.energy, "{energy} {report:?}");
        let mut stiff = solved.clone();
        stiff[2] = Affine3A::from_translation(Vec3::new(0.3, 0.0, 0.0)) * stiff[2];
        assert!(arap.energy_of(&stiff).unwrap() > energy, "the minimum is lower than beside it");
        assert!(arap.energy_of(&solved[1..]).is_err());
    }
}
