//! Reduced keys: the bound holds at every frame as a reader sees it, and there are as few keys as can be.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]
#![allow(clippy::float_cmp, reason = "what is copied keeps its bits")]

mod support;

use std::ops::ControlFlow;

use armature_formats::gltf::{GlbScene, read_gltf_skeleton, write_glb};
use armature_formats::motion::{KeyInterpolation, KeyTrack, KeyedPart, add_clip, annotate_clips, read_bvh};
use armature_rig::{Motion, Pose, Skeleton};
use armature_take::{KeyError, KeySettings, ReducedKeys, reduce_keys};
use armature_test_support::shared_bytes;
use glam::{Affine3A, DQuat, DVec3, Quat, Vec3};
use support::arm;

fn reduce(motion: &Motion, settings: &KeySettings) -> ReducedKeys {
    reduce_keys(motion, settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

fn settings(interpolation: KeyInterpolation, degrees: f64) -> KeySettings {
    KeySettings { interpolation, rotation: degrees.to_radians(), feet: None }
}

fn mocap() -> Vec<(&'static str, Motion)> {
    let read = |name| Some((name, read_bvh(&shared_bytes(name)?).unwrap().motion));
    ["mocap/freebvh.bvh", "mocap/mocapbank.bvh"].into_iter().filter_map(read).collect()
}

fn angle(a: DQuat, b: DQuat) -> f64 {
    let difference = a.normalize() * b.normalize().conjugate();
    2.0 * difference.xyz().length().atan2(difference.w.abs())
}

/// A track's value at a time, as the glTF specification says (appendix C), written without a look at the library.
fn value(track: &KeyTrack, time: f64) -> [f64; 4] {
    let at = |index: usize| track.values[index].map(f64::from);
    let keys: Vec<f64> = track.times.iter().map(|&t| f64::from(t)).collect();
    let cubic = track.interpolation == KeyInterpolation::Cubic;
    let key = |k: usize| if cubic { at(3 * k + 1) } else { at(k) };
    if time <= keys[0] {
        return key(0);
    }
    let Some(k) = keys.windows(2).position(|pair| time < pair[1]) else { return key(keys.len() - 1) };
    let delta = keys[k + 1] - keys[k];
    let t = (time - keys[k]) / delta;
    if !cubic && track.part == KeyedPart::Rotation {
        let (a, b) = (key(k), key(k + 1));
        let dot: f64 = (0..4).map(|i| a[i] * b[i]).sum();
        let theta = dot.abs().min(1.0).acos();
        if theta < 1e-9 {
            return a;
        }
        let (wa, wb) = (((1.0 - t) * theta).sin() / theta.sin(), dot.signum() * (t * theta).sin() / theta.sin());
        return std::array::from_fn(|i| wa * a[i] + wb * b[i]);
    }
    if !cubic {
        return std::array::from_fn(|i| key(k)[i] * (1.0 - t) + key(k + 1)[i] * t);
    }
    let (v0, b0, a1, v1) = (key(k), at(3 * k + 2), at(3 * k + 3), key(k + 1));
    std::array::from_fn(|i| {
        (2.0 * t * t * t - 3.0 * t * t + 1.0) * v0[i]
            + delta * (t * t * t - 2.0 * t * t + t) * b0[i]
            + (-2.0 * t * t * t + 3.0 * t * t) * v1[i]
            + delta * (t * t * t - t * t) * a1[i]
    })
}

/// Largest difference of a rotation (radians) and of a translation at any frame.
fn largest(motion: &Motion, tracks: &[KeyTrack]) -> (f64, f64) {
    let (mut turn, mut shift) = (0.0_f64, 0.0_f64);
    for track in tracks {
        for (n, pose) in motion.frames.iter().enumerate() {
            let time = f64::from((n as f64 * motion.frame_seconds) as f32);
            let (read, own) = (value(track, time), pose.parent_from_bone[track.bone]);
            match track.part {
                KeyedPart::Rotation => turn = turn.max(angle(DQuat::from_array(read), own.rotation.as_dquat())),
                KeyedPart::Translation => {
                    shift = shift.max(DVec3::new(read[0], read[1], read[2]).distance(own.translation.as_dvec3()));
                }
                KeyedPart::Scale => {}
            }
        }
    }
    (turn, shift)
}

/// The fewest keys on frames with arcs between them, by dynamic programming over all pairs of frames.
fn fewest(turns: &[DQuat], bound: f64) -> usize {
    let n = turns.len();
    let reaches = |i: usize, j: usize| {
        (i + 1..j).all(|k| angle(turns[i].slerp(turns[j], (k - i) as f64 / (j - i) as f64), turns[k]) <= bound)
    };
    let mut best = vec![usize::MAX; n];
    best[0] = 1;
    for j in 1..n {
        for i in (0..j).rev() {
            if best[i] < usize::MAX && best[i] + 1 < best[j] && reaches(i, j) {
                best[j] = best[i] + 1;
            }
        }
    }
    best[n - 1]
}

#[test]
fn lines_have_the_fewest_keys_that_dynamic_programming_finds() {
    for (name, motion) in mocap() {
        let bound = 0.5_f64.to_radians();
        let reduced = reduce(&motion, &settings(KeyInterpolation::Linear, 0.5));
        let (turn, shift) = largest(&motion, &reduced.tracks);
        assert!(turn <= bound && (turn - reduced.report.rotation).abs() < 1e-7, "{name}: {}°", turn.to_degrees());
        assert!((shift - reduced.report.translation).abs() < 1e-4 * shift.max(1.0), "{name}: {shift}");
        let (mut keys, mut optimum, mut all) = (0, 0, 0);
        for track in reduced.tracks.iter().filter(|track| track.part == KeyedPart::Rotation) {
            let turn = |pose: &Pose| pose.parent_from_bone[track.bone].rotation.as_dquat().normalize();
            let turns: Vec<DQuat> = motion.frames.iter().map(turn).collect();
            all += turns.len();
            keys += track.times.len();
            let constant = turns.iter().all(|&turn| angle(turn, turns[0]) <= bound) && track.bone > 0;
            optimum += if constant { 1 } else { fewest(&turns, bound) };
        }
        let share = 100.0 * keys as f64 / all as f64;
        println!("{name}: {keys} keys of {all} ({share:.1} %), the fewest are {optimum}");
        assert!(keys as f64 <= 1.001 * optimum as f64 && keys >= optimum, "{name}: {keys}, fewest {optimum}");
    }
}

#[test]
fn splines_keep_the_bound_and_say_when_they_save_less_than_half() {
    for (name, motion) in mocap() {
        for degrees in [0.5, 2.0] {
            let reduced = reduce(&motion, &settings(KeyInterpolation::Cubic, degrees));
            let (turn, _) = largest(&motion, &reduced.tracks);
            assert!(turn <= degrees.to_radians(), "{name}: {}° of {degrees}°", turn.to_degrees());
            let report = &reduced.report;
            let linear = reduce(&motion, &settings(KeyInterpolation::Linear, degrees)).report.keys;
            assert_eq!(report.fewest_linear, linear);
            println!(
                "{name} at {degrees}°: {} spline keys, {linear} linear ones, of {}",
                report.keys, report.keys_before
            );
            assert!(report.keys < linear, "{name}");
            assert_eq!(report.why_not_half().is_some(), 2 * report.keys > linear, "{name}");
        }
    }
}

fn heads(skeleton: &Skeleton, pose: &Pose) -> Vec<Vec3> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames.iter().map(|frame| frame.translation.into()).collect()
}

/// Written as GLB and read back by the library's own reader, which knows nothing of the reduction.
#[test]
fn a_file_with_reduced_keys_gives_the_motion_back() {
    for (name, motion) in mocap() {
        let size =
            heads(&motion.skeleton, &motion.skeleton.rest_pose()).iter().map(|head| head.length()).fold(0.0, f32::max);
        for kind in [KeyInterpolation::Linear, KeyInterpolation::Cubic] {
            let bound = f64::from(size) * 2e-3;
            let reduced = reduce(&motion, &KeySettings { feet: Some(bound), ..settings(kind, 1.0) });
            let (moved, foot) = reduced.report.feet.clone().unwrap();
            assert!(moved <= bound, "{name}: {foot} moves by {moved}");
            let scene = GlbScene { name: "figure", skeleton: &motion.skeleton, mesh: None, clips: vec![] };
            let glb = add_clip(&write_glb(&scene).unwrap(), "take", &reduced.tracks).unwrap();
            let noted = serde_json::json!({"start_timecode": "01:00:00:00"});
            let glb = annotate_clips(&glb, &noted).unwrap();
            assert!(String::from_utf8_lossy(&glb).contains("\"extras\":{\"start_timecode\":\"01:00:00:00\"}"));
            let read = read_gltf_skeleton("a.glb", &glb, &|_| Err("no other file".into())).unwrap();
            let read = &read.motions[0].1;
            assert!((read.duration_seconds() - motion.duration_seconds()).abs() < 1e-4, "{name}: the length stays");
            let feet: Vec<usize> =
                (0..motion.skeleton.len()).filter(|&b| motion.skeleton.bones()[b].name == foot).collect();
            let mut worst = 0.0_f32;
            for (n, pose) in motion.frames.iter().enumerate() {
                let at = (n as f64 * motion.frame_seconds / read.frame_seconds).round() as usize;
                let off = (at as f64 * read.frame_seconds - n as f64 * motion.frame_seconds).abs();
                if off > 1e-5 {
                    continue;
                }
                let (own, got) = (heads(&motion.skeleton, pose), heads(&read.skeleton, &read.frames[at]));
                for &bone in &feet {
                    let other = read.skeleton.find(&motion.skeleton.bones()[bone].name).unwrap();
                    worst = worst.max(own[bone].distance(got[other]));
                }
            }
            assert!(
                worst > 0.0 && f64::from(worst) <= 1.01 * moved.max(1e-4 * f64::from(size)),
                "{name}: {worst}, {moved}"
            );
        }
    }
}

/// What rests has no track, what never changes one key, what turns evenly two.
#[test]
fn no_key_is_kept_without_need() {
    let pose = |n: u32| {
        let mut pose = arm().rest_pose();
        pose.parent_from_bone[1].rotation = Quat::from_rotation_x(0.4);
        pose.parent_from_bone[2].rotation = Quat::from_rotation_y(n as f32 * 0.02);
        pose.parent_from_bone[0].translation.x += n as f32 * 0.01;
        pose
    };
    let motion = Motion::new(arm(), 0.01, (0..150).map(pose).collect()).unwrap();
    for kind in [KeyInterpolation::Linear, KeyInterpolation::Cubic] {
        let reduced = reduce(&motion, &settings(kind, 0.1));
        let counts: Vec<(usize, KeyedPart, usize)> =
            reduced.tracks.iter().map(|track| (track.bone, track.part, track.times.len())).collect();
        let expected = [
            (0, KeyedPart::Translation, 2),
            (0, KeyedPart::Rotation, 2),
            (1, KeyedPart::Rotation, 1),
            (2, KeyedPart::Rotation, if kind == KeyInterpolation::Linear { 2 } else { counts[3].2 }),
        ];
        assert_eq!(counts, expected);
        assert!(counts[3].2 <= 6, "{counts:?}: a turn by three quarters of a circle needs few splines");
    }
}

#[test]
fn impossible_bounds_are_refused() {
    let motion = Motion::new(arm(), 0.01, vec![arm().rest_pose(); 3]).unwrap();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused =
            reduce_keys(&motion, &settings(KeyInterpolation::Linear, bad), &mut |_, _| ControlFlow::Continue(()));
        assert!(matches!(refused, Err(KeyError::BadBound { .. })));
    }
    let cancelled = reduce_keys(&motion, &KeySettings::default(), &mut |_, _| ControlFlow::Break(()));
    assert_eq!(cancelled, Err(KeyError::Cancelled));
    let track = KeyTrack {
        bone: 9,
        part: KeyedPart::Rotation,
        interpolation: KeyInterpolation::Linear,
        times: vec![0.0],
        values: vec![[0.0, 0.0, 0.0, 1.0]],
    };
    let skeleton = arm();
    let scene = GlbScene { name: "arm", skeleton: &skeleton, mesh: None, clips: vec![] };
    let glb = write_glb(&scene).unwrap();
    assert!(add_clip(&glb, "a", std::slice::from_ref(&track)).is_err(), "there is no such bone");
    assert!(add_clip(&glb, "a", &[]).is_err());
    assert!(add_clip(&glb, "a", &[KeyTrack { bone: 0, times: vec![1.0, 0.5], ..track.clone() }]).is_err());
    assert!(add_clip(b"glTF", "a", &[KeyTrack { bone: 0, ..track }]).is_err());
}
