//! The calibration steps on virtual time, with a puppet whose true values are known.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use std::f64::consts::TAU;

use armature_rig::{
    Calibration, CalibrationRun, CalibrationStep, Finding, JointTree, Mapping, MappingEntry, Pose, PoseSolver,
    Progress, RawSample, Reading, SensorState, StepError, StepReport, StepTimes, joint_angles, wrapped,
};
use common::{BEND, TBT, TWIST, puppet, skeleton, uid};
use glam::Quat;

const TURN: f64 = 16_384.0;
const RATE: f64 = 100.0;
const TIMES: StepTimes = StepTimes { countdown: 3.0, hold: 0.5, sweep: 8.0 };

/// A puppet of three joints with magnets glued in at any angle, the second of them on the wrong side.
struct Truth {
    tree: JointTree,
    zeros: [u16; 5],
    backwards: [bool; 5],
}

impl Truth {
    fn new() -> Self {
        Self {
            tree: puppet(&[("hip", TBT, ""), ("knee", BEND, "hip"), ("forearm", TWIST, "knee")]),
            zeros: [16_380, 40, 9_000, 3, 16_000],
            backwards: [false, true, false, true, false],
        }
    }

    fn counts(&self, angles: [f64; 5]) -> Vec<u16> {
        let count = |slot: usize| {
            let angle = if self.backwards[slot] { -angles[slot] } else { angles[slot] };
            (f64::from(self.zeros[slot]) + angle / TAU * TURN).round().rem_euclid(TURN) as u16
        };
        (0..5).map(count).collect()
    }

    /// Runs a step from start to end; `angles` at this many seconds after its start.
    fn run(
        &self,
        step: CalibrationStep,
        calibration: &Calibration,
        angles: impl Fn(f64) -> [f64; 5],
    ) -> Result<StepReport, StepError> {
        let began = 1_000.0;
        let mut run = CalibrationRun::begin(step, TIMES, began);
        for tick in 0_u32.. {
            let seconds = f64::from(tick) / RATE;
            if run.progress(began + seconds) == Progress::Over {
                break;
            }
            let counts = self.counts(angles(seconds));
            let sample = RawSample { states: vec![SensorState::Ok; counts.len()], counts, ..RawSample::default() };
            run.take(&Reading { now: began + seconds, sample: &sample, tree: &self.tree, root_turn: None });
        }
        run.finish(calibration, None)
    }

    fn zeroed(&self) -> Calibration {
        self.run(CalibrationStep::Zero, &Calibration::default(), |_| [0.0; 5]).unwrap().calibration
    }
}

fn zeros(calibration: &Calibration) -> Vec<Option<u16>> {
    calibration.parts().flat_map(|(_, sensors)| sensors.iter().map(|sensor| sensor.zero_counts)).collect()
}

#[test]
fn a_step_counts_down_measures_and_is_over() {
    let run = CalibrationRun::begin(CalibrationStep::Mounting, TIMES, 5.0);
    let [bend, twist] = CalibrationStep::Mounting.instructions() else { panic!("two poses") };
    let at = |now| run.progress(now);
    assert_eq!(at(5.0), Progress::Countdown { seconds_left: 3.0, instruction: bend });
    assert_eq!(at(8.25), Progress::Measuring { seconds_left: 0.25, instruction: bend });
    assert_eq!(at(9.5), Progress::Countdown { seconds_left: 2.0, instruction: twist });
    assert_eq!(at(11.75), Progress::Measuring { seconds_left: 0.25, instruction: twist });
    assert_eq!(at(12.0), Progress::Over);
    for step in CalibrationStep::ALL {
        assert_eq!(step.to_string().parse(), Ok(step));
    }
    assert!("dance".parse::<CalibrationStep>().unwrap_err().to_string().contains("sweep"));
}

#[test]
fn zero_takes_the_mean_of_what_is_held_and_leaves_what_moves() {
    let truth = Truth::new();
    // During the countdown the puppet may do anything; then a hand shakes a little, and the last part moves.
    let shaking = |seconds: f64| {
        let shake = if seconds < 3.0 { 1.0 } else { 2e-3 * (TAU * 4.0 * seconds).sin() };
        [shake, -shake, shake, shake, if seconds < 3.0 { 0.0 } else { 0.5 * (seconds - 3.0) }]
    };
    let report = truth.run(CalibrationStep::Zero, &Calibration::default(), shaking).unwrap();
    let found = zeros(&report.calibration);
    for slot in 0..4 {
        let apart = wrapped((f64::from(found[slot].unwrap()) - f64::from(truth.zeros[slot])) / TURN * TAU);
        assert!(apart.abs() < 2.0 * TAU / TURN, "sensor {slot}: {apart}");
        assert!(matches!(report.findings[slot].finding, Finding::Zeroed(_)));
    }
    assert_eq!(found[4], None);
    assert!(
        matches!(report.findings[4].finding, Finding::Moved(degrees) if (degrees - 14.0).abs() < 1.0),
        "{:?}",
        report.findings[4]
    );
    assert!(report.findings[4].finding.to_string().contains("held still"));
}

#[test]
fn a_sweep_finds_range_direction_and_wrap_around() {
    let truth = Truth::new();
    let stops = [(1.0, -0.7), (2.0, -0.1), (0.3, -2.9), (2.6, -2.2)];
    // To the first stop, to the other one and back; the last joint is not moved.
    let swept = |seconds: f64| {
        let t = (seconds - 3.0) / 8.0;
        let mut angles = [0.0; 5];
        for (angle, (most, least)) in angles.iter_mut().zip(stops) {
            *angle = if t <= 0.0 {
                0.0
            } else if t < 0.25 {
                most * t * 4.0
            } else if t < 0.75 {
                most + (least - most) * (t - 0.25) * 2.0
            } else {
                least * (1.0 - t) * 4.0
            };
        }
        angles
    };
    let report = truth.run(CalibrationStep::Sweep, &truth.zeroed(), swept).unwrap();
    let sensors: Vec<_> = report.calibration.parts().flat_map(|(_, sensors)| sensors.to_vec()).collect();
    for (slot, (most, least)) in stops.into_iter().enumerate() {
        let sensor = sensors[slot];
        assert_eq!(sensor.reversed, truth.backwards[slot], "sensor {slot}");
        let span = f64::from(sensor.range.unwrap().span_counts) / TURN * TAU;
        assert!((span - (most - least)).abs() < 0.12, "sensor {slot}: {span}");
        // Over the whole travel the angle is the true one, without a jump.
        for on in 0..=100 {
            let angle = least + (most - least) * f64::from(on) / 100.0;
            let mut angles = [0.0; 5];
            angles[slot] = angle;
            let told = sensor.angle(truth.counts(angles)[slot], 16_384).unwrap();
            assert!((told - angle).abs() < 1e-3, "sensor {slot}: {told} instead of {angle}");
        }
        let across = matches!(report.findings[slot].finding, Finding::Swept { across_zero: true, .. });
        assert_eq!(across, [true, true, false, true][slot], "{:?}", report.findings[slot]);
    }
    assert_eq!(sensors[4].range, None);
    assert!(matches!(report.findings[4].finding, Finding::NotMoved(_)));
    assert_eq!(zeros(&report.calibration), zeros(&truth.zeroed()), "a sweep changes no zero");
}

#[test]
fn the_mounting_step_finds_the_full_attitude_of_a_part() {
    let truth = Truth::new();
    let skeleton = skeleton(&[("thigh", "", [0.0, 1.0, 0.0]), ("shin", "thigh", [0.0, 0.5, 0.0])]);
    let mapping = Mapping {
        entries: vec![MappingEntry::new(uid(0), "thigh"), MappingEntry::new(uid(1), "shin")],
        ..Mapping::default()
    };
    // The hip is glued on rotated about all axes, the knee by a quarter turn, so that it takes bends for its own twist.
    let mounted = Quat::from_xyzw(0.2, -0.5, 0.4, 0.6).normalize();
    let hip = |meant: Quat| joint_angles(TBT, mounted.inverse() * meant * mounted);
    let pose = |bend: f64, twist: f64| {
        let meant = if bend > 0.0 { Quat::from_rotation_x(bend as f32) } else { Quat::from_rotation_y(twist as f32) };
        let [a, b, c] = hip(meant);
        [a, b, c, 0.0, twist]
    };
    let posed = |seconds: f64| match seconds {
        s if s < 2.9 => [0.0; 5],
        s if s < 3.6 => pose(1.0, 0.0),
        _ => pose(0.0, 0.8),
    };
    let mut zeroed = truth.zeroed();
    for slot in 0..5 {
        let (part, sensor) = [(0, 0), (0, 1), (0, 2), (1, 0), (2, 0)][slot];
        zeroed.sensor_mut(uid(part), sensor).unwrap().reversed = truth.backwards[slot];
    }
    let report = truth.run(CalibrationStep::Mounting, &zeroed, posed).unwrap();
    let found = report.calibration.part_settings(uid(0)).mounting;
    assert!(found.dot(mounted).abs() > 1.0 - 1e-5, "{found} instead of {mounted}");
    assert!(matches!(report.findings[0].finding, Finding::Mounted { residual_degrees, .. } if residual_degrees < 0.5));
    assert!(matches!(report.findings[1].finding, Finding::NotMoved(_)), "the knee was left alone");
    assert!(
        matches!(report.findings[2].finding, Finding::Mounted { degrees, .. } if degrees < 0.5),
        "a twist about its own axis"
    );

    // With that, the character's bones turn as intended, whatever the hand does.
    let mut solver = PoseSolver::new(&truth.tree, &report.calibration, &mapping, &skeleton).unwrap();
    let frame = skeleton.bone_from_joint(0, &skeleton.rest_model_from_bone());
    let meant = (Quat::from_rotation_x(0.4) * Quat::from_rotation_z(-0.7)).normalize();
    let [a, b, c] = hip(meant);
    let mut got = Pose::default();
    let counts = truth.counts([a, b, c, 0.0, 0.0]);
    solver.solve(0, &counts, &[SensorState::Ok; 5], &mut got).unwrap();
    let expected = frame * meant * frame.inverse();
    assert!(got.parent_from_bone[0].rotation.dot(expected).abs() > 1.0 - 1e-5);
}

#[test]
fn motions_that_tell_nothing_change_nothing() {
    let truth = Truth::new();
    // The same motion twice: about the middle sensor.
    let twice = |seconds: f64| if seconds < 2.9 { [0.0; 5] } else { [0.0, 1.0, 0.0, 0.0, 0.0] };
    let report = truth.run(CalibrationStep::Mounting, &truth.zeroed(), twice).unwrap();
    assert!(matches!(report.findings[0].finding, Finding::NoMounting(_)), "{:?}", report.findings[0]);
    let once = |seconds: f64| if (2.9..3.6).contains(&seconds) { [0.0, 1.0, 0.0, 0.0, 0.0] } else { [0.0; 5] };
    let report = truth.run(CalibrationStep::Mounting, &truth.zeroed(), once).unwrap();
    assert_eq!(report.findings[0].finding, Finding::OneMotion);
    let unzeroed = truth.run(CalibrationStep::Mounting, &Calibration::default(), twice).unwrap();
    assert_eq!(unzeroed.findings[0].finding, Finding::NotZeroed);
    assert_eq!(unzeroed.calibration.set_parts().count(), 0);
}

#[test]
fn heading_makes_what_the_puppet_faces_the_front_and_leaves_its_lean() {
    let tree = puppet(&[("hips", TBT, "")]);
    let skeleton = skeleton(&[("hips", "", [0.0, 1.0, 0.0])]);
    let mapping = Mapping { entries: vec![MappingEntry::new(uid(0), "hips")], ..Mapping::default() };
    let mut calibration = Calibration::for_tree(&tree);
    let zero = RawSample { counts: vec![0; 3], states: vec![SensorState::Ok; 3], ..RawSample::default() };
    calibration.zero(&tree, &zero).unwrap();
    // It leans forward by 0.3 and faces 2.5 rad to the left: almost backwards, where angles wrap.
    let lean = Quat::from_rotation_x(0.3);
    let model_turn = Quat::from_rotation_y(2.5) * lean;
    let frame = skeleton.bone_from_joint(0, &skeleton.rest_model_from_bone());
    let angles = joint_angles(TBT, frame.inverse() * model_turn * frame);
    let counts: Vec<u16> = angles.iter().map(|angle| (angle / TAU * TURN).round().rem_euclid(TURN) as u16).collect();
    let sample = RawSample { counts: counts.clone(), states: vec![SensorState::Ok; 3], ..RawSample::default() };
    for _again in 0..2 {
        let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
        let mut pose = Pose::default();
        solver.solve(0, &counts, &sample.states, &mut pose).unwrap();
        let mut run = CalibrationRun::begin(CalibrationStep::Heading, TIMES, 0.0);
        for tick in 0..40 {
            run.take(&Reading {
                now: f64::from(tick) * 0.1,
                sample: &sample,
                tree: &tree,
                root_turn: solver.root_turn(),
            });
        }
        let report = run.finish(&calibration, Some(&mapping)).unwrap();
        assert!(
            matches!(report.findings[0].finding, Finding::Heading(degrees) if (degrees - 2.5_f64.to_degrees()).abs() < 0.1)
        );
        calibration = report.calibration;
    }
    let mut unzeroed = CalibrationRun::begin(CalibrationStep::Heading, TIMES, 0.0);
    let root_turn = Some((uid(0), Quat::IDENTITY));
    unzeroed.take(&Reading { now: 3.1, sample: &sample, tree: &tree, root_turn });
    let report = unzeroed.finish(&Calibration::for_tree(&tree), None).unwrap();
    assert_eq!(report.findings[0].finding, Finding::NotZeroed, "a part that was never zeroed has no heading");

    let mut solver = PoseSolver::new(&tree, &calibration, &mapping, &skeleton).unwrap();
    let mut pose = Pose::default();
    solver.solve(0, &counts, &sample.states, &mut pose).unwrap();
    let got = pose.parent_from_bone[0].rotation;
    assert!(got.dot(lean).abs() > 1.0 - 1e-5, "{got}");
}

#[test]
fn what_goes_wrong_is_named_and_changes_nothing() {
    let truth = Truth::new();
    let run = CalibrationRun::begin(CalibrationStep::Zero, TIMES, 0.0);
    let error = run.finish(&Calibration::default(), None).unwrap_err();
    assert_eq!(error, StepError::NoSamples { step: CalibrationStep::Zero });
    let mut run = CalibrationRun::begin(CalibrationStep::Sweep, TIMES, 0.0);
    let sample = |sensors: usize| RawSample {
        counts: vec![1; sensors],
        states: vec![SensorState::Ok; sensors],
        ..RawSample::default()
    };
    let smaller = JointTree::new(truth.tree.parts()[..2].to_vec()).unwrap();
    run.take(&Reading { now: 3.5, sample: &sample(5), tree: &truth.tree, root_turn: None });
    run.take(&Reading { now: 3.6, sample: &sample(4), tree: &smaller, root_turn: None });
    let error = run.finish(&Calibration::default(), None).unwrap_err();
    assert_eq!(error, StepError::TreeChanged { step: CalibrationStep::Sweep });
    // A sensor that does not answer, for every one that does.
    let mut run = CalibrationRun::begin(CalibrationStep::Zero, TIMES, 0.0);
    let mut weak = sample(5);
    weak.states[1] = SensorState::MagnetWeak;
    weak.counts.pop();
    run.take(&Reading { now: 3.1, sample: &weak, tree: &truth.tree, root_turn: None });
    weak.counts.push(7);
    run.take(&Reading { now: 3.2, sample: &weak, tree: &truth.tree, root_turn: None });
    let report = run.finish(&Calibration::default(), None).unwrap();
    assert_eq!(report.findings[1].finding, Finding::Unreadable(SensorState::MagnetWeak));
    assert!(report.findings[1].finding.is_bad() && report.findings[1].finding.to_string().contains("magnet"));
    assert_eq!(report.findings.iter().filter(|found| !found.finding.is_bad()).count(), 4);
}
