//! A difference that goes away over a time of the device's clock, so that no change of targets makes a pose jump.

use glam::{Quat, Vec3};

/// When a difference began to go away, and how long that takes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ease {
    over_micros: u32,
    since: Option<u64>,
}

impl Ease {
    /// Begins with the next pose.
    pub(super) fn over(over_micros: u32) -> Self {
        Self { over_micros, since: None }
    }

    /// How much of it is left: 1 at first, 0 once it is gone.
    pub(super) fn left(&mut self, micros: u64) -> f32 {
        if self.over_micros == 0 {
            return 0.0;
        }
        let since = *self.since.get_or_insert(micros);
        // A clock that has gone back means that the device restarted.
        let elapsed = micros.checked_sub(since).unwrap_or_else(|| {
            self.since = Some(micros);
            0
        });
        let at = (elapsed as f64 / f64::from(self.over_micros)).min(1.0);
        let left = 1.0 - at * at * (3.0 - 2.0 * at);
        if at >= 1.0 {
            self.over_micros = 0;
        }
        left as f32
    }
}

/// Part of a rotation: the same axis, and this share of the angle, the shorter way around.
pub(super) fn share_of(rotation: Quat, share: f32) -> Quat {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let along = rotation.xyz();
    let length = along.length();
    if length < 1e-12 || !length.is_finite() {
        return Quat::IDENTITY;
    }
    let (sin, cos) = libm::sincosf(share * libm::atan2f(length, rotation.w));
    let axis = along * (sin / length);
    Quat::from_xyzw(axis.x, axis.y, axis.z, cos).normalize()
}

/// A pose as it was: model space.
#[derive(Clone, Debug)]
pub(super) struct FormerPose {
    /// `model_from_bone` rotations.
    pub(super) rotations: Vec<Quat>,
    pub(super) heads: Vec<Vec3>,
    /// `parent_from_bone` rotations.
    pub(super) locals: Vec<Quat>,
}

/// What is left of the pose before the targets changed, as differences from the one that they lead to.
#[derive(Clone, Debug, Default)]
pub(super) struct Easing {
    ease: Ease,
    pub(super) left: f32,
    /// The pose that the differences are taken from, until they are.
    pub(super) former: Option<FormerPose>,
    /// Of bones that follow others, against their parents.
    pub(super) locals: Vec<(usize, Quat)>,
    /// Of bones whose orientation a pin holds, in model space.
    pub(super) held: Vec<(usize, Quat)>,
    /// Where pinned bones were.
    pub(super) places: Vec<(usize, Vec3)>,
    /// Of solved handles, in model space.
    pub(super) turns: Vec<(usize, Quat)>,
    /// Of free roots.
    pub(super) shifts: Vec<(usize, Vec3)>,
}

impl Easing {
    /// Begins with the next pose.
    pub(super) fn begin(&mut self, former: FormerPose, over_micros: u32) {
        self.forget();
        (self.ease, self.former) = (Ease::over(over_micros), Some(former));
    }

    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// At this time of the device's clock.
    pub(super) fn advance(&mut self, micros: u64) {
        self.left = self.ease.left(micros);
        if self.left <= 0.0 && (self.former.is_some() || !self.is_empty()) {
            self.former = None;
            self.locals.clear();
            self.held.clear();
            self.places.clear();
            self.turns.clear();
            self.shifts.clear();
        }
    }

    fn is_empty(&self) -> bool {
        let turned = [&self.locals, &self.held, &self.turns];
        turned.iter().all(|list| list.is_empty()) && self.places.is_empty() && self.shifts.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_goes_away_once_and_a_clock_that_starts_anew_starts_it_anew() {
        let mut ease = Ease::over(1_000);
        // What is gone stays gone.
        let left = [5_000, 5_500, 100, 1_100, 0].map(|micros| ease.left(micros));
        assert_eq!(left.map(f32::to_bits), [1.0_f32, 0.5, 1.0, 0.0, 0.0].map(f32::to_bits));
        assert!(Ease::over(0).left(7) <= 0.0);
    }

    #[test]
    fn a_share_of_a_rotation_has_that_share_of_its_angle() {
        let whole = Quat::from_rotation_y(2.0);
        assert!(share_of(whole, 0.25).angle_between(Quat::from_rotation_y(0.5)) < 1e-3);
        assert!(share_of(-whole, 0.25).dot(Quat::from_rotation_y(0.5)) > 1.0 - 1e-6);
        assert_eq!(share_of(whole, 0.0), Quat::IDENTITY);
    }
}
