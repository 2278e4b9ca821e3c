//! Sorting vertices so that given ones, and no others, are lower or higher than all their neighbours (Tierny & Pascucci
//! 2012, "Generalized Topological Simplification of Scalar Fields on Surfaces").
//!
//! A flood from the given minima, always over the lowest vertex it has reached, meets every other vertex from a lower
//! one: in the order of the flood there are no further minima. A flood from the maxima, on that order upside down, does
//! the same for maxima, and may make a few minima again; a few rounds of both end it. Where a function has only the
//! given extrema already, its own order comes back.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::error::ExtremaError;
use super::neighbours::Neighbours;

/// Floods before giving up. Noise on a disc takes two to four.
const MOST_FLOODS: usize = 100;

/// A total order of the vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MonotoneOrder {
    /// Place of each vertex, 0 for the lowest; n long. Vertices of pieces left out have `u32::MAX`.
    pub ranks: Vec<u32>,
    /// Vertices that were extrema in the order of the values and are not in this one.
    pub mended: usize,
}

/// Role of a vertex in the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
    Minimum,
    Ordinary,
    Maximum,
}

/// Sorts the vertices by `values` (n) with as few changes as it takes to have no minima and maxima but the given
/// vertices; connected given vertices may be in any order among themselves. Pieces of the mesh without any given vertex
/// are left out.
pub fn order_with_extrema(
    neighbours: &Neighbours,
    values: &[f64],
    minima: &[usize],
    maxima: &[usize],
) -> Result<MonotoneOrder, ExtremaError> {
    neighbours.check(values)?;
    let mut roles = vec![Role::Ordinary; values.len()];
    for (list, role) in [(minima, Role::Minimum), (maxima, Role::Maximum)] {
        for &vertex in list {
            let place =
                roles.get_mut(vertex).ok_or(ExtremaError::NoSuchVertex { vertex, vertices: neighbours.vertices() })?;
            if *place != Role::Ordinary && *place != role {
                return Err(ExtremaError::Both { vertex });
            }
            *place = role;
        }
    }
    let takes_part = pieces_with_both(neighbours, &roles)?;
    let mut ranks = by_value(neighbours, values, &roles, &takes_part);
    let mended = wrong(neighbours, &ranks, &roles).count();
    let mut floods = 0;
    loop {
        let Some(vertex) = wrong(neighbours, &ranks, &roles).next() else { break };
        if floods == MOST_FLOODS {
            return Err(ExtremaError::NoRoom { vertex });
        }
        floods += 2;
        flood(neighbours, &mut ranks, &roles, Role::Minimum);
        flood(neighbours, &mut ranks, &roles, Role::Maximum);
    }
    Ok(MonotoneOrder { ranks, mended })
}

/// Which vertices are in a piece with a given minimum and maximum; pieces with neither are left out.
fn pieces_with_both(neighbours: &Neighbours, roles: &[Role]) -> Result<Vec<bool>, ExtremaError> {
    let mut takes_part = vec![false; roles.len()];
    for piece in neighbours.pieces() {
        let has = |role: Role| piece.iter().any(|&vertex| roles[vertex] == role);
        match (has(Role::Minimum), has(Role::Maximum)) {
            (true, true) => piece.iter().for_each(|&vertex| takes_part[vertex] = true),
            (false, false) => {}
            (lowest, _) => {
                let lacking = if lowest { "maximum" } else { "minimum" };
                return Err(ExtremaError::Lacking { vertex: piece[0], lacking });
            }
        }
    }
    Ok(takes_part)
}

/// Ranks by value; a given extremum that is not one comes before, or after, its ordinary neighbours.
fn by_value(neighbours: &Neighbours, values: &[f64], roles: &[Role], takes_part: &[bool]) -> Vec<u32> {
    let around = |vertex: usize| neighbours.of(vertex).filter(|&other| roles[other] == Role::Ordinary);
    let key = |vertex: usize| match roles[vertex] {
        Role::Minimum => around(vertex).map(|other| values[other]).fold(values[vertex], f64::min),
        Role::Ordinary => values[vertex],
        Role::Maximum => around(vertex).map(|other| values[other]).fold(values[vertex], f64::max),
    };
    let mut order: Vec<(f64, Role, usize)> =
        (0..values.len()).filter(|&v| takes_part[v]).map(|v| (key(v), roles[v], v)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut ranks = vec![u32::MAX; values.len()];
    order.into_iter().enumerate().for_each(|(rank, (_, _, vertex))| ranks[vertex] = rank as u32);
    ranks
}

/// Vertices that are extrema and should not be, or the other way round.
fn wrong<'a>(neighbours: &'a Neighbours, ranks: &'a [u32], roles: &'a [Role]) -> impl Iterator<Item = usize> + 'a {
    (0..ranks.len()).filter(move |&vertex| {
        let mut others = neighbours.of(vertex).filter(|&other| roles[other] == Role::Ordinary);
        let (lower, higher) =
            (|other: usize| ranks[other] < ranks[vertex], |other: usize| ranks[other] > ranks[vertex]);
        ranks[vertex] != u32::MAX
            && match roles[vertex] {
                Role::Minimum => others.any(lower),
                Role::Maximum => others.any(higher),
                Role::Ordinary => !neighbours.of(vertex).any(lower) || !neighbours.of(vertex).any(higher),
            }
    })
}

/// Renumbers the vertices as a flood from those of one role meets them.
fn flood(neighbours: &Neighbours, ranks: &mut [u32], roles: &[Role], from: Role) {
    let count = ranks.iter().filter(|rank| **rank != u32::MAX).count() as u32;
    let upwards = from == Role::Minimum;
    let place = |rank: u32| if upwards { rank } else { count - 1 - rank };
    let mut met: Vec<bool> = (0..ranks.len()).map(|v| ranks[v] == u32::MAX || roles[v] == from).collect();
    let starts = (0..ranks.len()).filter(|&v| ranks[v] != u32::MAX && roles[v] == from);
    let mut open: BinaryHeap<Reverse<(u32, usize)>> = starts.map(|v| Reverse((place(ranks[v]), v))).collect();
    let mut order = Vec::with_capacity(count as usize);
    while let Some(Reverse((_, vertex))) = open.pop() {
        order.push(vertex);
        for other in neighbours.of(vertex) {
            if !std::mem::replace(&mut met[other], true) {
                open.push(Reverse((place(ranks[other]), other)));
            }
        }
    }
    order.into_iter().enumerate().for_each(|(index, vertex)| ranks[vertex] = place(index as u32));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extrema::local_extrema;

    /// A square grid of triangles.
    fn grid(side: u32) -> Neighbours {
        let cells = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| x + side * y));
        let triangles: Vec<[u32; 3]> =
            cells.flat_map(|a| [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]).collect();
        Neighbours::of_elements((side * side) as usize, &triangles).unwrap()
    }

    fn noise(count: usize) -> Vec<f64> {
        (0..count as u64).map(|k| (k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64).collect()
    }

    #[test]
    fn noise_keeps_the_given_extrema_only() {
        let (mesh, values) = (grid(40), noise(1600));
        let order = order_with_extrema(&mesh, &values, &[0, 1, 40, 790], &[1599, 300]).unwrap();
        assert!(order.mended > 100, "{}", order.mended);
        let heights: Vec<f64> = order.ranks.iter().map(|&rank| f64::from(rank)).collect();
        let found = local_extrema(&mesh, &heights).unwrap();
        assert_eq!(found.maxima.len(), 2);
        assert_eq!(found.besides(&[0, 1, 40, 790, 1599, 300]).count(), 0);
        let mut sorted = order.ranks.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(k, &rank)| rank == k as u32), "a permutation");
    }

    #[test]
    fn an_order_without_other_extrema_stays() {
        let mesh = grid(12);
        let values: Vec<f64> = (0..144).map(|k| f64::from(k % 12) + 0.3 * f64::from(k / 12)).collect();
        let order = order_with_extrema(&mesh, &values, &[0], &[143]).unwrap();
        assert_eq!(order.mended, 0);
        for a in 0..144 {
            for b in mesh.of(a).filter(|&b| values[a] < values[b]) {
                assert!(order.ranks[a] < order.ranks[b], "{a} {b}");
            }
        }
    }

    #[test]
    fn what_cannot_be_is_named() {
        let path = Neighbours::of_elements(6, &[[0, 1], [1, 2], [1, 3], [4, 5]]).unwrap();
        let values = [0.0, 1.0, 2.0, 3.0, 0.0, 1.0];
        let none = order_with_extrema(&path, &values, &[0], &[2]);
        assert_eq!(none, Err(ExtremaError::NoRoom { vertex: 3 }), "a dead end");
        let lacking = order_with_extrema(&path, &values, &[0, 4], &[2, 3]);
        assert_eq!(lacking, Err(ExtremaError::Lacking { vertex: 4, lacking: "maximum" }));
        assert_eq!(order_with_extrema(&path, &values, &[0], &[0]), Err(ExtremaError::Both { vertex: 0 }));
        let order = order_with_extrema(&path, &values, &[0], &[2, 3]).unwrap();
        assert_eq!(order.ranks, [0, 1, 2, 3, u32::MAX, u32::MAX]);
    }
}
