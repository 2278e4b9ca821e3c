//! What is plugged in: serial ports, and puppets on USB bulk and HID. Nothing is opened to find out.

use serialport::SerialPortType;

use super::board::{Board, board};
use super::twins::{twins, usb_device};
use crate::address::{DEFAULT_BAUD, DeviceAddress, HidPlace, UsbDescription, UsbId};
use crate::arm::ServoProtocol;
use crate::events::{DeviceProblem, printable};
use crate::transports::{hid, usb_bulk};

/// Something that is plugged in and may be one of our devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceDescription {
    /// Its device address.
    pub address: DeviceAddress,
    /// Where it is: path or name of the port, or bus and number.
    pub port: String,
    /// What a USB device reports about itself.
    pub usb: Option<UsbDescription>,
}

impl DeviceDescription {
    /// What this may be: a puppet, going by its interface, or what a serial port's USB chip is commonly built into;
    /// `None` if nothing is known. It is a guess.
    pub fn guess(&self) -> Option<DeviceGuess> {
        if let DeviceAddress::Usb(_) | DeviceAddress::Hid(_) = self.address {
            return Some(DeviceGuess::Puppet);
        }
        self.usb.as_ref()?;
        Some(match self.board() {
            Some(Board { servos: Some(protocol), in_puppets: false, .. }) => DeviceGuess::Servos(protocol),
            Some(Board { servos: Some(protocol), .. }) => DeviceGuess::PuppetOrServos(protocol),
            _ => DeviceGuess::Puppet,
        })
    }

    /// Which board a serial port is on, or which chip, if its numbers are known.
    pub fn board(&self) -> Option<Board> {
        let usb = self.usb.as_ref().filter(|_| self.address.serial_path().is_some())?;
        board(usb.vendor_id, usb.product_id)
    }

    /// The address to try for what the guess says: a puppet's at the speed of the reference firmware on that board.
    pub fn guessed_address(&self) -> DeviceAddress {
        match (self.guess(), &self.address) {
            (Some(DeviceGuess::Servos(protocol)), _) => self.servo_address(protocol),
            (_, DeviceAddress::Serial { path, .. }) => {
                let baud = self.board().and_then(|board| board.baud).unwrap_or(DEFAULT_BAUD);
                DeviceAddress::Serial { path: path.clone(), baud }
            }
            (_, address) => address.clone(),
        }
    }

    /// The address of servos at this port.
    pub fn servo_address(&self, protocol: ServoProtocol) -> DeviceAddress {
        DeviceAddress::Servos { protocol, path: self.port.clone(), baud: None, arm: None }
    }
}

/// What may be on a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceGuess {
    /// A puppet that speaks our protocol.
    Puppet,
    /// An arm of servos on this bus.
    Servos(ServoProtocol),
    /// Either: this USB chip is in boards of both.
    PuppetOrServos(ServoProtocol),
}

/// The ports found on this machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plugged {
    /// Serial ports, USB ones first, then by path; then puppets on USB bulk, then on HID. Pseudo-terminals are not
    /// included.
    pub devices: Vec<DeviceDescription>,
    /// What could not be listed, and why.
    pub problems: Vec<DeviceProblem>,
}

/// Lists what is plugged in now.
pub fn list_devices() -> Plugged {
    let mut plugged = Plugged::default();
    for found in [list_serial_ports(), list_usb_puppets(), list_hid_puppets()] {
        match found {
            Ok(devices) => plugged.devices.extend(devices),
            Err(problem) => plugged.problems.push(problem),
        }
    }
    let ports = plugged.devices.iter().filter(|found| found.address.serial_path().is_some());
    let ports = ports.filter_map(|found| Some((found.port.as_str(), found.usb.as_ref()?)));
    plugged.problems.extend(twins(ports, usb_device));
    plugged
}

/// The serial ports of this machine, USB ones first, then by path. Pseudo-terminals are not included.
pub fn list_serial_ports() -> Result<Vec<DeviceDescription>, DeviceProblem> {
    let ports =
        serialport::available_ports().map_err(|error| DeviceProblem::PortsUnknown { reason: error.to_string() })?;
    let mut ports: Vec<DeviceDescription> = ports
        .into_iter()
        .map(|port| DeviceDescription {
            address: DeviceAddress::Serial { path: port.port_name.clone(), baud: DEFAULT_BAUD },
            port: port.port_name,
            usb: match port.port_type {
                SerialPortType::UsbPort(usb) => Some(UsbDescription {
                    vendor_id: usb.vid,
                    product_id: usb.pid,
                    manufacturer: usb.manufacturer.as_deref().map(printable),
                    product: usb.product.as_deref().map(printable),
                    serial_number: usb.serial_number,
                }),
                SerialPortType::PciPort | SerialPortType::BluetoothPort | SerialPortType::Unknown => None,
            },
        })
        .collect();
    ports.sort_by(|a, b| (a.usb.is_none(), &a.port).cmp(&(b.usb.is_none(), &b.port)));
    Ok(ports)
}

fn list_usb_puppets() -> Result<Vec<DeviceDescription>, DeviceProblem> {
    let puppets = usb_bulk::list()?.into_iter().filter(usb_bulk::Found::is_puppet);
    let mut puppets: Vec<DeviceDescription> = puppets
        .map(|found| DeviceDescription {
            address: DeviceAddress::Usb(UsbId::of(&found.usb)),
            port: found.port(),
            usb: Some(found.usb),
        })
        .collect();
    puppets.sort_by(|a, b| a.port.cmp(&b.port));
    Ok(puppets)
}

fn list_hid_puppets() -> Result<Vec<DeviceDescription>, DeviceProblem> {
    let puppets = hid::list()?.into_iter().filter(|found| found.is_puppet);
    let describe = |found: hid::Found| DeviceDescription {
        address: DeviceAddress::Hid(HidPlace::Id(UsbId::of(&found.usb))),
        port: found.path,
        usb: Some(found.usb),
    };
    Ok(puppets.map(describe).collect())
}

/// What the puppet on USB bulk or HID at this address reports about itself now, if it is plugged in.
pub(crate) fn usb_behind(address: &DeviceAddress) -> Option<UsbDescription> {
    match address {
        DeviceAddress::Usb(id) => Some(usb_bulk::list().ok()?.into_iter().find(|found| id.names(&found.usb))?.usb),
        DeviceAddress::Hid(place) => Some(hid::list().ok()?.into_iter().find(|found| hid::is_at(place, found))?.usb),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(vendor_id: u16, product_id: u16) -> DeviceDescription {
        let usb = UsbDescription { vendor_id, product_id, manufacturer: None, product: None, serial_number: None };
        let address = DeviceAddress::Serial { path: "/dev/port".into(), baud: DEFAULT_BAUD };
        DeviceDescription { address, port: "/dev/port".into(), usb: Some(usb) }
    }

    #[test]
    fn boards_are_named_with_the_address_to_try() {
        let cases = [
            ((0x2341, 0x0043), Some("Arduino Uno"), "serial:/dev/port@1000000"),
            ((0x1A86, 0x7523), Some("CH340: Arduino Nano or Uno, servo adapter"), "serial:/dev/port@1000000"),
            ((0x0403, 0x6001), Some("FT232R: Arduino Nano, serial adapter"), "serial:/dev/port@1000000"),
            ((0x2E8A, 0x000A), Some("Raspberry Pi Pico"), "serial:/dev/port"),
            ((0x2E8A, 0xFFFF), Some("Raspberry Pi board"), "serial:/dev/port"),
            ((0x1A86, 0x55D3), Some("CH343: servo adapter"), "feetech:/dev/port"),
            ((0x2F5D, 0x0103), Some("OpenRB or OpenCM"), "dynamixel:/dev/port"),
            ((0xFEED, 0xBEEF), None, "serial:/dev/port"),
        ];
        for ((vendor_id, product_id), name, address) in cases {
            let found = port(vendor_id, product_id);
            assert_eq!(found.board().map(|board| board.name), name);
            assert_eq!(found.guessed_address().to_string(), address);
        }
        assert_eq!(port(0x1A86, 0x7523).guess(), Some(DeviceGuess::PuppetOrServos(ServoProtocol::Feetech)));
        let builtin = DeviceDescription { usb: None, ..port(0, 0) };
        assert_eq!((builtin.guess(), builtin.board()), (None, None));
    }
}
