//! Where a point is in a volume: near a hint, or anywhere.

use std::cell::Cell;
use std::cmp::Ordering;

use glam::DVec3;

use super::volume::{NONE, Volume};
use crate::search::TriangleHierarchy;
use crate::search::box_tree::{Bounds, BoxTree};
use crate::search::triangle_queries::closest_on_triangle;
use crate::{MeshError, TriangleMesh};

/// Steps of a walk through tetrahedra before it may be cycling, which can happen in meshes that are not Delaunay.
const MOST_STEPS: u32 = 512;

/// What a search finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// In this tetrahedron.
    Inside(u32),
    /// In none; this facet of the boundary is nearest.
    Outside(u32),
}

enum Walked {
    Inside(u32),
    Left(u32),
    Lost,
}

/// Searches around `starts`, vertices of the volume, without ever leaving it; `None` if none of them is on it.
pub(super) fn search_near(volume: &Volume, starts: [u32; 3], point: DVec3) -> Option<Found> {
    if let Some(inside) = containing_around(volume, starts, point) {
        return Some(Found::Inside(inside));
    }
    let first = starts.into_iter().flat_map(|v| volume.tetrahedra_at(v)).next().copied()?;
    let nearest = nearest_facet(volume, starts, point);
    if let Some((_, facet)) = nearest {
        let around = volume.facet_vertices(facet);
        if let Some(inside) = containing_around(volume, around, point) {
            return Some(Found::Inside(inside));
        }
    }
    let start = nearest.map_or(first, |(_, facet)| volume.facets[facet as usize].0);
    let facet = match walk(volume, start, point) {
        Walked::Inside(inside) => return Some(Found::Inside(inside)),
        // Arrived elsewhere on the boundary, where stepping over facets from the starts need not lead.
        Walked::Left(last) if last != start => {
            let there = nearest_facet(volume, volume.mesh.tetrahedra[last as usize], point);
            nearest.into_iter().chain(there).min_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal))
        }
        Walked::Left(_) | Walked::Lost => nearest,
    };
    facet.map(|(_, facet)| Found::Outside(facet))
}

fn containing_around(volume: &Volume, vertices: [u32; 3], point: DVec3) -> Option<u32> {
    let around = vertices.into_iter().flat_map(|v| volume.tetrahedra_at(v)).copied();
    around.into_iter().find(|&t| volume.contains(t, point))
}

/// Squared distance and index of the boundary facet that cannot be improved by stepping to one that shares a vertex,
/// starting from facets at `starts`.
fn nearest_facet<const K: usize>(volume: &Volume, starts: [u32; K], point: DVec3) -> Option<(f64, u32)> {
    let mut best = (f64::INFINITY, NONE);
    let look = |vertex: u32, best: &mut (f64, u32)| {
        for &facet in volume.facets_at(vertex) {
            let corners = volume.facet_vertices(facet).map(|v| volume.positions[v as usize]);
            let candidate = (closest_on_triangle(point, &corners).distance_squared(point), facet);
            if candidate < *best {
                *best = candidate;
            }
        }
    };
    starts.into_iter().for_each(|vertex| look(vertex, &mut best));
    // Every step comes closer, so this terminates.
    while best.1 != NONE {
        let before = best.1;
        volume.facet_vertices(before).into_iter().for_each(|vertex| look(vertex, &mut best));
        if best.1 == before {
            return Some(best);
        }
    }
    None
}

/// Steps across faces that the point lies beyond, as long as there is something beyond.
fn walk(volume: &Volume, start: u32, point: DVec3) -> Walked {
    let (mut at, mut from) = (start, NONE);
    for step in 0..MOST_STEPS {
        let Some(beyond) = volume.beyond(at, point) else { return Walked::Lost };
        if beyond == [false; 4] {
            return Walked::Inside(at);
        }
        // Starts with a different face at every step, and never goes back: walks that always turn the same way cycle.
        let turned = (0..4).map(|k| ((k + step) % 4) as usize);
        let next = turned.filter(|&k| beyond[k]).map(|k| volume.neighbours[at as usize][k]);
        let Some(next) = next.clone().find(|&t| t != NONE && t != from).or(next.into_iter().find(|&t| t != NONE))
        else {
            return Walked::Left(at);
        };
        (at, from) = (next, at);
    }
    Walked::Lost
}

/// Finds points anywhere.
#[derive(Debug)]
pub(super) struct Everywhere {
    tetrahedra: BoxTree,
    boundary: Option<TriangleHierarchy>,
}

impl Everywhere {
    pub(super) fn new(volume: &Volume) -> Result<Self, MeshError> {
        let count = volume.mesh.tetrahedra.len();
        let bounds_of = |t: u32| Bounds::around(&volume.corners(t));
        let tetrahedra = BoxTree::new((0..count as u32).collect(), count, bounds_of);
        let triangles: Vec<[u32; 3]> = (0..volume.facets.len() as u32).map(|f| volume.facet_vertices(f)).collect();
        // Tetrahedra upon tetrahedra, each face in pairs, have no boundary.
        let boundary = if triangles.is_empty() {
            None
        } else {
            let vertices = volume.positions.iter().map(DVec3::to_array).collect();
            Some(TriangleHierarchy::new(&TriangleMesh { vertices, triangles })?)
        };
        Ok(Self { tetrahedra, boundary })
    }

    /// Among several tetrahedra the one with the smallest index; `None` only without any boundary.
    pub(super) fn search(&self, volume: &Volume, point: DVec3) -> Option<Found> {
        let (here, inside) = (Bounds { low: point, high: point }, Cell::new(NONE));
        self.tetrahedra.visit(
            |bounds| bounds.overlaps(&here),
            |t| {
                if t < inside.get() && volume.contains(t, point) {
                    inside.set(t);
                }
            },
        );
        if inside.get() != NONE {
            return Some(Found::Inside(inside.get()));
        }
        let closest = self.boundary.as_ref()?.closest_point(point.to_array())?;
        Some(Found::Outside(closest.triangle))
    }
}
