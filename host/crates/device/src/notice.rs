//! What a user should know of a device although the session goes on, in words that say what to do.

/// Something worth telling that does not stop the session.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceNotice {
    /// The line broke; it is opened again as soon as it is there.
    #[error("the line broke ({reason}): check cable and power; it is taken up again by itself as soon as it is back")]
    LineLost {
        /// What the operating system said.
        reason: String,
    },
    /// The line is open again; the device introduces itself next.
    #[error("the line is back after {seconds:.1} s")]
    LineBack {
        /// How long it was gone, seconds.
        seconds: f64,
    },
    /// The line is there again but cannot be opened yet.
    #[error("the port is back but cannot be opened yet: {reason}")]
    LineWaits {
        /// Why.
        reason: String,
    },
    /// A rate that no line carries.
    #[error(
        "the device promises {hertz:.0} samples a second, more than any line carries; samples are taken as they come, and \
         its firmware had better state what it can do"
    )]
    ImpossibleRate {
        /// What it promises, samples a second.
        hertz: f64,
    },
    /// The servos were found at another speed than the one asked for.
    #[error("the servos answer at {found} baud, not at {asked}: give @{found} behind the port to begin there")]
    FoundAtBaud {
        /// What was asked for, bits a second.
        asked: u32,
        /// Where they are.
        found: u32,
    },
    /// A servo does not answer; the others go on.
    #[error(
        "servo {id} ({name}) does not answer; the others go on without it. Check its plug and its id; it is taken back \
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
    /// A servo is not the one that belongs there.
    #[error(
        "servo {id} ({name}) has model number {found}, this arm has {expected} there: {}",
        if *usable { "it counts the same way and is used" } else { "it counts differently and is left out; check --preset" }
    )]
    ServoModel {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
        /// The model number read.
        found: u16,
        /// The model number that the arm has there.
        expected: u16,
        /// Whether it can be used all the same.
        usable: bool,
    },
    /// Servos wait before they answer, which costs rate.
    #[error(
        "the servos wait up to {micros} us before each answer: {hertz_now:.0} readings a second are possible so, \
         {hertz_without:.0} without. Return delay is a setting in the servos' memory and is changed only with your \
         consent (--servo-return-delay-zero)"
    )]
    ReturnDelay {
        /// The longest of them, µs.
        micros: u32,
        /// Readings of all servos a second as it is.
        hertz_now: f64,
        /// Readings of all servos a second with delay 0.
        hertz_without: f64,
    },
    /// The adapter holds bytes back.
    #[error(
        "the USB adapter holds answers back for about {millis:.0} ms, which limits the rate to about {hertz:.0} a \
         second. FTDI adapters do that by default: as root, echo 1 > /sys/bus/usb-serial/devices/ttyUSB0/latency_timer \
         (with your port's name)"
    )]
    AdapterLatency {
        /// For how long, ms.
        millis: f64,
        /// Cycles a second at that.
        hertz: f64,
    },
    /// A servo still holds its position by force.
    #[error("servo {id} ({name}) could not be switched to free movement; cut its motor power before you bend it")]
    TorqueOn {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
    },
    /// The servos do not know the quicker way of reading.
    #[error("the servos do not answer {quick}; they are read by {instead}, which is slower but complete")]
    SlowerReads {
        /// The instruction they do not answer.
        quick: &'static str,
        /// What is used in its place.
        instead: &'static str,
    },
    /// A servo reports trouble of its own.
    #[error("servo {id} ({name}) reports {what}")]
    ServoComplains {
        /// Its number on the bus.
        id: u8,
        /// Its joint.
        name: String,
        /// What it reports.
        what: String,
    },
    /// A part that cannot show itself was asked to.
    #[error("{name} has no light to show itself with")]
    NoLight {
        /// Which part.
        name: String,
    },
}
