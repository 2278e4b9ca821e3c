//! Takes as CSV, `NumPy` arrays and MCAP, read by other people's libraries.
//!
//! `ARMATURE_MCAP_PYTHON` names a Python that has `numpy`, `mcap` and `mcap-protobuf-support`. Without it a check prints
//! that it is skipped; in CI it fails.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use armature_rig::{JointTree, PartKind, Pose, SensorState};
use armature_take::data::readings;
use armature_take::{
    ExportSettings, Header, McapError, Take, TakeWriter, csv_of, csv_of_motion, mcap_of, npz_of, take_motion,
};
use serde_json::{Value, json};
use support::{arm_tree, begun, header, part, raw, read};

fn go_on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Samples with states of all kinds, some without a pose, and a part that is plugged in later and never zeroed.
fn take() -> Take {
    let (mut writer, mut solver) = begun(&Header { unix_micros: Some(1_700_000_000_000_000), ..header() });
    let states = [SensorState::Ok, SensorState::MagnetWeak, SensorState::NoData, SensorState::Outlier];
    for n in 0..40 {
        let mut sample = raw(n, 5_000_000 + 10_000 * u64::from(n));
        sample.states[1] = states[n as usize % 4];
        writer.sample(&sample, Some(0.25 + 0.01 * f64::from(n))).unwrap();
        let pose = solver.solve(&sample).unwrap();
        if n % 5 != 3 {
            writer.pose(n, sample.device_micros, pose).unwrap();
        }
    }
    let mut parts = arm_tree().parts().to_vec();
    parts.push(part(3, PartKind::Twist, Some(1)));
    writer.topology(2, &JointTree::new(parts).unwrap()).unwrap();
    for n in 40..50 {
        let mut sample = raw(n, 5_000_000 + 10_000 * u64::from(n));
        sample.epoch = 2;
        sample.counts.push(77);
        sample.states.push(SensorState::Ok);
        writer.sample(&sample, None).unwrap();
    }
    read(&writer.finish().unwrap())
}

fn of_pose(pose: &Pose) -> Value {
    json!(pose.parent_from_bone.iter().map(|t| (t.translation.to_array(), t.rotation.to_array())).collect::<Vec<_>>())
}

#[test]
fn numbers_come_back() {
    let take = take();
    let motion = take_motion(&take, &ExportSettings::default(), &mut go_on).unwrap().resampled.motion;
    let readings = readings(&take);
    assert_eq!((readings.joints.len(), readings.rows.len()), (5, 50));
    let state = |state: SensorState| match state {
        SensorState::Ok => 0,
        SensorState::NoData => 1,
        SensorState::MagnetWeak => 2,
        SensorState::Outlier => 3,
    };
    let row = |n: usize| {
        let row = &readings.rows[n];
        let found = take.poses().find(|pose| pose.sequence == row.sample.raw.sequence);
        // The file's own numbers, not those that were gathered.
        let (raw, plugged) = (&row.sample.raw, row.sample.raw.counts.len());
        let counts: Vec<Value> = (0..5).map(|k| if k < plugged { json!(raw.counts[k]) } else { Value::Null }).collect();
        let states: Vec<Value> =
            (0..5).map(|k| if k < plugged { json!(state(raw.states[k])) } else { Value::Null }).collect();
        let angles: Vec<Option<f64>> = row.readings.iter().map(|cell| cell.and_then(|cell| cell.angle)).collect();
        json!({
            "seconds": n as f64 / 100.0, "sequence": n, "micros": 5_000_000 + 10_000 * n, "counts": counts,
            "states": states, "angles": angles, "pose": found.map(|pose| of_pose(&take.unpack(pose))),
        })
    };
    // Zeroed at 2048, 4096 counts a turn; the second sensor runs backwards.
    let first = &readings.rows[1].readings;
    let angle = |k: usize| first[k].unwrap().angle.unwrap();
    let count = std::f64::consts::TAU / 4096.0;
    assert!((angle(0) - count).abs() < 1e-12 && (angle(1) + 2.0 * count).abs() < 1e-12, "{first:?}");
    assert!(readings.rows[2].readings[1].unwrap().angle.is_none(), "a count without data is no angle");
    let skeleton = &motion.skeleton;
    let expected = json!({
        "bones": skeleton.bones().iter().map(|bone| &bone.name).collect::<Vec<_>>(),
        "parents": skeleton.bones().iter().map(|bone| bone.parent.map_or(-1, |p| p as i32)).collect::<Vec<_>>(),
        "joints": readings.joints.iter().map(armature_take::data::ReadJoint::name).collect::<Vec<_>>(),
        "joint_bones": ["upper", "upper", "upper", "hand", ""],
        "rows": (0..50).map(row).collect::<Vec<_>>(),
        "frames": motion.frames.iter().map(of_pose).collect::<Vec<_>>(),
        "frames_per_second": 30.0, "start_nanos": 1_700_000_000_000_000_000_i64,
    });
    let Some(python) = python() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("data");
    std::fs::create_dir_all(&folder).unwrap();
    let files = ["expected.json", "take.npz", "take.csv", "take.mcap"].map(|name| folder.join(name));
    std::fs::write(&files[0], expected.to_string()).unwrap();
    std::fs::write(&files[1], npz_of(&motion, Some(&take)).unwrap()).unwrap();
    std::fs::write(&files[2], csv_of(&take)).unwrap();
    std::fs::write(&files[3], mcap_of(&take, &mut go_on).unwrap()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/data_check.py");
    let output = Command::new(python).arg(script).args(&files).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{said}");
    assert!(output.status.success(), "{said}");
    // Equal takes give equal bytes.
    assert!(mcap_of(&take, &mut go_on).unwrap() == std::fs::read(&files[3]).unwrap());
}

fn python() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_MCAP_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_MCAP_PYTHON must be set in CI: mcap was not run");
        println!("SKIPPED: ARMATURE_MCAP_PYTHON is not set, so mcap was not run");
    }
    python
}

#[test]
fn a_motion_alone_and_nothing() {
    let motion = take_motion(&take(), &ExportSettings::default(), &mut go_on).unwrap().resampled.motion;
    let table = csv_of_motion(&motion);
    assert!(table.starts_with("time,upper.x,upper.y,upper.z,upper.qx"), "{table}");
    assert_eq!(table.lines().count(), motion.frames.len() + 1);
    let empty = read(&TakeWriter::new(Vec::new(), &header()).unwrap().finish().unwrap());
    assert_eq!(csv_of(&empty), "time,sequence,device_micros\n");
    assert!(matches!(mcap_of(&empty, &mut go_on), Err(McapError::Nothing)));
    assert!(matches!(mcap_of(&take(), &mut |_, _| ControlFlow::Break(())), Err(McapError::Cancelled)));
}
