//! Where limbs end, and the middles of spheres that fill the shape: the places between which a skeleton is embedded.

use glam::DVec3;
use rayon::prelude::*;

use super::interior::{Interior, Measure, Ways};

/// Limbs that stick out less than this share of the longest way are bumps.
const LEAST_PERSISTENCE: f64 = 0.035;
/// The share of the longest way from the middle that counts as a limb's last part: half a foot.
const LAST_PART: f64 = 0.12;
/// Rounds in which the radius of a limb near its end is found.
const ROUNDS: usize = 10;
/// Ends nearer to each other than this share of the longest way from the middle are the same.
const SAME_END: f64 = 0.1;
/// Most ends that are looked at.
const MOST_ENDS: usize = 16;
/// Most spheres.
const MOST_CENTRES: usize = 150;
/// Off the medial axis depth grows by its own distance; a point from which it grows at less than this rate is on the axis.
const MEDIAL_RATE: f64 = 0.75;
/// Centres of spheres are at least this share of the larger one's radius apart.
const SPACING: f64 = 0.55;

/// The end of a limb.
pub(super) struct End {
    /// In the middle of the end.
    pub(super) at: DVec3,
    /// How far the limb sticks out, along it.
    pub(super) persistence: f64,
    /// Where the end points: a foot forwards, a hand along the arm.
    pub(super) way: DVec3,
    /// Ways from it to all points.
    pub(super) ways: Ways,
    /// The inner point.
    pub(super) point: usize,
}

/// Ends of limbs and centres of spheres.
pub(super) struct Landmarks {
    /// The farthest ends first.
    pub(super) ends: Vec<End>,
    /// Inner points, the deepest first.
    pub(super) centres: Vec<usize>,
    /// The longest way between two ends.
    pub(super) diameter: f64,
}

/// Finds them.
pub(super) fn landmarks(interior: &Interior) -> Landmarks {
    let from_middle = interior.ways(middle(interior), Measure::Length);
    let peaks = peaks(interior, &from_middle);
    let reach = from_middle.length.iter().copied().filter(|length| length.is_finite()).fold(0.0, f64::max);
    let end = |&(point, persistence): &(usize, f64)| {
        let ways = interior.ways(point, Measure::Length);
        let at = middle_of_cap(interior, &ways, &from_middle, point);
        let is_before = |&&p: &&usize| from_middle.length[p] < from_middle.length[point] - LAST_PART * reach;
        let before = from_middle.way_to(point).iter().rev().find(is_before).copied();
        let way = before.map_or(DVec3::ZERO, |before| (at - interior.points[before]).normalize_or_zero());
        End { at, persistence, way, ways, point }
    };
    let mut ends: Vec<End> = peaks.par_iter().map(end).collect();
    let near = |a: DVec3| move |end: &End| end.at.distance(a) < SAME_END * reach;
    for (point, way) in extremes(interior, &from_middle) {
        if ends.len() < MOST_ENDS && !ends.iter().any(near(interior.points[point])) {
            let ways = interior.ways(point, Measure::Length);
            ends.push(End { at: interior.points[point], persistence: 0.0, way, ways, point });
        }
    }
    let between = ends.iter().flat_map(|a| ends.iter().map(|b| a.ways.length[b.point]));
    let diameter = between.filter(|length| length.is_finite()).fold(0.0, f64::max);
    Landmarks { ends, centres: centres(interior, &from_middle), diameter: diameter.max(reach) }
}

/// The middle of the longest way: of all points about the one with the shortest way to the farthest.
fn middle(interior: &Interior) -> usize {
    let farthest = |ways: &Ways| {
        let reached = (0..interior.points.len()).filter(|&p| ways.length[p].is_finite());
        reached.max_by(|&a, &b| ways.length[a].total_cmp(&ways.length[b])).unwrap_or_default()
    };
    let deepest = (0..interior.points.len()).max_by(|&a, &b| interior.depth[a].total_cmp(&interior.depth[b]));
    let one_end = farthest(&interior.ways(deepest.unwrap_or_default(), Measure::Length));
    let ways = interior.ways(one_end, Measure::Length);
    let other_end = farthest(&ways);
    let half = 0.5 * ways.length[other_end];
    ways.way_to(other_end).into_iter().find(|&p| ways.length[p] >= half).unwrap_or(one_end)
}

/// The outermost points along each axis, and the axis: the crown of a head is one although its ears are farther from the middle.
fn extremes(interior: &Interior, from_middle: &Ways) -> Vec<(usize, DVec3)> {
    let axes = [DVec3::Y, DVec3::Z, DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z, DVec3::NEG_X];
    let reached = || (0..interior.points.len()).filter(|&p| from_middle.length[p].is_finite());
    // Of a flat end the middle.
    let outermost = |axis: DVec3| {
        let along = |p: usize| interior.points[p].dot(axis);
        let most = reached().map(along).fold(f64::NEG_INFINITY, f64::max);
        let points: Vec<usize> = reached().filter(|&p| along(p) > most - 1.5 * interior.step).collect();
        let mean = points.iter().map(|&p| interior.points[p]).sum::<DVec3>() / points.len().max(1) as f64;
        let away = |p: usize| interior.points[p].distance_squared(mean);
        points.into_iter().min_by(|&a, &b| away(a).total_cmp(&away(b)))
    };
    axes.into_iter().filter_map(|axis| Some((outermost(axis)?, axis))).collect()
}

/// Points from which every way leads towards the middle, with the length over which their limb stays apart: the
/// persistence of the maxima of the distance from the middle.
fn peaks(interior: &Interior, from_middle: &Ways) -> Vec<(usize, f64)> {
    let length = &from_middle.length;
    let mut order: Vec<usize> = (0..length.len()).filter(|&p| length[p].is_finite()).collect();
    order.sort_by(|&a, &b| length[b].total_cmp(&length[a]).then(a.cmp(&b)));
    let mut group: Vec<usize> = vec![usize::MAX; length.len()];
    let mut found = Vec::new();
    for &point in &order {
        let around: Vec<usize> = interior.neighbours(point).filter(|&other| group[other] != usize::MAX).collect();
        let mut peaks: Vec<usize> = around.into_iter().map(|other| root(&mut group, other)).collect();
        peaks.sort_by(|&a, &b| length[b].total_cmp(&length[a]).then(a.cmp(&b)));
        peaks.dedup();
        group[point] = peaks.first().copied().unwrap_or(point);
        for &lower in peaks.iter().skip(1) {
            found.push((lower, length[lower] - length[point]));
            group[lower] = peaks[0];
        }
    }
    found.extend(order.first().map(|&highest| (highest, length[highest])));
    let longest = order.first().map_or(0.0, |&highest| length[highest]);
    found.retain(|&(_, persistence)| persistence >= (LEAST_PERSISTENCE * longest).max(2.5 * interior.step));
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.truncate(MOST_ENDS);
    found
}

fn root(group: &mut [usize], mut at: usize) -> usize {
    while group[at] != at {
        group[at] = group[group[at]];
        at = group[at];
    }
    at
}

/// The end's last point is at the skin, often at its rim. The middle of what is around it is in the middle of the limb;
/// from there the limb goes on to its end.
fn middle_of_cap(interior: &Interior, from_end: &Ways, from_middle: &Ways, end: usize) -> DVec3 {
    let cap = |radius: f64, height: f64| -> Vec<usize> {
        let within = |&p: &usize| {
            from_end.length[p] <= 2.0 * radius && from_middle.length[p] >= from_middle.length[end] - height
        };
        (0..interior.points.len()).filter(within).collect()
    };
    // The limb's radius near the end: that of the largest sphere that is about as near as it is large, found from a small
    // one that grows as long as there is room.
    let mut radius = 2.0 * interior.step;
    for _ in 0..ROUNDS {
        let depth = cap(radius, 1.5 * radius).iter().map(|&p| interior.depth[p]).fold(0.0, f64::max);
        radius = radius.max(depth);
    }
    let points = cap(radius, radius);
    let mean = points.iter().map(|&p| interior.points[p]).sum::<DVec3>() / points.len().max(1) as f64;
    let middle = if interior.at(mean).is_some() { mean } else { interior.points[interior.nearest(mean)] };
    // From there along the limb as far as it is inside.
    let is_before = |&p: &usize| {
        let back = from_middle.length[end] - from_middle.length[p];
        from_end.length[p] <= 4.0 * radius && (2.0 * radius..3.0 * radius).contains(&back)
    };
    let before: Vec<usize> = (0..interior.points.len()).filter(is_before).collect();
    let before_mean = before.iter().map(|&p| interior.points[p]).sum::<DVec3>() / before.len().max(1) as f64;
    let way = if before.is_empty() { DVec3::ZERO } else { (middle - before_mean).normalize_or_zero() };
    let onward = (1..).map(|k| middle + 0.5 * interior.step * f64::from(k) * way);
    let farthest = (4.0 * radius / interior.step).ceil() as usize;
    onward.take(farthest).take_while(|&at| interior.at(at).is_some()).last().unwrap_or(middle)
}

/// Centres of spheres that fill the shape, the largest first, on the medial axis.
fn centres(interior: &Interior, from_middle: &Ways) -> Vec<usize> {
    let is_medial = |&point: &usize| {
        let (at, depth) = (interior.points[point], interior.depth[point]);
        from_middle.length[point].is_finite()
            && interior
                .neighbours(point)
                .all(|other| interior.depth[other] - depth < MEDIAL_RATE * interior.points[other].distance(at))
    };
    let mut order: Vec<usize> = (0..interior.points.len()).filter(is_medial).collect();
    order.sort_by(|&a, &b| interior.depth[b].total_cmp(&interior.depth[a]).then(a.cmp(&b)));
    let mut chosen: Vec<usize> = Vec::new();
    for point in order {
        let is_apart = chosen.iter().all(|&other| {
            let apart = (SPACING * interior.depth[other]).max(1.5 * interior.step);
            interior.points[other].distance(interior.points[point]) >= apart
        });
        if is_apart {
            chosen.push(point);
        }
        if chosen.len() == MOST_CENTRES {
            break;
        }
    }
    chosen
}
