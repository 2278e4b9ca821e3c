//! Frame rates as they are: fractions.

use std::fmt;
use std::str::FromStr;

/// A frame rate as an exact fraction: film and video run at 24000/1001 or 30000/1001, which no decimal number states.
///
/// ```
/// use armature_take::FrameRate;
///
/// let rate: FrameRate = "29.97df".parse()?;
/// assert_eq!((rate.fraction(), rate.drops_numbers()), ((30_000, 1001), true));
/// assert_eq!("23.976".parse::<FrameRate>()?.fraction(), (24_000, 1001));
/// assert_eq!("29.476".parse::<FrameRate>()?.fraction(), (7369, 250));
/// # Ok::<(), armature_take::FrameRateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRate {
    frames: u32,
    seconds: u32,
    drops: bool,
}

/// Why a text is not a frame rate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{text:?} is not a frame rate ({why}); give 23.976, 24, 25, 29.97, 29.97df, 30, 48, 50, 59.94, 59.94df, 60, 120, \
     another number from 1 to 4000, or a fraction such as 24000/1001"
)]
pub struct FrameRateError {
    /// The text given.
    pub text: String,
    /// What is wrong with it.
    pub why: &'static str,
}

/// Slowest and fastest rate, frames a second.
const RANGE: std::ops::RangeInclusive<f64> = 1.0..=4000.0;

/// What people write for rates that are 1000/1001 of a whole number, and that number.
const BROADCAST: [(&str, u32); 6] =
    [("23.976", 24), ("23.98", 24), ("29.97", 30), ("47.952", 48), ("59.94", 60), ("119.88", 120)];

impl FrameRate {
    /// A whole number of frames a second; `None` outside 1 to 4000.
    pub fn whole(frames_per_second: u32) -> Option<Self> {
        Self::new(frames_per_second, 1)
    }

    /// `frames` in `seconds`; `None` outside 1 to 4000 frames a second.
    pub fn new(frames: u32, seconds: u32) -> Option<Self> {
        if seconds == 0 || !RANGE.contains(&(f64::from(frames) / f64::from(seconds))) {
            return None;
        }
        let divisor = greatest_common_divisor(frames, seconds);
        Some(Self { frames: frames / divisor, seconds: seconds / divisor, drops: false })
    }

    /// The fraction in lowest terms: this many frames in this many seconds.
    pub fn fraction(self) -> (u32, u32) {
        (self.frames, self.seconds)
    }

    /// Frames per second, to the last bit of a double.
    pub fn frames_per_second(self) -> f64 {
        f64::from(self.frames) / f64::from(self.seconds)
    }

    /// Whether timecode of this rate leaves out numbers (drop frame), so that it keeps up with the clock.
    pub fn drops_numbers(self) -> bool {
        self.drops
    }

    /// How many frames timecode counts to a second; `None` for a rate that timecode does not exist for.
    pub fn timecode_base(self) -> Option<u32> {
        let whole = self.frames.div_ceil(self.seconds);
        let broadcast = u64::from(self.frames) * 1001 == u64::from(self.seconds) * u64::from(whole) * 1000;
        (self.seconds == 1 || broadcast).then_some(whole)
    }

    /// The same rate whose timecode leaves out numbers; `None` except for 29.97 and 59.94.
    fn dropping(self) -> Option<Self> {
        let can = matches!(self.fraction(), (30_000 | 60_000, 1001));
        can.then_some(Self { drops: true, ..self })
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let drop = if self.drops { " drop frame" } else { "" };
        let broadcast = BROADCAST.iter().find(|(_, whole)| self.seconds == 1001 && self.frames == whole * 1000);
        match (broadcast, self.seconds) {
            (Some((name, _)), _) => write!(f, "{name}{drop} ({}/{})", self.frames, self.seconds),
            (None, 1) => write!(f, "{}", self.frames),
            (None, _) => write!(f, "{}", self.frames_per_second()),
        }
    }
}

impl FromStr for FrameRate {
    type Err = FrameRateError;

    fn from_str(text: &str) -> Result<Self, FrameRateError> {
        let error = |why| FrameRateError { text: text.to_owned(), why };
        let out_of_range = || error("it must be 1 to 4000 frames a second");
        let lower = text.trim().to_ascii_lowercase();
        let (number, suffix) = match lower.find(|c: char| c.is_ascii_alphabetic() && c != 'e') {
            Some(at) => lower.split_at(at),
            None => (lower.as_str(), ""),
        };
        let rate = if let Some((_, whole)) = BROADCAST.iter().find(|(name, _)| *name == number) {
            Self::new(whole * 1000, 1001).ok_or_else(out_of_range)?
        } else if let Some((frames, seconds)) = number.split_once('/') {
            let whole =
                |part: &str| part.trim().parse::<u32>().map_err(|_| error("a fraction is of two whole numbers"));
            Self::new(whole(frames)?, whole(seconds)?).ok_or_else(out_of_range)?
        } else {
            let value: f64 = number.trim().parse().map_err(|_| error("it is not a number"))?;
            if !RANGE.contains(&value) {
                return Err(out_of_range());
            }
            decimal(number.trim()).ok_or_else(|| error("it has too many digits; give a fraction"))?
        };
        match suffix {
            "" | "ndf" => Ok(rate),
            "df" => rate.dropping().ok_or_else(|| error("only 29.97 and 59.94 have drop frame")),
            _ => Err(error("only df or ndf may follow the number")),
        }
    }
}

/// A plain decimal number as a fraction.
fn decimal(text: &str) -> Option<FrameRate> {
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    let part = part.trim_end_matches('0');
    let seconds = 10_u32.checked_pow(u32::try_from(part.len()).ok()?)?;
    let frames = format!("{}{part}", whole.trim_start_matches('+')).parse().ok()?;
    FrameRate::new(frames, seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rate(text: &str) -> FrameRate {
        text.parse().unwrap()
    }

    #[test]
    fn the_rates_of_film_and_video_are_exact() {
        let expected = [
            ("23.976", (24_000, 1001), Some(24)),
            ("24", (24, 1), Some(24)),
            ("25", (25, 1), Some(25)),
            ("29.97", (30_000, 1001), Some(30)),
            ("30", (30, 1), Some(30)),
            ("48", (48, 1), Some(48)),
            ("50", (50, 1), Some(50)),
            ("59.94", (60_000, 1001), Some(60)),
            ("60.0", (60, 1), Some(60)),
            ("120", (120, 1), Some(120)),
            ("30000/1001", (30_000, 1001), Some(30)),
            ("29.476", (7369, 250), None),
            ("12.5", (25, 2), None),
        ];
        for (text, fraction, base) in expected {
            assert_eq!((rate(text).fraction(), rate(text).timecode_base()), (fraction, base), "{text}");
        }
        assert!(rate("29.97df").drops_numbers() && rate("59.94DF").drops_numbers());
        assert!(!rate("29.97ndf").drops_numbers());
        assert_eq!(rate("29.97df").to_string(), "29.97 drop frame (30000/1001)");
        assert_eq!((rate("24").to_string(), rate("12.5").to_string()), ("24".into(), "12.5".into()));
    }

    #[test]
    fn decimals_have_the_bits_of_the_number() {
        for text in ["1", "24", "30", "33.3", "29.476", "100", "119.5", "4000"] {
            assert_eq!(rate(text).frames_per_second().to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
        }
    }

    #[test]
    fn what_is_no_rate_is_refused() {
        let wrong = [
            "",
            "x",
            "0",
            "-24",
            "0.5",
            "4001",
            "NaN",
            "inf",
            "1e3",
            "24df",
            "24x",
            "30/0",
            "1/2",
            "30/1.5",
            "/",
            "df",
            "99999999999999999999",
            "1.00000000000000001",
            "24/",
            "2 4",
        ];
        for text in wrong {
            assert!(text.parse::<FrameRate>().is_err(), "{text:?}");
        }
    }
}
