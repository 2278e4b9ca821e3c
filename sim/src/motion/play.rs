//! What the puppet does: rest, a procedural motion, an exercise, or a recorded track.

use super::exercise::Exercise;
use super::procedural::{Procedure, Role, target};
use super::track::{JointTrack, TrackEnd};
use crate::body::Body;
use crate::rotation::{IDENTITY, Rotation, between, normalized, to_sensor_angles};

/// How long a procedural motion takes to grow from the rest pose to its full size, seconds.
const GROW_SECONDS: f64 = 0.5;

/// What moves the puppet.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Motion {
    /// Nothing moves.
    #[default]
    Rest,
    /// Walking on the spot.
    Walk,
    /// Waving the right arm (a spider waves its front legs, a hand its fingers).
    Wave,
    /// Walking and waving.
    WalkAndWave,
    /// Every sensor in turn, one second each.
    Wiggle,
    /// Every joint from rest to one stop, to the other and back, as for calibration.
    Sweep,
    /// What a human does again and again.
    Exercise(Exercise),
    /// Recorded rotations.
    Track(JointTrack),
}

impl Motion {
    /// The motion with this name, one of [`names`](Self::names).
    pub fn by_name(name: &str) -> Option<Self> {
        Some(match name {
            "rest" => Self::Rest,
            "walk" => Self::Walk,
            "wave" => Self::Wave,
            "walk+wave" => Self::WalkAndWave,
            "wiggle" => Self::Wiggle,
            "sweep" => Self::Sweep,
            _ => Self::Exercise(Exercise::ALL.iter().find(|(known, _)| *known == name)?.1),
        })
    }

    /// The names of all motions, with commas between.
    pub fn names() -> String {
        let exercises = Exercise::ALL.iter().map(|(name, _)| *name);
        ["rest", "walk", "wave", "walk+wave", "wiggle", "sweep"]
            .into_iter()
            .chain(exercises)
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// A motion, prepared for one body.
#[derive(Clone, Debug)]
pub(crate) enum Player {
    Rest,
    Procedure(Procedure, Vec<Role>),
    Wiggle,
    Sweep,
    Track(Track),
}

/// A recorded motion, ready to be played.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    recorded: JointTrack,
    /// The sensor angles at every frame, followed without jumps from the first.
    angles: Vec<[f64; 3]>,
    /// For how long the puppet goes from rest to the first frame, seconds.
    lead_in: f64,
    /// For how long it goes from the last frame back to the first where the motion begins again; 0: one frame later.
    lead_back: f64,
}

/// How quickly a puppet is brought to where a motion begins, radians a second of its quickest sensor on the average.
const LEAD_SPEED: f64 = 2.0;

impl Track {
    /// `leads`: whether the first frame is reached over a moment, from rest and from the last frame.
    fn new(mut track: JointTrack, body: &Body, leads: bool) -> Self {
        track.rotations.iter_mut().for_each(|q| *q = normalized(*q));
        let columns = track.parts.len();
        let mut angles: Vec<[f64; 3]> = Vec::with_capacity(track.rotations.len());
        for (index, &turn) in track.rotations.iter().enumerate() {
            let kind = body.parts()[track.parts[index % columns]].kind;
            let previous = index.checked_sub(columns).map_or([0.0; 3], |before| angles[before]);
            angles.push(to_sensor_angles(kind, turn, previous));
        }
        let mut played = Self { recorded: track, angles, lead_in: 0.0, lead_back: 0.0 };
        if leads && columns > 0 && !played.angles.is_empty() {
            let first = &played.angles[..columns];
            let last = &played.angles[played.angles.len() - columns..];
            let furthest = |away: &mut dyn Iterator<Item = f64>| away.map(f64::abs).fold(0.0, f64::max);
            let from_rest = furthest(&mut first.iter().flatten().copied());
            let from_last = furthest(&mut last.iter().zip(first).flat_map(|(last, first)| shortest(*last, *first)));
            let frame_seconds = played.recorded.frame_seconds;
            // Whole frames, so that those of the track stay where they would be among the samples.
            let lead = |away: f64| libm::ceil(away / LEAD_SPEED / frame_seconds) * frame_seconds;
            played.lead_in = lead(from_rest);
            let back = lead(from_last);
            let repeats = played.recorded.end == TrackEnd::Repeat && back > frame_seconds;
            played.lead_back = if repeats { back } else { 0.0 };
        }
        played
    }

    fn write(&self, body: &Body, seconds: f64, angles: &mut [f64]) {
        if self.recorded.frame_count() == 0 {
            return;
        }
        let columns = self.recorded.parts.len();
        let first = &self.angles[..columns];
        if seconds < self.lead_in {
            let at = smooth(seconds / self.lead_in);
            for (&part, own) in self.recorded.parts.iter().zip(first) {
                put(body, part, own.map(|angle| at * angle), angles);
            }
            return;
        }
        let mut seconds = seconds - self.lead_in;
        if self.lead_back > 0.0 {
            let once = (self.recorded.frame_count() - 1) as f64 * self.recorded.frame_seconds;
            let round = once + self.lead_back;
            seconds -= round * libm::floor(seconds / round);
            if seconds >= once {
                let at = smooth((seconds - once) / self.lead_back);
                let last = &self.angles[self.angles.len() - columns..];
                for ((&part, last), first) in self.recorded.parts.iter().zip(last).zip(first) {
                    let way = shortest(*last, *first);
                    put(body, part, [0, 1, 2].map(|axis| last[axis] + at * way[axis]), angles);
                }
                return;
            }
        }
        let (from, at, to) = self.recorded.place(seconds);
        for (column, &part) in self.recorded.parts.iter().enumerate() {
            let (a, b) = (from * columns + column, to * columns + column);
            let turn = between(self.recorded.rotations[a], self.recorded.rotations[b], at);
            put(body, part, to_sensor_angles(body.parts()[part].kind, turn, self.angles[a]), angles);
        }
    }
}

/// The shorter way from each angle to the other.
fn shortest(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    use std::f64::consts::{PI, TAU};
    [0, 1, 2].map(|axis| {
        let away = to[axis] - from[axis] + PI;
        away - TAU * libm::floor(away / TAU) - PI
    })
}

impl Player {
    /// `leads`: whether a track's first frame is reached over a moment.
    pub(crate) fn new(motion: Motion, body: &Body, leads: bool) -> Self {
        let by_rule =
            |procedure| Self::Procedure(procedure, body.parts().iter().map(|part| Role::of(&part.label)).collect());
        match motion {
            Motion::Rest => Self::Rest,
            Motion::Walk => by_rule(Procedure { walk: true, wave: false }),
            Motion::Wave => by_rule(Procedure { walk: false, wave: true }),
            Motion::WalkAndWave => by_rule(Procedure { walk: true, wave: true }),
            Motion::Wiggle => Self::Wiggle,
            Motion::Sweep => Self::Sweep,
            Motion::Exercise(exercise) => Self::Track(Track::new(exercise.track(body), body, true)),
            Motion::Track(track) => Self::Track(Track::new(track, body, leads)),
        }
    }

    /// How long after its beginning a motion shows its first frame, seconds.
    pub(crate) fn lead_in_seconds(&self) -> f64 {
        if let Self::Track(track) = self { track.lead_in } else { 0.0 }
    }

    /// Writes the angle of every sensor, radians, this many seconds after the motion began (`None`: before).
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
            Self::Track(track) => track.write(body, seconds, angles),
        }
    }
}

fn put(body: &Body, part: usize, values: [f64; 3], angles: &mut [f64]) {
    for (slot, value) in body.sensors(part).zip(values) {
        angles[slot] = value;
    }
}

/// Duration of a sweep from rest to both stops and back to rest, seconds.
const SWEEP_SECONDS: f64 = 8.0;

/// A sensor's stops in the motion `sweep`, radians: the one reached first, then the other.
pub fn sweep_stops(sensor: usize) -> (f64, f64) {
    (1.0 + 0.1 * (sensor % 7) as f64, -0.6 - 0.1 * (sensor % 5) as f64)
}

/// How far towards the first stop (1) or the second (-1).
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
    smooth(seconds / GROW_SECONDS)
}

/// From 0 to 1, at rest at both ends.
fn smooth(part: f64) -> f64 {
    let t = part.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn scaled(turn: Rotation, size: f64) -> Rotation {
    if size >= 1.0 { turn } else { between(IDENTITY, turn, size) }
}
