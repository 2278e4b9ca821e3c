//! The joints of a chain along a limb: where the limb bends, and where it is straight, in the template's proportions.

use glam::{DVec3, DVec4};

/// Samples along a limb.
const SAMPLES: usize = 49;
/// Rounds of smoothing; ways on a grid have corners.
const SMOOTHING: usize = 12;
/// Price of a limb's distance from its bones, as a share of its length, squared ...
const OFF_LIMB: f64 = 60.0;
/// ... beyond this share of its radius there, because a bone need not be exactly in the middle ...
const SLACK: f64 = 0.3;
/// ... relative to that of bones that are longer or shorter than the template's by a factor of e, squared.
const OFF_LENGTH: f64 = 0.3;

/// Joints of a chain whose bones have these `lengths` in the template, along the way `path` (both ends included) with the
/// radius of the limb at each of its points: as many joints as bones, and one. They are the polygon with the least sum of
/// squared distances from the path and of deviations from the template's proportions, by dynamic programming.
pub(super) fn joints_along(path: &[DVec3], radii: &[f64], lengths: &[f64]) -> Vec<DVec3> {
    let bones = lengths.len();
    let (Some(&first), Some(&last)) = (path.first(), path.last()) else { return vec![DVec3::ZERO; bones + 1] };
    let with_radius: Vec<DVec4> = path.iter().zip(radii).map(|(at, radius)| at.extend(*radius)).collect();
    let samples = smoothed(&with_radius);
    let whole: f64 = lengths.iter().sum();
    if bones < 2 || whole <= 0.0 || bones >= SAMPLES {
        let along = |k: usize| first.lerp(last, k as f64 / bones.max(1) as f64);
        return (0..=bones).map(along).collect();
    }
    let size: f64 = samples.windows(2).map(|pair| (pair[0] - pair[1]).truncate().length()).sum();
    let off = |from: usize, to: usize| off_segment(&samples, from, to) / (size * size).max(f64::MIN_POSITIVE);
    // least[k][i]: the first k bones end at sample i.
    let mut least = vec![vec![f64::INFINITY; SAMPLES]; bones + 1];
    let mut before = vec![vec![0_usize; SAMPLES]; bones + 1];
    least[0][0] = 0.0;
    let off: Vec<Vec<f64>> =
        (0..SAMPLES).map(|a| (0..SAMPLES).map(|b| if a < b { off(a, b) } else { 0.0 }).collect()).collect();
    for bone in 0..bones {
        let share = (lengths[bone] / whole).max(1e-3);
        for from in bone..SAMPLES {
            if least[bone][from].is_infinite() {
                continue;
            }
            let farthest = SAMPLES - (bones - bone);
            for to in from + 1..=farthest.min(SAMPLES - 1) {
                let ratio = ((to - from) as f64 / (SAMPLES - 1) as f64 / share).ln();
                let cost = least[bone][from] + OFF_LIMB * off[from][to] + OFF_LENGTH * share * ratio * ratio;
                if cost < least[bone + 1][to] {
                    least[bone + 1][to] = cost;
                    before[bone + 1][to] = from;
                }
            }
        }
    }
    let mut at = SAMPLES - 1;
    let mut joints = vec![last];
    for bone in (1..=bones).rev() {
        at = before[bone][at];
        joints.push(samples[at].truncate());
    }
    joints.reverse();
    joints
}

/// Mean squared distance of the samples between two from the segment that joins them, as far as it is more than the
/// slack, times their share of all.
fn off_segment(samples: &[DVec4], from: usize, to: usize) -> f64 {
    let (a, b) = (samples[from].truncate(), samples[to].truncate());
    let way = b - a;
    let scale = 1.0 / way.length_squared().max(f64::MIN_POSITIVE);
    let off = |sample: &DVec4| {
        let from_a = sample.truncate() - a;
        let off = from_a - (from_a.dot(way) * scale).clamp(0.0, 1.0) * way;
        (off.length() - SLACK * sample.w).max(0.0).powi(2)
    };
    samples[from..to].iter().map(off).sum::<f64>() / samples.len() as f64
}

/// Samples at equal distances, without the corners of the grid.
fn smoothed(path: &[DVec4]) -> Vec<DVec4> {
    let mut samples = resampled(path);
    for _ in 0..SMOOTHING {
        let old = samples.clone();
        for at in 1..old.len() - 1 {
            samples[at] = 0.25 * old[at - 1] + 0.5 * old[at] + 0.25 * old[at + 1];
        }
    }
    resampled(&samples)
}

fn resampled(path: &[DVec4]) -> Vec<DVec4> {
    let mut along = vec![0.0];
    for pair in path.windows(2) {
        along.push(along[along.len() - 1] + (pair[0] - pair[1]).truncate().length());
    }
    let whole = along[along.len() - 1];
    let at = |k: usize| {
        let wanted = whole * k as f64 / (SAMPLES - 1) as f64;
        let after = along.partition_point(|&length| length < wanted).clamp(1, path.len().max(2) - 1);
        let Some(&end) = path.get(after) else { return path[0] };
        let part = along[after] - along[after - 1];
        let share = if part > 0.0 { ((wanted - along[after - 1]) / part).clamp(0.0, 1.0) } else { 0.0 };
        path[after - 1].lerp(end, share)
    };
    (0..SAMPLES).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(corner: DVec3) -> Vec<DVec3> {
        let (a, b) = (DVec3::ZERO, DVec3::new(1.0, -0.4, 0.0));
        let half = |from: DVec3, to: DVec3| (0..20).map(move |k| from.lerp(to, f64::from(k) / 20.0));
        half(a, corner).chain(half(corner, b)).chain([b]).collect()
    }

    #[test]
    fn joints_are_where_a_limb_bends() {
        let corner = DVec3::new(0.6, 0.0, 0.0);
        let joints = joints_along(&bent(corner), &[0.02; 41], &[1.0, 1.0]);
        assert!(joints[1].distance(corner) < 0.05, "{joints:?}");
    }

    #[test]
    fn a_straight_limb_is_divided_as_the_template() {
        let line = [DVec3::ZERO, 2.0 * DVec3::X];
        let joints = joints_along(&line, &[0.1; 2], &[1.0, 3.0, 4.0]);
        let along: Vec<f64> = joints.iter().map(|joint| joint.x).collect();
        for (found, wanted) in along.iter().zip([0.0, 0.25, 1.0, 2.0]) {
            assert!((found - wanted).abs() < 0.05, "{along:?}");
        }
    }

    #[test]
    fn a_point_is_a_limb_without_length() {
        let joints = joints_along(&[DVec3::ONE], &[0.1], &[1.0, 1.0, 1.0]);
        assert_eq!(joints, [DVec3::ONE; 4]);
    }
}
