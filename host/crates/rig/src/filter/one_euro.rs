//! The One Euro filter of Casiez, Roussel and Vogel, *1€ Filter: A Simple Speed-based Low-pass Filter for Noisy Input
//! in Interactive Systems* (CHI 2012): a first-order low-pass filter whose cutoff grows with the speed. Here it works
//! on the sensor's rotation in radians, so that crossing count zero is no jump, and on the device's own clock, so that
//! lost samples and a different rate have no effect on it.

use std::f64::consts::{PI, TAU};

/// A gap in the readings after which a filter starts over.
const FORGET_SECONDS: f64 = 0.5;

/// Settings of the One Euro filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneEuro {
    /// Cutoff at rest, Hz. Lower is calmer.
    pub min_cutoff: f64,
    /// How the cutoff grows with the speed, Hz per radian per second. Higher lags less in motion.
    pub beta: f64,
    /// Cutoff for the speed itself, Hz.
    pub speed_cutoff: f64,
}

impl Default for OneEuro {
    /// Tuned for a hand-held puppet at 200 Hz with one count of noise at 14 bits: a lag of 80 ms at rest, where it does
    /// not show, 22 ms at 1 rad/s and 13 ms at 3 rad/s.
    fn default() -> Self {
        Self { min_cutoff: 2.0, beta: 1.0, speed_cutoff: 1.0 }
    }
}

impl OneEuro {
    /// How far the smoothed angle lags behind one turning at constant speed (radians per second), seconds, if readings
    /// come every `period` seconds.
    ///
    /// An exponential average with share α of the new value follows a ramp (1-α)/α periods late, which with the paper's
    /// α = 1/(1 + τ/T) is τ = 1/(2π·cutoff). The paper measures the speed from the last *smoothed* value, which itself
    /// lags, so the cutoff is `min_cutoff` + β·speed·(1 + lag/T): a quadratic equation in the lag.
    pub fn lag_seconds(&self, speed: f64, period: f64) -> f64 {
        let growth = self.beta * speed.abs();
        let (a, b) = (growth / period, self.min_cutoff + growth);
        // The form of the root that is also right for a = 0.
        (2.0 / TAU) / (b + libm::sqrt(b * b + 4.0 * a / TAU))
    }
}

/// One sensor's One Euro filter.
///
/// It stores how far the smoothed angle is ahead of the reading rather than the angle itself, so that nothing grows
/// with the number of turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Smoother {
    state: Option<Smoothed>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Smoothed {
    reading: f64,
    /// Smoothed angle minus reading.
    ahead: f64,
    /// Radians per second, smoothed.
    speed: f64,
    micros: u64,
    /// The time between the last two readings; used when the clock shows none.
    period: f64,
    lag: f64,
}

impl Smoother {
    /// Takes a reading (radians, off by any number of whole turns) at this device time; returns the smoothed angle.
    pub(crate) fn step(&mut self, settings: &OneEuro, reading: f64, micros: u64) -> f64 {
        let Some(last) = self.state else { return self.begin(reading, micros) };
        let elapsed = micros.checked_sub(last.micros).map_or(0.0, |micros| micros as f64 * 1e-6);
        let period = if elapsed > 0.0 { elapsed } else { last.period };
        if period > FORGET_SECONDS || period <= 0.0 {
            return self.begin(reading, micros);
        }
        // The reading as seen from the last smoothed angle.
        let away = shortest(reading - last.reading) - last.ahead;
        let speed = last.speed + share(settings.speed_cutoff, period) * (away / period - last.speed);
        let kept = 1.0 - share(settings.min_cutoff + settings.beta * speed.abs(), period);
        let ahead = -kept * away;
        let lag = period * kept / (1.0 - kept);
        self.state = Some(Smoothed { reading, ahead, speed, micros, period, lag });
        reading + ahead
    }

    fn begin(&mut self, reading: f64, micros: u64) -> f64 {
        let period = self.state.map_or(0.0, |last| last.period);
        // Nothing is known about the period before the second reading; with any positive one, that reading is taken as
        // it is.
        let period = if period > 0.0 { period } else { 1e-3 };
        self.state = Some(Smoothed { reading, ahead: 0.0, speed: 0.0, micros, period, lag: 0.0 });
        reading
    }

    /// The smoothed angle of the latest reading, radians; `None` before the first.
    pub(crate) fn turn(&self) -> Option<f64> {
        self.state.map(|state| state.reading + state.ahead)
    }

    /// Its lag at the current speed, seconds.
    pub(crate) fn lag_seconds(&self) -> f64 {
        self.state.map_or(0.0, |state| state.lag)
    }
}

/// The share of a new value in the average: α in the paper.
fn share(cutoff: f64, period: f64) -> f64 {
    1.0 / (1.0 + 1.0 / (TAU * cutoff * period))
}

/// A difference of angles wrapped into [-π, π).
fn shortest(turn: f64) -> f64 {
    turn - TAU * libm::floor((turn + PI) / TAU)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A synthetic clock: 50 samples at uneven times of a rotation that speeds up, stops and goes back.
    fn uneven() -> Vec<(u64, f64)> {
        let mut micros = 1_000_000;
        (0..50_u64)
            .map(|step| {
                micros += 4_000 + (step * step * 7) % 3_000;
                let t = micros as f64 * 1e-6;
                (micros, 1.2 * libm::sin(3.0 * t) + 0.01 * libm::cos(91.0 * step as f64))
            })
            .collect()
    }

    /// Values from the authors' own `OneEuroFilter` 0.2.1 (Python Package Index), with these settings and times.
    #[test]
    fn agrees_with_the_authors_own_program() {
        for (settings, expected) in REFERENCE {
            let mut smoother = Smoother::default();
            for (index, (micros, turn)) in uneven().into_iter().enumerate() {
                let got = smoother.step(&settings, turn, micros);
                if let Some(&(_, wanted)) = expected.iter().find(|(at, _)| *at == index) {
                    assert!((got - wanted).abs() < 1e-12, "{settings:?}, sample {index}: {got}, reference {wanted}");
                }
            }
        }
    }

    #[test]
    fn the_lag_told_is_the_lag_there_is() {
        for (settings, rate, speed) in [
            (OneEuro::default(), 200.0, 1.0),
            (OneEuro::default(), 1_000.0, 3.0),
            (OneEuro { min_cutoff: 1.0, beta: 0.0, speed_cutoff: 1.0 }, 120.0, 2.0),
            (OneEuro { min_cutoff: 8.0, beta: 0.5, speed_cutoff: 2.0 }, 60.0, -4.0),
        ] {
            let mut smoother = Smoother::default();
            let mut behind = 0.0;
            for step in 0..(5.0 * rate) as u64 {
                let seconds = step as f64 / rate;
                let turn = speed * seconds;
                behind = turn - smoother.step(&settings, turn, (seconds * 1e6).round() as u64);
            }
            let (measured, told) = (behind / speed, smoother.lag_seconds());
            assert!((measured - told).abs() < 2e-5, "{measured} s measured, {told} s told");
            assert!(
                (told - settings.lag_seconds(speed, 1.0 / rate)).abs() < 0.02 * told,
                "{told} told, {} by formula",
                settings.lag_seconds(speed, 1.0 / rate)
            );
        }
    }

    #[test]
    fn a_pause_and_a_clock_that_stands_or_goes_back_do_no_harm() {
        let settings = OneEuro::default();
        let mut smoother = Smoother::default();
        smoother.step(&settings, 0.0, 1_000_000);
        smoother.step(&settings, 0.1, 1_005_000);
        let standing = smoother.step(&settings, 0.2, 1_005_000);
        assert!((0.0..0.2).contains(&standing));
        let back = smoother.step(&settings, 0.2, 7);
        assert!((0.0..=0.2).contains(&back));
        assert_eq!(smoother.step(&settings, 2.0, 900_000), 2.0, "after a pause it starts over");
    }

    proptest! {
        /// The filter sees angles, not counts: where the count starts and how often it has wrapped changes nothing.
        #[test]
        fn a_turn_across_the_wrap_is_no_jump(start in 0.0_f64..TAU, steps in prop::collection::vec(-1.0_f64..1.0, 1..60)) {
            let settings = OneEuro::default();
            let (mut unwrapped, mut wrapped_one) = (Smoother::default(), Smoother::default());
            let (mut turn, mut micros) = (0.0, 0);
            for step in steps {
                turn += step;
                micros += 5_000;
                let a = unwrapped.step(&settings, turn, micros);
                let b = wrapped_one.step(&settings, (turn + start).rem_euclid(TAU), micros);
                prop_assert!(shortest(b - start - a).abs() < 1e-9);
            }
        }
    }

    /// What the authors' own program returns for some of the samples of `uneven`.
    const REFERENCE: [(OneEuro, [(usize, f64); 6]); 3] = [
        (
            OneEuro { min_cutoff: 1.0, beta: 0.0, speed_cutoff: 1.0 },
            [
                (0, 0.165_076_267_237_353),
                (1, 0.164_234_925_783_322),
                (2, 0.163_541_083_484_681),
                (10, 0.142_356_623_944_808),
                (30, -0.040_524_436_495_300),
                (49, -0.297_658_458_980_947),
            ],
        ),
        (
            OneEuro { min_cutoff: 2.0, beta: 2.0, speed_cutoff: 1.0 },
            [
                (0, 0.165_076_267_237_353),
                (1, 0.163_108_880_403_076),
                (2, 0.161_358_899_692_577),
                (10, 0.070_485_159_409_199),
                (30, -0.357_197_351_143_415),
                (49, -0.692_909_134_311_866),
            ],
        ),
        (
            OneEuro { min_cutoff: 0.5, beta: 7.5, speed_cutoff: 3.0 },
            [
                (0, 0.165_076_267_237_353),
                (1, 0.161_243_727_975_912),
                (2, 0.157_020_727_657_639),
                (10, 0.019_992_470_779_684),
                (30, -0.379_605_879_393_033),
                (49, -0.708_697_049_223_367),
            ],
        ),
    ];
}
