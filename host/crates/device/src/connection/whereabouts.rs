//! Finding a device again after its line was lost: at the port where it was, or at another one.

use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::address::{DeviceAddress, HidPlace, UsbDescription, UsbId};
use crate::discovery::{DeviceDescription, list_serial_ports, usb_behind};
use crate::events::DeviceProblem;
use crate::transports::{hid, usb_bulk};

/// Time between two checks for a missing serial port. A check costs less than 0.1 ms.
pub(super) const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Time between two checks for a USB device, which cost about a millisecond.
pub(super) const LOOK_AT_USB_EVERY: Duration = Duration::from_millis(50);
/// Time between two attempts at a network address, which may take long to fail.
pub(super) const CALL_EVERY: Duration = Duration::from_millis(250);

/// The numbers of FTDI's adapters, which hold bytes back by default.
const FTDI: u16 = 0x0403;

/// Lists the serial ports.
#[derive(Clone)]
pub(super) struct Ports(Arc<dyn Fn() -> Vec<DeviceDescription> + Send + Sync>);

impl Ports {
    /// Those of this machine.
    pub(super) fn of_this_machine() -> Self {
        Self::listed_by(|| list_serial_ports().unwrap_or_default())
    }

    pub(super) fn listed_by(list: impl Fn() -> Vec<DeviceDescription> + Send + Sync + 'static) -> Self {
        Self(Arc::new(list))
    }
}

impl fmt::Debug for Ports {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Ports")
    }
}

/// Distinguishes what is plugged in somewhere from the next device there.
pub(super) type Stamp = (u64, std::time::SystemTime);

/// Where a device was, and how to recognise it.
#[derive(Clone, Debug)]
pub(super) struct Whereabouts {
    address: DeviceAddress,
    usb: Option<UsbDescription>,
    ports: Ports,
}

impl Whereabouts {
    /// Notes where the device is now.
    pub(super) fn note(address: &DeviceAddress, ports: Ports) -> Self {
        let usb = match address {
            DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } => {
                let real = real_path(path);
                (ports.0)().into_iter().find(|port| port.port == *path || port.port == real).and_then(|port| port.usb)
            }
            other => usb_behind(other),
        };
        Self { address: address.clone(), usb, ports }
    }

    /// What distinguishes this device's adapter from others of its kind.
    pub(super) fn usb_serial_number(&self) -> Option<&str> {
        self.usb.as_ref().and_then(|usb| usb.serial_number.as_deref())
    }

    /// The port of an adapter that may hold bytes back.
    pub(super) fn slow_adapter(&self) -> Option<&str> {
        let is_ftdi = self.usb.as_ref().is_some_and(|usb| usb.vendor_id == FTDI);
        self.address.serial_path().filter(|_| is_ftdi)
    }

    /// How long to wait between two attempts.
    pub(super) fn pause(&self) -> Duration {
        match self.address {
            DeviceAddress::Serial { .. } | DeviceAddress::Servos { .. } => LOOK_EVERY,
            DeviceAddress::Usb(_) | DeviceAddress::Hid(_) => LOOK_AT_USB_EVERY,
            DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => CALL_EVERY,
        }
    }

    /// The port, if this is another one than that where the device was first.
    pub(super) fn moved_to(&self, place: &DeviceAddress) -> Option<String> {
        place.serial_path().filter(|_| *place != self.address).map(str::to_owned)
    }

    /// Where the device may be now, the likeliest place first; none if it is clearly not there. Another device may have
    /// taken its port meanwhile, and several may have one USB serial number, or none: only its own number tells, so
    /// whoever connects has to ask.
    pub(super) fn places(&self) -> Vec<DeviceAddress> {
        match (&self.address, &self.usb) {
            (DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. }, None) => {
                if Path::new(path).exists() { vec![self.address.clone()] } else { Vec::new() }
            }
            (DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. }, Some(usb)) => {
                let id = UsbId::of(usb);
                let is_alike = |port: &DeviceDescription| port.usb.as_ref().is_some_and(|usb| UsbId::of(usb) == id);
                let alike = (self.ports.0)().into_iter().filter(is_alike).map(|port| port.port);
                // A link that led to the port is as good as its name.
                let real = real_path(path);
                let (same, mut others): (Vec<_>, Vec<_>) = alike.partition(|port| *port == real || port == path);
                // An arm of servos has no number of its own.
                let is_certain = id.serial_number.is_some() && others.len() == 1 && same.is_empty();
                if matches!(self.address, DeviceAddress::Servos { .. }) && !is_certain {
                    others.clear();
                }
                let same = same.first().map(|_| self.address.clone());
                same.into_iter().chain(others.into_iter().map(|port| at_path(&self.address, port))).collect()
            }
            (DeviceAddress::Usb(id), usb) => {
                let known = usb.as_ref().map(UsbId::of).filter(|id| id.serial_number.is_some());
                vec![DeviceAddress::Usb(known.unwrap_or_else(|| id.clone()))]
            }
            (DeviceAddress::Hid(place), usb) => {
                let known = usb.as_ref().map(UsbId::of).filter(|id| id.serial_number.is_some());
                vec![DeviceAddress::Hid(known.map_or_else(|| place.clone(), HidPlace::Id))]
            }
            (DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. }, _) => vec![self.address.clone()],
        }
    }
}

/// Why a device with nothing but its adapter's serial number to know it by cannot be looked for: others have that number.
pub(super) fn ambiguity(whereabouts: &Whereabouts) -> Option<DeviceProblem> {
    let (DeviceAddress::Servos { .. }, Some(usb)) = (&whereabouts.address, &whereabouts.usb) else { return None };
    let id = UsbId::of(usb);
    let ports = (whereabouts.ports.0)();
    let alike =
        ports.iter().filter_map(|port| port.usb.as_ref().filter(|usb| UsbId::of(usb) == id).map(|usb| (usb, port)));
    let alike: Vec<_> = alike.map(|(usb, port)| (usb, port.port.clone())).collect();
    let port = whereabouts.address.to_string();
    (alike.len() > 1).then(|| DeviceProblem::several(port, alike.into_iter()))
}

/// Whether a place cannot be opened because nothing is there.
pub(super) fn is_vacant(problem: &DeviceProblem) -> bool {
    matches!(problem, DeviceProblem::PortMissing { .. } | DeviceProblem::Unreachable { .. })
}

/// Distinguishes what is plugged in there now from the next device; `None` if that is impossible, or nothing is plugged
/// in.
pub(super) fn stamp(place: &DeviceAddress) -> Option<Stamp> {
    let met = std::fs::metadata(node(place)?).ok()?;
    #[cfg(unix)]
    let (number, since) = {
        use std::os::unix::fs::MetadataExt;
        // When the node was created or given its owner; unlike the modification time, use does not change it.
        let since = Duration::new(met.ctime().max(0) as u64, met.ctime_nsec().clamp(0, 999_999_999) as u32);
        (met.rdev(), std::time::UNIX_EPOCH + since)
    };
    #[cfg(not(unix))]
    let (number, since) = (0, met.created().ok()?);
    Some((number, since))
}

/// The device file of what is plugged in there now.
fn node(place: &DeviceAddress) -> Option<String> {
    match place {
        DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } => Some(path.clone()),
        DeviceAddress::Usb(id) => {
            usb_bulk::list().ok()?.into_iter().find(|found| id.names(&found.usb)).map(|found| found.node())
        }
        DeviceAddress::Hid(place) => {
            hid::list().ok()?.into_iter().find(|found| hid::is_at(place, found)).map(|found| found.path)
        }
        DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => None,
    }
}

fn real_path(path: &str) -> String {
    std::fs::canonicalize(path).map_or_else(|_| path.to_owned(), |real| real.to_string_lossy().into_owned())
}

fn at_path(address: &DeviceAddress, now_at: String) -> DeviceAddress {
    let mut moved = address.clone();
    if let DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } = &mut moved {
        *path = now_at;
    }
    moved
}
