//! The winding number for a closed surface whose facets are facets of the tetrahedra: it is constant between them, zero
//! outside, and changes by one across each. Where a facet could not be recovered, the tetrahedra near it are left to be
//! integrated; a hundred of them do not make a million others worth it.

use glam::DVec3;

use super::constraints::{Constraints, State};
use super::elements::Elements;
use crate::delaunay::Triangulation;
use crate::predicates::orientation;
use crate::surface::edges;
use crate::vectors::places;

/// The winding number of every element of a closed surface, `None` for those near a facet that is missing; or nothing at
/// all if the surface is open or there are no triangles. `triangles` are the input's in the triangulation's numbering;
/// `unique_of` gives each one's constraint, if it has one; `evaluate` is used once for each region that missing facets
/// cut off from the hull.
pub(super) fn closed_winding(
    triangulation: &mut Triangulation,
    constraints: &Constraints,
    elements: &Elements,
    triangles: &[[u32; 3]],
    unique_of: &[Option<u32>],
    evaluate: &dyn Fn([f64; 3]) -> f64,
) -> Option<Vec<Option<f64>>> {
    let is_closed = !triangles.is_empty() && edges(triangles).iter().all(|edge| 2 * edge.forward == edge.triangles);
    if !is_closed {
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
    let mut missing = Vec::new();
    for index in 0..constraints.triangles.len() {
        let step = net[constraints.parent[index] as usize];
        if constraints.state[index] == State::GivenUp && step != 0 {
            missing.push(constraints.triangles[index]);
        }
        if constraints.state[index] != State::Locked || step == 0 {
            continue;
        }
        let [a, b, c] = constraints.triangles[index];
        let Some((tet, slot)) = triangulation.find_facet([a, b, c], &mut star) else {
            missing.push([a, b, c]);
            continue;
        };
        for (tet, slot) in [(tet, slot), triangulation.across(tet, slot)] {
            let opposite = triangulation.corners(tet)[slot];
            let (Some(position), Some(jump)) =
                (triangulation.points().get(opposite as usize), jump.get_mut(elements.index_of[tet as usize] as usize))
            else {
                continue;
            };
            let at = |v: u32| triangulation.point(v);
            // Outside the facet the number is smaller than behind it; parts of two triangles may be the same facet.
            jump[slot] += if orientation(at(a), at(b), at(c), position) > 0.0 { step } else { -step };
        }
    }
    let mut winding = Winding { elements, jump, near_gap: near(elements, &missing), of: Vec::new() };
    winding.flood_all(evaluate);
    Some(winding.of.into_iter().map(|w| w.map(f64::from)).collect())
}

/// Winding numbers on their way through the elements.
struct Winding<'a> {
    elements: &'a Elements,
    /// What is added across each facet.
    jump: Vec<[i32; 4]>,
    /// These are left out.
    near_gap: Vec<bool>,
    of: Vec<Option<i32>>,
}

impl Winding<'_> {
    /// From the hull inwards, then in the regions that this does not reach.
    fn flood_all(&mut self, evaluate: &dyn Fn([f64; 3]) -> f64) {
        let elements = self.elements;
        let count = elements.tetrahedra.len();
        self.of = vec![None; count];
        for element in 0..count {
            if let Some(slot) = elements.neighbours[element].iter().position(|&n| n == u32::MAX) {
                // What is added on the way out leads to zero.
                self.flood_from(element, -self.jump[element][slot]);
            }
        }
        let mut rest: Vec<usize> = (0..count).filter(|&e| self.of[e].is_none() && !self.near_gap[e]).collect();
        // The barycentre of the largest element is the farthest from the surface.
        rest.sort_by(|&a, &b| elements.volumes[b].total_cmp(&elements.volumes[a]));
        for element in rest {
            if self.of[element].is_none() {
                let corners: [DVec3; 4] = places(&elements.vertices, elements.tetrahedra[element]);
                let winding = evaluate((0.25 * corners.into_iter().sum::<DVec3>()).to_array());
                self.flood_from(element, winding.round() as i32);
            }
        }
    }

    fn flood_from(&mut self, element: usize, winding: i32) {
        if self.near_gap[element] || self.of[element].is_some() {
            return;
        }
        self.of[element] = Some(winding);
        let mut open = vec![element];
        while let Some(element) = open.pop() {
            for slot in 0..4 {
                let next = self.elements.neighbours[element][slot] as usize;
                if let (Some(here), Some(None)) = (self.of[element], self.of.get(next))
                    && !self.near_gap[next]
                {
                    self.of[next] = Some(here + self.jump[element][slot]);
                    open.push(next);
                }
            }
        }
    }
}

/// Which elements may meet one of these triangles: their boxes do.
fn near(elements: &Elements, triangles: &[[u32; 3]]) -> Vec<bool> {
    let mut near = vec![false; elements.tetrahedra.len()];
    if triangles.is_empty() {
        return near;
    }
    let mut one_at = vec![None; elements.vertices.len()];
    for (element, corners) in elements.tetrahedra.iter().enumerate() {
        corners.iter().for_each(|&v| one_at[v as usize] = Some(element));
    }
    let mut seen_for = vec![usize::MAX; near.len()];
    for (index, triangle) in triangles.iter().enumerate() {
        let [low, high] = bounds(&elements.vertices, *triangle);
        let mut open: Vec<usize> = triangle.iter().filter_map(|&v| one_at[v as usize]).collect();
        // Those that meet a box are connected through facets.
        while let Some(element) = open.pop() {
            let [from, to] = bounds(&elements.vertices, elements.tetrahedra[element]);
            let meets = from.cmple(high).all() && low.cmple(to).all();
            if meets && std::mem::replace(&mut seen_for[element], index) != index {
                near[element] = true;
                let around = elements.neighbours[element].iter().filter(|&&n| n != u32::MAX);
                open.extend(around.map(|&n| n as usize));
            }
        }
    }
    near
}

fn bounds<const K: usize>(vertices: &[[f64; 3]], corners: [u32; K]) -> [DVec3; 2] {
    let corners = places(vertices, corners);
    let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    [low, corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p))]
}

fn turns_alike(a: [u32; 3], b: [u32; 3]) -> bool {
    (0..3).any(|k| [a[k], a[(k + 1) % 3], a[(k + 2) % 3]] == b)
}
