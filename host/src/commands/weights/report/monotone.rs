//! What is said of monotone weights.

use armature_weights::monotone::{MonotonePartitionReport, MonotoneReport};
use serde_json::{Value, json};

use crate::commands::functions::outcome;

/// A handle's line in the table.
pub(super) fn monotone_line(name: &str, report: &MonotoneReport) -> String {
    format!(
        "{name:10} {:>13.6e} {:>14.1e} {:>17.1e} {:>12.1e}  {}",
        report.energy,
        report.margin + report.slack,
        report.repair,
        report.error_bound,
        outcome(report.outcome),
    )
}

pub(super) fn monotone_json(report: &MonotoneReport) -> Value {
    json!({
        "energy": report.energy,
        "gap": report.gap,
        "error_bound": report.error_bound,
        "margin": report.margin,
        "slack": report.slack,
        "violation_before_repair": report.violation,
        "energy_of_repair": report.repair,
        "directed_edges": report.edges,
        "raised_vertices": report.raised,
        "mended_vertices": report.mended,
        "steps": report.steps,
        "spurious_extrema": report.spurious,
        "energies": report.energies,
        "outcome": outcome(report.outcome),
    })
}

pub(super) fn monotone_together_json(report: &MonotonePartitionReport) -> Value {
    json!({
        "steps": report.steps,
        "gap": report.gap,
        "margin": report.margin,
        "slack": report.slack,
        "energy_of_repair": report.repair,
        "directed_edges": report.edges,
        "flattened_vertices": report.flattened,
        "raised_vertices": report.raised,
        "energies": report.energies,
        "largest_sum_error": report.largest_sum_error,
        "outcome": outcome(report.outcome),
    })
}
