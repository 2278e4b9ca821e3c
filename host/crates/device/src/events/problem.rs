//! What can be wrong with a device, with what to do about it.

use firmware_protocol::RefusalReason;

use super::request_kind::RequestKind;
use crate::address::{UsbDescription, UsbId};
use crate::arm::UnknownArm;
use crate::topology::TopologyProblem;

/// What is wrong with the device or the connection to it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceProblem {
    /// Not a single byte arrived.
    #[error(
        "the device has sent nothing for {seconds} s: is it powered, is this the right port, and does the line speed \
         match? (the session keeps asking)"
    )]
    Silent {
        /// How long, s.
        seconds: u64,
    },
    /// Bytes arrived, but no frame.
    #[error(
        "{bytes} bytes arrived within {seconds} s and none of them made sense: the line speed is wrong (set it with \
         serial:PATH@BAUD) or this is not an Armature device"
    )]
    Garbage {
        /// How many bytes.
        bytes: u64,
        /// Within how many seconds.
        seconds: u64,
    },
    /// The device speaks an incompatible protocol.
    #[error("the device speaks protocol {theirs} but this program speaks {ours}: update {}", if theirs > ours { "this program" } else { "the device's firmware" })]
    WrongMajor {
        /// Major version of the device.
        theirs: u8,
        /// Major version of this program.
        ours: u8,
    },
    /// The tree of parts is impossible.
    #[error(
        "the device describes an impossible tree of parts: {0}; unplug and replug that part, or update the device's firmware"
    )]
    TopologyInvalid(#[from] TopologyProblem),
    /// Samples do not have the length that the tree requires.
    #[error("a sample of epoch {epoch} has {found} sensors but the tree has {expected}; requesting the tree again")]
    SampleDoesNotFit {
        /// Epoch of sample and tree.
        epoch: u16,
        /// Sensors of the tree.
        expected: usize,
        /// Sensors of the sample.
        found: usize,
    },
    /// The puppet streams, and none of its sensors has data.
    #[error(
        "none of the puppet's {sensors} sensors has data, although it sends samples: check the sensors' power supply and the \
         plug at the root"
    )]
    NoSensorAnswers {
        /// How many there are.
        sensors: usize,
    },
    /// Samples keep referring to a tree that the device does not describe.
    #[error(
        "the samples refer to tree {sample}, but the device keeps describing tree {tree} when asked: update the \
         device's firmware (the samples cannot be used until then)"
    )]
    UnknownEpoch {
        /// Epoch of the samples.
        sample: u16,
        /// Epoch of the tree.
        tree: u16,
    },
    /// The samples' clock keeps jumping back.
    #[error(
        "the device's clock has run backwards {times} times within {seconds} s; where its sequence numbers go on, the \
         times of its samples are rebuilt; otherwise the session starts over from the hello and samples are lost. The \
         firmware must never let its clock run backwards; if the device really restarts this often, check its power supply"
    )]
    ClockRunsBackwards {
        /// How often.
        times: usize,
        /// Within how many seconds.
        seconds: u64,
    },
    /// The device sends data but does not answer a request.
    #[error("the device sends data but does not answer the {request} request; the session starts over from the hello")]
    NoAnswer {
        /// Which request.
        request: RequestKind,
    },
    /// The device refuses a request.
    #[error("the device refuses the {request} request: {}", refusal(*reason))]
    Refused {
        /// Which request.
        request: RequestKind,
        /// Why.
        reason: RefusalReason,
    },
    /// The line is gone.
    #[error("the device is gone ({reason}): check cable and power, then connect again")]
    Disconnected {
        /// What the operating system said.
        reason: String,
    },
    /// Another program is using the port.
    #[error(
        "{port} is in use: close the program that uses it (a serial monitor, another Armature, a driver) and try again"
    )]
    PortBusy {
        /// The port.
        port: String,
    },
    /// This process may not open any more files.
    #[error(
        "{port} cannot be opened, because too many files are open: raise the number that a program may have open \
         (`ulimit -n 4096`), or close other programs"
    )]
    NoDescriptors {
        /// The address.
        port: String,
    },
    /// There is no such port.
    #[error("there is no port {port}: is the device plugged in? `armature devices` lists the ports")]
    PortMissing {
        /// The port.
        port: String,
    },
    /// No permission to open the port.
    #[error("you do not have permission to open {port}{}", permission_remedy(group.as_deref()))]
    PermissionDenied {
        /// The port.
        port: String,
        /// The group that may use it.
        group: Option<String>,
    },
    /// No permission to open the USB device.
    #[error("you do not have permission to open {port}{}", usb_permission_remedy(node))]
    UsbPermissionDenied {
        /// The address.
        port: String,
        /// The device file, if there is one.
        node: String,
    },
    /// The named device is there, but is something else.
    #[error("{port} cannot be used as a puppet: {reason}")]
    NotAPuppet {
        /// The address.
        port: String,
        /// How that was noticed.
        reason: String,
    },
    /// More than one device has that name.
    #[error("{port} is the name of several devices; choose one of {names}")]
    SeveralDevices {
        /// The address.
        port: String,
        /// Addresses or places that distinguish them.
        names: String,
    },
    /// Boards that USB cannot tell apart.
    #[error(
        "{ports} have the same USB serial number ({number}), so a link in /dev/serial/by-id leads to only one of them: name \
         the port. A puppet that is unplugged and comes back is recognised by its own number"
    )]
    OneSerialNumber {
        /// Their ports.
        ports: String,
        /// Their number.
        number: String,
    },
    /// The operating system cannot list its USB devices.
    #[error("the USB devices of this machine cannot be listed ({reason})")]
    UsbUnavailable {
        /// The system's error.
        reason: String,
    },
    /// After the connection was lost, another device was found on the line.
    #[error(
        "what is plugged in now ({found}) is not the device that was in use before; plug that one in again, or reconnect"
    )]
    AnotherDevice {
        /// What is there now, with its port.
        found: String,
    },
    /// The path is something else.
    #[error("{port} cannot be used as a serial port ({reason}): `armature devices` lists the ports")]
    NotASerialPort {
        /// The path.
        port: String,
        /// The system's error.
        reason: String,
    },
    /// The operating system cannot list its ports.
    #[error("the serial ports of this machine cannot be listed ({reason}); give the path: --device serial:PATH")]
    PortsUnknown {
        /// The system's error.
        reason: String,
    },
    /// The network address cannot be reached.
    #[error("{address} cannot be reached ({reason}): is the simulator or bridge running there?")]
    Unreachable {
        /// Host and port.
        address: String,
        /// The system's error.
        reason: String,
    },
    /// No such arm.
    #[error(transparent)]
    UnknownArm(#[from] UnknownArm),
    /// No servo on the bus answered.
    #[error(
        "no servo of the {arm} answers at any of {bauds} baud: is its power supply on, is this the right port, and does \
         --preset name the right arm? (the session keeps asking)"
    )]
    NoServos {
        /// The arm.
        arm: String,
        /// The speeds tried.
        bauds: String,
    },
    /// Servos answer, but of a model that cannot be read.
    #[error("the servos (model number {model}) are not those of the {arm} and count differently; check --preset")]
    ForeignServos {
        /// The arm.
        arm: String,
        /// The model number of the first of them.
        model: u16,
    },
    /// A simulated device has no line for this crate to open.
    #[error("sim:{name} is simulated by the program itself and cannot be opened as a line")]
    SimulatedHere {
        /// Its name.
        name: String,
    },
}

impl DeviceProblem {
    /// Several devices with one name, each with its location.
    pub(crate) fn several<'a>(port: String, devices: impl Iterator<Item = (&'a UsbDescription, String)>) -> Self {
        let name = |(usb, place)| format!("{} ({place})", UsbId::of(usb));
        Self::SeveralDevices { port, names: devices.map(name).collect::<Vec<_>>().join(", ") }
    }
}

/// Gives Linux users access to USB puppets and servo adapters without a group: a file for `/etc/udev/rules.d`.
pub const UDEV_RULES: &str = include_str!("../../udev/70-armature.rules");

const INSTALL_RULES: &str = "`armature devices --udev-rules | sudo tee /etc/udev/rules.d/70-armature.rules`, then \
                             `sudo udevadm control --reload`, and plug the device in again";

fn usb_permission_remedy(node: &str) -> String {
    if !cfg!(target_os = "linux") {
        return String::new();
    }
    format!(" (you do not own {node}): {INSTALL_RULES}")
}

/// Where joining a group is not enough, a udev rule is.
fn permission_remedy(group: Option<&str>) -> String {
    if !cfg!(target_os = "linux") {
        return String::new();
    }
    let group = group.filter(|group| *group != "root").unwrap_or("dialout");
    format!(
        ": add yourself to the group that does (`sudo usermod -aG {group} $USER`, then log out and in), or \
         {INSTALL_RULES}"
    )
}

fn refusal(reason: RefusalReason) -> String {
    match reason {
        RefusalReason::UnknownRequest => "it does not know this request; update its firmware".into(),
        RefusalReason::Malformed => "it found the request malformed; update its firmware".into(),
        RefusalReason::Busy => "it is busy; the request is repeated soon".into(),
        RefusalReason::NoSuchPart => "no part has that number; it may have been unplugged".into(),
        RefusalReason::SensorBusFailed => "it cannot reach its sensors; check the plugs between the parts".into(),
        RefusalReason::Other(code) => format!("reason {code}, which this version does not know"),
    }
}
