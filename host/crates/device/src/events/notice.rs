//! What a user should know about a device although the session continues, with what to do about it.

use firmware_protocol::PartUid;

/// Something worth reporting that does not stop the session.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceNotice {
    /// The connection was lost; the line is reopened as soon as it is back.
    #[error(
        "the connection was lost ({reason}): check cable and power; it resumes automatically once the device is back"
    )]
    LineLost {
        /// What the operating system said.
        reason: String,
    },
    /// The device is back, at the same port or at another one; it introduces itself next.
    #[error("the connection is back after {seconds:.1} s{}", at.as_ref().map_or_else(String::new, |at| format!(", now at {at}")))]
    LineBack {
        /// How long it was gone, seconds.
        seconds: f64,
        /// The port where it is now, if that is another one than before.
        at: Option<String>,
    },
    /// The line was opened, and nothing has answered yet.
    #[error(
        "no answer yet: opening the port resets many boards (an Arduino is one), and their boot loader has the line for up to \
         two seconds; the puppet is asked until it answers"
    )]
    WaitsForStart,
    /// The line is there again but cannot be opened yet.
    #[error("the port is back but cannot be opened yet: {reason}")]
    LineWaits {
        /// Why.
        reason: String,
    },
    /// A joint has had no data for a second; the others continue.
    #[error(
        "part {part} ({uid}) has had no data for a second: its bone keeps its last rotation until it answers again. Check the \
         plug and the sensor"
    )]
    JointSilent {
        /// Zero-based part of the topology.
        part: usize,
        /// Its number.
        uid: PartUid,
    },
    /// A joint that had no data has some again.
    #[error("part {part} ({uid}) has data again, after {seconds:.1} s")]
    JointBack {
        /// Zero-based part of the topology.
        part: usize,
        /// Its number.
        uid: PartUid,
        /// For how long it had none, seconds.
        seconds: f64,
    },
    /// The time of a sample leaps ahead of the time that has passed.
    #[error(
        "the device's clock leaps: it went ahead by {seconds:.3} s within {host_seconds:.3} s. Samples with such a time \
         are rejected and counted as lost. A clock of 64 bits has to be read in one piece: read its upper half again \
         after the lower one, or keep interrupts out"
    )]
    ClockLeaps {
        /// How far the clock went, seconds.
        seconds: f64,
        /// What passed by sequence number and host time, seconds.
        host_seconds: f64,
    },
    /// The clock goes back while samples go on.
    #[error(
        "the device's clock stepped back by {seconds:.3} s although it keeps counting samples: their times are rebuilt \
         from their sequence numbers. The firmware must never let its clock run backwards"
    )]
    ClockStepsBack {
        /// How far, seconds.
        seconds: f64,
    },
    /// The clock shows the same time again and again.
    #[error(
        "the device's clock stands still: {samples} samples within {seconds:.1} s have the same time. Times are rebuilt from \
         their sequence numbers and the host's clock; the firmware must read its clock for every sample"
    )]
    ClockStands {
        /// How many so far.
        samples: u32,
        /// Over how long, seconds.
        seconds: f64,
    },
    /// A rate that no line can carry.
    #[error(
        "the device claims {hertz:.0} samples a second, more than any line carries; samples are used as they arrive, but \
         its firmware should state its real rate"
    )]
    ImpossibleRate {
        /// The rate it claims, samples per second.
        hertz: f64,
    },
    /// The servos were found at a speed other than the requested one.
    #[error("the servos answer at {found} baud, not at {asked}: add @{found} to the port's address to start there")]
    FoundAtBaud {
        /// The requested speed, bits per second.
        asked: u32,
        /// The speed where they were found, bits per second.
        found: u32,
    },
    /// A servo does not answer; the others continue.
    #[error(
        "servo {id} ({name}) does not answer; the others continue without it. Check its plug and its id; it rejoins \
         as soon as it answers"
    )]
    ServoMissing {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
    },
    /// A servo that was missing answers again.
    #[error("servo {id} ({name}) is back")]
    ServoBack {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
    },
    /// A servo is not the expected model.
    #[error(
        "servo {id} ({name}) has model number {found}, but this arm has {expected} there: {}",
        if *usable { "it counts the same way and is used" } else { "it counts differently and is ignored; check --preset" }
    )]
    ServoModel {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
        /// The model number that was read.
        found: u16,
        /// The model number that the arm should have there.
        expected: u16,
        /// Whether it can be used anyway.
        usable: bool,
    },
    /// Servos wait before they answer, which lowers the rate.
    #[error(
        "the servos wait up to {micros} us before each answer: {hertz_now:.0} readings a second are possible, \
         {hertz_without:.0} without. Return delay is a setting in the servos' memory and is changed only with your \
         consent (--servo-return-delay-zero)"
    )]
    ReturnDelay {
        /// The longest delay, µs.
        micros: u32,
        /// Readings of all servos per second as it is now.
        hertz_now: f64,
        /// Readings of all servos per second with delay 0.
        hertz_without: f64,
    },
    /// The adapter holds bytes back.
    #[error(
        "the USB adapter holds answers back for about {millis:.0} ms, which limits the rate to about {hertz:.0} a \
         second. FTDI adapters do that by default: as root, echo 1 > /sys/bus/usb-serial/devices/ttyUSB0/latency_timer \
         (with your port's name)"
    )]
    AdapterLatency {
        /// How long it holds them back, ms.
        millis: f64,
        /// Readings per second at that delay.
        hertz: f64,
    },
    /// The adapter between host and puppet holds bytes back.
    #[error(
        "the USB adapter at {port} holds bytes back for about {millis:.0} ms, and the character follows that much later. FTDI \
         adapters do that by default: install the rules that `armature devices --udev-rules` prints and plug the adapter in \
         again, or, as root, echo 1 > /sys/bus/usb-serial/devices/{}/latency_timer",
        port.rsplit('/').next().unwrap_or(port)
    )]
    AdapterHoldsBytes {
        /// The port.
        port: String,
        /// For how long it holds them back, ms.
        millis: f64,
    },
    /// A servo's motor still holds its position.
    #[error("servo {id} ({name}) could not be set to move freely; switch off its motor power before you bend it")]
    TorqueOn {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
    },
    /// The servos do not know the faster way of reading.
    #[error("the servos do not answer {quick}; {instead} are used instead, which are slower but complete")]
    SlowerReads {
        /// The instruction they do not answer.
        quick: &'static str,
        /// What is used instead.
        instead: &'static str,
    },
    /// A servo reports a fault.
    #[error("servo {id} ({name}) reports {what}")]
    ServoComplains {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
        /// What it reports.
        what: String,
    },
    /// A part without a light was asked to blink.
    #[error("{name} has no light to blink")]
    NoLight {
        /// Which part.
        name: String,
    },
}
