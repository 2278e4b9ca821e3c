//! A coarser surface around the same volume, by collapsing edges in the order of their quadric error (Garland and
//! Heckbert 1997, "Surface simplification using quadric error metrics").
//!
//! It is made for volumes: triangles stay compact, small where the surface is thin or close to itself, and sheets that
//! face each other across a thin gap or wall stay apart: no collapse makes triangles meet that did not.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::simplify::{SimplifyOutcome, simplify};
//!
//! // A flat sheet of 32 triangles.
//! let vertices = (0..25).map(|k| [f64::from(k % 5), f64::from(k / 5), 0.0]).collect();
//! let corners = (0..16).map(|k| k % 4 + 5 * (k / 4));
//! let triangles = corners.flat_map(|a| [[a, a + 1, a + 6], [a, a + 6, a + 5]]).collect();
//! let sheet = TriangleMesh { vertices, triangles };
//! let coarse = simplify(&sheet, 8, &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert_eq!(coarse.outcome, SimplifyOutcome::Reached);
//! assert!(coarse.place.len() == 25 && coarse.largest_distance < 1.0);
//! # Ok::<(), armature_geometry::simplify::SimplifyError>(())
//! ```

mod collapse;
mod place;
mod quadric;
mod queue;
mod roughness;
mod sample;
mod surface;
mod thickness;

use glam::DVec3;

use crate::progress::{Progress, stage};
use crate::{MeshError, TriangleMesh};
pub use place::SurfacePlace;
pub(crate) use roughness::without_roughness;
pub(crate) use sample::sample_surface;
pub(crate) use thickness::space_around;

use place::Given;
use quadric::Quadric;
use queue::{Collapser, Ended};
use surface::{NONE, Surface};

/// Weight of a vertex's distance from the points it represents, relative to that from their planes: how strongly
/// compact triangles are preferred over following the surface's bends. Tuned on the armadillo, see the example
/// `simplify`.
const EVENNESS: f64 = 0.003;
/// How much that weight may grow where the surface is thin, so that triangles are smaller there.
const MOST_GRADING: f64 = 8.0;
/// Weight of the planes that hold open and non-manifold edges in place, relative to those of triangles.
const EDGE_WEIGHT: f64 = 4.0;
/// How far to look for facing sheets, in edge lengths of the coarse surface.
const REACH_IN_EDGES: f64 = 4.0;

/// A coarser surface, and where on it the finer one's vertices are.
#[derive(Clone, Debug, PartialEq)]
pub struct Simplified {
    /// The coarse surface, without unused vertices.
    pub mesh: TriangleMesh,
    /// For each original vertex, its place on `mesh`: close by on the sheet that it was collapsed into, not on one
    /// across a gap. A vertex in no triangle (or only in ones with equal corners) gets the nearest place.
    pub place: Vec<SurfacePlace>,
    /// Root mean square distance from the original vertices to their places, in the mesh's unit.
    pub mean_distance: f64,
    /// The largest such distance.
    pub largest_distance: f64,
    /// Whether this is what was requested.
    pub outcome: SimplifyOutcome,
}

/// How far a simplification got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimplifyOutcome {
    /// There are as many vertices as requested, or fewer if there never were more.
    Reached,
    /// No further edge may be collapsed.
    Blocked {
        /// Vertices left.
        vertices: usize,
        /// Edges kept because the surface would be torn, closed or glued.
        by_topology: usize,
        /// Edges kept because triangles would flip, degenerate or meet, or sheets would come too close to each other.
        by_geometry: usize,
    },
    /// Most triangles are connected to no other: there is no surface to simplify. Points spread over them can be used
    /// instead.
    NoConnectivity {
        /// Vertices left.
        vertices: usize,
    },
    /// So many triangles cross each other that testing them was cut short.
    WorkLimit {
        /// Vertices left.
        vertices: usize,
    },
}

/// Why a surface cannot be simplified.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimplifyError {
    /// The mesh cannot be used at all.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Every triangle has two corners at one place, or all are on a line.
    #[error("no triangle of the mesh has an area; there is no surface to simplify")]
    NoArea,
    /// No surface has this few vertices.
    #[error("a surface needs at least 4 vertices, not {asked}; ask for more")]
    TooFew {
        /// The requested number.
        asked: usize,
    },
    /// The progress callback asked to stop.
    #[error("the simplification was cancelled")]
    Cancelled,
}

/// Coarsens the surface until it has `vertices` vertices. Any mesh will do: vertices at one place are merged, triangles
/// with equal corners and repeated triangles are dropped, and open and non-manifold edges are kept as such.
///
/// Pieces stay pieces, holes stay holes, and the number of pairs of triangles that meet (see
/// [`crate::surface::self_intersections`]) does not grow. `progress` receives the fraction done; see [`Progress`]. The
/// result does not depend on the number of threads.
pub fn simplify(mesh: &TriangleMesh, vertices: usize, progress: Progress<'_>) -> Result<Simplified, SimplifyError> {
    mesh.validate()?;
    if vertices < 4 {
        return Err(SimplifyError::TooFew { asked: vertices });
    }
    let (mut surface, given) = Surface::new(mesh);
    let area = (0..surface.triangles.len() as u32).map(|t| 0.5 * surface.area_vector(t).length()).sum::<f64>();
    if area <= 0.0 {
        return Err(SimplifyError::NoArea);
    }
    let is_soup = mostly_unconnected(&surface);
    let normals = place::normals(&surface);
    let (start, before) = (surface.live_vertices, surface.live_vertices.saturating_sub(vertices).max(1) as f64);
    let (into, ended) = if start > vertices {
        // Two triangles per vertex, all equilateral.
        let edge = (area / vertices as f64 * 2.0 / 3.0_f64.sqrt()).sqrt();
        let gaps = thickness::facing_distances(&surface, REACH_IN_EDGES * edge);
        let quadrics = initial_quadrics(&surface, &gaps, edge);
        let gaps = gaps.iter().map(|[out, through]| out.min(*through)).collect();
        let mut collapser = Collapser::new(&mut surface, quadrics, gaps);
        let mut report = stage(progress, "simplifying the surface");
        let ended = collapser.run(vertices, |live| report((start - live) as f64 / before).is_continue());
        (collapser.into, ended)
    } else {
        ((0..start as u32).collect(), Ended::default())
    };
    if ended.cancelled {
        return Err(SimplifyError::Cancelled);
    }
    let outcome = outcome_of(&surface, vertices, is_soup, &ended);
    let (coarse, name) = surface.to_mesh();
    let roots = roots(into);
    let given: Vec<Given> = given
        .iter()
        .zip(&mesh.vertices)
        .map(|(&vertex, &position)| match roots.get(vertex as usize) {
            Some(&root) => Given { position, normal: normals[vertex as usize], start: name[root as usize] },
            None => Given { position, normal: DVec3::ZERO, start: NONE },
        })
        .collect();
    let placed = place::places(&coarse, &given)?;
    let largest_distance = placed.iter().fold(0.0, |most: f64, (_, distance)| most.max(*distance));
    let mean_distance = root_mean_square(placed.iter().map(|(_, distance)| *distance), largest_distance);
    let place = placed.into_iter().map(|(place, _)| place).collect();
    Ok(Simplified { mesh: coarse, place, mean_distance, largest_distance, outcome })
}

fn outcome_of(surface: &Surface, asked: usize, is_soup: bool, ended: &Ended) -> SimplifyOutcome {
    let vertices = surface.live_vertices;
    if vertices <= asked {
        SimplifyOutcome::Reached
    } else if is_soup {
        SimplifyOutcome::NoConnectivity { vertices }
    } else if ended.out_of_work {
        SimplifyOutcome::WorkLimit { vertices }
    } else {
        let (by_topology, by_geometry) = (ended.refused_by_topology, ended.refused_by_geometry);
        SimplifyOutcome::Blocked { vertices, by_topology, by_geometry }
    }
}

/// Whether more than half of the triangles share no edge with another.
fn mostly_unconnected(surface: &Surface) -> bool {
    let shared = surface_edges(surface).chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1).flatten().fold(
        vec![false; surface.triangles.len()],
        |mut shared, (_, triangle)| {
            shared[*triangle as usize] = true;
            shared
        },
    );
    2 * shared.iter().filter(|&&is| is).count() < shared.len()
}

/// Every side of every triangle as its ends, the smaller first, and the triangle; sorted.
fn surface_edges(surface: &Surface) -> Vec<([u32; 2], u32)> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * surface.triangles.len());
    for (index, &[a, b, c]) in surface.triangles.iter().enumerate() {
        sides.extend([(a, b), (b, c), (c, a)].map(|(p, q)| ([p.min(q), p.max(q)], index as u32)));
    }
    sides.sort_unstable();
    sides
}

fn initial_quadrics(surface: &Surface, gaps: &[[f64; 2]], edge: f64) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); surface.positions.len()];
    let local = |v: u32| surface.positions[v as usize] - surface.centre;
    for (index, corners) in surface.triangles.iter().enumerate() {
        let twice_area = surface.area_vector(index as u32);
        let Some(normal) = twice_area.try_normalize() else { continue };
        let share = twice_area.length() / 6.0;
        for &v in corners {
            let quadric = &mut quadrics[v as usize];
            quadric.add_plane(normal, local(corners[0]), share);
            let [out, through] = gaps[v as usize];
            let grading = (edge / out.min(through)).powi(2).clamp(1.0, MOST_GRADING);
            quadric.add_point(local(v), EVENNESS * grading * share);
        }
    }
    for same in surface_edges(surface).chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() != 2) {
        for &([p, q], triangle) in same {
            let along = local(q) - local(p);
            let across = along.cross(surface.area_vector(triangle));
            if let Some(normal) = across.try_normalize() {
                let weight = EDGE_WEIGHT * along.length_squared();
                [p, q].into_iter().for_each(|v| quadrics[v as usize].add_plane(normal, local(p), weight));
            }
        }
    }
    quadrics
}

/// Where every vertex ended after following all collapses.
fn roots(mut into: Vec<u32>) -> Vec<u32> {
    for vertex in 0..into.len() {
        let mut root = vertex as u32;
        while into[root as usize] != root {
            root = into[root as usize];
        }
        let mut next = vertex as u32;
        while into[next as usize] != root {
            next = std::mem::replace(&mut into[next as usize], root);
        }
    }
    into
}

/// Without overflow, where `largest` is the largest of them.
fn root_mean_square(distances: impl ExactSizeIterator<Item = f64>, largest: f64) -> f64 {
    let count = distances.len().max(1) as f64;
    if largest > 0.0 { largest * (distances.map(|d| (d / largest).powi(2)).sum::<f64>() / count).sqrt() } else { 0.0 }
}
