//! From poses at true device times to a constant rate.

use std::ops::ControlFlow;

use armature_rig::{Motion, MotionError, Pose, Transform};
use glam::{DQuat, Quat, Vec3};

use super::low_pass::LowPass;
use super::timeline::Timeline;
use crate::file::same_bits;

/// Most bone transforms in a motion, frames times bones: 4.8 GB.
const MAX_TRANSFORMS: f64 = 1e8;

/// A frame this close to a recorded pose, in microseconds, is that pose to the bit.
const SAME_TIME_MICROS: f64 = 1e-3;

/// How to resample a take's poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResampleSettings {
    /// Frames per second of the result, exact whatever the take's own rate.
    pub frames_per_second: f64,
    /// First and last moment, seconds since the take's first sample; `None` for the start of the take up to its last
    /// pose.
    pub range_seconds: Option<(f64, f64)>,
    /// Between poses further apart than this, seconds, the earlier one is held: a slow glide through lost samples would
    /// be invented motion. The default, 0.1 s, bridges a few lost samples of the slowest device.
    pub hold_gaps_over_seconds: f64,
    /// Whether what is faster than half the frame rate is removed where the poses are denser than the frames, without
    /// lag. Otherwise such motion comes back as a slow wobble, but every frame at the time of a pose is that pose.
    pub low_pass: bool,
}

impl Default for ResampleSettings {
    fn default() -> Self {
        Self { frames_per_second: 30.0, range_seconds: None, hold_gaps_over_seconds: 0.1, low_pass: false }
    }
}

/// Why poses cannot be resampled to a constant rate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResampleError {
    /// There is no pose.
    #[error("the take has no poses; solve its samples again, or record with a character and a mapping")]
    NoPoses,
    /// The rate is invalid.
    #[error("{frames_per_second} frames a second is not a valid rate; give a positive number such as 24, 30 or 60")]
    BadRate {
        /// The value given.
        frames_per_second: f64,
    },
    /// The range is invalid.
    #[error("{start} s to {end} s is not a valid time range; give a start and an end that is not before it")]
    BadRange {
        /// Start given, seconds.
        start: f64,
        /// End given, seconds.
        end: f64,
    },
    /// More than fits in memory.
    #[error("{frames} frames of {bones} bones are too many; give a lower rate")]
    TooMany {
        /// Frames requested.
        frames: f64,
        /// Bones of the skeleton.
        bones: usize,
    },
    /// A recorded pose holds NaN or infinity.
    #[error("{0}; the take has a broken pose there")]
    Motion(#[from] MotionError),
    /// The callback asked to stop.
    #[error("the resampling was cancelled")]
    Cancelled,
}

/// A time without poses, in seconds since the take's first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldGap {
    /// The pose that is held.
    pub start_seconds: f64,
    /// The next pose.
    pub end_seconds: f64,
}

/// A motion, and which parts of it were not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// One pose per frame; `frame_seconds` is the reciprocal of the requested rate.
    pub motion: Motion,
    /// Time of the first frame, seconds since the take's first sample. Frame n is n / rate after it.
    pub start_seconds: f64,
    /// Gaps within the range in which the earlier pose is held.
    pub held_gaps: Vec<HeldGap>,
    /// Frames before the first pose, which show that pose.
    pub frames_before_first: usize,
    /// Frames after the last pose, which show that pose.
    pub frames_after_last: usize,
}

/// Resamples poses to a constant rate: rotations along the shorter great arc, translations and scales along a straight
/// line between the two neighbours in time. Without the low-pass, a frame at the time of a pose is that pose to the bit.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn resample(
    timeline: &Timeline<'_>,
    settings: &ResampleSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Resampled, ResampleError> {
    let (first, last) = timeline.span_seconds().ok_or(ResampleError::NoPoses)?;
    let (start_seconds, end) = settings.range_seconds.unwrap_or((0.0, last.max(0.0)));
    let frame_count = frame_count(settings.frames_per_second, start_seconds, end, timeline.skeleton().len())?;
    let hold_over_micros = settings.hold_gaps_over_seconds.max(0.0) * 1e6;
    let mut walk = Walk::new(timeline);
    let mut low_pass = settings.low_pass.then(|| LowPass::new(timeline, settings.frames_per_second, hold_over_micros));
    let mut frames = Vec::with_capacity(frame_count);
    let mut held_gaps: Vec<HeldGap> = Vec::new();
    let (mut frames_before_first, mut frames_after_last) = (0, 0);
    for frame in 0..frame_count {
        let seconds = start_seconds + frame as f64 / settings.frames_per_second;
        let micros = seconds * 1e6;
        walk.go_to(micros);
        if walk.gap_micros() > hold_over_micros && !walk.at_a_pose(micros) {
            let gap = walk.gap();
            if micros > walk.before_micros() && held_gaps.last() != Some(&gap) {
                held_gaps.push(gap);
            }
            frames.push(walk.before.clone());
        } else {
            let pose = walk.blend(micros);
            frames.push(match &mut low_pass {
                Some(low_pass) => low_pass.pose(micros, pose),
                None => pose,
            });
        }
        frames_before_first += usize::from(micros < first * 1e6 - SAME_TIME_MICROS);
        frames_after_last += usize::from(micros > last * 1e6 + SAME_TIME_MICROS);
        if frame.is_multiple_of(256) && progress("resampling", frame as f64 / frame_count as f64).is_break() {
            return Err(ResampleError::Cancelled);
        }
    }
    let motion = Motion::new(timeline.skeleton().clone(), 1.0 / settings.frames_per_second, frames)?;
    Ok(Resampled { motion, start_seconds, held_gaps, frames_before_first, frames_after_last })
}

fn frame_count(rate: f64, start: f64, end: f64, bones: usize) -> Result<usize, ResampleError> {
    if !(rate.is_finite() && rate > 0.0 && (1.0 / rate).is_finite() && 1.0 / rate > 0.0) {
        return Err(ResampleError::BadRate { frames_per_second: rate });
    }
    if !(start.is_finite() && end.is_finite() && end >= start) {
        return Err(ResampleError::BadRange { start, end });
    }
    // A millionth of a frame more, so that 2 s at 30 frames a second end with frame 60 despite rounding.
    let frames = ((end - start) * rate + 1e-6).floor() + 1.0;
    if frames.is_nan() || frames * bones.max(1) as f64 > MAX_TRANSFORMS {
        return Err(ResampleError::TooMany { frames, bones });
    }
    Ok(frames as usize)
}

/// The two poses around a time that only moves forward.
#[derive(Debug)]
struct Walk<'t, 'a> {
    timeline: &'a Timeline<'t>,
    index: usize,
    before: Pose,
    after: Pose,
}

impl<'t, 'a> Walk<'t, 'a> {
    fn new(timeline: &'a Timeline<'t>) -> Self {
        let mut walk = Self { timeline, index: 0, before: Pose::default(), after: Pose::default() };
        walk.unpack();
        walk
    }

    fn go_to(&mut self, micros: f64) {
        let ahead = &self.timeline.moments()[self.index + 1..];
        let steps = ahead.partition_point(|moment| moment.micros as f64 <= micros + SAME_TIME_MICROS);
        if steps > 0 {
            self.index += steps;
            self.unpack();
        }
    }

    fn unpack(&mut self) {
        let moments = self.timeline.moments();
        moments[self.index].pose.unpack(self.timeline.skeleton(), &mut self.before);
        if let Some(next) = moments.get(self.index + 1) {
            next.pose.unpack(self.timeline.skeleton(), &mut self.after);
        }
    }

    fn before_micros(&self) -> f64 {
        self.timeline.moments()[self.index].micros as f64
    }

    /// Time to the next pose; zero after the last one.
    fn gap_micros(&self) -> f64 {
        let gap = self.gap();
        (gap.end_seconds - gap.start_seconds) * 1e6
    }

    fn gap(&self) -> HeldGap {
        let moments = self.timeline.moments();
        let next = moments.get(self.index + 1).unwrap_or(&moments[self.index]);
        HeldGap { start_seconds: moments[self.index].seconds(), end_seconds: next.seconds() }
    }

    fn at_a_pose(&self, micros: f64) -> bool {
        micros <= self.before_micros() + SAME_TIME_MICROS
    }

    fn blend(&self, micros: f64) -> Pose {
        let gap = self.gap_micros();
        if self.at_a_pose(micros) || gap <= 0.0 {
            return self.before.clone();
        }
        let part = ((micros - self.before_micros()) / gap).clamp(0.0, 1.0);
        let pairs = self.before.parent_from_bone.iter().zip(&self.after.parent_from_bone);
        Pose { parent_from_bone: pairs.map(|(a, b)| between(a, b, part)).collect() }
    }
}

/// The transform at the fraction `part` (0 to 1) of the way from `a` to `b`.
pub(crate) fn between(a: &Transform, b: &Transform, part: f64) -> Transform {
    if same_bits(a, b) {
        return *a;
    }
    Transform {
        translation: on_the_line(a.translation, b.translation, part),
        rotation: on_the_arc(a.rotation, b.rotation, part),
        scale: on_the_line(a.scale, b.scale, part),
    }
}

fn on_the_line(a: Vec3, b: Vec3, part: f64) -> Vec3 {
    a.as_dvec3().lerp(b.as_dvec3(), part).as_vec3()
}

fn on_the_arc(a: Quat, b: Quat, part: f64) -> Quat {
    let (a, b): (DQuat, DQuat) = (a.as_dquat().normalize(), b.as_dquat().normalize());
    a.slerp(b, part).normalize().as_quat()
}
