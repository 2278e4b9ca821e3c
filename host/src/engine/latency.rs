//! How long after a sample's last byte the character is posed and skinned.

/// Collected latencies.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    micros: Vec<f64>,
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
    pub fn add(&mut self, latency: std::time::Duration) {
        self.micros.push(latency.as_secs_f64() * 1e6);
    }

    /// Percentiles of all that were added; zero without any.
    pub fn summary(&self) -> LatencySummary {
        let mut sorted = self.micros.clone();
        sorted.sort_by(f64::total_cmp);
        let at = |fraction| if sorted.is_empty() { 0.0 } else { percentile(&sorted, fraction) };
        LatencySummary { p50: at(0.5), p99: at(0.99), max: at(1.0) }
    }

    /// Forgets all but the newest `count`.
    pub fn keep_newest(&mut self, count: usize) {
        let surplus = self.micros.len().saturating_sub(count);
        self.micros.drain(..surplus);
    }
}

/// The value below which `fraction` of the sorted values lie; NaN without values.
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
    use std::time::Duration;

    #[test]
    fn percentiles_of_a_known_list() {
        let mut latencies = Latencies::default();
        (0..=100).rev().for_each(|micros| latencies.add(Duration::from_micros(micros)));
        let summary = latencies.summary();
        assert!((summary.p50 - 50.0).abs() < 1e-6 && (summary.p99 - 99.0).abs() < 1e-6);
        latencies.keep_newest(1);
        assert!(latencies.summary().max.abs() < 1e-6);
        assert_eq!(Latencies::default().summary(), LatencySummary::default());
        assert!(percentile(&[], 0.5).is_nan());
    }
}
