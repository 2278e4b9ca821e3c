//! How a part is mounted, found from motions whose meaning is known.
//!
//! A part that is rotated relative to its nominal joint frame reports each motion about a rotated axis. Two motions
//! about different axes give the whole orientation: the rotation that takes the measured axes closest to the nominal
//! ones in the least-squares sense (Wahba's problem; for two axes of equal weight in closed form, after F. L. Markley,
//! *Attitude Determination Using Two Vector Measurements*, 1998).

use glam::{DMat3, DQuat, DVec3, Quat};

/// Axes closer together than this do not determine the rotation about them, radians.
const SAME_AXIS: f64 = 0.35;

/// How a part is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// `nominal_from_mounted`.
    pub rotation: Quat,
    /// The difference between the angle of the two measured axes and that of the two nominal ones, radians.
    pub residual: f64,
}

/// Why two motions do not determine a mounting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MountingError {
    /// The part turned about nearly the same axis both times.
    #[error("both motions turned it about nearly the same axis")]
    SameAxis,
    /// An axis is zero or not finite.
    #[error("a motion has no axis")]
    NoAxis,
}

/// The mounting from one motion: the shortest rotation that takes the measured axis to the nominal one. This is enough
/// for a part with a single sensor, which knows no other axis.
pub fn mounting_from_axis(measured: DVec3, meant: DVec3) -> Result<Mounting, MountingError> {
    let (measured, meant) = (unit(measured)?, unit(meant)?);
    Ok(Mounting { rotation: DQuat::from_rotation_arc(measured, meant).normalize().as_quat(), residual: 0.0 })
}

/// The mounting from two motions about different axes, each as measured by the part and as intended.
///
/// ```
/// use armature_rig::steps::mounting_from_axes;
/// use glam::{DVec3, Vec3};
///
/// let found = mounting_from_axes([DVec3::Z, DVec3::Y], [DVec3::X, DVec3::Y])?;
/// assert!((found.rotation * Vec3::Z).distance(Vec3::X) < 1e-6);
/// # Ok::<(), armature_rig::steps::MountingError>(())
/// ```
pub fn mounting_from_axes(measured: [DVec3; 2], meant: [DVec3; 2]) -> Result<Mounting, MountingError> {
    let measured = [unit(measured[0])?, unit(measured[1])?];
    let meant = [unit(meant[0])?, unit(meant[1])?];
    let residual = angle(measured) - angle(meant);
    let rotation = frame(meant)? * frame(measured)?.transpose();
    Ok(Mounting { rotation: DQuat::from_mat3(&rotation).normalize().as_quat(), residual: residual.abs() })
}

/// The axes' bisector, the direction across it in their plane, and the plane's normal.
fn frame([a, b]: [DVec3; 2]) -> Result<DMat3, MountingError> {
    if a.cross(b).length() < libm::sin(SAME_AXIS) {
        return Err(MountingError::SameAxis);
    }
    let along = (a + b).normalize();
    let across = (a - b).normalize();
    Ok(DMat3::from_cols(along, across, along.cross(across)))
}

fn angle([a, b]: [DVec3; 2]) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}

fn unit(axis: DVec3) -> Result<DVec3, MountingError> {
    axis.try_normalize().ok_or(MountingError::NoAxis)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_rotation() -> impl Strategy<Value = DQuat> {
        prop::array::uniform4(-1.0_f64..1.0)
            .prop_map(DQuat::from_array)
            .prop_filter("a rotation", |q| q.length() > 0.1)
            .prop_map(DQuat::normalize)
    }

    fn apart(a: Quat, b: DQuat) -> f64 {
        let d = a.as_dquat().inverse() * b;
        2.0 * libm::atan2(d.xyz().length(), d.w.abs())
    }

    #[test]
    fn what_tells_nothing_is_named() {
        let twice = [DVec3::X, DVec3::new(1.0, 0.1, 0.0)];
        assert_eq!(mounting_from_axes(twice, [DVec3::X, DVec3::Y]), Err(MountingError::SameAxis));
        let opposite = [DVec3::X, DVec3::NEG_X];
        assert_eq!(mounting_from_axes(opposite, [DVec3::X, DVec3::Y]), Err(MountingError::SameAxis));
        assert_eq!(mounting_from_axis(DVec3::ZERO, DVec3::X), Err(MountingError::NoAxis));
        assert_eq!(mounting_from_axis(DVec3::new(f64::NAN, 0.0, 0.0), DVec3::X), Err(MountingError::NoAxis));
    }

    proptest! {
        #[test]
        fn any_attitude_is_found_from_two_motions(mounted in any_rotation(), size in 0.3_f64..2.0) {
            let measured = [DVec3::X, DVec3::Y].map(|axis| mounted.inverse() * (axis * size));
            let found = mounting_from_axes(measured, [DVec3::X, DVec3::Y]).unwrap();
            prop_assert!(apart(found.rotation, mounted) < 1e-6 && found.residual < 1e-9);
        }

        /// Checked by search: no rotation near the one found brings the axes closer in the least-squares sense.
        #[test]
        fn with_motions_that_are_off_it_is_the_nearest(mounted in any_rotation(),
            off in prop::array::uniform6(-0.15_f64..0.15), nudge in prop::array::uniform3(-0.05_f64..0.05)) {
            let meant = [DVec3::X, DVec3::Y];
            let measured = [
                (mounted.inverse() * DVec3::X + DVec3::new(off[0], off[1], off[2])).normalize(),
                (mounted.inverse() * DVec3::Y + DVec3::new(off[3], off[4], off[5])).normalize(),
            ];
            let found = mounting_from_axes(measured, meant).unwrap().rotation.as_dquat();
            let loss = |q: DQuat| -> f64 { measured.iter().zip(meant).map(|(&a, b)| (q * a - b).length_squared()).sum() };
            let nudged = (DQuat::from_scaled_axis(DVec3::from_array(nudge)) * found).normalize();
            prop_assert!(loss(found) <= loss(nudged) + 1e-12);
        }

        #[test]
        fn one_axis_goes_where_it_is_meant_to(mounted in any_rotation()) {
            let measured = mounted.inverse() * DVec3::X;
            let found = mounting_from_axis(measured, DVec3::X).unwrap();
            prop_assert!((found.rotation.as_dquat() * measured).distance(DVec3::X) < 1e-6);
        }
    }
}
