//! Where the vertices of a volume are: on the surface, along bones, at points, and graded in between.

use glam::DVec3;
use rayon::prelude::*;

use super::octree::Octree;
use crate::hierarchy::closest_on_segment;
use crate::{FastWindingNumber, TriangleHierarchy};

/// Sites inside keep this many of their cell's sizes away from the surface and the bones.
const APART: f64 = 0.6;
/// Steps along one bone for which sizes are given.
const MOST_STEPS: f64 = 4096.0;
/// A site this sure to be inside is used.
const INSIDE: f64 = 0.5;

/// Cells along bones are this many times as large as the shell's spacing is in the middle. Graded from the surface
/// alone, they would stay as large as a fixed share of its distance however fine the shell is, and weights, which
/// change most around bones, would not converge. Half of it makes twice as many vertices inside.
const ALONG_BONES: f64 = 1.0;

/// Places along the segments, and how large cells may be there.
pub(super) fn bone_sizes(segments: &[[[f64; 3]; 2]], mut spacing: Vec<f64>) -> Vec<([f64; 3], f64)> {
    let middle = spacing.len() / 2;
    if spacing.is_empty() {
        return Vec::new();
    }
    let size = ALONG_BONES * *spacing.select_nth_unstable_by(middle, f64::total_cmp).1;
    let places = |segment: &[[f64; 3]; 2]| {
        let [a, b] = segment.map(DVec3::from);
        // Two places in each cell, so that none is passed over; bones longer than that are not of this shape.
        let steps = (2.0 * a.distance(b) / size).ceil().clamp(1.0, MOST_STEPS) as u32;
        (0..=steps).map(move |k| (a.lerp(b, f64::from(k) / f64::from(steps)).to_array(), size))
    };
    segments.iter().flat_map(places).collect()
}

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
