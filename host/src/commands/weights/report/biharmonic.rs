//! The report on bounded biharmonic weights.

use armature_character::handle_weights::HandleWeights;
use armature_weights::biharmonic::{BiharmonicOutcome, HandleReport};
use serde_json::{Value, json};

use super::words::{HELD, domain_name, extrema_json, extrema_words, problem_json, problem_words};
use crate::cli::weight_args::WeightsArgs;
use crate::terminal::{Talk, aside, counted, grouped, out};

/// Bounded biharmonic weights, handle by handle.
pub(in crate::commands::weights) fn say_biharmonic(
    args: &WeightsArgs,
    made: &HandleWeights,
    names: &[String],
    talk: Talk,
    seconds: f64,
) {
    if args.json {
        out!("{}", biharmonic_json(args, made, names, seconds));
        return;
    }
    if talk.quiet {
        return;
    }
    out!(
        "{}: {} of {}, on {} of {}; {seconds:.2} s",
        args.output.display(),
        counted(made.weights.bones(), "handle", "handles"),
        counted(made.weights.vertices(), "vertex", "vertices"),
        domain_name(made.domain),
        counted(made.domain_vertices, "vertex", "vertices"),
    );
    if let Some(report) = &made.together {
        out!(
            "  all handles together: {} after {} steps, sums within {:.1e} of one",
            outcome(report.outcome),
            grouped(report.steps),
            report.largest_sum_error
        );
    } else {
        say_handles(made, names);
    }
    out!("  problem solved: {}", problem_words(made.joint_release, Some(made.flat_elements)));
    out!(
        "  energy of all {:.10e}, no weight farther than {:.1e} from the optimal one of this problem",
        made.energy(),
        made.error_bound()
    );
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

fn say_handles(made: &HandleWeights, names: &[String]) {
    out!("  handle          energy  bound violation  wrong multiplier  active sets  error bound");
    for (name, report) in names.iter().zip(&made.reports) {
        match report {
            Some(report) => out!("  {}", line(name, report)),
            None => out!("  {name:10}  holds no vertex; its weights are zero"),
        }
    }
}

fn line(name: &str, report: &HandleReport) -> String {
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

fn outcome(outcome: BiharmonicOutcome) -> &'static str {
    match outcome {
        BiharmonicOutcome::Converged => "converged",
        BiharmonicOutcome::LimitReached => "limit reached",
    }
}

fn biharmonic_json(args: &WeightsArgs, made: &HandleWeights, names: &[String], seconds: f64) -> Value {
    let handle = |(name, report): (&String, &Option<HandleReport>)| match report {
        None if made.together.is_some() => json!({"name": name}),
        None => json!({"name": name, "outcome": "holds nothing"}),
        Some(report) => json!({
            "name": name,
            "energy": report.energy,
            "largest_bound_violation": report.largest_bound_violation,
            "largest_wrong_multiplier": report.largest_wrong_multiplier,
            "stationarity": report.stationarity,
            "gap": report.gap,
            "error_bound": report.error_bound,
            "active_sets": report.active_sets,
            "outcome": outcome(report.outcome),
        }),
    };
    json!({
        "file": args.output.display().to_string(),
        "method": "bounded biharmonic",
        "together": made.together.map(|report| json!({
            "steps": report.steps,
            "gap": report.gap,
            "largest_sum_error": report.largest_sum_error,
            "outcome": outcome(report.outcome),
        })),
        "domain": domain_name(made.domain),
        "domain_vertices": made.domain_vertices,
        "problem": problem_json(made.joint_release, made.flat_elements),
        "vertices": made.weights.vertices(),
        "handles": names.iter().zip(&made.reports).map(handle).collect::<Vec<_>>(),
        "energy": made.energy(),
        "error_bound": made.error_bound(),
        "converged": made.converged(),
        "unconverged": made.unconverged(),
        "normalised": made.normalisation.is_some(),
        "largest_deviation": made.normalisation.as_ref().map(|n| n.largest_deviation),
        "mean_deviation": made.normalisation.as_ref().map(|n| n.mean_deviation),
        "spurious_extrema": extrema_json(&made.spurious, names),
        "warnings": made.warnings,
        "seconds": seconds,
    })
}
