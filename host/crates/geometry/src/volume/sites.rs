//! Where the vertices of a volume are: on the surface, along bones, at points, and graded in between.

use glam::DVec3;
use rayon::prelude::*;

use super::field::Field;
use super::input::{Resolution, VolumeInput};
use super::octree::{DEEPEST, Octree};
use super::shell::{Places, SHORTEST, Shell};
use crate::search::TriangleHierarchy;
use crate::search::triangle_queries::closest_on_segment;
use crate::winding::FastWindingNumber;

/// Interior sites stay this many times their cell's size away from the surface and the bones.
const APART: f64 = 0.6;
/// Steps along one bone for which sizes are given.
const MOST_STEPS: f64 = 4096.0;
/// A site at least this certain to be inside is used.
const INSIDE: f64 = 0.5;

/// Cells along bones are this many times as large as the shell's median spacing. Graded from the surface alone, they
/// would stay as large as a fixed share of their distance from it however fine the shell is, and weights, which change
/// most around bones, would not converge. Half of it gives twice as many interior vertices.
const ALONG_BONES: f64 = 1.0;

/// Graded interior sites stay below this many times the vertices of the shell, or of those asked for where they are
/// more. Real surfaces need less than one times; one whose edges differ in length by orders of magnitude would need
/// thousands of times.
const MOST_INSIDE: usize = 4;

/// Points, and what each of them is.
pub(super) struct Sites {
    pub(super) positions: Vec<[f64; 3]>,
    /// The site of each shell vertex; none for those in no triangle.
    pub(super) shell: Vec<Option<u32>>,
    /// Along each bone, from head to tail.
    pub(super) segments: Vec<Vec<u32>>,
    /// Of each point handle.
    pub(super) points: Vec<u32>,
    /// Number of graded interior sites.
    pub(super) inner_points: usize,
    /// Of how many interior sites [`MOST_INSIDE`] made these; `None` if it is all of them.
    pub(super) wanted_inside: Option<usize>,
}

/// Vertices where they are needed. `resolution` and `grading` as in [`super::VolumeSettings`].
pub(super) fn place(
    shell: &Shell,
    field: &Field,
    input: &VolumeInput<'_>,
    resolution: Resolution,
    grading: f64,
) -> Sites {
    let used = || shell.mesh.vertices.iter().zip(&shell.spacing).filter(|(_, spacing)| spacing.is_finite());
    let mut sized: Vec<([f64; 3], f64)> = used().map(|(&p, &s)| (p, grading * s)).collect();
    if !matches!(shell.places, Places::AreVertices) {
        let spacing = sized.iter().map(|(_, size)| size / grading).collect();
        sized.extend(bone_sizes(input.segments, spacing, SHORTEST * shell.even, &field.surface));
    }
    let (low, high) = shell.mesh.bounds().unwrap_or_default();
    let most = MOST_INSIDE
        * match resolution {
            Resolution::Conforming => sized.len(),
            Resolution::Embedded { vertices } => vertices.max(used().count()),
        };
    let (octree, inside, wanted_inside) = graded(low, high, &sized, most, |octree| {
        inside(octree, &field.surface, &field.winding, input.segments, input.points)
    });
    let mut found = Sites {
        positions: Vec::new(),
        shell: Vec::new(),
        segments: Vec::new(),
        points: Vec::new(),
        inner_points: inside.len(),
        wanted_inside,
    };
    let mut add = |position: [f64; 3]| {
        found.positions.push(position);
        found.positions.len() as u32 - 1
    };
    found.shell = shell.mesh.vertices.iter().zip(&shell.spacing).map(|(&p, s)| s.is_finite().then(|| add(p))).collect();
    for &segment in input.segments {
        found.segments.push(along(segment, &octree).into_iter().map(&mut add).collect());
    }
    found.points = input.points.iter().map(|&p| add(p)).collect();
    found.positions.extend(inside);
    found
}

/// The octree for these sizes, and the sites inside that come of it. Where those are more than `most`, the finest cells
/// are left out, as few levels of them as suffice; then the number that was wanted comes too.
fn graded(
    low: [f64; 3],
    high: [f64; 3],
    sized: &[([f64; 3], f64)],
    most: usize,
    inside: impl Fn(&Octree) -> Vec<[f64; 3]>,
) -> (Octree, Vec<[f64; 3]>, Option<usize>) {
    let of_depth = |depth: u32| {
        let octree = Octree::new(low, high, sized, depth);
        let sites = inside(&octree);
        (octree, sites)
    };
    let (whole, sites) = of_depth(DEEPEST);
    if sites.len() <= most {
        return (whole, sites, None);
    }
    let (mut few, mut many, mut best) = (0, whole.depth(), of_depth(0));
    while many - few > 1 {
        let depth = u32::midpoint(few, many);
        let (octree, sites) = of_depth(depth);
        if sites.len() <= most {
            (few, best) = (depth, (octree, sites));
        } else {
            many = depth;
        }
    }
    (best.0, best.1, Some(sites.len()))
}

/// Places along the segments, and how large cells may be there: no larger than the surface is far, but at least
/// `smallest`. Weights change from one bone to the next across what lies between them and the surface.
fn bone_sizes(
    segments: &[[[f64; 3]; 2]],
    mut spacing: Vec<f64>,
    smallest: f64,
    surface: &TriangleHierarchy,
) -> Vec<([f64; 3], f64)> {
    let middle = spacing.len() / 2;
    if spacing.is_empty() {
        return Vec::new();
    }
    let usual = ALONG_BONES * *spacing.select_nth_unstable_by(middle, f64::total_cmp).1;
    let smallest = smallest.min(usual);
    let mut sized = Vec::new();
    for segment in segments {
        let [a, b] = segment.map(DVec3::from);
        let length = a.distance(b);
        // Two places per cell, so that none is missed; longer bones do not belong to this shape.
        let steps = (2.0 * length / usual).ceil().clamp(1.0, MOST_STEPS);
        let finer = (usual / smallest).ceil().min(MOST_STEPS);
        for step in 0..=steps as u32 {
            let place = |step: f64| a.lerp(b, (step / steps).min(1.0));
            let away = |place: DVec3| {
                surface.closest_point(place.to_array()).map_or(f64::INFINITY, |c| c.distance_squared.sqrt())
            };
            let here = place(f64::from(step));
            let distance = away(here);
            sized.push((here.to_array(), distance.clamp(smallest, usual)));
            if distance < usual + length / steps {
                let between = (1..finer as u32).map(|k| place(f64::from(step) + f64::from(k) / finer));
                sized.extend(
                    between.map(|p| (p.to_array(), away(p).clamp(smallest, usual))).filter(|(_, s)| *s < usual),
                );
            }
        }
    }
    sized
}

/// Positions along a segment, both ends included, no further apart than the size of the cells there.
fn along(segment: [[f64; 3]; 2], octree: &Octree) -> Vec<[f64; 3]> {
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

/// The centres of interior cells that are clear of the surface, the segments and the points.
fn inside(
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
