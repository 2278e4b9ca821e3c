//! Takes of devices with a faulty clock: the timeline is still that of the performance, and the fault is named.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::ops::ControlFlow;

use armature_take::{ClockFaults, ExportSettings, Take, Timeline, export_bvh, summarize};

/// Real takes of one performance of four seconds in which a single sample leapt by 2³² and by 2⁶³ µs.
#[test]
fn one_leap_of_the_clock_does_not_stretch_a_take() {
    for name in ["x_jump32.take", "x_jump63.take"] {
        let Some(path) = armature_test_support::shared(&format!("cases/device/{name}")) else { return };
        let (take, report) = Take::read(&std::fs::read(path).unwrap()).unwrap();
        assert!(report.is_whole(), "{report}");
        let summary = summarize(&take);
        assert!((3.5..4.5).contains(&summary.duration_seconds), "{name}: {} s", summary.duration_seconds);
        assert_eq!(summary.clock_faults, ClockFaults { leapt: 1, ..ClockFaults::default() }, "{name}");
        // The session that recorded them greeted the device again after the leap.
        assert_eq!(summary.restarts, 1, "{name}");
        let timeline = Timeline::recorded(&take).unwrap();
        assert_eq!((timeline.report().clock_faults.leapt, timeline.report().out_of_order), (1, 0), "{name}");
        let exported = export_bvh(&take, &ExportSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap();
        let frames = exported.motion.resampled.motion.frames.len();
        assert!((105..=136).contains(&frames), "{name}: {frames} frames of 30 a second");
        assert!(exported.motion.resampled.held_gaps.is_empty(), "{name}");
    }
}
