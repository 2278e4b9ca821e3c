//! Rotations as unit quaternions (x, y, z, w) in f64, and the sensor angles of a joint.
//!
//! The core depends on nothing but the wire protocol, so it has these few lines itself.

use std::f64::consts::{PI, TAU};

use firmware_protocol::PartKind;

/// A unit quaternion (x, y, z, w).
pub type Rotation = [f64; 4];

/// No rotation.
pub const IDENTITY: Rotation = [0.0, 0.0, 0.0, 1.0];

/// Below this value of sin or cos of half the bend, only the sum or difference of the two twists is determined.
const TWISTS_COINCIDE: f64 = 1e-9;

/// A rotation about one of the axes x (0), y (1), z (2) by an angle in radians.
pub fn about(axis: usize, angle: f64) -> Rotation {
    let (sin, cos) = libm::sincos(0.5 * angle);
    let mut rotation = [0.0, 0.0, 0.0, cos];
    if let Some(component) = rotation.get_mut(axis).filter(|_| axis < 3) {
        *component = sin;
    }
    rotation
}

/// First `b`, then `a`, both about fixed axes.
pub fn product(a: Rotation, b: Rotation) -> Rotation {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// The inverse rotation.
pub fn inverse([x, y, z, w]: Rotation) -> Rotation {
    [-x, -y, -z, w]
}

/// Normalised to unit length; the identity if the length is zero or NaN.
pub fn normalized(q: Rotation) -> Rotation {
    let length = libm::sqrt(q.iter().map(|v| v * v).sum());
    if length.is_finite() && length > 1e-12 { q.map(|v| v / length) } else { IDENTITY }
}

/// The rotation at `at` (0 to 1) on the shortest path from `a` to `b`, at constant speed (slerp).
pub fn between(a: Rotation, b: Rotation, at: f64) -> Rotation {
    let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let b = if dot < 0.0 { b.map(|v| -v) } else { b };
    let apart: f64 = libm::sqrt(a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum());
    let angle = 2.0 * libm::asin((0.5 * apart).min(1.0));
    let sin = libm::sin(angle);
    let (p, q) =
        if sin < 1e-9 { (1.0 - at, at) } else { (libm::sin((1.0 - at) * angle) / sin, libm::sin(at * angle) / sin) };
    normalized([0, 1, 2, 3].map(|i| p * a[i] + q * b[i]))
}

/// An angle wrapped into (-π, π].
pub fn wrapped(angle: f64) -> f64 {
    let turned = angle - TAU * libm::floor(angle / TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// The rotation of a part at these sensor angles.
pub fn from_sensor_angles(kind: PartKind, angles: [f64; 3]) -> Rotation {
    match kind {
        PartKind::Bend => about(0, angles[0]),
        PartKind::Twist => about(1, angles[0]),
        PartKind::TwistBendTwist => product(product(about(1, angles[0]), about(0, angles[1])), about(1, angles[2])),
        PartKind::Splitter | PartKind::Other(_) => IDENTITY,
    }
}

/// The sensor angles of a part rotated by `turn`: twist · bend · twist for three sensors, otherwise the nearest angle
/// about the one axis. Of the equivalent solutions, the one nearest to `previous`; where only one twist is determined,
/// the outer one stays at `previous`.
pub fn to_sensor_angles(kind: PartKind, turn: Rotation, previous: [f64; 3]) -> [f64; 3] {
    let [x, y, z, w] = turn;
    match kind {
        PartKind::Bend => [wrapped(2.0 * libm::atan2(x, w)), 0.0, 0.0],
        PartKind::Twist => [wrapped(2.0 * libm::atan2(y, w)), 0.0, 0.0],
        PartKind::Splitter | PartKind::Other(_) => [0.0; 3],
        PartKind::TwistBendTwist => {
            let (cos_half, sin_half) = (libm::hypot(w, y), libm::hypot(x, z));
            let bend = 2.0 * libm::atan2(sin_half, cos_half);
            let half_sum = libm::atan2(y, w);
            let half_difference = libm::atan2(z, x);
            let (a, c) = if sin_half < TWISTS_COINCIDE {
                (2.0 * half_sum - previous[2], previous[2])
            } else if cos_half < TWISTS_COINCIDE {
                (previous[2] - 2.0 * half_difference, previous[2])
            } else {
                (half_sum - half_difference, half_sum + half_difference)
            };
            let one = [wrapped(a), bend, wrapped(c)];
            let other = [wrapped(a + PI), -bend, wrapped(c + PI)];
            if distance(other, previous) < distance(one, previous) { other } else { one }
        }
    }
}

fn distance(angles: [f64; 3], previous: [f64; 3]) -> f64 {
    angles.iter().zip(previous).map(|(angle, before)| wrapped(angle - before).abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn apart(a: Rotation, b: Rotation) -> f64 {
        let [x, y, z, w] = product(inverse(a), b);
        2.0 * libm::atan2(libm::sqrt(x * x + y * y + z * z), w.abs())
    }

    #[test]
    fn every_rotation_comes_back_from_its_sensors() {
        let mut random = Random::new(3, 0);
        for _ in 0..2000 {
            let q = normalized([0; 4].map(|_| random.unit() - 0.5));
            let previous = [0; 3].map(|_| 6.0 * random.unit() - 3.0);
            let angles = to_sensor_angles(PartKind::TwistBendTwist, q, previous);
            assert!(apart(q, from_sensor_angles(PartKind::TwistBendTwist, angles)) < 1e-7);
        }
        for bend in [0.0, 1e-12, 1e-8, PI - 1e-8, PI] {
            let q = from_sensor_angles(PartKind::TwistBendTwist, [0.7, bend, -0.2]);
            let angles = to_sensor_angles(PartKind::TwistBendTwist, q, [0.0; 3]);
            assert!(apart(q, from_sensor_angles(PartKind::TwistBendTwist, angles)) < 1e-7, "{bend}");
        }
    }

    #[test]
    fn the_way_between_is_even() {
        let (a, b) = (about(1, 0.3), product(about(0, 1.0), about(2, -0.4)));
        let whole = apart(a, b);
        for i in 0..=10 {
            let at = f64::from(i) / 10.0;
            assert!((apart(a, between(a, b, at)) - at * whole).abs() < 1e-9);
            assert!(apart(between(a, b.map(|v| -v), at), between(a, b, at)) < 1e-9);
        }
    }
}
