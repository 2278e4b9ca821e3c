//! Where weights are computed: the elements, which of their vertices each handle holds, and how the surface's own
//! vertices are attached.

use armature_geometry::embed::Embedding;
use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian, cotangent_laplacian_tetrahedra, intrinsic_delaunay_laplacian,
    lumped_mass, lumped_mass_tetrahedra,
};
use armature_geometry::surface::weld_vertices;
use armature_geometry::volume::{Resolution, Volume, VolumeInput, VolumeSettings};
use armature_geometry::{MeshError, TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use glam::DVec3;

use super::away::away;
use super::handle::{HandlePlace, HandleShape};
use super::hold_vertices::hold_vertices;
use super::settings::{DomainKind, WeightsOn};
use crate::progress::Progress;
use crate::volume::{FlatDomain, Made, MakeError, make_volume};

/// Elements to compute weights on.
#[derive(Clone, Debug)]
pub(super) struct WeightDomain {
    pub(super) kind: DomainKind,
    /// n×3, the mesh's unit.
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) laplacian: SparseMatrix,
    /// n long.
    pub(super) mass: Vec<f64>,
    /// Elements without a volume or area, or with so little that they were ignored.
    pub(super) degenerate: usize,
    /// For each handle its vertices, ascending; none if it is entirely outside.
    pub(super) held: Vec<Vec<usize>>,
    /// Handles that are completely outside.
    pub(super) outside: Vec<usize>,
    /// Handles without vertices on them, which hold the nearest ones instead, and the largest distance (mesh unit).
    pub(super) snapped: Vec<(usize, f64)>,
    carried: Carried,
}

/// How the surface's vertices are attached.
#[derive(Clone, Debug)]
enum Carried {
    /// Each is this vertex of the domain.
    Vertices(Vec<u32>),
    /// Each has its place in a tetrahedron; `first` is the first vertex at the same place.
    Embedded { tetrahedra: Vec<[u32; 4]>, places: Embedding, first: Vec<u32> },
}

/// Prepares the elements that weights are computed on. A volume also gets vertices along the edges of `cage`.
pub(super) fn weight_domain(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    handles: &[HandleShape],
    cage: &[[[f64; 3]; 2]],
    on: WeightsOn,
    progress: Progress<'_>,
) -> Result<WeightDomain, MakeError> {
    let is_away = away(surface, handles, cage)?;
    // Handles that are away have no place in the shape.
    let placed = |(handle, &away): (&HandleShape, &bool)| {
        let place = if away { HandlePlace::Segments(Vec::new()) } else { handle.place.clone() };
        HandleShape { name: handle.name.clone(), place }
    };
    let handles: &[HandleShape] = &handles.iter().zip(&is_away).map(placed).collect::<Vec<_>>();
    match (on, tetrahedra) {
        (WeightsOn::Volume { vertices }, _) => on_volume(surface, handles, cage, vertices, progress),
        (WeightsOn::OwnElements, Some(own)) => Ok(on_own_tetrahedra(own, handles)?),
        (WeightsOn::OwnElements | WeightsOn::Surface, _) => Ok(on_surface(surface, handles)?),
    }
}

fn on_volume(
    surface: &TriangleMesh,
    handles: &[HandleShape],
    cage: &[[[f64; 3]; 2]],
    vertices: usize,
    progress: Progress<'_>,
) -> Result<WeightDomain, MakeError> {
    let mut segments = Vec::new();
    let mut points = Vec::new();
    for handle in handles {
        match &handle.place {
            HandlePlace::Segments(all) => segments.extend(all.iter().copied()),
            HandlePlace::Point(point) => points.push(*point),
        }
    }
    // After those of the handles.
    segments.extend(cage);
    let input = VolumeInput { surface, segments: &segments, points: &points };
    let settings = VolumeSettings { resolution: Resolution::Embedded { vertices }, ..VolumeSettings::default() };
    match make_volume(&input, &settings, progress)? {
        Made::Solid(made) => Ok(of_solid(surface, handles, *made)?),
        Made::Flat(made) => Ok(of_flat(handles, *made)?),
    }
}

/// The vertices of each handle, from those of all segments and of all points in the order of the handles.
fn gathered(handles: &[HandleShape], segments: &[Vec<u32>], points: &[u32]) -> Vec<Vec<usize>> {
    let (mut segments, mut points) = (segments.iter(), points.iter());
    let of_handle = |handle: &HandleShape| {
        let mut held: Vec<usize> = match &handle.place {
            HandlePlace::Segments(all) => {
                segments.by_ref().take(all.len()).flatten().map(|&vertex| vertex as usize).collect()
            }
            HandlePlace::Point(_) => points.by_ref().take(1).map(|&vertex| vertex as usize).collect(),
        };
        held.sort_unstable();
        held.dedup();
        held
    };
    handles.iter().map(of_handle).collect()
}

/// A winding number above this is inside.
const INSIDE: f64 = 0.5;
/// Elements with six times their volume below this fraction of the cube of their longest edge are ignored. The
/// Hessian's entries grow with the third power of the inverse: from about 1e-4 on it is no longer positive definite in
/// f64. Volumes remove slivers on their boundary themselves; these are the ones inside and those that hold parts
/// together, of which a messy truck has hundreds: with them its weights do not converge.
pub const FLAT: f64 = 1e-3;

/// Removes flat elements; returns how many there were. Their vertices stay; most belong to others too.
pub(crate) fn without_flat(mesh: &TetrahedralMesh) -> (TetrahedralMesh, usize) {
    let is_solid = |corners: &&[u32; 4]| {
        let [a, b, c, d] = corners.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
        let longest = edges.iter().map(|edge| edge.length()).fold(0.0, f64::max);
        edges[0].dot(edges[1].cross(edges[2])).abs() > FLAT * longest.powi(3)
    };
    let tetrahedra: Vec<[u32; 4]> = mesh.tetrahedra.iter().filter(is_solid).copied().collect();
    let flat = mesh.tetrahedra.len() - tetrahedra.len();
    (TetrahedralMesh { vertices: mesh.vertices.clone(), tetrahedra }, flat)
}

fn of_solid(surface: &TriangleMesh, handles: &[HandleShape], made: Volume) -> Result<WeightDomain, MeshError> {
    let (solid, flat) = without_flat(&made.mesh);
    let laplacian = cotangent_laplacian_tetrahedra(&solid)?;
    let mass = lumped_mass_tetrahedra(&solid, Lumping::Barycentric)?;
    let held = gathered(handles, &made.segment_vertices, &made.point_vertices);
    let mut highest = vec![f64::NEG_INFINITY; made.mesh.vertices.len()];
    for (corners, &winding) in made.mesh.tetrahedra.iter().zip(&made.winding) {
        corners.iter().for_each(|&v| highest[v as usize] = highest[v as usize].max(winding));
    }
    let is_outside = |held: &Vec<usize>| held.iter().all(|&vertex| highest[vertex] < INSIDE);
    let weld = weld_vertices(&surface.vertices, 0.0);
    let first = weld.welded_of.iter().map(|&welded| weld.representative[welded as usize]).collect();
    Ok(WeightDomain {
        kind: DomainKind::Volume,
        laplacian: laplacian.matrix,
        mass,
        degenerate: flat,
        outside: (0..held.len()).filter(|&handle| is_outside(&held[handle])).collect(),
        held,
        snapped: Vec::new(),
        carried: Carried::Embedded { tetrahedra: made.mesh.tetrahedra, places: made.surface, first },
        vertices: made.mesh.vertices,
    })
}

fn of_flat(handles: &[HandleShape], made: FlatDomain) -> Result<WeightDomain, MeshError> {
    let laplacian = cotangent_laplacian(&made.mesh)?;
    let mass = lumped_mass(&made.mesh, Lumping::Barycentric)?;
    let mut held = gathered(handles, &made.domain.segment_vertices, &made.domain.point_vertices);
    // Points outside have vertices in no triangle; bones outside have none.
    held.iter_mut().for_each(|held| held.retain(|&vertex| mass[vertex] > 0.0));
    Ok(WeightDomain {
        kind: DomainKind::Flat,
        laplacian: laplacian.matrix,
        mass,
        degenerate: laplacian.degenerate_elements,
        outside: holding_nothing(&held),
        held,
        snapped: Vec::new(),
        carried: Carried::Vertices(made.domain.input_vertices),
        vertices: made.mesh.vertices,
    })
}

fn holding_nothing(held: &[Vec<usize>]) -> Vec<usize> {
    (0..held.len()).filter(|&handle| held[handle].is_empty()).collect()
}

fn on_own_tetrahedra(own: &TetrahedralMesh, handles: &[HandleShape]) -> Result<WeightDomain, MeshError> {
    let laplacian = cotangent_laplacian_tetrahedra(own)?;
    let mass = lumped_mass_tetrahedra(own, Lumping::Barycentric)?;
    let usable: Vec<usize> = (0..mass.len()).filter(|&vertex| mass[vertex] > 0.0).collect();
    let (held, snapped) = hold_vertices(&own.vertices, &usable, handles);
    Ok(WeightDomain {
        kind: DomainKind::OwnTetrahedra,
        laplacian: laplacian.matrix,
        mass,
        degenerate: laplacian.degenerate_elements,
        outside: holding_nothing(&held),
        held,
        snapped,
        carried: Carried::Vertices((0..own.vertices.len() as u32).collect()),
        vertices: own.vertices.clone(),
    })
}

fn on_surface(surface: &TriangleMesh, handles: &[HandleShape]) -> Result<WeightDomain, MeshError> {
    surface.validate()?;
    let weld = weld_vertices(&surface.vertices, 0.0);
    let vertices: Vec<[f64; 3]> = weld.representative.iter().map(|&v| surface.vertices[v as usize]).collect();
    let triangles = surface.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize]));
    let welded =
        TriangleMesh { triangles: triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect(), vertices };
    // A surface's triangles have any shape; those of its intrinsic Delaunay triangulation have the best possible.
    let intrinsic = intrinsic_delaunay_laplacian(&welded, Lumping::Barycentric)?;
    let mass = intrinsic.mass;
    let usable: Vec<usize> = (0..mass.len()).filter(|&vertex| mass[vertex] > 0.0).collect();
    let (held, snapped) = hold_vertices(&welded.vertices, &usable, handles);
    Ok(WeightDomain {
        kind: DomainKind::Surface,
        laplacian: intrinsic.matrix,
        mass,
        degenerate: intrinsic.omitted_triangles + intrinsic.degenerate_triangles,
        outside: holding_nothing(&held),
        held,
        snapped,
        carried: Carried::Vertices(weld.welded_of),
        vertices: welded.vertices,
    })
}

impl WeightDomain {
    /// The weights of the surface's vertices from those of the domain's: copied at shared vertices, interpolated
    /// linearly elsewhere.
    pub(super) fn carry(&self, weights: &WeightMatrix) -> Option<WeightMatrix> {
        let of_handle = |handle: usize| -> Vec<f64> {
            let column = weights.bone(handle);
            match &self.carried {
                Carried::Vertices(vertices) => vertices.iter().map(|&vertex| column[vertex as usize]).collect(),
                Carried::Embedded { tetrahedra, places, first } => {
                    let at = |vertex: &u32| {
                        let place = *vertex as usize;
                        let corners = tetrahedra[places.tetrahedra[place] as usize];
                        corners
                            .iter()
                            .zip(places.barycentric[place])
                            .map(|(&v, share)| share * column[v as usize])
                            .sum()
                    };
                    first.iter().map(at).collect()
                }
            }
        };
        let columns = (0..weights.bones()).map(|handle| of_handle(handle).into_iter().enumerate());
        WeightMatrix::from_sparse_columns(self.surface_vertices(), columns)
    }

    /// How many vertices the surface has.
    pub(super) fn surface_vertices(&self) -> usize {
        match &self.carried {
            Carried::Vertices(vertices) => vertices.len(),
            Carried::Embedded { first, .. } => first.len(),
        }
    }
}
