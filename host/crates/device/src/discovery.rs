//! What is plugged in: serial ports, and puppets on USB bulk and HID. Nothing is opened to find out.

use serialport::SerialPortType;

use crate::servo::ServoProtocol;
use crate::{DEFAULT_BAUD, DeviceAddress, DeviceProblem, HidPlace, UsbId, hid, usb_bulk};

/// Something that is plugged in and may be a device of ours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceDescription {
    /// What to give as the device's address.
    pub address: DeviceAddress,
    /// Where it is: path or name of the port, or bus and number.
    pub port: String,
    /// What a device on USB says about itself.
    pub usb: Option<UsbDescription>,
}

impl DeviceDescription {
    /// What this may be: a puppet by its interface, or what the USB chip of a serial port is commonly built into; `None`
    /// where nothing is known. It is a guess.
    pub fn guess(&self) -> Option<DeviceGuess> {
        if let DeviceAddress::Usb(_) | DeviceAddress::Hid(_) = self.address {
            return Some(DeviceGuess::Puppet);
        }
        let usb = self.usb.as_ref()?;
        let guess = match (usb.vendor_id, usb.product_id) {
            (0x1A86, 0x55D3 | 0x7523 | 0x7522) => DeviceGuess::Servos(ServoProtocol::Feetech),
            (0x0403, 0x6014) | (0x2F5D, _) => DeviceGuess::Servos(ServoProtocol::Dynamixel),
            _ => DeviceGuess::Puppet,
        };
        Some(guess)
    }

    /// The address at which to try what the guess says.
    pub fn guessed_address(&self) -> DeviceAddress {
        match self.guess() {
            Some(DeviceGuess::Servos(protocol)) => {
                DeviceAddress::Servos { protocol, path: self.port.clone(), baud: None, arm: None }
            }
            Some(DeviceGuess::Puppet) | None => self.address.clone(),
        }
    }
}

/// What may be behind a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceGuess {
    /// A puppet that speaks our protocol.
    Puppet,
    /// An arm of servos on this bus.
    Servos(ServoProtocol),
}

/// What a USB device says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbDescription {
    /// Vendor number.
    pub vendor_id: u16,
    /// The vendor's product number.
    pub product_id: u16,
    /// Maker.
    pub manufacturer: Option<String>,
    /// Product name.
    pub product: Option<String>,
    /// Serial number.
    pub serial_number: Option<String>,
}

/// What a look at the machine's ports found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plugged {
    /// Serial ports, those on USB first, then by path; then puppets on USB bulk, then on HID. Pseudo terminals are not
    /// among them.
    pub devices: Vec<DeviceDescription>,
    /// What could not be looked at, and why.
    pub problems: Vec<DeviceProblem>,
}

/// Looks at what is plugged in now.
pub fn list_devices() -> Plugged {
    let mut plugged = Plugged::default();
    for found in [list_serial_ports(), list_usb_puppets(), list_hid_puppets()] {
        match found {
            Ok(devices) => plugged.devices.extend(devices),
            Err(problem) => plugged.problems.push(problem),
        }
    }
    plugged
}

/// The serial ports of this machine, those on USB first, then by path. Pseudo terminals are not among them.
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
                    manufacturer: usb.manufacturer,
                    product: usb.product,
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

/// What the device at this address says about itself now, if it is on USB and there.
pub(crate) fn usb_behind(address: &DeviceAddress) -> Option<UsbDescription> {
    match address {
        DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } => {
            // A link in /dev/serial/by-id is the port that it leads to.
            let real = std::fs::canonicalize(path);
            let real = real.map_or_else(|_| path.clone(), |real| real.to_string_lossy().into_owned());
            list_serial_ports().ok()?.into_iter().find(|port| port.port == *path || port.port == real)?.usb
        }
        DeviceAddress::Usb(id) => Some(usb_bulk::list().ok()?.into_iter().find(|found| id.names(&found.usb))?.usb),
        DeviceAddress::Hid(place) => Some(hid::list().ok()?.into_iter().find(|found| hid::is_at(place, found))?.usb),
        DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => None,
    }
}

/// The serial port at which this very device is now; it may come back under another name. Only a serial number tells it
/// from another one of its kind.
pub(crate) fn port_of(usb: &UsbDescription) -> Option<String> {
    let id = UsbId::of(usb);
    id.serial_number.as_ref()?;
    let is_it = |port: &DeviceDescription| port.usb.as_ref().is_some_and(|usb| id.names(usb));
    list_serial_ports().ok()?.into_iter().find(is_it).map(|port| port.port)
}
