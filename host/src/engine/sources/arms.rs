//! Servo arms that cannot be told apart.

use armature_device::servo::{NO_SEAT, ServoArm, ServoJoint};
use armature_device::{DeviceAddress, DeviceDescription, DeviceGuess};
use armature_rig::{Calibration, PartUid};

use crate::engine::event::Problem;

/// What to say of an arm whose calibration is also another arm's: servos have no numbers of their own, so arms are told
/// apart by their adapters' serial numbers, and many adapters have none. `kept`: the calibration that is kept for
/// everything that is plugged in; `plugged`: what that is now, asked only where it matters.
pub(super) fn shared_calibration(
    address: &DeviceAddress,
    kept: Option<&Calibration>,
    plugged: &dyn Fn() -> Vec<DeviceDescription>,
) -> Option<Problem> {
    let DeviceAddress::Servos { protocol, path, arm, .. } = address else { return None };
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
    if !names.is_empty() {
        return Some(Problem {
            what: format!(
                "the adapters at {real} and {} have no serial numbers, so arms of the same kind there share one \
                 calibration",
                names.join(", ")
            ),
            remedy: "give each arm its own file with --calibration".into(),
        });
    }
    let arm = ServoArm::preset(*protocol, arm.as_deref()).ok()?;
    let is_kept =
        |joint: &ServoJoint| kept.is_some_and(|kept| kept.part(PartUid(arm.part_uid(NO_SEAT, joint.id).0)).is_some());
    arm.joints.iter().any(is_kept).then(|| Problem {
        what: format!(
            "the adapter at {real} has no serial number: this arm has the calibration of the last one of its kind \
             without a number"
        ),
        remedy: "if that was another arm, give each its own file with --calibration".into(),
    })
}

#[cfg(test)]
mod tests {
    use armature_device::UsbDescription;
    use armature_device::servo::ServoProtocol;

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
        let of = |plugged: &[DeviceDescription]| shared_calibration(&address, None, &|| plugged.to_vec());
        let own = adapter("/dev/arm0", None);
        let told = of(&[own.clone(), adapter("/dev/arm1", None), adapter("/dev/arm2", Some(""))]).unwrap();
        assert!(told.what.contains("/dev/arm0 and /dev/arm1, /dev/arm2") && told.remedy.contains("--calibration"));
        assert_eq!(of(std::slice::from_ref(&own)), None, "there is no other arm");
        assert_eq!(of(&[own.clone(), adapter("/dev/arm1", Some("A7"))]), None, "the other arm has a number");
        assert_eq!(of(&[adapter("/dev/arm0", Some("A7")), adapter("/dev/arm1", None)]), None, "this one has one");
        let puppet = DeviceDescription { usb: None, ..adapter("/dev/ttyS0", None) };
        assert_eq!(of(&[own, puppet]), None, "that is no arm");
        let puppet: DeviceAddress = "serial:/dev/arm0".parse().unwrap();
        assert_eq!(shared_calibration(&puppet, None, &|| panic!("puppets have numbers of their own")), None);
    }

    #[test]
    fn an_arm_without_a_serial_number_does_not_take_another_ones_calibration_silently() {
        let address: DeviceAddress = "feetech:/dev/arm0".parse().unwrap();
        let arm = ServoArm::preset(ServoProtocol::Feetech, None).unwrap();
        let own = [adapter("/dev/arm0", None)];
        let of = |kept: &Calibration| shared_calibration(&address, Some(kept), &|| own.to_vec());
        assert_eq!(of(&Calibration::default()), None, "nothing is kept");
        let mut kept = Calibration::default();
        kept.set_part(PartUid(arm.part_uid(7, arm.joints[0].id).0), Vec::new());
        assert_eq!(of(&kept), None, "that arm has a number");
        kept.set_part(PartUid(arm.part_uid(NO_SEAT, arm.joints[0].id).0), Vec::new());
        let told = of(&kept).unwrap();
        assert!(told.what.contains("/dev/arm0") && told.remedy.contains("--calibration"), "{told:?}");
    }
}
