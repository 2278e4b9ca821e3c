//! `armature devices`

use std::io::{self, Write};
use std::time::{Duration, Instant};

use armature_device::servo::{ServoArm, ServoProtocol};
use armature_device::{DeviceDescription, DeviceGuess, DeviceWatch, Plugged, PortChange, UDEV_RULES, list_devices};

use super::decode::decode;
use crate::cli::args::DevicesArgs;
use crate::failure::Failure;

/// Time between two looks while watching.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Lists what is plugged in, watches it come and go, or tells what one device says.
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
    match written {
        // Whoever read the list has seen enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Failure::input(format!("cannot write the list: {e}"), "")),
    }
}

/// Lists serial ports and puppets with what may be behind them, the arms of servos that are known, and the simulated
/// puppets.
fn list(out: &mut impl Write) -> io::Result<()> {
    let plugged = list_devices();
    tell_problems(&plugged);
    if plugged.devices.is_empty() {
        writeln!(out, "No serial port and no puppet on USB is there. Plug the puppet in, or use a simulated one:")?;
    }
    for device in &plugged.devices {
        writeln!(out, "{}", line_of(device))?;
    }
    for arm in ServoArm::presets() {
        let address = format!("{}:PATH,{}", arm.protocol.scheme(), arm.name);
        writeln!(out, "{address:32}  {} ({} servos at {} baud)", arm.title, arm.joints.len(), arm.baud)?;
    }
    for (address, what) in [
        ("sim:human", "simulated human"),
        ("sim:spider", "simulated spider"),
        ("sim:hand", "simulated hand"),
        ("sim:FILE.bvh", "a puppet with a joint for each bone of a motion file"),
    ] {
        writeln!(out, "{address:32}  {what}")?;
    }
    Ok(())
}

/// Tells what is there, and from then on what comes and goes.
fn watch(out: &mut impl Write, seconds: Option<f64>) -> io::Result<()> {
    let began = Instant::now();
    let mut watch = DeviceWatch::default();
    let mut problems = Vec::new();
    loop {
        for change in watch.look() {
            match change {
                PortChange::PluggedIn(device) => writeln!(out, "plugged in  {}", line_of(&device))?,
                PortChange::Unplugged(device) => writeln!(out, "unplugged   {}", line_of(&device))?,
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
        eprintln!("note: {problem}");
    }
}

/// Address, what it may be, and what USB tells: numbers, maker, product, serial number, place.
fn line_of(device: &DeviceDescription) -> String {
    let guess = match device.guess() {
        Some(DeviceGuess::Puppet) => "a puppet?",
        Some(DeviceGuess::Servos(ServoProtocol::Feetech)) => "Feetech servos?",
        Some(DeviceGuess::Servos(ServoProtocol::Dynamixel)) => "Dynamixel servos?",
        None => "",
    };
    let usb = device.usb.as_ref().map_or_else(String::new, |usb| {
        let words = [&usb.manufacturer, &usb.product, &usb.serial_number];
        let words: Vec<&str> = words.into_iter().flatten().map(String::as_str).collect();
        format!("  USB {:04x}:{:04x}  {}  ({})", usb.vendor_id, usb.product_id, words.join(" · "), device.port)
    });
    format!("{:32}  {guess:17}{usb}", device.guessed_address().to_string()).trim_end().to_owned()
}
