//! Merging vertices at the same place.

use std::collections::HashMap;

use glam::DVec3;

/// Which vertices became one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Weld {
    /// For every original vertex, the welded vertex it became.
    pub welded_of: Vec<u32>,
    /// For every welded vertex, the first original vertex that became it; ascending.
    pub representative: Vec<u32>,
}

/// Merges vertices no further apart than `distance` (mesh unit). Vertices are taken in order; each joins the first
/// earlier representative close enough, so the result depends on nothing but the order. With a distance of zero only
/// equal positions are merged. Vertices that are not finite are never merged.
pub fn weld_vertices(vertices: &[[f64; 3]], distance: f64) -> Weld {
    let mut weld = Weld { welded_of: Vec::with_capacity(vertices.len()), representative: Vec::new() };
    if distance > 0.0 {
        weld_within(vertices, distance, &mut weld);
    } else {
        weld_equal(vertices, &mut weld);
    }
    weld
}

fn weld_equal(vertices: &[[f64; 3]], weld: &mut Weld) {
    let mut seen: HashMap<[u64; 3], u32> = HashMap::with_capacity(vertices.len());
    for (index, vertex) in vertices.iter().enumerate() {
        // Adding zero turns -0 into 0, which is the same place.
        let key = vertex.map(|c| (c + 0.0).to_bits());
        let welded = if vertex.iter().all(|c| c.is_finite()) {
            *seen.entry(key).or_insert_with(|| weld.representative.len() as u32)
        } else {
            weld.representative.len() as u32
        };
        weld.join(index, welded);
    }
}

/// Width of a search cell in welding distances: wide enough that most vertices only need one cell, narrow enough that a
/// cell holds few representatives.
const CELL: f64 = 8.0;

fn weld_within(vertices: &[[f64; 3]], distance: f64, weld: &mut Weld) {
    let cell_at = |c: f64| (c / (CELL * distance)).floor() as i64;
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(vertices.len());
    for (index, vertex) in vertices.iter().enumerate() {
        let (low, high) = (vertex.map(|c| cell_at(c - distance)), vertex.map(|c| cell_at(c + distance)));
        let mut found: Option<u32> = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let near = cells.get(&[x, y, z]).into_iter().flatten().copied().filter(|&welded| {
                        let other = vertices[weld.representative[welded as usize] as usize];
                        DVec3::from(other).distance(DVec3::from(*vertex)) <= distance
                    });
                    found = found.into_iter().chain(near).min();
                }
            }
        }
        let welded = found.unwrap_or(weld.representative.len() as u32);
        if found.is_none() {
            cells.entry(vertex.map(cell_at)).or_default().push(welded);
        }
        weld.join(index, welded);
    }
}

impl Weld {
    fn join(&mut self, index: usize, welded: u32) {
        if welded as usize == self.representative.len() {
            self.representative.push(index as u32);
        }
        self.welded_of.push(welded);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_places_join_with_and_without_distance() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [-0.0, 0.0, 0.0], [1.0, 1e-6, 0.0], [f64::NAN; 3], [f64::NAN; 3]];
        let exact = weld_vertices(&vertices, 0.0);
        assert_eq!(exact.welded_of, [0, 1, 0, 2, 3, 4]);
        assert_eq!(exact.representative, [0, 1, 3, 4, 5]);
        assert_eq!(weld_vertices(&vertices, 1e-5).welded_of, [0, 1, 0, 1, 2, 3]);
    }

    #[test]
    fn joins_across_cell_borders() {
        let d = 0.1;
        let vertices = [[0.2 - 1e-9, 0.0, 0.0], [0.2 + 1e-9, 0.0, 0.0], [-1e-9, 0.2, 0.0], [1e-9, 0.2, 0.0]];
        assert_eq!(weld_vertices(&vertices, d).welded_of, [0, 0, 1, 1]);
    }
}
