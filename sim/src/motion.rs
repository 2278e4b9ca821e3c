//! How the puppet is moved: at rest, by a rule, or along a recorded track.

use crate::body::Body;
use crate::procedural::{Procedure, Role, target};
use crate::rotation::{IDENTITY, Rotation, between, normalized, to_sensor_angles};

/// For how long a motion by rule grows from the rest pose to its full size, seconds.
const GROW_SECONDS: f64 = 0.5;

/// What moves the puppet.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Motion {
    /// Nothing.
    #[default]
    Rest,
    /// Walking on the spot.
    Walk,
    /// Waving the right arm (a spider its front legs, a hand its fingers).
    Wave,
    /// Walking and waving.
    WalkAndWave,
    /// Every sensor in turn, a second each.
    Wiggle,
    /// Every joint from rest to one stop, to the other and back, as for a calibration.
    Sweep,
    /// Recorded rotations.
    Track(JointTrack),
}

impl Motion {
    /// The motion with this name: `rest`, `walk`, `wave`, `walk+wave`, `wiggle`, `sweep`.
    pub fn by_name(name: &str) -> Option<Self> {
        Some(match name {
            "rest" => Self::Rest,
            "walk" => Self::Walk,
            "wave" => Self::Wave,
            "walk+wave" => Self::WalkAndWave,
            "wiggle" => Self::Wiggle,
            "sweep" => Self::Sweep,
            _ => return None,
        })
    }
}

/// What comes after a track's last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrackEnd {
    /// The last frame, for ever.
    #[default]
    Hold,
    /// The first frame again, one frame later.
    Repeat,
}

/// Rotations of joints at a constant rate; between frames each turns evenly along the shortest way.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTrack {
    /// Seconds from one frame to the next, positive.
    pub frame_seconds: f64,
    /// The parts that move, as indices into the body; all others rest.
    pub parts: Vec<usize>,
    /// Frame by frame one rotation for each of `parts`: the joint's turn away from rest in its own frame (+Y along the
    /// part, +X the bend axis), a unit quaternion (x, y, z, w).
    pub rotations: Vec<Rotation>,
    /// What comes after the last frame.
    pub end: TrackEnd,
}

impl JointTrack {
    /// Whole frames in the track.
    pub fn frame_count(&self) -> usize {
        self.rotations.len().checked_div(self.parts.len()).unwrap_or(0)
    }

    /// The frame at or before a time, how far it is on the way to the one after, and that one.
    fn place(&self, seconds: f64) -> (usize, f64, usize) {
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

/// A motion prepared for one body.
#[derive(Clone, Debug)]
pub(crate) enum Player {
    Rest,
    Procedure(Procedure, Vec<Role>),
    Wiggle,
    Sweep,
    /// With the sensor angles at every frame, followed without jumps from the first.
    Track(JointTrack, Vec<[f64; 3]>),
}

impl Player {
    pub(crate) fn new(motion: Motion, body: &Body) -> Self {
        let by_rule =
            |procedure| Self::Procedure(procedure, body.parts().iter().map(|part| Role::of(&part.label)).collect());
        match motion {
            Motion::Rest => Self::Rest,
            Motion::Walk => by_rule(Procedure { walk: true, wave: false }),
            Motion::Wave => by_rule(Procedure { walk: false, wave: true }),
            Motion::WalkAndWave => by_rule(Procedure { walk: true, wave: true }),
            Motion::Wiggle => Self::Wiggle,
            Motion::Sweep => Self::Sweep,
            Motion::Track(mut track) => {
                track.rotations.iter_mut().for_each(|q| *q = normalized(*q));
                let columns = track.parts.len();
                let mut angles: Vec<[f64; 3]> = Vec::with_capacity(track.rotations.len());
                for (index, &turn) in track.rotations.iter().enumerate() {
                    let kind = body.parts()[track.parts[index % columns]].kind;
                    let previous = index.checked_sub(columns).map_or([0.0; 3], |before| angles[before]);
                    angles.push(to_sensor_angles(kind, turn, previous));
                }
                Self::Track(track, angles)
            }
        }
    }

    /// Writes the angle of every sensor, radians, at so many seconds after the motion began (`None`: before).
    pub(crate) fn sensor_angles(&self, body: &Body, seconds: Option<f64>, angles: &mut Vec<f64>) {
        angles.clear();
        angles.resize(body.sensor_count(), 0.0);
        let Some(seconds) = seconds else { return };
        match self {
            Self::Rest => {}
            Self::Procedure(procedure, roles) => {
                let size = grown(seconds);
                for (part, role) in roles.iter().enumerate() {
                    let turn = scaled(target(*procedure, *role, seconds), size);
                    put(body, part, to_sensor_angles(body.parts()[part].kind, turn, [0.0; 3]), angles);
                }
            }
            Self::Wiggle => {
                let whole = libm::floor(seconds);
                let sensor = (whole % body.sensor_count().max(1) as f64) as usize;
                if let Some(angle) = angles.get_mut(sensor) {
                    *angle = 0.5 * libm::sin(std::f64::consts::TAU * (seconds - whole));
                }
            }
            Self::Sweep => {
                let share = sweep_share(seconds);
                for (sensor, angle) in angles.iter_mut().enumerate() {
                    let (most, least) = sweep_stops(sensor);
                    *angle = if share > 0.0 { most * share } else { -least * share };
                }
            }
            Self::Track(track, frame_angles) => {
                if track.frame_count() == 0 {
                    return;
                }
                let (from, at, to) = track.place(seconds);
                let columns = track.parts.len();
                for (column, &part) in track.parts.iter().enumerate() {
                    let (a, b) = (from * columns + column, to * columns + column);
                    let turn = between(track.rotations[a], track.rotations[b], at);
                    put(body, part, to_sensor_angles(body.parts()[part].kind, turn, frame_angles[a]), angles);
                }
            }
        }
    }
}

fn put(body: &Body, part: usize, values: [f64; 3], angles: &mut [f64]) {
    for (slot, value) in body.sensors(part).zip(values) {
        angles[slot] = value;
    }
}

/// How long a sweep takes from rest to both stops and back to rest, seconds.
const SWEEP_SECONDS: f64 = 8.0;

/// The stops of a sensor in the motion `sweep`, radians: the one that comes first, and the other.
pub fn sweep_stops(sensor: usize) -> (f64, f64) {
    (1.0 + 0.1 * (sensor % 7) as f64, -0.6 - 0.1 * (sensor % 5) as f64)
}

/// The part of the way to the first stop (1) or the second (-1).
fn sweep_share(seconds: f64) -> f64 {
    let at = 4.0 * (seconds / SWEEP_SECONDS - libm::floor(seconds / SWEEP_SECONDS));
    let triangle = if at < 1.0 {
        at
    } else if at < 3.0 {
        2.0 - at
    } else {
        at - 4.0
    };
    libm::sin(std::f64::consts::FRAC_PI_2 * triangle)
}

fn grown(seconds: f64) -> f64 {
    let t = (seconds / GROW_SECONDS).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn scaled(turn: Rotation, size: f64) -> Rotation {
    if size >= 1.0 { turn } else { between(IDENTITY, turn, size) }
}
