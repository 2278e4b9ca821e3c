//! What goes wrong on a line is counted exactly, recorded in the take, and affects nothing else.
//!
//! Session, take and simulator are three witnesses. The simulator knows the truth; the others must agree with it to the
//! last sample.

use std::collections::{BTreeMap, BTreeSet};

use crate::tapped::tapped;
use armature_device::Event;
use armature_rig::Pose;
use armature_sim::Body;
use armature_sim::serve::Options;
use armature_take::{EventKind, Record, Take, summarize, verify};
use armature_tests::{Run, Setup, bones_of, keep_going, options, perform, perform_from};

const RATE: f64 = 100.0;
const SEED: u64 = 5;

fn human(options: &Options, samples: u32) -> Run {
    perform(options.puppet().unwrap(), &bones_of("human"), &Setup::samples(samples, RATE))
}

fn lost_in(events: &[Event]) -> u64 {
    events.iter().map(|e| if let Event::Lost { count, .. } = e { u64::from(*count) } else { 0 }).sum()
}

fn samples_in(events: &[Event]) -> u64 {
    events.iter().filter(|e| matches!(e, Event::Sample(_))).count() as u64
}

/// Pieces with a wrong checksum, and bytes skipped.
fn noise_in(events: &[Event]) -> (u64, u64) {
    let noise = events.iter().filter_map(|e| match e {
        Event::Noise { checksum_errors, bytes, .. } => Some((*checksum_errors, *bytes)),
        _ => None,
    });
    noise.fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

/// Samples taken after the last one that came through: only the simulator can know of them yet.
fn still_unknown(run: &Run) -> u64 {
    let last = run.take.samples().last().unwrap().raw.sequence;
    run.truth.samples_taken - u64::from(last) - 1
}

/// Session, take and simulator agree on a stream that was never restarted.
fn assert_accounts_agree(run: &Run) {
    let (counters, truth) = (run.summary.counters, run.truth);
    assert_eq!(counters.frames, truth.frames_sent - truth.frames_damaged, "every whole frame, and no other");
    assert_eq!(counters.lost_samples, truth.samples_damaged - still_unknown(run), "every damaged sample");
    assert_eq!(counters.samples + truth.samples_damaged, truth.samples_taken);
    assert_eq!((counters.malformed_messages, counters.unknown_messages, counters.unusable_samples), (0, 0, 0));
    assert_eq!((counters.duplicate_samples, counters.stale_samples), (0, 0));
    assert_eq!(samples_in(&run.events), counters.samples);
    assert_eq!(lost_in(&run.events), counters.lost_samples);
    assert_take_tells_all(run);
}

/// The take contains what the session reported since its first sample, in the right place.
fn assert_take_tells_all(run: &Run) {
    let events = run.events_of_take();
    let summary = summarize(&run.take);
    assert_eq!(summary.samples, samples_in(events));
    assert_eq!(summary.lost_samples, lost_in(events));
    assert_eq!((summary.crc_errors, summary.discarded_bytes), noise_in(events));
    let recorded = &run.summary.take.as_ref().unwrap().1;
    assert_eq!((recorded.samples, recorded.lost), (summary.samples, summary.lost_samples));
    assert_gaps_are_told(&run.take);
    let verification = verify(&run.take, &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{verification:?}");
    assert_eq!(verification.identical, summary.samples);
}

/// Between two samples of one stream there is a gap exactly where an event says so, of the length it says.
fn assert_gaps_are_told(take: &Take) {
    let mut last: Option<u32> = None;
    let mut told = 0;
    for record in take.records() {
        match record {
            Record::Event(event) => match event.kind {
                EventKind::LostSamples { count, after_sequence } => {
                    assert_eq!(last.map_or(after_sequence, |s| s), after_sequence);
                    told += count;
                }
                EventKind::Restart => last = None,
                _ => {}
            },
            Record::Sample(sample) => {
                if let Some(last) = last {
                    assert_eq!(u64::from(sample.raw.sequence - last) - 1, told, "before {}", sample.raw.sequence);
                }
                (last, told) = (Some(sample.raw.sequence), 0);
            }
            _ => {}
        }
    }
}

/// The poses of a take by the number of their sample.
fn poses(take: &Take) -> BTreeMap<u32, Pose> {
    take.poses().map(|packed| (packed.sequence, take.unpack(packed))).collect()
}

/// All poses of a disturbed run are those of the calm one, for the bones that count.
fn assert_same_poses(disturbed: &Take, calm: &Take, counts: impl Fn(&str) -> bool) -> usize {
    let calm_poses = poses(calm);
    let bones = calm.skeleton().unwrap().bones();
    let mut compared = 0;
    for (sequence, pose) in poses(disturbed) {
        let Some(expected) = calm_poses.get(&sequence) else { continue };
        compared += 1;
        for (bone, (a, b)) in bones.iter().zip(pose.parent_from_bone.iter().zip(&expected.parent_from_bone)) {
            assert!(!counts(&bone.name) || a == b, "{} at sample {sequence}: {a:?}, calm {b:?}", bone.name);
        }
    }
    compared
}

#[test]
fn a_second_of_noise_is_survived_and_counted() {
    let noisy = human(&Options { burst: vec!["1.5:1".into()], ..options("human", SEED) }, 400);
    assert!(noisy.truth.noise_bytes > 50_000 && noisy.truth.samples_damaged >= 100, "{:?}", noisy.truth);
    assert_accounts_agree(&noisy);
    let counters = noisy.summary.counters;
    assert_eq!(still_unknown(&noisy), 0, "it recovered by itself and streams to the end");
    assert_eq!((counters.connections, counters.restarts), (1, 0), "without a new hello");
    let summary = summarize(&noisy.take);
    assert_eq!(summary.crc_errors, counters.checksum_errors);
    assert_eq!(summary.discarded_bytes, counters.discarded_bytes);
    // A piece that starts with noise may end with a whole frame's bytes; empty pieces between two delimiters have no
    // bytes.
    let discarded = counters.discarded_bytes as f64 / noisy.truth.noise_bytes as f64;
    assert!((0.99..1.01).contains(&discarded), "{discarded}");
    println!(
        "a second of noise: {} bytes, {} samples lost, {} wrong checksums, {} bytes discarded",
        noisy.truth.noise_bytes, summary.lost_samples, summary.crc_errors, summary.discarded_bytes
    );
    let calm = human(&options("human", SEED), 400);
    assert_eq!(summarize(&calm.take).lost_samples, 0);
    let compared = assert_same_poses(&noisy.take, &calm.take, |_| true);
    assert_eq!(compared, noisy.take.samples().count());
}

#[test]
fn noise_before_the_first_word_only_delays() {
    let noisy = human(&Options { burst: vec!["0:1".into()], ..options("human", SEED) }, 200);
    assert_eq!((noisy.summary.counters.connections, noisy.summary.counters.restarts), (1, 0));
    assert_eq!((noisy.truth.samples_damaged, noisy.summary.counters.lost_samples), (0, 0));
    assert!(noisy.summary.counters.discarded_bytes > 50_000);
    let summary = summarize(&noisy.take);
    assert_eq!((summary.lost_samples, summary.discarded_bytes), (0, 0), "all of it was before the take");
    assert_accounts_agree(&noisy);
}

#[test]
fn flipped_and_dropped_bytes_cost_their_frames_and_no_more() {
    for seed in [SEED, 6, 7] {
        let calm = human(&options("human", seed), 600);
        for (flip, drop, duplicate) in [(1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (0.0, 0.0, 1e-3), (1e-3, 1e-3, 1e-3)] {
            let run = human(&Options { flip, drop, duplicate, ..options("human", seed) }, 600);
            let (counters, truth) = (run.summary.counters, run.truth);
            println!(
                "seed {seed}, flip {flip}, drop {drop}, duplicate {duplicate}: {} of {} samples lost, all known",
                counters.lost_samples, truth.samples_taken
            );
            assert!(truth.samples_damaged > 20, "{truth:?}");
            assert_accounts_agree(&run);
            assert!(counters.checksum_errors + counters.framing_errors > 20);
            assert!(assert_same_poses(&run.take, &calm.take, |_| true) > 300);
        }
    }
}

/// Exactly this many frames have a wrong checksum: the test damages them itself, one content byte each.
#[test]
fn wrong_checksums_are_counted_to_the_last_one() {
    fn damage(frame: usize, bytes: &mut [u8]) -> bool {
        // After a hundred frames, so that the take has begun; in the content, which no length covers.
        let hit = frame > 100 && frame.is_multiple_of(7) && bytes.len() > 40;
        if hit {
            let place = bytes.len() / 2;
            bytes[place] ^= if bytes[place] == 0x40 { 0x80 } else { 0x40 };
        }
        hit
    }
    let puppet = options("human", SEED).puppet().unwrap();
    let (source, damaged) = tapped(puppet, RATE, damage);
    let run = perform_from(source, &bones_of("human"), &Setup::samples(400, RATE));
    let (frames, bytes) = damaged.get();
    assert!(frames > 30);
    let counters = run.summary.counters;
    assert_eq!((counters.checksum_errors, counters.framing_errors, counters.discarded_bytes), (frames, 0, bytes));
    let summary = summarize(&run.take);
    assert_eq!((summary.crc_errors, summary.discarded_bytes), (frames, bytes));
    assert_eq!(summary.lost_samples + still_unknown(&run), frames);
    assert_take_tells_all(&run);
    println!("{frames} frames damaged, {} wrong checksums in the take", summary.crc_errors);
}

#[test]
fn a_restart_is_survived_and_told() {
    let calm = human(&options("human", SEED), 300);
    let run = human(&Options { restart: vec![1.7], ..options("human", SEED) }, 300);
    let (counters, truth) = (run.summary.counters, run.truth);
    assert_eq!((truth.restarts, counters.restarts, counters.connections), (1, 1, 2));
    let summary = summarize(&run.take);
    assert_eq!((summary.restarts, summary.lost_samples, summary.crc_errors), (1, 0, 0));
    assert_eq!(counters.samples, truth.samples_taken, "every sample taken came through");
    assert_eq!((counters.lost_samples, counters.stale_samples), (0, 0));
    assert_take_tells_all(&run);
    // After its restart the puppet repeats everything from the beginning, and so does the character.
    let restart = run.take.records().iter().position(|r| matches!(r, Record::Event(e) if e.kind == EventKind::Restart));
    let calm_poses = poses(&calm.take);
    let mut compared = 0;
    for record in &run.take.records()[restart.unwrap()..] {
        let Record::Pose(packed) = record else { continue };
        let Some(expected) = calm_poses.get(&packed.sequence) else { continue };
        if packed.sequence < ENGAGING_SAMPLES {
            continue;
        }
        assert_eq!(&run.take.unpack(packed), expected, "sample {} after the restart", packed.sequence);
        compared += 1;
    }
    assert_no_jump(&run.take);
    println!("{compared} poses after the restart are those after the first start");
    assert!(compared > 100);
}

/// Labels of a part and of everything that hangs on it.
fn subtree(body: &Body, label: &str) -> BTreeSet<[u8; 12]> {
    let root = body.find(label).unwrap();
    let parts = (0..body.parts().len()).filter(|&part| part == root || body.is_below(part, root));
    parts.map(|part| body.parts()[part].uid.0).collect()
}

#[test]
fn an_unplugged_arm_leaves_the_other_bones_alone() {
    let calm = human(&options("human", SEED), 400);
    let run = human(&Options { pull: vec!["left_shoulder@1.5:1".into()], ..options("human", SEED) }, 400);
    let (counters, truth) = (run.summary.counters, run.truth);
    assert_eq!(truth.topology_changes, 2);
    assert_eq!(counters.samples, truth.samples_taken, "samples wait for their topology; none is lost");
    assert_eq!((counters.lost_samples, counters.unusable_samples, counters.restarts), (0, 0, 0));
    assert_take_tells_all(&run);
    let changes: Vec<u16> = run
        .take
        .events()
        .filter_map(|e| if let EventKind::TopologyChange { epoch } = e.kind { Some(epoch) } else { None })
        .collect();
    assert_eq!(changes, [1, 2]);

    let body = Body::preset("human", SEED).unwrap();
    let pulled = subtree(&body, "left_shoulder");
    let on_the_arm: BTreeSet<&str> =
        run.mapping().entries.iter().filter(|e| pulled.contains(&e.part.0)).map(|e| e.bone.as_str()).collect();
    assert_eq!((pulled.len(), on_the_arm.len()), (4, 3), "shoulder, elbow with forearm, and wrist");
    let others = run.mapping().entries.iter().filter(|e| !pulled.contains(&e.part.0)).count();
    assert_eq!(others, 15);
    let compared = assert_same_poses(&run.take, &calm.take, |bone| !on_the_arm.contains(bone));
    assert_eq!(compared, 400, "all other bones follow as if nothing had happened");

    // While it is unplugged, the arm stays as it was; when it is back, it follows again.
    let part_epochs: BTreeMap<u32, u16> = run.take.samples().map(|s| (s.raw.sequence, s.raw.epoch)).collect();
    let (poses, calm_poses) = (poses(&run.take), poses(&calm.take));
    let out: Vec<&Pose> = poses.iter().filter(|(s, _)| part_epochs[*s] == 1).map(|(_, p)| p).collect();
    assert!((98..=102).contains(&out.len()), "{} samples without the arm", out.len());
    for bone in on_the_arm.iter().map(|name| run.take.skeleton().unwrap().find(name).unwrap()) {
        assert!(out.iter().all(|p| p.parent_from_bone[bone] == out[0].parent_from_bone[bone]), "bone {bone} is held");
        let back = poses.iter().filter(|(s, _)| part_epochs[*s] == 2);
        for (sequence, pose) in back.skip(ENGAGING_SAMPLES as usize) {
            assert_eq!(pose.parent_from_bone[bone], calm_poses[sequence].parent_from_bone[bone], "sample {sequence}");
        }
    }
}

/// How long a part that is back takes to bring its bone along: 250 ms.
const ENGAGING_SAMPLES: u32 = (0.25 * RATE) as u32;

fn angle_between(a: &Pose, b: &Pose, bone: usize) -> f32 {
    let [a, b] = [a, b].map(|pose| pose.parent_from_bone[bone].rotation);
    2.0 * (a - b).length().min((a + b).length())
}

/// From one recorded pose to the next no bone turns further than a limb moves in a hundredth of a second.
fn assert_no_jump(take: &Take) {
    let recorded: Vec<Pose> = take.poses().map(|packed| take.unpack(packed)).collect();
    for (index, pair) in recorded.windows(2).enumerate() {
        for bone in 0..pair[0].parent_from_bone.len() {
            let turned = angle_between(&pair[0], &pair[1], bone);
            assert!(turned < 0.2, "bone {bone} jumps by {turned} rad after pose {index}");
        }
    }
}

/// The arm bends while it is unplugged, as nobody holds it: when it is back, its bones move over to it without a jump,
/// by the number of each part and with its earlier zero.
#[test]
fn a_subtree_that_comes_back_takes_its_bones_along_without_a_jump() {
    for pull in ["left_shoulder@1.5:1.3", "left_elbow@1.3:0.9", "left_hip@1.5:1.25", "shoulders@1.2:0.7"] {
        let calm = human(&options("human", SEED), 500);
        let run = human(&Options { pull: vec![pull.into()], ..options("human", SEED) }, 500);
        assert_eq!(run.truth.topology_changes, 2);
        let (out, held) = (poses(&calm.take), poses(&run.take));
        let epochs: BTreeMap<u32, u16> = run.take.samples().map(|s| (s.raw.sequence, s.raw.epoch)).collect();
        let back = *epochs.iter().find(|(_, epoch)| **epoch == 2).unwrap().0;
        let bones = run.take.skeleton().unwrap().len();
        let apart =
            |sequence: u32| (0..bones).map(|b| angle_between(&held[&sequence], &out[&sequence], b)).fold(0.0, f32::max);
        println!("{pull}: {:.2} rad apart when it comes back", apart(back));
        assert!(apart(back) > 0.05, "{pull}: the arm must have moved: {}", apart(back));
        assert!(
            (0..bones).all(|b| angle_between(&held[&(back - 1)], &held[&back], b) < 0.05),
            "{pull}: the first step"
        );
        assert!(apart(back + ENGAGING_SAMPLES) < 1e-6, "{pull}: it follows exactly after a quarter of a second");
        assert_no_jump(&run.take);
        assert_take_tells_all(&run);
        let zeros = |run: &Run| {
            run.take
                .records()
                .iter()
                .rev()
                .find_map(|r| if let Record::Calibration(c) = r { Some(c.clone()) } else { None })
        };
        assert_eq!(zeros(&run), zeros(&calm), "{pull}: nothing is zeroed again");
    }
}

/// A part plugged in later is zeroed when it appears; everything else keeps its zero.
#[test]
fn a_part_plugged_in_later_does_not_zero_the_others() {
    let calm = human(&options("human", SEED), 400);
    let run = human(&Options { pull: vec!["left_wrist@0:1.5".into()], ..options("human", SEED) }, 400);
    let zero = |run: &Run| {
        let mut calibrations = run.take.records().iter().rev().filter_map(|r| match r {
            Record::Calibration(calibration) => Some(calibration.clone()),
            _ => None,
        });
        calibrations.next().unwrap()
    };
    let body = Body::preset("human", SEED).unwrap();
    let late = subtree(&body, "left_wrist");
    let (late_run, calm) = (zero(&run), zero(&calm));
    for (uid, sensors) in calm.parts() {
        let found = late_run.part(uid).unwrap();
        assert!(found.iter().all(|sensor| sensor.zero_counts.is_some()), "{uid:?} is zeroed");
        assert!(late.contains(&uid.0) || found == sensors, "{uid:?}: {found:?}, {sensors:?}");
    }
    assert_take_tells_all(&run);
}
