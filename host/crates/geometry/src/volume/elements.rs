//! The finite tetrahedra of a triangulation as plain arrays.

use crate::delaunay::{INFINITE, NO_TETRAHEDRON, Triangulation};
use crate::vectors::{places, six_volumes};

/// Tetrahedra with what the segmentation needs to know about them.
#[derive(Debug, Default)]
pub(super) struct Elements {
    /// n×3 positions in the mesh's unit, in the triangulation's numbering.
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) tetrahedra: Vec<[u32; 4]>,
    /// Across the facet opposite each corner; `u32::MAX` beyond the hull.
    pub(super) neighbours: Vec<[u32; 4]>,
    /// Areas of those facets.
    pub(super) areas: Vec<[f64; 4]>,
    /// Whether those facets are of the shell.
    pub(super) locked: Vec<[bool; 4]>,
    pub(super) volumes: Vec<f64>,
    /// For each tetrahedron of the triangulation, its index here.
    pub(super) index_of: Vec<u32>,
}

impl Elements {
    /// `shift` is the power of two by which the triangulation's coordinates are larger.
    pub(super) fn new(triangulation: &Triangulation, shift: i32) -> Self {
        let mut elements = Self {
            vertices: triangulation.points().iter().map(|p| p.map(|c| libm::scalbn(c, -shift))).collect(),
            index_of: vec![NO_TETRAHEDRON; triangulation.slots() as usize],
            ..Self::default()
        };
        for tet in 0..triangulation.slots() {
            if triangulation.is_alive(tet) && triangulation.infinite_slot(tet).is_none() {
                elements.index_of[tet as usize] = elements.tetrahedra.len() as u32;
                elements.tetrahedra.push(triangulation.corners(tet));
                elements.neighbours.push(triangulation.neighbours(tet));
                elements.locked.push(std::array::from_fn(|slot| triangulation.is_locked(tet, slot)));
            }
        }
        for across in elements.neighbours.iter_mut().flatten() {
            *across = elements.index_of[*across as usize];
        }
        for t in &elements.tetrahedra {
            debug_assert!(!t.contains(&INFINITE));
            let p = places(&elements.vertices, *t);
            // They are exactly positive; after rounding, flat ones may come out slightly below zero.
            elements.volumes.push((six_volumes(p) / 6.0).max(0.0));
            let area = |k: usize| {
                let [a, b, c] = [p[(k + 1) % 4], p[(k + 2) % 4], p[(k + 3) % 4]];
                0.5 * (b - a).cross(c - a).length()
            };
            elements.areas.push(std::array::from_fn(area));
        }
        elements
    }

    /// The neighbours that are not across a facet of the shell.
    pub(super) fn open_neighbours(&self) -> Vec<[u32; 4]> {
        let open = |(across, locked): (&[u32; 4], &[bool; 4])| {
            std::array::from_fn(|slot| if locked[slot] { u32::MAX } else { across[slot] })
        };
        self.neighbours.iter().zip(&self.locked).map(open).collect()
    }

    /// The elements on the two sides of each facet of the shell, `u32::MAX` beyond the hull.
    pub(super) fn locked_facets(&self) -> Vec<[u32; 2]> {
        let sides = |(element, (across, locked)): (usize, (&[u32; 4], &[bool; 4]))| {
            let element = element as u32;
            let slots = (0..4).filter(|&slot| locked[slot] && element < across[slot]);
            slots.map(|slot| [element, across[slot]]).collect::<Vec<_>>()
        };
        self.neighbours.iter().zip(&self.locked).enumerate().flat_map(sides).collect()
    }
}
