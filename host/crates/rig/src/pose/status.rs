//! How far the rotation of each bone can be trusted.

/// How far a bone's rotation can be trusted, worst first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum BoneQuality {
    /// No part drives the bone; it is in the rest pose.
    #[default]
    Unmapped,
    /// The part that drives it is not plugged in; the bone keeps its last rotation.
    Absent,
    /// A sensor was never zeroed and is assumed to be in the rest pose.
    Unzeroed,
    /// A sensor has not had a usable reading yet and is assumed to be in the rest pose.
    NoReading,
    /// A sensor has had no good reading for longer than its filter's patience; its last good one is used.
    Stale,
    /// A sensor has no good reading now; its last good one is used.
    Held,
    /// A sensor reports a weak magnet; its reading is used.
    Weak,
    /// All sensors are good.
    Live,
}

/// The state of one bone after the latest sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoneStatus {
    /// The worst state of its sensors.
    pub quality: BoneQuality,
    /// How many samples in a row the stalest of its sensors has had no usable reading.
    pub held_samples: u32,
}
