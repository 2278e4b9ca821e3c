//! Exports: the file says the rate it has, and the motion comes back from it.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;

use armature_formats::read_bvh;
use armature_rig::{Motion, Pose, Skeleton};
use armature_take::{
    ExportError, ExportSettings, PoseSource, ReplayError, ResampleSettings, Take, TakeWriter, export_bvh, take_motion,
};
use glam::{Affine3A, Vec3};
use support::{arm, arm_calibration, arm_mapping, arm_tree, header, raw, read};

fn go_on(_: f32) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn settings(poses: PoseSource, frames_per_second: f64) -> ExportSettings {
    ExportSettings { poses, resample: ResampleSettings { frames_per_second, ..ResampleSettings::default() } }
}

/// A second at 100 samples a second, without poses unless `poses`.
fn recorded(poses: bool) -> Take {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    let mut solver = armature_take::StreamSolver::new(arm());
    solver.set_topology(1, arm_tree());
    solver.set_calibration(arm_calibration());
    solver.set_mapping(arm_mapping());
    writer.skeleton(&arm()).unwrap();
    writer.topology(1, &arm_tree()).unwrap();
    writer.calibration(&arm_calibration()).unwrap();
    writer.mapping(&arm_mapping()).unwrap();
    for n in 0..=100 {
        let sample = raw(n, 1_000_000 + 10_000 * u64::from(n));
        writer.sample(&sample, None).unwrap();
        let pose = solver.solve(&sample).unwrap();
        if poses {
            writer.pose(n, sample.device_micros, pose).unwrap();
        }
    }
    read(&writer.finish().unwrap())
}

fn heads(skeleton: &Skeleton, pose: &Pose) -> Vec<Vec3> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames.iter().map(|frame| frame.translation.into()).collect()
}

/// Largest distance between the heads of equally named bones, over all frames.
fn largest_distance(a: &Motion, b: &Motion) -> f32 {
    assert_eq!(a.frames.len(), b.frames.len());
    let pairs: Vec<(usize, usize)> =
        a.skeleton.bones().iter().enumerate().map(|(i, bone)| (i, b.skeleton.find(&bone.name).unwrap())).collect();
    let frames = a.frames.iter().zip(&b.frames);
    let distances = frames.flat_map(|(pose_a, pose_b)| {
        let (heads_a, heads_b) = (heads(&a.skeleton, pose_a), heads(&b.skeleton, pose_b));
        pairs.iter().map(move |&(i, j)| heads_a[i].distance(heads_b[j])).collect::<Vec<_>>()
    });
    distances.fold(0.0, f32::max)
}

#[test]
fn bvh_has_the_rate_asked_for_and_gives_the_motion_back() {
    let take = recorded(true);
    for (rate, frames) in [(24.0, 25), (100.0, 101), (29.97, 30)] {
        let exported = export_bvh(&take, &settings(PoseSource::Recorded, rate), &mut go_on).unwrap();
        let read = read_bvh(exported.file.as_bytes()).unwrap();
        assert_eq!(read.frames.len(), frames, "{rate}");
        assert!((read.frame_seconds - 1.0 / rate).abs() < 1e-6, "{} at {rate}", read.frame_seconds);
        let distance = largest_distance(&exported.motion.resampled.motion, &read);
        assert!(distance < 1e-4, "{distance} at {rate}");
    }
}

#[test]
fn a_take_without_poses_is_exported_by_solving_it_again_only_when_asked() {
    let (with, without) = (recorded(true), recorded(false));
    let refused = export_bvh(&without, &settings(PoseSource::Recorded, 30.0), &mut go_on);
    assert!(matches!(refused, Err(ExportError::Resample(armature_take::ResampleError::NoPoses))));
    let again = export_bvh(&without, &settings(PoseSource::SolvedAgain, 30.0), &mut go_on).unwrap();
    assert_eq!(again.motion.replay.as_ref().unwrap().solved, 101);
    assert_eq!(again.file, export_bvh(&with, &settings(PoseSource::Recorded, 30.0), &mut go_on).unwrap().file);
}

#[test]
fn without_a_skeleton_there_is_nothing_to_export() {
    let writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    let take = read(&writer.finish().unwrap());
    let solved = take_motion(&take, &settings(PoseSource::SolvedAgain, 30.0), &mut go_on);
    assert_eq!(solved, Err(ExportError::Replay(ReplayError::NoSkeleton)));
    let cancelled = take_motion(&recorded(true), &ExportSettings::default(), &mut |_| ControlFlow::Break(()));
    assert!(matches!(cancelled, Err(ExportError::Resample(armature_take::ResampleError::Cancelled))));
}
