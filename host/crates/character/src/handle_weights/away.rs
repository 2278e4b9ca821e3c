//! Handles that have nothing to do with the shape: bones of a prop, or forgotten points.

use armature_geometry::search::TriangleHierarchy;
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;

use super::handle::{HandlePlace, HandleShape};

/// A handle is away if all of it is farther from the surface than this fraction of the shape's size,
const FAR: f64 = 0.02;
/// and the winding number is nowhere above this on it; inside a surface with large openings it may be this low.
const INSIDE: f64 = 0.1;
/// Number of sample places along a segment.
const PLACES_ALONG: usize = 32;

/// For each handle, whether it is away from the shape. Ends of cage edges never are: cages go around shapes.
pub(super) fn away(
    surface: &TriangleMesh,
    handles: &[HandleShape],
    cage: &[[[f64; 3]; 2]],
) -> Result<Vec<bool>, MeshError> {
    if surface.triangles.is_empty() {
        return Ok(vec![false; handles.len()]);
    }
    surface.validate()?;
    let corners = || surface.triangles.iter().flatten().map(|&v| DVec3::from(surface.vertices[v as usize]));
    let (low, high) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let far_squared = (FAR * (high - low).length()).powi(2);
    let hierarchy = TriangleHierarchy::new(surface)?;
    let winding = FastWindingNumber::precompute(surface)?;
    let is_away = |place: DVec3| {
        let place = place.to_array();
        hierarchy.closest_point(place).is_some_and(|closest| closest.distance_squared > far_squared)
            && winding.evaluate(place).abs() < INSIDE
    };
    let of = |handle: &HandleShape| match &handle.place {
        HandlePlace::Point(point) => {
            let place = DVec3::from(*point);
            !cage.iter().flatten().any(|&end| DVec3::from(end) == place) && is_away(place)
        }
        HandlePlace::Segments(segments) => segments.iter().all(|&[a, b]| {
            let (a, b) = (DVec3::from(a), DVec3::from(b));
            (0..=PLACES_ALONG).all(|k| is_away(a.lerp(b, k as f64 / PLACES_ALONG as f64)))
        }),
    };
    Ok(handles.par_iter().map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_wholly_outside_and_far_is_away() {
        // A cube from 0 to 1 without its lid.
        let vertices = (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
        let sides = vec![[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
        let more = vec![[0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
        let cube = TriangleMesh { vertices, triangles: [sides, more].concat() };
        let shape = |place| HandleShape { name: String::new(), place };
        let bone = |a, b| shape(HandlePlace::Segments(vec![[a, b]]));
        let handles = [
            bone([0.5, 0.2, 0.5], [0.5, 0.9, 0.5]),
            bone([0.5, 0.9, 0.5], [0.5, 3.0, 0.5]),
            bone([0.5, 3.0, 0.5], [0.5, 4.0, 0.5]),
            bone([1.01, 0.2, 0.5], [1.01, 0.8, 0.5]),
            shape(HandlePlace::Point([0.5, 0.5, 0.5])),
            shape(HandlePlace::Point([3.0, 0.5, 0.5])),
            shape(HandlePlace::Point([-1.0, 0.5, 0.5])),
        ];
        let cage = [[[-1.0, 0.5, 0.5], [-1.0, 2.0, 0.5]]];
        assert_eq!(away(&cube, &handles, &cage).unwrap(), [false, false, true, false, false, true, false]);
        let nothing = TriangleMesh { vertices: Vec::new(), triangles: Vec::new() };
        assert_eq!(away(&nothing, &handles[..1], &[]).unwrap(), [false]);
    }
}
