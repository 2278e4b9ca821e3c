//! Which USB device: its vendor ID, its product ID and, if there are several, its serial number.

use std::fmt;
use std::str::FromStr;

/// A USB device by its IDs, written `VID:PID` or `VID:PID,SERIAL` with four hexadecimal digits each.
///
/// ```
/// let id: armature_device::UsbId = "1209:0001,A7".parse()?;
/// assert_eq!((id.vendor_id, id.product_id, id.serial_number.as_deref()), (0x1209, 1, Some("A7")));
/// # Ok::<(), armature_device::NoUsbId>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbId {
    /// Vendor ID.
    pub vendor_id: u16,
    /// The vendor's product ID.
    pub product_id: u16,
    /// Serial number; without it there must be only one device of this product.
    pub serial_number: Option<String>,
}

/// What a USB device reports about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbDescription {
    /// Vendor ID.
    pub vendor_id: u16,
    /// The vendor's product ID.
    pub product_id: u16,
    /// Manufacturer.
    pub manufacturer: Option<String>,
    /// Product name.
    pub product: Option<String>,
    /// Serial number.
    pub serial_number: Option<String>,
}

/// The text does not name a USB device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("write vendor and product in hexadecimal, as in 1209:0001, followed by ,SERIAL if there are several")]
pub struct NoUsbId;

impl UsbId {
    /// The most specific name for this device.
    pub fn of(usb: &UsbDescription) -> Self {
        let serial_number = usb.serial_number.clone().filter(|number| !number.is_empty());
        Self { vendor_id: usb.vendor_id, product_id: usb.product_id, serial_number }
    }

    /// Whether this names that device.
    pub fn names(&self, usb: &UsbDescription) -> bool {
        (self.vendor_id, self.product_id) == (usb.vendor_id, usb.product_id)
            && (self.serial_number.is_none() || self.serial_number == usb.serial_number)
    }
}

impl FromStr for UsbId {
    type Err = NoUsbId;

    fn from_str(text: &str) -> Result<Self, NoUsbId> {
        let (numbers, serial_number) = match text.split_once(',') {
            Some((numbers, serial)) => (numbers, Some(serial.to_owned()).filter(|serial| !serial.is_empty())),
            None => (text, None),
        };
        let (vendor, product) = numbers.split_once(':').ok_or(NoUsbId)?;
        // `from_str_radix` accepts a sign, but no ID has one.
        let number = |digits: &str| {
            let are_digits = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
            u16::from_str_radix(digits, 16).ok().filter(|_| are_digits).ok_or(NoUsbId)
        };
        Ok(Self { vendor_id: number(vendor)?, product_id: number(product)?, serial_number })
    }
}

impl fmt::Display for UsbId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:04x}", self.vendor_id, self.product_id)?;
        self.serial_number.as_ref().map_or(Ok(()), |number| write!(f, ",{number}"))
    }
}
