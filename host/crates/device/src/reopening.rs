//! Finding a line again after it was lost: the same device at the same port, or at the one where it is now.

use std::path::Path;
use std::time::Duration;

use crate::discovery::{port_of, usb_behind};
use crate::{DeviceAddress, DeviceProblem, HidPlace, Transport, UsbDescription, UsbId, hid, open, usb_bulk};

/// Time between two looks for a serial port that is gone. A look costs less than 0.1 ms.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Time between two looks for a device on USB, which cost about a millisecond.
pub(crate) const LOOK_AT_USB_EVERY: Duration = Duration::from_millis(50);
/// Time between two attempts at a network address, which may take long to fail.
pub(crate) const CALL_EVERY: Duration = Duration::from_millis(250);

/// Where a device was, and how to know it again.
#[derive(Clone, Debug)]
pub(crate) struct Whereabouts {
    address: DeviceAddress,
    usb: Option<UsbDescription>,
}

impl Whereabouts {
    /// Notes where the device is now.
    pub(crate) fn note(address: &DeviceAddress) -> Self {
        Self { address: address.clone(), usb: usb_behind(address) }
    }

    /// What tells this device's adapter from others of its kind.
    pub(crate) fn usb_serial_number(&self) -> Option<&str> {
        self.usb.as_ref().and_then(|usb| usb.serial_number.as_deref())
    }

    /// How long to wait between two attempts.
    pub(crate) fn pause(&self) -> Duration {
        match self.address {
            DeviceAddress::Serial { .. } | DeviceAddress::Servos { .. } => LOOK_EVERY,
            DeviceAddress::Usb(_) | DeviceAddress::Hid(_) => LOOK_AT_USB_EVERY,
            DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => CALL_EVERY,
        }
    }

    /// What tells the thing that is plugged in there now from the next one; `None` if that cannot be told, or nothing is.
    pub(crate) fn stamp(&self) -> Option<(u64, std::time::SystemTime)> {
        let met = std::fs::metadata(self.node()?).ok()?;
        #[cfg(unix)]
        let (number, since) = {
            use std::os::unix::fs::MetadataExt;
            // When the node was made or given its owner; unlike the time of writing, use leaves it alone.
            let since = Duration::new(met.ctime().max(0) as u64, met.ctime_nsec().clamp(0, 999_999_999) as u32);
            (met.rdev(), std::time::UNIX_EPOCH + since)
        };
        #[cfg(not(unix))]
        let (number, since) = (0, met.created().ok()?);
        Some((number, since))
    }

    /// The file that stands for what is plugged in there now.
    fn node(&self) -> Option<String> {
        match &self.address {
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

    /// Opens the line again; `None` while the device is not there.
    pub(crate) async fn try_again(&self) -> Option<Result<Box<dyn Transport>, DeviceProblem>> {
        match open(&self.address_now()?).await {
            Err(DeviceProblem::PortMissing { .. } | DeviceProblem::Unreachable { .. }) => None,
            opened => Some(opened),
        }
    }

    /// Where the device is now; `None` if it is clear that it is not there. A name may have gone to another device
    /// meanwhile: what has a serial number is looked for by it.
    fn address_now(&self) -> Option<DeviceAddress> {
        let known = self.usb.as_ref().map(UsbId::of).filter(|id| id.serial_number.is_some());
        match &self.address {
            DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } => {
                let now_at = match &self.usb {
                    Some(usb) if known.is_some() => port_of(usb)?,
                    _ if Path::new(path).exists() => path.clone(),
                    _ => return None,
                };
                // A link that led to the port is as good as its name.
                let unchanged = std::fs::canonicalize(path).is_ok_and(|real| real == Path::new(&now_at));
                Some(if unchanged { self.address.clone() } else { at_path(&self.address, now_at) })
            }
            DeviceAddress::Usb(id) => Some(DeviceAddress::Usb(known.unwrap_or_else(|| id.clone()))),
            DeviceAddress::Hid(place) => Some(DeviceAddress::Hid(known.map_or_else(|| place.clone(), HidPlace::Id))),
            DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => Some(self.address.clone()),
        }
    }
}

fn at_path(address: &DeviceAddress, now_at: String) -> DeviceAddress {
    let mut moved = address.clone();
    if let DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } = &mut moved {
        *path = now_at;
    }
    moved
}
