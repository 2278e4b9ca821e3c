//! Puppets on USB bulk: an interface of the puppet class with an endpoint each way, as described in
//! [`firmware_protocol::carriers`].

use std::io;
use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::carriers::{BULK_CLASS, BULK_PROTOCOL, BULK_SUBCLASS};
use rusb::{Context, Device, DeviceHandle, Direction, Error, InterfaceDescriptor, TransferType, UsbContext};

use super::bridge::{BlockingRead, BlockingWrite, READ_PATIENCE};
use crate::address::{DeviceAddress, UsbDescription, UsbId};
use crate::events::{DeviceProblem, printable};

/// How long one write waits for the device to take bytes.
const WRITE_PATIENCE: Duration = Duration::from_millis(200);
/// How long a device has to report its name, if the operating system has not read it already.
#[cfg(not(target_os = "linux"))]
const NAME_PATIENCE: Duration = Duration::from_millis(100);

/// A USB device.
pub(crate) struct Found {
    device: Device<Context>,
    /// What it reports about itself.
    pub(crate) usb: UsbDescription,
    /// Its interface for a puppet's stream.
    place: Option<Place>,
}

/// An interface with an endpoint each way.
#[derive(Clone, Copy, Debug)]
struct Place {
    interface: u8,
    setting: u8,
    input: u8,
    output: u8,
}

impl Found {
    pub(crate) fn is_puppet(&self) -> bool {
        self.place.is_some()
    }

    /// Where it is plugged in.
    pub(crate) fn port(&self) -> String {
        format!("bus {} device {}", self.device.bus_number(), self.device.address())
    }

    /// Its device file on Linux.
    pub(crate) fn node(&self) -> String {
        format!("/dev/bus/usb/{:03}/{:03}", self.device.bus_number(), self.device.address())
    }
}

/// All USB devices that are plugged in. None is opened if the system provides their names.
pub(crate) fn list() -> Result<Vec<Found>, DeviceProblem> {
    // A machine without any USB.
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/bus/usb").exists() {
        return Ok(Vec::new());
    }
    let unavailable = |error: Error| DeviceProblem::UsbUnavailable { reason: error.to_string() };
    let devices = Context::new().and_then(|context| context.devices()).map_err(unavailable)?;
    // A device that is being pulled out right now cannot be described, and is not there either.
    Ok(devices.iter().filter_map(|device| describe(device).ok()).collect())
}

fn describe(device: Device<Context>) -> rusb::Result<Found> {
    let descriptor = device.device_descriptor()?;
    let [manufacturer, product, serial_number] = names(&device, &descriptor);
    let usb = UsbDescription {
        vendor_id: descriptor.vendor_id(),
        product_id: descriptor.product_id(),
        manufacturer: manufacturer.as_deref().map(printable),
        product: product.as_deref().map(printable),
        serial_number,
    };
    // A device that is not configured has no interfaces.
    let place = device.active_config_descriptor().ok().and_then(|configuration| {
        configuration.interfaces().flat_map(|interface| interface.descriptors()).find_map(|d| place_in(&d))
    });
    Ok(Found { device, usb, place })
}

fn place_in(interface: &InterfaceDescriptor<'_>) -> Option<Place> {
    let class = (interface.class_code(), interface.sub_class_code(), interface.protocol_code());
    if class != (BULK_CLASS, BULK_SUBCLASS, BULK_PROTOCOL) {
        return None;
    }
    let endpoint = |direction| {
        let mut endpoints = interface.endpoint_descriptors();
        endpoints
            .find(|e| e.transfer_type() == TransferType::Bulk && e.direction() == direction)
            .map(|found| found.address())
    };
    Some(Place {
        interface: interface.interface_number(),
        setting: interface.setting_number(),
        input: endpoint(Direction::In)?,
        output: endpoint(Direction::Out)?,
    })
}

/// Manufacturer, product and serial number. Linux read them when the device was plugged in; reading them again would
/// require permission to open it.
#[cfg(target_os = "linux")]
fn names(device: &Device<Context>, _: &rusb::DeviceDescriptor) -> [Option<String>; 3] {
    let Ok(ports) = device.port_numbers() else { return [const { None }; 3] };
    let ports: Vec<String> = ports.iter().map(u8::to_string).collect();
    let folder = if ports.is_empty() {
        format!("/sys/bus/usb/devices/usb{}", device.bus_number())
    } else {
        format!("/sys/bus/usb/devices/{}-{}", device.bus_number(), ports.join("."))
    };
    ["manufacturer", "product", "serial"]
        .map(|name| Some(std::fs::read_to_string(format!("{folder}/{name}")).ok()?.trim_end_matches('\n').to_owned()))
}

#[cfg(not(target_os = "linux"))]
fn names(device: &Device<Context>, descriptor: &rusb::DeviceDescriptor) -> [Option<String>; 3] {
    let Ok(handle) = device.open() else { return [const { None }; 3] };
    let language = handle.read_languages(NAME_PATIENCE).ok().and_then(|languages| languages.first().copied());
    let Some(language) = language else { return [const { None }; 3] };
    [
        handle.read_manufacturer_string(language, descriptor, NAME_PATIENCE).ok(),
        handle.read_product_string(language, descriptor, NAME_PATIENCE).ok(),
        handle.read_serial_number_string(language, descriptor, NAME_PATIENCE).ok(),
    ]
}

/// Opens the one device with this name, and never takes an interface away from a driver.
pub(crate) fn open(id: &UsbId) -> Result<(Reader, Writer), DeviceProblem> {
    let port = DeviceAddress::Usb(id.clone()).to_string();
    let mut named: Vec<Found> = list()?.into_iter().filter(|found| id.names(&found.usb)).collect();
    let Some(found) = named.pop() else { return Err(DeviceProblem::PortMissing { port }) };
    if !named.is_empty() {
        named.push(found);
        return Err(DeviceProblem::several(port, named.iter().map(|found| (&found.usb, found.port()))));
    }
    let Some(place) = found.place else {
        let reason = "it has no interface of class ff, subclass 41, protocol 01 with a bulk endpoint each way".into();
        return Err(DeviceProblem::NotAPuppet { port, reason });
    };
    let handle = claim(&found.device, place).map_err(|error| match error {
        Error::Access => DeviceProblem::UsbPermissionDenied { port: port.clone(), node: found.node() },
        Error::Busy => DeviceProblem::PortBusy { port: port.clone() },
        Error::NoDevice | Error::NotFound => DeviceProblem::PortMissing { port: port.clone() },
        error => DeviceProblem::NotAPuppet { port: port.clone(), reason: error.to_string() },
    })?;
    let handle = Arc::new(handle);
    Ok((Reader { handle: handle.clone(), endpoint: place.input }, Writer { handle, endpoint: place.output }))
}

/// An interface that a driver of the operating system holds is busy.
fn claim(device: &Device<Context>, place: Place) -> rusb::Result<DeviceHandle<Context>> {
    let handle = device.open()?;
    handle.claim_interface(place.interface)?;
    if place.setting != 0 {
        handle.set_alternate_setting(place.interface, place.setting)?;
    }
    Ok(handle)
}

/// What comes from the device.
#[derive(Debug)]
pub(crate) struct Reader {
    handle: Arc<DeviceHandle<Context>>,
    endpoint: u8,
}

/// What goes to the device.
#[derive(Debug)]
pub(crate) struct Writer {
    handle: Arc<DeviceHandle<Context>>,
    endpoint: u8,
}

impl BlockingRead for Reader {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.handle.read_bulk(self.endpoint, into, READ_PATIENCE);
        settle(&self.handle, self.endpoint, read)
    }
}

impl BlockingWrite for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.handle.write_bulk(self.endpoint, bytes, WRITE_PATIENCE);
        settle(&self.handle, self.endpoint, written)
    }
}

/// A transfer that timed out has moved nothing; a halted endpoint is cleared.
fn settle(handle: &DeviceHandle<Context>, endpoint: u8, moved: rusb::Result<usize>) -> io::Result<usize> {
    match moved {
        Ok(length) => Ok(length),
        Err(Error::Timeout | Error::Interrupted) => Ok(0),
        Err(Error::Pipe) => handle.clear_halt(endpoint).map(|()| 0).map_err(failed),
        Err(error) => Err(failed(error)),
    }
}

fn failed(error: Error) -> io::Error {
    let kind = match error {
        Error::NoDevice => io::ErrorKind::NotConnected,
        Error::Access => io::ErrorKind::PermissionDenied,
        _ => io::ErrorKind::Other,
    };
    io::Error::new(kind, format!("USB: {error}"))
}
