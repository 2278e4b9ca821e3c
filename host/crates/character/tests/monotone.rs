//! Monotone weights of handles: on a volume made for them, and where that is impossible.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

use std::ops::ControlFlow;

use armature_character::handle_weights::{
    BiharmonicTier, Certificates, HandlePlace, HandleShape, HandleWeights, HandleWeightsError, HandleWeightsSettings,
    Held, Partition, WeightMethod, WeightsOn, handle_weights,
};
use armature_geometry::TriangleMesh;

/// A bar from y = 0 to 4.
fn bar() -> TriangleMesh {
    let vertices = (0..8).map(|i| [f64::from(i & 1), 4.0 * f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
    let sides = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
    let more = [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
    TriangleMesh { vertices, triangles: [sides, more].concat() }
}

fn solve(heights: &[f64], order: usize, partition: Partition) -> Result<HandleWeights, HandleWeightsError> {
    let point = |y: &f64| HandleShape { name: format!("at {y}"), place: HandlePlace::Point([0.5, *y, 0.5]) };
    let shapes: Vec<HandleShape> = heights.iter().map(point).collect();
    let settings = HandleWeightsSettings {
        method: WeightMethod::Monotone { order },
        tier: BiharmonicTier::Interactive,
        on: WeightsOn::Volume { vertices: 600 },
        partition,
        joint_release: 0.0,
    };
    let held = Held::Shapes { shapes: &shapes, cage: &[] };
    handle_weights(&bar(), None, held, &settings, &mut |_, _| ControlFlow::Continue(()))
}

#[test]
fn points_in_a_bar_have_weights_without_extrema_of_their_own() {
    for order in 2..=3 {
        let made = solve(&[0.6, 2.0, 3.4], order, Partition::Normalised).unwrap();
        let Certificates::Monotone(reports) = &made.certificates else { panic!("{:?}", made.certificates) };
        for report in reports.iter().flatten() {
            println!("order {order}: {report:?}");
            assert_eq!(report.spurious, 0);
            assert!(report.slack >= 0.0 && report.margin > 0.0);
        }
        assert_eq!(reports.iter().flatten().count(), 3);
        for vertex in 0..8 {
            let sum: f64 = made.weights.vertex(vertex).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
            let own = if vertex & 2 == 0 { 0 } else { 2 };
            assert!(made.weights.weight(vertex, own) > 0.8, "an end follows the point next to it");
        }
        assert!(made.normalisation.is_some());
    }
    let left = solve(&[0.6, 3.4], 2, Partition::Left).unwrap();
    assert!(left.normalisation.is_none() && left.unconverged() == 0);
}

#[test]
fn points_solved_together_need_no_scaling() {
    let made = solve(&[0.6, 2.0, 3.4], 2, Partition::Exact).unwrap();
    let Certificates::MonotoneTogether(report) = &made.certificates else { panic!("{:?}", made.certificates) };
    println!("{report:?}");
    assert!(made.converged() && made.normalisation.is_none() && report.largest_sum_error < 1e-15);
    assert!(made.spurious.scaled.is_none() && made.spurious.computed.iter().all(Vec::is_empty));
    for vertex in 0..8 {
        assert!((made.weights.vertex(vertex).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_single_handle_has_no_minimum_and_is_constant() {
    let made = solve(&[2.0], 2, Partition::Left).unwrap();
    assert!((0..8).all(|vertex| (made.weights.weight(vertex, 0) - 1.0).abs() < 1e-12));
}
