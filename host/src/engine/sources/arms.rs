//! Servo arms that cannot be told apart.

use armature_device::{DeviceAddress, DeviceDescription, DeviceGuess};

use crate::engine::event::Problem;

/// What to say of an arm whose calibration is also another arm's: servos have no numbers of their own, so arms are told
/// apart by their adapters' serial numbers, and many adapters have none. `plugged`: what is plugged in, asked only where
/// it matters.
pub(super) fn shared_calibration(
    address: &DeviceAddress,
    plugged: &dyn Fn() -> Vec<DeviceDescription>,
) -> Option<Problem> {
    let DeviceAddress::Servos { protocol, path, .. } = address else { return None };
    let real = std::fs::canonicalize(path).map_or_else(|_| path.clone(), |real| real.to_string_lossy().into_owned());
    let has_number = |device: &DeviceDescription| {
        device.usb.as_ref().and_then(|usb| usb.serial_number.as_ref()).is_some_and(|number| !number.is_empty())
    };
    let (own, others): (Vec<_>, Vec<_>) =
        plugged().into_iter().filter(|device| !has_number(device)).partition(|device| device.port == real);
    own.first()?;
    let is_arm = |device: &&DeviceDescription| {
        let either = [DeviceGuess::Servos(*protocol), DeviceGuess::PuppetOrServos(*protocol)];
        device.guess().is_some_and(|guess| either.contains(&guess))
    };
    let names: Vec<&str> = others.iter().filter(is_arm).map(|device| device.port.as_str()).collect();
    if names.is_empty() {
        return None;
    }
    Some(Problem {
        what: format!(
            "the adapters at {real} and {} have no serial numbers, so arms of the same kind there share one calibration",
            names.join(", ")
        ),
        remedy: "give each arm its own file with --calibration".into(),
    })
}

#[cfg(test)]
mod tests {
    use armature_device::UsbDescription;

    use super::*;

    fn adapter(port: &str, serial_number: Option<&str>) -> DeviceDescription {
        let usb = UsbDescription {
            vendor_id: 0x1A86,
            product_id: 0x55D3,
            manufacturer: None,
            product: None,
            serial_number: serial_number.map(str::to_owned),
        };
        DeviceDescription {
            address: DeviceAddress::Serial { path: port.into(), baud: 115_200 },
            port: port.into(),
            usb: Some(usb),
        }
    }

    #[test]
    fn two_arms_without_serial_numbers_do_not_share_a_calibration_silently() {
        let address: DeviceAddress = "feetech:/dev/arm0".parse().unwrap();
        let of = |plugged: &[DeviceDescription]| shared_calibration(&address, &|| plugged.to_vec());
        let own = adapter("/dev/arm0", None);
        let told = of(&[own.clone(), adapter("/dev/arm1", None), adapter("/dev/arm2", Some(""))]).unwrap();
        assert!(told.what.contains("/dev/arm0 and /dev/arm1, /dev/arm2") && told.remedy.contains("--calibration"));
        assert_eq!(of(std::slice::from_ref(&own)), None, "there is no other arm");
        assert_eq!(of(&[own.clone(), adapter("/dev/arm1", Some("A7"))]), None, "the other arm has a number");
        assert_eq!(of(&[adapter("/dev/arm0", Some("A7")), adapter("/dev/arm1", None)]), None, "this one has one");
        let puppet = DeviceDescription { usb: None, ..adapter("/dev/ttyS0", None) };
        assert_eq!(of(&[own, puppet]), None, "that is no arm");
        let puppet: DeviceAddress = "serial:/dev/arm0".parse().unwrap();
        assert_eq!(shared_calibration(&puppet, &|| panic!("puppets have numbers of their own")), None);
    }
}
