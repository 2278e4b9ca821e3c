//! What a take's measurement is worth: rate, jitter, losses, lag, and how its clock went.

use std::fmt;

use armature_rig::{Calibration, Filter, PartUid};

use crate::file::{EventKind, Record, Take};
use crate::summary::{Summary, summarize};
use crate::time::{ClockFaults, DeviceClock, HeldGap};

/// Speeds at which the lag of a filter is stated, radians a second.
pub const LAG_AT_SPEEDS: [f64; 2] = [0.5, 3.0];

/// A longer time between two samples is a gap, seconds.
const GAP_SECONDS: f64 = 0.1;

/// Fewer arrival times, or a shorter time, say nothing of a clock.
const FEWEST_ARRIVALS: usize = 100;
const SHORTEST_ARRIVALS: f64 = 1.0;

/// More missing numbers in a row are a restart of the numbering.
const MOST_MISSING: u32 = 1 << 24;

/// The receipt of a take, from its samples and events.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receipt {
    /// Samples.
    pub samples: u64,
    /// From the first to the last one, seconds of the device's clock.
    pub duration_seconds: f64,
    /// The rate that was asked of the device, samples a second.
    pub nominal_rate: Option<f64>,
    /// The true rate: samples over time.
    pub rate: Option<f64>,
    /// How evenly the device measured.
    pub jitter: Option<Jitter>,
    /// Samples that never arrived, according to the events.
    pub lost_samples: u64,
    /// Numbers that are missing between two samples.
    pub missing_numbers: u64,
    /// Times without a sample.
    pub gaps: Vec<HeldGap>,
    /// Restarts of the device.
    pub restarts: u64,
    /// Samples whose time was rebuilt.
    pub clock_faults: ClockFaults,
    /// How the samples arrived on the host's clock; `None` if the take does not say, or is too short.
    pub arrival: Option<Arrival>,
    /// From the last byte of a sample until the character was posed; `None` if the take does not say.
    pub posing: Option<Posing>,
    /// The filters that are not `none`, and their lag.
    pub filters: Vec<FilterLag>,
}

/// How long it took from a sample's last byte to the pose, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posing {
    /// Half of the samples took no longer.
    pub p50_seconds: f64,
    /// 99 of 100 took no longer.
    pub p99_seconds: f64,
    /// The longest.
    pub max_seconds: f64,
}

/// By how much the time from one sample to the next differs from its median, microseconds of the device's clock; gaps
/// and lost samples do not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jitter {
    /// The median itself.
    pub period: f64,
    /// Root mean square of the difference.
    pub rms: f64,
    /// What 99 of 100 do not exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

/// When samples arrived on the host's clock, against the device's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// By how many millionths the host's clock is faster than the device's: the slope of a straight line through the
    /// arrival times.
    pub drift_ppm: f64,
    /// Its standard error.
    pub drift_error_ppm: f64,
    /// How much later than the earliest ones, beside the drift, half of the samples arrived, seconds.
    pub late_median_seconds: f64,
    /// The same for 99 of 100.
    pub late_p99_seconds: f64,
}

/// What a filter costs.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterLag {
    /// The part that has it; `None` for all that have none of their own.
    pub part: Option<PartUid>,
    /// The filter.
    pub filter: Filter,
    /// Its lag at [`LAG_AT_SPEEDS`], seconds.
    pub lag_seconds: [f64; 2],
}

/// The receipt of a take.
pub fn receipt(take: &Take) -> Receipt {
    let Summary { samples, duration_seconds, samples_per_second, lost_samples, restarts, clock_faults, .. } =
        summarize(take);
    let mut clock = DeviceClock::new(take);
    let mut last: Option<(u32, i64)> = None;
    let (mut steps, mut gaps, mut missing_numbers) = (Vec::new(), Vec::new(), 0);
    let mut arrivals = Vec::new();
    let (mut calibration, mut posing) = (None, None);
    for record in take.records() {
        match record {
            Record::Sample(sample) => {
                let micros = clock.next_sample();
                let seconds = micros as f64 * 1e-6;
                let host = sample.host_receive_seconds.filter(|host| host.is_finite());
                arrivals.extend(host.map(|host| (seconds, host)));
                let sequence = sample.raw.sequence;
                if let Some((before, then)) = last {
                    let ahead = sequence.wrapping_sub(before);
                    let step = (micros - then) as f64;
                    let is_gap = step * 1e-6 > GAP_SECONDS;
                    if is_gap {
                        gaps.push(HeldGap { start_seconds: then as f64 * 1e-6, end_seconds: seconds });
                    }
                    match ahead {
                        1 if !is_gap => steps.push(step),
                        2..MOST_MISSING => missing_numbers += u64::from(ahead - 1),
                        _ => {}
                    }
                }
                last = Some((sequence, micros));
            }
            Record::Calibration(new) => calibration = Some(new),
            Record::Event(event) => {
                if let EventKind::Posing { p50_micros, p99_micros, max_micros } = event.kind {
                    let [p50_seconds, p99_seconds, max_seconds] =
                        [p50_micros, p99_micros, max_micros].map(|micros| f64::from(micros) * 1e-6);
                    posing = Some(Posing { p50_seconds, p99_seconds, max_seconds });
                }
            }
            _ => {}
        }
    }
    let jitter = jitter(steps);
    let period = jitter.map(|jitter| jitter.period * 1e-6).or(samples_per_second.map(|rate| 1.0 / rate));
    Receipt {
        samples,
        duration_seconds,
        nominal_rate: take.header().nominal_samples_per_second,
        rate: samples_per_second,
        jitter,
        lost_samples,
        missing_numbers,
        gaps,
        restarts,
        clock_faults,
        arrival: arrival(&arrivals),
        posing,
        filters: calibration.zip(period).map(|(calibration, period)| filters(calibration, period)).unwrap_or_default(),
    }
}

fn jitter(mut steps: Vec<f64>) -> Option<Jitter> {
    let period = quantile(&mut steps, 0.5).filter(|period| *period > 0.0)?;
    let square = |step: &f64| (step - period) * (step - period);
    let rms = libm::sqrt(steps.iter().map(square).sum::<f64>() / steps.len() as f64);
    let mut off: Vec<f64> = steps.iter().map(|step| (step - period).abs()).collect();
    Some(Jitter { period, rms, p99: quantile(&mut off, 0.99)?, max: quantile(&mut off, 1.0)? })
}

/// The value that this share of the values does not exceed; sorts them.
fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(values[libm::ceil(share * last as f64) as usize])
}

/// A straight line of host time over device time by least squares.
fn arrival(arrivals: &[(f64, f64)]) -> Option<Arrival> {
    let count = arrivals.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| arrivals.iter().map(of).sum::<f64>() / count;
    let (device, late) = (mean(|a| a.0), mean(|a| a.1 - a.0));
    let spread: f64 = arrivals.iter().map(|a| (a.0 - device) * (a.0 - device)).sum();
    let lasted = arrivals.last()?.0 - arrivals.first()?.0;
    if arrivals.len() < FEWEST_ARRIVALS || lasted < SHORTEST_ARRIVALS || spread <= 0.0 {
        return None;
    }
    let drift = arrivals.iter().map(|a| (a.0 - device) * (a.1 - a.0 - late)).sum::<f64>() / spread;
    let mut beside: Vec<f64> = arrivals.iter().map(|a| a.1 - a.0 - late - drift * (a.0 - device)).collect();
    let variance = beside.iter().map(|b| b * b).sum::<f64>() / (count - 2.0);
    let earliest = quantile(&mut beside, 0.0)?;
    Some(Arrival {
        drift_ppm: drift * 1e6,
        drift_error_ppm: libm::sqrt(variance / spread) * 1e6,
        late_median_seconds: quantile(&mut beside, 0.5)? - earliest,
        late_p99_seconds: quantile(&mut beside, 0.99)? - earliest,
    })
}

fn filters(calibration: &Calibration, period: f64) -> Vec<FilterLag> {
    let own = calibration.set_parts().filter_map(|(part, settings)| Some((Some(part), settings.filter?)));
    let all = std::iter::once((None, calibration.filter)).chain(own);
    let lag = |(part, filter): (Option<PartUid>, Filter)| FilterLag {
        part,
        filter,
        lag_seconds: LAG_AT_SPEEDS.map(|speed| filter.lag_seconds(speed, period)),
    };
    all.filter(|(_, filter)| *filter != Filter::None).map(lag).collect()
}

impl fmt::Display for Receipt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rate {
            Some(rate) => write!(f, "{rate:.3} samples a second")?,
            None => write!(f, "no rate: fewer than two samples")?,
        }
        if let Some(nominal) = self.nominal_rate {
            write!(f, " ({nominal} asked for)")?;
        }
        if let Some(jitter) = self.jitter {
            write!(f, ", jitter {:.3} ms rms and {:.3} ms at most", jitter.rms * 1e-3, jitter.max * 1e-3)?;
        }
        write!(f, ", {} lost", self.lost_samples.max(self.missing_numbers))?;
        let longest = self.gaps.iter().map(|gap| gap.end_seconds - gap.start_seconds).fold(0.0, f64::max);
        match self.gaps.len() {
            0 => write!(f, ", no gap over {GAP_SECONDS} s")?,
            1 => write!(f, ", a gap of {longest:.3} s")?,
            gaps => write!(f, ", {gaps} gaps of up to {longest:.3} s")?,
        }
        match &self.arrival {
            Some(arrival) => write!(
                f,
                ", arrived up to {:.1} ms late (99 of 100), clocks drift {:+.1} ± {:.1} ppm",
                arrival.late_p99_seconds * 1e3,
                arrival.drift_ppm,
                arrival.drift_error_ppm
            )?,
            None => write!(f, ", drift of the clock unknown (no host times, or too few)")?,
        }
        match self.posing {
            Some(posing) => write!(
                f,
                ", posed {:.2} ms after the last byte (99 of 100: {:.2} ms)",
                posing.p50_seconds * 1e3,
                posing.p99_seconds * 1e3
            )?,
            None => write!(f, ", time to the pose not recorded")?,
        }
        let most = |speed: usize| self.filters.iter().map(|filter| filter.lag_seconds[speed]).fold(0.0, f64::max) * 1e3;
        if self.filters.is_empty() {
            write!(f, ", no filter")
        } else {
            let [calm, quick] = LAG_AT_SPEEDS;
            write!(f, ", filter lag {:.1} ms at {calm} rad/s and {:.1} ms at {quick} rad/s", most(0), most(1))
        }
    }
}
