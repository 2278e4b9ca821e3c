//! Procedural motions: walking and waving, for the parts that the presets' labels name.
//!
//! Signs, in the joints' own frames on a character in T-pose that faces +Z: a positive bend goes backwards for trunk,
//! legs and arms alike; a knee bends by positive angles, an elbow by negative ones.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::rotation::{Rotation, about, product};

const STEPS_PER_SECOND: f64 = 0.9;
const WAVES_PER_SECOND: f64 = 1.4;
/// How far a walker's arms hang down from the T-pose, radians.
pub(super) const ARMS_DOWN: f64 = 1.3;

/// Which rules apply.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Procedure {
    pub(crate) walk: bool,
    pub(crate) wave: bool,
}

/// A part's role, from its label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Still,
    Hips,
    Spine,
    Chest,
    Neck,
    Head,
    Hip(Side),
    Knee(Side),
    Ankle(Side),
    Shoulder(Side),
    Elbow(Side),
    Forearm(Side),
    Wrist(Side),
    /// A spider's leg joint: side, leg counted from the front (0 to 3), joint counted from the body (0 to 2).
    Leg(Side, u8, u8),
    /// A finger joint: finger counted from the thumb, joint counted from the palm.
    Finger(u8, u8),
    HandWrist,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

impl Side {
    /// +1 on the character's left.
    pub(super) fn sign(self) -> f64 {
        if self == Self::Left { 1.0 } else { -1.0 }
    }

    /// The right leg is half a step behind.
    fn phase(self) -> f64 {
        if self == Self::Left { 0.0 } else { 0.5 * TAU }
    }
}

impl Role {
    pub(crate) fn of(label: &str) -> Self {
        let words: Vec<&str> = label.split('_').collect();
        let side = |word: &str| match word {
            "left" => Some(Side::Left),
            "right" => Some(Side::Right),
            _ => None,
        };
        let digit = |word: &str| word.parse::<u8>().ok().and_then(|n| n.checked_sub(1)).filter(|n| *n < 4);
        match words[..] {
            ["hips"] => Self::Hips,
            ["spine"] => Self::Spine,
            ["chest"] => Self::Chest,
            ["neck"] => Self::Neck,
            ["head"] => Self::Head,
            ["wrist"] => Self::HandWrist,
            [first, second] => match (side(first), second) {
                (Some(side), "hip") => Self::Hip(side),
                (Some(side), "knee") => Self::Knee(side),
                (Some(side), "ankle") => Self::Ankle(side),
                (Some(side), "shoulder") => Self::Shoulder(side),
                (Some(side), "elbow") => Self::Elbow(side),
                (Some(side), "forearm") => Self::Forearm(side),
                (Some(side), "wrist") => Self::Wrist(side),
                (Some(_), _) => Self::Still,
                (None, _) => {
                    let finger = ["thumb", "index", "middle", "ring", "little"].iter().position(|f| *f == first);
                    finger.zip(digit(second)).map_or(Self::Still, |(f, joint)| Self::Finger(f as u8, joint))
                }
            },
            [first, leg, joint] => {
                let joint = ["hip", "knee", "ankle"].iter().position(|j| *j == joint);
                match (side(first), digit(leg), joint) {
                    (Some(side), Some(leg), Some(joint)) => Self::Leg(side, leg, joint as u8),
                    _ => Self::Still,
                }
            }
            _ => Self::Still,
        }
    }
}

/// The rotation that the procedure gives a part at this time.
pub(crate) fn target(procedure: Procedure, role: Role, seconds: f64) -> Rotation {
    let Procedure { walk, wave } = procedure;
    match role {
        Role::Leg(side, leg, joint) => spider_leg(procedure, side, leg, joint, seconds),
        Role::Finger(finger, joint) => hand_finger(procedure, finger, joint, seconds),
        Role::HandWrist => bend(if walk { 0.25 * libm::sin(TAU * 0.3 * seconds) } else { 0.0 }),
        Role::Shoulder(Side::Right) if wave => product(about(2, 0.35), about(1, FRAC_PI_2)),
        Role::Elbow(Side::Right) if wave => bend(-1.2 + 0.45 * libm::sin(TAU * WAVES_PER_SECOND * seconds)),
        Role::Forearm(Side::Right) if wave => twist(0.2 * libm::sin(TAU * WAVES_PER_SECOND * seconds + 0.8)),
        Role::Wrist(Side::Right) if wave => about(0, -0.3 * libm::sin(TAU * WAVES_PER_SECOND * seconds - 0.9)),
        Role::Head if wave => product(about(1, -0.35), about(0, -0.1)),
        Role::Shoulder(side) if !walk => about(2, side.sign() * ARMS_DOWN),
        Role::Elbow(_) if !walk => bend(-0.2),
        _ if !walk => twist(0.0),
        _ => walker(role, TAU * STEPS_PER_SECOND * seconds),
    }
}

/// A walking human at this phase of the left leg's step.
fn walker(role: Role, phase: f64) -> Rotation {
    let sway = libm::sin(phase);
    match role {
        Role::Hips => product(about(1, -0.10 * sway), about(2, 0.04 * libm::cos(phase))),
        Role::Spine => product(about(1, 0.08 * sway), about(0, -0.05)),
        Role::Chest => product(about(1, 0.14 * sway), about(2, -0.03 * libm::cos(phase))),
        Role::Neck => twist(-0.06 * sway),
        Role::Head => product(about(1, -0.06 * sway), about(0, 0.03 * libm::cos(2.0 * phase))),
        Role::Hip(side) => {
            let forward = 0.45 * libm::sin(phase + side.phase());
            product(about(0, -forward - 0.05), about(2, 0.02 * side.sign()))
        }
        Role::Knee(side) => {
            let swing = libm::cos(phase + side.phase()).max(0.0);
            bend(0.12 + 0.75 * swing * swing)
        }
        Role::Ankle(side) => about(0, 0.18 * libm::sin(phase + side.phase() - 0.6)),
        Role::Shoulder(side) => {
            let backward = 0.4 * libm::sin(phase + side.phase());
            product(about(1, side.sign() * backward), about(2, side.sign() * ARMS_DOWN))
        }
        Role::Elbow(side) => bend(-0.35 + 0.2 * libm::sin(phase + side.phase())),
        Role::Forearm(side) => twist(0.25 * side.sign()),
        Role::Wrist(side) => about(0, -0.1 * libm::sin(phase + side.phase() - 0.5)),
        _ => twist(0.0),
    }
}

/// Legs in two groups of four, each leg out of phase with its neighbours.
fn spider_leg(procedure: Procedure, side: Side, leg: u8, joint: u8, seconds: f64) -> Rotation {
    let odd = (leg % 2 == 1) != (side == Side::Right);
    let phase = TAU * 1.2 * seconds + if odd { 0.5 * TAU } else { 0.0 };
    let lift = libm::cos(phase).max(0.0);
    let waving = procedure.wave && leg == 0;
    let wave = libm::sin(TAU * WAVES_PER_SECOND * seconds);
    match joint {
        0 if waving => about(2, -side.sign() * (0.6 + 0.2 * wave)),
        0 if procedure.walk => {
            let turn = about(2, -side.sign() * 0.3 * lift);
            product(about(0, -0.3 * libm::sin(phase)), turn)
        }
        1 if waving => bend(-0.3 * wave),
        1 if procedure.walk => bend(0.2 * lift),
        2 if procedure.walk => bend(-0.15 * lift),
        _ => bend(0.0),
    }
}

/// Fingers that curl one after another; the first joint spreads a little too.
fn hand_finger(procedure: Procedure, finger: u8, joint: u8, seconds: f64) -> Rotation {
    let phase = TAU * 0.5 * seconds - 0.7 * f64::from(finger);
    let curl = if procedure.walk || procedure.wave { 0.5 - 0.5 * libm::cos(phase) } else { 0.0 };
    match joint {
        0 if procedure.wave => product(about(2, 0.08 * libm::sin(phase)), about(0, -0.9 * curl)),
        0 => about(0, -0.9 * curl),
        _ => bend(-1.1 * curl),
    }
}

fn bend(angle: f64) -> Rotation {
    about(0, angle)
}

fn twist(angle: f64) -> Rotation {
    about(1, angle)
}

#[cfg(test)]
mod tests {
    use super::super::play::{Motion, Player};
    use super::*;
    use crate::body::Body;

    #[test]
    fn every_joint_of_the_presets_has_a_role() {
        for name in ["human", "human8", "spider", "hand"] {
            let body = Body::preset(name, 0).unwrap();
            for part in body.parts().iter().filter(|p| p.kind.sensor_count() != Some(0)) {
                assert!(Role::of(&part.label) != Role::Still || part.label == "body", "{}", part.label);
            }
        }
        for odd in ["", "_", "left", "left_5_hip", "left_0_hip", "thumb_0", "a_b_c_d"] {
            assert_eq!(Role::of(odd), Role::Still, "{odd}");
        }
    }

    #[test]
    fn motions_begin_at_rest_and_run_smoothly() {
        for name in ["human", "human8", "spider", "hand", "joints:5"] {
            let body = Body::preset(name, 0).unwrap();
            for motion in [Motion::Walk, Motion::Wave, Motion::WalkAndWave, Motion::Wiggle] {
                let player = Player::new(motion.clone(), &body, false);
                let turns = |seconds: f64| {
                    let mut angles = Vec::new();
                    player.sensor_angles(&body, Some(seconds), &mut angles);
                    (0..body.parts().len())
                        .map(|part| {
                            let mut own = [0.0; 3];
                            own.iter_mut().zip(&angles[body.sensors(part)]).for_each(|(a, b)| *a = *b);
                            crate::rotation::from_sensor_angles(body.parts()[part].kind, own)
                        })
                        .collect::<Vec<_>>()
                };
                let mut moved = 0.0_f64;
                let mut before = turns(0.0);
                for turn in &before {
                    assert!(turn[3].abs() > 1.0 - 1e-12, "{name} {motion:?} starts at rest");
                }
                for step in 1..4000 {
                    let now = turns(f64::from(step) * 0.001);
                    for (a, b) in now.iter().zip(&before) {
                        let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                        let apart = 2.0 * libm::acos(dot.abs().min(1.0));
                        assert!(apart < 0.02, "{name} {motion:?} jumps by {apart} at {step} ms");
                        moved = moved.max(apart);
                    }
                    before = now;
                }
                assert!(moved > 1e-4 || name == "joints:5", "{name} {motion:?} moves");
            }
        }
    }
}
