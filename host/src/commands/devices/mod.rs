//! `armature devices`

mod decode;
mod decoding;

use std::io::{self, Write};
use std::time::{Duration, Instant};

use armature_device::servo::{ServoArm, ServoProtocol};
use armature_device::{DeviceDescription, DeviceGuess, DeviceWatch, Plugged, PortChange, UDEV_RULES, list_devices};
use armature_sim::Body;

use self::decode::decode;
use crate::cli::args::DevicesArgs;
use crate::failure::Failure;
use crate::terminal::{aside, not_printed, plain};

/// Time between two scans while watching.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Lists what is plugged in, watches it come and go, or explains what one device sends.
pub fn devices(args: &DevicesArgs) -> Result<(), Failure> {
    if let Some(what) = &args.decode {
        return decode(what, args.listen);
    }
    let mut out = io::stdout().lock();
    let written = match args {
        DevicesArgs { udev_rules: true, .. } => out.write_all(UDEV_RULES.as_bytes()),
        DevicesArgs { watch: true, seconds, .. } => watch(&mut out, *seconds),
        _ => list(&mut out),
    };
    written.or_else(|error| not_printed(&error))
}

/// Lists serial ports and puppets with what they may be, known servo arms, and the simulated puppets.
fn list(out: &mut impl Write) -> io::Result<()> {
    let plugged = list_devices();
    tell_problems(&plugged);
    if plugged.devices.is_empty() {
        writeln!(out, "There is no serial port and no puppet on USB. Plug the puppet in, or use a simulated one:")?;
    }
    for device in &plugged.devices {
        writeln!(out, "{}", plain(&line_of(device)))?;
    }
    for arm in ServoArm::presets() {
        let address = format!("{}:PATH,{}", arm.protocol.scheme(), arm.name);
        writeln!(out, "{address:32}  {} ({} servos at {} baud)", arm.title, arm.joints.len(), arm.baud)?;
    }
    for (name, what) in Body::presets() {
        writeln!(out, "{:32}  simulated {what}", format!("sim:{name}"))?;
    }
    writeln!(out, "{:32}  simulated puppet with a joint for each bone of a motion file", "sim:FILE.bvh")
}

/// Prints what is plugged in, then everything that comes and goes.
fn watch(out: &mut impl Write, seconds: Option<f64>) -> io::Result<()> {
    let began = Instant::now();
    let mut watch = DeviceWatch::default();
    let mut problems = Vec::new();
    loop {
        for change in watch.look() {
            match change {
                PortChange::PluggedIn(device) => writeln!(out, "plugged in  {}", plain(&line_of(&device)))?,
                PortChange::Unplugged(device) => writeln!(out, "unplugged   {}", plain(&line_of(&device)))?,
            }
        }
        out.flush()?;
        if watch.known().problems != problems {
            tell_problems(watch.known());
            problems.clone_from(&watch.known().problems);
        }
        if seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds) {
            return Ok(());
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

fn tell_problems(plugged: &Plugged) {
    for problem in &plugged.problems {
        aside!("note: {problem}");
    }
}

/// Address, what it may be, which board or chip it is, and what USB reports: numbers, maker, product, serial number,
/// location.
fn line_of(device: &DeviceDescription) -> String {
    let guess = match device.guess() {
        Some(DeviceGuess::Puppet) => "a puppet?",
        Some(DeviceGuess::Servos(ServoProtocol::Feetech)) => "Feetech servos?",
        Some(DeviceGuess::Servos(ServoProtocol::Dynamixel)) => "Dynamixel servos?",
        Some(DeviceGuess::PuppetOrServos(_)) => "puppet or servos?",
        None => "",
    };
    let usb = device.usb.as_ref().map_or_else(String::new, |usb| {
        let words = [&usb.manufacturer, &usb.product, &usb.serial_number];
        let words: Vec<&str> = words.into_iter().flatten().map(String::as_str).collect();
        let board = device.board().map_or_else(String::new, |board| format!("  {}", board.name));
        let servos = match device.guess() {
            Some(DeviceGuess::PuppetOrServos(protocol)) => format!("; for servos {}", device.servo_address(protocol)),
            _ => String::new(),
        };
        let numbers = format!("{:04x}:{:04x}", usb.vendor_id, usb.product_id);
        format!("  USB {numbers}{board}  {}  ({}{servos})", words.join(" · "), device.port)
    });
    format!("{:32}  {guess:17}{usb}", device.guessed_address().to_string()).trim_end().to_owned()
}
