//! A joint's rotation from its sensor angles, and back.
//!
//! In the joint's own frame a twist turns about +Y and a bend about +X; a three-axis joint turns
//! `R_Y(a) · R_X(b) · R_Y(c)`, from the inlet outwards.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, Quat};

use super::joint_tree::{JointAxis, PartKind};

/// Below this value of sin or cos of half the bend, the two twists turn about the same axis and only their sum or
/// difference is known.
const TWISTS_COINCIDE: f64 = 1e-6;

/// The rotation of a joint whose sensors turn about `axes` by `angles` (radians), from the inlet outwards.
/// Surplus entries of the longer list are ignored.
///
/// ```
/// use armature_rig::{JointAxis, PartKind, joint_angles, joint_rotation};
///
/// let turn = joint_rotation(&[JointAxis::Twist, JointAxis::Bend, JointAxis::Twist], &[0.3, 0.7, -0.2]);
/// let [twist, bend, outer] = joint_angles(PartKind::TwistBendTwist, turn);
/// assert!((twist - 0.3).abs() < 1e-6 && (bend - 0.7).abs() < 1e-6 && (outer + 0.2).abs() < 1e-6);
/// ```
pub fn joint_rotation(axes: &[JointAxis], angles: &[f64]) -> Quat {
    let mut rotation = DQuat::IDENTITY;
    for (&axis, &angle) in axes.iter().zip(angles) {
        let (sin, cos) = libm::sincos(0.5 * angle);
        rotation *= match axis {
            JointAxis::Bend => DQuat::from_xyzw(sin, 0.0, 0.0, cos),
            JointAxis::Twist => DQuat::from_xyzw(0.0, sin, 0.0, cos),
        };
    }
    rotation.as_quat()
}

/// The angles of a part of this kind that rotate it by `delta`, a unit quaternion in the joint's frame.
///
/// As many angles as the part has sensors, each in (-π, π]; the rest is zero. A bend or twist joint takes what it can:
/// the closest angle about its axis. The bend of a three-axis joint is in [0, π]; where the bend is 0 or π and only one
/// twist is determined, the outer twist is zero.
pub fn joint_angles(kind: PartKind, delta: Quat) -> [f64; 3] {
    let q = delta.as_dquat();
    match kind {
        PartKind::Bend => [about_axis(q.x, q.w), 0.0, 0.0],
        PartKind::Twist => [about_axis(q.y, q.w), 0.0, 0.0],
        PartKind::TwistBendTwist => twist_bend_twist(q, 0.0),
        PartKind::Splitter { .. } => [0.0; 3],
    }
}

/// Like [`joint_angles`], but returns the equivalent solution nearest to `previous`: the bend may be negative, and
/// where only one twist is determined, the outer one stays. Follows a motion without jumps.
pub fn joint_angles_near(kind: PartKind, delta: Quat, previous: [f64; 3]) -> [f64; 3] {
    if kind != PartKind::TwistBendTwist {
        return joint_angles(kind, delta);
    }
    let [a, b, c] = twist_bend_twist(delta.as_dquat(), previous[2]);
    let other = [wrapped(a + PI), -b, wrapped(c + PI)];
    let distance = |angles: [f64; 3]| -> f64 {
        angles.iter().zip(previous).map(|(angle, before)| wrapped(angle - before).abs()).sum()
    };
    if distance(other) < distance([a, b, c]) { other } else { [a, b, c] }
}

/// An angle wrapped into (-π, π].
pub fn wrapped(angle: f64) -> f64 {
    let turned = angle - TAU * libm::floor(angle / TAU);
    if turned > PI { turned - TAU } else { turned }
}

fn about_axis(sin_half: f64, cos_half: f64) -> f64 {
    wrapped(2.0 * libm::atan2(sin_half, cos_half))
}

/// q = (cos b/2 cos (a+c)/2, sin b/2 cos (a-c)/2, cos b/2 sin (a+c)/2, sin b/2 sin (c-a)/2) as (w, x, y, z).
fn twist_bend_twist(q: DQuat, outer_twist_if_free: f64) -> [f64; 3] {
    let cos_half = libm::hypot(q.w, q.y);
    let sin_half = libm::hypot(q.x, q.z);
    let bend = 2.0 * libm::atan2(sin_half, cos_half);
    let half_sum = libm::atan2(q.y, q.w);
    let half_difference = libm::atan2(q.z, q.x);
    if sin_half < TWISTS_COINCIDE {
        return [wrapped(2.0 * half_sum - outer_twist_if_free), bend, wrapped(outer_twist_if_free)];
    }
    if cos_half < TWISTS_COINCIDE {
        return [wrapped(outer_twist_if_free - 2.0 * half_difference), bend, wrapped(outer_twist_if_free)];
    }
    [wrapped(half_sum - half_difference), bend, wrapped(half_sum + half_difference)]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn angle_between(a: Quat, b: Quat) -> f64 {
        let d = a.as_dquat().inverse() * b.as_dquat();
        2.0 * libm::atan2(libm::hypot(libm::hypot(d.x, d.y), d.z), d.w.abs())
    }

    fn rebuilt(kind: PartKind, angles: [f64; 3]) -> Quat {
        joint_rotation(kind.axes(), &angles)
    }

    #[test]
    fn each_axis_turns_the_documented_way() {
        let bend = joint_rotation(&[JointAxis::Bend], &[PI / 2.0]);
        assert!((bend * glam::Vec3::Y).distance(glam::Vec3::Z) < 1e-6, "+Y bends towards +Z about +X");
        let twist = joint_rotation(&[JointAxis::Twist], &[PI / 2.0]);
        assert!((twist * glam::Vec3::Z).distance(glam::Vec3::X) < 1e-6);
        let both = joint_rotation(&[JointAxis::Twist, JointAxis::Bend], &[0.3, 0.7]);
        let reference = Quat::from_rotation_y(0.3) * Quat::from_rotation_x(0.7);
        assert!(angle_between(both, reference) < 1e-6);
    }

    #[test]
    fn the_free_twist_is_zero_or_stays() {
        let [a, b, c] = joint_angles(PartKind::TwistBendTwist, Quat::from_rotation_y(0.8));
        assert!((a - 0.8).abs() < 1e-6 && b.abs() < 1e-6 && c == 0.0);
        let over = Quat::from_rotation_y(0.8) * Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);
        let [a, b, c] = joint_angles(PartKind::TwistBendTwist, over);
        assert!((a - 0.8).abs() < 1e-6 && (b - PI).abs() < 1e-6 && c == 0.0);
        let kept = joint_angles_near(PartKind::TwistBendTwist, Quat::from_rotation_y(0.8), [0.0, 0.0, 0.5]);
        assert!((kept[2] - 0.5).abs() < 1e-12 && (kept[0] - 0.3).abs() < 1e-6);
    }

    #[test]
    fn a_swing_through_the_middle_keeps_its_twists() {
        let mut previous = [0.2, 0.5, -0.4];
        for step in 0..=100 {
            let bend = 0.5 - 0.01 * f64::from(step);
            let delta = joint_rotation(PartKind::TwistBendTwist.axes(), &[0.2, bend, -0.4]);
            let now = joint_angles_near(PartKind::TwistBendTwist, delta, previous);
            for (angle, before) in now.iter().zip(previous) {
                assert!(wrapped(angle - before).abs() < 0.011, "step {step}: {previous:?} -> {now:?}");
            }
            previous = now;
        }
    }

    proptest! {
        #[test]
        fn three_axes_reach_every_rotation(x in -1.0_f32..1.0, y in -1.0_f32..1.0, z in -1.0_f32..1.0, w in -1.0_f32..1.0) {
            let q = Quat::from_xyzw(x, y, z, w);
            prop_assume!(q.length() > 1e-3);
            let q = q.normalize();
            let angles = joint_angles(PartKind::TwistBendTwist, q);
            prop_assert!(angles.iter().all(|a| *a > -PI && *a <= PI));
            prop_assert!(angle_between(rebuilt(PartKind::TwistBendTwist, angles), q) < 1e-5);
            let near = joint_angles_near(PartKind::TwistBendTwist, q, [x.into(), y.into(), z.into()]);
            prop_assert!(angle_between(rebuilt(PartKind::TwistBendTwist, near), q) < 1e-5);
        }

        #[test]
        fn angles_survive_even_at_the_poles(a in -3.1_f64..3.1, c in -3.1_f64..3.1, b in 0.0_f64..1e-5, over: bool) {
            let bend = if over { PI - b } else { b };
            let q = joint_rotation(PartKind::TwistBendTwist.axes(), &[a, bend, c]);
            let angles = joint_angles(PartKind::TwistBendTwist, q);
            prop_assert!(angle_between(rebuilt(PartKind::TwistBendTwist, angles), q) < 1e-5);
        }

        #[test]
        fn single_axes_come_back(angle in -3.1_f64..3.1) {
            for kind in [PartKind::Bend, PartKind::Twist] {
                let q = joint_rotation(kind.axes(), &[angle]);
                prop_assert!((joint_angles(kind, q)[0] - angle).abs() < 1e-5);
                prop_assert!((joint_angles(kind, -q)[0] - angle).abs() < 1e-5);
            }
        }

        #[test]
        fn wrapped_is_within_one_turn(angle in -100.0_f64..100.0) {
            let w = wrapped(angle);
            prop_assert!(w > -PI && w <= PI);
            prop_assert!((libm::sin(w) - libm::sin(angle)).abs() < 1e-12);
        }
    }
}
