//! Where the vertices of a volume are: on the surface, along bones, at points, and graded in between.

use glam::DVec3;
use rayon::prelude::*;

use super::octree::Octree;
use crate::hierarchy::closest_on_segment;
use crate::{FastWindingNumber, TriangleHierarchy};

/// Sites inside keep this many of their cell's sizes away from the surface and the bones.
const APART: f64 = 0.6;
/// A site this sure to be inside is used.
const INSIDE: f64 = 0.5;

/// Positions along a segment, its two ends included, no further apart than the cells there are large.
pub(super) fn along(segment: [[f64; 3]; 2], octree: &Octree) -> Vec<[f64; 3]> {
    let [a, b] = segment.map(DVec3::from);
    let length = a.distance(b);
    let mut stops = vec![0.0, 1.0];
    if length > 0.0 {
        let mut open = vec![(0.0, 1.0, 0_u32)];
        while let Some((from, to, depth)) = open.pop() {
            let middle = f64::midpoint(from, to);
            if (to - from) * length > octree.size_at(a.lerp(b, middle).to_array()) && depth < 12 {
                stops.push(middle);
                open.extend([(from, middle, depth + 1), (middle, to, depth + 1)]);
            }
        }
    } else {
        stops.pop();
    }
    stops.sort_unstable_by(f64::total_cmp);
    let position = |&share: &f64| match share {
        1.0 => segment[1],
        share => a.lerp(b, share).to_array(),
    };
    stops.iter().map(position).collect()
}

/// The centres of the cells that lie inside, clear of the surface, the segments and the points.
pub(super) fn inside(
    octree: &Octree,
    surface: &TriangleHierarchy,
    winding: &FastWindingNumber,
    segments: &[[[f64; 3]; 2]],
    points: &[[f64; 3]],
) -> Vec<[f64; 3]> {
    let leaves = octree.leaves();
    leaves
        .par_iter()
        .filter(|leaf| {
            let clear = (APART * leaf.size).powi(2);
            let centre = DVec3::from(leaf.centre);
            segments.iter().all(|segment| {
                let [a, b] = segment.map(DVec3::from);
                closest_on_segment(centre, a, b).distance_squared(centre) > clear
            }) && points.iter().all(|&point| centre.distance_squared(DVec3::from(point)) > clear)
                && winding.evaluate(leaf.centre) > INSIDE
                && surface.closest_point(leaf.centre).is_none_or(|closest| closest.distance_squared > clear)
        })
        .map(|leaf| leaf.centre)
        .collect()
}
