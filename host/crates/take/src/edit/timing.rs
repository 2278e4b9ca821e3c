//! Edits of time: trim, retime, loop.

use super::performance::{Performance, blend, ease};

/// Leaves what is between two times; poses are added exactly there.
pub(super) fn trim(performance: &mut Performance, from: i64, to: i64) {
    let Some((first, last)) = performance.span() else { return };
    let (start, end) = (from.max(first), to.min(last));
    let ends = if start <= end { [performance.at(start), performance.at(end)] } else { [None, None] };
    performance.poses.retain(|(time, _)| *time > start && *time < end);
    if let [Some(at_start), Some(at_end)] = ends {
        performance.poses.insert(0, (start, at_start));
        if end > start {
            performance.poses.push((end, at_end));
        }
    }
    performance.poses.iter_mut().for_each(|(time, _)| *time -= start);
    if let Some(shapes) = performance.shapes_mut() {
        shapes.trim(start, end);
    }
    performance.markers.retain(|(time, _)| (start..=end).contains(time));
    performance.markers.iter_mut().for_each(|(time, _)| *time -= start);
    performance.segments.retain(|(_, from, to)| *to >= start && *from <= end);
    for (_, from, to) in &mut performance.segments {
        (*from, *to) = ((*from).max(start) - start, (*to).min(end) - start);
    }
}

/// Plays everything at another speed.
pub(super) fn retime(performance: &mut Performance, speed: f64) {
    let at = |time: &mut i64| *time = libm::round(*time as f64 / speed) as i64;
    performance.poses.iter_mut().for_each(|(time, _)| at(time));
    // Faster than the clock can tell apart.
    performance.poses.dedup_by_key(|(time, _)| *time);
    if let Some(shapes) = performance.shapes_mut() {
        shapes.retime(at);
    }
    performance.markers.iter_mut().for_each(|(time, _)| at(time));
    for (_, from, to) in &mut performance.segments {
        at(from);
        at(to);
    }
}

/// Repeats everything. Where one round ends, its last `fade` goes over into the first of the next: a round lasts that
/// much less, and its last pose is its first one.
pub(super) fn repeat(performance: &mut Performance, times: u32, fade: i64) {
    let Some((first, last)) = performance.span() else { return };
    let round = last - first - fade;
    let start = |performance: &Performance, time: i64, pose: &armature_rig::Pose| {
        let end = performance.at(time + round).unwrap_or_default();
        if fade > 0 { blend(&end, pose, ease((time - first) as f64 / fade as f64)) } else { pose.clone() }
    };
    let inside = performance.poses.iter().filter(|(time, _)| *time < first + round);
    let one: Vec<_> = inside
        .map(|(time, pose)| {
            (*time - first, if *time < first + fade { start(performance, *time, pose) } else { pose.clone() })
        })
        .collect();
    let mut poses = Vec::with_capacity(one.len() * times as usize + 1);
    for n in 0..i64::from(times) {
        poses.extend(one.iter().map(|(time, pose)| (time + n * round, pose.clone())));
    }
    let closing = if fade > 0 { one.first().map(|(_, pose)| pose.clone()) } else { performance.at(last) };
    poses.extend(closing.map(|pose| (i64::from(times) * round, pose)));
    performance.poses = poses;
    if let Some(shapes) = performance.shapes_mut() {
        shapes.repeat((first, last), times, fade, ease);
    }
    performance.markers.iter_mut().for_each(|(time, _)| *time -= first);
    for (_, from, to) in &mut performance.segments {
        (*from, *to) = (*from - first, *to - first);
    }
}
