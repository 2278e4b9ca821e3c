//! How long after a sample's last byte the character is posed and skinned.

use std::time::Duration;

use hdrhistogram::Histogram;

/// Significant digits of a latency that are kept.
const DIGITS: u8 = 3;
/// A longer latency counts as this.
const LONGEST: Duration = Duration::from_mins(1);

/// Collected latencies, in a quarter of a megabyte however long the run.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    /// Nanoseconds; made by the first latency.
    nanos: Option<Histogram<u64>>,
}

/// Percentiles of latencies, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatencySummary {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

impl Latencies {
    /// Adds one.
    pub fn add(&mut self, latency: Duration) {
        if self.nanos.is_none() {
            // Only bounds that contradict each other are refused.
            self.nanos = Histogram::new_with_max(LONGEST.as_nanos() as u64, DIGITS).ok();
        }
        if let Some(nanos) = &mut self.nanos {
            nanos.saturating_record(latency.min(LONGEST).as_nanos() as u64);
        }
    }

    /// Like [`summary`](Self::summary), but `None` if nothing was added.
    pub fn measured(&self) -> Option<LatencySummary> {
        self.nanos.is_some().then(|| self.summary())
    }

    /// Percentiles of everything added, to three digits; zero if nothing was.
    pub fn summary(&self) -> LatencySummary {
        let at = |fraction| self.nanos.as_ref().map_or(0.0, |nanos| nanos.value_at_quantile(fraction) as f64 / 1e3);
        LatencySummary { p50: at(0.5), p99: at(0.99), max: at(1.0) }
    }
}

/// The value that `fraction` of the sorted values do not exceed; NaN without values.
pub fn percentile(sorted: &[f64], fraction: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((fraction * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

impl std::fmt::Display for LatencySummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let millis = |micros: f64| micros / 1000.0;
        write!(f, "p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms", millis(self.p50), millis(self.p99), millis(self.max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_a_known_list() {
        let mut latencies = Latencies::default();
        (0..=100).rev().for_each(|micros| latencies.add(Duration::from_micros(micros)));
        let summary = latencies.summary();
        let is = |value: f64, wanted: f64| (value / wanted - 1.0).abs() < 1e-3;
        assert!(is(summary.p50, 50.0) && is(summary.p99, 99.0) && is(summary.max, 100.0), "{summary:?}");
        assert_eq!(Latencies::default().summary(), LatencySummary::default());
        assert!(percentile(&[], 0.5).is_nan());
    }

    #[test]
    fn an_hour_takes_no_more_memory_than_a_moment() {
        let mut latencies = Latencies::default();
        latencies.add(Duration::from_micros(300));
        let places = |latencies: &Latencies| latencies.nanos.as_ref().map(Histogram::distinct_values);
        let at_first = places(&latencies);
        // An hour at 1,000 Hz, with stalls longer than any that is told apart.
        for sample in 0..3_600_000_u64 {
            latencies.add(Duration::from_micros(200 + sample % 1_000));
        }
        latencies.add(Duration::MAX);
        assert_eq!(places(&latencies), at_first);
        assert!(at_first.is_some_and(|places| places * size_of::<u64>() < 300_000), "{at_first:?}");
        assert!((latencies.summary().max / 60e6 - 1.0).abs() < 1e-3, "{:?}", latencies.summary());
    }
}
