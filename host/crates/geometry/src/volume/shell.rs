//! The surface that a volume is made for: the given one, or a simpler one that stands for it.

use std::ops::ControlFlow;

use glam::DVec3;

use super::{Resolution, VolumeError};
use crate::{
    MeshError, SimplifyError, SimplifyOutcome, SurfacePlace, TriangleMesh, sample_surface, simplify,
    subdivide_long_edges, triangle_areas,
};

/// Share of an embedded volume's vertices that lie on its shell; with the default grading the inside then makes up
/// the rest, as seen on the armadillo and the elephant.
const ON_SHELL: f64 = 0.72;
/// Edges longer than this many times those of an even shell are cut.
const LONG: f64 = 1.8;
/// A shell of fewer vertices has no shape.
const FEWEST: usize = 64;

/// A surface, or only points of one.
#[derive(Debug)]
pub(super) struct Shell {
    /// Without triangles, its vertices are samples of a surface that does not hang together.
    pub(super) mesh: TriangleMesh,
    /// For each vertex how far its neighbours are, about; infinite for one that is not used.
    pub(super) spacing: Vec<f64>,
    pub(super) places: Places,
    /// What could not be had.
    pub(super) shortfall: Option<ShellShortfall>,
}

/// Where the vertices of the given surface are on a shell.
#[derive(Debug)]
pub(super) enum Places {
    /// They are its vertices.
    AreVertices,
    /// On its triangles.
    OnShell(Vec<SurfacePlace>),
    /// There are no triangles.
    Unknown,
}

/// Why the shell of an embedded volume is not as coarse, or not such a shell, as was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShellShortfall {
    /// The surface could not be made simpler than this without gluing or tearing it.
    Vertices(usize),
    /// The triangles hang together with no other; points spread over them took the place of a surface.
    Samples,
}

impl Shell {
    /// The shell for a surface whose triangles are oriented well.
    pub(super) fn new(
        surface: &TriangleMesh,
        resolution: Resolution,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, VolumeError> {
        let Resolution::Embedded { vertices } = resolution else {
            let spacing = mean_edge_lengths(surface);
            return Ok(Self { mesh: surface.clone(), spacing, places: Places::AreVertices, shortfall: None });
        };
        let wanted = ((ON_SHELL * vertices as f64) as usize).max(FEWEST);
        let simplified = simplify(surface, wanted, progress).map_err(|error| match error {
            SimplifyError::Mesh(error) => VolumeError::Mesh(error),
            SimplifyError::Cancelled => VolumeError::Cancelled,
            SimplifyError::NoArea | SimplifyError::TooFew { .. } => VolumeError::NoArea,
        })?;
        let even = even_edge(surface, wanted)?;
        let shortfall = match simplified.outcome {
            SimplifyOutcome::Reached => None,
            SimplifyOutcome::NoConnectivity { .. } => {
                let samples = sample_surface(surface, wanted)?;
                let spacing = vec![even; samples.len()];
                let mesh = TriangleMesh { vertices: samples, triangles: Vec::new() };
                return Ok(Self { mesh, spacing, places: Places::Unknown, shortfall: Some(ShellShortfall::Samples) });
            }
            SimplifyOutcome::Blocked { vertices, .. } | SimplifyOutcome::WorkLimit { vertices } => {
                Some(ShellShortfall::Vertices(vertices))
            }
        };
        let finer = subdivide_long_edges(&simplified.mesh, LONG * even, wanted);
        let places = if finer.mesh.vertices.len() == simplified.mesh.vertices.len() {
            simplified.place
        } else {
            moved_to_parts(&simplified.mesh, &simplified.place, &finer.mesh, &finer.triangle_of)
        };
        let spacing = mean_edge_lengths(&finer.mesh);
        Ok(Self { mesh: finer.mesh, spacing, places: Places::OnShell(places), shortfall })
    }
}

/// The mean length of the edges at each vertex; infinite where there are none.
fn mean_edge_lengths(mesh: &TriangleMesh) -> Vec<f64> {
    let mut sum = vec![0.0; mesh.vertices.len()];
    let mut count = vec![0.0; mesh.vertices.len()];
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
            let length = DVec3::from(mesh.vertices[a]).distance(DVec3::from(mesh.vertices[b]));
            for v in [a, b] {
                sum[v] += length;
                count[v] += 1.0;
            }
        }
    }
    sum.iter().zip(&count).map(|(s, c)| if *c > 0.0 && *s > 0.0 { s / c } else { f64::INFINITY }).collect()
}

/// The length of the edges of a surface of as large an area with so many vertices, all its triangles equilateral.
fn even_edge(mesh: &TriangleMesh, vertices: usize) -> Result<f64, MeshError> {
    let area: f64 = triangle_areas(mesh)?.iter().sum();
    Ok((area / vertices as f64 * 2.0 / 3.0_f64.sqrt()).sqrt())
}

/// Places on a surface as places on a finer one of the same shape.
fn moved_to_parts(
    coarse: &TriangleMesh,
    places: &[SurfacePlace],
    fine: &TriangleMesh,
    triangle_of: &[u32],
) -> Vec<SurfacePlace> {
    let mut first_part = vec![0_u32; coarse.triangles.len() + 1];
    for &whole in triangle_of {
        first_part[whole as usize + 1] += 1;
    }
    for t in 0..coarse.triangles.len() {
        first_part[t + 1] += first_part[t];
    }
    let corner = |mesh: &TriangleMesh, triangle: u32, k: usize| {
        DVec3::from(mesh.vertices[mesh.triangles[triangle as usize][k] as usize])
    };
    let moved = |place: &SurfacePlace| {
        let point: DVec3 = (0..3).map(|k| place.barycentric[k] * corner(coarse, place.triangle, k)).sum();
        let parts = first_part[place.triangle as usize]..first_part[place.triangle as usize + 1];
        // The part that the point lies deepest in, up to rounding.
        let best = parts.map(|triangle| {
            let [a, b, c] = [0, 1, 2].map(|k| corner(fine, triangle, k));
            let normal = (b - a).cross(c - a);
            let doubled = [(b, c), (c, a), (a, b)].map(|(p, q)| (p - point).cross(q - point).dot(normal));
            let total = normal.length_squared();
            (SurfacePlace { triangle, barycentric: doubled.map(|d| d / total) }, total)
        });
        let depth = |p: &SurfacePlace| p.barycentric.iter().fold(f64::INFINITY, |least, &b| least.min(b));
        let deepest = best.filter(|&(_, total)| total > 0.0).max_by(|a, b| depth(&a.0).total_cmp(&depth(&b.0)));
        deepest.map_or(SurfacePlace { triangle: first_part[place.triangle as usize], ..*place }, |(place, _)| {
            let clamped = place.barycentric.map(|b| b.max(0.0));
            let sum: f64 = clamped.iter().sum();
            SurfacePlace { barycentric: clamped.map(|b| b / sum), ..place }
        })
    };
    // Parts follow one another in the order of the triangles they are parts of.
    places.iter().map(moved).collect()
}
