//! Finding a line again after it was lost: the same device at the same port, or at the one where it is now.

use std::path::Path;
use std::time::Duration;

use crate::discovery::{port_of, usb_behind};
use crate::{DeviceAddress, DeviceProblem, Transport, UsbDescription, open};

/// Time between two looks for a port that is gone. A look costs less than 0.1 ms.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(20);
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
        let usb = path_of(address).and_then(usb_behind);
        Self { address: address.clone(), usb }
    }

    /// What tells this device's adapter from others of its kind.
    pub(crate) fn usb_serial_number(&self) -> Option<&str> {
        self.usb.as_ref().and_then(|usb| usb.serial_number.as_deref())
    }

    /// How long to wait between two attempts.
    pub(crate) fn pause(&self) -> Duration {
        if path_of(&self.address).is_some() { LOOK_EVERY } else { CALL_EVERY }
    }

    /// What tells the thing that is plugged in there now from the next one; `None` if that cannot be told, or nothing is.
    pub(crate) fn stamp(&self) -> Option<(u64, std::time::SystemTime)> {
        let met = std::fs::metadata(path_of(&self.address)?).ok()?;
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

    /// Opens the line again; `None` while the device is not there.
    pub(crate) async fn try_again(&self) -> Option<Result<Box<dyn Transport>, DeviceProblem>> {
        let Some(path) = path_of(&self.address) else {
            return Some(open(&self.address).await)
                .filter(|line| !matches!(line, Err(DeviceProblem::Unreachable { .. })));
        };
        // The name may have gone to another device meanwhile.
        let now_at = match &self.usb {
            Some(usb) if usb.serial_number.is_some() => port_of(usb)?,
            _ if Path::new(path).exists() => path.to_owned(),
            _ => return None,
        };
        // A link that led to the port is as good as its name.
        let unchanged = std::fs::canonicalize(path).is_ok_and(|real| real == Path::new(&now_at));
        let address = if unchanged { self.address.clone() } else { at_path(&self.address, now_at) };
        match open(&address).await {
            Err(DeviceProblem::PortMissing { .. }) => None,
            opened => Some(opened),
        }
    }
}

fn path_of(address: &DeviceAddress) -> Option<&str> {
    match address {
        DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } => Some(path),
        DeviceAddress::Tcp { .. } | DeviceAddress::Sim { .. } => None,
    }
}

fn at_path(address: &DeviceAddress, now_at: String) -> DeviceAddress {
    let mut moved = address.clone();
    if let DeviceAddress::Serial { path, .. } | DeviceAddress::Servos { path, .. } = &mut moved {
        *path = now_at;
    }
    moved
}
