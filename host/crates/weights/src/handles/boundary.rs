//! Which weights are given where: handles of all kinds, freely mixed, as fixed vertices (thesis eqs. 4.3 and 4.4).

use armature_geometry::search::closest_on_segment;
use glam::DVec3;

/// How a handle holds the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HandleKind {
    /// A point, a region or a vertex of a cage: its vertices are its own.
    Own,
    /// A bone, as the vertices along it from end to end: bones share equally the vertices where they meet.
    Bone,
}

/// One handle and its vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Handle {
    /// How it holds them.
    pub kind: HandleKind,
    /// Zero-based vertices of the mesh.
    pub vertices: Vec<usize>,
}

/// A facet of a cage, open or closed: a segment or triangle between cage vertices, on which weights are linear.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CageFacet {
    /// Two or three handles of kind [`HandleKind::Own`] with one vertex each.
    pub corners: Vec<usize>,
    /// Zero-based vertices of the mesh that lie on the facet; may include those of its corners.
    pub vertices: Vec<usize>,
}

/// Fixed vertices and their weights, as [`crate::biharmonic::BiharmonicProblem`] takes them.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleBoundary {
    /// Fixed vertices, ascending.
    pub fixed: Vec<usize>,
    /// `fixed.len()` × m handles, column-major; each vertex's weights sum to one.
    pub fixed_weights: Vec<f64>,
    /// Number of handles m.
    pub handles: usize,
}

/// Why handles do not fit a mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HandleError {
    /// A handle without vertices would have no weights.
    #[error("handle {handle} holds no vertex of the mesh; it may lie outside, or have no samples among the vertices")]
    Empty {
        /// Zero-based handle.
        handle: usize,
    },
    /// A vertex does not exist.
    #[error("handle {handle} holds vertex {vertex}, but the mesh has only {vertices} vertices")]
    NoSuchVertex {
        /// Zero-based handle, or the first corner of a facet.
        handle: usize,
        /// The vertex.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// Only bones may share a vertex.
    #[error("handles {first} and {second} both hold vertex {vertex}; move one of them (only bones can share a vertex)")]
    TwoHandles {
        /// The vertex.
        vertex: usize,
        /// The handle that held it first.
        first: usize,
        /// The handle that also claims it.
        second: usize,
    },
    /// A facet's corners are not two or three single vertices.
    #[error("facet {facet} of the cage needs two or three different corners that are handles of one vertex each")]
    BadFacet {
        /// Zero-based facet.
        facet: usize,
    },
    /// A vertex is off its facet, or two facets give it different weights.
    #[error("vertex {vertex} does not lie on facet {facet} of the cage, or two facets give it different weights")]
    OffFacet {
        /// Zero-based facet.
        facet: usize,
        /// The vertex.
        vertex: usize,
    },
}

/// A vertex counts as on a facet if it is no farther from it than this fraction of the facet's size.
const ON_FACET: f64 = 1e-6;

/// Weights of one fixed vertex: `(handle, weight)`.
type Shares = Vec<(usize, f64)>;

/// Collects the vertices that the handles fix, and their weights. `vertices` are the mesh's n positions; planar meshes
/// have z = 0.
pub fn handle_boundary(
    vertices: &[[f64; 3]],
    handles: &[Handle],
    facets: &[CageFacet],
) -> Result<HandleBoundary, HandleError> {
    let mut owners: Vec<Vec<usize>> = vec![Vec::new(); vertices.len()];
    for (handle, Handle { kind, vertices: held }) in handles.iter().enumerate() {
        if held.is_empty() {
            return Err(HandleError::Empty { handle });
        }
        for &vertex in held {
            let owners =
                owners.get_mut(vertex).ok_or(HandleError::NoSuchVertex { handle, vertex, vertices: vertices.len() })?;
            if owners.contains(&handle) {
                continue;
            }
            let shared = |first: usize| *kind == HandleKind::Bone && handles[first].kind == HandleKind::Bone;
            if let Some(&first) = owners.iter().find(|&&first| !shared(first)) {
                return Err(HandleError::TwoHandles { vertex, first, second: handle });
            }
            owners.push(handle);
        }
    }
    let share = |owners: &Vec<usize>| owners.iter().map(|&handle| (handle, 1.0 / owners.len() as f64)).collect();
    let mut shares: Vec<Shares> = owners.iter().map(share).collect();
    for (index, facet) in facets.iter().enumerate() {
        lay_facet(vertices, handles, index, facet, &mut shares)?;
    }
    // A bone of zero length, or with all its vertices on joints, still has its shares; nothing else can vanish.
    let fixed: Vec<usize> = (0..vertices.len()).filter(|&vertex| !shares[vertex].is_empty()).collect();
    let mut fixed_weights = vec![0.0; fixed.len() * handles.len()];
    for (row, &vertex) in fixed.iter().enumerate() {
        for &(handle, weight) in &shares[vertex] {
            fixed_weights[handle * fixed.len() + row] = weight;
        }
    }
    Ok(HandleBoundary { fixed, fixed_weights, handles: handles.len() })
}

/// Gives the vertices of one facet their linear weights.
fn lay_facet(
    vertices: &[[f64; 3]],
    handles: &[Handle],
    index: usize,
    facet: &CageFacet,
    shares: &mut [Shares],
) -> Result<(), HandleError> {
    let bad = HandleError::BadFacet { facet: index };
    let corner = |&handle: &usize| match handles.get(handle) {
        Some(Handle { kind: HandleKind::Own, vertices: held }) if held.len() == 1 => Ok(held[0]),
        _ => Err(bad),
    };
    let corners: Vec<usize> = facet.corners.iter().map(corner).collect::<Result<_, _>>()?;
    let distinct = (1..corners.len()).all(|k| !corners[..k].contains(&corners[k]));
    if !(2..=3).contains(&corners.len()) || !distinct {
        return Err(bad);
    }
    let places: Vec<DVec3> = corners.iter().map(|&vertex| vertices[vertex].into()).collect();
    for &vertex in &facet.vertices {
        let handle = facet.corners[0];
        let place =
            *vertices.get(vertex).ok_or(HandleError::NoSuchVertex { handle, vertex, vertices: vertices.len() })?;
        if corners.contains(&vertex) {
            continue;
        }
        let off = HandleError::OffFacet { facet: index, vertex };
        let weights = linear_weights(&places, place.into()).ok_or(off)?;
        let linear: Shares = facet.corners.iter().copied().zip(weights).filter(|(_, weight)| *weight > 0.0).collect();
        if shares[vertex].is_empty() {
            shares[vertex] = linear;
            continue;
        }
        // Along an edge that two facets share, both must agree.
        let weight_of = |shares: &Shares, handle: usize| {
            shares.iter().find(|(other, _)| *other == handle).map_or(0.0, |(_, weight)| *weight)
        };
        let known = &shares[vertex];
        if known.iter().chain(&linear).any(|&(h, _)| (weight_of(known, h) - weight_of(&linear, h)).abs() > ON_FACET) {
            return Err(off);
        }
    }
    Ok(())
}

/// Barycentric coordinates of a point on a segment or triangle; `None` off it.
fn linear_weights(corners: &[DVec3], point: DVec3) -> Option<Vec<f64>> {
    let size = corners.iter().map(|corner| corner.distance(corners[0])).fold(0.0, f64::max);
    let weights = match *corners {
        [a, b] => {
            let along = closest_on_segment(point, a, b);
            let share = along.distance(a) / size;
            vec![1.0 - share, share]
        }
        [a, b, c] => {
            let normal = (b - a).cross(c - a);
            let squared = normal.length_squared();
            let at_b = (point - a).cross(c - a).dot(normal) / squared;
            let at_c = (b - a).cross(point - a).dot(normal) / squared;
            vec![1.0 - at_b - at_c, at_b, at_c]
        }
        _ => return None,
    };
    let met: DVec3 = corners.iter().zip(&weights).map(|(corner, weight)| *corner * *weight).sum();
    let inside = weights.iter().all(|weight| *weight >= -ON_FACET);
    if !(inside && met.distance(point) <= ON_FACET * size) {
        return None;
    }
    let total: f64 = weights.iter().map(|weight| weight.max(0.0)).sum();
    Some(weights.into_iter().map(|weight| weight.max(0.0) / total).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(vertex: usize) -> Handle {
        Handle { kind: HandleKind::Own, vertices: vec![vertex] }
    }

    fn bone(vertices: &[usize]) -> Handle {
        Handle { kind: HandleKind::Bone, vertices: vertices.to_vec() }
    }

    fn grid() -> Vec<[f64; 3]> {
        (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3), 0.0]).collect()
    }

    #[test]
    fn bones_share_their_joints_equally() {
        let boundary = handle_boundary(&grid(), &[bone(&[0, 1]), bone(&[1, 2]), bone(&[1, 4]), own(8)], &[]).unwrap();
        assert_eq!(boundary.fixed, [0, 1, 2, 4, 8]);
        let third = 1.0 / 3.0;
        assert_eq!(boundary.fixed_weights[..5], [1.0, third, 0.0, 0.0, 0.0]);
        assert_eq!(boundary.fixed_weights[15..], [0.0, 0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn cage_facets_are_linear() {
        let handles = [own(0), own(2), own(6)];
        let edge = |a: usize, b: usize, middle: usize| CageFacet { corners: vec![a, b], vertices: vec![middle] };
        let face = CageFacet { corners: vec![0, 1, 2], vertices: vec![0, 1, 3, 4] };
        let boundary = handle_boundary(&grid(), &handles, &[edge(0, 1, 1), face, edge(2, 1, 4)]).unwrap();
        assert_eq!(boundary.fixed, [0, 1, 2, 3, 4, 6]);
        assert_eq!(boundary.fixed_weights[..6], [1.0, 0.5, 0.0, 0.5, 0.0, 0.0]);
        assert_eq!(boundary.fixed_weights[6..12], [0.0, 0.5, 1.0, 0.0, 0.5, 0.0]);
    }

    #[test]
    fn nonsense_is_named() {
        let at = |handles: &[Handle], facets: &[CageFacet]| handle_boundary(&grid(), handles, facets).unwrap_err();
        let two = HandleError::TwoHandles { vertex: 1, first: 0, second: 1 };
        assert_eq!(at(&[bone(&[0, 1]), own(1)], &[]), two);
        assert_eq!(at(&[own(1), own(1)], &[]), two);
        assert_eq!(at(&[bone(&[])], &[]), HandleError::Empty { handle: 0 });
        assert_eq!(at(&[own(9)], &[]), HandleError::NoSuchVertex { handle: 0, vertex: 9, vertices: 9 });
        let facet = |corners: &[usize], vertex| CageFacet { corners: corners.to_vec(), vertices: vec![vertex] };
        assert_eq!(at(&[own(0), own(2)], &[facet(&[0, 1], 4)]), HandleError::OffFacet { facet: 0, vertex: 4 });
        assert_eq!(at(&[own(0), own(2)], &[facet(&[0], 1)]), HandleError::BadFacet { facet: 0 });
        assert_eq!(at(&[own(0), own(2)], &[facet(&[0, 7], 1)]), HandleError::BadFacet { facet: 0 });
        assert_eq!(at(&[own(0), bone(&[2, 5])], &[facet(&[0, 1], 1)]), HandleError::BadFacet { facet: 0 });
        assert_eq!(at(&[own(0), own(2), own(1)], &[facet(&[0, 1], 1)]), HandleError::OffFacet { facet: 0, vertex: 1 });
    }
}
