//! Edge removal: the tetrahedra around an edge give way to the best triangulation of the ring around it, found by
//! Klincsek's dynamic programme (Freitag & Ollivier-Gooch 1997; Klingner & Shewchuk 2008, section 3.1).

use super::candidate::Candidate;
use super::complex::{Complex, EDGES_FIRST};

/// Most corners of a ring. Larger rings rarely help, and the cost grows with the cube.
const MOST_AROUND: usize = 10;

/// The best replacement for edge `edge` of `tetrahedron`, if it beats `at_least`.
pub(super) fn remove_edge(complex: &Complex, tetrahedron: u32, edge: usize, at_least: f64, best: &mut Candidate) {
    let mut ring = [0; MOST_AROUND];
    let mut around = [0; MOST_AROUND];
    let corners = EDGES_FIRST[edge].map(|k| complex.corners(tetrahedron)[k]);
    let Some(count) = walk_around(complex, tetrahedron, corners, &mut ring, &mut around) else { return };
    let [p, q, ..] = corners;
    // value[i][j]: the worst tetrahedron of the best triangulation of the ring from i to j; apex[i][j]: its triangle.
    let mut value = [[f64::INFINITY; MOST_AROUND]; MOST_AROUND];
    let mut apex = [[0; MOST_AROUND]; MOST_AROUND];
    for span in 2..count {
        for i in 0..count - span {
            let j = i + span;
            let mut most = at_least;
            for k in i + 1..j {
                let mut least = value[i][k].min(value[k][j]);
                if least <= most {
                    continue;
                }
                least = least.min(complex.sine([ring[i], ring[k], ring[j], q]));
                if least <= most {
                    continue;
                }
                least = least.min(complex.sine([ring[k], ring[i], ring[j], p]));
                if least > most {
                    most = least;
                    apex[i][j] = k;
                }
            }
            value[i][j] = most;
        }
    }
    if value[0][count - 1] <= at_least {
        return;
    }
    best.worst = value[0][count - 1];
    best.old.clear();
    best.old.extend_from_slice(&around[..count]);
    best.new.clear();
    let mut open = vec![(0, count - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i >= 2 {
            let k = apex[i][j];
            best.new.push([ring[i], ring[k], ring[j], q]);
            best.new.push([ring[k], ring[i], ring[j], p]);
            open.extend([(i, k), (k, j)]);
        }
    }
}

/// The vertices around an edge counter-clockwise, with the tetrahedron from each to the next; `None` if the edge must
/// stay or has too many.
fn walk_around(
    complex: &Complex,
    tetrahedron: u32,
    [p, q, first, second]: [u32; 4],
    ring: &mut [u32; MOST_AROUND],
    around: &mut [u32; MOST_AROUND],
) -> Option<usize> {
    let (mut here, mut from, mut to) = (tetrahedron, first, second);
    for count in 0..MOST_AROUND {
        ring[count] = from;
        around[count] = here;
        here = complex.across(here, complex.slot_of(here, from)?)?;
        if here == tetrahedron {
            return (count >= 2).then_some(count + 1);
        }
        let next = complex.corners(here).into_iter().find(|&v| v != p && v != q && v != to)?;
        (from, to) = (to, next);
    }
    None
}
