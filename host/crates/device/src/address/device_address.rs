//! Where a device is: `serial:PATH[@BAUD]`, `feetech:PATH[@BAUD][,ARM]`, `dynamixel:PATH[@BAUD][,ARM]`,
//! `usb:VID:PID[,SERIAL]`, `hid:VID:PID[,SERIAL]`, `hid:PATH`, `tcp:HOST:PORT` or `sim:NAME`.

use std::fmt;
use std::str::FromStr;

use super::usb_id::{NoUsbId, UsbId};
use crate::arm::ServoProtocol;

/// The line speed used when an address gives none, bits per second; USB devices ignore it.
pub const DEFAULT_BAUD: u32 = 3_000_000;

/// Where a device is.
///
/// ```
/// use armature_device::DeviceAddress;
///
/// let address: DeviceAddress = "serial:/dev/ttyACM0@1000000".parse()?;
/// assert_eq!(address, DeviceAddress::Serial { path: "/dev/ttyACM0".into(), baud: 1_000_000 });
/// assert_eq!(address.to_string(), "serial:/dev/ttyACM0@1000000");
/// # Ok::<(), armature_device::AddressError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceAddress {
    /// A serial port, or a pseudo-terminal that looks like one.
    Serial {
        /// The port's path (`/dev/ttyACM0`) or name (`COM3`).
        path: String,
        /// Line speed, bits per second.
        baud: u32,
    },
    /// An arm of bus servos behind a serial port.
    Servos {
        /// Which bus.
        protocol: ServoProtocol,
        /// The port's path or name.
        path: String,
        /// The speed at which to look for the servos first, bits per second; without it, the arm's own speed.
        baud: Option<u32>,
        /// Which arm, by the name of its preset; without it, the first preset for this bus.
        arm: Option<String>,
    },
    /// A puppet on USB bulk.
    Usb(UsbId),
    /// A puppet on HID.
    Hid(HidPlace),
    /// A device at a TCP port.
    Tcp {
        /// Host name or address.
        host: String,
        /// Port.
        port: u16,
    },
    /// A simulated device, which the program itself starts.
    Sim {
        /// Which one.
        name: String,
    },
}

/// Which HID device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HidPlace {
    /// By its IDs, wherever it is plugged in.
    Id(UsbId),
    /// By its current name in the operating system (`/dev/hidraw0`).
    Path(String),
}

/// Why a text is not a device address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// It starts with none of the address kinds.
    #[error(
        "`{given}` is not a device address; use serial:PATH[@BAUD], feetech:PATH[@BAUD][,ARM], \
         dynamixel:PATH[@BAUD][,ARM], usb:VID:PID[,SERIAL], hid:VID:PID[,SERIAL], tcp:HOST:PORT or sim:NAME, for example \
         serial:/dev/ttyACM0, feetech:/dev/ttyACM0,so101-leader, usb:1209:0001, tcp:localhost:7700 or sim:human"
    )]
    UnknownKind {
        /// The text.
        given: String,
    },
    /// `serial:`, `feetech:` or `dynamixel:` without a path.
    #[error(
        "the port's path is missing, as in serial:/dev/ttyACM0 or feetech:/dev/ttyACM0 (`armature devices` lists them)"
    )]
    NoPath,
    /// A speed that is not a number.
    #[error(
        "`{given}` is not a line speed; give bits per second as a whole number, for example serial:{path}@{DEFAULT_BAUD}"
    )]
    BadBaud {
        /// The path before the speed.
        path: String,
        /// The text after the `@`.
        given: String,
    },
    /// `usb:` or `hid:` without the IDs of a device.
    #[error("`{given}` does not name a device ({problem}); `armature devices` lists them")]
    BadUsb {
        /// The whole address.
        given: String,
        /// Why not.
        problem: NoUsbId,
    },
    /// `tcp:` without a host or without a port.
    #[error("tcp: needs a host and a port, for example tcp:localhost:7700; found `{given}`")]
    BadTcp {
        /// The text after `tcp:`.
        given: String,
    },
    /// `sim:` without a name.
    #[error("sim: needs the name of a simulated puppet, for example sim:human")]
    NoSimName,
}

impl DeviceAddress {
    /// The serial port's path or name, if this is on one.
    pub fn serial_path(&self) -> Option<&str> {
        match self {
            Self::Serial { path, .. } | Self::Servos { path, .. } => Some(path),
            Self::Usb(_) | Self::Hid(_) | Self::Tcp { .. } | Self::Sim { .. } => None,
        }
    }
}

impl FromStr for DeviceAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        match text.split_once(':') {
            Some(("serial", rest)) => parse_serial(rest),
            Some(("feetech", rest)) => parse_servos(ServoProtocol::Feetech, rest),
            Some(("dynamixel", rest)) => parse_servos(ServoProtocol::Dynamixel, rest),
            Some(("usb", rest)) => parse_usb_id(text, rest).map(Self::Usb),
            Some(("hid", rest)) => parse_hid(text, rest).map(Self::Hid),
            Some(("tcp", rest)) => parse_tcp(rest),
            Some(("sim", "")) => Err(AddressError::NoSimName),
            Some(("sim", name)) => Ok(Self::Sim { name: name.to_owned() }),
            _ => Err(AddressError::UnknownKind { given: text.to_owned() }),
        }
    }
}

fn parse_serial(rest: &str) -> Result<DeviceAddress, AddressError> {
    let (path, baud) = parse_port(rest)?;
    Ok(DeviceAddress::Serial { path, baud: baud.unwrap_or(DEFAULT_BAUD) })
}

/// The arm's name follows the last comma; if the last part of the path has a comma, the arm's name must be given too.
fn parse_servos(protocol: ServoProtocol, rest: &str) -> Result<DeviceAddress, AddressError> {
    let (port, arm) = match rest.rsplit_once(',') {
        Some((port, arm)) if !arm.contains('/') => (port, Some(arm.to_owned()).filter(|arm| !arm.is_empty())),
        _ => (rest, None),
    };
    let (path, baud) = parse_port(port)?;
    Ok(DeviceAddress::Servos { protocol, path, baud, arm })
}

/// An `@` in a folder's name belongs to the path; one in the last part separates the speed.
fn parse_port(rest: &str) -> Result<(String, Option<u32>), AddressError> {
    let (path, baud) = match rest.rsplit_once('@') {
        Some((path, speed)) if !speed.contains('/') => match speed.parse() {
            Ok(baud) if baud > 0 => (path, Some(baud)),
            _ => return Err(AddressError::BadBaud { path: path.to_owned(), given: speed.to_owned() }),
        },
        _ => (rest, None),
    };
    if path.is_empty() {
        return Err(AddressError::NoPath);
    }
    Ok((path.to_owned(), baud))
}

fn parse_usb_id(given: &str, rest: &str) -> Result<UsbId, AddressError> {
    rest.parse().map_err(|problem| AddressError::BadUsb { given: given.to_owned(), problem })
}

/// A path has a slash or a backslash; IDs have none.
fn parse_hid(given: &str, rest: &str) -> Result<HidPlace, AddressError> {
    match parse_usb_id(given, rest) {
        Ok(id) => Ok(HidPlace::Id(id)),
        Err(_) if rest.contains(['/', '\\']) => Ok(HidPlace::Path(rest.to_owned())),
        Err(problem) => Err(problem),
    }
}

/// The host may be an IPv6 address in brackets.
fn parse_tcp(rest: &str) -> Result<DeviceAddress, AddressError> {
    let bad = || AddressError::BadTcp { given: rest.to_owned() };
    let (host, port) = rest.rsplit_once(':').ok_or_else(bad)?;
    let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    match port.parse() {
        Ok(port) if port > 0 && !host.is_empty() => Ok(DeviceAddress::Tcp { host: host.to_owned(), port }),
        _ => Err(bad()),
    }
}

impl fmt::Display for DeviceAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { path, baud } if *baud == DEFAULT_BAUD => write!(f, "serial:{path}"),
            Self::Serial { path, baud } => write!(f, "serial:{path}@{baud}"),
            Self::Servos { protocol, path, baud, arm } => {
                write!(f, "{}:{path}", protocol.scheme())?;
                baud.map_or(Ok(()), |baud| write!(f, "@{baud}"))?;
                arm.as_ref().map_or(Ok(()), |arm| write!(f, ",{arm}"))
            }
            Self::Usb(id) => write!(f, "usb:{id}"),
            Self::Hid(HidPlace::Id(id)) => write!(f, "hid:{id}"),
            Self::Hid(HidPlace::Path(path)) => write!(f, "hid:{path}"),
            Self::Tcp { host, port } if host.contains(':') => write!(f, "tcp:[{host}]:{port}"),
            Self::Tcp { host, port } => write!(f, "tcp:{host}:{port}"),
            Self::Sim { name } => write!(f, "sim:{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serial(path: &str, baud: u32) -> DeviceAddress {
        DeviceAddress::Serial { path: path.into(), baud }
    }

    fn servos(protocol: ServoProtocol, path: &str, baud: Option<u32>, arm: Option<&str>) -> DeviceAddress {
        DeviceAddress::Servos { protocol, path: path.into(), baud, arm: arm.map(str::to_owned) }
    }

    fn usb_id(vendor_id: u16, product_id: u16, serial_number: Option<&str>) -> UsbId {
        UsbId { vendor_id, product_id, serial_number: serial_number.map(str::to_owned) }
    }

    fn tcp(host: &str, port: u16) -> DeviceAddress {
        DeviceAddress::Tcp { host: host.into(), port }
    }

    #[test]
    fn addresses_are_read_and_written_the_same() {
        let known = [
            ("serial:/dev/ttyACM0", serial("/dev/ttyACM0", DEFAULT_BAUD)),
            ("serial:/dev/pts/7@115200", serial("/dev/pts/7", 115_200)),
            ("serial:/dev/odd@folder/tty", serial("/dev/odd@folder/tty", DEFAULT_BAUD)),
            ("serial:COM3", serial("COM3", DEFAULT_BAUD)),
            ("feetech:/dev/ttyACM0", servos(ServoProtocol::Feetech, "/dev/ttyACM0", None, None)),
            (
                "feetech:/dev/ttyACM0,so101-leader",
                servos(ServoProtocol::Feetech, "/dev/ttyACM0", None, Some("so101-leader")),
            ),
            (
                "dynamixel:/dev/a,b@c/0@57600,gello",
                servos(ServoProtocol::Dynamixel, "/dev/a,b@c/0", Some(57_600), Some("gello")),
            ),
            ("usb:1209:0001", DeviceAddress::Usb(usb_id(0x1209, 1, None))),
            ("usb:1209:0001,A,7", DeviceAddress::Usb(usb_id(0x1209, 1, Some("A,7")))),
            ("hid:feed:beef,/dev", DeviceAddress::Hid(HidPlace::Id(usb_id(0xFEED, 0xBEEF, Some("/dev"))))),
            ("hid:/dev/hidraw3", DeviceAddress::Hid(HidPlace::Path("/dev/hidraw3".into()))),
            ("tcp:localhost:7700", tcp("localhost", 7_700)),
            ("tcp:[::1]:7700", tcp("::1", 7_700)),
            ("sim:human", DeviceAddress::Sim { name: "human".into() }),
        ];
        for (text, address) in known {
            assert_eq!(text.parse(), Ok(address.clone()));
            assert_eq!(address.to_string(), text);
        }
    }

    #[test]
    fn wrong_addresses_are_explained_by_example() {
        for text in [
            "",
            "/dev/ttyACM0",
            "usb:1",
            "usb:12345:1",
            "usb:+123:1",
            "usb::",
            "hid:",
            "hid:hidraw0",
            "serial:",
            "serial:@9600",
            "serial:x@",
            "serial:x@fast",
            "serial:x@0",
            "feetech:",
            "dynamixel:,gello",
            "feetech:x@fast",
        ]
        .into_iter()
        .chain(["tcp:", "tcp:host", "tcp::80", "tcp:host:0", "tcp:host:70000", "sim:"])
        {
            let error = text.parse::<DeviceAddress>().expect_err(text);
            let message = error.to_string();
            assert!(
                ["serial:", "tcp:", "sim:", "1209:0001"].iter().any(|kind| message.contains(kind)),
                "{text}: {message}"
            );
        }
    }
}
