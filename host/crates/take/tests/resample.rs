//! Resampling: true to the motion, and honest about the rate and about what was not measured.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;

use armature_rig::{Pose, Transform};
use armature_take::{
    Event, EventKind, HeldGap, ResampleError, ResampleSettings, Resampled, Take, TakeWriter, Timeline, resample,
};
use glam::{DQuat, DVec3, Quat, Vec3};
use proptest::prelude::*;
use support::{arm, bits, header, raw, read};

fn go_on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn at_rate(take: &Take, frames_per_second: f64) -> Resampled {
    let settings = ResampleSettings { frames_per_second, ..ResampleSettings::default() };
    resample(&Timeline::recorded(take).unwrap(), &settings, &mut go_on).unwrap()
}

/// Angular frequency in radians per second and amplitude in radians of the lower arm.
const OMEGA: f64 = 5.0;
const AMPLITUDE: f64 = 1.1;

fn swing(seconds: f64) -> f64 {
    AMPLITUDE * (OMEGA * seconds).sin()
}

fn stride(seconds: f64) -> f64 {
    0.4 * seconds * seconds
}

/// A motion known at every time: the lower arm swings about a slanted axis, the root accelerates along Z.
fn motion(seconds: f64) -> Pose {
    let mut pose = arm().rest_pose();
    pose.parent_from_bone[0].translation.z = stride(seconds) as f32;
    pose.parent_from_bone[1].rotation = Quat::from_axis_angle(axis(), swing(seconds) as f32);
    pose
}

fn axis() -> Vec3 {
    Vec3::new(1.0, 2.0, -0.5).normalize()
}

/// Records `motion` at these device times, in this order; the first one is the motion's time zero.
fn record(device_micros: &[u64]) -> Take {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&arm()).unwrap();
    let zero = device_micros[0];
    for (n, &micros) in device_micros.iter().enumerate() {
        let seconds = (i128::from(micros) - i128::from(zero)) as f64 * 1e-6;
        writer.sample(&raw(n as u32, micros), None).unwrap();
        writer.pose(n as u32, micros, &motion(seconds)).unwrap();
    }
    read(&writer.finish().unwrap())
}

/// The angle between a rotation and the motion's at this time, well conditioned near zero.
fn turn_error(got: &Transform, seconds: f64) -> f64 {
    let (sin, cos) = (0.5 * swing(seconds)).sin_cos();
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize() * sin;
    let difference = got.rotation.as_dquat().normalize() * DQuat::from_xyzw(axis.x, axis.y, axis.z, cos).conjugate();
    2.0 * difference.xyz().length().min(1.0).asin()
}

proptest! {
    /// Linear interpolation of f over a step h is off by at most h²/8 · max |f''|, whatever the jitter.
    #[test]
    fn jittered_timestamps_stay_within_the_bound_of_linear_interpolation(
        steps in prop::collection::vec(2_000_u64..9_000, 100..200),
        rate in prop::sample::select(vec![23.976, 24.0, 25.0, 29.97, 30.0, 60.0, 120.0, 333.3]),
        start in 0_u64..1 << 60,
    ) {
        let times: Vec<u64> = std::iter::once(0).chain(steps).scan(start, |t, dt| { *t += dt; Some(*t) }).collect();
        let take = record(&times);
        let result = at_rate(&take, rate);
        let h = times.windows(2).map(|w| w[1] - w[0]).max().unwrap() as f64 * 1e-6;
        let turn_bound = h * h / 8.0 * AMPLITUDE * OMEGA * OMEGA + 1e-6;
        let stride_bound = h * h / 8.0 * 0.8 + 1e-6;
        prop_assert_eq!(result.motion.frame_seconds.to_bits(), (1.0 / rate).to_bits());
        let span = (times[times.len() - 1] - times[0]) as f64 * 1e-6;
        prop_assert!(result.motion.duration_seconds() <= span + 1e-6);
        prop_assert!(result.motion.duration_seconds() > span - 1.0 / rate - 1e-6);
        prop_assert_eq!((result.frames_before_first, result.frames_after_last, result.held_gaps.len()), (0, 0, 0));
        for (n, frame) in result.motion.frames.iter().enumerate() {
            let seconds = n as f64 / rate;
            let error = turn_error(&frame.parent_from_bone[1], seconds);
            prop_assert!(error <= turn_bound, "frame {}: {} > {}", n, error, turn_bound);
            let z = f64::from(frame.parent_from_bone[0].translation.z);
            prop_assert!((z - stride(seconds)).abs() <= stride_bound);
            prop_assert_eq!(frame.parent_from_bone[2], arm().bones()[2].rest);
        }
    }

    #[test]
    fn any_device_times_survive(
        times in prop::collection::vec(prop_oneof![any::<u64>(), 0_u64..3_000_000, Just(0)], 1..30),
        rate in prop_oneof![any::<f64>(), 1.0..100.0],
        range in prop::option::of((any::<f64>(), any::<f64>())),
        hold_gaps_over_seconds in any::<f64>(),
        low_pass in any::<bool>(),
    ) {
        let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
        writer.skeleton(&arm()).unwrap();
        for (n, &micros) in times.iter().enumerate() {
            writer.sample(&raw(n as u32, micros), Some(n as f64)).unwrap();
            writer.pose(n as u32 / 2, micros, &support::pose(n as u32)).unwrap();
        }
        let take = read(&writer.finish().unwrap());
        let timeline = Timeline::recorded(&take).unwrap();
        let settings = ResampleSettings { frames_per_second: rate, range_seconds: range, hold_gaps_over_seconds, low_pass };
        // Cancelled early: some of these ask for millions of frames.
        let mut calls = 0;
        let _ = resample(&timeline, &settings, &mut |_, _| { calls += 1; if calls > 9 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) } });
    }
}

#[test]
fn at_the_recorded_rate_every_frame_is_the_recorded_pose_to_the_bit() {
    let times: Vec<u64> = (0..200).map(|n| 77_000_000 + 10_000 * n).collect();
    let take = record(&times);
    let result = at_rate(&take, 100.0);
    assert_eq!(result.motion.frames.len(), 200);
    for (packed, frame) in take.poses().zip(&result.motion.frames) {
        assert_eq!(bits(&take.unpack(packed)), bits(frame));
    }
}

#[test]
fn samples_twice_and_out_of_order_give_the_motion_of_the_ordered_ones() {
    let ordered: Vec<u64> = (0..100).map(|n| 5_000_000 + 10_000 * n).collect();
    let mut shuffled = ordered.clone();
    shuffled.swap(10, 12);
    shuffled.swap(50, 51);
    shuffled.insert(31, ordered[30]);
    shuffled.insert(71, ordered[68]);
    let (expected, take) = (record(&ordered), record(&shuffled));
    assert_eq!(at_rate(&take, 60.0).motion, at_rate(&expected, 60.0).motion);
    let report = Timeline::recorded(&take).unwrap().report().clone();
    assert_eq!((report.duplicates, report.restarts.len()), (2, 0));
    assert!(report.out_of_order >= 3);
}

#[test]
fn a_long_gap_is_held_and_named() {
    let times: Vec<u64> = (0..50).map(|n| 10_000 * n).chain((0..50).map(|n| 1_490_000 + 10_000 * n)).collect();
    let take = record(&times);
    let result = at_rate(&take, 20.0);
    assert_eq!(result.held_gaps, [HeldGap { start_seconds: 0.49, end_seconds: 1.49 }]);
    for frame in 10..30 {
        assert_eq!(bits(&result.motion.frames[frame]), bits(&motion(0.49)), "frame {frame}");
    }
    assert!(turn_error(&result.motion.frames[30].parent_from_bone[1], 1.5) < 1e-2);
    let bridged = ResampleSettings { frames_per_second: 20.0, hold_gaps_over_seconds: 2.0, ..Default::default() };
    let bridged = resample(&Timeline::recorded(&take).unwrap(), &bridged, &mut go_on).unwrap();
    assert_eq!(bridged.held_gaps, []);
    let middle = bridged.motion.frames[20].parent_from_bone[0].translation.z;
    assert!((f64::from(middle) - (stride(0.49) + (stride(1.49) - stride(0.49)) * 0.51)).abs() < 1e-6);
}

#[test]
fn a_range_is_cut_exactly_and_its_edges_are_told() {
    let times: Vec<u64> = (0..=100).map(|n| 10_000 * n).collect();
    let take = record(&times);
    let timeline = Timeline::recorded(&take).unwrap();
    let settings =
        ResampleSettings { frames_per_second: 10.0, range_seconds: Some((-0.25, 1.25)), ..Default::default() };
    let result = resample(&timeline, &settings, &mut go_on).unwrap();
    assert_eq!((result.motion.frames.len(), result.frames_before_first, result.frames_after_last), (16, 3, 3));
    assert_eq!(bits(&result.motion.frames[0]), bits(&motion(0.0)));
    assert_eq!(bits(&result.motion.frames[15]), bits(&motion(1.0)));
    assert_eq!(result.start_seconds.to_bits(), (-0.25_f64).to_bits());
}

#[test]
fn a_restart_of_the_device_is_bridged_by_the_hosts_clock() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&arm()).unwrap();
    let run = |writer: &mut TakeWriter<Vec<u8>>, device: u64, host: f64, from: u32| {
        for n in 0..10_u32 {
            let micros = device + 10_000 * u64::from(n);
            writer.sample(&raw(n, micros), Some(host + 0.01 * f64::from(n))).unwrap();
            writer.pose(n, micros, &support::pose(from + n)).unwrap();
        }
    };
    run(&mut writer, 0, 100.0, 0);
    writer.event(&Event { device_micros: None, host_seconds: None, kind: EventKind::Restart }).unwrap();
    // The same clock and sequence numbers again: only the event shows it.
    run(&mut writer, 0, 103.0, 10);
    let take = read(&writer.finish().unwrap());
    let timeline = Timeline::recorded(&take).unwrap();
    assert_eq!(timeline.len(), 20);
    let restart = timeline.report().restarts[0];
    assert!((restart.at_seconds - 3.0).abs() < 1e-6 && restart.measured, "{restart:?}");
    let (seconds, packed) = timeline.get(19).unwrap();
    assert!((seconds - 3.09).abs() < 1e-6);
    assert_eq!(bits(&take.unpack(packed)), bits(&support::pose(19)));
    assert_eq!((timeline.at(-1.0), timeline.at(0.015), timeline.at(1.0), timeline.at(99.0)), (0, 1, 9, 19));
}

#[test]
fn what_makes_no_motion_is_refused_with_a_remedy() {
    let take = record(&[0, 10_000]);
    let timeline = Timeline::recorded(&take).unwrap();
    let run = |rate, range_seconds| {
        let settings = ResampleSettings { frames_per_second: rate, range_seconds, ..Default::default() };
        resample(&timeline, &settings, &mut go_on).map(|r| r.motion.frames.len())
    };
    for rate in [0.0, -30.0, f64::NAN, f64::INFINITY, 1e-320] {
        assert!(matches!(run(rate, None), Err(ResampleError::BadRate { .. })), "{rate}");
    }
    for range in [(1.0, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
        assert!(matches!(run(30.0, Some(range)), Err(ResampleError::BadRange { .. })), "{range:?}");
    }
    assert!(matches!(run(30.0, Some((0.0, 1e12))), Err(ResampleError::TooMany { .. })));
    assert_eq!(run(30.0, Some((5.0, 5.0))), Ok(1));
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&arm()).unwrap();
    let empty = read(&writer.finish().unwrap());
    let nothing = resample(&Timeline::recorded(&empty).unwrap(), &ResampleSettings::default(), &mut go_on);
    assert_eq!(nothing, Err(ResampleError::NoPoses));
    let mut broken = TakeWriter::new(Vec::new(), &header()).unwrap();
    broken.skeleton(&arm()).unwrap();
    let mut pose = motion(0.0);
    pose.parent_from_bone[1].rotation = Quat::from_array([0.0; 4]);
    broken.pose(0, 0, &pose).unwrap();
    pose.parent_from_bone[1].rotation.x = f32::NAN;
    broken.pose(1, 50_000, &pose).unwrap();
    let broken = read(&broken.finish().unwrap());
    let outcome = resample(&Timeline::recorded(&broken).unwrap(), &ResampleSettings::default(), &mut go_on);
    assert!(matches!(outcome, Err(ResampleError::Motion(_))));
}
