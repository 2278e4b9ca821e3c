//! Exercises of the human presets: a squat, sitting down, a kick, a reach, a cartwheel. Each begins and ends standing with
//! hanging arms and is repeated.
//!
//! Signs are those of the [walker](super::procedural): a positive bend goes backwards for trunk, legs and arms; knees bend
//! by positive angles, elbows by negative ones.

use std::f64::consts::TAU;

use super::procedural::{ARMS_DOWN, Role, Side};
use super::track::{JointTrack, TrackEnd};
use crate::body::Body;
use crate::rotation::{IDENTITY, Rotation, about, product};

/// What the puppet does over and over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exercise {
    /// Down with flat feet and arms forward, and up again.
    Squat,
    /// Down to a low seat, a rest there, and up.
    Sit,
    /// The left leg swings back and kicks forward; the right one stands.
    Kick,
    /// The trunk leans far forward and to the left behind an outstretched right arm.
    Reach,
    /// Once over the left hand, the right hand and the right foot.
    Cartwheel,
}

const FRAME_SECONDS: f64 = 0.01;

/// A limb's angles: how far forward (or, of an arm, up from hanging, sideways) and how far bent.
#[derive(Clone, Copy, Default)]
struct Limb {
    forward: f64,
    aside: f64,
    bent: f64,
}

/// A human's joints at one moment, radians.
#[derive(Clone, Copy, Default)]
struct Figure {
    /// Of the whole body over its left side.
    roll: f64,
    lean: f64,
    turn: f64,
    legs: [Limb; 2],
    arms: [Limb; 2],
}

impl Exercise {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 5] = [
        ("squat", Self::Squat),
        ("sit", Self::Sit),
        ("kick", Self::Kick),
        ("reach", Self::Reach),
        ("cartwheel", Self::Cartwheel),
    ];

    /// How long it takes once, seconds.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Kick => 2.0,
            Self::Squat | Self::Reach => 3.0,
            Self::Sit | Self::Cartwheel => 4.0,
        }
    }

    /// Whether a body has the joints for it: a trunk, hips and shoulders.
    pub fn suits(self, body: &Body) -> bool {
        let has = |role: Role| body.parts().iter().any(|part| Role::of(&part.label) == role);
        let sides = [Side::Left, Side::Right].into_iter();
        has(Role::Spine) && sides.flat_map(|side| [Role::Hip(side), Role::Shoulder(side)]).all(has)
    }

    /// The motion for a body; joints that have no part in it rest.
    pub(super) fn track(self, body: &Body) -> JointTrack {
        let roles: Vec<Role> = body.parts().iter().map(|part| Role::of(&part.label)).collect();
        let parts: Vec<usize> = (0..roles.len()).filter(|&part| roles[part] != Role::Still).collect();
        let frames = libm::round(self.seconds() / FRAME_SECONDS) as u32;
        let figures = (0..frames).map(|frame| self.figure(f64::from(frame) / f64::from(frames)));
        let rotations =
            figures.flat_map(|figure| parts.iter().map(|&part| figure.turn_of(roles[part])).collect::<Vec<_>>());
        JointTrack { frame_seconds: FRAME_SECONDS, rotations: rotations.collect(), parts, end: TrackEnd::Repeat }
    }

    /// The joints at a share of the exercise.
    fn figure(self, at: f64) -> Figure {
        let s = once(at);
        let both = |limb: Limb| [limb; 2];
        let leg = |forward: f64, bent: f64| Limb { forward, bent, ..Limb::default() };
        match self {
            Self::Squat => Figure {
                lean: 0.5 * s,
                legs: both(leg(1.05 * s, 2.05 * s)),
                arms: both(Limb { forward: 1.3 * s, bent: 0.2, ..Limb::default() }),
                ..Figure::default()
            },
            Self::Sit => {
                let s = smooth(3.0 * at) - smooth(3.0 * at - 2.0);
                Figure {
                    lean: 0.15 * s + 0.6 * libm::sin(0.5 * TAU * s),
                    legs: both(leg(1.5 * s, 1.55 * s)),
                    arms: both(Limb { forward: 0.5 * s, bent: 0.2 + 0.6 * s, ..Limb::default() }),
                    ..Figure::default()
                }
            }
            Self::Kick => {
                let (back, forward) = (once(2.0 * at.min(0.5)), once((2.0 * at - 0.6).clamp(0.0, 1.0)));
                Figure {
                    lean: 0.1 * back - 0.25 * forward,
                    legs: [leg(1.25 * forward - 0.45 * back, 0.06 + 1.0 * back + 0.1 * forward), leg(0.06, 0.12)],
                    arms: [
                        Limb { forward: 0.5 * back - 0.4 * forward, bent: 0.3, ..Limb::default() },
                        Limb { forward: 0.5 * forward - 0.3 * back, aside: 0.3 * forward, bent: 0.3 },
                    ],
                    ..Figure::default()
                }
            }
            Self::Reach => Figure {
                lean: 0.9 * s,
                turn: 0.5 * s,
                legs: both(leg(0.15 * s, 0.2 * s)),
                arms: [
                    Limb { forward: -0.3 * s, bent: 0.3, ..Limb::default() },
                    Limb { forward: 2.2 * s, aside: 0.2 * s, bent: 0.2 * (1.0 - s) },
                ],
                ..Figure::default()
            },
            Self::Cartwheel => {
                // Arms up and legs apart, once around, down again.
                let spread = smooth(5.0 * at) - smooth(5.0 * at - 4.0);
                Figure {
                    roll: TAU * smooth((at - 0.15) / 0.7),
                    legs: both(Limb { aside: 0.55 * spread, ..Limb::default() }),
                    arms: both(Limb { aside: 2.7 * spread, ..Limb::default() }),
                    ..Figure::default()
                }
            }
        }
    }
}

impl Figure {
    fn turn_of(&self, role: Role) -> Rotation {
        let of = |side: Side, limbs: [Limb; 2]| limbs[usize::from(side == Side::Right)];
        match role {
            Role::Hips => about(2, self.roll),
            Role::Spine => product(about(1, 0.6 * self.turn), about(0, -0.6 * self.lean)),
            Role::Chest => product(about(1, 0.4 * self.turn), about(0, -0.4 * self.lean)),
            Role::Neck => about(0, 0.2 * self.lean),
            Role::Head => about(0, 0.3 * self.lean),
            Role::Hip(side) => {
                let Limb { forward, aside, .. } = of(side, self.legs);
                product(about(2, -side.sign() * aside), about(0, -forward))
            }
            Role::Knee(side) => about(0, of(side, self.legs).bent),
            // Level with the floor as long as the leg stands on it.
            Role::Ankle(side) => {
                let Limb { forward, bent, .. } = of(side, self.legs);
                about(0, (forward - bent).clamp(-1.1, 0.6))
            }
            Role::Shoulder(side) => {
                let Limb { forward, aside, .. } = of(side, self.arms);
                product(about(1, -side.sign() * forward), about(2, side.sign() * (ARMS_DOWN - aside)))
            }
            Role::Elbow(side) => about(0, -of(side, self.arms).bent),
            _ => IDENTITY,
        }
    }
}

/// From 0 to 1 and back, at rest at the ends and in the middle.
fn once(at: f64) -> f64 {
    0.5 - 0.5 * libm::cos(TAU * at)
}

/// From 0 to 1 with a steady acceleration at both ends.
fn smooth(at: f64) -> f64 {
    let t = at.clamp(0.0, 1.0);
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::{inverse, normalized};

    fn apart(a: Rotation, b: Rotation) -> f64 {
        let [x, y, z, w] = normalized(product(inverse(a), b));
        2.0 * libm::atan2(libm::sqrt(x * x + y * y + z * z), w.abs())
    }

    #[test]
    fn exercises_suit_humans_and_end_where_they_begin() {
        for (name, exercise) in Exercise::ALL {
            for preset in ["spider", "hand", "joints:5"] {
                assert!(!exercise.suits(&Body::preset(preset, 0).unwrap()), "{name} {preset}");
            }
            for preset in ["human", "human8"] {
                let body = Body::preset(preset, 0).unwrap();
                assert!(exercise.suits(&body), "{name} {preset}");
                let track = exercise.track(&body);
                let (count, columns) = (track.frame_count(), track.parts.len());
                assert_eq!(count as f64 * FRAME_SECONDS, exercise.seconds());
                let mut furthest = 0.0_f64;
                for frame in 0..count {
                    let next = (frame + 1) % count;
                    for column in 0..columns {
                        let [a, b] = [frame, next].map(|f| track.rotations[f * columns + column]);
                        furthest = furthest.max(apart(a, b));
                    }
                }
                assert!((0.01..0.09).contains(&furthest), "{name}: {furthest} in a frame");
            }
        }
    }
}
