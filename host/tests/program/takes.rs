//! Takes in use: edit lists that leave them as they are, and comparing them in anybody's CI.

use std::path::Path;
use std::process::Command;

use armature_take::{Record, Take, TakeWriter};

use crate::common::Place;

/// Two takes of the human with different motions.
fn prepared(name: &str) -> Place {
    let place = Place::new(name);
    for (take, motion, seconds) in [("body.take", "walk", "2"), ("arms.take", "wave", "1.5")] {
        let run = ["run", "--device", "sim:human", "--character", "human", "--virtual-clock", "--quiet"];
        place
            .done(&[&run[..], &["--motion", motion, "--seconds", seconds, "--rate", "100", "--record", take]].concat());
    }
    place
}

/// A bone of the take that a joint drives and that has bones below it.
fn arm_of(place: &Place) -> String {
    let take = Take::read(&place.read("body.take")).unwrap().0;
    let bones = take.skeleton().unwrap().bones();
    let arm = bones.iter().find(|bone| bone.name.to_lowercase().contains("arm")).unwrap();
    arm.name.clone()
}

#[test]
fn an_edit_list_is_built_step_by_step_and_exported_and_the_takes_stay() {
    let place = prepared("takes-edit");
    let before = (place.read("body.take"), place.read("arms.take"));
    let arm = arm_of(&place);
    let made = place.done(&["edit", "walk.edit", "new", "body.take"]);
    assert!(made.out.contains("walk.edit: \"body.take\" after 0 edits"), "{made:?}");
    place.done(&["edit", "walk.edit", "trim", "0.5", "1.8"]);
    let edited =
        place.done(&["edit", "walk.edit", "overdub", "arms.take", "--bones", &arm, "--at", "0.2", "--blend", "0.2"]);
    assert!(edited.out.contains("1. overdub") && edited.out.contains("2. trim"), "solving comes first: {edited:?}");
    place.done(&["edit", "walk.edit", "smooth", "8"]);
    place.done(&["edit", "walk.edit", "marker", "0.4", "heel down"]);
    place.done(&["edit", "walk.edit", "segment", "step", "0.1", "0.9"]);
    let shown = place.done(&["edit", "walk.edit"]);
    for said in ["1.300 s", "marker at 0.400 s: heel down", "segment \"step\"", "5. segment"] {
        assert!(shown.out.contains(said), "{said}: {shown:?}");
    }
    assert!(shown.err.contains("zero phase"), "{shown:?}");
    place.done(&["export", "walk.edit", "--to", "walk.bvh", "--fps", "24"]);
    // On the floor it is another motion, without a change of the take.
    place.done(&["export", "walk.edit", "--to", "grounded.bvh", "--fps", "24", "--ground", "walk"]);
    assert!(place.read("grounded.bvh") != place.read("walk.bvh"));
    place.done(&["export", "walk.edit", "--to", "walk.glb", "--fps", "24", "--reduce-keys"]);
    let bvh = armature_formats::motion::read_bvh(&place.read("walk.bvh")).unwrap().motion;
    assert_eq!(bvh.frames.len(), 32, "1.3 s at 24 frames a second");
    place.done(&["export", "walk.edit", "--to", "again.bvh", "--fps", "24"]);
    assert!(place.read("again.bvh") == place.read("walk.bvh"), "the same list gives the same bytes");
    place.done(&["edit", "walk.edit", "undo"]);
    place.done(&["edit", "walk.edit", "undo", "1"]);
    let shown = place.done(&["edit", "walk.edit"]);
    assert!(shown.out.contains("after 3 edits") && !shown.out.contains("overdub"), "{shown:?}");
    place.done(&["export", "walk.edit", "--to", "other.bvh", "--fps", "24"]);
    assert!(place.read("other.bvh") != place.read("walk.bvh"));
    assert!((place.read("body.take"), place.read("arms.take")) == before, "takes are never changed");
}

#[test]
fn edits_that_cannot_be_are_refused_and_not_saved() {
    let place = prepared("takes-bad-edits");
    place.done(&["edit", "a.edit", "new", "body.take"]);
    let list = place.read("a.edit");
    place.fails(2, "a.edit", &["edit", "a.edit", "new", "body.take"]);
    place.fails(2, "notes.txt", &["edit", "notes.txt", "new", "body.take"]);
    place.fails(3, "gone.take", &["edit", "b.edit", "new", "gone.take"]);
    place.fails(3, "outside", &["edit", "b.edit", "new", "../body.take"]);
    assert!(!place.path("b.edit").exists());
    place.fails(3, "missing.edit", &["edit", "missing.edit", "mirror"]);
    place.fails(3, "nobone", &["edit", "a.edit", "mute", "--bones", "nobone"]);
    place.fails(3, "gone.take", &["edit", "a.edit", "add", "gone.take"]);
    place.fails(3, "leaves nothing", &["edit", "a.edit", "trim", "50", "60"]);
    place.fails(3, "0.01", &["edit", "a.edit", "retime", "0"]);
    place.fails(2, "has no edit 1", &["edit", "a.edit", "undo"]);
    assert!(place.read("a.edit") == list, "what was refused is not saved");
    place.write("torn.edit", "version = 1\ntake = \"body.take\"\n[[edit]]\ndo = \"fly\"\n");
    place.fails(3, "fly", &["export", "torn.edit", "--to", "torn.bvh"]);
    place.write("torn.edit", b"\xff\xfe");
    place.fails(3, "torn.edit", &["edit", "torn.edit"]);
}

/// The take with one rotation of one pose changed.
fn with_a_fault(place: &Place, degrees: f32) -> String {
    let take = Take::read(&place.read("body.take")).unwrap().0;
    let mut writer = TakeWriter::new(Vec::new(), take.header()).unwrap();
    let mut poses = 0;
    for record in take.records() {
        match record {
            Record::Pose(packed) => {
                poses += 1;
                let mut pose = take.unpack(packed);
                if poses == 50 {
                    let turn = &mut pose.parent_from_bone[3].rotation;
                    *turn = (*turn * glam::Quat::from_rotation_x(degrees.to_radians())).normalize();
                }
                writer.pose(packed.sequence, packed.device_micros, &pose).unwrap();
            }
            other => writer.record(other).unwrap(),
        }
    }
    place.write("expected.take", writer.finish().unwrap());
    take.skeleton().unwrap().bones()[3].name.clone()
}

#[test]
fn replaying_against_another_take_finds_the_first_difference() {
    let place = prepared("takes-verify");
    let same = place.done(&["replay", "body.take", "--verify", "body.take"]);
    assert!(same.out.contains("all as in body.take to the last bit"), "{same:?}");
    let bone = with_a_fault(&place, 0.5);
    let verify = ["replay", "body.take", "--verify", "expected.take"];
    let ran = place.fails(5, "1 differ", &verify);
    for said in [bone.as_str(), "0.500", " s (sample", "joint"] {
        assert!(ran.err.contains(said), "{said}: {ran:?}");
    }
    place.fails(5, "1 differ", &[&verify[..], &["--tolerance", "0.4"]].concat());
    let tolerated = place.done(&[&verify[..], &["--tolerance", "0.6"]].concat());
    assert!(tolerated.out.contains("within 0.6°"), "{tolerated:?}");
    place.fails(5, "differ", &["replay", "arms.take", "--verify", "body.take"]);
    place.fails(2, "--verify", &["replay", "body.take", "--tolerance", "1"]);
    place.fails(3, "gone.take", &["replay", "body.take", "--verify", "gone.take"]);
}

/// The recipe for anybody's CI is run here as its page says.
#[test]
fn the_recipe_for_ci_passes_right_takes_and_fails_wrong_ones() {
    let place = prepared("takes-recipe");
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("recipes/ci/verify-takes");
    let folder = place.path("takes");
    std::fs::create_dir_all(folder.join("expected")).unwrap();
    std::fs::rename(place.path("body.take"), folder.join("body.take")).unwrap();
    std::fs::copy(folder.join("body.take"), place.path("body.take")).unwrap();
    std::fs::copy(place.path("arms.take"), folder.join("arms.take")).unwrap();
    let run = |more: &[&str]| {
        let mut command = Command::new("sh");
        command.arg(&recipe).args(more).current_dir(&place.folder).env("ARMATURE", env!("CARGO_BIN_EXE_armature"));
        for variable in ["HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"] {
            command.env(variable, &place.folder);
        }
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output.status.code(), text)
    };
    let (code, text) = run(&["takes"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("2 takes are as expected"), "{text}");
    with_a_fault(&place, 0.5);
    std::fs::rename(place.path("expected.take"), folder.join("expected/body.take")).unwrap();
    let (code, text) = run(&["takes"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("the first difference is at") && text.contains("1 of 2 takes"), "{text}");
    assert_eq!(run(&["takes", "0.6"]).0, Some(0));
    let (code, text) = run(&["nothing-here"]);
    assert_eq!(code, Some(2), "{text}");
    // The workflow calls the same script.
    let workflow = std::fs::read_to_string(recipe.with_file_name("workflow.yml")).unwrap();
    assert!(workflow.contains("run: sh verify-takes takes"), "{workflow}");
}
