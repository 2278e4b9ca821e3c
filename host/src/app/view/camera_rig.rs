//! The camera glides to its destination.

use armature_render::{Bounds, Camera};

/// How much of the distance is left after a second, as a power of e.
const HASTE: f32 = 14.0;

/// Where the camera is and where it is going.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CameraRig {
    pub(super) now: Camera,
    pub(super) goal: Camera,
}

impl CameraRig {
    /// Jumps to the destination.
    pub(super) fn cut_to(&mut self, bounds: &Bounds, aspect: f32) {
        self.goal.frame(bounds, aspect);
        self.now = self.goal;
    }

    /// Moves for this many seconds. Returns whether there is further to go.
    pub(super) fn glide(&mut self, seconds: f32) -> bool {
        let share = 1.0 - (-HASTE * seconds.clamp(0.0, 0.1)).exp();
        let (now, goal) = (&mut self.now, &self.goal);
        // The short way round.
        let turn = (goal.yaw - now.yaw + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI;
        now.yaw += turn * share;
        now.pitch += (goal.pitch - now.pitch) * share;
        now.distance += (goal.distance - now.distance) * share;
        now.target += (goal.target - now.target) * share;
        let far = turn.abs() + (goal.pitch - now.pitch).abs() > 1e-3
            || now.target.distance(goal.target) + (now.distance - goal.distance).abs() > goal.distance * 1e-3;
        if !far {
            *now = *goal;
        }
        far
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn it_arrives_and_stops() {
        let mut rig = CameraRig::default();
        rig.goal.yaw = 6.2;
        rig.goal.target = Vec3::new(1.0, 2.0, 3.0);
        let steps = (0..200).take_while(|_| rig.glide(1.0 / 60.0)).count();
        assert!(steps < 120 && rig.now == rig.goal, "{steps}");
    }
}
