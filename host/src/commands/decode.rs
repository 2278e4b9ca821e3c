//! `armature devices --decode`

use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

use armature_device::{DeviceAddress, Session, SessionSettings, Transport, open};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::Instant;

use crate::decoding::{Decoding, bytes_of_file};
use crate::engine::live::problem_failure;
use crate::engine::second_process::SimulatedPuppet;
use crate::engine::simulated::SimulatedArgs;
use crate::failure::Failure;
use crate::files;

/// Samples a second that a device is asked for; few, so that each can be read.
const RATE_MILLIHERTZ: u32 = 10_000;
const TICK: Duration = Duration::from_millis(20);

/// Tells in words what the bytes of a file (`-`: standard input) or of a device mean. Faults are bad input.
pub(super) fn decode(what: &str, listen_seconds: f64) -> Result<(), Failure> {
    let mut decoding = Decoding::default();
    if what == "-" {
        let mut content = Vec::new();
        std::io::stdin().read_to_end(&mut content).map_err(|e| Failure::input(format!("standard input: {e}"), ""))?;
        tell(&mut decoding, &bytes_of_file(&content))?;
    } else if Path::new(what).exists() {
        tell(&mut decoding, &bytes_of_file(&files::read(Path::new(what))?))?;
    } else {
        let address: DeviceAddress = what.parse().map_err(|e: armature_device::AddressError| {
            Failure::usage(format!("{what} is no file, and as a device: {e}"), "name a file, - or a device")
        })?;
        decode_device(&address, listen_seconds, &mut decoding)?;
    }
    let mut lines = Vec::new();
    decoding.finish(&mut lines);
    print(&lines)?;
    let totals = decoding.totals();
    print(&[format!(
        "{} messages, {} pieces that are none, {} things that cannot be",
        totals.messages, totals.faults, totals.doubts
    )])?;
    if totals.messages + totals.faults == 0 {
        let remedy = "is it powered, is this the right port, and does the line speed match (serial:PATH@BAUD)?";
        return Err(Failure::device("not one byte between two delimiters came", remedy));
    }
    if totals.faults + totals.doubts > 0 {
        let faults = totals.faults + totals.doubts;
        let what = format!("{faults} fault{} (the lines with ✗)", if faults == 1 { "" } else { "s" });
        return Err(Failure::input(what, "firmware-protocol/BUILD_YOUR_OWN_PUPPET.md goes through the protocol"));
    }
    Ok(())
}

fn tell(decoding: &mut Decoding, bytes: &[u8]) -> Result<(), Failure> {
    let mut lines = Vec::new();
    decoding.receive(bytes, &mut lines);
    print(&lines)
}

fn print(lines: &[String]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    for line in lines {
        match writeln!(out, "{line}") {
            // Whoever read it has seen enough.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => return Ok(()),
            other => other.map_err(|e| Failure::input(format!("cannot write: {e}"), ""))?,
        }
    }
    Ok(())
}

/// Holds a conversation with a device, as the program would, and tells all that it says.
fn decode_device(address: &DeviceAddress, listen_seconds: f64, decoding: &mut Decoding) -> Result<(), Failure> {
    let (address, _process) = match address {
        DeviceAddress::Sim { name } => {
            let process = SimulatedPuppet::start(name, &SimulatedArgs::default())?;
            (crate::engine::live::parse_address(process.address())?, Some(process))
        }
        DeviceAddress::Servos { .. } => {
            let remedy = "`armature run` tells what is wrong with an arm of servos";
            return Err(Failure::usage("servos speak another protocol", remedy));
        }
        other => (other.clone(), None),
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Failure::device(format!("no runtime for the device: {e}"), "close other programs"))?;
    runtime.block_on(async {
        let line = open(&address).await.map_err(|problem| problem_failure(&problem))?;
        converse(line, listen_seconds, decoding).await
    })
}

async fn converse(line: Box<dyn Transport>, seconds: f64, decoding: &mut Decoding) -> Result<(), Failure> {
    let (mut reader, mut writer) = tokio::io::split(line);
    let mut session = Session::new(SessionSettings::default());
    session.start(RATE_MILLIHERTZ);
    let (began, mut events, mut arrived) = (Instant::now(), Vec::new(), vec![0; 4096]);
    let gone = |error: std::io::Error| Failure::device(format!("the line is gone: {error}"), "check cable and power");
    while began.elapsed().as_secs_f64() < seconds {
        session.tick(began.elapsed(), &mut events);
        writer.write_all(&session.take_outgoing()).await.map_err(gone)?;
        if let Ok(read) = tokio::time::timeout(TICK, reader.read(&mut arrived)).await {
            let length = read.map_err(gone)?;
            if length == 0 {
                return Ok(());
            }
            session.receive(began.elapsed(), &arrived[..length], &mut events);
            tell(decoding, &arrived[..length])?;
        }
        for event in events.drain(..) {
            if let armature_device::Event::Problem(problem) = event {
                eprintln!("note: {problem}");
            }
        }
    }
    // A device that streams on would be found so by the next program; it copes, but a stop is kinder.
    session.stop();
    session.tick(began.elapsed(), &mut events);
    writer.write_all(&session.take_outgoing()).await.map_err(gone)
}
