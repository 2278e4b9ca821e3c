//! Weights of joints without a volume, from distances (thesis eq. 6.9).

use glam::DVec3;

use crate::weight_matrix::WeightMatrix;

/// The inverse squares of the distances of n points to each joint (eq. 6.9 with α = 2), scaled to sum to one (Shepard
/// 1968): smooth, but blind to the shape. A point at a joint follows it alone. A point or joint that is not finite has no
/// weight.
pub fn inverse_distance_weights(points: &[[f64; 3]], joints: &[[f64; 3]]) -> WeightMatrix {
    let mut columns = vec![vec![0.0; points.len()]; joints.len()];
    let mut squares = vec![0.0; joints.len()];
    for (row, &point) in points.iter().enumerate() {
        for (square, &joint) in squares.iter_mut().zip(joints) {
            *square = DVec3::from(point).distance_squared(joint.into());
        }
        let nearest = squares.iter().copied().filter(|square| square.is_finite()).fold(f64::INFINITY, f64::min);
        // Relative to the nearest joint, so that nothing is divided by a tiny number.
        let share = |square: f64| match square {
            square if !square.is_finite() || nearest.is_infinite() => 0.0,
            square if square <= nearest => 1.0,
            square => nearest / square,
        };
        let sum: f64 = squares.iter().map(|&square| share(square)).sum();
        for (column, &square) in columns.iter_mut().zip(&squares) {
            column[row] = if sum > 0.0 { share(square) / sum } else { 0.0 };
        }
    }
    WeightMatrix::from_columns(points.len(), joints.len(), &columns.concat()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_share_by_the_square_of_their_distance() {
        let joints = [[0.0; 3], [3.0, 0.0, 0.0]];
        let points = [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0]];
        let weights = inverse_distance_weights(&points, &joints);
        assert_eq!(weights.bone(0), [0.8, 0.0, 0.0]);
        assert_eq!(weights.bone(1), [0.2, 1.0, 0.0]);
        let lost = inverse_distance_weights(&points[..1], &[[f64::INFINITY, 0.0, 0.0], [0.0; 3]]);
        assert_eq!((lost.bone(0), lost.bone(1)), (vec![0.0], vec![1.0]));
    }
}
