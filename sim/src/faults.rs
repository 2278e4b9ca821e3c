//! What can go wrong, and how often it did.

/// Faults to emulate. Times are in microseconds since the emulation's first step; all chances are drawn from the seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Chance that one bit of a sent byte is flipped.
    pub bit_flip: f64,
    /// Chance that a sent byte is lost.
    pub byte_drop: f64,
    /// Chance that a sent byte arrives twice.
    pub byte_duplicate: f64,
    /// Periods in which the line carries noise instead of everything sent.
    pub noise: Vec<NoiseBurst>,
    /// Sensors that misbehave for a while.
    pub sensors: Vec<SensorFault>,
    /// Chance for each reading of each sensor to be a wild value, marked as an outlier.
    pub outlier: f64,
    /// Chance for each reading of each sensor to be a wild value that is *not* marked.
    pub hidden_outlier: f64,
    /// Parts that are pulled out, with everything attached to them.
    pub unplugged: Vec<Unplugging>,
    /// How much too fast the device's clock runs, parts per million.
    pub clock_drift_ppm: f64,
    /// What the device's clock does wrong.
    pub clock: Vec<ClockFault>,
    /// When the device loses power and restarts.
    pub restarts: Vec<u64>,
}

/// A clock that shows a wrong time for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockFault {
    /// When it begins.
    pub at_micros: u64,
    /// For how long; `None`: until the end.
    pub for_micros: Option<u64>,
    /// What it does.
    pub kind: ClockFaultKind,
}

/// How a clock is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockFaultKind {
    /// It shows this many microseconds more, or less.
    Steps(i64),
    /// It shows the same time all the while.
    Stands,
}

/// A period in which the line carries noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseBurst {
    /// When it begins.
    pub start_micros: u64,
    /// How long it lasts.
    pub duration_micros: u64,
}

/// A sensor that misbehaves for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorFault {
    /// The sensor, numbered over the whole puppet ([`Body::sensors`](crate::Body::sensors)).
    pub sensor: usize,
    /// How.
    pub kind: SensorFaultKind,
    /// When it begins.
    pub start_micros: u64,
    /// How long it lasts.
    pub duration_micros: u64,
}

/// How a sensor misbehaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorFaultKind {
    /// Its count freezes but claims to be good.
    Stuck,
    /// It does not answer.
    NoData,
    /// Its magnet is weak: the count is noisy and says so.
    MagnetWeak,
}

/// A part that is pulled out for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unplugging {
    /// The part.
    pub part: usize,
    /// When it is pulled out.
    pub at_micros: u64,
    /// How long until it is plugged in again, in the same place; `None` for never.
    pub for_micros: Option<u64>,
}

/// The truth about everything sent since the emulation's first step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Truth {
    /// Frames of all kinds put on the line.
    pub frames_sent: u64,
    /// Frames that no receiver can recover between the right delimiters.
    pub frames_damaged: u64,
    /// Samples taken, whether sent or not: the sequence numbers used.
    pub samples_taken: u64,
    /// Samples put on the line; part of `frames_sent`.
    pub samples_sent: u64,
    /// Samples among `frames_damaged`.
    pub samples_damaged: u64,
    /// Samples taken but not sent because too much time had passed since the previous step.
    pub samples_skipped: u64,
    /// Bytes with a flipped bit.
    pub bits_flipped: u64,
    /// Bytes lost.
    pub bytes_dropped: u64,
    /// Bytes that arrived twice.
    pub bytes_duplicated: u64,
    /// Bytes of noise.
    pub noise_bytes: u64,
    /// Readings marked as outliers.
    pub outliers: u64,
    /// Wild readings that were not marked.
    pub hidden_outliers: u64,
    /// Readings of stuck sensors.
    pub stuck_readings: u64,
    /// Readings of sensors that did not answer.
    pub missing_readings: u64,
    /// Readings with a weak magnet.
    pub weak_readings: u64,
    /// Times a part was pulled out or plugged in again.
    pub topology_changes: u64,
    /// Times the device restarted.
    pub restarts: u64,
    /// Requests understood.
    pub requests: u64,
    /// Requests refused.
    pub requests_refused: u64,
}
