//! The session with C firmware on an emulated ARM board, over the emulator's serial port.
//!
//! `firmware-protocol/reference-firmware/run` builds the firmware and runs this with `ARMATURE_FIRMWARE` set to it.
//! `ARMATURE_REQUIRE_FIRMWARE` makes it fail instead of skip without that.

#![cfg(unix)]

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use armature_device::{Connection, DeviceAddress, Event, Sample, SensorState, SessionSettings, Topology, open};
use tokio::runtime::Handle;

/// An emulated board that has not started to run.
struct Board {
    emulator: Child,
    path: String,
}

impl Board {
    /// `-S` holds the processor until it is told to start, so that no early byte is lost.
    fn with(program: &std::ffi::OsStr) -> Self {
        let mut emulator = Command::new("qemu-system-arm")
            .args([
                "-M",
                "lm3s6965evb",
                "-nodefaults",
                "-nographic",
                "-S",
                "-serial",
                "pty",
                "-qmp",
                "stdio",
                "-kernel",
            ])
            .arg(program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .expect("qemu-system-arm runs");
        let mut said = BufReader::new(emulator.stdout.take().expect("its output")).lines();
        let path = loop {
            let line = said.next().expect("the emulator reports its port").expect("a line");
            if let Some((_, rest)) = line.split_once("char device redirected to ") {
                break rest.split_whitespace().next().expect("a path").to_owned();
            }
        };
        // The emulator stops if nobody reads its output.
        std::thread::spawn(move || said.for_each(drop));
        Self { emulator, path }
    }

    fn go(&mut self) {
        let mut words = self.emulator.stdin.as_ref().expect("its input");
        words.write_all(b"{\"execute\":\"qmp_capabilities\"}{\"execute\":\"cont\"}\n").expect("it listens");
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

/// The firmware's table for a sensor: a sine of 64 steps of 16 ms, 1024 counts high, about its own middle.
fn expected_count(part: usize, sensor: usize, device_micros: u64) -> f64 {
    let step = (device_micros as f64 / 16_000.0) + (part * 7 + sensor * 16) as f64;
    (part * 1_000) as f64 + 1_024.0 * (step * std::f64::consts::TAU / 64.0).sin()
}

fn assert_is_true(sample: &Sample, parts: &[usize]) {
    let kinds = [0, 3, 1, 3, 1, 3, 3, 1];
    let sensors: Vec<(usize, usize)> = parts.iter().flat_map(|&p| (0..kinds[p]).map(move |s| (p, s))).collect();
    assert_eq!(sample.counts.len(), sensors.len());
    assert!(sample.states.iter().all(|&state| state == SensorState::Ok));
    for (&count, &(part, sensor)) in sample.counts.iter().zip(&sensors) {
        let expected = expected_count(part, sensor, sample.device_micros).rem_euclid(16_384.0);
        let apart = (f64::from(count) - expected).rem_euclid(16_384.0);
        let apart = apart.min(16_384.0 - apart);
        // The table is linear between its steps and rounded to whole counts.
        assert!(apart < 6.0, "part {part}, sensor {sensor}: {count} instead of {expected:.1}");
    }
}

/// Which of the firmware's parts a tree contains, by the last byte of their numbers.
fn parts_of(topology: &Topology) -> Vec<usize> {
    topology.parts.iter().map(|part| usize::from(part.uid.0[11]) - 1).collect()
}

#[tokio::test]
async fn the_reference_firmware_is_a_puppet() {
    let Some(program) = std::env::var_os("ARMATURE_FIRMWARE") else {
        assert!(std::env::var_os("ARMATURE_REQUIRE_FIRMWARE").is_none(), "ARMATURE_FIRMWARE is not set");
        println!("SKIPPED: run firmware-protocol/reference-firmware/run");
        return;
    };
    let mut board = Board::with(&program);
    let address: DeviceAddress = format!("serial:{}", board.path).parse().unwrap();
    let line = open(&address).await.unwrap();
    board.go();
    let mut connection = Connection::spawn(&Handle::current(), line, SessionSettings::default());
    connection.start(1_000_000);
    let mut parts: Vec<usize> = Vec::new();
    let (mut samples, mut lost, mut trees, mut epochs) = (0_u32, 0_u32, 0, std::collections::BTreeSet::new());
    let mut blinked = false;
    let (mut first, mut last) = (None, 0);
    while samples < 6_000 {
        let event = tokio::time::timeout(Duration::from_mins(2), connection.next()).await.expect("an event in time");
        match event.expect("the connection stands") {
            Event::Connected(info) => assert_eq!((info.name.as_str(), info.protocol), ("Reference firmware", [1, 0])),
            Event::Topology(topology) => {
                parts = parts_of(&topology);
                trees += 1;
                let whole = parts == [0, 1, 2, 3, 4, 5, 6, 7];
                assert!(whole || parts == [0, 1, 2, 3, 4, 5], "the last arm comes and goes: {parts:?}");
                connection.blink(topology.parts[1].uid, 200);
            }
            Event::Sample(sample) => {
                assert_is_true(&sample, &parts);
                samples += 1;
                epochs.insert(sample.epoch);
                first.get_or_insert(sample.device_micros);
                last = sample.device_micros;
            }
            Event::Lost { count, .. } => lost += count,
            Event::Blinking { .. } => blinked = true,
            Event::Problem(problem) => panic!("{problem}"),
            Event::Noise { checksum_errors, framing_errors, bytes } => {
                panic!("a quiet line: {checksum_errors} {framing_errors} {bytes}")
            }
            _ => {}
        }
    }
    let seconds = (last - first.unwrap_or(0)) as f64 * 1e-6;
    println!("{samples} samples in {seconds:.2} s of the board's time, {lost} skipped, {trees} trees");
    assert!(blinked && trees >= 4 && epochs.len() >= 4, "parts were pulled and plugged in while it streamed");
    // A busy machine may pause board or host for a while: then requests are repeated, and a very late answer looks like
    // a board that has restarted. Still, nothing may be damaged or invented.
    let counters = connection.close().await;
    println!("{counters:?}");
    assert_eq!((counters.checksum_errors, counters.framing_errors, counters.malformed_messages), (0, 0, 0));
}
