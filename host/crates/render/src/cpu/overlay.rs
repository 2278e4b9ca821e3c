//! Twin of `shader/overlay.wgsl`.

use glam::{Vec3, Vec4, Vec4Swizzles as _};

use super::sampling::saturate;
use crate::bone_shape::OverlayVertex;
use crate::uniforms::Uniforms;

/// Linear colour and opacity of a corner.
pub(crate) fn vertex(u: &Uniforms, corner: &OverlayVertex) -> Vec4 {
    let to_eye = (u.eye.xyz() - Vec3::from(corner.position)).normalize_or_zero();
    let shade = 0.4 + 0.6 * saturate(Vec3::from(corner.normal).dot(to_eye));
    let color = Vec4::from(corner.color);
    (color.xyz() * shade).extend(color.w)
}
