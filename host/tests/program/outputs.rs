//! No output destroys an existing file, whether an input or anything else, unless `--force` is given. And output that
//! cannot be printed never ends the work.

use std::fs::File;
use std::process::Stdio;

use crate::common::{Place, TUBE_TGF, tube_obj};

/// The program's inputs, and a take.
fn prepared(name: &str) -> Place {
    let place = Place::new(name);
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.done(&["volume", "tube.obj", "--vertices", "300", "-o", "tube.mesh", "--quiet"]);
    place.done(&["bind", "tube.obj", "-s", "bones.tgf", "--method", "heat", "-o", "tube.armature", "--quiet"]);
    let run = ["run", "--device", "sim:joints:2", "--character", "tube.armature", "--virtual-clock", "--quiet"];
    place.done(&[&run[..], &["--seconds", "1", "--record", "a.take"]].concat());
    place
}

#[test]
fn nothing_that_is_there_is_written_over() {
    let place = prepared("outputs");
    place.write("notes.txt", "mine");
    place.write("kept.png", "mine");
    let run = ["run", "--device", "sim:joints:2", "--character", "tube.armature", "--virtual-clock", "--seconds", "1"];
    let with_run = |more: &[&'static str]| [&run[..], more].concat();
    let heat = ["bind", "tube.obj", "-s", "bones.tgf", "--method", "heat"];
    for (kept, arguments) in [
        ("a.take", with_run(&["--record", "a.take"])),
        ("a.take", with_run(&["--save-mapping", "a.take"])),
        ("tube.mesh", vec!["volume", "tube.mesh", "-o", "tube.mesh"]),
        ("kept.png", vec!["volume", "tube.obj", "-o", "other.mesh", "--slice", "kept.png"]),
        ("bones.tgf", [&heat[..], &["-o", "other.armature", "--picture", "bones.tgf"]].concat()),
        ("tube.armature", [&heat[..], &["-o", "tube.armature"]].concat()),
        ("kept.png", vec!["weights", "tube.mesh", "--handles", "bones.tgf", "-o", "w.npy", "--picture", "kept.png"]),
        ("a.take", vec!["replay", "a.take", "--at", "0.5", "--picture", "a.take"]),
        ("kept.png", vec!["replay", "a.take", "--filmstrip", "kept.png"]),
        ("notes.txt", vec!["bench", "--plot", "notes.txt", "protocol/encode"]),
    ] {
        let before = place.read(kept);
        place.fails(2, kept, &arguments);
        assert!(place.read(kept) == before, "{kept} by {arguments:?}");
    }
    for never in ["other.mesh", "other.armature", "w.npy"] {
        assert!(!place.path(never).exists(), "{never} must not be left behind by a command that failed");
    }
    // A mesh as a table of weights, and a take as its own export: the file name's extension protects some, the check
    // the rest.
    std::fs::copy(place.path("tube.mesh"), place.path("in.npy")).expect("a copy");
    place.fails(2, "in.npy", &["weights", "tube.mesh", "--handles", "bones.tgf", "-o", "in.npy"]);
    place.write("out.bvh", "mine");
    place.fails(2, "out.bvh", &["export", "a.take", "--to", "out.bvh"]);
    assert_eq!(place.read("out.bvh"), b"mine");

    place.done(&["export", "a.take", "--to", "out.bvh", "--force"]);
    assert!(place.read("out.bvh").starts_with(b"HIERARCHY"));
    let before = place.read("a.take");
    place.done(&with_run(&["--record", "a.take", "--force"]));
    assert!(place.read("a.take") == before, "the same puppet, the same take");
    place.done(&["replay", "a.take", "--at", "0.5", "--picture", "kept.png", "--force"]);
    assert!(place.read("kept.png").starts_with(b"\x89PNG"));
}

#[test]
fn folders_and_calibrations_are_not_made_by_a_slip() {
    let place = prepared("outputs-slip");
    let run = ["run", "--device", "sim:joints:2", "--character", "tube.armature", "--virtual-clock", "--seconds", "1"];
    place.fails(2, "no/where", &[&run[..], &["--record", "no/where/a.take"]].concat());
    place.fails(2, "typo.toml", &[&run[..], &["--calibration", "typo.toml"]].concat());
    place.fails(2, "no/where", &["export", "a.take", "--to", "no/where/a.bvh"]);
    place.fails(2, "no/where", &["volume", "tube.obj", "-o", "no/where/a.mesh"]);
    assert!(!place.path("no").exists() && !place.path("typo.toml").exists());
}

#[test]
fn moments_and_times_that_cannot_be_are_refused() {
    let place = prepared("outputs-moments");
    for at in ["20", "-1", "nan"] {
        place.fails(2, "a.take", &["replay", "a.take", "--at", at, "--picture", "p.png"]);
    }
    assert!(!place.path("p.png").exists());
    place.fails(2, "--at", &["replay", "a.take", "--picture", "p.png"]);
    for between in [["0.5", "20"], ["0.5", "0.2"], ["nan", "1"]] {
        place.fails(2, "", &[&["replay", "a.take", "--filmstrip", "p.png", "--between"][..], &between].concat());
    }
    place.fails(2, "--moments", &["replay", "a.take", "--filmstrip", "p.png", "--moments", "1"]);
    place.done(&["replay", "a.take", "--filmstrip", "p.png", "--moments", "3", "--between", "0.1", "0.8"]);
    assert!(place.read("p.png").starts_with(b"\x89PNG"));
    for seconds in ["-1", "0", "inf"] {
        let ran = place.fails(2, "--seconds", &["run", "--device", "sim:human", "--seconds", seconds]);
        assert!(ran.err.contains("above 0"), "{ran:?}");
    }
    place.fails(2, "--seconds", &["devices", "--watch", "--seconds", "-1"]);
}

#[test]
fn each_demo_has_its_own_folder() {
    let place = Place::new("outputs-demo");
    for folder in ["armature-demo", "armature-demo-2"] {
        place.done(&["demo", "--seconds", "0.2", "--quiet", "--puppet", "hand"]);
        assert!(place.path(folder).join("demo.take").exists(), "{folder}");
    }
    let again = ["demo", "--seconds", "0.2", "--quiet", "--puppet", "hand", "--output", "armature-demo"];
    let before = place.read("armature-demo/demo.glb");
    place.fails(2, "demo.take", &again);
    assert!(place.read("armature-demo/demo.glb") == before);
    place.done(&[&again[..], &["--force"]].concat());
}

#[cfg(unix)]
#[test]
fn a_closed_or_full_standard_output_is_no_panic() {
    let place = prepared("outputs-streams");
    let commands: [&[&str]; 6] = [
        &["inspect", "tube.obj"],
        &["inspect", "a.take", "--json"],
        &["replay", "a.take"],
        &["bench", "--list"],
        &["devices"],
        &["--help"],
    ];
    for arguments in commands {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut closed = place.command(arguments);
        let output = closed.stdout(writer).output().expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
        assert!(!said.contains("panicked") && !said.contains("error"), "{arguments:?}: {said}");

        let full = || Stdio::from(File::options().write(true).open("/dev/full").expect("/dev/full"));
        let output = place.command(arguments).stdout(full()).output().expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code().expect("not killed");
        assert!([2, 3].contains(&code) && !said.contains("panicked"), "{arguments:?}: {code}, {said}");
        // Notes have nowhere to go either; the work is done all the same.
        let output = place.command(arguments).stderr(full()).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
    }
}
