//! What is said of bounded biharmonic weights.

use armature_weights::biharmonic::{BiharmonicOutcome, ExactPartitionReport, HandleReport};
use serde_json::{Value, json};

use crate::terminal::grouped;

/// A handle's line in the table.
pub(super) fn bounded_line(name: &str, report: &HandleReport) -> String {
    format!(
        "{name:10} {:>13.6e} {:>16.1e} {:>17.1e} {:>12} {:>12.1e}  {}",
        report.energy,
        report.largest_bound_violation,
        report.largest_wrong_multiplier,
        grouped(report.active_sets),
        report.error_bound,
        outcome(report.outcome),
    )
}

pub(super) fn outcome(outcome: BiharmonicOutcome) -> &'static str {
    match outcome {
        BiharmonicOutcome::Converged => "converged",
        BiharmonicOutcome::LimitReached => "limit reached",
    }
}

pub(super) fn bounded_json(report: &HandleReport) -> Value {
    json!({
        "energy": report.energy,
        "largest_bound_violation": report.largest_bound_violation,
        "largest_wrong_multiplier": report.largest_wrong_multiplier,
        "stationarity": report.stationarity,
        "gap": report.gap,
        "error_bound": report.error_bound,
        "active_sets": report.active_sets,
        "outcome": outcome(report.outcome),
    })
}

pub(super) fn bounded_together_json(report: &ExactPartitionReport) -> Value {
    json!({
        "steps": report.steps,
        "gap": report.gap,
        "largest_sum_error": report.largest_sum_error,
        "outcome": outcome(report.outcome),
    })
}
