//! A puppet inside the virtual machine: the emulated one, behind the kernel's gadget drivers.
//!
//! ```text
//! usb-puppet acm  /dev/ttyGS0   SEED       the device's end of CDC-ACM
//! usb-puppet hid  /dev/hidg0    SEED       the device's end of HID
//! usb-puppet bulk /dev/ffs      SEED       FunctionFS: describes the interface to the kernel first
//! ```
//!
//! When the cable is pulled the puppet loses power; when it is back, a new one starts.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use armature_sim::{Body, Motion, Puppet, PuppetSettings};
use firmware_protocol::carriers::{BULK_CLASS, BULK_PROTOCOL, BULK_SUBCLASS, read_report, write_report};

/// Never a whole number of packets, so that every transfer ends with a short one.
const BULK_TRANSFER: usize = 511;

type Error = Box<dyn std::error::Error>;

/// How the stream passes through a gadget's file.
#[derive(Clone, Copy)]
enum Carrier {
    Acm,
    Bulk,
    Hid,
}

fn main() -> Result<(), Error> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [carrier, path, seed] = &arguments[..] else { return Err("usb-puppet acm|bulk|hid PATH SEED".into()) };
    let seed: u64 = seed.parse()?;
    let path = Path::new(path);
    match carrier.as_str() {
        "acm" => serve(Carrier::Acm, path, path, seed),
        "hid" => serve(Carrier::Hid, path, path, seed),
        "bulk" => {
            // The interface exists as long as this file is open.
            let mut control = OpenOptions::new().read(true).write(true).open(path.join("ep0"))?;
            control.write_all(&function_descriptors())?;
            control.write_all(&function_strings())?;
            serve(Carrier::Bulk, &path.join("ep2"), &path.join("ep1"), seed)
        }
        other => Err(format!("no carrier {other}").into()),
    }
}

fn serve(carrier: Carrier, input: &Path, output: &Path, seed: u64) -> Result<(), Error> {
    loop {
        let body = Body::preset("joints:8", seed)?;
        let puppet = Puppet::new(PuppetSettings { motion: Motion::Wiggle, ..PuppetSettings::new(body) })?;
        if let Err(error) = live(carrier, input, output, puppet) {
            eprintln!("{}: {error}", input.display());
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// One life of a puppet, from plugging in to unplugging.
fn live(carrier: Carrier, input: &Path, output: &Path, mut puppet: Puppet) -> Result<(), Error> {
    if let Carrier::Acm = carrier {
        Command::new("stty").arg("-F").arg(input).args(["raw", "-echo"]).status()?;
    }
    let reads = File::open(input)?;
    let mut writes = OpenOptions::new().write(true).open(output)?;
    let heard = listen(carrier, reads);
    let began = Instant::now();
    let mut said = Vec::new();
    loop {
        let now = began.elapsed().as_micros() as u64;
        let due =
            puppet.next_due_micros().map_or(Duration::from_secs(1), |at| Duration::from_micros(at.saturating_sub(now)));
        let bytes = match heard.recv_timeout(due) {
            Ok(bytes) => bytes?,
            Err(RecvTimeoutError::Timeout) => Vec::new(),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        said.clear();
        puppet.step(began.elapsed().as_micros() as u64, &bytes, &mut said);
        say(carrier, &mut writes, &said)?;
    }
}

/// What the host sends, read by a thread that ends with the line.
fn listen(carrier: Carrier, mut input: File) -> Receiver<io::Result<Vec<u8>>> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut bytes = vec![0; 16_384];
        loop {
            let heard = match (input.read(&mut bytes), carrier) {
                (Ok(0), Carrier::Acm) => Err(io::ErrorKind::UnexpectedEof.into()),
                (Ok(length), Carrier::Hid) => Ok(read_report(&bytes[..length]).unwrap_or_default().to_vec()),
                (Ok(length), _) => Ok(bytes[..length].to_vec()),
                (Err(error), _) => Err(error),
            };
            let over = heard.is_err();
            if sender.send(heard).is_err() || over {
                return;
            }
        }
    });
    receiver
}

fn say(carrier: Carrier, output: &mut File, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match carrier {
            Carrier::Hid => {
                let (report, taken) = write_report(bytes);
                output.write_all(&report)?;
                bytes = &bytes[taken..];
            }
            Carrier::Acm | Carrier::Bulk => {
                let length = bytes.len().min(BULK_TRANSFER);
                // Each call is one transfer.
                let written = output.write(&bytes[..length])?;
                bytes = &bytes[written..];
            }
        }
    }
    Ok(())
}

/// The description that `FunctionFS` wants first: an interface and its two endpoints, for full and for high speed.
fn function_descriptors() -> Vec<u8> {
    const BULK: u8 = 2;
    let for_speed = |packet: u16| {
        let mut bytes = vec![9, 4, 0, 0, 2, BULK_CLASS, BULK_SUBCLASS, BULK_PROTOCOL, 1];
        for address in [0x81, 0x02] {
            bytes.extend([7, 5, address, BULK]);
            bytes.extend(packet.to_le_bytes());
            bytes.push(0);
        }
        bytes
    };
    let (full, high) = (for_speed(64), for_speed(512));
    let words = |words: [u32; 5]| words.into_iter().flat_map(u32::to_le_bytes);
    // Magic number of the second version, length, flags: full and high speed; three descriptors each.
    let length = 20 + full.len() + high.len();
    words([3, length as u32, 3, 3, 3]).chain(full).chain(high).collect()
}

fn function_strings() -> Vec<u8> {
    let name = b"Armature puppet\0";
    let (english, length) = (0x0409_u16, 16 + 2 + name.len());
    let words = [2, length as u32, 1, 1].into_iter().flat_map(u32::to_le_bytes);
    words.chain(english.to_le_bytes()).chain(name.iter().copied()).collect()
}
