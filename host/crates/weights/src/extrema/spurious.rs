//! Extrema that nobody asked for.

use super::error::ExtremaError;
use super::local_extrema::{Extrema, Extremum, local_extrema};
use super::neighbours::Neighbours;
use super::persistence::{PersistentExtremum, persistence_preferring};

/// Which extrema a function is expected to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected<'a> {
    /// Those that contain one of these vertices.
    At(&'a [usize]),
    /// Those with the lowest or the highest value of their piece of the mesh.
    Outermost,
}

/// The extrema of a function, one value for each vertex, besides the expected ones; most persistent first. A plateau is
/// one extremum, told of by one of its vertices.
pub fn spurious_extrema(
    neighbours: &Neighbours,
    values: &[f64],
    expected: Expected<'_>,
) -> Result<Vec<PersistentExtremum>, ExtremaError> {
    let found = local_extrema(neighbours, values)?;
    let spurious = match expected {
        Expected::At(vertices) => found.besides(vertices),
        Expected::Outermost => besides_outermost(neighbours, values, found),
    };
    if spurious.count() == 0 {
        return Ok(Vec::new());
    }
    let mut is_spurious = vec![false; values.len()];
    let all = spurious.minima.iter().chain(&spurious.maxima);
    all.flat_map(|one| &one.vertices).for_each(|&vertex| is_spurious[vertex] = true);
    // Of every plateau, exactly one vertex is told of with a persistence above zero.
    let mut is_expected = vec![false; values.len()];
    if let Expected::At(vertices) = expected {
        vertices.iter().filter(|&&vertex| vertex < values.len()).for_each(|&vertex| is_expected[vertex] = true);
    }
    let mut told = persistence_preferring(neighbours, values, |vertex| is_expected[vertex])?;
    told.retain(|one| is_spurious[one.vertex]);
    Ok(told)
}

fn besides_outermost(neighbours: &Neighbours, values: &[f64], mut found: Extrema) -> Extrema {
    let mut range = vec![[f64::INFINITY, f64::NEG_INFINITY]; values.len()];
    for piece in neighbours.pieces() {
        let low = piece.iter().map(|&vertex| values[vertex]).fold(f64::INFINITY, f64::min);
        let high = piece.iter().map(|&vertex| values[vertex]).fold(f64::NEG_INFINITY, f64::max);
        piece.into_iter().for_each(|vertex| range[vertex] = [low, high]);
    }
    let of = |one: &Extremum| range[one.vertices[0]];
    found.minima.retain(|one| one.value > of(one)[0]);
    found.maxima.retain(|one| one.value < of(one)[1]);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_expected_is_left_out_and_plateaus_are_told_of_once() {
        let edges: Vec<[u32; 2]> = (0..8).map(|k| [k, k + 1]).collect();
        let path = Neighbours::of_elements(9, &edges).unwrap();
        // Zero at both ends and in a flat valley; a hill, and a higher one with a dent.
        let values = [0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.75, 0.875, 0.0];
        let told = |expected| -> Vec<(bool, f64)> {
            let found = spurious_extrema(&path, &values, expected).unwrap();
            found.iter().map(|one| (one.is_minimum, one.persistence)).collect()
        };
        assert_eq!(told(Expected::Outermost), [(false, 0.5), (true, 0.125), (false, 0.125)]);
        // The valley is one, and as deep as the hill that parts it from an end as low as itself.
        let held = told(Expected::At(&[0, 5, 8]));
        assert_eq!(held, [(false, 0.5), (true, 0.5), (true, 0.125), (false, 0.125)]);
        assert_eq!(told(Expected::At(&[0, 1, 3, 5, 8])), [(true, 0.125), (false, 0.125)]);
        // Of equals, the expected one counts as the lowest, and the first end only parts from it at the hill.
        let valley = told(Expected::At(&[3, 5]));
        assert_eq!(valley, [(true, 1.0), (true, 0.5), (false, 0.5), (true, 0.125), (false, 0.125)]);
    }
}
