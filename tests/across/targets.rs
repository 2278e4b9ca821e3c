//! Points that are dragged besides what the puppet does: from the bytes of a puppet to the take, and back again.

use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::characters::ground::{GroundArgs, GroundChoice};
use armature::characters::inverse_kinematics::IkArgs;
use armature::characters::targets::TargetArgs;
use armature::engine::recast::{Recast, recast};
use armature::takes;
use armature_rig::{Pose, PoseCompletion};
use armature_take::{EditList, Record, RecordKind, ReplayError, Take, apply_edits, verify, verify_completed};
use armature_tests::{Run, Setup, character, keep_going, options, perform};
use glam::{Affine3A, Vec3};

const RATE: f64 = 100.0;

fn dragged(puppet: &str, human: &Arc<LoadedCharacter>, wishes: &[&str], ground: Option<GroundChoice>) -> Run {
    let targets = TargetArgs { targets: wishes.iter().map(|wish| wish.parse().unwrap()).collect() };
    let ground = GroundArgs { ground, ..GroundArgs::default() };
    let setup = Setup { ik: IkArgs::default(), targets, ground, ..Setup::samples(150, RATE) };
    let header = armature_take::Header { character_hash: human.content_hash(), ..setup.header };
    perform(options(puppet, 5).puppet().unwrap(), human, &Setup { header, ..setup })
}

fn head(take: &Take, pose: &Pose, bone: &str) -> Vec3 {
    let skeleton = take.skeleton().unwrap();
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames[skeleton.find(bone).unwrap()].translation.into()
}

/// Bit for bit: by a replay here and on a second thread, and by an edit list without edits.
fn assert_solved_again(run: &Run, human: &LoadedCharacter) {
    let again = || {
        let mut completion = takes::completion(&run.take, human).unwrap().unwrap();
        let completion: &mut dyn PoseCompletion = &mut completion;
        verify_completed(&run.take, Some(completion), &mut keep_going).unwrap()
    };
    let (here, there) = std::thread::scope(|scope| {
        let there = scope.spawn(again);
        (again(), there.join().unwrap())
    });
    assert!(here.is_exact() && there.is_exact(), "{here:?}");
    assert_eq!(here.identical, run.take.samples().count() as u64);
    let mut completion = takes::completion(&run.take, human).unwrap().unwrap();
    let nowhere = |name: &str| Err(format!("no {name}"));
    let edited = apply_edits(&EditList::new("run.take"), &run.take, &nowhere, Some(&mut completion), &mut keep_going);
    let edited = edited.unwrap();
    let timeline = edited.timeline();
    for (index, recorded) in run.take.poses().enumerate() {
        let (_, pose) = timeline.get(index).unwrap();
        assert_eq!(run.take.unpack(pose), run.take.unpack(recorded), "pose {index} after an edit without edits");
    }
}

#[test]
fn a_chest_follows_a_timetable_and_the_take_solves_it_again() {
    let human = character("human");
    let wishes = ["UpperChest@0.2..0.9=+0.06,-0.03,0.04:over=0.2", "vertex:100@0.4..=+0,0.01,0.02:strength=0.3"];
    let run = dragged("human8", &human, &wishes, None);
    assert_solved_again(&run, &human);
    let told = run.take.records().iter().filter(|record| record.kind() == RecordKind::Target).count();
    assert_eq!(told, 3, "two are set, one is let go");
    let poses: Vec<Pose> = run.take.poses().map(|packed| run.take.unpack(packed)).collect();
    let rest = head(&run.take, &human.skeleton.rest_pose(), "UpperChest");
    let to = rest + Vec3::new(0.06, -0.03, 0.04);
    let places: Vec<Vec3> = poses.iter().map(|pose| head(&run.take, pose, "UpperChest")).collect();
    let off: Vec<f32> = places.iter().map(|place| place.distance(to)).collect();
    // The pull on the skin gives way to it.
    assert!(off[60..80].iter().all(|off| *off < 1e-3), "{:?}", &off[60..80]);
    assert!(off[15] > 0.03 && off[149] > 0.03, "{} {}", off[15], off[149]);
    let largest = places.windows(2).map(|two| two[0].distance(two[1])).fold(0.0, f32::max);
    assert!(largest < 0.02, "no jump: {largest} in 10 ms");
    let again = dragged("human8", &human, &wishes, None);
    assert!(again.bytes == run.bytes, "the same wishes give the same take");
}

#[test]
fn a_dragged_root_overrides_the_ground() {
    let human = character("human");
    let run = dragged("human", &human, &["Hips@0.5..1.1=+0,0.4,0.1:over=0.15"], Some(GroundChoice::Walk));
    assert_solved_again(&run, &human);
    let place = |index: usize| {
        let packed = run.take.poses().nth(index).unwrap();
        head(&run.take, &run.take.unpack(packed), "Hips")
    };
    let rest = head(&run.take, &human.skeleton.rest_pose(), "Hips");
    let to = rest + Vec3::new(0.0, 0.4, 0.1);
    assert!(place(90).distance(to) < 1e-3, "{} {to}", place(90));
    assert!(place(45).y < rest.y + 0.05 && place(149).y < rest.y + 0.05, "{} {}", place(45), place(149));
    let largest = (1..150).map(|index| place(index).distance(place(index - 1))).fold(0.0, f32::max);
    assert!(largest < 0.08, "no jump: {largest} in 10 ms");
}

/// A puppet that drives every bone needs no inverse kinematics, until something is dragged in the middle of the take.
#[test]
fn a_take_that_began_without_inverse_kinematics_goes_on_with_it() {
    let hand = character("hand");
    let wrist = &hand.skeleton.bones()[0].name;
    let run = dragged("hand", &hand, &[&format!("{wrist}@0.5..1.1=+0,0.05,0.1:over=0.15")], None);
    assert_eq!(run.take.header().inverse_kinematics, None);
    assert!(run.take.inverse_kinematics().is_some());
    assert!(matches!(verify(&run.take, &mut keep_going), Err(ReplayError::NeedsCharacter)));
    assert_solved_again(&run, &hand);
    let begins = run.take.records().iter().filter(|record| matches!(record, Record::InverseKinematics(_))).count();
    assert_eq!(begins, 1);
}

#[test]
fn what_cannot_be_held_is_named_with_its_distance() {
    let human = character("human");
    let run = dragged("human8", &human, &["LeftHand=9,1,0"], None);
    let [missed] = &run.summary.missed_targets[..] else { panic!("{:?}", run.summary.missed_targets) };
    assert!(missed.name == "LeftHand" && missed.distance > 5.0, "{missed:?}");
    assert!(run.summary.to_string().contains("targets    missed: LeftHand by up to "), "{}", run.summary);
}

/// What a human did, a spider and a human with its own mapping do anew, and what they did replays.
#[test]
fn a_take_performs_for_another_character_or_mapping() {
    let human = character("human");
    let run = dragged("human8", &human, &["UpperChest@0.2..0.9=+0.06,-0.03,0.04", "vertex:100@0.4..=+0,0,0.02"], None);
    let spider = character("spider");
    let cast = |character: &Arc<LoadedCharacter>, mapping| Recast {
        character: character.clone(),
        mapping,
        ground: GroundArgs::default(),
    };
    let (solved, notes) = recast(&run.take, &cast(&spider, None), &mut keep_going).unwrap();
    assert_eq!(solved.skeleton(), Some(&spider.skeleton));
    assert_eq!(solved.poses().count(), run.take.poses().count());
    assert!(notes.iter().any(|note| note.contains("vertex:100")), "{notes:?}");
    let mut completion = takes::completion(&solved, &spider).unwrap();
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    assert!(verify_completed(&solved, completion, &mut keep_going).unwrap().is_exact());
    // With its own mapping it is the same performance; with fewer joints another one.
    let (same, notes) = recast(&run.take, &cast(&human, Some(run.mapping().clone())), &mut keep_going).unwrap();
    assert_eq!(notes, Vec::<String>::new());
    assert!(same.poses().eq(run.take.poses()), "the same mapping gives the same poses");
    let mut fewer = run.mapping().clone();
    fewer.entries.truncate(3);
    let (other, _) = recast(&run.take, &cast(&human, Some(fewer)), &mut keep_going).unwrap();
    assert_eq!(other.poses().count(), run.take.poses().count());
    assert!(!other.poses().eq(run.take.poses()));
}
