//! The winding number where the surface is closed and all of its facets are facets of the tetrahedra: it is constant
//! between them, zero outside, and changes by one across each.

use super::constraints::{Constraints, State};
use super::elements::Elements;
use crate::delaunay::Triangulation;
use crate::edges;
use crate::predicates::orientation;

/// For every element its winding number; `None` if the surface is open, a facet is missing or there are none. `triangles` are the
/// input's in the triangulation's numbering; `unique_of` says which constraint each is, if one.
pub(super) fn closed_winding(
    triangulation: &mut Triangulation,
    constraints: &Constraints,
    elements: &Elements,
    triangles: &[[u32; 3]],
    unique_of: &[Option<u32>],
) -> Option<Vec<f64>> {
    let is_closed = !triangles.is_empty() && edges(triangles).iter().all(|edge| 2 * edge.forward == edge.triangles);
    if !is_closed || constraints.state.contains(&State::GivenUp) {
        return None;
    }
    let mut net = vec![0_i32; constraints.triangles.len()];
    for (triangle, unique) in triangles.iter().zip(unique_of) {
        if let &Some(unique) = unique {
            let like = constraints.triangles[unique as usize];
            net[unique as usize] += if turns_alike(*triangle, like) { 1 } else { -1 };
        }
    }
    let mut jump = vec![[0_i32; 4]; elements.tetrahedra.len()];
    let mut star = Vec::new();
    for index in 0..constraints.triangles.len() {
        let step = net[constraints.parent[index] as usize];
        if constraints.state[index] != State::Locked || step == 0 {
            continue;
        }
        let [a, b, c] = constraints.triangles[index];
        let (tet, slot) = triangulation.find_facet([a, b, c], &mut star)?;
        let other = triangulation.neighbours[tet as usize][slot];
        let back = triangulation.neighbours[other as usize].iter().position(|&n| n == tet)?;
        for (tet, slot) in [(tet, slot), (other, back)] {
            let opposite = triangulation.corners[tet as usize][slot];
            let (Some(position), Some(jump)) =
                (triangulation.points.get(opposite as usize), jump.get_mut(elements.index_of[tet as usize] as usize))
            else {
                continue;
            };
            let at = |v: u32| &triangulation.points[v as usize];
            // Outside the facet the number is smaller than behind it.
            jump[slot] = if orientation(at(a), at(b), at(c), position) > 0.0 { step } else { -step };
        }
    }
    Some(flood(elements, &jump))
}

/// From the hull inwards; `jump` is what is added across each facet.
fn flood(elements: &Elements, jump: &[[i32; 4]]) -> Vec<f64> {
    let mut winding: Vec<Option<i32>> = vec![None; elements.tetrahedra.len()];
    let mut open = Vec::new();
    for (tet, across) in elements.neighbours.iter().enumerate() {
        if let Some(slot) = across.iter().position(|&n| n == u32::MAX)
            && winding[tet].is_none()
        {
            // What is added on the way out leads to zero.
            winding[tet] = Some(-jump[tet][slot]);
            open.push(tet);
        }
    }
    while let Some(tet) = open.pop() {
        for slot in 0..4 {
            let next = elements.neighbours[tet][slot] as usize;
            if let (Some(here), Some(there)) = (winding[tet], winding.get_mut(next))
                && there.is_none()
            {
                *there = Some(here + jump[tet][slot]);
                open.push(next);
            }
        }
    }
    winding.into_iter().map(|w| f64::from(w.unwrap_or(0))).collect()
}

fn turns_alike(a: [u32; 3], b: [u32; 3]) -> bool {
    (0..3).any(|k| [a[k], a[(k + 1) % 3], a[(k + 2) % 3]] == b)
}
