//! Joints that are glued in askew: after the mounting step they drive their bones like straight ones.

use armature::engine::drive::drive_calibration;
use armature::engine::machine::{Engine, EngineSettings};
use armature::engine::pipeline::Pipeline;
use armature::engine::puppeteer::{Puppeteer, ZeroPolicy};
use armature::engine::sources::{Source as _, VirtualSource};
use armature_rig::{Calibration, CalibrationStep, Finding, Pose, StepTimes};
use armature_sim::{Body, JointTrack, Motion, Puppet, PuppetSettings, TrackEnd};
use armature_tests::bones_of;
use firmware_protocol::PartKind;
use glam::{DQuat, DVec3};

const RATE: f64 = 200.0;
/// Countdown and hold of each instruction; zeroing is the first.
const TIMES: StepTimes = StepTimes { countdown: 0.5, hold: 0.5, sweep: 1.0 };
/// The puppet rests for the first instruction, then has this long for each of the next two.
const INSTRUCTION_SECONDS: f64 = TIMES.countdown + TIMES.hold;
const FRAME_SECONDS: f64 = 0.1;

/// How each joint is mounted: `nominal_from_mounted`, by up to a quarter turn, each about a different axis.
fn seat(part: usize) -> DQuat {
    let golden = 2.399_963 * part as f64;
    let axis = DVec3::new(golden.cos(), (1.7 * golden).sin(), golden.sin()).normalize();
    DQuat::from_axis_angle(axis, 0.15 + 1.4 * (0.618_034 * part as f64).fract())
}

fn joints(body: &Body) -> Vec<usize> {
    (0..body.parts().len()).filter(|&part| body.parts()[part].kind == PartKind::TwistBendTwist).collect()
}

/// A human whose ball joints all make these turns, one second each; `askew`: as measured by joints mounted askew.
fn puppet(turns: &[DQuat], askew: bool) -> Puppet {
    let body = Body::preset("human", 7).unwrap();
    let parts = joints(&body);
    let frames = (INSTRUCTION_SECONDS / FRAME_SECONDS) as usize;
    let mut rotations = vec![[0.0, 0.0, 0.0, 1.0]; parts.len()];
    for turn in turns {
        for _ in 0..frames {
            rotations.extend(parts.iter().map(|&part| {
                let seat = if askew { seat(part) } else { DQuat::IDENTITY };
                (seat.inverse() * *turn * seat).to_array()
            }));
        }
    }
    let track = JointTrack { frame_seconds: FRAME_SECONDS, parts, rotations, end: TrackEnd::Hold };
    let rest_micros = (INSTRUCTION_SECONDS * 1e6) as u64;
    Puppet::new(PuppetSettings { motion: Motion::Track(track), seed: 7, rest_micros, ..PuppetSettings::new(body) })
        .unwrap()
}

/// The pose of the human at the end of a motion of one turn.
fn pose(turn: DQuat, askew: bool, calibration: Calibration, zero: ZeroPolicy) -> Pose {
    let puppeteer = Puppeteer::new(bones_of("human"), None, calibration, zero).unwrap();
    let mut pipeline: Pipeline<std::io::Sink> = Pipeline::new(puppeteer);
    let mut source = VirtualSource::of(puppet(&[turn], askew), RATE);
    while source.now() < 2.5 * INSTRUCTION_SECONDS {
        if let Some(event) = source.next_event() {
            pipeline.handle(&event).unwrap();
        }
    }
    pipeline.puppeteer().pose().clone()
}

fn worst_degrees(a: &Pose, b: &Pose) -> f64 {
    let apart = a.parent_from_bone.iter().zip(&b.parent_from_bone).map(|(a, b)| {
        let d = a.rotation.as_dquat().normalize().inverse() * b.rotation.as_dquat().normalize();
        2.0 * d.xyz().length().atan2(d.w.abs()).to_degrees()
    });
    apart.fold(0.0, f64::max)
}

#[test]
fn joints_glued_in_askew_drive_their_bones_as_straight_ones_do() {
    let bent = DQuat::from_axis_angle(DVec3::X, 60_f64.to_radians());
    let twisted = DQuat::from_axis_angle(DVec3::Y, 60_f64.to_radians());
    let settings = EngineSettings {
        samples_per_second: RATE,
        zero_policy: ZeroPolicy::OnRequest,
        step_times: TIMES,
        ..EngineSettings::default()
    };
    let mut engine = Engine::new(settings);
    let mut source = VirtualSource::of(puppet(&[bent, twisted], true), RATE);
    let steps = [CalibrationStep::Zero, CalibrationStep::Mounting];
    let human = bones_of("human");
    let reports = drive_calibration(&mut engine, &mut source, human, "sim:human", &steps, &mut |_| ()).unwrap();

    let body = Body::preset("human", 7).unwrap();
    let parts = joints(&body);
    assert!(parts.len() >= 5, "{} ball joints", parts.len());
    let findings = &reports[1].findings;
    for &part in &parts {
        let uid = armature_rig::PartUid(body.parts()[part].uid.0);
        let found = findings.iter().find(|finding| finding.part == Some(uid)).unwrap();
        let true_degrees = 2.0 * seat(part).w.abs().acos().to_degrees();
        let Finding::Mounted { degrees, residual_degrees } = found.finding else { panic!("{found:?}") };
        assert!((degrees - true_degrees).abs() < 0.2 && residual_degrees < 0.2, "{found:?} instead of {true_degrees}");
    }
    let calibration = engine.puppeteer().unwrap().calibration().clone();
    for turn in [bent, DQuat::from_euler(glam::EulerRot::ZXY, 0.5, -0.4, 0.3)] {
        let straight = pose(turn, false, Calibration::default(), ZeroPolicy::AtStart);
        let uncorrected = pose(turn, true, Calibration::default(), ZeroPolicy::AtStart);
        let corrected = pose(turn, true, calibration.clone(), ZeroPolicy::WhenUnknown);
        assert!(worst_degrees(&straight, &uncorrected) > 20.0, "askew joints must show without the step");
        let apart = worst_degrees(&straight, &corrected);
        assert!(apart < 0.2, "{apart}° from straight joints");
    }
}
