//! SMPTE timecode (ST 12-1): hours, minutes, seconds and frames.

use std::fmt;

use super::frame_rate::FrameRate;

const SECONDS_A_DAY: u64 = 24 * 3600;

/// The name of a frame at a rate that timecode exists for. Drop-frame timecode (29.97 and 59.94) leaves out the first
/// two or four numbers of each minute except every tenth, and so keeps up with the clock.
///
/// ```
/// use armature_take::{FrameRate, Timecode};
///
/// let rate: FrameRate = "29.97df".parse()?;
/// let start = Timecode::parse("00:00:59;28", rate)?;
/// assert_eq!(start.after(2).to_string(), "00:01:00;02");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timecode {
    rate: FrameRate,
    base: u32,
    /// Frames since 00:00:00:00, less than a day.
    frame: u64,
}

/// Why a text is not a timecode at a rate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not a timecode at {rate} frames a second: {why}")]
pub struct TimecodeError {
    /// The text given.
    pub text: String,
    /// The rate given.
    pub rate: String,
    /// What is wrong and what to write.
    pub why: String,
}

impl Timecode {
    /// Reads `HH:MM:SS:FF`, or `HH:MM:SS;FF` where numbers are dropped; at a rate that drops numbers, both are read so.
    pub fn parse(text: &str, rate: FrameRate) -> Result<Self, TimecodeError> {
        let error = |why: String| TimecodeError { text: text.to_owned(), rate: rate.to_string(), why };
        let base = rate.timecode_base().ok_or_else(|| error("timecode does not exist for this rate".into()))?;
        let fields: Vec<&str> = text.trim().split([':', ';']).collect();
        let number = |field: &&str| field.bytes().all(|b| b.is_ascii_digit()).then(|| field.parse::<u32>().ok())?;
        let numbers: Option<Vec<u32>> = fields.iter().map(number).collect();
        let Some(&[hours, minutes, seconds, frames]) = numbers.as_deref() else {
            return Err(error("write HH:MM:SS:FF".into()));
        };
        let drop_sign = text.rfind([':', ';']).is_some_and(|at| text.as_bytes()[at] == b';');
        if drop_sign && !rate.drops_numbers() {
            return Err(error("a semicolon means drop frame; write df behind the rate, or a colon".into()));
        }
        if hours > 23 || minutes > 59 || seconds > 59 || frames >= base {
            return Err(error(format!("the largest one is 23:59:59:{}", base - 1)));
        }
        let dropped = dropped_a_minute(rate, base);
        if seconds == 0 && !minutes.is_multiple_of(10) && frames < dropped {
            return Err(error(format!(
                "drop frame leaves out that number; the first one of this minute is {hours:02}:{minutes:02}:00;{dropped:02}"
            )));
        }
        let whole_minutes = u64::from(hours) * 60 + u64::from(minutes);
        let numbered = (whole_minutes * 60 + u64::from(seconds)) * u64::from(base) + u64::from(frames);
        let frame = numbered - u64::from(dropped) * (whole_minutes - whole_minutes / 10);
        Ok(Self { rate, base, frame })
    }

    /// 00:00:00:00; `None` for a rate that timecode does not exist for.
    pub fn zero(rate: FrameRate) -> Option<Self> {
        Some(Self { rate, base: rate.timecode_base()?, frame: 0 })
    }

    /// Frames since 00:00:00:00.
    pub fn frame(self) -> u64 {
        self.frame
    }

    /// The rate it counts at.
    pub fn rate(self) -> FrameRate {
        self.rate
    }

    /// The timecode of the frame that comes this many frames later; after a day it begins again.
    #[must_use]
    pub fn after(self, frames: u64) -> Self {
        let minutes = 24 * 60;
        let dropped = u64::from(dropped_a_minute(self.rate, self.base));
        let day = SECONDS_A_DAY * u64::from(self.base) - dropped * (minutes - minutes / 10);
        Self { frame: (self.frame + frames % day) % day, ..self }
    }

    /// Hours, minutes, seconds, frames.
    pub fn fields(self) -> [u64; 4] {
        let base = u64::from(self.base);
        let dropped = u64::from(dropped_a_minute(self.rate, self.base));
        let ten_minutes = 600 * base - 9 * dropped;
        let minute = 60 * base - dropped;
        let (tens, rest) = (self.frame / ten_minutes, self.frame % ten_minutes);
        // The first of ten minutes drops nothing.
        let later_minutes = if rest < 60 * base { 0 } else { (rest - 60 * base) / minute + 1 };
        let numbered = self.frame + dropped * (9 * tens + later_minutes);
        let seconds = numbered / base;
        [seconds / 3600, seconds / 60 % 60, seconds % 60, numbered % base]
    }
}

/// How many numbers are left out at the start of each minute except every tenth.
fn dropped_a_minute(rate: FrameRate, base: u32) -> u32 {
    if rate.drops_numbers() { base / 15 } else { 0 }
}

impl fmt::Display for Timecode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [hours, minutes, seconds, frames] = self.fields();
        let sign = if self.rate.drops_numbers() { ';' } else { ':' };
        let width = if self.base > 100 { 3 } else { 2 };
        write!(f, "{hours:02}:{minutes:02}:{seconds:02}{sign}{frames:0width$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str, rate: &str) -> Result<Timecode, TimecodeError> {
        Timecode::parse(text, rate.parse().unwrap())
    }

    /// The counter as ST 12-1 describes it: it steps, and jumps over the numbers that are left out.
    #[test]
    fn every_rate_is_counted_as_the_standard_says() {
        for name in ["23.976", "24", "25", "29.97", "29.97df", "30", "48", "50", "59.94", "59.94df", "60", "120"] {
            let rate: FrameRate = name.parse().unwrap();
            let base = u64::from(rate.timecode_base().unwrap());
            let dropped = if rate.drops_numbers() { base / 15 } else { 0 };
            let (zero, mut count, mut frame) = (Timecode::zero(rate).unwrap(), [0_u64; 4], 0_u64);
            let hours = if dropped > 0 { 24 } else { 2 };
            while count[0] < hours {
                assert_eq!(zero.after(frame).fields(), count, "{name}: frame {frame}");
                if count[2..] == [59, base - 1] || frame.is_multiple_of(997) {
                    let read = Timecode::parse(&zero.after(frame).to_string(), rate).unwrap();
                    assert_eq!(read.frame(), frame, "{name}");
                }
                count[3] += 1;
                for (place, most) in [(3, base), (2, 60), (1, 60)] {
                    if count[place] == most {
                        count[place] = 0;
                        count[place - 1] += 1;
                    }
                }
                if count[2..] == [0, 0] && !count[1].is_multiple_of(10) {
                    count[3] = dropped;
                }
                frame += 1;
            }
            assert_eq!(zero.after(frame * 24 / hours).frame(), 0, "{name}: a day is over");
        }
    }

    /// Numbers that the standard and its readers agree on.
    #[test]
    fn drop_frame_keeps_up_with_the_clock() {
        for (text, frame) in [("00:01:00;02", 1800), ("00:10:00;00", 17_982), ("01:00:00;00", 107_892)] {
            assert_eq!(at(text, "29.97df").unwrap().frame(), frame);
        }
        assert_eq!(at("01:00:00;00", "59.94df").unwrap().frame(), 215_784);
        assert_eq!(at("01:00:00:00", "29.97").unwrap().frame(), 108_000);
        assert_eq!(at("01:00:00:00", "120").unwrap().to_string(), "01:00:00:000");
    }

    #[test]
    fn what_is_no_timecode_is_refused_with_the_reason() {
        let wrong = [
            ("01:00:00", "24", "HH:MM:SS:FF"),
            ("01:00:00:24", "24", "23:59:59:23"),
            ("24:00:00:00", "25", "23:59:59:24"),
            ("00:60:00:00", "25", "23:59:59:24"),
            ("00:01:00;00", "29.97df", "00:01:00;02"),
            ("00:01:00;02", "29.97", "semicolon"),
            ("00:00:00:00", "12.5", "does not exist"),
            ("a:b:c:d", "24", "HH:MM:SS:FF"),
            ("-1:00:00:00", "24", "HH:MM:SS:FF"),
            ("99999999999:00:00:00", "24", "HH:MM:SS:FF"),
            ("", "24", "HH:MM:SS:FF"),
            (":::", "24", "HH:MM:SS:FF"),
        ];
        for (text, rate, why) in wrong {
            let error = at(text, rate).unwrap_err().to_string();
            assert!(error.contains(why), "{text} at {rate}: {error}");
        }
    }
}
