//! Curve conditions of the triharmonic problem as two held rows (thesis 3.4.2, "Reduction of fixed curve boundary
//! conditions"): tangents along the border place the vertices next to it.
//!
//! The thesis extends u linearly from the border. Second derivatives are known too, so the extension here is quadratic,
//! which makes the place of a vertex right to the third order in the size of its triangle instead of the second.

use std::collections::BTreeMap;

use armature_geometry::operators::SparseMatrix;

use super::conditions::{Border, Checked, Sides};
use super::elements::Elements;
use super::error::FairingError;

/// A border that turns by more than this at a vertex (30°) has a corner there, and no second derivative along itself.
const CORNER: f64 = std::f64::consts::PI / 6.0;

/// Cotangents below this are rounding errors of right angles.
const NO_WEIGHT: f64 = 1e-6;

/// A vertex beside the border, and the border edges that say where it is.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) vertex: u32,
    from: Vec<Offset>,
}

/// A place relative to a border edge, in the plane of the triangles between them.
#[derive(Clone, Copy, Debug)]
struct Offset {
    border: usize,
    /// From the edge's first end (0) to its second (1).
    along: f64,
    /// How far inside.
    inward: f64,
}

/// The border around one of its vertices.
#[derive(Clone, Copy, Debug)]
struct Bend {
    before: (u32, f64),
    after: (u32, f64),
    /// How much the border turns towards the domain for each unit of length.
    curvature: f64,
}

/// The rows beside borders whose ends are both bent.
#[derive(Debug)]
pub(super) struct TwoRows {
    pub(super) placed: Vec<Placed>,
    /// Of every border edge, its ends' bends; `None` at corners.
    bends: Vec<[Option<Bend>; 2]>,
}

/// Values along the border, one component.
pub(super) struct AlongBorder<'a> {
    /// u at every vertex, right at the border.
    pub(super) u: &'a [f64],
    /// Δu at every vertex, right at the border.
    pub(super) laplacian: &'a [f64],
    /// ∂u/∂n of every border edge, at the ends as its triangle runs.
    pub(super) tangents: &'a [[f64; 2]],
}

impl TwoRows {
    /// Finds the free vertices beside bent ones.
    pub(super) fn find(
        elements: &Elements,
        laplacian: &SparseMatrix,
        checked: &Checked,
        fixed: &[bool],
    ) -> Result<Self, FairingError> {
        let (borders, bent) = (&checked.borders, &checked.bent);
        let is_beside = beside(laplacian, fixed, bent);
        let sides = Sides::of(elements.triangles());
        let ours = |border: &Border| border.ends.iter().all(|&v| bent[v as usize]);
        // Directly over an edge, or else around one of its ends.
        let mut over: BTreeMap<u32, (Vec<Offset>, Vec<Offset>)> = BTreeMap::new();
        for (index, border) in borders.iter().enumerate().filter(|(_, b)| ours(b)) {
            for (vertex, along, inward, direct) in around(elements, &sides, border) {
                if is_beside[vertex as usize] {
                    let offset = Offset { border: index, along, inward };
                    let lists = over.entry(vertex).or_default();
                    if direct { lists.0.push(offset) } else { lists.1.push(offset) }
                }
            }
        }
        if let Some(beside) = (0..fixed.len() as u32).find(|&v| is_beside[v as usize] && !over.contains_key(&v)) {
            let near = laplacian.column(beside as usize).map(|(row, _)| row).find(|&row| bent[row]);
            return Err(FairingError::NoTangent { vertex: near.unwrap_or(0) as u32, beside });
        }
        let choose = |(direct, other): (Vec<Offset>, Vec<Offset>)| if direct.is_empty() { other } else { direct };
        let placed = over.into_iter().map(|(vertex, lists)| Placed { vertex, from: choose(lists) }).collect();
        Ok(Self { placed, bends: bends(elements, borders) })
    }

    /// The value of each placed vertex.
    pub(super) fn values(&self, borders: &[Border], given: &AlongBorder<'_>) -> Vec<f64> {
        let value = |placed: &Placed| {
            let sum: f64 = placed.from.iter().map(|offset| self.extended(borders, given, offset)).sum();
            sum / placed.from.len() as f64
        };
        self.placed.iter().map(value).collect()
    }

    /// u at an offset, by Taylor's formula from the border.
    fn extended(&self, borders: &[Border], given: &AlongBorder<'_>, offset: &Offset) -> f64 {
        let (border, tangents) = (&borders[offset.border], given.tangents[offset.border]);
        let between = |[from, to]: [f64; 2]| from + offset.along * (to - from);
        let ends = border.ends.map(|v| v as usize);
        let linear = between(ends.map(|v| given.u[v])) - offset.inward * between(tangents);
        let second_along: Vec<f64> = (0..2)
            .filter_map(|k| {
                let bend = self.bends[offset.border][k]?;
                Some(second_difference(given.u, ends[k], &bend) + bend.curvature * tangents[k])
            })
            .collect();
        if second_along.is_empty() {
            return linear;
        }
        let along = second_along.iter().sum::<f64>() / second_along.len() as f64;
        let across = between(ends.map(|v| given.laplacian[v])) - along;
        linear + 0.5 * offset.inward.powi(2) * across
            - 0.5 * offset.along * (1.0 - offset.along) * border.length.powi(2) * along
    }
}

/// The second derivative along the border, by lengths.
fn second_difference(u: &[f64], at: usize, bend: &Bend) -> f64 {
    let ((before, back), (after, ahead)) = (bend.before, bend.after);
    2.0 * ((u[after as usize] - u[at]) / ahead - (u[at] - u[before as usize]) / back) / (back + ahead)
}

/// Free vertices that a bent one has an equation with. A neighbour across a right angle has none.
fn beside(laplacian: &SparseMatrix, fixed: &[bool], bent: &[bool]) -> Vec<bool> {
    let meets = |v: usize| laplacian.column(v).any(|(row, weight)| bent[row] && weight.abs() > NO_WEIGHT);
    (0..fixed.len()).map(|v| !fixed[v] && meets(v)).collect()
}

/// Vertices of the triangles around an edge's ends, unfolded into the plane of the edge: how far along, how far inside,
/// and whether the triangle stands on the edge.
fn around(elements: &Elements, sides: &Sides, border: &Border) -> Vec<(u32, f64, f64, bool)> {
    let [a, b] = border.ends;
    let mut found = Vec::new();
    for (pivot, is_first) in [(a, true), (b, false)] {
        let (mut angle, mut triangle) = (0.0, Some(border.triangle));
        let mut edge_end = if is_first { b } else { a };
        let mut first = true;
        while let Some(index) = triangle {
            let corners = elements.triangles()[index as usize];
            let Some(apex) = corners.iter().copied().find(|&v| v != pivot && v != edge_end) else { break };
            let lengths = elements.lengths()[index as usize];
            angle += angle_at(corners, lengths, pivot);
            // Beyond a straight angle the edge is out of sight.
            if angle > std::f64::consts::PI {
                break;
            }
            // A triangle on the edge is seen from both ends and counts once.
            if !first || is_first {
                let reach = side_between(corners, lengths, pivot, apex);
                let along = reach * angle.cos() / border.length;
                found.push((apex, if is_first { along } else { 1.0 - along }, reach * angle.sin(), first));
            }
            let next = if is_first { sides.at(pivot, apex) } else { sides.at(apex, pivot) };
            triangle = next.map(|(t, _)| t).filter(|&t| t != border.triangle);
            edge_end = apex;
            first = false;
        }
    }
    found
}

fn angle_at(corners: [u32; 3], lengths: [f64; 3], vertex: u32) -> f64 {
    let at = corners.iter().position(|&v| v == vertex).unwrap_or(0);
    let (opposite, b, c) = (lengths[at], lengths[(at + 1) % 3], lengths[(at + 2) % 3]);
    ((b * b + c * c - opposite * opposite) / (2.0 * b * c)).clamp(-1.0, 1.0).acos()
}

fn side_between(corners: [u32; 3], lengths: [f64; 3], a: u32, b: u32) -> f64 {
    corners.iter().position(|&v| v != a && v != b).map_or(0.0, |opposite| lengths[opposite])
}

/// How the border goes on at both ends of each of its edges.
fn bends(elements: &Elements, borders: &[Border]) -> Vec<[Option<Bend>; 2]> {
    let mut inside: BTreeMap<u32, f64> = borders.iter().flat_map(|b| b.ends).map(|v| (v, 0.0)).collect();
    for (&corners, &lengths) in elements.triangles().iter().zip(elements.lengths()) {
        for vertex in corners {
            if let Some(sum) = inside.get_mut(&vertex) {
                *sum += angle_at(corners, lengths, vertex);
            }
        }
    }
    let mut ahead: BTreeMap<u32, (u32, f64)> = BTreeMap::new();
    let mut back: BTreeMap<u32, (u32, f64)> = BTreeMap::new();
    for border in borders {
        let [from, to] = border.ends;
        ahead.insert(from, (to, border.length));
        back.insert(to, (from, border.length));
    }
    let bend = |vertex: u32| {
        let (before, after) = (*back.get(&vertex)?, *ahead.get(&vertex)?);
        let turn = std::f64::consts::PI - inside.get(&vertex)?;
        let curvature = 2.0 * turn / (before.1 + after.1);
        (turn.abs() < CORNER).then_some(Bend { before, after, curvature })
    };
    borders.iter().map(|border| border.ends.map(bend)).collect()
}
