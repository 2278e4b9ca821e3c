//! Device addresses as users write them, and device problems as users read them.

use armature_device::{DeviceAddress, DeviceProblem};

use super::SimulatedPuppet;
use crate::failure::{Failure, FailureKind};

/// Parses a device address as the user writes it.
pub fn parse_address(text: &str) -> Result<DeviceAddress, Failure> {
    text.parse().map_err(|e: armature_device::AddressError| Failure::usage(e.to_string(), ""))
}

/// Where a simulated puppet is served. `name`: what it simulates; a bus of servos does not say which arm it is.
pub fn served_address(process: &SimulatedPuppet, name: &str) -> Result<DeviceAddress, Failure> {
    let mut address = parse_address(process.address())?;
    if let DeviceAddress::Servos { arm, .. } = &mut address {
        *arm = Some(name.to_owned());
    }
    Ok(address)
}

/// Whether an address is that of a simulated puppet.
pub fn is_simulated(address: &str) -> Result<bool, Failure> {
    Ok(matches!(parse_address(address)?, DeviceAddress::Sim { .. }))
}

/// The device with the arm's name in its address; only servo arms have one.
pub fn with_preset(device: &str, preset: Option<&str>) -> Result<String, Failure> {
    let Some(preset) = preset else { return Ok(device.to_owned()) };
    match parse_address(device)? {
        DeviceAddress::Servos { protocol, path, baud, .. } => {
            Ok(DeviceAddress::Servos { protocol, path, baud, arm: Some(preset.to_owned()) }.to_string())
        }
        _ => Err(Failure::usage("--preset names an arm of servos", "choose a --device feetech:PATH or dynamixel:PATH")),
    }
}

/// What happened at a device, with the device's name before it unless it is in it already: two programs may run beside
/// each other, each with its own puppet.
pub fn named(device: &str, what: &str) -> String {
    let place = device.split_once(':').map_or(device, |(_, place)| place);
    let place = place.split(['@', ',']).next().unwrap_or(place);
    if place.is_empty() || what.contains(place) { what.to_owned() } else { format!("{device}: {what}") }
}

/// A failure of the device with the device's name; see [`named`].
pub fn name_device(device: &str, failure: Failure) -> Failure {
    match failure.kind {
        FailureKind::Device => Failure { what: named(device, &failure.what), ..failure },
        _ => failure,
    }
}

/// A device problem as the program reports it.
pub fn problem_failure(problem: &DeviceProblem) -> Failure {
    Failure::device(problem.to_string(), "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_happens_at_a_device_is_reported_with_its_name() {
        let silent = "the device has sent nothing for 3 s";
        assert_eq!(named("serial:/dev/ttyACM1@3000000", silent), format!("serial:/dev/ttyACM1@3000000: {silent}"));
        for known in ["there is no port /dev/ttyACM1", "serial:/dev/ttyACM1 is in use"] {
            assert_eq!(named("serial:/dev/ttyACM1", known), known);
            assert_eq!(named("feetech:/dev/ttyACM1@1000000,so101-leader", known), known);
        }
        assert_eq!(named("", silent), silent);
        let usage = Failure::usage("there is no bone", "");
        assert_eq!(name_device("sim:hand", usage.clone()), usage, "that is nothing about the device");
        assert_eq!(name_device("sim:hand", Failure::device(silent, "look")).what, format!("sim:hand: {silent}"));
    }
}
