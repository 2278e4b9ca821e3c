//! Ctrl-C, a request to end, and a closed terminal each end a performance and lose nothing of it.

#![cfg(unix)]

mod common;

use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use common::Place;

/// Long enough for a loaded machine to make a character and connect to a puppet.
const PATIENCE: Duration = Duration::from_mins(2);
/// Two flushes of a take.
const SOME_BYTES: u64 = 60_000;

/// Records `NAME.take` and, once there is something in it, sends a signal to the program and the simulated puppet, as a
/// terminal does to all processes of its foreground group.
fn recorded_until(signal: &str, place: &Place, name: &str) -> Output {
    let take = format!("{name}.take");
    let mut command = place.command(&["run", "--device", "sim:human", "--rate", "500", "--record", &take]);
    command.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped());
    let program = command.spawn().expect("the program starts");
    let start = Instant::now();
    let recorded = || std::fs::metadata(place.path(&take)).map_or(0, |file| file.len());
    while recorded() < SOME_BYTES {
        assert!(start.elapsed() < PATIENCE, "nothing was recorded");
        std::thread::sleep(Duration::from_millis(20));
    }
    let group = format!("kill -{signal} -{}", program.id());
    assert!(Command::new("sh").args(["-c", &group]).status().expect("sh").success());
    program.wait_with_output().expect("the program ends")
}

/// Starts a program that will be stuck some time after it is ready, waits for that long, and interrupts it until it
/// ends. Returns how many interrupts that took, and its exit code.
fn interrupted_until_it_ends(
    place: &Place,
    arguments: &[&str],
    is_ready: impl Fn(&str) -> bool,
    until_stuck: Duration,
) -> (usize, Option<i32>) {
    let mut command = place.command(arguments);
    command.process_group(0).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut program = command.spawn().expect("the program starts");
    let lines = BufReader::new(program.stderr.take().expect("its standard error")).lines();
    assert!(lines.map_while(Result::ok).any(|line| is_ready(&line)), "it is never ready");
    let interrupt = format!("kill -INT {}", program.id());
    std::thread::sleep(until_stuck);
    let start = Instant::now();
    let mut times = 0;
    loop {
        times += 1;
        assert!(Command::new("sh").args(["-c", &interrupt]).status().expect("sh").success());
        std::thread::sleep(Duration::from_millis(500));
        if let Some(status) = program.try_wait().expect("it can be waited for") {
            return (times, status.code());
        }
        assert!(start.elapsed() < PATIENCE, "it goes on after {times} interrupts");
    }
}

#[test]
fn a_second_interrupt_ends_a_run_that_is_stuck() {
    let place = Place::new("interrupt-twice");
    // Nobody reads from this pipe, so that opening it takes forever.
    let pipe = place.path("pipe.take");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    let run = ["run", "--device", "sim:hand", "--character", "hand", "--record", "pipe.take"];
    // On a loaded machine the first Ctrl-C may come before the program opens the pipe, and then ends it tidily.
    let waits = [1, 4, 16].map(Duration::from_secs);
    let ready = |line: &str| line.contains("hold the rest pose");
    let ends = waits.into_iter().map(|wait| interrupted_until_it_ends(&place, &run, ready, wait));
    let stuck = ends.into_iter().find(|(times, _)| *times > 1);
    assert_eq!(stuck.expect("the first Ctrl-C waits for what is in progress").1, Some(130));
}

#[test]
fn every_request_to_end_finishes_the_take() {
    let place = Place::new("interrupt");
    for signal in ["INT", "TERM", "HUP"] {
        let output = recorded_until(signal, &place, signal);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{signal}: {said}");
        assert!(!said.contains("error"), "{signal}: {said}");
        let take = place.done(&["inspect", &format!("{signal}.take")]);
        assert!(take.out.contains("complete: ended cleanly"), "{signal}: {take:?}");
    }
}
