//! Stiff and limited joints as terms of the energy.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

mod support;

use std::f64::consts::PI;
use std::ops::ControlFlow;

use armature_deform::arap::{
    ArapEnergy, ArapError, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
    RotationLimit, SoftJoint,
};
use glam::{Affine3A, Mat3A, Quat, Vec3};
use support::{Dice, bar, boundary, smooth_weights};

use HandleConstraint::{Free, Full, Orientation, Position};

struct Bar {
    positions: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    weights: Vec<f64>,
    points: Vec<[f64; 3]>,
}

/// A bar of 12×2×2 along x with five handles in a row.
fn five_handles() -> Bar {
    let (positions, tetrahedra) = bar([12, 2, 2]);
    let points: Vec<[f64; 3]> = (0..5).map(|i| [3.0 * f64::from(i), 1.0, 1.0]).collect();
    Bar { weights: smooth_weights(&positions, &points), positions, tetrahedra, points }
}

impl Bar {
    fn precompute(&self, energy: ArapEnergy) -> ReducedArap {
        let shape = ArapShape {
            positions: &self.positions,
            energy,
            weights: ArapWeights::Matrix(&self.weights),
            handle_points: &self.points,
            joints: &[],
        };
        ReducedArap::precompute(&shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap()
    }
}

fn limit(swing: f64, twist: f64, strength: f64) -> RotationLimit {
    RotationLimit { axis: [2.0, 0.0, 0.0], swing, twist: [-twist, twist], strength }
}

fn turn(dice: &mut Dice) -> Quat {
    Quat::from_xyzw(dice.roll() as f32, dice.roll() as f32, dice.roll() as f32, dice.roll() as f32).normalize()
}

/// How far two handles are rotated relative to each other (radians).
fn apart(arap: &ReducedArap, [a, b]: [usize; 2]) -> f64 {
    let turn = |handle: usize| Quat::from_mat3a(&arap.transforms()[handle].matrix3).normalize();
    f64::from(turn(a).angle_between(turn(b)))
}

#[test]
fn the_energy_never_rises() {
    let bar = five_handles();
    let surface = boundary(&bar.tetrahedra);
    let dice = &mut Dice(5);
    let energies = [
        ArapEnergy::Tetrahedra(&bar.tetrahedra),
        ArapEnergy::Spokes(&surface),
        ArapEnergy::SpokesAndRims(&surface),
        ArapEnergy::PlanarTriangles(&surface[..150]),
    ];
    for energy in energies {
        let mut arap = bar.precompute(energy);
        for round in 0..40 {
            let joint = |handle: usize| SoftJoint {
                handles: [handle, handle + 1],
                stiffness: 0.5 * dice.roll().abs(),
                limit: (handle != 2).then(|| RotationLimit {
                    axis: dice.vector(),
                    swing: 0.5 * PI * dice.roll().abs(),
                    twist: [-PI * dice.roll().abs(), PI * dice.roll().abs()],
                    strength: 10.0_f64.powf(2.0 * dice.roll()),
                }),
            };
            let joints: Vec<SoftJoint> = (0..4).map(joint).collect();
            arap.soften(&joints).unwrap();
            let kinds = [0; 5].map(|_| [Free, Position, Orientation, Full][((dice.roll() + 1.0) * 1.999) as usize]);
            arap.constrain(&kinds, &[]).unwrap();
            let shift = |dice: &mut Dice| 4.0 * Vec3::from_array(dice.vector().map(|c| c as f32));
            let targets: Vec<Affine3A> =
                (0..5).map(|_| Affine3A::from_rotation_translation(turn(dice), shift(dice))).collect();
            let (mut before, mut first) = (f64::INFINITY, 0.0);
            for step in 0..25 {
                let report = arap.solve(&targets, &[], ArapStop { iterations: 1, tolerance: 0.0 }).unwrap();
                if step == 0 {
                    first = report.energy;
                }
                assert!(report.energy.is_finite() && report.energy > -1e-6 * (1.0 + first));
                let slack = 3e-6 * (first + 1.0);
                assert!(report.energy <= before + slack, "{energy:?} {kinds:?} {round} {step}: {before} {report:?}");
                before = report.energy;
            }
        }
    }
}

#[test]
fn terms_are_those_of_the_formula() {
    // With all handles given, only the terms themselves are left.
    let bar = five_handles();
    let mut arap = bar.precompute(ArapEnergy::Tetrahedra(&bar.tetrahedra));
    arap.constrain(&[Full; 5], &[]).unwrap();
    let stop = ArapStop { iterations: 50, tolerance: 0.0 };
    let pressed = Affine3A { matrix3: Mat3A::ZERO, translation: Vec3::ONE.into() };
    let unit = arap.solve(&[pressed; 5], &[], stop).unwrap().energy;
    for (angle, axis) in [(0.4_f32, Vec3::Z), (1.5, Vec3::Y), (2.4, Vec3::new(0.0, 0.6, 0.8)), (1.2, Vec3::X)] {
        let around = Vec3::new(3.0, 1.0, 1.0);
        let turned = Affine3A::from_translation(around)
            * Affine3A::from_axis_angle(axis, angle)
            * Affine3A::from_translation(-around);
        let targets = [Affine3A::IDENTITY, turned, turned, turned, turned];
        let mut energy = |joint: &[SoftJoint]| {
            arap.soften(joint).unwrap();
            arap.restart();
            arap.solve(&targets, &[], stop).unwrap().energy
        };
        let bare = energy(&[]);
        let stiff = energy(&[SoftJoint { handles: [0, 1], stiffness: 0.7, limit: None }]) - bare;
        // Two rotations that differ by φ are 4 (1 − cos φ) apart, squared.
        let angle = f64::from(angle);
        let expected = 0.5 * 0.7 * unit * 4.0 * (1.0 - angle.cos());
        assert!((stiff - expected).abs() < 1e-4 * unit, "{stiff} {expected}");
        let limited = limit(0.5, 0.3, 2.0);
        let held = energy(&[SoftJoint { handles: [0, 1], stiffness: 0.0, limit: Some(limited) }]) - bare;
        // The excess is shared by both.
        let share = 0.5 * (angle - if axis == Vec3::X { 0.3 } else { 0.5 }).max(0.0);
        let expected = 2.0 * 0.5 * 2.0 * unit * 4.0 * (1.0 - share.cos());
        assert!((held - expected).abs() < 1e-4 * unit, "{angle} {axis}: {held} {expected}");
    }
}

#[test]
fn a_limit_holds_and_is_not_felt_within() {
    let bar = five_handles();
    let mut arap = bar.precompute(ArapEnergy::Tetrahedra(&bar.tetrahedra));
    arap.constrain(&[Full, Free, Free, Free, Orientation], &[]).unwrap();
    for (axis, swing, twist) in [(Vec3::Z, 0.2, PI), (Vec3::X, PI, 0.2)] {
        let bent = Affine3A::from_axis_angle(axis, 2.0);
        let targets = [Affine3A::IDENTITY, bent, bent, bent, bent];
        let stop = ArapStop { iterations: 2000, tolerance: 1e-6 };
        let mut angle = |limit: Option<RotationLimit>| {
            arap.soften(&[SoftJoint { handles: [1, 2], stiffness: 0.0, limit }]).unwrap();
            arap.restart();
            arap.solve(&targets, &[], stop).unwrap();
            apart(&arap, [1, 2])
        };
        let free = angle(None);
        assert!(free > 0.4, "{free}");
        let held = angle(Some(limit(swing, twist, 100.0)));
        assert!(held < 0.2 + 0.02, "{axis}: {held} of {free}");
        let wide = angle(Some(limit(PI, PI, 1.0)));
        assert!((wide - free).abs() < 0.1 * free, "{axis}: {wide} of {free}");
    }
}

#[test]
fn a_stiff_joint_bends_less() {
    let bar = five_handles();
    let mut arap = bar.precompute(ArapEnergy::Tetrahedra(&bar.tetrahedra));
    arap.constrain(&[Full, Free, Free, Free, Orientation], &[]).unwrap();
    let bent = Affine3A::from_axis_angle(Vec3::Z, 1.5);
    let targets = [Affine3A::IDENTITY, bent, bent, bent, bent];
    let mut last = f64::INFINITY;
    for stiffness in [0.0, 0.1, 1.0, 10.0] {
        arap.soften(&[SoftJoint { handles: [1, 2], stiffness, limit: None }]).unwrap();
        arap.restart();
        arap.solve(&targets, &[], ArapStop { iterations: 2000, tolerance: 1e-6 }).unwrap();
        let angle = apart(&arap, [1, 2]);
        assert!(angle < 0.9 * last, "{stiffness}: {angle} after {last}");
        last = angle;
    }
    assert!(last < 0.05, "{last}");
}

#[test]
fn nonsense_is_named() {
    let bar = five_handles();
    let mut arap = bar.precompute(ArapEnergy::Tetrahedra(&bar.tetrahedra));
    let bad = |limit| SoftJoint { handles: [0, 1], stiffness: 0.0, limit: Some(limit) };
    let good = limit(1.0, 1.0, 1.0);
    for limit in [
        limit(-0.1, 1.0, 1.0),
        limit(1.0, f64::NAN, 1.0),
        limit(1.0, 4.0, 1.0),
        limit(1.0, 1.0, f64::INFINITY),
        RotationLimit { axis: [f64::NAN; 3], ..good },
        RotationLimit { twist: [0.1, 0.5], ..good },
    ] {
        assert_eq!(arap.soften(&[bad(good), bad(limit)]), Err(ArapError::UnusableSoftJoint { joint: 1 }));
    }
    let stray = SoftJoint { handles: [0, 5], stiffness: 0.0, limit: None };
    assert_eq!(arap.soften(&[stray]), Err(ArapError::HandleOutOfRange { joint: 0, handle: 5, handle_count: 5 }));
    // Without an axis, with the same handle twice, and without freedom: finite all the same.
    arap.soften(&[
        bad(RotationLimit { axis: [0.0; 3], ..good }),
        SoftJoint { handles: [2, 2], stiffness: 1.0, limit: Some(good) },
        bad(limit(0.0, 0.0, 1e4)),
    ])
    .unwrap();
    let far = Affine3A::from_rotation_translation(Quat::from_rotation_y(3.0), Vec3::splat(40.0));
    arap.constrain(&[Full, Orientation, Free, Free, Position], &[]).unwrap();
    let report = arap.solve(&[Affine3A::IDENTITY, far, far, far, far], &[], ArapStop::default()).unwrap();
    assert!(report.energy.is_finite() && arap.transforms().iter().all(Affine3A::is_finite));
}

#[test]
fn a_handle_without_weight_is_decided_by_its_joint_and_undecided_again_without() {
    let mut bar = five_handles();
    for row in bar.weights.chunks_exact_mut(5) {
        row[3] += std::mem::take(&mut row[4]);
    }
    let mut arap = bar.precompute(ArapEnergy::Tetrahedra(&bar.tetrahedra));
    let constraints = [Full, Free, Free, Free, Free];
    let targets = [Affine3A::from_rotation_x(0.3); 5];
    let undetermined = |arap: &mut ReducedArap| {
        let report = arap.solve(&targets, &[], ArapStop::default()).unwrap();
        assert!(arap.transforms().iter().all(Affine3A::is_finite));
        report.warnings.undetermined
    };
    arap.soften(&[SoftJoint { handles: [3, 4], stiffness: 1.0, limit: None }]).unwrap();
    arap.constrain(&constraints, &[]).unwrap();
    assert_eq!(undetermined(&mut arap), 3, "its translation");
    arap.soften(&[]).unwrap();
    assert_eq!(undetermined(&mut arap), 12, "all of it");
}
