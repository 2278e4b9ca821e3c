//! Which serial ports there are.

use serialport::SerialPortType;

use crate::servo::ServoProtocol;
use crate::{DEFAULT_BAUD, DeviceAddress, DeviceProblem};

/// A serial port that may have a device behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SerialPortDescription {
    /// What to give as the device's address.
    pub address: DeviceAddress,
    /// Path or name of the port.
    pub path: String,
    /// What a port on USB says about itself.
    pub usb: Option<UsbDescription>,
}

impl SerialPortDescription {
    /// What may be behind this port, from what its USB chip is commonly built into; `None` where nothing is known. It
    /// is a guess: nothing is opened to find out.
    pub fn guess(&self) -> Option<DeviceGuess> {
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
                DeviceAddress::Servos { protocol, path: self.path.clone(), baud: None, arm: None }
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

/// The serial ports of this machine, those on USB first, then by path. Pseudo terminals are not among them.
pub fn list_serial_ports() -> Result<Vec<SerialPortDescription>, DeviceProblem> {
    let ports =
        serialport::available_ports().map_err(|error| DeviceProblem::PortsUnknown { reason: error.to_string() })?;
    let mut ports: Vec<SerialPortDescription> = ports
        .into_iter()
        .map(|port| SerialPortDescription {
            address: DeviceAddress::Serial { path: port.port_name.clone(), baud: DEFAULT_BAUD },
            path: port.port_name,
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
    ports.sort_by(|a, b| (a.usb.is_none(), &a.path).cmp(&(b.usb.is_none(), &b.path)));
    Ok(ports)
}

/// What the USB device behind this port says about itself.
pub(crate) fn usb_behind(path: &str) -> Option<UsbDescription> {
    // A link in /dev/serial/by-id is the port that it leads to.
    let real = std::fs::canonicalize(path).map_or_else(|_| path.to_owned(), |real| real.to_string_lossy().into_owned());
    list_serial_ports().ok()?.into_iter().find(|port| port.path == path || port.path == real)?.usb
}

/// The port at which this very device is now; it may come back under another name. Only a serial number tells it from
/// another one of its kind.
pub(crate) fn port_of(usb: &UsbDescription) -> Option<String> {
    usb.serial_number.as_ref().filter(|number| !number.is_empty())?;
    let same = |other: &UsbDescription| {
        (usb.vendor_id, usb.product_id, &usb.serial_number) == (other.vendor_id, other.product_id, &other.serial_number)
    };
    list_serial_ports().ok()?.into_iter().find(|port| port.usb.as_ref().is_some_and(same)).map(|port| port.path)
}
