//! Exports: the file states its rate, and the motion can be read back from it.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::ops::ControlFlow;

use armature_formats::fbx::FbxNotes;
use armature_formats::gltf::GlbMesh;
use armature_formats::motion::read_bvh;
use armature_formats::read_model;
use armature_rig::{Motion, Pose, Skeleton};
use armature_take::{
    ExportError, ExportSettings, Header, PoseSource, ReplayError, ResampleSettings, Surface, Take, TakeMotion,
    TakeWriter, export_bvh, export_glb, fbx_of, take_motion,
};
use armature_test_support::shared_bytes;
use glam::{Affine3A, Vec3};
use support::{begun, header, raw, read};

fn go_on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn settings(poses: PoseSource, frames_per_second: f64) -> ExportSettings {
    let resample = ResampleSettings { frames_per_second, ..ResampleSettings::default() };
    ExportSettings { poses, resample, ..ExportSettings::default() }
}

/// A second at 100 samples a second, without poses unless `poses`.
fn recorded(poses: bool) -> Take {
    let (mut writer, mut solver) = begun(&header());
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
        let read = read_bvh(exported.file.as_bytes()).unwrap().motion;
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
    let cancelled = take_motion(&recorded(true), &ExportSettings::default(), &mut |_, _| ControlFlow::Break(()));
    assert!(matches!(cancelled, Err(ExportError::Resample(armature_take::ResampleError::Cancelled))));
}

fn read_glb(bytes: &[u8]) -> armature_formats::model::Model {
    read_model("a.glb", bytes, &|name| Err(format!("it needs no other file, but asked for {name}"))).unwrap()
}

fn other_motion() -> TakeMotion {
    take_motion(&recorded(true), &settings(PoseSource::Recorded, 30.0), &mut go_on).unwrap()
}

/// A real rigged animal: its own animation recorded as a take, exported with its mesh, read back.
#[test]
fn a_skinned_glb_gives_mesh_weights_and_motion_back() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let fox = read_glb(&bytes);
    let (skeleton, motion) = (&fox.rig.as_ref().unwrap().skeleton, &fox.motions[0].1);
    let header = Header { character_name: "fox".into(), ..Header::default() };
    let mut writer = TakeWriter::new(Vec::new(), &header).unwrap();
    writer.skeleton(skeleton).unwrap();
    for (n, pose) in motion.frames.iter().enumerate() {
        let micros = 7_000_000 + (n as f64 * motion.frame_seconds * 1e6).round() as u64;
        writer.pose(n as u32, micros, pose).unwrap();
    }
    let take = read(&writer.finish().unwrap());
    let surface = Surface { skeleton, mesh: GlbMesh::of_model(&fox), expressions: &[] };
    let settings = settings(PoseSource::Recorded, 30.0);
    let exported = export_glb(&take, Some(&surface), "run", &settings, &mut go_on).unwrap();
    let back = read_glb(&exported.file);
    let (name, back_motion) = &back.motions[0];
    assert_eq!((name.as_str(), back.motions.len()), ("run", 1));
    assert_eq!(back.mesh.triangles.len(), fox.mesh.triangles.len());
    assert_eq!(back.rig.unwrap().skeleton.len(), skeleton.len());
    assert!((back_motion.frame_seconds - 1.0 / 30.0).abs() < 1e-6, "{}", back_motion.frame_seconds);
    let size = heads(skeleton, &skeleton.rest_pose()).iter().fold(0.0, |size, head| head.length().max(size));
    let distance = largest_distance(&exported.motion.resampled.motion, back_motion);
    assert!(distance < 1e-5 * size, "{distance} of {size}");

    let fbx = fbx_of(exported.motion.clone(), "fox", Some(&surface), "run", &FbxNotes::default()).unwrap();
    let back = read_model("fox.fbx", &fbx.file.bytes, &|name| Err(format!("{name} is not expected"))).unwrap();
    let (name, back_motion) = &back.motions[0];
    assert_eq!((name.as_str(), back.motions.len(), back.mesh.triangles.len()), ("run", 1, fox.mesh.triangles.len()));
    assert!((back_motion.frame_seconds - 1.0 / 30.0).abs() < 1e-10, "{}", back_motion.frame_seconds);
    assert_eq!(back.materials[0].base_color_map, fox.materials[0].base_color_map);
    let distance = largest_distance(&exported.motion.resampled.motion, back_motion);
    assert!(distance < 1e-5 * size, "FBX: {distance} of {size}");

    let other = fbx_of(other_motion(), "arm", Some(&surface), "run", &FbxNotes::default());
    assert!(other.unwrap_err().to_string().contains("export it with the character \"arm\""));
    let refused = export_glb(&recorded(true), Some(&surface), "run", &settings, &mut go_on).unwrap_err();
    assert!(refused.to_string().contains("export it with the character \"arm\""), "{refused}");
}

#[test]
fn a_glb_without_a_surface_holds_skeleton_and_clip() {
    let exported = export_glb(&recorded(true), None, "take 1", &settings(PoseSource::Recorded, 25.0), &mut go_on);
    let file = exported.unwrap().file;
    assert_eq!(file[..4], *b"glTF");
    let json = String::from_utf8_lossy(&file);
    for text in ["\"take 1\"", "\"upper\"", "\"hand\""] {
        assert!(json.contains(text), "{text}");
    }
    let again = export_glb(&recorded(true), None, "take 1", &settings(PoseSource::Recorded, 25.0), &mut go_on);
    assert_eq!(again.unwrap().file, file);
}
