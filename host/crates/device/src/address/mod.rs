//! Where a device is: [`DeviceAddress`], read from and written as text.

mod device_address;
mod usb_id;

pub use device_address::{AddressError, DEFAULT_BAUD, DeviceAddress, HidPlace};
pub use usb_id::{NoUsbId, UsbDescription, UsbId};
