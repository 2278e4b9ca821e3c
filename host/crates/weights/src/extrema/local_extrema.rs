//! The exact extrema of a piecewise linear function.

use std::cmp::Ordering;

use super::error::ExtremaError;
use super::neighbours::Neighbours;

/// A connected set of vertices of one value whose other neighbours are all higher, or all lower.
#[derive(Clone, Debug, PartialEq)]
pub struct Extremum {
    /// Their value.
    pub value: f64,
    /// The vertices, ascending.
    pub vertices: Vec<usize>,
}

/// All extrema of a function, by first vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extrema {
    /// Vertices and plateaus with only higher neighbours.
    pub minima: Vec<Extremum>,
    /// Vertices and plateaus with only lower neighbours.
    pub maxima: Vec<Extremum>,
}

impl Extrema {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.minima.len() + self.maxima.len()
    }

    /// Those that contain none of the expected vertices: the spurious ones.
    #[must_use]
    pub fn besides(&self, expected: &[usize]) -> Self {
        let spurious = |all: &[Extremum]| {
            all.iter().filter(|one| !expected.iter().any(|v| one.vertices.binary_search(v).is_ok())).cloned().collect()
        };
        Self { minima: spurious(&self.minima), maxima: spurious(&self.maxima) }
    }
}

/// Finds the minima and maxima of a function, one value for each vertex. Values are compared exactly, and a plateau is
/// one extremum; a piece of the mesh on which the function is constant has none.
pub fn local_extrema(neighbours: &Neighbours, values: &[f64]) -> Result<Extrema, ExtremaError> {
    neighbours.check(values)?;
    let mut found = Extrema::default();
    let mut seen = vec![false; values.len()];
    for first in 0..values.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let value = values[first];
        let mut vertices = vec![first];
        let (mut at, mut lower, mut higher) = (0, false, false);
        while let Some(&vertex) = vertices.get(at) {
            at += 1;
            for other in neighbours.of(vertex) {
                match values[other].partial_cmp(&value) {
                    Some(Ordering::Less) => lower = true,
                    Some(Ordering::Greater) => higher = true,
                    _ if std::mem::replace(&mut seen[other], true) => {}
                    _ => vertices.push(other),
                }
            }
        }
        if lower != higher {
            vertices.sort_unstable();
            let list = if lower { &mut found.maxima } else { &mut found.minima };
            list.push(Extremum { value, vertices });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plateaus_count_once_and_slopes_do_not() {
        let edges: Vec<[u32; 2]> = (0..9).map(|k| [k, k + 1]).collect();
        let path = Neighbours::of_elements(11, &edges).unwrap();
        // A plateau on a slope, a plateau on top, a valley, an end, and a vertex alone.
        let values = [0.0, 1.0, 1.0, 2.0, 2.0, 0.5, 0.5, 3.0, 3.0, 4.0, 7.0];
        let found = local_extrema(&path, &values).unwrap();
        let of = |all: &[Extremum]| all.iter().map(|one| one.vertices.clone()).collect::<Vec<_>>();
        assert_eq!(of(&found.minima), [vec![0], vec![5, 6]]);
        assert_eq!(of(&found.maxima), [vec![3, 4], vec![9]]);
        assert_eq!(of(&found.besides(&[0, 6, 9]).maxima), [vec![3, 4]]);
        assert_eq!(local_extrema(&path, &[1.0; 11]).unwrap().count(), 0, "constant");
    }

    #[test]
    fn nonsense_is_named() {
        let path = Neighbours::of_elements(2, &[[0, 1]]).unwrap();
        assert_eq!(local_extrema(&path, &[0.0]), Err(ExtremaError::Size { values: 1, vertices: 2 }));
        assert!(matches!(local_extrema(&path, &[0.0, f64::NAN]), Err(ExtremaError::NotFinite { vertex: 1, .. })));
        let missing = Neighbours::of_elements(2, &[[0, 2]]);
        assert_eq!(missing, Err(ExtremaError::NoSuchVertex { vertex: 2, vertices: 2 }));
    }
}
