//! What a picture's shaders and their twins read: camera, lights, colours.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};

use crate::contact_shadow::ContactShadow;
use crate::srgb::linear_from_srgb;
use crate::{Camera, Scene};

/// The struct of `shader/common.wgsl`, field by field; the comments are there.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Uniforms {
    pub(crate) clip_from_world: Mat4,
    pub(crate) eye: Vec4,
    pub(crate) ray_forward: Vec4,
    pub(crate) ray_right: Vec4,
    pub(crate) ray_up: Vec4,
    pub(crate) viewport: Vec4,
    pub(crate) ground: Vec4,
    pub(crate) ground_center: Vec4,
    pub(crate) shadow: Vec4,
    pub(crate) backdrop_top: Vec4,
    pub(crate) backdrop_horizon: Vec4,
    pub(crate) floor: Vec4,
    pub(crate) grid: Vec4,
    pub(crate) highlight: Vec4,
    pub(crate) sky: Vec4,
    pub(crate) bounce: Vec4,
    pub(crate) key_direction: Vec4,
    pub(crate) key_color: Vec4,
    pub(crate) fill_direction: Vec4,
    pub(crate) fill_color: Vec4,
    pub(crate) rim_direction: Vec4,
    pub(crate) rim_color: Vec4,
}

impl Uniforms {
    pub(crate) fn new(scene: &Scene, camera: &Camera, shadow: &ContactShadow, size: [u32; 2]) -> Self {
        let [width, height] = size.map(|side| side.max(1) as f32);
        let aspect = width / height;
        let (right, up, forward) = camera.basis();
        let eye = camera.eye();
        let half = (camera.fov_y * 0.5).tan();
        let ground = &scene.ground;
        let radius = ground.radius.max(1e-6);
        // The lights are placed around the character relative to the camera's heading, so that it is well lit from all
        // sides.
        let (sin, cos) = camera.yaw.sin_cos();
        let towards = |x: f32, y: f32, z: f32| {
            (Vec3::new(cos, 0.0, -sin) * x + Vec3::Y * y + Vec3::new(sin, 0.0, cos) * z).normalize()
        };
        Self {
            clip_from_world: camera.clip_from_world(aspect),
            eye: eye.extend(0.0),
            ray_forward: forward.extend(0.0),
            ray_right: (right * half * aspect).extend(0.0),
            ray_up: (up * half).extend(0.0),
            viewport: Vec4::new(width, height, 1.0 / width, 1.0 / height),
            ground: Vec4::new(ground.height, grid_cell(radius), radius, f32::from(eye.y > ground.height)),
            ground_center: Vec4::new(ground.center.x, ground.center.z, 0.0, 0.0),
            shadow: Vec4::new(shadow.center[0], shadow.center[1], shadow.half_side, scene.look.shadow),
            backdrop_top: linear(scene.look.backdrop_top),
            backdrop_horizon: linear(scene.look.backdrop_horizon),
            floor: linear(scene.look.floor),
            grid: linear(scene.look.grid),
            highlight: linear(scene.look.highlight),
            sky: Vec4::new(0.085, 0.105, 0.145, 0.0),
            bounce: Vec4::new(0.040, 0.036, 0.036, 0.0),
            key_direction: towards(-0.80, 0.78, 0.42).extend(0.0),
            key_color: Vec4::new(1.12, 1.03, 0.90, 0.0),
            fill_direction: towards(0.85, 0.18, 0.50).extend(0.0),
            fill_color: Vec4::new(0.10, 0.15, 0.23, 0.0),
            rim_direction: towards(0.45, 0.55, -0.70).extend(0.0),
            rim_color: Vec4::new(0.60, 0.72, 0.90, 0.0),
        }
    }
}

/// A round length near two fifths of the character's radius: 1, 2 or 5 times a power of ten.
fn grid_cell(radius: f32) -> f32 {
    let wanted = radius * 0.4;
    let power = 10.0_f32.powf(wanted.log10().floor());
    let step = match wanted / power {
        x if x < 1.5 => 1.0,
        x if x < 3.5 => 2.0,
        x if x < 7.5 => 5.0,
        _ => 10.0,
    };
    step * power
}

fn linear(srgb: [f32; 3]) -> Vec4 {
    Vec3::from(srgb.map(linear_from_srgb)).extend(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_cells_are_round() {
        for (radius, cell) in [(1.0, 0.5), (0.1, 0.05), (90.0, 50.0), (250.0, 100.0), (4.5, 2.0)] {
            assert!((grid_cell(radius) / cell - 1.0).abs() < 1e-4, "{radius}: {}", grid_cell(radius));
        }
    }

    #[test]
    fn rays_and_projection_agree() {
        let camera = Camera { target: Vec3::new(0.2, 0.9, 0.1), yaw: 1.1, pitch: 0.4, ..Camera::default() };
        let uniforms = Uniforms::new(&Scene::default(), &camera, &ContactShadow::default(), [400, 300]);
        let ray = (uniforms.ray_forward + uniforms.ray_right * 0.5 + uniforms.ray_up * -0.25).truncate();
        let seen = camera.project(camera.eye() + ray * 3.0, 400.0 / 300.0).unwrap();
        assert!((seen - glam::Vec2::new(0.75, 0.625)).length() < 1e-4, "{seen}");
    }
}
