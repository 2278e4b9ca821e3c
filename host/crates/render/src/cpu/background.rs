//! Twin of `shader/background.wgsl`.

use glam::{Vec2, Vec3, Vec3Swizzles as _, Vec4Swizzles as _};

use super::sampling::{mix, shadow_at, smoothstep};
use crate::contact_shadow::ContactShadow;
use crate::uniforms::Uniforms;

/// Linear light of the backdrop or floor seen through a pixel.
pub(crate) fn fragment(u: &Uniforms, shadow: &ContactShadow, pixel: [f32; 2]) -> Vec3 {
    let pixel = Vec2::from(pixel);
    let ray = ray_through(u, pixel);
    let elevation = ray.normalize().y;
    let rise = smoothstep(0.0, 0.45, elevation);
    let mut color = mix(u.backdrop_horizon.xyz(), u.backdrop_top.xyz(), rise);
    if u.ground.w > 0.5 && elevation < -1e-4 {
        let point = floor_point(u, ray);
        let away = (point - u.ground_center.xy()) / u.ground.z;
        let falloff = away.dot(away);
        let pool = (-falloff / 5.0).exp();
        color = mix(u.backdrop_horizon.xyz(), u.floor.xyz() * (1.0 + 0.9 * (-falloff / 1.1).exp()), pool);
        let right = ray_through(u, pixel + Vec2::X);
        let down = ray_through(u, pixel + Vec2::Y);
        if right.y < 0.0 && down.y < 0.0 {
            let across = (floor_point(u, right) - point).abs() + (floor_point(u, down) - point).abs();
            let minor = grid_lines(point, across, u.ground.y);
            let major = grid_lines(point, across, u.ground.y * 5.0);
            let strength = (minor * 0.22).max(major * 0.42) * (-falloff / 7.0).exp();
            color = mix(color, u.grid.xyz(), strength);
        }
        let texel = (point - u.shadow.xy()) / (2.0 * u.shadow.z) + 0.5;
        if texel.cmpgt(Vec2::ZERO).all() && texel.cmplt(Vec2::ONE).all() {
            color *= 1.0 - u.shadow.w * shadow_at(shadow, texel);
        }
    }
    let corner = (pixel * u.viewport.zw() - 0.5) * 1.25;
    color * (1.0 - 0.45 * corner.dot(corner))
}

fn ray_through(u: &Uniforms, pixel: Vec2) -> Vec3 {
    let x = pixel.x * u.viewport.z * 2.0 - 1.0;
    let y = 1.0 - pixel.y * u.viewport.w * 2.0;
    u.ray_forward.xyz() + u.ray_right.xyz() * x + u.ray_up.xyz() * y
}

/// x, z on the floor.
fn floor_point(u: &Uniforms, ray: Vec3) -> Vec2 {
    let travel = (u.ground.x - u.eye.y) / ray.y;
    u.eye.xz() + ray.xz() * travel
}

fn grid_lines(point: Vec2, across: Vec2, cell: f32) -> f32 {
    let coordinate = point / cell;
    let pixel = across / cell;
    let shifted = coordinate - 0.5;
    let distance = (shifted - shifted.floor() - 0.5).abs();
    let line = |d: f32, width: f32| 1.0 - smoothstep(0.0, (width * 1.3).max(1e-6), d);
    let calm = |width: f32| 1.0 - smoothstep(0.1, 0.4, width);
    (line(distance.x, pixel.x) * calm(pixel.x)).max(line(distance.y, pixel.y) * calm(pixel.y))
}
