//! A bone that rests otherwise than in the character's rest pose.

use glam::{DQuat, DVec3, Quat, Vec3};

/// A bone turned from the character's rest pose to that of the puppet, together with all bones below it.
#[derive(Clone, Debug, PartialEq)]
pub struct RestTurn {
    /// The bone, by its name.
    pub bone: String,
    /// The axis through the bone's head, times the angle in degrees. In the model's frame: +X to the character's left, +Y
    /// up, +Z where it looks.
    pub degrees: Vec3,
}

impl RestTurn {
    /// The rotation, in the model's frame; `None` if it is not finite.
    pub fn rotation(&self) -> Option<Quat> {
        let vector = self.degrees.as_dvec3() * std::f64::consts::PI / 180.0;
        let angle = vector.length();
        if !angle.is_finite() {
            return None;
        }
        let axis = vector.try_normalize().unwrap_or(DVec3::X);
        let (sin, cos) = libm::sincos(0.5 * angle);
        let v = axis * sin;
        Some(DQuat::from_xyzw(v.x, v.y, v.z, cos).as_quat().normalize())
    }

    /// By how much, in degrees.
    pub fn angle(&self) -> f32 {
        self.degrees.length()
    }
}
