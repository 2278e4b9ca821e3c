//! Feet that stand in the source stand in the target.

use glam::{DQuat, DVec3};

use super::frames::{Frame, frames, shortest};
use super::pairs::Pairs;
use crate::recognise::{Figure, HumanoidBone, HumanoidPart, Side};
use crate::skeleton::{Pose, Skeleton};

/// A foot stands while it is no higher than this share of the leg above where it is lowest, and slower than so many
/// legs a second; it stands at least so long (seconds).
const HEIGHT: f64 = 0.1;
const SPEED: f64 = 0.3;
const LEAST_SECONDS: f64 = 0.1;
/// How long a leg takes to come to, and away from, the place where its foot stands, seconds.
const BLEND_SECONDS: f64 = 0.2;
/// How straight a leg may be.
const REACH: f64 = 0.9999;

/// A leg of both, from the hip to the ankle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub(super) source_foot: usize,
    pub(super) source_length: f64,
    pub(super) target_upper: usize,
    pub(super) target_lower: usize,
    pub(super) target_foot: usize,
    pub(super) target_length: f64,
}

/// Where a foot should be, frame by frame.
pub(super) struct Planted {
    leg: Leg,
    /// Where it is by turns alone.
    feet: Vec<DVec3>,
    /// How far it should move from there, less and less away from where it stands.
    offsets: Vec<DVec3>,
    /// 1 while it stands, falling to 0 away from there.
    holds: Vec<f64>,
    /// How often it stands.
    pub(super) contacts: usize,
}

/// The legs that both have; a quadruped has four.
pub(super) fn legs(pairs: &Pairs, source: &[Frame], target: &[Frame]) -> Vec<Leg> {
    let hind = [HumanoidPart::UpperLeg, HumanoidPart::LowerLeg, HumanoidPart::Foot];
    let front = [HumanoidPart::UpperArm, HumanoidPart::LowerArm, HumanoidPart::Hand];
    let on_all_fours = pairs.source.figure == Figure::Quadruped && pairs.target.figure == Figure::Quadruped;
    let chains = if on_all_fours { vec![hind, front] } else { vec![hind] };
    let leg = |(chain, side): ([HumanoidPart; 3], Side)| {
        let pair = |part| pairs.both(HumanoidBone { part, side: Some(side) });
        let [upper, lower, foot] = [pair(chain[0])?, pair(chain[1])?, pair(chain[2])?];
        let length = |frames: &[Frame], which: usize| {
            let head = |bone: [usize; 2]| frames[bone[which]].head;
            head(upper).distance(head(lower)) + head(lower).distance(head(foot))
        };
        let (source_length, target_length) = (length(source, 0), length(target, 1));
        (source_length > 0.0 && target_length > 0.0).then_some(Leg {
            source_foot: foot[0],
            source_length,
            target_upper: upper[1],
            target_lower: lower[1],
            target_foot: foot[1],
            target_length,
        })
    };
    let sides = |chain| [(chain, Side::Left), (chain, Side::Right)];
    chains.into_iter().flat_map(sides).filter_map(leg).collect()
}

/// Where a foot should be so that it goes, while the source's stands, the source's way alone (`way`, scaled and turned).
/// The place is where the foot would be on average, so that as little changes as can be.
pub(super) fn plant(
    leg: &Leg,
    target: &Skeleton,
    source: &[Vec<Frame>],
    way: &dyn Fn(&Vec<Frame>) -> DVec3,
    frame_seconds: f64,
    poses: &[Pose],
) -> Planted {
    let ways: Vec<DVec3> = source.iter().map(way).collect();
    let stands = standing(&ways, leg.target_length, frame_seconds);
    let feet: Vec<DVec3> = poses.iter().map(|pose| frames(target, pose)[leg.target_foot].head).collect();
    let mut known: Vec<Option<DVec3>> = vec![None; poses.len()];
    for stand in &stands {
        let count = stand.len() as f64;
        let place = stand.clone().map(|frame| feet[frame] - ways[frame]).sum::<DVec3>() / count;
        for frame in stand.clone() {
            known[frame] = Some(place + ways[frame] - feet[frame]);
        }
    }
    let reach = (BLEND_SECONDS / frame_seconds).max(1.0);
    let of = |frame: usize| known[frame].map_or_else(|| blended(&known, frame, reach), |offset| (1.0, offset));
    let (holds, offsets) = (0..poses.len()).map(of).unzip();
    Planted { leg: *leg, feet, offsets, holds, contacts: stands.len() }
}

/// How far the whole figure goes along, so that legs change less: the mean of what the feet that stand ask for.
pub(super) fn shift(planted: &[Planted], frame: usize) -> DVec3 {
    let holds: f64 = planted.iter().map(|own| own.holds[frame]).sum();
    planted.iter().map(|own| own.offsets[frame]).sum::<DVec3>() / holds.max(1.0)
}

/// Bends the leg of a figure that was shifted. Returns how far a foot that stands is from its place.
pub(super) fn settle(planted: &Planted, target: &Skeleton, pose: &mut Pose, frame: usize, shift: DVec3) -> f64 {
    let hold = planted.holds[frame];
    if hold <= 0.0 {
        return 0.0;
    }
    let place = planted.feet[frame] + planted.offsets[frame] + (1.0 - hold) * shift;
    let missed = bend(&planted.leg, target, pose, place);
    if hold >= 1.0 { missed } else { 0.0 }
}

/// The frames in which a foot stands.
fn standing(ways: &[DVec3], length: f64, frame_seconds: f64) -> Vec<std::ops::Range<usize>> {
    let mut heights: Vec<f64> = ways.iter().map(|place| place.y).collect();
    heights.sort_by(f64::total_cmp);
    let floor = heights[heights.len() / 50];
    let speed = |frame: usize| {
        let (before, after) = (frame.saturating_sub(1), (frame + 1).min(ways.len() - 1));
        let seconds = (after - before).max(1) as f64 * frame_seconds;
        ways[after].distance(ways[before]) / seconds
    };
    let stands = |frame: usize| ways[frame].y < floor + HEIGHT * length && speed(frame) < SPEED * length;
    let mut out = Vec::new();
    let mut begin = None;
    for frame in 0..=ways.len() {
        match (frame < ways.len() && stands(frame), begin) {
            (true, None) => begin = Some(frame),
            (false, Some(first)) => {
                if (frame - first) as f64 * frame_seconds >= LEAST_SECONDS {
                    out.push(first..frame);
                }
                begin = None;
            }
            _ => {}
        }
    }
    out
}

/// Between places: each holds the foot less the further away it is, by a curve without corners. How much they hold it
/// together, and by how much it moves.
fn blended(known: &[Option<DVec3>], frame: usize, reach: f64) -> (f64, DVec3) {
    let limit = reach.ceil() as usize;
    let share = |away: usize| {
        let x = (1.0 - away as f64 / (reach + 1.0)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    };
    let before = (1..=limit.min(frame)).find_map(|away| Some((share(away), known[frame - away]?)));
    let after = (1..=limit.min(known.len() - 1 - frame)).find_map(|away| Some((share(away), known[frame + away]?)));
    let [(a, first), (b, second)] = [before, after].map(|found| found.unwrap_or((0.0, DVec3::ZERO)));
    let sum = a + b;
    (sum.min(1.0), (a * first + b * second) / sum.max(1.0))
}

/// Bends hip and knee so that the foot comes to a place, in the plane in which the leg is bent; the foot keeps its turn.
/// Returns how far it is from there.
fn bend(leg: &Leg, target: &Skeleton, pose: &mut Pose, place: DVec3) -> f64 {
    let now = frames(target, pose);
    let (hip, knee, ankle) = (now[leg.target_upper].head, now[leg.target_lower].head, now[leg.target_foot].head);
    let (upper, lower) = (hip.distance(knee), knee.distance(ankle));
    let (Some(straight), Some(along)) = ((ankle - hip).try_normalize(), (place - hip).try_normalize()) else {
        return ankle.distance(place);
    };
    let (least, most) = ((upper - lower).abs() + (1.0 - REACH) * (upper + lower), REACH * (upper + lower));
    // A leg that is straighter than that already is not bent for it.
    let most = most.max(hip.distance(ankle).min(upper + lower));
    let reach = hip.distance(place).clamp(least.min(most), most);
    let swing = shortest(straight, along);
    let out = swing * (knee - hip);
    let side = out - out.dot(along) * along;
    // The knee of a straight leg goes to the front of the thigh.
    let front = || {
        let ahead = now[leg.target_upper].rotation * DVec3::Z;
        (ahead - ahead.dot(along) * along).try_normalize().unwrap_or_else(|| along.any_orthonormal_vector())
    };
    let side = if side.length() > 1e-6 * upper { side.normalize() } else { front() };
    let x = (upper * upper - lower * lower + reach * reach) / (2.0 * reach);
    let y = (upper * upper - x * x).max(0.0).sqrt();
    let new_knee = hip + x * along + y * side;
    let new_ankle = hip + reach * along;
    let turn_upper = shortest(knee - hip, new_knee - hip);
    let turn_lower = shortest(ankle - knee, new_ankle - new_knee);
    turn(target, pose, leg.target_upper, turn_upper * now[leg.target_upper].rotation);
    turn(target, pose, leg.target_lower, turn_lower * now[leg.target_lower].rotation);
    turn(target, pose, leg.target_foot, now[leg.target_foot].rotation);
    frames(target, pose)[leg.target_foot].head.distance(place)
}

/// Gives a bone a rotation in model space.
fn turn(target: &Skeleton, pose: &mut Pose, bone: usize, model: DQuat) {
    let above = target.bones()[bone].parent.map_or(DQuat::IDENTITY, |parent| frames(target, pose)[parent].rotation);
    pose.parent_from_bone[bone].rotation = (above.inverse() * model).normalize().as_quat().normalize();
}
