//! Whole components that are inside out.

use super::sides::{UNDECIDED, sides};
use crate::surface::{connected_components, weld_vertices};
use crate::{MeshError, TriangleMesh};

/// The components of a mesh, which are pieces connected through vertices at exactly one place, and their orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct FlippedComponents {
    /// Component of every triangle, numbered by their first vertices.
    pub component_of: Vec<u32>,
    /// For every component, the mean winding number of both sides of its surface, as it is, due to itself and the
    /// (corrected) larger components around it: ½ for the sound skin of a solid or of a hole in a solid, -½ for one
    /// inside out, near 0 for a flat sheet. `None` for components not tested because there are too many.
    pub mean_winding: Vec<Option<f64>>,
    /// Components that are inside out, ascending.
    pub flipped: Vec<u32>,
    /// Components that are too open to decide, or not tested, ascending.
    pub undecided: Vec<u32>,
}

/// Finds components that are inside out: the winding number just inside is -1 or just outside is below 0. Components
/// are tested from the largest down, each together with the corrected ones before it, so that a cavity within a solid
/// stays as it is.
pub fn flipped_components(mesh: &TriangleMesh) -> Result<FlippedComponents, MeshError> {
    mesh.validate()?;
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let components = connected_components(weld.representative.len(), &triangles);
    let (component_of, count) = number_by_first_triangle(&triangles, &components.of_vertex, components.count);
    let mut parts: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (t, &component) in component_of.iter().enumerate() {
        parts[component as usize].push(t as u32);
    }
    let mut flipped = Vec::new();
    let sides = sides(mesh, &parts, |component, sides| {
        let is_flipped = sides.own + sides.around < -UNDECIDED;
        flipped.extend(is_flipped.then_some(component as u32));
        is_flipped
    })?;
    flipped.sort_unstable();
    let mean_winding: Vec<Option<f64>> = sides.iter().map(|s| s.map(|s| s.own + s.around)).collect();
    let is_undecided = |mean: &Option<f64>| mean.is_none_or(|m| m.abs() <= UNDECIDED);
    let undecided = (0..count as u32).filter(|&c| is_undecided(&mean_winding[c as usize])).collect();
    Ok(FlippedComponents { component_of, mean_winding, flipped, undecided })
}

impl FlippedComponents {
    /// `mesh` with the flipped components turned right side out. `mesh` must be the one that was tested; triangles of
    /// other components are unchanged.
    #[must_use]
    pub fn corrected(&self, mesh: &TriangleMesh) -> TriangleMesh {
        let mut corrected = mesh.clone();
        for (triangle, component) in corrected.triangles.iter_mut().zip(&self.component_of) {
            if self.flipped.binary_search(component).is_ok() {
                triangle.swap(1, 2);
            }
        }
        corrected
    }
}

fn number_by_first_triangle(triangles: &[[u32; 3]], of_vertex: &[u32], count: usize) -> (Vec<u32>, usize) {
    let mut number: Vec<Option<u32>> = vec![None; count];
    let mut next = 0;
    let component_of = triangles
        .iter()
        .map(|t| {
            *number[of_vertex[t[0] as usize] as usize].get_or_insert_with(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    (component_of, next as usize)
}
