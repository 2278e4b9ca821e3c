//! What `armature weights` reports about its results.

use armature_character::handle_weights::{DomainKind, HandleWeights, MonotoneHandleWeights, SpuriousExtrema};
use armature_weights::biharmonic::{BiharmonicOutcome, HandleReport};
use armature_weights::heat::BoneHeat;
use armature_weights::monotone::{MonotoneOutcome, MonotoneReport};
use serde_json::{Value, json};

use crate::cli::weight_args::WeightsArgs;
use crate::terminal::{Talk, aside, counted, grouped, out};

/// Bounded biharmonic weights, handle by handle.
pub(super) fn say_biharmonic(args: &WeightsArgs, made: &HandleWeights, names: &[String], talk: Talk, seconds: f64) {
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

/// Which extrema count as spurious where handles hold the shape, and where nothing is held.
const HELD: &str = "spurious extrema, where no handle holds the shape";
const OUTERMOST: &str = "spurious extrema, besides each handle's lowest and highest";

/// How many spurious extrema there are, before and after scaling, and how much they matter.
fn extrema_words(which: &str, spurious: &SpuriousExtrema) -> String {
    let words = |(count, most): (usize, f64)| match count {
        0 => "none".to_owned(),
        _ => format!("{} (up to {most:.1e} from their saddles)", grouped(count)),
    };
    let before = words(SpuriousExtrema::total(&spurious.computed));
    match &spurious.scaled {
        None => format!("{which}: {before}"),
        Some(scaled) => format!("{which}: {before}; after scaling: {}", words(SpuriousExtrema::total(scaled))),
    }
}

fn extrema_json(spurious: &SpuriousExtrema, names: &[String]) -> Value {
    let summary = |all: &[Vec<_>]| {
        let (count, largest_persistence) = SpuriousExtrema::total(all);
        json!({"count": count, "largest_persistence": largest_persistence})
    };
    let listed = spurious.last().iter().zip(names).flat_map(|(all, name)| {
        all.iter().map(move |one| {
            json!({
                "handle": name,
                "kind": if one.extremum.is_minimum { "minimum" } else { "maximum" },
                "place": one.place,
                "value": one.extremum.value,
                "persistence": one.extremum.persistence,
            })
        })
    });
    json!({
        "computed": summary(&spurious.computed),
        "scaled": spurious.scaled.as_deref().map(summary),
        "places": listed.collect::<Vec<_>>(),
    })
}

/// The problem that the weights are the optimum of: the fraction of their length over which bones are released near
/// shared joints (`None`: vertices are fixed), and how many flat elements are ignored (`None`: unknown).
pub(in crate::commands) fn problem_words(joint_release: Option<f64>, flat_elements: Option<usize>) -> String {
    let held = match joint_release {
        None => "vertices fixed as given".to_owned(),
        Some(0.0) => "bones hold to their ends".to_owned(),
        Some(share) => format!("bones are released over {share} of their length at shared joints"),
    };
    let flat = match flat_elements {
        None | Some(0) => String::new(),
        Some(count) => format!(", {} ignored", counted(count, "flat element", "flat elements")),
    };
    format!("{held}{flat}, barycentric masses")
}

fn problem_json(joint_release: Option<f64>, flat_elements: usize) -> Value {
    json!({"joint_release": joint_release, "flat_elements_left_out": flat_elements, "masses": "barycentric"})
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

fn domain_name(domain: DomainKind) -> &'static str {
    match domain {
        DomainKind::Volume => "a volume",
        DomainKind::Flat => "the flat figure",
        DomainKind::OwnTetrahedra => "its own tetrahedra",
        DomainKind::Surface => "the surface",
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

/// Monotone weights, handle by handle.
pub(super) fn say_monotone(
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

/// Bone heat weights.
pub(super) fn say_heat(
    args: &WeightsArgs,
    (made, spurious): (&BoneHeat, &SpuriousExtrema),
    names: &[String],
    talk: Talk,
    seconds: f64,
) {
    let cold: Vec<&str> = made.report.cold_bones.iter().map(|&bone| names[bone].as_str()).collect();
    if args.json {
        let value = json!({
            "file": args.output.display().to_string(),
            "method": "bone heat",
            "vertices": made.weights.vertices(),
            "handles": names.iter().map(|name| json!({"name": name})).collect::<Vec<_>>(),
            "residual": made.residual,
            "cold": cold,
            "spurious_extrema": extrema_json(spurious, names),
            "seconds": seconds,
        });
        out!("{value}");
        return;
    }
    if talk.quiet {
        return;
    }
    out!(
        "{}: {} of {} by bone heat, residual {:.1e}; {seconds:.2} s",
        args.output.display(),
        counted(made.weights.bones(), "handle", "handles"),
        counted(made.weights.vertices(), "vertex", "vertices"),
        made.residual,
    );
    out!("  {}", extrema_words(OUTERMOST, spurious));
    if !cold.is_empty() {
        aside!("note: these handles move no part of the mesh: {}", cold.join(", "));
    }
}
