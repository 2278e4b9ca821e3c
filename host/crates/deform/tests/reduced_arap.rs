//! Fast automatic skinning transformations on real and small shapes: the promises of thesis chapter 7.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

mod support;

use std::ops::ControlFlow;

use armature_deform::arap::{
    Anchor, ArapEnergy, ArapError, ArapOutcome, ArapSettings, ArapShape, ArapStop, ArapWeights, GlobalStep,
    HandleConstraint, ReducedArap, SharedJoint,
};
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3, Quat, Vec3};
use support::{Dice, bar, boundary, hand, hand_weights, middle_of_handles, smooth_weights};

use HandleConstraint::{Free, Full, Orientation, Position};

fn precompute(shape: &ArapShape) -> ReducedArap {
    ReducedArap::precompute(shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap()
}

fn rotation(dice: &mut Dice) -> Quat {
    Quat::from_xyzw(dice.roll() as f32, dice.roll() as f32, dice.roll() as f32, dice.roll() as f32).normalize()
}

fn vector(dice: &mut Dice) -> Vec3 {
    DVec3::from(dice.vector()).as_vec3()
}

/// Linear blend skinning in f64.
fn blend(positions: &[[f64; 3]], weights: &[f64], transforms: &[Affine3A]) -> Vec<DVec3> {
    let maps: Vec<DAffine3> = transforms
        .iter()
        .map(|t| DAffine3 { matrix3: t.matrix3.as_dmat3(), translation: t.translation.as_dvec3() })
        .collect();
    let rows = positions.iter().zip(weights.chunks_exact(maps.len()));
    rows.map(|(p, row)| row.iter().zip(&maps).map(|(w, m)| *w * m.transform_point3(DVec3::from(*p))).sum()).collect()
}

struct Bar {
    positions: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    surface: Vec<[u32; 3]>,
    weights: Vec<f64>,
    points: Vec<[f64; 3]>,
    joints: Vec<SharedJoint>,
}

/// A bar of 12×2×2 with five handles in a row.
fn five_handles() -> Bar {
    let (positions, tetrahedra) = bar([12, 2, 2]);
    let points: Vec<[f64; 3]> = (0..5).map(|i| [3.0 * f64::from(i), 1.0, 1.0]).collect();
    let joint = |i: usize| SharedJoint { handles: [i, i + 1], point: [3.0 * i as f64 + 1.5, 1.0, 1.0] };
    Bar {
        surface: boundary(&tetrahedra),
        weights: smooth_weights(&positions, &points),
        positions,
        tetrahedra,
        points,
        joints: (0..4).map(joint).collect(),
    }
}

impl Bar {
    fn shape(&self) -> ArapShape<'_> {
        ArapShape {
            positions: &self.positions,
            energy: ArapEnergy::Tetrahedra(&self.tetrahedra),
            weights: ArapWeights::Matrix(&self.weights),
            handle_points: &self.points,
            joints: &self.joints,
        }
    }
}

#[test]
fn the_energy_never_rises() {
    let bar = five_handles();
    let dice = &mut Dice(5);
    let energies = [
        ArapEnergy::Tetrahedra(&bar.tetrahedra),
        ArapEnergy::Spokes(&bar.surface),
        ArapEnergy::SpokesAndRims(&bar.surface),
        ArapEnergy::PlanarTriangles(&bar.surface[..150]),
    ];
    for energy in energies {
        let joints = if matches!(energy, ArapEnergy::Tetrahedra(_)) { &bar.joints[..] } else { &[] };
        let mut arap = precompute(&ArapShape { energy, joints, ..bar.shape() });
        for round in 0..30 {
            let kinds = [0; 5].map(|_| [Free, Position, Orientation, Full][((dice.roll() + 1.0) * 1.999) as usize]);
            arap.constrain(&kinds, &[]).unwrap();
            let targets: Vec<Affine3A> =
                (0..5).map(|_| Affine3A::from_rotation_translation(rotation(dice), 4.0 * vector(dice))).collect();
            let mut before = f64::INFINITY;
            let mut first = 0.0;
            for step in 0..25 {
                let report = arap.solve(&targets, &[], ArapStop { iterations: 1, tolerance: 0.0 }).unwrap();
                assert!(report.energy.is_finite() && report.energy > -1e-6 * (1.0 + first));
                if step == 0 {
                    first = report.energy;
                }
                let slack = 3e-6 * (first + 1.0);
                assert!(report.energy <= before + slack, "{energy:?} {kinds:?} {round} {step}: {before} {report:?}");
                before = report.energy;
            }
        }
    }
}

#[test]
fn rigid_motions_of_all_constraints_move_the_result_rigidly() {
    let dice = &mut Dice(6);
    let bar = five_handles();
    let mut arap = precompute(&bar.shape());
    let anchor = Anchor::on_shape([40, 41, 42], [0.2, 0.3, 0.5]);
    let stop = ArapStop { iterations: 5000, tolerance: 2e-7 };
    for kinds in [[Position, Free, Position, Free, Position], [Full, Free, Orientation, Free, Position]] {
        arap.constrain(&kinds, std::slice::from_ref(&anchor)).unwrap();
        let targets: Vec<Affine3A> = (0..5)
            .map(|_| Affine3A::from_rotation_translation(Quat::from_rotation_x(dice.roll() as f32), vector(dice)))
            .collect();
        let held = Vec3::new(7.0, 2.0, 1.0);
        arap.restart();
        arap.solve(&targets, &[held], stop).unwrap();
        let still = blend(&bar.positions, &bar.weights, arap.transforms());
        let motion = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.3), 2.0 * vector(dice));
        let moved: Vec<Affine3A> = targets.iter().map(|t| motion * *t).collect();
        let report = arap.solve(&moved, &[motion.transform_point3(held)], stop).unwrap();
        assert!(matches!(report.outcome, ArapOutcome::Converged { .. }), "{report:?}");
        let after = blend(&bar.positions, &bar.weights, arap.transforms());
        let motion = DAffine3 { matrix3: motion.matrix3.as_dmat3(), translation: motion.translation.as_dvec3() };
        for (a, b) in still.iter().zip(&after) {
            let off = motion.transform_point3(*a).distance(*b);
            assert!(off < 12.0 * 1e-5, "{kinds:?}: {off}");
        }
    }
}

#[test]
fn constraints_hold_and_joints_stay_together() {
    let dice = &mut Dice(7);
    let bar = five_handles();
    let mut arap = precompute(&bar.shape());
    let kinds = [Full, Orientation, Free, Orientation, Position];
    let anchor = Anchor::on_shape([70, 71, 72], [0.5, 0.25, 0.25]);
    arap.constrain(&kinds, &[anchor]).unwrap();
    for _ in 0..20 {
        let targets: Vec<Affine3A> =
            (0..5).map(|_| Affine3A::from_rotation_translation(rotation(dice), 3.0 * vector(dice))).collect();
        let held = 5.0 * vector(dice);
        let report = arap.solve(&targets, &[held], ArapStop::default()).unwrap();
        assert_eq!(report.warnings.contradiction, None);
        assert_eq!(report.warnings.undetermined, 0);
        let solved = arap.transforms();
        let matrix_off = |a: &Affine3A, b: &Affine3A| {
            let difference = (Mat3::from(a.matrix3) - Mat3::from(b.matrix3)).to_cols_array();
            difference.iter().fold(0.0_f32, |m, c| m.max(c.abs()))
        };
        assert!(
            matrix_off(&solved[0], &targets[0]) < 1e-6 && solved[0].translation.distance(targets[0].translation) < 2e-5
        );
        assert!(matrix_off(&solved[1], &targets[1]) < 1e-6 && matrix_off(&solved[3], &targets[3]) < 1e-6);
        let tip = Vec3::from_array(bar.points[4].map(|c| c as f32));
        assert!(solved[4].transform_point3(tip).distance(targets[4].transform_point3(tip)) < 1e-4);
        for joint in &bar.joints {
            let point = Vec3::from_array(joint.point.map(|c| c as f32));
            let [a, b] = joint.handles.map(|h| solved[h].transform_point3(point));
            assert!(a.distance(b) < 1e-4, "{joint:?}: {a} {b}");
        }
        let posed = blend(&bar.positions, &bar.weights, solved);
        let at = 0.5 * posed[70] + 0.25 * posed[71] + 0.25 * posed[72];
        assert!(at.distance(held.as_dvec3()) < 1e-4);
    }
}

/// The same energy from deformation gradients rather than edges (Chao et al. 2010), every vertex free, in f64:
/// `½ Σ volume ‖F − R‖²`, local and global steps until nothing moves.
fn full_arap(positions: &[[f64; 3]], tetrahedra: &[[u32; 4]], held: &[(usize, DVec3)]) -> Vec<DVec3> {
    use faer::prelude::Solve;
    let n = positions.len();
    let rest: Vec<DVec3> = positions.iter().map(|p| DVec3::from(*p)).collect();
    // Gradients of the hat functions: F = Σ v' gᵀ.
    let gradients: Vec<[DVec3; 4]> = tetrahedra
        .iter()
        .map(|t| {
            let [a, b, c, d] = t.map(|v| rest[v as usize]);
            let inverse = DMat3::from_cols(b - a, c - a, d - a).inverse();
            let g = [inverse.row(0), inverse.row(1), inverse.row(2)];
            [-(g[0] + g[1] + g[2]), g[0], g[1], g[2]]
        })
        .collect();
    let volume = |t: &[u32; 4]| {
        let [a, b, c, d] = t.map(|v| rest[v as usize]);
        (b - a).dot((c - a).cross(d - a)).abs() / 6.0
    };
    let mut matrix = faer::Mat::<f64>::zeros(n, n);
    for (t, g) in tetrahedra.iter().zip(&gradients) {
        for i in 0..4 {
            for j in 0..4 {
                matrix[(t[i] as usize, t[j] as usize)] += volume(t) * g[i].dot(g[j]);
            }
        }
    }
    for &(v, _) in held {
        for j in 0..n {
            matrix[(v, j)] = f64::from(u8::from(v == j));
        }
    }
    let solver = matrix.partial_piv_lu();
    let mut posed = rest.clone();
    for _ in 0..20_000 {
        let mut right = faer::Mat::<f64>::zeros(n, 3);
        for (t, g) in tetrahedra.iter().zip(&gradients) {
            let deformation = (0..4).fold(DMat3::ZERO, |sum, i| {
                let (v, g) = (posed[t[i] as usize], g[i]);
                sum + DMat3::from_cols(v * g.x, v * g.y, v * g.z)
            });
            let turn = nearest(&deformation);
            for i in 0..4 {
                let pull = turn * g[i] * volume(t);
                (0..3).for_each(|axis| right[(t[i] as usize, axis)] += pull[axis]);
            }
        }
        for &(v, at) in held {
            (0..3).for_each(|axis| right[(v, axis)] = at[axis]);
        }
        let solved = solver.solve(&right);
        let next: Vec<DVec3> = (0..n).map(|v| DVec3::new(solved[(v, 0)], solved[(v, 1)], solved[(v, 2)])).collect();
        let moved = next.iter().zip(&posed).fold(0.0_f64, |m, (a, b)| m.max(a.distance(*b)));
        posed = next;
        if moved < 1e-9 {
            return posed;
        }
    }
    panic!("the reference did not settle");
}

fn nearest(m: &DMat3) -> DMat3 {
    let svd = faer::Mat::from_fn(3, 3, |r, c| m.col(c)[r]).svd().unwrap();
    let dense = |m: faer::MatRef<f64>| {
        let column = |c: usize| DVec3::new(m[(0, c)], m[(1, c)], m[(2, c)]);
        DMat3::from_cols(column(0), column(1), column(2))
    };
    let (u, v) = (dense(svd.U()), dense(svd.V()));
    u * DMat3::from_diagonal(DVec3::new(1.0, 1.0, (u.determinant() * v.determinant()).signum())) * v.transpose()
}

#[test]
fn with_every_vertex_a_handle_it_is_the_full_method() {
    let (positions, tetrahedra) = bar([5, 1, 1]);
    let n = positions.len();
    let weights: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i / n == i % n))).collect();
    let shape = ArapShape {
        positions: &positions,
        energy: ArapEnergy::Tetrahedra(&tetrahedra),
        weights: ArapWeights::Matrix(&weights),
        handle_points: &positions,
        joints: &[],
    };
    let settings = ArapSettings { clusters: Some(usize::MAX), ..ArapSettings::default() };
    let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!(arap.cluster_count(), tetrahedra.len());
    let mut kinds = vec![Free; n];
    let mut targets = vec![Affine3A::IDENTITY; n];
    let mut held = Vec::new();
    for v in (0..4).chain(n - 4..n) {
        kinds[v] = Position;
        if v >= 4 {
            let turn = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.9), Vec3::new(0.5, -2.0, 0.3));
            targets[v] = turn;
        }
        let p = Vec3::from_array(positions[v].map(|c| c as f32));
        held.push((v, targets[v].transform_point3(p).as_dvec3()));
    }
    arap.constrain(&kinds, &[]).unwrap();
    let report = arap.solve(&targets, &[], ArapStop { iterations: 20_000, tolerance: 1e-7 }).unwrap();
    let posed = blend(&positions, &weights, arap.transforms());
    let expected = full_arap(&positions, &tetrahedra, &held);
    let off = posed.iter().zip(&expected).fold(0.0_f64, |m, (a, b)| m.max(a.distance(*b)));
    assert!(off < 5.0 * 1e-4, "off by {off}: {report:?}");
}

#[test]
fn a_hand_is_posed_by_its_finger_tips() {
    let (Some(hand), Some(weights)) = (hand(), hand_weights()) else { return };
    let (positions, tetrahedra) = (hand.vertices, hand.tetrahedra);
    let points = middle_of_handles(&positions, &weights, 20);
    let shape = ArapShape {
        positions: &positions,
        energy: ArapEnergy::Tetrahedra(&tetrahedra),
        weights: ArapWeights::Matrix(&weights),
        handle_points: &points,
        joints: &[],
    };
    let mut arap = precompute(&shape);
    assert_eq!((arap.cluster_count(), arap.degenerate_elements()), (40, 0));
    assert!(arap.weightless_handles().is_empty());
    let mut kinds = [Free; 20];
    let (mut targets, lift) = (vec![Affine3A::IDENTITY; 20], 0.1);
    let size = points.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
    for handle in [0, 3, 7, 11, 15, 19] {
        kinds[handle] = Position;
        targets[handle] = Affine3A::from_translation(Vec3::new(0.0, lift * size as f32 * (handle % 2) as f32, 0.0));
    }
    arap.constrain(&kinds, &[]).unwrap();
    let first = arap.solve(&targets, &[], ArapStop { iterations: 1, tolerance: 0.0 }).unwrap();
    let later = arap.solve(&targets, &[], ArapStop { iterations: 500, tolerance: 1e-6 }).unwrap();
    assert!(later.energy < first.energy && later.warnings == first.warnings);
    // The same bytes from a second run.
    let mut again = precompute(&shape);
    again.constrain(&kinds, &[]).unwrap();
    again.solve(&targets, &[], ArapStop { iterations: 1, tolerance: 0.0 }).unwrap();
    again.solve(&targets, &[], ArapStop { iterations: 500, tolerance: 1e-6 }).unwrap();
    assert_eq!(again.transforms(), arap.transforms());
}

#[test]
fn under_constrained_shapes_stay_where_they_are_and_say_so() {
    let bar = five_handles();
    let mut arap = precompute(&bar.shape());
    let report = arap.solve(&[Affine3A::IDENTITY; 5], &[], ArapStop::default()).unwrap();
    assert_eq!(report.warnings.undetermined, 3);
    assert!(report.energy.abs() < 1e-6);
    let posed = blend(&bar.positions, &bar.weights, arap.transforms());
    assert!(posed.iter().zip(&bar.positions).all(|(a, b)| a.distance(DVec3::from(*b)) < 1e-4));
    // Only rotated: everything turns about its own centre.
    arap.constrain(&[Orientation; 5], &[]).unwrap();
    let turn = Affine3A::from_quat(Quat::from_rotation_z(1.0));
    let report = arap.solve(&[turn; 5], &[], ArapStop { iterations: 50, tolerance: 0.0 }).unwrap();
    assert_eq!(report.warnings.undetermined, 3);
    assert!(report.energy.abs() < 1e-3, "{report:?}");
    let middle = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let posed = blend(&bar.positions, &bar.weights, arap.transforms());
    let rest: Vec<DVec3> = bar.positions.iter().map(|p| DVec3::from(*p)).collect();
    assert!(middle(&posed).distance(middle(&rest)) < 0.5);
}

#[test]
fn separate_pieces_and_handles_without_weight_are_no_harm() {
    let bar = five_handles();
    let n = bar.positions.len();
    // Two pieces, each with its own handle, and a handle that nothing follows.
    let mut positions = bar.positions.clone();
    positions.extend(bar.positions.iter().map(|p| [p[0], p[1] + 5.0, p[2]]));
    let mut tetrahedra = bar.tetrahedra.clone();
    tetrahedra.extend(bar.tetrahedra.iter().map(|t| t.map(|v| v + n as u32)));
    let weights: Vec<f64> = (0..2 * n).flat_map(|v| if v < n { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] }).collect();
    let points = [[0.0; 3], [0.0, 5.0, 0.0], [1.0; 3]];
    let shape = ArapShape {
        positions: &positions,
        energy: ArapEnergy::Tetrahedra(&tetrahedra),
        weights: ArapWeights::Matrix(&weights),
        handle_points: &points,
        joints: &[],
    };
    let mut arap = precompute(&shape);
    assert_eq!(arap.weightless_handles(), [2]);
    arap.constrain(&[Position, Free, Free], &[]).unwrap();
    let to = Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0));
    let report = arap.solve(&[to; 3], &[], ArapStop { iterations: 100, tolerance: 0.0 }).unwrap();
    assert_eq!(report.warnings.undetermined, 3 * (1 + 4));
    let posed = blend(&positions, &weights, arap.transforms());
    for v in 0..2 * n {
        let expected = DVec3::from(positions[v]) + if v < n { DVec3::new(1.0, 2.0, 3.0) } else { DVec3::ZERO };
        assert!(posed[v].distance(expected) < 1e-3, "{v}: {} {expected}", posed[v]);
    }
}

#[test]
fn hostile_targets_and_shapes_are_survived() {
    let bar = five_handles();
    let mut arap = precompute(&bar.shape());
    let finite = |arap: &ReducedArap| arap.transforms().iter().all(Affine3A::is_finite);
    arap.constrain(&[Full, Position, Orientation, Full, Position], &[]).unwrap();
    for nonsense in [f32::NAN, f32::INFINITY, f32::MAX, -1e30] {
        let bad = Affine3A::from_cols_array(&[nonsense; 12]);
        let report = arap.solve(&[bad; 5], &[], ArapStop::default()).unwrap();
        assert_eq!(report.warnings.unusable_targets, 5);
        assert!(finite(&arap) && report.energy.is_finite());
    }
    // Neighbours that share a joint are sent apart.
    arap.constrain(&[Full; 5], &[]).unwrap();
    let mut targets = [Affine3A::IDENTITY; 5];
    targets[2] = Affine3A::from_translation(Vec3::new(0.0, 7.0, 0.0));
    let report = arap.solve(&targets, &[], ArapStop::default()).unwrap();
    assert!(report.warnings.contradiction.is_some_and(|d| (d - 7.0).abs() < 1e-3), "{report:?}");
    // One point in two places.
    arap.constrain(&[Free; 5], &vec![Anchor::on_shape([3; 3], [1.0, 0.0, 0.0]); 2]).unwrap();
    let report = arap.solve(&targets, &[Vec3::ZERO, Vec3::X], ArapStop::default()).unwrap();
    assert!(report.warnings.contradiction.is_some_and(|d| (d - 0.5).abs() < 1e-3), "{report:?}");
    assert!(finite(&arap));
    // Shapes without volume: flat, and a point.
    for flatten in [[1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]] {
        let flat: Vec<[f64; 3]> = bar.positions.iter().map(|p| [0, 1, 2].map(|a| p[a] * flatten[a])).collect();
        for energy in [ArapEnergy::Tetrahedra(&bar.tetrahedra), ArapEnergy::SpokesAndRims(&bar.surface)] {
            let mut arap = precompute(&ArapShape { positions: &flat, energy, ..bar.shape() });
            arap.constrain(&[Position, Free, Orientation, Free, Position], &[]).unwrap();
            let report = arap.solve(&targets, &[], ArapStop::default()).unwrap();
            assert!(finite(&arap) && report.energy.is_finite(), "{report:?}");
            let named = arap.degenerate_elements() > 0 || report.warnings.undetermined > 0;
            // A flat surface has area; being flat is nothing unusual.
            let flat_surface = flatten[1] > 0.0 && matches!(energy, ArapEnergy::SpokesAndRims(_));
            assert!(named || flat_surface, "{flatten:?} {report:?}");
        }
    }
}

#[test]
fn nonsense_is_named() {
    let bar = five_handles();
    let attempt = |shape: &ArapShape| {
        ReducedArap::precompute(shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap_err()
    };
    let mut weights = bar.weights.clone();
    weights[5 * 7..5 * 8].fill(0.0);
    assert_eq!(
        attempt(&ArapShape { weights: ArapWeights::Matrix(&weights), ..bar.shape() }),
        ArapError::Unweighted { vertex: 7 }
    );
    weights[3] = f64::NAN;
    let error = attempt(&ArapShape { weights: ArapWeights::Matrix(&weights), ..bar.shape() });
    assert_eq!(error, ArapError::NotFinite { what: "weights of vertex", index: 0 });
    assert!(matches!(
        attempt(&ArapShape { weights: ArapWeights::Matrix(&weights[1..]), ..bar.shape() }),
        ArapError::Length { .. }
    ));
    let error = attempt(&ArapShape { energy: ArapEnergy::Spokes(&[[0, 1, 9999]]), ..bar.shape() });
    assert!(matches!(error, ArapError::VertexOutOfRange { element: 0, vertex: 9999, .. }));
    assert_eq!(
        attempt(&ArapShape { energy: ArapEnergy::Spokes(&[]), ..bar.shape() }),
        ArapError::Empty { what: "elements" }
    );
    // One rotation per element would take gigabytes: an error, without trying.
    let many = bar.tetrahedra.repeat(20);
    let all = ArapSettings { clusters: Some(usize::MAX), ..ArapSettings::default() };
    let shape = ArapShape { energy: ArapEnergy::Tetrahedra(&many), ..bar.shape() };
    let error = ReducedArap::precompute(&shape, &all, &mut |_, _| ControlFlow::Continue(())).unwrap_err();
    let most = GlobalStep::Inverse.most_clusters();
    assert!(many.len() > most && error == ArapError::TooManyClusters { clusters: many.len(), most }, "{error}");
    let joints = [SharedJoint { handles: [0, 5], point: [0.0; 3] }];
    let error = attempt(&ArapShape { joints: &joints, ..bar.shape() });
    assert_eq!(error, ArapError::HandleOutOfRange { joint: 0, handle: 5, handle_count: 5 });
    let cancelled = ReducedArap::precompute(&bar.shape(), &ArapSettings::default(), &mut |_, _| ControlFlow::Break(()));
    assert_eq!(cancelled.unwrap_err(), ArapError::Cancelled);
    let mut arap = precompute(&bar.shape());
    assert!(matches!(arap.constrain(&[Free; 4], &[]), Err(ArapError::Length { .. })));
    assert!(arap.constrain(&[Free; 5], &[Anchor::on_shape([0, 1, 5000], [0.3; 3])]).is_err());
    assert!(matches!(arap.solve(&[Affine3A::IDENTITY; 2], &[], ArapStop::default()), Err(ArapError::Length { .. })));
}
