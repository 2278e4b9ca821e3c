//! Which vertices of given elements a handle holds: those on it, or those nearest to it.

use armature_geometry::search::closest_on_segment;
use glam::DVec3;
use rayon::prelude::*;

use super::handle::{HandlePlace, HandleShape};

/// A vertex counts as on a handle if it is no farther from it than this fraction of the mesh's size.
const ON_HANDLE: f64 = 1e-6;
/// Sample places along a bone that has no vertices of its own; the vertices nearest to these are held.
const PLACES_ALONG: usize = 64;

/// For each handle its vertices, ascending: those on it, since `usable` vertices are placed along bones that the mesh
/// was made for; if there are none, the nearest to places along it, and for such a handle how far away the farthest is.
pub(super) fn hold_vertices(
    vertices: &[[f64; 3]],
    usable: &[usize],
    handles: &[HandleShape],
) -> (Vec<Vec<usize>>, Vec<(usize, f64)>) {
    let places = || usable.iter().map(|&vertex| DVec3::from(vertices[vertex]));
    let (low, high) = places().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let tolerance = ON_HANDLE * (high - low).length();
    let hold = |handle: &HandleShape| -> (Vec<usize>, Option<f64>) {
        let segments: Vec<[DVec3; 2]> = match &handle.place {
            HandlePlace::Segments(all) => all.iter().map(|ends| ends.map(DVec3::from)).collect(),
            HandlePlace::Point(point) => vec![[DVec3::from(*point); 2]],
        };
        let distance = |p: DVec3| {
            segments.iter().map(|&[a, b]| closest_on_segment(p, a, b).distance(p)).fold(f64::INFINITY, f64::min)
        };
        let on: Vec<usize> =
            usable.iter().copied().filter(|&vertex| distance(vertices[vertex].into()) <= tolerance).collect();
        if !on.is_empty() || usable.is_empty() {
            return (on, None);
        }
        let nearest = |p: DVec3| {
            let ranked = usable.iter().map(|&vertex| (DVec3::from(vertices[vertex]).distance_squared(p), vertex));
            ranked.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let along = segments.iter().flat_map(|&[a, b]| {
            let count = if a == b { 1 } else { PLACES_ALONG };
            (0..count).map(move |k| a.lerp(b, k as f64 / (count.max(2) - 1) as f64))
        });
        let found: Vec<(f64, usize)> = along.filter_map(nearest).collect();
        let farthest = found.iter().map(|(squared, _)| squared.sqrt()).fold(0.0, f64::max);
        let mut held: Vec<usize> = found.into_iter().map(|(_, vertex)| vertex).collect();
        held.sort_unstable();
        held.dedup();
        (held, Some(farthest))
    };
    let all: Vec<(Vec<usize>, Option<f64>)> = handles.par_iter().map(hold).collect();
    let snapped = all.iter().enumerate().filter_map(|(handle, (_, far))| far.map(|far| (handle, far))).collect();
    (all.into_iter().map(|(held, _)| held).collect(), snapped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_on_a_handle_are_held_and_otherwise_the_nearest() {
        let vertices: Vec<[f64; 3]> = (0..5).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let shape = |place| HandleShape { name: String::new(), place };
        let bone = |a, b| shape(HandlePlace::Segments(vec![[a, b]]));
        let handles = [
            bone([1.0, 0.0, 0.0], [3.0, 0.0, 0.0]),
            bone([0.0, 0.5, 0.0], [1.0, 0.5, 0.0]),
            shape(HandlePlace::Point([3.9, 0.0, 0.0])),
        ];
        let (held, snapped) = hold_vertices(&vertices, &[0, 1, 2, 3, 4], &handles);
        assert_eq!(held, [vec![1, 2, 3], vec![0, 1], vec![4]]);
        assert_eq!(snapped.iter().map(|s| s.0).collect::<Vec<_>>(), [1, 2]);
        assert!((snapped[1].1 - 0.1).abs() < 1e-12);
        // Vertices that belong to nothing cannot be held.
        assert_eq!(hold_vertices(&vertices, &[2, 3, 4], &handles[1..2]).0, [vec![2]]);
        assert_eq!(hold_vertices(&vertices, &[], &handles[1..2]).0, [Vec::<usize>::new()]);
    }
}
