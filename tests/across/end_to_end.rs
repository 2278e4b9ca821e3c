//! From the simulated puppet's first hello to the finished take on the virtual clock: the same every time.

use std::path::Path;
use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature_rig::{Pose, Transform};
use armature_take::{Header, Record, Take, verify};
use armature_tests::{Run, Setup, bones_of, character, keep_going, options, perform};

/// Replays a take and compares every bit.
fn assert_replays(take: &Take) {
    let verification = verify(take, &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{verification:?}");
    assert_eq!(verification.identical, take.samples().count() as u64);
    assert_eq!(take.poses().count(), take.samples().count());
}

fn moved_bones(take: &Take) -> usize {
    let poses: Vec<Pose> = take.poses().map(|packed| take.unpack(packed)).collect();
    let bones = take.skeleton().unwrap().len();
    let moves = |bone: usize| {
        let turn = |pose: &Pose| pose.parent_from_bone[bone].rotation;
        poses.iter().any(|pose| turn(pose).angle_between(turn(&poses[0])) > 1e-3)
    };
    (0..bones).filter(|&bone| moves(bone)).count()
}

#[test]
fn one_seed_gives_one_take_and_another_seed_another() {
    // The human with its mesh, so that skinning runs too; the others by their bones alone.
    for (name, character) in [("human", character("human")), ("spider", bones_of("spider")), ("hand", bones_of("hand"))]
    {
        let setup = Setup::samples(150, 100.0);
        let run = |seed: u64| -> Run { perform(options(name, seed).puppet().unwrap(), &character, &setup) };
        let (first, second, other) = (run(7), run(7), run(8));
        assert_eq!(first.bytes.len(), second.bytes.len(), "{name}");
        assert!(first.bytes == second.bytes, "{name}: two runs with one seed differ");
        assert_eq!(first.events, second.events, "{name}");
        assert!(first.bytes != other.bytes, "{name}: the seed changes nothing");
        assert_replays(&first.take);
        assert_eq!(first.take.samples().count(), 150, "{name}");
        let (_, bones, driven) = first.summary.joints_bones_driven;
        let moved = moved_bones(&first.take);
        println!("{name}: {} bytes; of {bones} bones {driven} are driven and {moved} moved", first.bytes.len());
        assert!(moved > driven / 2, "{name}: {moved} of {driven} driven bones moved");
    }
}

#[test]
fn what_a_take_holds_does_not_depend_on_what_went_on_before_it() {
    let character = bones_of("hand");
    let long = perform(options("hand", 3).puppet().unwrap(), &character, &Setup::samples(200, 100.0));
    let short = perform(options("hand", 3).puppet().unwrap(), &character, &Setup::samples(120, 100.0));
    for (a, b) in short.take.poses().zip(long.take.poses()) {
        assert_eq!(a, b, "a longer take begins like a shorter one");
    }
}

/// The golden take: the hand, one second at 25 samples a second. It contains its own skeleton, so changing our
/// characters does not affect it; changing the simulator, wire, session, proposal, solver or file does.
const GOLDEN: &str = "golden/hand.take";
const HOW_TO_BLESS: &str = "if the change is intended, write a new golden take with \
                            `ARMATURE_BLESS=1 cargo test -p armature-tests --test across end_to_end` and say why in the commit";

fn perform_golden(character: &Arc<LoadedCharacter>) -> Run {
    let setup = Setup {
        header: Header {
            program_version: "golden".into(),
            character_name: "hand".into(),
            nominal_samples_per_second: Some(25.0),
            seed: Some(2014),
            virtual_clock: true,
            ..Header::default()
        },
        ..Setup::samples(25, 25.0)
    };
    perform(options("hand", 2014).puppet().unwrap(), character, &setup)
}

/// Where two transforms differ by more than the last bits, which another processor may round differently.
fn far_apart(a: &Transform, b: &Transform) -> bool {
    let pairs = [
        (a.translation.extend(0.0), b.translation.extend(0.0)),
        (a.rotation.into(), b.rotation.into()),
        (a.scale.extend(0.0), b.scale.extend(0.0)),
    ];
    !pairs.iter().all(|(a, b)| (*a - *b).abs().max_element() <= 1e-6)
}

#[test]
fn the_golden_take_comes_out_again() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(GOLDEN);
    if std::env::var_os("ARMATURE_BLESS").is_some() {
        std::fs::write(&path, perform_golden(&bones_of("hand")).bytes).unwrap();
        println!("wrote {}", path.display());
    }
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes.len() < 60_000, "a golden take is small");
    let (golden, report) = Take::read(&bytes).unwrap();
    assert!(report.is_whole(), "{report}");
    let skeleton = golden.skeleton().unwrap().clone();
    let again = perform_golden(&Arc::new(LoadedCharacter::bare("hand", "hand", skeleton)));

    let kinds = |take: &Take| take.records().iter().map(Record::kind).collect::<Vec<_>>();
    assert_eq!(kinds(&golden), kinds(&again.take), "the records differ; {HOW_TO_BLESS}");
    for (index, (was, is)) in golden.records().iter().zip(again.take.records()).enumerate() {
        if let (Record::Pose(was), Record::Pose(is)) = (was, is) {
            let (was, is) = (golden.unpack(was), again.take.unpack(is));
            let mut bones = was.parent_from_bone.iter().zip(&is.parent_from_bone);
            let differs = bones.position(|(a, b)| far_apart(a, b));
            assert_eq!(differs, None, "record {index}: the pose of this bone differs; {HOW_TO_BLESS}");
        } else {
            // Samples, topology, calibration and the rest: bit for bit on every machine.
            assert_eq!(was, is, "record {index}; {HOW_TO_BLESS}");
        }
    }
    if cfg!(target_arch = "x86_64") {
        assert!(bytes == again.bytes, "the poses differ in their last bits; {HOW_TO_BLESS}");
        assert_replays(&golden);
    }
    assert!(moved_bones(&golden) >= 8, "it moves");
}
