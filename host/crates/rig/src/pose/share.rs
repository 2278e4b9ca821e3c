//! A share of a joint's rotation.

use glam::{DQuat, DVec3, Quat};

/// Beyond this angle a rotation may be taken the long way round, if it came that way, radians. A share jumps where the way
/// round changes; near a half turn, noise would change it all the time.
const BOTH_WAYS: f64 = 2.0 * std::f64::consts::FRAC_PI_3;

/// What a bone takes of a joint's rotation: a power of it, about the same axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    of_whole: f64,
    /// The whole rotation, axis times radians, the way round that it came.
    turn: DVec3,
}

impl Share {
    pub(super) fn new(of_whole: f64) -> Self {
        Self { of_whole, turn: DVec3::ZERO }
    }

    /// Takes the way round of the share that this one replaces.
    pub(super) fn continue_from(&mut self, before: &Self) {
        self.turn = before.turn;
    }

    /// The joint has turned so far.
    pub(super) fn follow(&mut self, whole: Quat) {
        let whole = whole.as_dquat();
        let whole = if whole.w < 0.0 { -whole } else { whole };
        let sin = DVec3::new(whole.x, whole.y, whole.z);
        let length = sin.length();
        // Below that, the angle is twice its half's sine.
        let short = if length < 1e-9 { sin * 2.0 } else { sin * (2.0 * libm::atan2(length, whole.w) / length) };
        let angle = short.length();
        let long = short * (1.0 - std::f64::consts::TAU / angle.max(BOTH_WAYS));
        let came_long = angle > BOTH_WAYS && self.turn.distance_squared(long) < self.turn.distance_squared(short);
        self.turn = if came_long { long } else { short };
    }

    /// The bone's rotation.
    pub(super) fn rotation(&self) -> Quat {
        let half = self.turn * (0.5 * self.of_whole);
        let angle = half.length();
        let (sin, cos) = libm::sincos(angle);
        let sinc = if angle < 1e-9 { 1.0 } else { sin / angle };
        DQuat::from_xyzw(half.x * sinc, half.y * sinc, half.z * sinc, cos).normalize().as_quat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_rotation_make_up_the_whole_about_the_same_axis() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        for angle in [0.0, 1e-12, 1e-6, 0.4, 2.0, 3.1] {
            let whole = DQuat::from_axis_angle(axis, angle).as_quat();
            let mut product = Quat::IDENTITY;
            for of_whole in [0.2, 0.5, 0.3] {
                let mut share = Share::new(of_whole);
                share.follow(whole);
                let expected = DQuat::from_axis_angle(axis, angle * of_whole).as_quat();
                assert!(share.rotation().dot(expected) > 1.0 - 1e-6, "{angle} {of_whole}");
                product *= share.rotation();
            }
            assert!(product.dot(whole).abs() > 1.0 - 1e-6, "{angle}");
        }
    }

    #[test]
    fn a_rotation_past_a_half_turn_goes_on_the_way_it_came_and_noise_there_does_not_turn_it_over() {
        let mut share = Share::new(0.25);
        let mut before = Quat::IDENTITY;
        for step in 0..230_i32 {
            let noise = if step % 2 == 0 { 0.02 } else { -0.02 };
            let angle = f64::from(step).to_radians() + noise;
            share.follow(DQuat::from_rotation_y(angle).as_quat());
            let shown = share.rotation();
            let expected = DQuat::from_rotation_y(0.25 * angle).as_quat();
            assert!(shown.dot(expected).abs() > 1.0 - 1e-6, "{step}°");
            assert!(shown.angle_between(before) < 0.02 || step == 0, "{step}°: no jump");
            before = shown;
        }
        // Far enough back, the short way is meant.
        share.follow(DQuat::from_rotation_y(-1.0).as_quat());
        assert!(share.rotation().dot(DQuat::from_rotation_y(-0.25).as_quat()) > 1.0 - 1e-6);
    }

    #[test]
    fn the_same_rotation_written_the_other_way_has_the_same_share() {
        let (mut one, mut other) = (Share::new(0.5), Share::new(0.5));
        let whole = DQuat::from_rotation_x(1.2).as_quat();
        one.follow(whole);
        other.follow(-whole);
        assert_eq!(one.rotation(), other.rotation());
    }
}
