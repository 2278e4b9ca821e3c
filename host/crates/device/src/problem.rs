//! What can be wrong with a device, in words that say what to do.

use crate::topology::TopologyProblem;
use crate::{RefusalReason, RequestKind, UsbDescription, UsbId};

/// What is wrong with the device or the way to it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceProblem {
    /// Not a byte came.
    #[error(
        "the device has sent nothing for {seconds} s: is it powered, is this the right port, and does the line speed \
         match? (the session keeps asking)"
    )]
    Silent {
        /// For how long, s.
        seconds: u64,
    },
    /// Bytes came, but no frame.
    #[error(
        "{bytes} bytes came within {seconds} s and none of them made sense: the line speed is wrong (set it with \
         serial:PATH@BAUD) or this is not an Armature device"
    )]
    Garbage {
        /// How many bytes.
        bytes: u64,
        /// Within how long, s.
        seconds: u64,
    },
    /// The device speaks an incompatible protocol.
    #[error("the device speaks protocol {theirs} and this program {ours}: update {}", if theirs > ours { "this program" } else { "the device's firmware" })]
    WrongMajor {
        /// Major version of the device.
        theirs: u8,
        /// Major version of this program.
        ours: u8,
    },
    /// The tree of parts cannot be.
    #[error(
        "the device describes a tree that cannot be: {0}; unplug and replug that part, or update the device's firmware"
    )]
    TopologyInvalid(#[from] TopologyProblem),
    /// Samples do not have the length that the tree gives.
    #[error("a sample of epoch {epoch} has {found} sensors where the tree has {expected}; the tree is asked for again")]
    SampleDoesNotFit {
        /// Epoch of sample and tree.
        epoch: u16,
        /// Sensors of the tree.
        expected: usize,
        /// Sensors of the sample.
        found: usize,
    },
    /// Samples keep being numbered by a tree that the device does not describe.
    #[error(
        "the samples are numbered by tree {sample}, but asked for it the device keeps describing tree {tree}: update the \
         device's firmware (the samples cannot be used until then)"
    )]
    UnknownEpoch {
        /// Epoch of the samples.
        sample: u16,
        /// Epoch of the tree.
        tree: u16,
    },
    /// The clock of the samples jumps back again and again.
    #[error(
        "the device's clock has run backwards {times} times within {seconds} s; each time the session begins again from \
         the hello and samples are lost. A clock that never goes back is the firmware's duty; if it starts anew so often \
         in truth, check its power supply"
    )]
    ClockRunsBackwards {
        /// How often.
        times: usize,
        /// Within how long, s.
        seconds: u64,
    },
    /// The device talks but does not answer a request.
    #[error("the device talks but does not answer the {request} request; the session begins again from the hello")]
    NoAnswer {
        /// Which request.
        request: RequestKind,
    },
    /// The device says no.
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
    /// Someone else has the port.
    #[error(
        "{port} is in use: close what uses it (a serial monitor, another Armature, a driver of its own) and try again"
    )]
    PortBusy {
        /// The port.
        port: String,
    },
    /// There is no such port.
    #[error("there is no port {port}: is the device plugged in? `armature devices` lists the ports there are")]
    PortMissing {
        /// The port.
        port: String,
    },
    /// The port may not be opened.
    #[error("{port} may not be opened by this user{}", permission_remedy(group.as_deref()))]
    PermissionDenied {
        /// The port.
        port: String,
        /// The group that may use it.
        group: Option<String>,
    },
    /// The device on USB may not be opened.
    #[error("{port} may not be opened by this user{}", usb_permission_remedy(node))]
    UsbPermissionDenied {
        /// The address.
        port: String,
        /// The file that stands for the device, where there is one.
        node: String,
    },
    /// What was named is there, and is something else.
    #[error("{port} cannot be used as a puppet: {reason}")]
    NotAPuppet {
        /// The address.
        port: String,
        /// What tells.
        reason: String,
    },
    /// More than one device has that name.
    #[error("{port} is the name of several devices, and none is taken at random; name one of {names}")]
    SeveralDevices {
        /// The address.
        port: String,
        /// Addresses or places that tell them apart.
        names: String,
    },
    /// The operating system does not tell its USB devices.
    #[error("the USB devices of this machine cannot be listed ({reason})")]
    UsbUnavailable {
        /// What it said.
        reason: String,
    },
    /// After the line was lost, another device was found at it.
    #[error(
        "the device that is plugged in now ({found}) is not the one that was used; plug that one in again, or connect anew"
    )]
    AnotherDevice {
        /// Who is there now.
        found: String,
    },
    /// The path leads to something else.
    #[error("{port} cannot be used as a serial port ({reason}): `armature devices` lists the ports there are")]
    NotASerialPort {
        /// The path.
        port: String,
        /// What the operating system said.
        reason: String,
    },
    /// The operating system does not tell its ports.
    #[error("the serial ports of this machine cannot be listed ({reason}); give the path: --device serial:PATH")]
    PortsUnknown {
        /// What the operating system said.
        reason: String,
    },
    /// Nobody answers at the network address.
    #[error("{address} cannot be reached ({reason}): is the simulator or bridge running there?")]
    Unreachable {
        /// Host and port.
        address: String,
        /// What the operating system said.
        reason: String,
    },
    /// No such arm.
    #[error(transparent)]
    UnknownArm(#[from] crate::servo::UnknownArm),
    /// Nobody on the bus answered.
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
    /// Servos answer, but of a kind that cannot be read.
    #[error("the servos (model number {model}) are not those of the {arm} and count differently; check --preset")]
    ForeignServos {
        /// The arm.
        arm: String,
        /// The model number of the first of them.
        model: u16,
    },
    /// A simulated device has no line that this crate could open.
    #[error("sim:{name} is started by the program itself and cannot be opened as a line")]
    SimulatedHere {
        /// Its name.
        name: String,
    },
}

impl DeviceProblem {
    /// Several devices, each with where it is.
    pub(crate) fn several<'a>(port: String, devices: impl Iterator<Item = (&'a UsbDescription, String)>) -> Self {
        let name = |(usb, place)| format!("{} ({place})", UsbId::of(usb));
        Self::SeveralDevices { port, names: devices.map(name).collect::<Vec<_>>().join(", ") }
    }
}

/// What gives a user of Linux puppets and servo adapters on USB without a group: a file for `/etc/udev/rules.d`.
pub const UDEV_RULES: &str = include_str!("../udev/70-armature.rules");

const INSTALL_RULES: &str = "`armature devices --udev-rules | sudo tee /etc/udev/rules.d/70-armature.rules`, then \
                             `sudo udevadm control --reload`, and plug the device in again";

fn usb_permission_remedy(node: &str) -> String {
    if !cfg!(target_os = "linux") {
        return String::new();
    }
    format!(" ({node} belongs to others): {INSTALL_RULES}")
}

/// Where one cannot simply join a group, a rule for the device manager does.
fn permission_remedy(group: Option<&str>) -> String {
    if !cfg!(target_os = "linux") {
        return String::new();
    }
    let group = group.filter(|group| *group != "root").unwrap_or("dialout");
    format!(
        ": add yourself to the group that may (`sudo usermod -aG {group} $USER`, then log out and in), or \
         {INSTALL_RULES}"
    )
}

fn refusal(reason: RefusalReason) -> String {
    match reason {
        RefusalReason::UnknownRequest => "it does not know it; update its firmware".into(),
        RefusalReason::Malformed => "it found it malformed; update its firmware".into(),
        RefusalReason::Busy => "it is busy; asked again soon".into(),
        RefusalReason::NoSuchPart => "no part has that number; it may have been unplugged".into(),
        RefusalReason::SensorBusFailed => "it cannot reach its sensors; check the plugs between the parts".into(),
        RefusalReason::Other(code) => format!("reason {code}, which this version does not know"),
    }
}
