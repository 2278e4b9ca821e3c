//! Feet whose legs no joint turns: they stay where they were put.

use glam::{Affine3A, DQuat, DVec2, DVec3, Vec3Swizzles as _};

use super::leg::{Leg, turn_of};
use crate::skeleton::{Pose, Skeleton};

/// How long feet take to stay and to be let go, seconds.
const BLEND_SECONDS: f64 = 0.25;
/// The point of a foot that stays changes when another is lower by this share of the character's height.
const LOWER: f64 = 0.003;
/// Feet that face further than this away from where the hips do turn with them, radians.
const FURTHEST_TURN: f64 = 1.3;

/// A foot that was put down.
#[derive(Clone, Copy, Debug)]
struct Put {
    /// Its point among its points, and where that stays.
    point: usize,
    place: DVec2,
    /// How it is turned, if no joint turns it.
    turn: DQuat,
}

/// A foot at the end of a leg that bends.
#[derive(Clone, Debug)]
pub(super) struct PlacedFoot {
    bone: usize,
    leg: Leg,
    /// Its points among all.
    points: Vec<usize>,
    /// How it is turned at rest, and how high its lowest point is above the floor then.
    rest: DQuat,
    rest_height: f64,
    put: Option<Put>,
    /// Where it is to be, in the model: its head, and how it is turned.
    target: (DVec3, DQuat),
}

/// All feet, if each of them ends a leg that can bend.
#[derive(Clone, Debug)]
pub(super) struct PlacedFeet {
    feet: Vec<PlacedFoot>,
    /// For each point, whether it belongs to one of the legs.
    is_of_leg: Vec<bool>,
    height: f64,
    floor: f64,
    /// How far they have come to stay, 0 to 1.
    share: f64,
}

impl PlacedFoot {
    /// `places` and `rest`: all points and all bones at rest.
    pub(super) fn new(
        bone: usize,
        leg: Leg,
        points: &[usize],
        places: &[DVec3],
        rest: &[Affine3A],
        floor: f64,
    ) -> Self {
        let low = points.iter().fold(f64::INFINITY, |low, &point| low.min(places[point].y));
        Self {
            bone,
            leg,
            points: points.to_vec(),
            rest: turn_of(&rest[bone]),
            rest_height: low - floor,
            put: None,
            target: (DVec3::ZERO, DQuat::IDENTITY),
        }
    }

    /// The lowest of its points where it is turned like this: their places about its head, and which.
    fn lowest(&self, turn: DQuat, about: &dyn Fn(usize, DQuat) -> DVec3) -> (usize, f64) {
        let heights = self.points.iter().map(|&point| (point, about(point, turn).y));
        heights.fold((self.points[0], f64::INFINITY), |low, next| if next.1 < low.1 { next } else { low })
    }
}

impl PlacedFeet {
    /// `bone_of_point`: the bone of every point.
    pub(super) fn new(
        feet: Vec<PlacedFoot>,
        skeleton: &Skeleton,
        bone_of_point: &[usize],
        height: f64,
        floor: f64,
    ) -> Self {
        let mut below = vec![false; skeleton.len()];
        for (bone, named) in skeleton.bones().iter().enumerate() {
            let is_thigh = feet.iter().any(|foot| foot.leg.thigh() == bone);
            below[bone] = is_thigh || named.parent.is_some_and(|parent| below[parent]);
        }
        let is_of_leg = bone_of_point.iter().map(|&bone| below[bone]).collect();
        Self { feet, is_of_leg, height, floor, share: 0.0 }
    }

    /// Forgets where they were put.
    pub(super) fn restart(&mut self) {
        self.share = 0.0;
        self.feet.iter_mut().for_each(|foot| foot.put = None);
    }

    /// Whether no joint turns any of the legs.
    pub(super) fn are_free(&self, driven: &[bool]) -> bool {
        self.feet.iter().all(|foot| foot.leg.is_free(driven))
    }

    /// The points that stay where they are, and whether all the weight is on them.
    pub(super) fn standing(&self) -> impl Iterator<Item = usize> + '_ {
        let stays = self.share >= 1.0;
        self.feet.iter().filter_map(move |foot| foot.put.filter(|_| stays).map(|put| put.point))
    }

    /// How far they have come to stay, 0 to 1, after this time. The first pose begins with what is right for it.
    pub(super) fn settle(&mut self, are_free: bool, is_first: bool, seconds: f64) -> f64 {
        let step = if is_first { 1.0 } else { seconds / BLEND_SECONDS };
        self.share = if are_free { (self.share + step).min(1.0) } else { (self.share - step).max(0.0) };
        if self.share == 0.0 {
            self.feet.iter_mut().for_each(|foot| foot.put = None);
        }
        self.share
    }

    /// Finds where the feet are to be. `places` and `frames`: all points and bones with the roots moved to where they were
    /// in the last pose; `driven`: which bones joints turn; `facing`: by how much the hips' heading is turned away from
    /// rest, radians.
    pub(super) fn aim(&mut self, places: &[DVec3], frames: &[Affine3A], driven: &[bool], facing: f64) {
        let mut furthest = 0.0_f64;
        for foot in &self.feet {
            let Some(put) = foot.put else { continue };
            let apart = wrapped(facing - heading(put.turn * foot.rest.inverse()));
            furthest = if apart.abs() > furthest.abs() { apart } else { furthest };
        }
        let follow = furthest - furthest.clamp(-FURTHEST_TURN, FURTHEST_TURN);
        let count = self.feet.len().max(1) as f64;
        let middle = self.feet.iter().filter_map(|foot| Some(foot.put?.place)).sum::<DVec2>() / count;
        for foot in &mut self.feet {
            let (head, now) = (frames[foot.bone].translation.as_dvec3(), turn_of(&frames[foot.bone]));
            let about = |point: usize, turn: DQuat| turn * (now.inverse() * (places[point] - head));
            let is_driven = driven.get(foot.bone).copied().unwrap_or(false);
            let mut put = foot.put.unwrap_or_else(|| {
                let turn = DQuat::from_rotation_y(heading(now * foot.rest.inverse())) * foot.rest;
                let (point, _) = foot.lowest(if is_driven { now } else { turn }, &about);
                Put { point, place: places[point].xz(), turn }
            });
            if follow != 0.0 {
                let turn = DQuat::from_rotation_y(follow);
                put.turn = turn * put.turn;
                let from_middle = put.place - middle;
                put.place = middle + (turn * DVec3::new(from_middle.x, 0.0, from_middle.y)).xz();
            }
            let turn = if is_driven { now } else { put.turn };
            let (low, lowest) = foot.lowest(turn, &about);
            if about(put.point, turn).y - lowest > LOWER * self.height {
                // Another point stays where it is now.
                put.place += (about(low, turn) - about(put.point, turn)).xz();
                put.point = low;
            }
            let above = if is_driven { 0.0 } else { foot.rest_height };
            let flat = put.place - about(put.point, turn).xz();
            foot.target = (DVec3::new(flat.x, self.floor + above - lowest, flat.y), turn);
            foot.put = Some(put);
        }
    }

    /// By how much the roots are to be raised, mesh units, negative to sink: as little as lets all feet be reached, and
    /// nothing else be below the floor. `places` and `frames` as for [`aim`](Self::aim).
    pub(super) fn rise(&self, places: &[DVec3], frames: &[Affine3A]) -> f64 {
        let hip = |foot: &PlacedFoot| frames[foot.leg.thigh()].translation.as_dvec3();
        let high = self.feet.iter().map(|foot| foot.leg.too_high(hip(foot), foot.target.0));
        let width = LOWER * self.height;
        let too_high = high.reduce(|a, b| smooth_most(a, b, width)).unwrap_or(0.0).max(0.0);
        self.lift(places, -too_high)
    }

    /// At least as much as keeps all but the legs above the floor.
    fn lift(&self, places: &[DVec3], rise: f64) -> f64 {
        let others = places.iter().zip(&self.is_of_leg).filter(|(_, of_leg)| !**of_leg);
        let lowest = others.fold(f64::INFINITY, |low, (place, _)| low.min(place.y));
        if lowest.is_finite() { rise.max(self.floor - lowest) } else { rise }
    }

    /// By how much roots that something else places are to be raised.
    pub(super) fn raised(&self, places: &[DVec3]) -> f64 {
        self.lift(places, 0.0)
    }

    /// Bends the legs. `frames` of the pose.
    pub(super) fn bend(&self, skeleton: &Skeleton, pose: &mut Pose, frames: &mut [Affine3A]) {
        let share = self.share * self.share * (3.0 - 2.0 * self.share);
        for foot in &self.feet {
            let (mut place, mut turn) = foot.target;
            if share < 1.0 {
                let frame = &frames[foot.bone];
                place = frame.translation.as_dvec3().lerp(place, share);
                turn = turn_of(frame).slerp(turn, share);
            }
            foot.leg.step_to(place, turn, skeleton, pose, frames);
        }
    }
}

/// The turn about +Y that a rotation holds, radians.
pub(super) fn heading(turn: DQuat) -> f64 {
    if turn.y == 0.0 && turn.w == 0.0 { 0.0 } else { wrapped(2.0 * libm::atan2(turn.y, turn.w)) }
}

pub(super) fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    angle - TAU * libm::floor((angle + PI) / TAU)
}

/// The greater of two numbers, at a slope that does not jump where they are equal; exact where both are zero, and less than
/// a tenth of `width` off anywhere.
fn smooth_most(a: f64, b: f64, width: f64) -> f64 {
    let apart = (a - b) / width;
    let root = (1.0 + apart * apart).sqrt();
    0.5 * (a + b) + 0.5 * width * (root - 1.0 / (1.0 + apart * apart))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greater_of_two_is_nearly_met_and_smooth() {
        assert_eq!(smooth_most(0.0, 0.0, 0.01), 0.0);
        let mut before = [f64::NAN; 2];
        for step in -1000..1000_i32 {
            let x = f64::from(step) * 1e-4;
            let most = smooth_most(x, -x, 0.01);
            assert!((most - x.abs()).abs() < 1e-3, "{x} {most}");
            let bend = most - 2.0 * before[0] + before[1];
            assert!(bend.is_nan() || bend.abs() < 2e-5, "{x} {bend}");
            before = [most, before[0]];
        }
    }
}
