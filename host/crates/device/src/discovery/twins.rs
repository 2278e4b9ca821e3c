//! Boards with one USB serial number, which cheap adapters often have.

use std::path::{Path, PathBuf};

use crate::address::{UsbDescription, UsbId};
use crate::events::DeviceProblem;

/// Names the serial ports of different boards that have the same USB serial number. `ports`: each with what is behind it;
/// `device`: which USB device a port belongs to, since one board may have several ports.
pub(super) fn twins<'p>(
    ports: impl Iterator<Item = (&'p str, &'p UsbDescription)>,
    device: impl Fn(&str) -> PathBuf,
) -> Vec<DeviceProblem> {
    let mut groups: Vec<(UsbId, Vec<(&str, PathBuf)>)> = Vec::new();
    for (port, usb) in ports {
        let Some(id) = Some(UsbId::of(usb)).filter(|id| id.serial_number.is_some()) else { continue };
        let port = (port, device(port));
        match groups.iter_mut().find(|(known, _)| *known == id) {
            Some((_, ports)) if ports.iter().any(|(_, board)| *board == port.1) => {}
            Some((_, ports)) => ports.push(port),
            None => groups.push((id, vec![port])),
        }
    }
    let several = groups.into_iter().filter(|(_, ports)| ports.len() > 1);
    let problem = |(id, ports): (UsbId, Vec<(&str, PathBuf)>)| {
        let ports: Vec<&str> = ports.into_iter().map(|(port, _)| port).collect();
        DeviceProblem::OneSerialNumber { ports: ports.join(" and "), number: id.serial_number.unwrap_or_default() }
    };
    several.map(problem).collect()
}

/// The USB device that a serial port belongs to, by its folder; the port itself where the system has no such folders.
pub(super) fn usb_device(port: &str) -> PathBuf {
    let name = port.rsplit('/').next().unwrap_or(port);
    let interface = std::fs::canonicalize(Path::new("/sys/class/tty").join(name).join("device"));
    let device = interface
        .ok()
        .and_then(|folder| folder.ancestors().find(|folder| folder.join("idVendor").exists()).map(Path::to_path_buf));
    device.unwrap_or_else(|| PathBuf::from(port))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(serial_number: Option<&str>) -> UsbDescription {
        UsbDescription {
            vendor_id: 0x10C4,
            product_id: 0xEA60,
            manufacturer: None,
            product: None,
            serial_number: serial_number.map(str::to_owned),
        }
    }

    #[test]
    fn boards_with_one_serial_number_are_named_and_ports_of_one_board_are_not() {
        let ports = [
            ("/dev/ttyUSB0", adapter(Some("0001"))),
            ("/dev/ttyUSB1", adapter(Some("0001"))),
            ("/dev/ttyUSB2", adapter(Some("0002"))),
            ("/dev/ttyUSB3", adapter(None)),
            ("/dev/ttyUSB4", adapter(None)),
            ("/dev/ttyACM0", adapter(Some("7"))),
            ("/dev/ttyACM1", adapter(Some("7"))),
        ];
        let board = |port: &str| PathBuf::from(if port.starts_with("/dev/ttyACM") { "one board" } else { port });
        let problems = twins(ports.iter().map(|(port, usb)| (*port, usb)), board);
        let [problem @ DeviceProblem::OneSerialNumber { ports, .. }] = &problems[..] else { panic!("{problems:?}") };
        assert_eq!(ports, "/dev/ttyUSB0 and /dev/ttyUSB1");
        assert!(problem.to_string().contains("(0001)"), "{problem}");
    }
}
