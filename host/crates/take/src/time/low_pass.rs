//! Smoothing before the frame rate falls: what is faster than half the new rate would come back as a slow wobble.

use std::collections::VecDeque;

use armature_rig::{Pose, Transform};
use glam::{DQuat, DVec3, Quat, Vec3};

use super::timeline::Timeline;
use crate::file::same_bits;

/// Lobes of the kernel on each side, in frames of the new rate.
const LOBES: f64 = 3.0;

/// A zero-phase filter over the poses of a timeline: at each moment, the poses around it weighted by a Lanczos kernel
/// whose cutoff is half the frame rate. Rotations are filtered as rotation vectors from the pose in the middle (Lee and
/// Shin, *General construction of time-domain filters for orientation data*, 2002), translations and scales as they
/// are. Poses keep their own, uneven times. Constant speeds pass unchanged, at the ends and beside gaps too, where the
/// motion is continued by its point reflection.
#[derive(Debug)]
pub(crate) struct LowPass<'t, 'a> {
    timeline: &'a Timeline<'t>,
    period_micros: f64,
    /// Poses further apart than this do not see each other.
    hold_over_micros: f64,
    /// Poses around the current moment and their times.
    window: VecDeque<(f64, Pose)>,
    next: usize,
}

/// How much each pose of the window counts.
type Weights = Vec<f64>;

impl<'t, 'a> LowPass<'t, 'a> {
    pub(crate) fn new(timeline: &'a Timeline<'t>, frames_per_second: f64, hold_over_micros: f64) -> Self {
        let period_micros = 1e6 / frames_per_second;
        Self { timeline, period_micros, hold_over_micros, window: VecDeque::new(), next: 0 }
    }

    /// The smooth pose at a moment, which never goes back; `middle` is the pose there without smoothing.
    pub(crate) fn pose(&mut self, micros: f64, middle: Pose) -> Pose {
        self.move_to(micros);
        let Some((first, weights)) = self.weights(micros) else { return middle };
        let near: Vec<(&Pose, f64)> =
            self.window.range(first..first + weights.len()).map(|(_, pose)| pose).zip(weights).collect();
        let start = self.window.range(first..first + near.len()).filter(|(time, _)| *time <= micros).count();
        let bones = middle.parent_from_bone.iter().enumerate();
        Pose { parent_from_bone: bones.map(|(bone, middle)| smooth(middle, bone, &near, start)).collect() }
    }

    fn move_to(&mut self, micros: f64) {
        let reach = LOBES * self.period_micros;
        while self.window.front().is_some_and(|(time, _)| *time < micros - reach) {
            self.window.pop_front();
        }
        let moments = self.timeline.moments();
        while let Some(moment) = moments.get(self.next).filter(|moment| moment.micros as f64 <= micros + reach) {
            self.next += 1;
            if moment.micros as f64 >= micros - reach {
                let mut pose = Pose::default();
                moment.pose.unpack(self.timeline.skeleton(), &mut pose);
                self.window.push_back((moment.micros as f64, pose));
            }
        }
    }

    /// The first pose of the window that counts, and what each from there on counts for; `None` where the poses are no
    /// denser than the frames.
    fn weights(&self, micros: f64) -> Option<(usize, Weights)> {
        let times: Vec<f64> = self.window.iter().map(|(time, _)| *time - micros).collect();
        let after = times.partition_point(|time| *time <= 0.0);
        let joined = |pair: &[f64]| pair[1] - pair[0] <= self.hold_over_micros;
        let here = after.checked_sub(1)?;
        let first = here - times[..=here].windows(2).rev().take_while(|pair| joined(pair)).count();
        let last = here + times[here..].windows(2).take_while(|pair| joined(pair)).count();
        let times = &times[first..=last];
        let span = times[times.len() - 1] - times[0];
        if times.len() < 3 || span / (times.len() - 1) as f64 >= self.period_micros {
            return None;
        }
        Some((first, weights(times, self.period_micros)))
    }
}

/// A time around the moment, and the poses that give the value there: its own, or for a time beyond an end twice the
/// end's less the one as far inside.
#[derive(Clone, Copy)]
struct Place {
    time: f64,
    pose: usize,
    mirrored_at: Option<usize>,
}

/// What each pose at these times (microseconds after the moment, increasing) counts for.
fn weights(times: &[f64], period: f64) -> Weights {
    let (reach, end) = (LOBES * period, times.len() - 1);
    let mirrored =
        |at: usize| move |pose: usize| Place { time: 2.0 * times[at] - times[pose], pose, mirrored_at: Some(at) };
    let inside = |place: &Place| place.time.abs() < reach;
    let mut places: Vec<Place> = (1..=end).rev().map(mirrored(0)).filter(inside).collect();
    places.extend((0..=end).map(|pose| Place { time: times[pose], pose, mirrored_at: None }));
    places.extend((0..end).rev().map(mirrored(end)).filter(inside));
    let width = |at: usize| {
        let before = places[at.saturating_sub(1)].time;
        let after = places[(at + 1).min(places.len() - 1)].time;
        0.5 * (after - before)
    };
    let window = |time: f64| if time.abs() < reach { sinc(time / reach) } else { 0.0 };
    let widths: Vec<f64> = (0..places.len()).map(width).collect();
    let kernel = |(place, width): (&Place, &f64)| width * sinc(place.time / period) * window(place.time);
    let mut counts: Vec<f64> = places.iter().zip(&widths).map(kernel).collect();
    let sum: f64 = counts.iter().sum();
    counts.iter_mut().for_each(|count| *count /= sum);
    straighten(&mut counts, &places, &widths, window);
    let mut weights = vec![0.0; times.len()];
    for (place, count) in places.iter().zip(counts) {
        match place.mirrored_at {
            None => weights[place.pose] += count,
            Some(at) => {
                weights[at] += 2.0 * count;
                weights[place.pose] -= count;
            }
        }
    }
    weights
}

/// Uneven times shift the kernel's middle: moves it back, so that a constant speed passes unchanged.
fn straighten(counts: &mut [f64], places: &[Place], widths: &[f64], window: impl Fn(f64) -> f64) {
    let shift: f64 = counts.iter().zip(places).map(|(count, place)| count * place.time).sum();
    let shares: Vec<f64> = places.iter().zip(widths).map(|(place, width)| width * window(place.time)).collect();
    let moment =
        |power: i32| -> f64 { shares.iter().zip(places).map(|(share, place)| share * place.time.powi(power)).sum() };
    let (zeroth, first, second) = (moment(0), moment(1), moment(2));
    let determinant = zeroth * second - first * first;
    if determinant > 0.0 {
        let slope = -shift * zeroth / determinant;
        let level = -slope * first / zeroth;
        for ((count, share), place) in counts.iter_mut().zip(shares).zip(places) {
            *count += share * (level + slope * place.time);
        }
    }
}

/// sin πx / πx.
fn sinc(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    if angle.abs() < 1e-9 { 1.0 } else { libm::sin(angle) / angle }
}

/// One bone, from the weighted poses; the first `start` of them are not after the moment.
fn smooth(middle: &Transform, bone: usize, near: &[(&Pose, f64)], start: usize) -> Transform {
    let own = |(pose, _): &(&Pose, f64)| pose.parent_from_bone[bone];
    if near.iter().all(|pose| same_bits(&own(pose), middle)) {
        return *middle;
    }
    let sum = |part: fn(&Transform) -> Vec3| -> Vec3 {
        let weighted = near.iter().map(|pose| part(&own(pose)).as_dvec3() * pose.1);
        weighted.sum::<DVec3>().as_vec3()
    };
    let kept = |part: fn(&Transform) -> Vec3| {
        if near.iter().all(|pose| part(&own(pose)) == part(middle)) { part(middle) } else { sum(part) }
    };
    let from_middle = middle.rotation.as_dquat().normalize();
    let turn = |pose: &(&Pose, f64)| (from_middle.conjugate() * own(pose).rotation.as_dquat().normalize(), pose.1);
    let (before, after) = near.split_at(start.min(near.len()));
    let vector = turned(before.iter().rev().map(turn)) + turned(after.iter().map(turn));
    Transform {
        translation: kept(|t| t.translation),
        rotation: if near.iter().all(|pose| own(pose).rotation == middle.rotation) {
            middle.rotation
        } else {
            rotated(from_middle, vector)
        },
        scale: kept(|t| t.scale),
    }
}

fn rotated(from: DQuat, vector: DVec3) -> Quat {
    (from * DQuat::from_scaled_axis(vector)).normalize().as_quat()
}

/// The weighted sum of rotations as vectors. Each goes on from the one before, so that a turn of more than half a circle
/// stays one.
fn turned(turns: impl Iterator<Item = (DQuat, f64)>) -> DVec3 {
    let (mut last, mut sum) = (DVec3::ZERO, DVec3::ZERO);
    for (turn, weight) in turns {
        let vector = turn.to_scaled_axis();
        let angle = vector.length();
        let axis = vector.try_normalize().unwrap_or_else(|| last.normalize_or_zero());
        let turns = libm::round((last.dot(axis) - angle) / std::f64::consts::TAU);
        last = axis * (angle + turns * std::f64::consts::TAU);
        sum += last * weight;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uneven times, and the ends near: the sum of what all poses count for is one, and of their times zero.
    #[test]
    fn constants_and_constant_speeds_pass() {
        let period = 41_667.0;
        for (first, count, wobble) in [(-125e3, 90, 0.0), (-125e3, 70, 900.0), (-9e3, 40, 500.0), (0.0, 30, 0.0)] {
            let times: Vec<f64> =
                (0..count).map(|n| first + 2_700.0 * f64::from(n) + wobble * f64::from(n * 7 % 5)).collect();
            let weights = weights(&times, period);
            let sum: f64 = weights.iter().sum();
            let middle: f64 = weights.iter().zip(&times).map(|(weight, time)| weight * time).sum();
            assert!((sum - 1.0).abs() < 1e-12 && middle.abs() < 1e-6, "{sum} {middle}");
        }
    }

    #[test]
    fn a_turn_of_more_than_half_a_circle_stays_one() {
        let turns = (0..9).map(|n| (DQuat::from_rotation_y(f64::from(n)), if n == 8 { 1.0 } else { 0.0 }));
        assert!((turned(turns) - DVec3::Y * 8.0).length() < 1e-9);
    }
}
