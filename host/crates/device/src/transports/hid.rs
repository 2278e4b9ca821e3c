//! Puppets on HID: the stream in reports, as described in [`firmware_protocol::carriers`].

use std::collections::BTreeMap;
use std::ffi::CString;
use std::io;

use firmware_protocol::carriers::{HID_USAGE, HID_USAGE_PAGE, REPORT_LENGTH, read_report, write_report};
use hidapi::{DeviceInfo, HidApi, HidDevice, HidError};

use super::bridge::{BlockingRead, BlockingWrite, READ_PATIENCE};
use crate::address::{DeviceAddress, HidPlace, UsbDescription};
use crate::events::{DeviceProblem, printable};

/// Reports begin with their number, which is 0 if they have none.
const NO_NUMBER: u8 = 0;

/// A HID device.
pub(crate) struct Found {
    /// Its name in the operating system.
    pub(crate) path: String,
    /// What it reports about itself.
    pub(crate) usb: UsbDescription,
    /// Whether its reports are those of a puppet.
    pub(crate) is_puppet: bool,
}

/// All HID devices that are plugged in. None of them is opened.
pub(crate) fn list() -> Result<Vec<Found>, DeviceProblem> {
    Ok(list_by(&look()?))
}

fn look() -> Result<HidApi, DeviceProblem> {
    HidApi::new().map_err(|error| DeviceProblem::UsbUnavailable { reason: error.to_string() })
}

fn list_by(api: &HidApi) -> Vec<Found> {
    // A device is listed once for each of its usages.
    let mut found: BTreeMap<String, Found> = BTreeMap::new();
    for device in api.device_list() {
        let Ok(path) = device.path().to_str() else { continue };
        let entry = found.entry(path.to_owned()).or_insert_with(|| describe(path, device));
        entry.is_puppet |= (device.usage_page(), device.usage()) == (HID_USAGE_PAGE, HID_USAGE);
    }
    found.into_values().collect()
}

fn describe(path: &str, device: &DeviceInfo) -> Found {
    let told = |text: Option<&str>| text.filter(|text| !text.is_empty()).map(str::to_owned);
    let usb = UsbDescription {
        vendor_id: device.vendor_id(),
        product_id: device.product_id(),
        manufacturer: told(device.manufacturer_string()).as_deref().map(printable),
        product: told(device.product_string()).as_deref().map(printable),
        serial_number: told(device.serial_number()),
    };
    Found { path: path.to_owned(), usb, is_puppet: false }
}

/// Opens the one device with this name.
pub(crate) fn open(place: &HidPlace) -> Result<(Reader, Writer), DeviceProblem> {
    let port = DeviceAddress::Hid(place.clone()).to_string();
    let api = look()?;
    let mut named: Vec<Found> = list_by(&api).into_iter().filter(|found| is_at(place, found)).collect();
    // A composite device may have other HID interfaces, which are not meant.
    if named.len() > 1 {
        named.retain(|found| found.is_puppet);
    }
    let Some(found) = named.pop() else { return Err(DeviceProblem::PortMissing { port }) };
    if !named.is_empty() {
        named.push(found);
        return Err(DeviceProblem::several(port, named.iter().map(|found| (&found.usb, found.path.clone()))));
    }
    if !found.is_puppet {
        let reason = "its reports are not those of a puppet (usage page ff41, usage 01)".into();
        return Err(DeviceProblem::NotAPuppet { port, reason });
    }
    let lock = lock(&found.path, &port)?;
    let open = || -> Result<HidDevice, HidError> {
        let path = CString::new(found.path.as_str()).map_err(|error| HidError::IoError { error: error.into() })?;
        api.open_path(&path)
    };
    let failed = |error: HidError| DeviceProblem::NotAPuppet { port: port.clone(), reason: error.to_string() };
    // One handle for each thread: they must not be shared.
    let (reads, writes) = (open().map_err(failed)?, open().map_err(failed)?);
    Ok((Reader { device: reads, _lock: lock }, Writer { device: writes }))
}

/// A link to the device is as good as its path.
pub(crate) fn is_at(place: &HidPlace, found: &Found) -> bool {
    match place {
        HidPlace::Id(id) => id.names(&found.usb),
        HidPlace::Path(path) => {
            *path == found.path
                || std::fs::canonicalize(path).is_ok_and(|real| real == std::path::Path::new(&found.path))
        }
    }
}

/// Linux lets any number of programs open a HID device, each receiving all reports; a second host would spoil the first
/// one's conversation. The lock keeps other Armature hosts out.
#[cfg(target_os = "linux")]
fn lock(path: &str, port: &str) -> Result<Option<std::fs::File>, DeviceProblem> {
    let port = port.to_owned();
    let file = std::fs::OpenOptions::new().read(true).write(true).open(path).map_err(|error| match error.kind() {
        io::ErrorKind::PermissionDenied => {
            DeviceProblem::UsbPermissionDenied { port: port.clone(), node: path.to_owned() }
        }
        io::ErrorKind::NotFound => DeviceProblem::PortMissing { port: port.clone() },
        _ => DeviceProblem::NotAPuppet { port: port.clone(), reason: error.to_string() },
    })?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(std::fs::TryLockError::WouldBlock) => Err(DeviceProblem::PortBusy { port }),
        Err(std::fs::TryLockError::Error(error)) => Err(DeviceProblem::NotAPuppet { port, reason: error.to_string() }),
    }
}

#[cfg(not(target_os = "linux"))]
fn lock(_: &str, _: &str) -> Result<Option<std::fs::File>, DeviceProblem> {
    Ok(None)
}

/// What comes from the device.
pub(crate) struct Reader {
    device: HidDevice,
    _lock: Option<std::fs::File>,
}

/// What goes to the device.
pub(crate) struct Writer {
    device: HidDevice,
}

impl BlockingRead for Reader {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        // One byte more than a report has, so that a longer one shows.
        let mut report = [0; REPORT_LENGTH + 1];
        let length = self.device.read_timeout(&mut report, READ_PATIENCE.as_millis() as i32).map_err(failed)?;
        let Some(stream) = read_report(&report[..length]) else {
            if length > 0 {
                tracing::debug!(length, "an invalid report was dropped");
            }
            return Ok(0);
        };
        into[..stream.len()].copy_from_slice(stream);
        Ok(stream.len())
    }
}

impl BlockingWrite for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let (report, taken) = write_report(bytes);
        let mut numbered = [NO_NUMBER; 1 + REPORT_LENGTH];
        numbered[1..].copy_from_slice(&report);
        self.device.write(&numbered).map_err(failed)?;
        Ok(taken)
    }
}

fn failed(error: HidError) -> io::Error {
    match error {
        HidError::IoError { error } => error,
        other => io::Error::other(other.to_string()),
    }
}
