//! A camera that orbits its target.

use glam::camera::rh::proj::directx::perspective;
use glam::camera::rh::view::look_at_mat4;
use glam::{Mat4, Vec2, Vec3};

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest box around all finite points; `None` without any.
    pub fn of(points: &[[f32; 3]]) -> Option<Self> {
        let mut finite = points.iter().map(|&p| Vec3::from(p)).filter(|p| p.is_finite());
        let first = finite.next()?;
        let start = Self { min: first, max: first };
        Some(finite.fold(start, |b, p| Self { min: b.min.min(p), max: b.max.max(p) }))
    }

    /// The middle.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Edge lengths.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Half the diagonal, never zero.
    pub fn radius(&self) -> f32 {
        (self.size().length() * 0.5).max(1e-6)
    }
}

/// A perspective camera on a sphere around its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The point looked at, world space.
    pub target: Vec3,
    /// Radians about +Y; 0 looks along −Z, into the face of a character that looks along +Z.
    pub yaw: f32,
    /// Radians above the horizon.
    pub pitch: f32,
    /// From the eye to the target, world units.
    pub distance: f32,
    /// Vertical field of view, radians.
    pub fov_y: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self { target: Vec3::ZERO, yaw: 0.45, pitch: 0.16, distance: 4.0, fov_y: 0.55 }
    }
}

impl Camera {
    /// Steepest look from above or below, radians.
    pub const PITCH_LIMIT: f32 = 1.5;

    /// A camera that shows the whole box in a picture with this aspect ratio (width / height), from the default
    /// direction.
    pub fn fit(bounds: &Bounds, aspect: f32) -> Self {
        let mut camera = Self::default();
        camera.frame(bounds, aspect);
        camera
    }

    /// Moves target and distance so that the whole box is visible; keeps the direction.
    pub fn frame(&mut self, bounds: &Bounds, aspect: f32) {
        let half_y = (self.fov_y * 0.5).tan();
        let half_x = half_y * aspect.clamp(0.05, 20.0);
        let (right, up, forward) = self.basis();
        let half = bounds.size() * 0.5;
        let mut distance = bounds.radius() * 0.05;
        for corner in 0..8 {
            let sign = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
            let offset = half * Vec3::new(sign(1), sign(2), sign(4));
            let needed = (offset.dot(right).abs() / half_x).max(offset.dot(up).abs() / half_y);
            distance = f32::max(distance, needed - offset.dot(forward));
        }
        self.target = bounds.center();
        self.distance = distance * 1.12;
    }

    /// Where the eye is, world space.
    pub fn eye(&self) -> Vec3 {
        self.target - self.basis().2 * self.distance
    }

    /// Unit vectors to the picture's right, its top, and into it.
    pub fn basis(&self) -> (Vec3, Vec3, Vec3) {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        let forward = -Vec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
        let right = Vec3::new(cos_yaw, 0.0, -sin_yaw);
        (right, right.cross(forward), forward)
    }

    /// The projection that wgpu uses (as in DirectX): depth 0 (near) to 1 (far), +Y up.
    pub fn clip_from_world(&self, aspect: f32) -> Mat4 {
        let (_, up, _) = self.basis();
        let view = look_at_mat4(self.eye(), self.target, up);
        let near = self.distance * 0.01;
        perspective(self.fov_y, aspect, near, self.distance * 200.0) * view
    }

    /// Turns by a drag, in points; 300 points are a quarter turn.
    pub fn orbit(&mut self, drag: Vec2) {
        const RADIANS_PER_POINT: f32 = std::f32::consts::FRAC_PI_2 / 300.0;
        self.yaw = (self.yaw - drag.x * RADIANS_PER_POINT).rem_euclid(std::f32::consts::TAU);
        self.pitch = (self.pitch + drag.y * RADIANS_PER_POINT).clamp(-Self::PITCH_LIMIT, Self::PITCH_LIMIT);
    }

    /// Moves closer (factor below 1) or away, within sensible limits for something of this radius.
    pub fn zoom(&mut self, factor: f32, radius: f32) {
        if factor.is_finite() && factor > 0.0 {
            self.distance = (self.distance * factor).clamp(radius * 0.1, radius * 50.0);
        }
    }

    /// Pans by a drag, so that the point under the pointer stays under it (at the target's depth).
    pub fn pan(&mut self, drag: Vec2, viewport_height: f32) {
        let (right, up, _) = self.basis();
        let world_per_point = 2.0 * self.distance * (self.fov_y * 0.5).tan() / viewport_height.max(1.0);
        self.target += (up * drag.y - right * drag.x) * world_per_point;
    }

    /// Where a world point appears, 0 to 1 from the upper left; `None` behind the eye.
    pub fn project(&self, point: Vec3, aspect: f32) -> Option<Vec2> {
        let clip = self.clip_from_world(aspect) * point.extend(1.0);
        (clip.w > 0.0).then(|| Vec2::new(clip.x / clip.w * 0.5 + 0.5, 0.5 - clip.y / clip.w * 0.5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fit_shows_every_corner_and_little_more() {
        let bounds = Bounds { min: Vec3::new(-0.9, 0.0, -0.2), max: Vec3::new(0.9, 1.8, 0.3) };
        for aspect in [0.5, 1.0, 1.78] {
            let camera = Camera::fit(&bounds, aspect);
            let mut reach = 0.0_f32;
            for corner in 0..8 {
                let pick = |bit: u32, axis: usize| if corner & bit == 0 { bounds.min[axis] } else { bounds.max[axis] };
                let seen = camera.project(Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2)), aspect).unwrap();
                reach = reach.max((seen - 0.5).abs().max_element());
            }
            assert!((0.40..0.5).contains(&reach), "aspect {aspect}: {reach}");
        }
    }

    #[test]
    fn pan_keeps_the_point_under_the_pointer() {
        let mut camera = Camera { target: Vec3::new(0.3, 1.0, -0.2), ..Camera::default() };
        let point = camera.target;
        camera.pan(Vec2::new(80.0, -50.0), 400.0);
        let seen = camera.project(point, 2.0).unwrap();
        assert!((seen * Vec2::new(800.0, 400.0)).distance(Vec2::new(480.0, 150.0)) < 0.1, "{seen}");
    }

    #[test]
    fn dragging_up_never_turns_over() {
        let mut camera = Camera::default();
        camera.orbit(Vec2::new(0.0, 1e6));
        assert!(camera.pitch <= Camera::PITCH_LIMIT && camera.eye().is_finite());
        camera.zoom(f32::NAN, 1.0);
        assert!(camera.distance.is_finite());
    }

    #[test]
    fn bounds_ignore_what_is_no_number() {
        let bounds = Bounds::of(&[[f32::NAN, 0.0, 0.0], [1.0, 2.0, 3.0], [-1.0, 0.0, f32::INFINITY]]).unwrap();
        assert_eq!((bounds.min, bounds.max), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(Bounds::of(&[[f32::NAN; 3]]), None);
    }
}
