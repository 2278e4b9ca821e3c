//! `armature devices --decode`

use std::io::Read;
use std::path::Path;
use std::time::Duration;

use armature_device::{DeviceAddress, DeviceNotice, DeviceProblem, Event, Session, SessionSettings, Transport, open};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::Instant;

use super::decoding::{Decoding, bytes_of_file};
use crate::descriptors;
use crate::engine::sources::SimulatedPuppet;
use crate::engine::sources::address::{problem_failure, served_address};
use crate::engine::sources::simulated::SimulatedArgs;
use crate::failure::Failure;
use crate::files;
use crate::terminal::{aside, counted, out};

/// Samples a second that a device is asked for; few, so that each can be read.
const RATE_MILLIHERTZ: u32 = 10_000;
const TICK: Duration = Duration::from_millis(20);

/// Tells in words what the bytes of a file (`-`: standard input) or of a device mean. Faults are bad input.
pub(super) fn decode(what: &str, listen_seconds: f64) -> Result<(), Failure> {
    let mut decoding = Decoding::default();
    let (mut has_ended, mut refused) = (true, None);
    if what == "-" {
        let mut content = Vec::new();
        std::io::stdin().read_to_end(&mut content).map_err(|e| Failure::input(format!("standard input: {e}"), ""))?;
        tell(&mut decoding, &bytes_of_file(&content));
    } else if Path::new(what).exists() {
        tell(&mut decoding, &bytes_of_file(&files::read(Path::new(what))?));
    } else {
        let address: DeviceAddress = what.parse().map_err(|e: armature_device::AddressError| {
            Failure::usage(format!("{what} is not a file, and as a device: {e}"), "name a file, - or a device")
        })?;
        (has_ended, refused) = decode_device(&address, listen_seconds, &mut decoding)?;
    }
    let mut lines = Vec::new();
    if has_ended {
        decoding.finish(&mut lines);
    }
    print(&lines);
    let totals = decoding.totals();
    print(&[format!(
        "{}, {}, {}",
        counted(totals.messages as usize, "message", "messages"),
        counted(totals.faults as usize, "unreadable piece", "unreadable pieces"),
        counted(totals.doubts as usize, "contradiction", "contradictions")
    )]);
    if totals.messages + totals.faults == 0 {
        let remedy = "is it powered, is this the right port, and does the line speed match (serial:PATH@BAUD)?";
        return Err(Failure::device("nothing arrived, or only delimiters", remedy));
    }
    if totals.faults + totals.doubts > 0 {
        let faults = totals.faults + totals.doubts;
        let what = format!("{} (the lines with ✗)", counted(faults as usize, "fault", "faults"));
        return Err(Failure::input(what, "firmware-protocol/BUILD_YOUR_OWN_PUPPET.md goes through the protocol"));
    }
    refused.map_or(Ok(()), |problem| Err(problem_failure(&problem)))
}

fn tell(decoding: &mut Decoding, bytes: &[u8]) {
    let mut lines = Vec::new();
    decoding.receive(bytes, &mut lines);
    print(&lines);
}

fn print(lines: &[String]) {
    lines.iter().for_each(|line| out!("{line}"));
}

/// How a conversation ended: whether the stream ended by itself (if the time was up, the frame that was just arriving is
/// no fault), and what the device refused last, unless it sent samples afterwards.
type Ended = (bool, Option<DeviceProblem>);

/// Holds a conversation with a device, as the program would, and prints everything it sends.
fn decode_device(address: &DeviceAddress, listen_seconds: f64, decoding: &mut Decoding) -> Result<Ended, Failure> {
    let (address, _process) = match address {
        DeviceAddress::Sim { name } => {
            let process = SimulatedPuppet::start(name, &SimulatedArgs::default())?;
            (served_address(&process, name)?, Some(process))
        }
        other => (other.clone(), None),
    };
    if matches!(address, DeviceAddress::Servos { .. }) {
        let remedy = "`armature run` reports what is wrong with an arm of servos";
        return Err(Failure::usage("servos speak another protocol", remedy));
    }
    descriptors::check()?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Failure::device(format!("no runtime for the device: {e}"), "close other programs"))?;
    runtime.block_on(async {
        let line = open(&address).await.map_err(|problem| problem_failure(&problem))?;
        converse(line, listen_seconds, decoding).await
    })
}

async fn converse(line: Box<dyn Transport>, seconds: f64, decoding: &mut Decoding) -> Result<Ended, Failure> {
    let mut refused = None;
    let (mut reader, mut writer) = tokio::io::split(line);
    let mut session = Session::new(SessionSettings::default());
    session.start(RATE_MILLIHERTZ);
    let (began, mut events, mut arrived) = (Instant::now(), Vec::new(), vec![0; 4096]);
    let gone = |error: std::io::Error| Failure::device(format!("the line is gone: {error}"), "check cable and power");
    // Opening the port resets many boards; their boot loader comes first.
    let listens = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    let patience = listens.saturating_add(SessionSettings::default().starting_for);
    let mut heard: Option<Instant> = None;
    while heard.map_or_else(|| began.elapsed() < patience, |heard| heard.elapsed() < listens) {
        session.tick(began.elapsed(), &mut events);
        writer.write_all(&session.take_outgoing()).await.map_err(gone)?;
        if let Ok(read) = tokio::time::timeout(TICK, reader.read(&mut arrived)).await {
            let length = read.map_err(gone)?;
            if length == 0 {
                return Ok((true, refused));
            }
            heard.get_or_insert_with(Instant::now);
            session.receive(began.elapsed(), &arrived[..length], &mut events);
            tell(decoding, &arrived[..length]);
        }
        for event in events.drain(..) {
            match event {
                Event::Sample(_) => refused = None,
                Event::Notice(notice @ DeviceNotice::WaitsForStart) => aside!("note: {notice}"),
                Event::Problem(problem) => {
                    aside!("note: {problem}");
                    if matches!(problem, DeviceProblem::Refused { .. }) {
                        refused = Some(problem);
                    }
                }
                _ => {}
            }
        }
    }
    // A device that streams on would be found so by the next program; it copes, but a stop is kinder.
    session.stop();
    session.tick(began.elapsed(), &mut events);
    writer.write_all(&session.take_outgoing()).await.map_err(gone)?;
    Ok((false, refused))
}
