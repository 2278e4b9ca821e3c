//! Recorded rotations of joints.

use crate::rotation::Rotation;

/// What comes after a track's last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrackEnd {
    /// The last frame, forever.
    #[default]
    Hold,
    /// The first frame again, one frame time later.
    Repeat,
}

/// Joint rotations at a constant frame rate; between frames each joint turns uniformly along the shortest path.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTrack {
    /// Seconds from one frame to the next, positive.
    pub frame_seconds: f64,
    /// The parts that move, as indices into the body; all others stay at rest.
    pub parts: Vec<usize>,
    /// Frame by frame, one rotation for each of `parts`: the joint's rotation away from rest in its own frame (+Y along
    /// the part, +X the bend axis), a unit quaternion (x, y, z, w).
    pub rotations: Vec<Rotation>,
    /// What happens after the last frame.
    pub end: TrackEnd,
}

impl JointTrack {
    /// Number of whole frames in the track.
    pub fn frame_count(&self) -> usize {
        self.rotations.len().checked_div(self.parts.len()).unwrap_or(0)
    }

    /// The frame at or before a time, the fraction of the way to the next one, and that next frame.
    pub(super) fn place(&self, seconds: f64) -> (usize, f64, usize) {
        let frames = self.frame_count();
        let last = frames.saturating_sub(1);
        let at = (seconds / self.frame_seconds).max(0.0);
        let whole = libm::floor(at);
        match self.end {
            TrackEnd::Hold if whole >= last as f64 => (last, 0.0, last),
            TrackEnd::Hold => (whole as usize, at - whole, whole as usize + 1),
            TrackEnd::Repeat => {
                let frame = (whole % frames.max(1) as f64) as usize;
                (frame, at - whole, (frame + 1) % frames.max(1))
            }
        }
    }
}
