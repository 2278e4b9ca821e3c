//! Real motion capture the whole way: file → puppet → counts → wire → session → zero → mapping → solver → take → file.

use armature::takes::exports::{self, Target, export};
use armature_rig::{Motion, Pose, Skeleton};
use armature_sim::serve::Options;
use armature_take::{ExportSettings, FrameRate, ResampleSettings, Take, verify};
use armature_test_support::shared;
use armature_tests::{Run, Setup, character, keep_going, perform};
use glam::{DQuat, DVec3};

/// The puppet holds the rest pose for this long, and is zeroed.
const REST_SECONDS: f64 = 1.0;
const SAMPLES_A_SECOND: f64 = 240.0;
const TOLERANCE_DEGREES: f64 = 0.1;

fn degrees_apart(a: DQuat, b: DQuat) -> f64 {
    let d = a.inverse() * b;
    // Exact for small angles, where an arc cosine is not.
    2.0 * DVec3::new(d.x, d.y, d.z).length().atan2(d.w.abs()).to_degrees()
}

fn rotation(pose: &Pose, bone: usize) -> DQuat {
    pose.parent_from_bone[bone].rotation.as_dquat().normalize()
}

/// The source's local rotation at a time of the clip, turning uniformly between frames.
fn source_rotation(motion: &Motion, bone: usize, seconds: f64) -> DQuat {
    let last = motion.frames.len() - 1;
    let at = (seconds / motion.frame_seconds).clamp(0.0, last as f64);
    let frame = at.floor() as usize;
    let (before, after) = (&motion.frames[frame], &motion.frames[(frame + 1).min(last)]);
    rotation(before, bone).slerp(rotation(after, bone), at - at.floor()).normalize()
}

/// The worst of all bones, in degrees.
fn worst(skeleton: &Skeleton, mut apart: impl FnMut(usize) -> f64) -> f64 {
    (0..skeleton.len()).map(&mut apart).fold(0.0, f64::max)
}

/// Every pose of the take against the source at the sample's own time, and every frame of the source against the take.
fn compare_take(name: &str, motion: &Motion, take: &Take, lead_in: f64) {
    let first_micros = take.samples().next().unwrap().raw.device_micros as f64;
    // The take begins one sample after the stream.
    let clip_begins = first_micros * 1e-6 + REST_SECONDS + lead_in - 1.0 / SAMPLES_A_SECOND;
    let (mut largest, mut compared) = (0.0_f64, 0);
    for packed in take.poses() {
        let seconds = packed.device_micros as f64 * 1e-6 - clip_begins;
        if seconds < 0.0 {
            continue;
        }
        let pose = take.unpack(packed);
        largest = largest.max(worst(&motion.skeleton, |bone| {
            degrees_apart(rotation(&pose, bone), source_rotation(motion, bone, seconds))
        }));
        compared += 1;
    }
    println!("{name}: {compared} poses of {} bones from the take, worst {largest:.4}°", motion.skeleton.len());
    assert!(compared as f64 >= motion.duration_seconds() * SAMPLES_A_SECOND, "{name}: the whole clip was played");
    assert!(largest < TOLERANCE_DEGREES, "{name}: {largest}°");
}

/// The exported motion, frame by frame at the source's own rate.
fn compare_export(name: &str, motion: &Motion, take: &Take, lead_in: f64) {
    // Frames of the source begin one sample period before those of the take.
    let begin = REST_SECONDS + lead_in - 1.0 / SAMPLES_A_SECOND;
    let last_frame = (motion.frames.len() - 1) as f64;
    let resample = ResampleSettings {
        frames_per_second: 1.0 / motion.frame_seconds,
        range_seconds: Some((begin, begin + last_frame * motion.frame_seconds)),
        ..ResampleSettings::default()
    };
    let settings = ExportSettings { resample, ..ExportSettings::default() };
    let options = exports::Options { settings, ..exports::Options::at(FrameRate::whole(30).unwrap()) };
    let exported = export(take, None, None, Target::Bvh, &options, &mut keep_going).unwrap();
    assert_eq!(exported.notes, Vec::<String>::new());
    let read = armature_formats::motion::read_bvh(&exported.bytes).unwrap().motion;
    assert_eq!(read.frames.len(), motion.frames.len(), "{name}: every frame");
    assert_eq!(read.skeleton.len(), motion.skeleton.len(), "{name}: every bone");
    let mut largest = 0.0_f64;
    for (theirs, ours) in read.frames.iter().zip(&motion.frames) {
        largest = largest.max(worst(&motion.skeleton, |bone| {
            let read_bone = read.skeleton.find(&motion.skeleton.bones()[bone].name).unwrap();
            degrees_apart(rotation(theirs, read_bone), rotation(ours, bone))
        }));
    }
    println!("{name}: {} frames of the exported file, worst {largest:.4}°", read.frames.len());
    assert!(largest < TOLERANCE_DEGREES, "{name}: {largest}° in the exported file");
}

fn whole_way(name: &str) {
    let Some(path) = shared(&format!("mocap/{name}")) else { return };
    let motion = armature_formats::motion::read_bvh(&std::fs::read(&path).unwrap()).unwrap().motion;
    let file = path.to_str().unwrap();
    let bones = character(file);
    assert_eq!(bones.skeleton, motion.skeleton);
    let options = Options { puppet: file.into(), seed: 5, rest: REST_SECONDS, ..Options::default() };
    let puppet = options.puppet().unwrap();
    let lead_in = puppet.lead_in_seconds();
    let samples = ((REST_SECONDS + lead_in + motion.duration_seconds()) * SAMPLES_A_SECOND).ceil() as u32 + 2;
    let run: Run = perform(puppet, &bones, &Setup::samples(samples, SAMPLES_A_SECOND));

    let mut mapped: Vec<&str> = run.mapping().entries.iter().map(|entry| entry.bone.as_str()).collect();
    mapped.sort_unstable();
    mapped.dedup();
    let (joints, bones, driven) = run.summary.joints_bones_driven;
    println!("{name}: {joints} joints, {bones} bones, {driven} of them driven");
    assert_eq!(mapped.len(), motion.skeleton.len(), "{name}: every bone has a joint of its own");
    assert_eq!((joints, driven), (bones, bones), "{name}");
    assert_eq!(run.summary.counters.lost_samples, 0);
    assert!(verify(&run.take, &mut keep_going).unwrap().is_exact());
    compare_take(name, &motion, &run.take, lead_in);
    compare_export(name, &motion, &run.take, lead_in);
}

#[test]
fn freebvh_comes_back_within_a_tenth_of_a_degree() {
    whole_way("freebvh.bvh");
}

#[test]
fn mocapbank_comes_back_within_a_tenth_of_a_degree() {
    whole_way("mocapbank.bvh");
}
