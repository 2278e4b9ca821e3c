//! From each handle's own weights to weights that can skin: pieces without a handle follow their nearest one, and
//! every vertex's weights sum to one (thesis 4.3.4).

use glam::DVec3;

use crate::handles::HandleBoundary;
use crate::weight_matrix::WeightMatrix;

/// What normalising changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Normalisation {
    /// Largest distance of a vertex's sum of weights from one, before normalising.
    pub largest_deviation: f64,
    /// Mean of the same over all vertices with weights.
    pub mean_deviation: f64,
    /// Vertices with no weights; they stay that way.
    pub unweighted: Vec<usize>,
}

/// Makes every piece of the mesh without a fixed vertex follow a single handle: that of the fixed vertex nearest to any
/// of the piece's vertices, and of several handles there the heaviest, then the first. `vertices` are the mesh's n
/// positions. Returns the handle of each piece in `unreached`.
///
/// # Panics
/// If there are fewer `vertices` than the weights have, or `boundary` is not the one the weights were computed for.
pub fn follow_nearest_handle(
    weights: &mut WeightMatrix,
    unreached: &[Vec<usize>],
    boundary: &HandleBoundary,
    vertices: &[[f64; 3]],
) -> Vec<usize> {
    let place = |vertex: usize| DVec3::from(vertices[vertex]);
    let mut followed = Vec::with_capacity(unreached.len());
    let mut given = vec![Vec::new(); weights.bones()];
    for piece in unreached {
        let nearness = |row: usize| {
            let to = place(boundary.fixed[row]);
            piece.iter().map(|&vertex| place(vertex).distance_squared(to)).fold(f64::INFINITY, f64::min)
        };
        let nearest = (0..boundary.fixed.len()).map(|row| (nearness(row), row)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, row)) = nearest else { break };
        let weight = |handle: usize| boundary.fixed_weights[handle * boundary.fixed.len() + row];
        let heaviest = (1..boundary.handles).fold(0, |best, h| if weight(h) > weight(best) { h } else { best });
        given[heaviest].extend(piece.iter().map(|&vertex| (vertex, 1.0)));
        followed.push(heaviest);
    }
    if followed.is_empty() {
        return followed;
    }
    given.iter_mut().for_each(|given| given.sort_unstable_by_key(|&(vertex, _)| vertex));
    if let Some(with_pieces) = weights.overlay(&given) {
        *weights = with_pieces;
    }
    followed
}

/// Scales every vertex's weights to sum to one.
pub fn normalise(weights: &mut WeightMatrix) -> Normalisation {
    let n = weights.vertices();
    let mut sums = vec![0.0; n];
    for bone in 0..weights.bones() {
        weights.column(bone).for_each(|(vertex, weight)| sums[vertex] += weight);
    }
    weights.change(|vertex, weight| if sums[vertex] > 0.0 { weight / sums[vertex] } else { weight });
    let unweighted: Vec<usize> = (0..n).filter(|&vertex| sums[vertex] <= 0.0).collect();
    let deviations = || sums.iter().filter(|sum| **sum > 0.0).map(|sum| (sum - 1.0).abs());
    Normalisation {
        largest_deviation: deviations().fold(0.0, f64::max),
        mean_deviation: deviations().sum::<f64>() / (n - unweighted.len()).max(1) as f64,
        unweighted,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_pieces_follow_their_nearest_handle() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        let boundary = HandleBoundary { fixed: vec![0, 1], fixed_weights: vec![1.0, 0.25, 0.0, 0.75], handles: 2 };
        let values = vec![1.0, 0.25, 0.0, 0.0, 0.0, 0.75, 0.0, 0.0];
        let mut weights = WeightMatrix::from_columns(4, 2, &values).unwrap();
        assert_eq!(follow_nearest_handle(&mut weights, &[vec![2, 3]], &boundary, &vertices), [1]);
        assert_eq!(weights.bone(1), [0.0, 0.75, 1.0, 1.0]);
    }

    #[test]
    fn sums_become_one_and_the_change_is_told() {
        let mut weights = WeightMatrix::from_columns(3, 2, &[0.5, 0.3, 0.0, 0.5, 0.5, 0.0]).unwrap();
        let report = normalise(&mut weights);
        assert_eq!(weights.to_columns().unwrap(), [0.5, 0.3 / 0.8, 0.0, 0.5, 0.5 / 0.8, 0.0]);
        assert!((report.largest_deviation - 0.2).abs() < 1e-15 && (report.mean_deviation - 0.1).abs() < 1e-15);
        assert_eq!(report.unweighted, [2]);
        assert_eq!(normalise(&mut WeightMatrix::default()), Normalisation::default());
    }
}
