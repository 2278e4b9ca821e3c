//! The puppet's sensor readings at one moment, before calibration.

/// What a sensor says about its own reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SensorState {
    /// The count is good.
    Ok,
    /// There is no count (the part is not answering); the number beside it means nothing.
    #[default]
    NoData,
    /// The magnet is too weak or too far away; the count is a guess.
    MagnetWeak,
    /// The device itself distrusts this count.
    Outlier,
}

/// One reading of every sensor, in the joint tree's sensor order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RawSample {
    /// The device's own clock, microseconds.
    pub device_micros: u64,
    /// The device's sequence number; a gap is a loss.
    pub sequence: u32,
    /// Which topology the sensors are numbered by.
    pub epoch: u16,
    /// Raw counts.
    pub counts: Vec<u16>,
    /// One state per count.
    pub states: Vec<SensorState>,
}
