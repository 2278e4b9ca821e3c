//! Ctrl-C ends a performance and loses nothing of it.

#![cfg(unix)]

mod common;

use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::Place;

/// Long enough for a loaded machine to shape a character and shake hands with a puppet.
const PATIENCE: Duration = Duration::from_mins(1);
/// Two flushes of a take.
const SOME_BYTES: u64 = 60_000;

/// A terminal interrupts all processes of the foreground group at once, the simulated puppet's among them.
#[test]
fn ctrl_c_finishes_the_take() {
    let place = Place::new("interrupt");
    let arguments = ["run", "--device", "sim:human", "--rate", "500", "--record", "a.take"];
    let mut command = place.command(&arguments);
    command.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped());
    let program = command.spawn().expect("the program starts");

    let start = Instant::now();
    let recorded = || std::fs::metadata(place.path("a.take")).map_or(0, |file| file.len());
    while recorded() < SOME_BYTES {
        assert!(start.elapsed() < PATIENCE, "nothing was recorded");
        std::thread::sleep(Duration::from_millis(20));
    }
    let group = format!("kill -INT -{}", program.id());
    assert!(Command::new("sh").args(["-c", &group]).status().expect("sh").success());
    let output = program.wait_with_output().expect("the program ends");

    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(!said.contains("error"), "{said}");
    let take = place.done(&["inspect", "a.take"]);
    assert!(take.out.contains("whole: ended cleanly"), "{take:?}");
}
