//! Too few file descriptors are an error with a name, wherever they run out.

#![cfg(unix)]

use std::process::Command;

use crate::common::{Place, SMALL_BVH};

#[test]
fn running_out_of_file_descriptors_is_a_named_error() {
    let place = Place::new("descriptors");
    place.write("walk.bvh", SMALL_BVH);
    let program = env!("CARGO_BIN_EXE_armature");
    let limited = |limit: u32, arguments: &str| {
        let line = format!("ulimit -n {limit} && exec {program} {arguments}");
        let mut command = Command::new("sh");
        command.args(["-c", &line]).current_dir(&place.folder).env("XDG_CONFIG_HOME", &place.folder);
        let output = command.env("HOME", &place.folder).output().expect("sh starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (mut named, mut done) = (0, 0);
    for limit in 4..=48 {
        // The system itself needs some to start a program.
        if limited(limit, "--version").0 != Some(0) {
            continue;
        }
        for arguments in [
            "run --device sim:walk.bvh --character walk.bvh --seconds 0.1 --rate 50 --force --record a.take",
            "run --device tcp:127.0.0.1:1 --character walk.bvh --seconds 0.1",
            "devices --decode tcp:127.0.0.1:1",
            "sim hand --until-input-ends",
            "inspect walk.bvh",
        ] {
            let (code, said) = limited(limit, arguments);
            assert!(!said.contains("panicked"), "{limit}, {arguments}: {said}");
            let is_refused = said.contains("127.0.0.1:1 cannot be reached");
            match code {
                Some(0) => done += 1,
                // Nobody listens there; the descriptors sufficed to find out.
                Some(4) if is_refused && !said.contains("open files") => done += 1,
                Some(3 | 4) if said.contains("ulimit -n") => named += 1,
                _ => panic!("{limit}, {arguments}: {code:?}: {said}"),
            }
        }
    }
    println!("{named} named errors, {done} done");
    assert!(named > 10 && done > 10, "{named} named errors, {done} done");
}
