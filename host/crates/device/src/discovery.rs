//! Which serial ports there are.

use serialport::SerialPortType;

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
