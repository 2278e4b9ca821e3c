//! One bone's rotation, translation or scale over all frames, and how far an interpolation is from it.

use glam::{DQuat, DVec3, DVec4, Vec3};

/// What is between two keys.
pub(super) trait Curve {
    /// Seconds of every frame as files hold them, in single precision.
    fn times(&self) -> &[f64];

    /// The value of a frame as files hold it; a quaternion has the sign closer to the one before.
    fn value(&self, frame: usize) -> DVec4;

    /// How far this value is from the one of a frame: radians, or a length.
    fn distance(&self, value: DVec4, frame: usize) -> f64;

    /// The value at a fraction of the way from one frame's to another's: along a line, or the shorter great arc.
    fn between(&self, from: usize, to: usize, part: f64) -> DVec4;

    /// The step from one frame's value to another's, and how far it may be wrong where the distance is `bound`; `None`
    /// where it could be one of several.
    fn step(&self, from: usize, to: usize, bound: f64) -> Option<(DVec3, f64)>;

    /// Number of frames.
    fn len(&self) -> usize {
        self.times().len()
    }

    /// How far a frame is on the way between two others, 0 to 1.
    fn part(&self, from: usize, to: usize, frame: usize) -> f64 {
        let times = self.times();
        (times[frame] - times[from]) / (times[to] - times[from])
    }
}

/// Rotations, as unit quaternions.
#[derive(Debug)]
pub(super) struct Rotations<'a> {
    times: &'a [f64],
    turns: Vec<DQuat>,
}

impl<'a> Rotations<'a> {
    pub(super) fn new(times: &'a [f64], turns: impl Iterator<Item = glam::Quat>) -> Self {
        let mut last = DQuat::IDENTITY;
        let unit = |turn: glam::Quat| {
            let turn = turn.normalize().as_dquat();
            last = if turn.dot(last) < 0.0 { -turn } else { turn };
            last
        };
        Self { times, turns: turns.map(unit).collect() }
    }
}

impl Curve for Rotations<'_> {
    fn times(&self) -> &[f64] {
        self.times
    }

    fn value(&self, frame: usize) -> DVec4 {
        DVec4::from(self.turns[frame])
    }

    fn distance(&self, value: DVec4, frame: usize) -> f64 {
        let length = value.length();
        if length < 1e-6 {
            return std::f64::consts::PI;
        }
        let difference = DQuat::from_vec4(value / length) * self.turns[frame].normalize().conjugate();
        2.0 * libm::atan2(difference.xyz().length(), difference.w.abs())
    }

    fn between(&self, from: usize, to: usize, part: f64) -> DVec4 {
        let (a, b) = (self.turns[from].normalize(), self.turns[to].normalize());
        DVec4::from(a.slerp(b, part))
    }

    fn step(&self, from: usize, to: usize, bound: f64) -> Option<(DVec3, f64)> {
        let turn = (self.turns[from].normalize().conjugate() * self.turns[to].normalize()).to_scaled_axis();
        let turn =
            if turn.length() > std::f64::consts::PI { turn - turn.normalize() * std::f64::consts::TAU } else { turn };
        // Rotation vectors of this length are further apart than the rotations are, by no more than this factor.
        let half = 0.5 * (turn.length() + bound);
        (half < 1.3).then(|| (turn, bound * half / libm::sin(half).max(1e-12)))
    }
}

/// Translations or scales.
#[derive(Debug)]
pub(super) struct Vectors<'a> {
    times: &'a [f64],
    values: Vec<DVec3>,
}

impl<'a> Vectors<'a> {
    pub(super) fn new(times: &'a [f64], values: impl Iterator<Item = Vec3>) -> Self {
        Self { times, values: values.map(Vec3::as_dvec3).collect() }
    }
}

impl Curve for Vectors<'_> {
    fn times(&self) -> &[f64] {
        self.times
    }

    fn value(&self, frame: usize) -> DVec4 {
        self.values[frame].extend(0.0)
    }

    fn distance(&self, value: DVec4, frame: usize) -> f64 {
        (value.truncate() - self.values[frame]).length()
    }

    fn between(&self, from: usize, to: usize, part: f64) -> DVec4 {
        self.values[from].lerp(self.values[to], part).extend(0.0)
    }

    fn step(&self, from: usize, to: usize, bound: f64) -> Option<(DVec3, f64)> {
        Some((self.values[to] - self.values[from], bound))
    }
}
