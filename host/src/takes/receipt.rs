//! A take's receipt for scripts.

use armature_take::{FilterLag, LAG_AT_SPEEDS, Receipt};
use serde_json::{Value, json};

/// The receipt as JSON; what the take does not say is null.
pub fn to_json(receipt: &Receipt) -> Value {
    let filter = |lag: &FilterLag| {
        json!({
            "part": lag.part.map(|part| part.to_string()), "filter": lag.filter.to_string(),
            "lag_seconds": lag.lag_seconds, "at_radians_per_second": LAG_AT_SPEEDS,
        })
    };
    json!({
        "samples": receipt.samples,
        "seconds": receipt.duration_seconds,
        "samples_per_second": receipt.rate,
        "samples_per_second_asked_for": receipt.nominal_rate,
        "jitter_micros": receipt.jitter.map(|jitter| json!({
            "period": jitter.period, "rms": jitter.rms, "p99": jitter.p99, "max": jitter.max,
        })),
        "lost_samples": receipt.lost_samples,
        "missing_numbers": receipt.missing_numbers,
        "gaps": receipt.gaps.iter().map(|gap| json!({
            "start_seconds": gap.start_seconds, "end_seconds": gap.end_seconds,
        })).collect::<Vec<_>>(),
        "restarts": receipt.restarts,
        "clock_faults": {
            "leapt": receipt.clock_faults.leapt, "stood": receipt.clock_faults.stood,
            "went_back": receipt.clock_faults.went_back,
        },
        "arrival": receipt.arrival.map(|arrival| json!({
            "drift_ppm": arrival.drift_ppm, "drift_error_ppm": arrival.drift_error_ppm,
            "late_median_seconds": arrival.late_median_seconds, "late_p99_seconds": arrival.late_p99_seconds,
        })),
        "last_byte_to_pose_seconds": receipt.posing.map(|posing| json!({
            "p50": posing.p50_seconds, "p99": posing.p99_seconds, "max": posing.max_seconds,
        })),
        "filters": receipt.filters.iter().map(filter).collect::<Vec<_>>(),
    })
}
