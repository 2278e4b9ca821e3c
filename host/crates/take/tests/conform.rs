//! Conforming to the rates of film and video: exact times, and no wobble where the rate falls.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]
#![allow(clippy::float_cmp, reason = "what is copied keeps its bits")]

mod support;

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use armature_rig::{Motion, Pose};
use armature_take::{FrameRate, ResampleSettings, Take, TakeWriter, Timecode, Timeline, resample};
use glam::{Quat, Vec3};
use proptest::prelude::*;
use support::{arm, bits, header, raw, read};

const RATES: [&str; 12] = ["23.976", "24", "25", "29.97", "29.97df", "30", "48", "50", "59.94", "59.94df", "60", "120"];

fn rate(text: &str) -> FrameRate {
    text.parse().unwrap()
}

fn record(micros: impl Iterator<Item = u64>, motion: impl Fn(f64) -> Pose) -> Take {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&arm()).unwrap();
    for (n, micros) in micros.enumerate() {
        writer.sample(&raw(n as u32, micros), None).unwrap();
        writer.pose(n as u32, micros, &motion(micros as f64 * 1e-6)).unwrap();
    }
    read(&writer.finish().unwrap())
}

fn conform(take: &Take, frames_per_second: f64, low_pass: bool) -> Motion {
    let settings = ResampleSettings { frames_per_second, low_pass, ..ResampleSettings::default() };
    resample(&Timeline::recorded(take).unwrap(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap().motion
}

fn axis() -> Vec3 {
    Vec3::new(1.0, 2.0, -0.5).normalize()
}

/// The lower arm turned about a slanted axis by this much, and the root moved by it.
fn turned(angle: f64) -> Pose {
    let mut pose = arm().rest_pose();
    pose.parent_from_bone[0].translation.z = angle as f32;
    pose.parent_from_bone[1].rotation = Quat::from_axis_angle(axis(), angle as f32);
    pose
}

/// By how much the lower arm is turned in a frame, and how far the root is.
fn measured(pose: &Pose) -> [f64; 2] {
    let turn = pose.parent_from_bone[1].rotation.as_dquat().normalize().to_scaled_axis();
    assert!(turn.reject_from(axis().as_dvec3().normalize()).length() < 1e-5, "the axis stays");
    [turn.dot(axis().as_dvec3()), f64::from(pose.parent_from_bone[0].translation.z)]
}

/// The amplitude of a frequency in values at a constant rate, away from the ends.
fn amplitude(values: &[f64], hertz: f64, fps: f64) -> f64 {
    let inside = values.len() / 4..values.len() * 3 / 4;
    // Least squares of sine and cosine: exact whatever the number of periods.
    let [mut ss, mut sc, mut cc, mut sv, mut cv] = [0.0; 5];
    for n in inside {
        let (s, c) = (TAU * hertz * n as f64 / fps).sin_cos();
        (ss, sc, cc) = (ss + s * s, sc + s * c, cc + c * c);
        (sv, cv) = (sv + s * values[n], cv + c * values[n]);
    }
    let determinant = ss * cc - sc * sc;
    ((sv * cc - cv * sc) / determinant).hypot((cv * ss - sv * sc) / determinant)
}

/// A tremor of 20 Hz exported at 24 frames a second comes back as one of 4 Hz, unless it is filtered out; what is slow
/// enough stays.
#[test]
fn what_the_frame_rate_cannot_show_does_not_come_back_as_a_wobble() {
    let (fps, slow, fast) = (24.0, 3.0, 20.0);
    let motion = |t: f64| turned(0.8 * (TAU * slow * t).sin() + 0.2 * (TAU * fast * t).sin());
    for times in [1000, 120].map(|hertz: u64| (0..20 * hertz).map(move |n| n * 1_000_000 / hertz + (n * 7 % 5) * 90)) {
        let take = record(times, motion);
        for (low_pass, alias) in [(false, 0.19..0.21), (true, 0.0..0.004)] {
            let out = conform(&take, fps, low_pass);
            for part in 0..2 {
                let values: Vec<f64> = out.frames.iter().map(|frame| measured(frame)[part]).collect();
                let (kept, wobble) = (amplitude(&values, slow, fps), amplitude(&values, fps - fast, fps));
                assert!((kept - 0.8).abs() < 0.012, "{kept} of 0.8 is kept (low-pass {low_pass})");
                assert!(alias.contains(&wobble), "a wobble of {wobble} (low-pass {low_pass})");
            }
        }
    }
}

#[test]
fn the_low_pass_has_no_lag_and_keeps_constant_speeds_up_to_the_ends() {
    let take = record((0..2_000).map(|n| n * 1_000 + n % 3 * 200), |t| turned(-0.5 + 0.9 * t));
    let out = conform(&take, 25.0, true);
    assert_eq!(out.frames.len(), 50);
    for (n, frame) in out.frames.iter().enumerate() {
        let [turn, place] = measured(frame);
        let expected = -0.5 + 0.9 * n as f64 / 25.0;
        assert!((turn - expected).abs() < 1e-5 && (place - expected).abs() < 1e-5, "frame {n}: {turn}, {expected}");
        assert_eq!(frame.parent_from_bone[2], arm().bones()[2].rest, "what never moves keeps its bits");
    }
}

#[test]
fn the_low_pass_does_nothing_where_the_rate_does_not_fall() {
    let take = record((0..100).map(|n| n * 40_000), |t| turned((3.0 * t).sin()));
    for fps in [25.0, 30.0, 60.0] {
        let (plain, filtered) = (conform(&take, fps, false), conform(&take, fps, true));
        assert!(plain.frames.iter().zip(&filtered.frames).all(|(a, b)| bits(a) == bits(b)), "{fps}");
    }
}

/// A gap that is held does not leak: frames before it know nothing of what comes after.
#[test]
fn the_low_pass_does_not_see_across_a_gap() {
    let times = || (0..500).map(|n| n * 1_000).chain((0..500).map(|n| 1_500_000 + n * 1_000));
    let jump = |after: f64| record(times(), move |t| turned(if t < 1.0 { 0.3 } else { after }));
    let (one, other) = (conform(&jump(0.9), 24.0, true), conform(&jump(-0.4), 24.0, true));
    for frame in 0..36 {
        assert_eq!(bits(&one.frames[frame]), bits(&other.frames[frame]), "frame {frame}");
    }
    assert!((measured(&one.frames[40])[0] - 0.9).abs() < 1e-5);
}

proptest! {
    /// Frames lie where the exact fraction says, at every rate: each is the motion there up to what interpolation costs.
    #[test]
    fn every_frame_lies_on_its_exact_time(name in prop::sample::select(&RATES[..]), low_pass in any::<bool>()) {
        let (numerator, denominator) = rate(name).fraction();
        let take = record((0..3_000).map(|n| n * 1_000), |t| turned((1.3 * t).sin()));
        let out = conform(&take, rate(name).frames_per_second(), low_pass);
        let frames = 2_999 * u64::from(numerator) / (1_000 * u64::from(denominator)) + 1;
        prop_assert_eq!(out.frames.len() as u64, frames);
        prop_assert!((out.frame_seconds * f64::from(numerator) / f64::from(denominator) - 1.0).abs() < 1e-15);
        for (n, frame) in out.frames.iter().enumerate() {
            let seconds = n as f64 * f64::from(denominator) / f64::from(numerator);
            let bound = if low_pass { 3e-4 } else { 1e-5 };
            prop_assert!((measured(frame)[0] - (1.3 * seconds).sin()).abs() < bound, "{}: frame {}", name, n);
        }
        let last = Timecode::zero(rate(name)).unwrap().after(frames - 1);
        prop_assert_eq!(last.frame(), frames - 1);
    }
}
