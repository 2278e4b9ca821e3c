//! Which triangles are inside, in pieces that bones connect.

use std::ops::ControlFlow;

use glam::DVec2;

use super::error::PlanarError;
use super::input::PlanarSettings;
use super::outline::{Outline, doubled_area};
use super::triangulate::Triangulated;
use crate::segmentation::{ElementWindingSettings, Label, element_winding, graph_cut_with_forced_labels};
use crate::surface::vertex_triangles;
use crate::winding::WindingNumberHierarchy2d;

/// A bone that has less than this of its length in a triangle does not pass through it.
const TOUCHES: f64 = 1e-9;

/// The chosen labels.
#[derive(Clone, Debug)]
pub(super) struct Inside {
    /// Mean winding number of every triangle, for the reversed outline if it was reversed.
    pub(super) winding: Vec<f64>,
    /// The piece of every triangle inside, connected through edges; `NO_PIECE` outside.
    pub(super) piece_of: Vec<u32>,
    pub(super) pieces: usize,
    /// Pieces that bones pass through.
    pub(super) pieces_with_bones: usize,
    /// Triangles that were made inside because a bone passes through them.
    pub(super) bridging: usize,
    pub(super) turned_over: bool,
}

pub(super) const NO_PIECE: u32 = u32::MAX;

/// Segments triangles by winding number and graph cut (thesis 8.5.1). If bones then pass through several pieces, what
/// they cross between the pieces is forced to be inside as well. `bones` lists the vertices along each.
pub(super) fn inside(
    outline: &Outline,
    mesh: &Triangulated,
    bones: &[Vec<u32>],
    settings: &PlanarSettings,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Inside, PlanarError> {
    let exact = WindingNumberHierarchy2d::precompute(&outline.vertices, &outline.segments)?;
    let quadrature = ElementWindingSettings::default();
    let evaluate = |p: [f64; 2]| exact.evaluate(p);
    let mut winding = element_winding(&mesh.vertices, &mesh.triangles, &[], &evaluate, &quadrature, &mut |_, done| {
        progress(0.5 * done)
    })?
    .means;
    let corners = |t: usize| mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
    let area = |t: usize| {
        let [a, b, c] = corners(t);
        0.5 * doubled_area(a, b, c)
    };
    let turned_over = (0..winding.len()).map(|t| area(t) * winding[t]).sum::<f64>() < 0.0;
    if turned_over {
        winding.iter_mut().for_each(|w| *w = -*w);
    }
    let lengths: Vec<[f64; 3]> = (0..winding.len())
        .map(|t| {
            let [a, b, c] = corners(t).map(DVec2::from);
            [b.distance(c), c.distance(a), a.distance(b)]
        })
        .collect();
    let mut forced = vec![Label::Free; winding.len()];
    let mut cut = |forced: &[Label], from: f64| {
        let mut part = |_: &str, done: f64| progress(from + 0.25 * done);
        let cut = graph_cut_with_forced_labels(&winding, &mesh.neighbours, &lengths, forced, &settings.cut, &mut part)?;
        let (piece_of, pieces) = pieces(&mesh.neighbours, &cut.inside);
        Ok::<_, PlanarError>((cut.inside, piece_of, pieces))
    };
    let (is_inside, mut piece_of, mut pieces) = cut(&forced, 0.5)?;
    let mut with_bones = pieces_with_bones(mesh, &piece_of, bones);
    let mut bridging = 0;
    if with_bones > 1 {
        for t in crossed_outside(mesh, &is_inside, bones) {
            forced[t as usize] = Label::Inside;
            bridging += 1;
        }
        (_, piece_of, pieces) = cut(&forced, 0.75)?;
        with_bones = pieces_with_bones(mesh, &piece_of, bones);
    }
    Ok(Inside { winding, piece_of, pieces, pieces_with_bones: with_bones, bridging, turned_over })
}

/// Pieces connected through edges, numbered by their first triangles.
fn pieces(neighbours: &[[u32; 3]], inside: &[bool]) -> (Vec<u32>, usize) {
    let mut piece_of = vec![NO_PIECE; inside.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for first in 0..inside.len() {
        if !inside[first] || piece_of[first] != NO_PIECE {
            continue;
        }
        piece_of[first] = count;
        stack.push(first);
        while let Some(t) = stack.pop() {
            for &next in &neighbours[t] {
                if next != u32::MAX && inside[next as usize] && piece_of[next as usize] == NO_PIECE {
                    piece_of[next as usize] = count;
                    stack.push(next as usize);
                }
            }
        }
        count += 1;
    }
    (piece_of, count as usize)
}

/// The smallest number of pieces that together have all vertices of bones that are in any piece; a vertex where pieces
/// touch counts for one that another vertex is in.
fn pieces_with_bones(mesh: &Triangulated, piece_of: &[u32], bones: &[Vec<u32>]) -> usize {
    let fans = vertex_triangles(mesh.vertices.len(), &mesh.triangles);
    let mut at_one: Vec<u32> = Vec::new();
    let mut at_several: Vec<Vec<u32>> = Vec::new();
    for &v in bones.iter().flatten() {
        let mut around: Vec<u32> =
            fans.of(v as usize).iter().map(|&t| piece_of[t as usize]).filter(|&p| p != NO_PIECE).collect();
        around.sort_unstable();
        around.dedup();
        match around.as_slice() {
            [] => {}
            [one] => at_one.push(*one),
            _ => at_several.push(around),
        }
    }
    at_one.sort_unstable();
    at_one.dedup();
    for around in at_several {
        if !around.iter().any(|p| at_one.binary_search(p).is_ok()) {
            let slot = at_one.partition_point(|&p| p < around[0]);
            at_one.insert(slot, around[0]);
        }
    }
    at_one.len()
}

/// Triangles outside that bones pass through, and all around the ends of those stretches, ascending.
fn crossed_outside(mesh: &Triangulated, inside: &[bool], bones: &[Vec<u32>]) -> Vec<u32> {
    let fans = vertex_triangles(mesh.vertices.len(), &mesh.triangles);
    let mut found = Vec::new();
    for pair in bones.iter().flat_map(|bone| bone.windows(2)) {
        let ends = [pair[0], pair[1]].map(|v| DVec2::from(mesh.vertices[v as usize]));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let near = |t: &usize| {
            let corners = mesh.triangles[*t].map(|v| DVec2::from(mesh.vertices[v as usize]));
            let (first, last) =
                (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            first.cmple(high).all() && last.cmpge(low).all()
        };
        let crossed: Vec<usize> =
            (0..mesh.triangles.len()).filter(near).filter(|&t| runs_through(mesh, t, ends)).collect();
        if crossed.iter().any(|&t| !inside[t]) {
            found.extend(crossed.iter().map(|&t| t as u32));
            found.extend(pair.iter().flat_map(|&v| fans.of(v as usize)));
        }
    }
    found.sort_unstable();
    found.dedup();
    found.retain(|&t| !inside[t as usize]);
    found
}

/// Whether a segment does more than touch a triangle or its edges.
fn runs_through(mesh: &Triangulated, triangle: usize, [from, to]: [DVec2; 2]) -> bool {
    let corners = mesh.triangles[triangle].map(|v| DVec2::from(mesh.vertices[v as usize]));
    let size = corners[0].distance(corners[1]);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        // Heights over the edge, in the triangle's size.
        let edge = (b - a) / (size * a.distance(b));
        let (start, end) = (edge.perp_dot(from - a) + TOUCHES, edge.perp_dot(to - a) + TOUCHES);
        if start < 0.0 && end < 0.0 {
            return false;
        }
        let at = start / (start - end);
        if start < 0.0 {
            enter = enter.max(at);
        } else if end < 0.0 {
            leave = leave.min(at);
        }
    }
    (leave - enter) * from.distance(to) > 10.0 * TOUCHES * size
}
