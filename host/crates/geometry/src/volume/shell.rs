//! The surface that a volume is made for: the given one, or a simplified one used instead.

use std::collections::HashSet;
use std::ops::ControlFlow;

use glam::DVec3;

use super::error::VolumeError;
use super::input::Resolution;
use super::report::ShellShortfall;
use crate::search::triangle_queries::closest_on_segment;
use crate::simplify::{SimplifyError, SimplifyOutcome, SurfacePlace, sample_surface, simplify, without_roughness};
use crate::surface::{edges, subdivide_long_edges, triangle_areas};
use crate::{MeshError, TriangleMesh};

/// Share of an embedded volume's vertices on its shell; with the default grading the inside then makes up the rest, as
/// measured on the armadillo and the elephant.
const ON_SHELL: f64 = 0.72;
/// Edges longer than this many times those of an even shell are cut.
const LONG: f64 = 1.8;
/// A shell with fewer vertices has no shape.
const FEWEST: usize = 64;
/// Where there are so few vertices that edges would stay this many times too long, those beside narrow triangles are not
/// cut at all: a spike cut into a thousand needles is no better than one needle.
const FAR_TOO_LONG: f64 = 2.0;
/// Triangles narrower than this, relative to how long edges would stay.
const NARROW: f64 = 0.2;
/// Near bones, edges may be this many times as long as the bones are far.
const NEAR_BONES: f64 = 2.0;
/// But they need not be shorter than this, relative to those of an even shell.
pub(super) const SHORTEST: f64 = 0.15;
/// Near bones, the shell gets at most this share of vertices more.
const MORE_NEAR_BONES: f64 = 0.3;

/// A surface, or only points of one.
#[derive(Debug)]
pub(super) struct Shell {
    /// Without triangles, its vertices are samples of a disconnected surface.
    pub(super) mesh: TriangleMesh,
    /// For each vertex, the approximate distance of its neighbours; infinite for an unused one.
    pub(super) spacing: Vec<f64>,
    pub(super) places: Places,
    /// What could not be achieved.
    pub(super) shortfall: Option<ShellShortfall>,
    /// How far the surface's roughness moved a vertex at most, if it was smoothed away.
    pub(super) smoothed_by: Option<f64>,
    /// Edges that are longer than they should be, because the triangles beside them are narrow.
    pub(super) left_long: usize,
    /// The length of edges of an even shell; infinite where the shell is the surface itself.
    pub(super) even: f64,
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

impl Shell {
    /// The shell for a surface whose triangles are oriented consistently; that of an embedded volume is finer where
    /// bones are near it.
    pub(super) fn new(
        surface: &TriangleMesh,
        bones: &[[[f64; 3]; 2]],
        resolution: Resolution,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, VolumeError> {
        let Resolution::Embedded { vertices } = resolution else {
            return Ok(Self {
                spacing: mean_edge_lengths(surface),
                mesh: surface.clone(),
                places: Places::AreVertices,
                shortfall: None,
                smoothed_by: None,
                left_long: 0,
                even: f64::INFINITY,
            });
        };
        let wanted = ((ON_SHELL * vertices as f64) as usize).max(FEWEST);
        let smoothed = without_roughness(surface, wanted);
        let smoothed_by = smoothed.as_ref().map(|smoothed| smoothed.farthest);
        let surface = smoothed.as_ref().map_or(surface, |smoothed| &smoothed.mesh);
        let simplified = simplify(surface, wanted, &mut |_, done| progress(done)).map_err(|error| match error {
            SimplifyError::Mesh(error) => VolumeError::Mesh(error),
            SimplifyError::Cancelled => VolumeError::Cancelled,
            SimplifyError::NoArea | SimplifyError::TooFew { .. } => VolumeError::NoArea,
        })?;
        let even = even_edge(surface, wanted)?;
        let shortfall = match simplified.outcome {
            SimplifyOutcome::Reached => None,
            SimplifyOutcome::NoConnectivity { .. } => {
                let mesh = TriangleMesh { vertices: sample_surface(surface, wanted)?, triangles: Vec::new() };
                let (spacing, shortfall) = (vec![even; mesh.vertices.len()], Some(ShellShortfall::Samples));
                let places = Places::Unknown;
                return Ok(Self { mesh, spacing, places, shortfall, smoothed_by, left_long: 0, even });
            }
            SimplifyOutcome::Blocked { vertices, .. } | SimplifyOutcome::WorkLimit { vertices } => {
                Some(ShellShortfall::Vertices(vertices))
            }
        };
        let (fine, left_long) = cut_long_edges(simplified.mesh, simplified.place, LONG * even, wanted);
        let (mesh, places) = cut_near_bones(fine, bones, even);
        let (spacing, places) = (mean_edge_lengths(&mesh), Places::OnShell(places));
        Ok(Self { mesh, spacing, places, shortfall, smoothed_by, left_long, even })
    }
}

/// A surface and the places of others' vertices on it.
type Placed = (TriangleMesh, Vec<SurfacePlace>);

/// Cuts edges longer than `longest` until there are `wanted` vertices; also returns how many edges stay so because of
/// narrow triangles.
fn cut_long_edges(mesh: TriangleMesh, places: Vec<SurfacePlace>, longest: f64, wanted: usize) -> (Placed, usize) {
    let at = |v: u32| DVec3::from(mesh.vertices[v as usize]);
    let length = |[a, b]: [u32; 2]| at(a).distance(at(b));
    let mut lengths: Vec<f64> = edges(&mesh.triangles).iter().map(|edge| length(edge.vertices)).collect();
    let reached = reachable(&mut lengths, wanted.saturating_sub(mesh.vertices.len()));
    if reached <= FAR_TOO_LONG * longest {
        return (refined((mesh, places), |_| longest, wanted), 0);
    }
    let is_narrow = |t: &[u32; 3]| {
        let [a, b, c] = t.map(at);
        let side = a.distance(b).max(b.distance(c)).max(c.distance(a));
        (b - a).cross(c - a).length() < NARROW * reached * side
    };
    let narrow: HashSet<[[u64; 3]; 2]> = mesh
        .triangles
        .iter()
        .filter(|t| is_narrow(t))
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|edge| named(edge.map(at)))
        .collect();
    let bound = |ends: [DVec3; 2]| if narrow.contains(&named(ends)) { f64::INFINITY } else { longest };
    let left_long = narrow.iter().filter(|ends| length_of(**ends) > FAR_TOO_LONG * longest).count();
    (refined((mesh.clone(), places), bound, wanted), left_long)
}

/// How long edges stay if the longest are cut, but only `cuts` times in all.
fn reachable(lengths: &mut [f64], cuts: usize) -> f64 {
    lengths.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut sum = 0.0;
    for (index, &length) in lengths.iter().enumerate() {
        sum += length;
        // With the first ones cut to one length, of which there are so many pieces:
        let pieces = sum / (cuts + index + 1) as f64;
        if lengths.get(index + 1).is_none_or(|&next| pieces >= next) {
            return pieces;
        }
    }
    0.0
}

fn length_of(ends: [[u64; 3]; 2]) -> f64 {
    let [a, b] = ends.map(|p| DVec3::from(p.map(f64::from_bits)));
    a.distance(b)
}

/// An edge by the bits of its ends, in either direction.
fn named(ends: [DVec3; 2]) -> [[u64; 3]; 2] {
    let mut named = ends.map(|p| p.to_array().map(f64::to_bits));
    named.sort_unstable();
    named
}

/// Cuts edges that are long compared with their distance from a bone: weights change there from one end to the other.
fn cut_near_bones(placed: Placed, bones: &[[[f64; 3]; 2]], even: f64) -> Placed {
    let most = placed.0.vertices.len() as f64 * (1.0 + MORE_NEAR_BONES);
    let bones: Vec<[DVec3; 2]> = bones.iter().map(|ends| ends.map(DVec3::from)).collect();
    let bound = |[a, b]: [DVec3; 2]| {
        let middle = 0.5 * (a + b);
        let off = |&[head, tail]: &[DVec3; 2]| closest_on_segment(middle, head, tail).distance(middle);
        let distance = bones.iter().map(off).fold(f64::INFINITY, f64::min);
        (NEAR_BONES * distance).max(SHORTEST * even)
    };
    // Elsewhere edges are as long as they should be.
    let near = |ends: [DVec3; 2]| bound(ends).max(if bound(ends) > 2.0 * even { f64::INFINITY } else { 0.0 });
    if bones.is_empty() { placed } else { refined(placed, near, most as usize) }
}

fn refined((mesh, places): Placed, longest: impl Fn([DVec3; 2]) -> f64, most_vertices: usize) -> Placed {
    let finer = subdivide_long_edges(&mesh, longest, most_vertices);
    if finer.mesh.vertices.len() == mesh.vertices.len() {
        return (mesh, places);
    }
    let moved = moved_to_parts(&mesh, &places, &finer.mesh, &finer.triangle_of);
    (finer.mesh, moved)
}

/// The mean length of the edges at each vertex; infinite where there are none.
pub(super) fn mean_edge_lengths(mesh: &TriangleMesh) -> Vec<f64> {
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

/// The edge length of an equilateral mesh with the same area and this many vertices.
fn even_edge(mesh: &TriangleMesh, vertices: usize) -> Result<f64, MeshError> {
    let area: f64 = triangle_areas(mesh)?.iter().sum();
    Ok((area / vertices as f64 * 2.0 / 3.0_f64.sqrt()).sqrt())
}

/// Converts places on a surface to places on a finer one of the same shape.
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
        // The part that contains the point most deeply, up to rounding.
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
    // Parts come in the order of the triangles they belong to.
    places.iter().map(moved).collect()
}
