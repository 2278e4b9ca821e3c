//! Tetrahedra of all the sites, with as many as possible of the shell's facets among their facets.

use std::collections::HashMap;
use std::ops::ControlFlow;

use super::constraints::{Constraints, State};
use super::elements::Elements;
use super::error::VolumeError;
use super::recover::{Effort, recover};
use super::report::VolumeReport;
use super::shell::{Places, Shell};
use super::sites::Sites;
use crate::delaunay::Bulk;
use crate::predicates::collinear;

/// Most new vertices on the shell, per shell vertex ...
const POINTS_A_VERTEX: usize = 1;
/// ... but at least this many.
const POINTS_AT_LEAST: usize = 4000;

/// The whole of the convex hull in tetrahedra. Vertices are in the triangulation's numbering.
pub(super) struct Tessellation {
    pub(super) bulk: Bulk,
    pub(super) constraints: Constraints,
    /// The shell's triangles; the next two lists belong to it.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The constraint of each triangle; none if it has no area.
    pub(super) constraint_of: Vec<Option<u32>>,
    /// The vertex of each shell vertex; none for those in no triangle.
    pub(super) shell: Vec<Option<u32>>,
    /// The vertices along each bone, from head to tail.
    pub(super) segments: Vec<Vec<u32>>,
    /// The vertices of the point handles.
    pub(super) points: Vec<u32>,
    pub(super) elements: Elements,
    pub(super) report: VolumeReport,
}

/// Makes the shell's facets facets of the tetrahedra of all `sites`, which are in `bulk`.
pub(super) fn tessellate(
    mut bulk: Bulk,
    shell: &Shell,
    sites: &Sites,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Tessellation, VolumeError> {
    let mut report = VolumeReport {
        shell_vertices: shell.mesh.vertices.len(),
        bone_points: sites.segments.iter().map(Vec::len).sum(),
        inner_points: sites.inner_points,
        ..VolumeReport::default()
    };
    let mut at = vec![0; sites.positions.len()];
    // Of points at the same place, the first inserted is the corner.
    for (position, &name) in bulk.name.iter().enumerate().rev() {
        at[name as usize] = position as u32;
    }
    let vertex = |site: u32| at[bulk.first_at_place[site as usize] as usize];
    let shell_at: Vec<Option<u32>> = sites.shell.iter().map(|site| site.map(vertex)).collect();
    let corner = |v: u32| shell_at[v as usize].unwrap_or(0);
    let triangles: Vec<[u32; 3]> = shell.mesh.triangles.iter().map(|t| t.map(corner)).collect();
    let (mut constraints, constraint_of) = constrain(&triangles, bulk.triangulation.points());
    let before = bulk.triangulation.points().len();
    let effort = Effort {
        most_points: POINTS_A_VERTEX * shell.mesh.vertices.len() + POINTS_AT_LEAST,
        cut_crossings: matches!(shell.places, Places::AreVertices),
    };
    if recover(&mut bulk.triangulation, &mut constraints, effort, progress).is_break() {
        return Err(VolumeError::Cancelled);
    }
    report.shell_points_added = bulk.triangulation.points().len() - before;
    let elements = Elements::new(&bulk.triangulation, bulk.shift);
    count_facets(&constraints, &elements, &mut report);
    let segments = sites.segments.iter().map(|run| run.iter().map(|&s| vertex(s)).collect()).collect();
    let points = sites.points.iter().map(|&s| vertex(s)).collect();
    Ok(Tessellation {
        triangles,
        constraint_of,
        shell: shell_at,
        segments,
        points,
        bulk,
        constraints,
        elements,
        report,
    })
}

/// One constraint for each set of triangles on the same corners, without those that have no area.
fn constrain(triangles: &[[u32; 3]], points: &[[f64; 3]]) -> (Constraints, Vec<Option<u32>>) {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(triangles.len());
    let mut unique = Vec::with_capacity(triangles.len());
    let constraint_of = triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = triangle.map(|v| &points[v as usize]);
            if collinear(a, b, c) {
                return None;
            }
            let mut key = triangle;
            key.sort_unstable();
            Some(*known.entry(key).or_insert_with(|| {
                unique.push(triangle);
                unique.len() as u32 - 1
            }))
        })
        .collect();
    (Constraints::new(unique.into_iter()), constraint_of)
}

fn count_facets(constraints: &Constraints, elements: &Elements, report: &mut VolumeReport) {
    let area = |index: usize| {
        let [a, b, c] = constraints.triangles[index].map(|v| glam::DVec3::from(elements.vertices[v as usize]));
        (b - a).cross(c - a).length()
    };
    let first_part = constraints.depth.iter().position(|&depth| depth > 0).unwrap_or(constraints.depth.len());
    let mut has_gap = vec![false; first_part];
    let (mut covered, mut total) = (0.0, 0.0);
    for (index, &state) in constraints.state.iter().enumerate() {
        match state {
            State::Locked => covered += area(index),
            State::GivenUp | State::Missing => has_gap[constraints.parent[index] as usize] = true,
            State::Split => {}
        }
        total += if index < first_part { area(index) } else { 0.0 };
    }
    report.facets = first_part;
    report.facets_whole = constraints.state[..first_part].iter().filter(|&&s| s == State::Locked).count();
    let cut = |&i: &usize| constraints.state[i] == State::Split && !has_gap[i];
    report.facets_cut = (0..first_part).filter(cut).count();
    report.area_covered = if total > 0.0 { covered / total } else { 0.0 };
}

#[cfg(test)]
#[path = "tessellate_tests.rs"]
mod tessellate_tests;
