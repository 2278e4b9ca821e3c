//! Points in a tetrahedral mesh: which tetrahedron each is in, and where in it.
//!
//! ```
//! use armature_geometry::TetrahedralMesh;
//! use armature_geometry::embed::embed_points;
//!
//! let vertices = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
//! let mesh = TetrahedralMesh { vertices, tetrahedra: vec![[0, 1, 2, 3]] };
//! let embedding = embed_points(&mesh, &[[0.25, 0.25, 0.25], [0.0, 0.0, 2.0]], None)?;
//! assert_eq!(embedding.barycentric, [[0.25; 4], [0.0, 0.0, 0.0, 1.0]]);
//! assert_eq!(embedding.distance, [0.0, 1.0], "the second point lies outside");
//! # Ok::<(), armature_geometry::embed::EmbedError>(())
//! ```

mod search;
mod volume;

use glam::DVec3;
use rayon::prelude::*;

use crate::facets::FACETS;
use crate::search::triangle_queries::{barycentric, closest_on_triangle};
use crate::simplify::Simplified;
use crate::{MeshError, TetrahedralMesh};
use search::{Everywhere, Found, search_near};
use volume::Volume;

/// Points further away than this many times the mesh's largest coordinate are refused.
const FARTHEST: f64 = 1e60;
/// Coordinates whose place is off by more than this, relative to the tetrahedron's edges, were not solved well.
const WELL_SOLVED: f64 = 1e-14;

/// The places of points that move with a volume.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Embedding {
    /// For each point, a zero-based tetrahedron.
    pub tetrahedra: Vec<u32>,
    /// For each point, its coordinates with respect to the tetrahedron's corners: none negative, sum 1. For points
    /// outside the volume they are those of the nearest place on its boundary.
    pub barycentric: Vec<[f64; 4]>,
    /// For each point, 0 inside and on the boundary, otherwise the distance from the place that its coordinates give,
    /// in the mesh's unit.
    pub distance: Vec<f64>,
    /// How many of the points were searched for everywhere, because there was no hint for them or the hint had no
    /// vertex of a tetrahedron: they may be on the wrong side of a gap.
    pub searched_everywhere: usize,
}

/// Vertices of the volume around the place where a point belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfacePlaceHint {
    /// Corners of a facet, as zero-based vertices of the tetrahedral mesh; [`Self::UNKNOWN`] for any that is not known.
    pub vertices: [u32; 3],
}

impl SurfacePlaceHint {
    /// Marks a vertex that is not known.
    pub const UNKNOWN: u32 = u32::MAX;
    /// An empty hint.
    pub const NONE: Self = Self { vertices: [Self::UNKNOWN; 3] };
}

impl Simplified {
    /// For each vertex of the simplified mesh, the vertices of a volume around its place on the coarse surface.
    /// `volume_vertex` returns the vertex of the volume for each coarse vertex, if any.
    pub fn hints(&self, volume_vertex: impl Fn(u32) -> Option<u32>) -> Vec<SurfacePlaceHint> {
        let vertex = |v: u32| volume_vertex(v).unwrap_or(SurfacePlaceHint::UNKNOWN);
        let of_place = |triangle: u32| self.mesh.triangles.get(triangle as usize).map(|t| t.map(vertex));
        self.place
            .iter()
            .map(|place| {
                of_place(place.triangle).map_or(SurfacePlaceHint::NONE, |vertices| SurfacePlaceHint { vertices })
            })
            .collect()
    }
}

/// Why points cannot be embedded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EmbedError {
    /// The volume cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Two tetrahedra at every face, or none with a volume.
    #[error("the tetrahedra have no boundary and point {point} is in none of them; remove repeated tetrahedra")]
    NoBoundary {
        /// Zero-based point.
        point: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {point} has a coordinate that is not a finite number")]
    NotFinite {
        /// Zero-based point.
        point: usize,
    },
    /// A point is much too far away.
    #[error("point {point} is more than 1e60 times as far away as the volume is large; check its unit")]
    TooFar {
        /// Zero-based point.
        point: usize,
    },
    /// The number of hints is not the number of points.
    #[error("there are {points} points, but {hints} hints; give one hint per point, or none")]
    HintCount {
        /// How many points there are.
        points: usize,
        /// How many hints there are.
        hints: usize,
    },
    /// A hint refers to a vertex that does not exist.
    #[error("the hint for point {point} refers to vertex {vertex}, but there are only {vertex_count} vertices")]
    HintOutOfRange {
        /// Zero-based point.
        point: usize,
        /// The offending zero-based vertex.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
}

/// Finds n×3 `points` (mesh unit) in a tetrahedral mesh: the tetrahedron they are in, by exact signs, or the nearest
/// place on the boundary.
///
/// With hints, a point is searched for from its hint's vertices, through connected tetrahedra and facets, so that it
/// ends up on its own side of a gap even where it is closer to the other side or inside it. Any tetrahedra will do: in
/// several pieces, of either orientation, even some without volume. The result does not depend on the number of
/// threads.
pub fn embed_points(
    mesh: &TetrahedralMesh,
    points: &[[f64; 3]],
    hints: Option<&[SurfacePlaceHint]>,
) -> Result<Embedding, EmbedError> {
    mesh.validate()?;
    let volume = Volume::new(mesh);
    check(&volume, points, hints)?;
    let hint_of = |point: usize| hints.map_or(SurfacePlaceHint::NONE, |hints| hints[point]);
    let scaled = |point: usize| DVec3::from(points[point]) / volume.unit;
    let near: Vec<Option<Found>> = (0..points.len())
        .into_par_iter()
        .map(|point| search_near(&volume, hint_of(point).vertices, scaled(point)))
        .collect();
    let searched_everywhere = near.iter().filter(|found| found.is_none()).count();
    let everywhere = if searched_everywhere > 0 { Some(Everywhere::new(&volume)?) } else { None };
    let placed: Vec<Option<Placed>> = near
        .into_par_iter()
        .enumerate()
        .map(|(point, found)| {
            let found = found.or_else(|| everywhere.as_ref()?.search(&volume, scaled(point)))?;
            Some(placed(&volume, found, scaled(point)))
        })
        .collect();
    let mut embedding = Embedding { searched_everywhere, ..Embedding::default() };
    for (point, placed) in placed.into_iter().enumerate() {
        let placed = placed.ok_or(EmbedError::NoBoundary { point })?;
        embedding.tetrahedra.push(placed.tetrahedron);
        embedding.barycentric.push(placed.barycentric);
        embedding.distance.push(placed.distance * volume.unit);
    }
    Ok(embedding)
}

fn check(volume: &Volume, points: &[[f64; 3]], hints: Option<&[SurfacePlaceHint]>) -> Result<(), EmbedError> {
    if let Some(point) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(EmbedError::NotFinite { point });
    }
    if let Some(point) = points.iter().position(|p| p.iter().any(|c| c.abs() / volume.unit > FARTHEST)) {
        return Err(EmbedError::TooFar { point });
    }
    let Some(hints) = hints else { return Ok(()) };
    if hints.len() != points.len() {
        return Err(EmbedError::HintCount { points: points.len(), hints: hints.len() });
    }
    let vertex_count = volume.positions.len();
    let is_bad = |v: u32| v != SurfacePlaceHint::UNKNOWN && v as usize >= vertex_count;
    for (point, hint) in hints.iter().enumerate() {
        if let Some(vertex) = hint.vertices.into_iter().find(|&v| is_bad(v)) {
            return Err(EmbedError::HintOutOfRange { point, vertex, vertex_count });
        }
    }
    Ok(())
}

struct Placed {
    tetrahedron: u32,
    barycentric: [f64; 4],
    distance: f64,
}

fn placed(volume: &Volume, found: Found, point: DVec3) -> Placed {
    match found {
        Found::Inside(tetrahedron) => {
            Placed { tetrahedron, barycentric: inside(&volume.corners(tetrahedron), point), distance: 0.0 }
        }
        Found::Outside(facet) => {
            let (tetrahedron, opposite) = volume.facets[facet as usize];
            let all = volume.corners(tetrahedron);
            let barycentric = on_facet(&all, opposite as usize, point);
            Placed { tetrahedron, barycentric, distance: residual(&all, barycentric, point).length() }
        }
    }
}

/// Coordinates of the place closest to a point on the facet opposite a corner.
fn on_facet(all: &[DVec3; 4], opposite: usize, point: DVec3) -> [f64; 4] {
    let corners = FACETS[opposite].map(|k| all[k]);
    let in_facet = barycentric(closest_on_triangle(point, &corners), &corners);
    let mut at = [0.0; 4];
    for (k, coordinate) in FACETS[opposite].into_iter().zip(in_facet) {
        at[k] = coordinate;
    }
    at
}

/// Coordinates of a point in a tetrahedron. For one that is flat up to rounding they cannot be computed, but a facet is
/// then within rounding of the point.
fn inside(corners: &[DVec3; 4], point: DVec3) -> [f64; 4] {
    let solved = solved_inside(corners, point);
    let off = |at: &[f64; 4]| residual(corners, *at, point).length_squared();
    let longest = corners.iter().fold(0.0, |most: f64, corner| most.max(corner.distance_squared(corners[0])));
    if off(&solved) <= WELL_SOLVED * WELL_SOLVED * longest {
        return solved;
    }
    let facets = (0..4).map(|opposite| on_facet(corners, opposite, point));
    facets.chain([solved]).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(solved)
}

fn solved_inside(corners: &[DVec3; 4], point: DVec3) -> [f64; 4] {
    let [a, b, c, d] = corners;
    let edges = [*b - *a, *c - *a, *d - *a];
    let normals = [edges[1].cross(edges[2]), edges[2].cross(edges[0]), edges[0].cross(edges[1])];
    let determinant = edges[0].dot(normals[0]);
    let mut at = [1.0, 0.0, 0.0, 0.0];
    // The second round removes most of the rounding of the first, which slivers amplify; none is negative in between
    // and afterwards, since the point is known to be inside.
    for _ in 0..3 {
        let off = residual(corners, at, point);
        for k in 0..3 {
            let step = normals[k].dot(off) / determinant;
            at[k + 1] += if step.is_finite() { step } else { 0.0 };
        }
        at[0] = 1.0 - at[1] - at[2] - at[3];
        at = at.map(|coordinate| coordinate.max(0.0));
        let sum: f64 = at.iter().sum();
        at = at.map(|coordinate| coordinate / sum);
    }
    at
}

/// From the place that coordinates name to `point`.
fn residual(corners: &[DVec3; 4], at: [f64; 4], point: DVec3) -> DVec3 {
    corners.iter().zip(at).map(|(corner, coordinate)| coordinate * (point - *corner)).sum()
}
