//! Which filter, and its settings in text form.

use std::fmt;
use std::str::FromStr;

use super::one_euro::OneEuro;

/// What is done to the readings of a joint's sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Filter {
    /// Nothing: a good reading is used immediately and unchanged; without one, the last good one stays.
    #[default]
    None,
    /// Smoothed, less the faster it moves.
    OneEuro(OneEuro),
    /// Unchanged; but a joint without a good reading for longer than this is marked as stale, and comes back gradually
    /// instead of with a jump.
    Hold {
        /// How many seconds the last good reading may be used instead.
        patience_seconds: f64,
    },
}

/// How long readings may be missing before `hold` marks a joint as stale, by default.
pub const DEFAULT_PATIENCE_SECONDS: f64 = 0.25;

impl Filter {
    /// The lag at a constant angular speed (radians per second), seconds, if readings come every `period` seconds.
    ///
    /// ```
    /// use armature_rig::Filter;
    ///
    /// let filter: Filter = "one-euro:2,1".parse()?;
    /// let millis = filter.lag_seconds(1.0, 0.005) * 1e3;
    /// assert!((millis - 22.0).abs() < 1.0, "at 1 rad/s and 200 Hz: {millis}");
    /// # Ok::<(), armature_rig::FilterError>(())
    /// ```
    pub fn lag_seconds(&self, speed: f64, period: f64) -> f64 {
        match self {
            Self::OneEuro(settings) => settings.lag_seconds(speed, period),
            Self::None | Self::Hold { .. } => 0.0,
        }
    }

    /// The first impossible setting, if there is one.
    pub fn problem(&self) -> Option<&'static str> {
        let positive = |value: f64| value.is_finite() && value > 0.0 && value <= 1e6;
        match *self {
            Self::OneEuro(OneEuro { min_cutoff, speed_cutoff, .. })
                if !positive(min_cutoff) || !positive(speed_cutoff) =>
            {
                Some("a cutoff must be a number of Hz above 0")
            }
            Self::OneEuro(OneEuro { beta, .. }) if !(beta.is_finite() && (0.0..=1e6).contains(&beta)) => {
                Some("beta must be 0 or more")
            }
            Self::Hold { patience_seconds }
                if !(patience_seconds.is_finite() && (0.0..=3_600.0).contains(&patience_seconds)) =>
            {
                Some("the patience must be 0 to 3600000 ms")
            }
            _ => None,
        }
    }
}

impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::OneEuro(OneEuro { min_cutoff, beta, speed_cutoff }) => {
                write!(f, "one-euro:{min_cutoff},{beta},{speed_cutoff}")
            }
            Self::Hold { patience_seconds } => write!(f, "hold:{}", patience_seconds * 1e3),
        }
    }
}

/// Why a text is not a filter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not a filter ({why}); write none, one-euro, one-euro:MIN_CUTOFF_HZ,BETA or hold:MILLISECONDS")]
pub struct FilterError {
    /// The text given.
    pub text: String,
    /// What is wrong with it.
    pub why: &'static str,
}

impl FromStr for Filter {
    type Err = FilterError;

    fn from_str(text: &str) -> Result<Self, FilterError> {
        let error = |why| FilterError { text: text.to_owned(), why };
        let (name, numbers) = text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        let numbers: Vec<f64> = numbers
            .map(|list| list.split(',').map(|number| number.trim().parse()).collect::<Result<_, _>>())
            .transpose()
            .map_err(|_| error("the colon must be followed by numbers separated by commas"))?
            .unwrap_or_default();
        let filter = match (name, numbers.as_slice()) {
            ("none", []) => Self::None,
            ("one-euro", []) => Self::OneEuro(OneEuro::default()),
            ("one-euro", &[min_cutoff, beta]) => Self::OneEuro(OneEuro { min_cutoff, beta, ..OneEuro::default() }),
            ("one-euro", &[min_cutoff, beta, speed_cutoff]) => {
                Self::OneEuro(OneEuro { min_cutoff, beta, speed_cutoff })
            }
            ("hold", []) => Self::Hold { patience_seconds: DEFAULT_PATIENCE_SECONDS },
            ("hold", &[millis]) => Self::Hold { patience_seconds: millis * 1e-3 },
            ("none" | "one-euro" | "hold", _) => return Err(error("wrong number of settings")),
            _ => return Err(error("there is no filter of that name")),
        };
        filter.problem().map_or(Ok(filter), |why| Err(error(why)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_come_back() {
        for text in ["none", "one-euro:1.5,0.25,1", "hold:250"] {
            assert_eq!(text.parse::<Filter>().unwrap().to_string(), text);
        }
        assert_eq!("one-euro".parse(), Ok(Filter::OneEuro(OneEuro::default())));
        assert_eq!(
            "one-euro:3,1".parse(),
            Ok(Filter::OneEuro(OneEuro { min_cutoff: 3.0, beta: 1.0, speed_cutoff: 1.0 }))
        );
        assert_eq!("hold".parse(), Ok(Filter::Hold { patience_seconds: 0.25 }));
        for wrong in [
            "",
            "kalman",
            "one-euro:0,1",
            "one-euro:1",
            "one-euro:nan,1",
            "one-euro:1,-1",
            "hold:-1",
            "none:1",
            "hold:x",
        ] {
            let error = wrong.parse::<Filter>().unwrap_err();
            assert!(error.to_string().contains("one-euro"), "{error}");
        }
    }
}
