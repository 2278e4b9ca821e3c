//! One time line from a device clock that may start anew.

/// A clock that goes back further than this has started anew; less is a sample that came late.
const RESTART_STEP_MICROS: u64 = 1_000_000;

/// The device started anew in the middle of the take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockRestart {
    /// Time of the first sample afterwards, seconds since the take's first sample.
    pub at_seconds: f64,
    /// Time between it and the latest sample before.
    pub gap_seconds: f64,
    /// Whether the gap was measured by the host's clock. Otherwise nobody knows how long the device was away,
    /// and the gap is one sample period.
    pub measured: bool,
}

/// Places device times on one line that starts with the first one.
#[derive(Debug)]
pub(crate) struct DeviceClock {
    /// Assumed time between two samples where nothing better is known.
    period_micros: i64,
    run: Option<Run>,
    announced: bool,
    restarts: Vec<ClockRestart>,
}

/// The time from one start of the device to the next.
#[derive(Clone, Copy, Debug)]
struct Run {
    first_device_micros: u64,
    /// Where the run's first sample is on the line.
    start_micros: i64,
    latest_device_micros: u64,
    latest_host_seconds: Option<f64>,
}

impl Run {
    fn place(&self, device_micros: u64) -> i64 {
        let since = i128::from(device_micros) - i128::from(self.first_device_micros);
        let limit = i128::from(i64::MAX / 4);
        self.start_micros.saturating_add(since.clamp(-limit, limit) as i64)
    }
}

impl DeviceClock {
    pub(crate) fn new(nominal_samples_per_second: Option<f64>) -> Self {
        let period = nominal_samples_per_second.map_or(0.0, |rate| 1e6 / rate);
        // A rate that is no rate leaves the smallest step there is.
        let period_micros = if period.is_finite() { period.clamp(1.0, 60e6) as i64 } else { 1 };
        Self { period_micros, run: None, announced: false, restarts: Vec::new() }
    }

    /// The device was seen to start anew.
    pub(crate) fn announce_restart(&mut self) {
        self.announced = self.run.is_some();
    }

    /// Place of the next sample on the line, microseconds after the first one.
    pub(crate) fn sample(&mut self, device_micros: u64, host_seconds: Option<f64>) -> i64 {
        let host_seconds = host_seconds.filter(|seconds| seconds.is_finite());
        let run = match self.run {
            Some(run) if !self.announced && !goes_back(run, device_micros) => run,
            Some(run) => self.restart(run, device_micros, host_seconds),
            None => Run {
                first_device_micros: device_micros,
                start_micros: 0,
                latest_device_micros: device_micros,
                latest_host_seconds: None,
            },
        };
        self.announced = false;
        self.run = Some(Run {
            latest_device_micros: run.latest_device_micros.max(device_micros),
            latest_host_seconds: host_seconds.or(run.latest_host_seconds),
            ..run
        });
        run.place(device_micros)
    }

    /// Place of a device time that belongs to no sample at hand.
    pub(crate) fn place(&mut self, device_micros: u64) -> i64 {
        match self.run {
            Some(run) => run.place(device_micros),
            None => self.sample(device_micros, None),
        }
    }

    pub(crate) fn into_restarts(self) -> Vec<ClockRestart> {
        self.restarts
    }

    fn restart(&mut self, before: Run, device_micros: u64, host_seconds: Option<f64>) -> Run {
        let elapsed = host_seconds.zip(before.latest_host_seconds).map(|(now, then)| now - then);
        let measured = elapsed.filter(|seconds| *seconds > 0.0).map(|seconds| (seconds * 1e6).round() as i64);
        let gap_micros = measured.unwrap_or(self.period_micros).clamp(1, i64::MAX / 4);
        let start_micros = before.place(before.latest_device_micros).saturating_add(gap_micros);
        self.restarts.push(ClockRestart {
            at_seconds: start_micros as f64 * 1e-6,
            gap_seconds: gap_micros as f64 * 1e-6,
            measured: measured.is_some(),
        });
        Run {
            first_device_micros: device_micros,
            start_micros,
            latest_device_micros: device_micros,
            latest_host_seconds: host_seconds,
        }
    }
}

fn goes_back(run: Run, device_micros: u64) -> bool {
    run.latest_device_micros.saturating_sub(device_micros) > RESTART_STEP_MICROS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_samples_stay_at_their_own_time() {
        let mut clock = DeviceClock::new(Some(100.0));
        let places = [5_000_000, 5_020_000, 5_010_000, 4_990_000].map(|micros| clock.sample(micros, None));
        assert_eq!(places, [0, 20_000, 10_000, -10_000]);
        assert_eq!(clock.into_restarts(), []);
    }

    #[test]
    fn a_restart_is_measured_by_the_host_where_it_can() {
        let mut clock = DeviceClock::new(Some(100.0));
        clock.sample(9_000_000, Some(10.0));
        assert_eq!(clock.sample(400, Some(12.5)), 2_500_000);
        assert_eq!(clock.sample(10_400, None), 2_510_000);
        assert_eq!(clock.into_restarts(), [ClockRestart { at_seconds: 2.5, gap_seconds: 2.5, measured: true }]);
    }

    #[test]
    fn an_unmeasured_restart_takes_one_period_and_says_so() {
        let mut clock = DeviceClock::new(Some(100.0));
        clock.sample(9_000_000, None);
        assert_eq!(clock.sample(400, None), 10_000);
        assert!(!clock.into_restarts()[0].measured);
    }

    #[test]
    fn an_announced_restart_counts_even_if_the_clock_went_forward() {
        let mut clock = DeviceClock::new(Some(1000.0));
        clock.announce_restart();
        clock.sample(100, Some(1.0));
        clock.announce_restart();
        assert_eq!(clock.sample(5_000_000, Some(1.25)), 250_000);
    }

    #[test]
    fn clocks_from_hostile_files_saturate() {
        for rate in [None, Some(0.0), Some(-1.0), Some(f64::NAN), Some(f64::INFINITY)] {
            let mut clock = DeviceClock::new(rate);
            for micros in [0, u64::MAX, 0, u64::MAX, 1, u64::MAX, 2, u64::MAX] {
                clock.sample(micros, Some(f64::MAX));
                clock.sample(micros, Some(f64::NAN));
            }
        }
    }
}
