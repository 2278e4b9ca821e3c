//! The report on monotone weights.

use armature_character::handle_weights::MonotoneHandleWeights;
use armature_weights::monotone::{MonotoneOutcome, MonotoneReport};
use serde_json::{Value, json};

use super::words::{HELD, domain_name, extrema_json, extrema_words, problem_json, problem_words};
use crate::cli::weight_args::WeightsArgs;
use crate::terminal::{Talk, aside, counted, out};

/// Monotone weights, handle by handle.
pub(in crate::commands::weights) fn say_monotone(
    args: &WeightsArgs,
    made: &MonotoneHandleWeights,
    names: &[String],
    talk: Talk,
    seconds: f64,
) {
    if args.json {
        out!("{}", monotone_json(args, made, names, seconds));
        return;
    }
    if talk.quiet {
        return;
    }
    out!(
        "{}: {} of {} by monotone weights of order {}, on {} of {}; {seconds:.2} s",
        args.output.display(),
        counted(made.weights.bones(), "handle", "handles"),
        counted(made.weights.vertices(), "vertex", "vertices"),
        args.order.order(),
        domain_name(made.domain),
        counted(made.domain_vertices, "vertex", "vertices"),
    );
    out!("  handle          energy  smallest rise  energy of repair  error bound");
    for (name, report) in names.iter().zip(&made.reports) {
        match report {
            Some(report) => out!(
                "  {name:10} {:>13.6e} {:>14.1e} {:>17.1e} {:>12.1e}  {}",
                report.energy,
                report.margin + report.slack,
                report.repair,
                report.error_bound,
                monotone_outcome(report.outcome),
            ),
            None => out!("  {name:10}  holds no vertex; its weights are zero"),
        }
    }
    out!("  problem solved: {}", problem_words(made.joint_release, Some(made.flat_elements)));
    if let Some(n) = &made.normalisation {
        out!(
            "  scaled to sum to one: sums were off by {:.4} at most, {:.4} on average",
            n.largest_deviation,
            n.mean_deviation
        );
    }
    out!("  {}", extrema_words(HELD, &made.spurious));
    made.warnings.iter().for_each(|warning| aside!("note: {warning}"));
}

fn monotone_outcome(outcome: MonotoneOutcome) -> &'static str {
    match outcome {
        MonotoneOutcome::Converged => "converged",
        MonotoneOutcome::LimitReached => "limit reached",
    }
}

fn monotone_json(args: &WeightsArgs, made: &MonotoneHandleWeights, names: &[String], seconds: f64) -> Value {
    let handle = |(name, report): (&String, &Option<MonotoneReport>)| match report {
        None => json!({"name": name, "outcome": "holds nothing"}),
        Some(report) => json!({
            "name": name,
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
            "outcome": monotone_outcome(report.outcome),
        }),
    };
    json!({
        "file": args.output.display().to_string(),
        "method": "monotone",
        "order": args.order.order(),
        "domain": domain_name(made.domain),
        "domain_vertices": made.domain_vertices,
        "problem": problem_json(made.joint_release, made.flat_elements),
        "vertices": made.weights.vertices(),
        "handles": names.iter().zip(&made.reports).map(handle).collect::<Vec<_>>(),
        "unconverged": made.unconverged(),
        "normalised": made.normalisation.is_some(),
        "largest_deviation": made.normalisation.as_ref().map(|n| n.largest_deviation),
        "mean_deviation": made.normalisation.as_ref().map(|n| n.mean_deviation),
        "spurious_extrema": extrema_json(&made.spurious, names),
        "warnings": made.warnings,
        "seconds": seconds,
    })
}
