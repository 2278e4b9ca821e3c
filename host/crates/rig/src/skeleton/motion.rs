//! A pose for every frame of a clip.

use super::bones::Skeleton;
use super::transforms::Pose;

/// Poses at a constant rate on one skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The bones that move.
    pub skeleton: Skeleton,
    /// Seconds from one frame to the next.
    pub frame_seconds: f64,
    /// One pose per frame.
    pub frames: Vec<Pose>,
}

/// Why poses are not a motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The time between frames is zero, negative or NaN.
    #[error("a frame lasts {seconds} s; it must be a positive number")]
    BadFrameTime {
        /// The value given.
        seconds: f64,
    },
    /// A frame has a different number of bones than the skeleton.
    #[error("frame {frame} moves {got} bones, but the skeleton has {expected}")]
    BoneCount {
        /// Zero-based frame.
        frame: usize,
        /// Bones in the frame.
        got: usize,
        /// Bones in the skeleton.
        expected: usize,
    },
    /// A frame holds NaN or infinity.
    #[error("frame {frame}, bone {bone}: not a finite number")]
    NotFinite {
        /// Zero-based frame.
        frame: usize,
        /// Zero-based bone.
        bone: usize,
    },
}

impl Motion {
    /// Checks the frames and builds the motion.
    pub fn new(skeleton: Skeleton, frame_seconds: f64, frames: Vec<Pose>) -> Result<Self, MotionError> {
        if !(frame_seconds.is_finite() && frame_seconds > 0.0) {
            return Err(MotionError::BadFrameTime { seconds: frame_seconds });
        }
        for (frame, pose) in frames.iter().enumerate() {
            if pose.parent_from_bone.len() != skeleton.len() {
                return Err(MotionError::BoneCount {
                    frame,
                    got: pose.parent_from_bone.len(),
                    expected: skeleton.len(),
                });
            }
            if let Some(bone) = pose.parent_from_bone.iter().position(|t| !t.is_finite()) {
                return Err(MotionError::NotFinite { frame, bone });
            }
        }
        Ok(Self { skeleton, frame_seconds, frames })
    }

    /// Time of the last frame in seconds.
    pub fn duration_seconds(&self) -> f64 {
        self.frames.len().saturating_sub(1) as f64 * self.frame_seconds
    }
}
