//! A tetrahedral mesh with what a search in it needs: neighbours and boundary.

use glam::DVec3;
use rayon::prelude::*;

use crate::TetrahedralMesh;
use crate::facets::{facet, sorted_sides};
use crate::predicates::orientation;

/// Marks a missing neighbour.
pub(super) const NONE: u32 = u32::MAX;
#[derive(Debug)]
pub(super) struct Volume<'a> {
    pub(super) mesh: &'a TetrahedralMesh,
    /// In units of `unit`, where all signs are exact.
    pub(super) positions: Vec<DVec3>,
    /// A power of two.
    pub(super) unit: f64,
    /// m×4: the tetrahedron across the face opposite each corner.
    pub(super) neighbours: Vec<[u32; 4]>,
    /// 1 or -1 as the corners are oriented, 0 without volume.
    orientations: Vec<i8>,
    /// Faces of one tetrahedron only: that, and the corner opposite.
    pub(super) facets: Vec<(u32, u8)>,
    tetrahedra_at: Lists,
    facets_at: Lists,
}

/// For every vertex a slice of a shared list.
#[derive(Debug)]
struct Lists {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    fn new<const K: usize>(vertices: usize, elements: impl Iterator<Item = [u32; K]> + Clone) -> Self {
        let mut starts = vec![0_u32; vertices + 1];
        elements.clone().flatten().for_each(|v| starts[v as usize + 1] += 1);
        (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
        let mut next = starts.clone();
        let mut items = vec![0; starts[vertices] as usize];
        for (index, element) in elements.enumerate() {
            for v in element {
                items[next[v as usize] as usize] = index as u32;
                next[v as usize] += 1;
            }
        }
        Self { starts, items }
    }

    fn of(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        match (self.starts.get(v), self.starts.get(v.wrapping_add(1))) {
            (Some(&first), Some(&end)) => &self.items[first as usize..end as usize],
            _ => &[],
        }
    }
}

impl<'a> Volume<'a> {
    /// Of a valid mesh.
    pub(super) fn new(mesh: &'a TetrahedralMesh) -> Self {
        let largest = mesh.vertices.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
        let unit = if largest > 0.0 { libm::scalbn(1.0, libm::ilogb(largest).clamp(-1000, 1000)) } else { 1.0 };
        let positions: Vec<DVec3> = mesh.vertices.iter().map(|&p| DVec3::from(p) / unit).collect();
        let orientations = mesh
            .tetrahedra
            .par_iter()
            .map(|t| {
                let [a, b, c, d] = t.map(|v| positions[v as usize].to_array());
                let sign = orientation(&a, &b, &c, &d);
                i8::from(sign > 0.0) - i8::from(sign < 0.0)
            })
            .collect();
        let (neighbours, facets) = neighbours(mesh);
        let count = mesh.vertices.len();
        let tetrahedra_at = Lists::new(count, mesh.tetrahedra.iter().copied());
        let facets_at = Lists::new(count, facets.iter().map(|&facet| facet_vertices(mesh, facet)));
        Self { mesh, positions, unit, neighbours, orientations, facets, tetrahedra_at, facets_at }
    }

    pub(super) fn tetrahedra_at(&self, vertex: u32) -> &[u32] {
        self.tetrahedra_at.of(vertex)
    }

    /// Facets of the boundary at a vertex.
    pub(super) fn facets_at(&self, vertex: u32) -> &[u32] {
        self.facets_at.of(vertex)
    }

    pub(super) fn facet_vertices(&self, facet: u32) -> [u32; 3] {
        facet_vertices(self.mesh, self.facets[facet as usize])
    }

    pub(super) fn corners(&self, tetrahedron: u32) -> [DVec3; 4] {
        self.mesh.tetrahedra[tetrahedron as usize].map(|v| self.positions[v as usize])
    }

    /// Which faces `point` is strictly beyond, exactly; `None` for a tetrahedron without volume.
    pub(super) fn beyond(&self, tetrahedron: u32, point: DVec3) -> Option<[bool; 4]> {
        let sign = f64::from(self.orientations[tetrahedron as usize]);
        let corners = self.corners(tetrahedron).map(|p| p.to_array());
        let point = point.to_array();
        (sign != 0.0).then(|| {
            std::array::from_fn(|k| {
                let mut with = [&corners[0], &corners[1], &corners[2], &corners[3]];
                with[k] = &point;
                sign * orientation(with[0], with[1], with[2], with[3]) < 0.0
            })
        })
    }

    /// Exact, boundary included: where tetrahedra leave no gap between them, this test leaves none either.
    pub(super) fn contains(&self, tetrahedron: u32, point: DVec3) -> bool {
        let corners = self.corners(tetrahedron);
        let [a, b, c, d] = corners;
        let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        (point.cmpge(low) & point.cmple(high)).all()
            && self.beyond(tetrahedron, point).is_some_and(|beyond| beyond == [false; 4])
    }
}

fn facet_vertices(mesh: &TetrahedralMesh, (tetrahedron, opposite): (u32, u8)) -> [u32; 3] {
    facet(mesh.tetrahedra[tetrahedron as usize], opposite as usize)
}

/// Neighbours across faces, and the faces without one. If more than two tetrahedra share a face, they are paired up.
fn neighbours(mesh: &TetrahedralMesh) -> (Vec<[u32; 4]>, Vec<(u32, u8)>) {
    let (mut neighbours, mut facets) = (vec![[NONE; 4]; mesh.tetrahedra.len()], Vec::new());
    for same in sorted_sides(&mesh.tetrahedra).chunk_by(|a, b| a.corners == b.corners) {
        if let [alone] = same {
            facets.push((alone.tetrahedron, alone.opposite));
        }
        for pair in same.chunks_exact(2) {
            neighbours[pair[0].tetrahedron as usize][pair[0].opposite as usize] = pair[1].tetrahedron;
            neighbours[pair[1].tetrahedron as usize][pair[1].opposite as usize] = pair[0].tetrahedron;
        }
    }
    facets.sort_unstable();
    (neighbours, facets)
}
