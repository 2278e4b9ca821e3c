//! How a take is played, and what can be asked for. The window and the engine share these words.

/// Slowest and fastest speed.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.05..=8.0;

/// How a take is being played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Where the playhead is, seconds on the clock of the edited take.
    pub seconds: f64,
    /// Whether it moves.
    pub playing: bool,
    /// How fast: 1 is as recorded.
    pub speed: f64,
    /// Whether it begins again at the end.
    pub looping: bool,
    /// In and out point; without them, the whole take.
    pub range: Option<(f64, f64)>,
}

impl Default for Playback {
    fn default() -> Self {
        Self { seconds: 0.0, playing: false, speed: 1.0, looping: true, range: None }
    }
}

/// What is asked of a player.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Play {
    /// Go on; at the end, from the start.
    Start,
    /// Stand still.
    Pause,
    /// Go to a moment, seconds.
    Seek(f64),
    /// Go to the next pose, or the one before, and stand still.
    Step {
        /// Whether to the next one.
        forward: bool,
    },
    /// How fast.
    Speed(f64),
    /// Whether to begin again at the end.
    Loop(bool),
    /// In and out point.
    Range(Option<(f64, f64)>),
}
