//! Twin of `shader/mesh.wgsl`.

use glam::{Vec2, Vec3, Vec4Swizzles as _};

use super::sampling::{TextureSampler, mix, saturate};
use crate::MeshView;
use crate::srgb::linear_from_srgb;
use crate::uniforms::Uniforms;

/// What the vertex stage passes to the fragment stage, interpolated.
pub(crate) struct Surface {
    world: Vec3,
    normal: Vec3,
    uv: Vec2,
    color: Vec3,
    highlight: f32,
    /// Perpendicular to the triangle, towards the eye; of any length.
    seen_side: Vec3,
}

/// A point of a triangle, by the weights of its corners.
pub(crate) fn interpolate(mesh: &MeshView, triangle: u32, front: bool, weights: Vec3) -> Surface {
    let corners = mesh.triangles[triangle as usize].map(|c| c as usize);
    let blend = |of: &dyn Fn(usize) -> Vec3| {
        of(corners[0]) * weights.x + of(corners[1]) * weights.y + of(corners[2]) * weights.z
    };
    let [a, b, c] = corners.map(|c| Vec3::from(mesh.positions[c]));
    let outwards = (b - a).cross(c - a);
    Surface {
        seen_side: if front { outwards } else { -outwards },
        world: blend(&|c| Vec3::from(mesh.positions[c])),
        normal: blend(&|c| Vec3::from(mesh.normals[c])),
        uv: mesh.uv.map_or(Vec2::ZERO, |uv| blend(&|c| Vec2::from(uv[c]).extend(0.0)).truncate()),
        color: mesh.colors.map_or(Vec3::ONE, |all| blend(&|c| all[c].map(linear_from_srgb).into())),
        highlight: mesh.highlight.map_or(0.0, |h| blend(&|c| Vec3::splat(h[c])).x),
    }
}

/// The material that a part is drawn with.
pub(crate) struct Paint<'a> {
    /// Linear light.
    pub(crate) base_color: Vec3,
    pub(crate) texture: TextureSampler<'a>,
}

/// Linear light reflected by the surface towards the eye.
pub(crate) fn fragment(u: &Uniforms, paint: &Paint, surface: &Surface) -> Vec3 {
    let texel = paint.texture.sample(surface.uv);
    let base = mix(paint.base_color * surface.color * texel, u.highlight.xyz(), saturate(surface.highlight) * 0.75);
    let to_eye = (u.eye.xyz() - surface.world).normalize_or_zero();
    let shading = surface.normal.normalize_or_zero();
    let normal = if shading.dot(surface.seen_side) >= 0.0 { shading } else { -shading };
    let facing = saturate(normal.dot(to_eye));
    let above = saturate((surface.world.y - u.ground.x) / (0.5 * u.ground.z));
    let openness = 1.0 + (0.45 + 0.55 * above - 1.0) * saturate(0.5 - 0.5 * normal.y);
    let ambient = mix(u.bounce.xyz(), u.sky.xyz(), 0.5 + 0.5 * normal.y) * openness;
    let key = wrapped(normal.dot(u.key_direction.xyz()), 0.05);
    let fill = wrapped(normal.dot(u.fill_direction.xyz()), 0.45);
    let edge = (1.0 - facing).powi(3);
    let rim = edge * saturate(0.35 + 0.65 * normal.dot(u.rim_direction.xyz()));
    let diffuse = base * (ambient + u.key_color.xyz() * key + u.fill_color.xyz() * fill);
    let gloss = u.key_color.xyz() * specular(normal, to_eye, u.key_direction.xyz());
    diffuse + gloss + u.rim_color.xyz() * rim
}

fn wrapped(cosine: f32, wrap: f32) -> f32 {
    saturate((cosine + wrap) / (1.0 + wrap))
}

fn specular(normal: Vec3, to_eye: Vec3, to_light: Vec3) -> f32 {
    let half_way = (to_eye + to_light).normalize_or_zero();
    let fresnel = 0.04 + 0.96 * (1.0 - saturate(to_eye.dot(half_way))).powi(5);
    fresnel * 1.3 * saturate(normal.dot(half_way)).powf(22.0) * saturate(normal.dot(to_light))
}
