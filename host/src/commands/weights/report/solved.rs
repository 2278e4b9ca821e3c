//! The report on bounded biharmonic and monotone weights.

use armature_character::handle_weights::{Certificates, HandleWeights};
use serde_json::{Value, json};

use super::biharmonic::{bounded_json, bounded_line, bounded_together_json, outcome};
use super::monotone::{monotone_json, monotone_line, monotone_together_json};
use super::words::{HELD, domain_name, extrema_json, extrema_words, problem_json, problem_words};
use crate::cli::weight_args::WeightsArgs;
use crate::commands::functions;
use crate::terminal::{Talk, aside, counted, grouped, out};

/// Bounded biharmonic or monotone weights, handle by handle or together.
pub(in crate::commands::weights) fn say_solved(
    args: &WeightsArgs,
    made: &HandleWeights,
    names: &[String],
    talk: Talk,
    seconds: f64,
) {
    if args.json {
        out!("{}", solved_json(args, made, names, seconds));
        return;
    }
    if talk.quiet {
        return;
    }
    let monotone = match made.certificates {
        Certificates::Monotone(_) | Certificates::MonotoneTogether(_) => {
            format!(" by monotone weights of order {}", args.order.order())
        }
        Certificates::Bounded(_) | Certificates::BoundedTogether(_) => String::new(),
    };
    out!(
        "{}: {} of {}{monotone}, on {} of {}; {seconds:.2} s",
        args.output.display(),
        counted(made.weights.bones(), "handle", "handles"),
        counted(made.weights.vertices(), "vertex", "vertices"),
        domain_name(made.domain),
        counted(made.domain_vertices, "vertex", "vertices"),
    );
    let best = match &made.certificates {
        Certificates::Bounded(reports) => {
            out!("  handle          energy  bound violation  wrong multiplier  active sets  error bound");
            say_each(names, reports, bounded_line);
            "the optimal one of this problem"
        }
        Certificates::BoundedTogether(report) => {
            say_together(outcome(report.outcome), report.steps, report.largest_sum_error);
            "the optimal one of this problem"
        }
        Certificates::Monotone(reports) => {
            out!("  handle          energy  smallest rise  energy of repair  error bound");
            say_each(names, reports, monotone_line);
            "the best one that rises along the same edges"
        }
        Certificates::MonotoneTogether(report) => {
            say_together(functions::outcome(report.outcome), report.steps, report.largest_sum_error);
            if report.flattened > 0 {
                let flat = counted(report.flattened, "vertex", "vertices");
                out!("  weights of {flat} are those of a neighbour: all are equal there to the last digits");
            }
            "the best one that rises along the same edges"
        }
    };
    out!("  problem solved: {}", problem_words(made.joint_release, Some(made.flat_elements)));
    out!("  energy of all {:.10e}, no weight farther than {:.1e} from {best}", made.energy(), made.error_bound());
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

fn say_each<R>(names: &[String], reports: &[Option<R>], line: impl Fn(&str, &R) -> String) {
    for (name, report) in names.iter().zip(reports) {
        match report {
            Some(report) => out!("  {}", line(name, report)),
            None => out!("  {name:10}  holds no vertex; its weights are zero"),
        }
    }
}

fn say_together(outcome: &str, steps: usize, sum_error: f64) {
    out!("  all handles together: {outcome} after {} steps, sums within {sum_error:.1e} of one", grouped(steps));
}

fn each_json<R>(names: &[String], reports: &[Option<R>], of: impl Fn(&R) -> Value) -> Vec<Value> {
    let one = |(name, report): (&String, &Option<R>)| {
        let mut value = report.as_ref().map_or_else(|| json!({"outcome": "holds nothing"}), &of);
        value["name"] = json!(name);
        value
    };
    names.iter().zip(reports).map(one).collect()
}

fn solved_json(args: &WeightsArgs, made: &HandleWeights, names: &[String], seconds: f64) -> Value {
    let alone = || names.iter().map(|name| json!({"name": name})).collect::<Vec<_>>();
    let (method, together, handles) = match &made.certificates {
        Certificates::Bounded(reports) => ("bounded biharmonic", Value::Null, each_json(names, reports, bounded_json)),
        Certificates::BoundedTogether(report) => ("bounded biharmonic", bounded_together_json(report), alone()),
        Certificates::Monotone(reports) => ("monotone", Value::Null, each_json(names, reports, monotone_json)),
        Certificates::MonotoneTogether(report) => ("monotone", monotone_together_json(report), alone()),
    };
    json!({
        "file": args.output.display().to_string(),
        "method": method,
        "order": (method == "monotone").then(|| args.order.order()),
        "together": together,
        "domain": domain_name(made.domain),
        "domain_vertices": made.domain_vertices,
        "problem": problem_json(made.joint_release, made.flat_elements),
        "vertices": made.weights.vertices(),
        "handles": handles,
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
