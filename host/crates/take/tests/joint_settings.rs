//! Filters, mountings, ranges and the return of parts are stored in a take and read back, and a replay applies them.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;

use armature_rig::{Calibration, PartSettings, PartUid, RawSample, SensorRange, StreamSolver};
use armature_take::{
    EventKind, Header, PayloadError, Problem, Record, RecordKind, Take, TakeWriter, summarize, verify,
};
use glam::Quat;
use support::{arm, arm_calibration, arm_mapping, arm_tree, event, raw, read};

/// Everything that a calibration can contain.
fn rich() -> Calibration {
    let mut calibration = arm_calibration();
    calibration.filter = "hold:40".parse().unwrap();
    let parts: Vec<PartUid> = calibration.parts().map(|(uid, _)| uid).collect();
    let filter = Some("one-euro:1.5,0.25".parse().unwrap());
    let mounting = Quat::from_rotation_x(0.3);
    calibration.set_part_settings(parts[0], PartSettings { mounting, heading: -0.75, filter });
    // A part with settings that is not listed as calibrated.
    calibration.set_part_settings(PartUid([9; 12]), PartSettings { heading: 2.0, ..PartSettings::default() });
    let range = Some(SensorRange { first_counts: 16_000, span_counts: 5_000 });
    calibration.sensor_mut(parts[0], 0).unwrap().range = range;
    calibration
}

#[test]
fn what_a_calibration_says_comes_back() {
    let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
    writer.calibration(&arm_calibration()).unwrap();
    let plain = writer.totals();
    assert_eq!(plain.records, 2, "a plain calibration takes no more space than it ever did");
    writer.calibration(&rich()).unwrap();
    writer.engagement(250_000, true).unwrap();
    writer.event(&event(EventKind::Resync { count: 7 })).unwrap();
    let bytes = writer.finish().unwrap();
    let (take, report) = Take::read(&bytes).unwrap();
    assert!(report.is_whole(), "{report}");
    let expected = [
        Record::Calibration(arm_calibration()),
        Record::Calibration(rich()),
        Record::Engagement { micros: 250_000, all: true },
    ];
    assert_eq!(take.records()[..3], expected);
    assert_eq!(summarize(&take).resyncs, 7);
    assert_eq!(take.write(Vec::new()).unwrap(), bytes, "and is written again byte for byte");
}

#[test]
fn settings_that_stand_alone_or_cannot_be_are_named() {
    let whole = {
        let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
        writer.calibration(&rich()).unwrap();
        writer.finish().unwrap()
    };
    let at = |kind: RecordKind| {
        let found = whole.windows(2).position(|pair| pair == kind.code().to_le_bytes());
        found.unwrap()
    };
    // The calibration before it is damaged: what follows belongs to nothing.
    let mut damaged = whole.clone();
    damaged[at(RecordKind::Calibration) + 8] ^= 1;
    let (take, report) = Take::read(&damaged).unwrap();
    let alone = |problem: &Problem| matches!(problem, Problem::Unusable { reason: PayloadError::Alone, .. });
    assert!(report.problems.iter().any(alone), "{report}");
    assert!(take.records().is_empty());
}

/// Two sensors that swing, one of which is missing for a while.
fn sample(step: u32) -> RawSample {
    let tree = arm_tree();
    let mut sample = raw(step, u64::from(step) * 5_000);
    sample.epoch = 1;
    sample.counts = (0..tree.sensor_count()).map(|s| (2_000 + step * 11 + s as u32 * 77) as u16 % 4_096).collect();
    sample.states = vec![armature_rig::SensorState::Ok; tree.sensor_count()];
    if (40..80).contains(&step) {
        sample.states[0] = armature_rig::SensorState::NoData;
    }
    sample
}

#[test]
fn a_replay_goes_by_filters_and_by_the_way_back_bit_for_bit() {
    let mut solver = StreamSolver::new(arm());
    solver.set_topology(1, arm_tree());
    solver.set_mapping(arm_mapping());
    solver.set_calibration(rich());
    solver.engage(250_000, false);
    let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
    writer.skeleton(&arm()).unwrap();
    writer.topology(1, &arm_tree()).unwrap();
    writer.calibration(&rich()).unwrap();
    writer.mapping(&arm_mapping()).unwrap();
    writer.engagement(250_000, false).unwrap();
    for step in 0..200 {
        if step == 150 {
            solver.engage(100_000, true);
            writer.engagement(100_000, true).unwrap();
        }
        let sample = sample(step);
        let pose = solver.solve(&sample).unwrap().clone();
        writer.sample(&sample, None).unwrap();
        writer.pose(sample.sequence, sample.device_micros, &pose).unwrap();
    }
    let take = read(&writer.finish().unwrap());
    let verified = verify(&take, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert!(verified.is_exact() && verified.identical == 200, "{verified:?}");
    // Without the recorded settings the poses differ: the settings are needed.
    let mut other = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
    for record in take.records() {
        match record {
            Record::Engagement { .. } => {}
            Record::Calibration(_) => other.calibration(&arm_calibration()).unwrap(),
            record => other.record(record).unwrap(),
        }
    }
    let other = read(&other.finish().unwrap());
    assert!(verify(&other, &mut |_, _| ControlFlow::Continue(())).unwrap().different > 100);
}
