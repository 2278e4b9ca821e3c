//! What is plugged in and unplugged over time.

use super::list::{DeviceDescription, Plugged, list_devices};

/// A change between two checks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortChange {
    /// This was not there before.
    PluggedIn(DeviceDescription),
    /// This is no longer there.
    Unplugged(DeviceDescription),
}

/// Remembers what was there at the last check. A check takes about a millisecond; two per second are enough to seem
/// live.
#[derive(Clone, Debug, Default)]
pub struct DeviceWatch {
    known: Plugged,
}

impl DeviceWatch {
    /// Checks again: first what has gone, then what has come. The first check reports everything that is there.
    pub fn look(&mut self) -> Vec<PortChange> {
        self.compare(list_devices())
    }

    /// What the last check found.
    pub fn known(&self) -> &Plugged {
        &self.known
    }

    /// A device that comes back at another port counts as gone and come.
    fn compare(&mut self, now: Plugged) -> Vec<PortChange> {
        let gone = self.known.devices.iter().filter(|device| !now.devices.contains(device));
        let come = now.devices.iter().filter(|device| !self.known.devices.contains(device));
        let changes =
            gone.cloned().map(PortChange::Unplugged).chain(come.cloned().map(PortChange::PluggedIn)).collect();
        self.known = now;
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::{DeviceAddress, UsbDescription};

    fn device(address: &str, port: &str) -> DeviceDescription {
        let usb = UsbDescription {
            vendor_id: 0x1209,
            product_id: 1,
            manufacturer: None,
            product: Some("Puppet".into()),
            serial_number: Some("7".into()),
        };
        let address: DeviceAddress = address.parse().unwrap();
        DeviceDescription { address, port: port.into(), usb: Some(usb) }
    }

    #[test]
    fn what_goes_and_comes_is_told_once() {
        let plugged = |devices: &[&DeviceDescription]| Plugged {
            devices: devices.iter().map(|&device| device.clone()).collect(),
            problems: Vec::new(),
        };
        let (serial, bulk) =
            (device("serial:/dev/ttyACM0", "/dev/ttyACM0"), device("usb:1209:0001,7", "bus 1 device 3"));
        let moved = device("usb:1209:0001,7", "bus 1 device 4");
        let mut watch = DeviceWatch::default();
        assert_eq!(watch.compare(plugged(&[])), []);
        let both = [PortChange::PluggedIn(serial.clone()), PortChange::PluggedIn(bulk.clone())];
        assert_eq!(watch.compare(plugged(&[&serial, &bulk])), both);
        assert_eq!(watch.compare(plugged(&[&bulk, &serial])), [], "order does not matter");
        let pulled_and_back = [PortChange::Unplugged(bulk), PortChange::PluggedIn(moved.clone())];
        assert_eq!(watch.compare(plugged(&[&serial, &moved])), pulled_and_back);
        assert_eq!(watch.compare(plugged(&[&moved])), [PortChange::Unplugged(serial)]);
        assert_eq!(watch.known().devices, [moved]);
    }

    #[test]
    fn this_machine_can_be_looked_at() {
        let mut watch = DeviceWatch::default();
        let first = watch.look();
        assert_eq!(first.len(), watch.known().devices.len());
    }
}
