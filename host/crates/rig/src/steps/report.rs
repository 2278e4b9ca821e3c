//! What a calibration step found, sensor by sensor, in words.

use std::fmt;

use glam::{DQuat, DVec3};

use super::measure::{HeldStill, SweepOutcome, Swept};
use super::mounting::{Mounting, MountingError, mounting_from_axes, mounting_from_axis};
use super::step::CalibrationStep;
use crate::calibration::{Calibration, PartSettings};
use crate::mapping::Mapping;
use crate::puppet::{JointTree, PartUid, SensorState, joint_rotation};

/// A part that turned less than this did not take part in a motion, radians.
const TURNED: f64 = 0.26;

/// The result of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// The step.
    pub step: CalibrationStep,
    /// The calibration from now on.
    pub calibration: Calibration,
    /// What it found, in the tree's order.
    pub findings: Vec<StepFinding>,
}

/// What a step found about a sensor, or about a part as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepFinding {
    /// The part; `None` if there is none.
    pub part: Option<PartUid>,
    /// Which of its sensors, from the inlet outwards.
    pub sensor: Option<usize>,
    /// The finding.
    pub finding: Finding,
}

/// What was found. [Bad findings](Finding::is_bad) change nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding {
    /// It has a new zero, counts.
    Zeroed(u16),
    /// It was not held still; degrees.
    Moved(f64),
    /// It had no good reading.
    Unreadable(SensorState),
    /// Its stops are known.
    Swept {
        /// From one to the other, degrees.
        degrees: f64,
        /// Whether it counts backwards.
        reversed: bool,
        /// Whether its range crosses count zero.
        across_zero: bool,
    },
    /// It has no stops.
    AllRound {
        /// Whether it counts backwards.
        reversed: bool,
    },
    /// It hardly moved; degrees.
    NotMoved(f64),
    /// It moved too fast to follow.
    TooFast,
    /// Its mounting is known.
    Mounted {
        /// How far it is rotated from its nominal mounting, degrees.
        degrees: f64,
        /// How far the two motions were off, degrees.
        residual_degrees: f64,
    },
    /// It moved in only one of the two poses.
    OneMotion,
    /// It was never zeroed.
    NotZeroed,
    /// The motions do not determine it.
    NoMounting(MountingError),
    /// Its direction is forward from now on; the rotation it had until then, degrees.
    Heading(f64),
    /// No part drives a bone.
    NoRoot,
}

impl Finding {
    /// Whether the step failed for this sensor or part.
    pub fn is_bad(&self) -> bool {
        !matches!(
            self,
            Self::Zeroed(_) | Self::Swept { .. } | Self::AllRound { .. } | Self::Mounted { .. } | Self::Heading(_)
        )
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sense = |reversed: bool| if reversed { ", counting backwards" } else { "" };
        match *self {
            Self::Zeroed(counts) => write!(f, "rest pose at count {counts}"),
            Self::Moved(degrees) => {
                write!(f, "moved by {degrees:.1}° while it should have been held still; left unchanged")
            }
            Self::Unreadable(state) => {
                let why = match state {
                    SensorState::NoData => "it does not answer; check its plug",
                    SensorState::MagnetWeak => "its magnet is weak; bring it closer to the sensor",
                    SensorState::Outlier | SensorState::Ok => "its readings cannot be trusted",
                };
                write!(f, "no good reading ({why}); left unchanged")
            }
            Self::Swept { degrees, reversed, across_zero } => {
                let across = if across_zero { ", across count zero" } else { "" };
                write!(f, "{degrees:.0}° from stop to stop{across}{}", sense(reversed))
            }
            Self::AllRound { reversed } => write!(f, "goes all the way round, without stops{}", sense(reversed)),
            Self::NotMoved(degrees) => write!(f, "moved by only {degrees:.1}°; left unchanged"),
            Self::TooFast => f.write_str("moved too fast to follow; sweep it again, more slowly"),
            Self::Mounted { degrees, residual_degrees } => {
                write!(
                    f,
                    "mounted {degrees:.0}° off its nominal orientation (the two motions were {residual_degrees:.0}° off square)"
                )
            }
            Self::OneMotion => f.write_str("moved in only one of the two poses; left unchanged"),
            Self::NotZeroed => f.write_str("was never zeroed; run the zero step first"),
            Self::NoMounting(error) => write!(f, "{error}; left unchanged"),
            Self::Heading(degrees) => write!(f, "faced {degrees:.0}° off; that direction is forward now"),
            Self::NoRoot => f.write_str("no part drives a bone, so nothing has a heading"),
        }
    }
}

pub(super) fn zero_report(tree: &JointTree, mut calibration: Calibration, held: &[HeldStill]) -> StepReport {
    let findings = each_sensor(tree, |part, sensor, slot| match held.get(slot) {
        Some(&HeldStill::At(counts)) => {
            if let Some(known) = calibration.sensor_mut(part, sensor) {
                known.zero_counts = Some(counts);
            }
            Finding::Zeroed(counts)
        }
        Some(&HeldStill::Moved(degrees)) => Finding::Moved(degrees),
        Some(&HeldStill::Unreadable(state)) => Finding::Unreadable(state),
        None => Finding::Unreadable(SensorState::NoData),
    });
    StepReport { step: CalibrationStep::Zero, calibration, findings }
}

pub(super) fn sweep_report(tree: &JointTree, mut calibration: Calibration, swept: &[Swept]) -> StepReport {
    let turn_of = |uid: PartUid| tree.find(uid).map_or(1, |part| tree.parts()[part].counts_per_turn);
    let findings = each_sensor(tree, |part, sensor, slot| {
        let turn = turn_of(part);
        let outcome = swept.get(slot).map_or(SweepOutcome::Unread, |swept| swept.outcome(turn));
        let (range, rose_first) = match outcome {
            SweepOutcome::Unread => return Finding::Unreadable(SensorState::NoData),
            SweepOutcome::NotMoved(degrees) => return Finding::NotMoved(degrees),
            SweepOutcome::TooFast => return Finding::TooFast,
            SweepOutcome::Between { range, rose_first } => (Some(range), rose_first),
            SweepOutcome::AllRound { rose_first } => (None, rose_first),
        };
        let reversed = !rose_first;
        if let Some(known) = calibration.sensor_mut(part, sensor) {
            (known.range, known.reversed) = (range, reversed);
        }
        range.map_or(Finding::AllRound { reversed }, |range| Finding::Swept {
            degrees: f64::from(range.span_counts) / f64::from(turn) * 360.0,
            reversed,
            across_zero: u32::from(range.first_counts) + range.span_counts >= turn,
        })
    });
    StepReport { step: CalibrationStep::Sweep, calibration, findings }
}

/// The first pose is a bend, the second a twist, as [`CalibrationStep::instructions`] asks.
pub(super) fn mounting_report(
    tree: &JointTree,
    mut calibration: Calibration,
    mapping: Option<&Mapping>,
    poses: &[Vec<HeldStill>],
) -> StepReport {
    let mut findings = Vec::new();
    for (index, part) in tree.parts().iter().enumerate().filter(|(_, part)| !part.kind.axes().is_empty()) {
        // The mapping's own mounting is applied on top of the one found here.
        let entry = mapping.and_then(|mapping| mapping.entries.iter().find(|entry| entry.part == part.uid));
        let on_top = entry.map_or(DQuat::IDENTITY, |entry| entry.mounting.as_dquat().normalize());
        let meant = [DVec3::X, DVec3::Y].map(|axis| on_top.inverse() * axis);
        let turned = poses.iter().map(|held| part_turn(tree, index, &calibration, held)).collect::<Result<Vec<_>, _>>();
        let found = turned.and_then(|turned| match turned[..] {
            [Some(bent), Some(twisted)] => mounting_from_axes([bent, twisted], meant).map_err(Finding::NoMounting),
            [Some(one), None] if part.kind.axes().len() == 1 => {
                mounting_from_axis(one, meant[0]).map_err(Finding::NoMounting)
            }
            [None, Some(one)] if part.kind.axes().len() == 1 => {
                mounting_from_axis(one, meant[1]).map_err(Finding::NoMounting)
            }
            [Some(_), None] | [None, Some(_)] => Err(Finding::OneMotion),
            _ => Err(Finding::NotMoved(0.0)),
        });
        let finding = match found {
            Ok(Mounting { rotation, residual }) => {
                let settings = PartSettings { mounting: rotation, ..calibration.part_settings(part.uid) };
                calibration.set_part_settings(part.uid, settings);
                let q = rotation.as_dquat();
                let angle = 2.0 * libm::atan2(q.xyz().length(), libm::fabs(q.w));
                Finding::Mounted { degrees: angle.to_degrees(), residual_degrees: residual.to_degrees() }
            }
            Err(finding) => finding,
        };
        findings.push(StepFinding { part: Some(part.uid), sensor: None, finding });
    }
    StepReport { step: CalibrationStep::Mounting, calibration, findings }
}

/// The axis about which a part is rotated from its rest pose, in its own frame; `None` if it hardly is.
fn part_turn(
    tree: &JointTree,
    part: usize,
    calibration: &Calibration,
    held: &[HeldStill],
) -> Result<Option<DVec3>, Finding> {
    let sensors = calibration.part(tree.parts()[part].uid).unwrap_or_default();
    let (mut axes, mut angles) = (Vec::new(), Vec::new());
    for (sensor, slot) in sensors.iter().zip(tree.sensors(part)) {
        let counts = match held.get(slot) {
            Some(&HeldStill::At(counts)) => counts,
            Some(&HeldStill::Moved(degrees)) => return Err(Finding::Moved(degrees)),
            Some(&HeldStill::Unreadable(state)) => return Err(Finding::Unreadable(state)),
            None => return Err(Finding::Unreadable(SensorState::NoData)),
        };
        axes.push(sensor.axis);
        angles.push(sensor.angle(counts, tree.parts()[part].counts_per_turn).ok_or(Finding::NotZeroed)?);
    }
    let turn = joint_rotation(&axes, &angles).as_dquat();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let angle = 2.0 * libm::atan2(turn.xyz().length(), turn.w);
    Ok((angle > TURNED).then(|| turn.xyz().normalize()))
}

pub(super) fn heading_report(
    tree: &JointTree,
    mut calibration: Calibration,
    heading: Option<(PartUid, f64)>,
) -> StepReport {
    // A sensor that was never zeroed is assumed to be in the rest pose, whichever way the puppet faces.
    let is_zeroed = |part: PartUid| {
        let sensors = calibration.part(part).unwrap_or_default();
        tree.find(part).is_some() && sensors.iter().all(|sensor| sensor.zero_counts.is_some())
    };
    let (part, finding) = match heading {
        Some((part, _)) if !is_zeroed(part) => (Some(part), Finding::NotZeroed),
        Some((part, heading)) => {
            let settings = PartSettings { heading, ..calibration.part_settings(part) };
            calibration.set_part_settings(part, settings);
            (Some(part), Finding::Heading(heading.to_degrees()))
        }
        None => (None, Finding::NoRoot),
    };
    let findings = vec![StepFinding { part, sensor: None, finding }];
    StepReport { step: CalibrationStep::Heading, calibration, findings }
}

fn each_sensor(tree: &JointTree, mut found: impl FnMut(PartUid, usize, usize) -> Finding) -> Vec<StepFinding> {
    let mut findings = Vec::with_capacity(tree.sensor_count());
    for (index, part) in tree.parts().iter().enumerate() {
        for (sensor, slot) in tree.sensors(index).enumerate() {
            let finding = found(part.uid, sensor, slot);
            findings.push(StepFinding { part: Some(part.uid), sensor: Some(sensor), finding });
        }
    }
    findings
}
