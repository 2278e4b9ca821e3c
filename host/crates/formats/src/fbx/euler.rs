//! Rotations as angles about X, then Y, then Z, in degrees, without jumps from key to key.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat};

/// Nearer than this to a pole, the first and the last angle turn about the same axis.
const POLE: f64 = 1e-7;

/// The angles of a rotation, nearest to the `last` ones of the same joint (degrees).
pub(super) fn nearest_angles(rotation: DQuat, last: [f64; 3]) -> [f64; 3] {
    let last = last.map(f64::to_radians);
    let m = DMat3::from_quat(rotation);
    let level = libm::hypot(m.x_axis.x, m.x_axis.y);
    let y = libm::atan2(-m.x_axis.z, level);
    let x = if level > POLE { libm::atan2(m.y_axis.z, m.z_axis.z) } else { last[0] };
    // From the first angle, so that the three agree even at a pole.
    let (sin, cos) = (libm::sin(x), libm::cos(x));
    let z = libm::atan2(sin * m.z_axis.x - cos * m.y_axis.x, cos * m.y_axis.y - sin * m.z_axis.y);
    let [direct, around] = [[x, y, z], [x + PI, PI - y, z + PI]].map(|angles| unwound(angles, last));
    let distance = |angles: [f64; 3]| angles.iter().zip(last).map(|(a, b)| (a - b).abs()).sum::<f64>();
    let nearest = if distance(around) < distance(direct) { around } else { direct };
    nearest.map(f64::to_degrees)
}

/// The same angles, each within half a turn of the last.
fn unwound(angles: [f64; 3], last: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| angles[k] - TAU * libm::round((angles[k] - last[k]) / TAU))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation([x, y, z]: [f64; 3]) -> DQuat {
        let [x, y, z] = [x, y, z].map(f64::to_radians);
        DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
    }

    #[test]
    fn angles_give_the_rotation_back() {
        let steps = [-180.0, -117.0, -90.0, -30.0, 0.0, 1e-5, 45.0, 90.0, 179.0];
        for x in steps {
            for y in steps {
                for z in steps {
                    let turned = rotation([x, y, z]);
                    let angles = nearest_angles(turned, [10.0, -20.0, 30.0]);
                    let off = rotation(angles).angle_between(turned).to_degrees();
                    assert!(off < 1e-4, "{x} {y} {z}: {angles:?} are off by {off}");
                }
            }
        }
    }

    #[test]
    fn angles_go_on_through_turns_and_poles() {
        let mut last = [0.0; 3];
        for step in 0..800 {
            let next = nearest_angles(rotation([f64::from(step), 0.0, 0.0]), last);
            assert!(next.iter().zip(last).all(|(a, b)| (a - b).abs() < 1.001), "{last:?} to {next:?}");
            last = next;
        }
        assert!((last[0] - 799.0).abs() < 1e-6);
        last = [0.0; 3];
        for step in 0..180 {
            let next = nearest_angles(rotation([0.0, f64::from(step), 0.0]), last);
            assert!(next.iter().zip(last).all(|(a, b)| (a - b).abs() < 1.001), "{last:?} to {next:?}");
            last = next;
        }
    }
}
