//! `armature smooth` and `armature interpolate`

mod interpolate;
mod smooth;
mod value_sources;

pub use interpolate::interpolate;
pub use smooth::smooth;

use std::path::Path;

use armature_formats::model::Model;
use armature_weights::FunctionDomain;
use armature_weights::monotone::{MonotoneError, MonotoneOutcome, MonotoneReport, MonotoneSettings};
use serde_json::{Value, json};

use crate::cli::function_args::SolverArgs;
use crate::failure::Failure;
use crate::terminal::counted;

/// The mesh's tetrahedra if it has any, its triangles otherwise.
fn domain_of(path: &Path, model: &Model) -> Result<FunctionDomain, Failure> {
    let made = match &model.tetrahedra {
        Some(tetrahedra) => FunctionDomain::of_tetrahedra(tetrahedra),
        None => FunctionDomain::of_triangles(&model.mesh),
    };
    made.map_err(|e| {
        let remedy = format!("`armature inspect {}` says more", path.display());
        Failure::input(format!("{}: {e}", path.display()), remedy)
    })
}

fn domain_name(model: &Model) -> &'static str {
    if model.tetrahedra.is_some() { "its own tetrahedra" } else { "the surface" }
}

fn settings(solver: SolverArgs) -> MonotoneSettings {
    MonotoneSettings { convexifications: solver.convexify, ..MonotoneSettings::default() }
}

pub(super) fn outcome(outcome: MonotoneOutcome) -> &'static str {
    match outcome {
        MonotoneOutcome::Converged => "converged",
        MonotoneOutcome::LimitReached => "limit reached",
    }
}

/// What both commands say of a function.
fn report_json(report: &MonotoneReport) -> Value {
    json!({
        "energy": report.energy,
        "energies": report.energies,
        "gap": report.gap,
        "error_bound": report.error_bound,
        "energy_of_repair": report.repair,
        "steps": report.steps,
        "outcome": outcome(report.outcome),
    })
}

/// A failure if some function is not as good as requested; `path` is the file with its values.
fn all_converged<'a>(path: &Path, reports: impl IntoIterator<Item = &'a MonotoneReport>) -> Result<(), Failure> {
    match reports.into_iter().filter(|report| report.outcome != MonotoneOutcome::Converged).count() {
        0 => Ok(()),
        late => Err(Failure::not_converged(
            format!(
                "{}: {} did not converge; the best found were written",
                path.display(),
                counted(late, "function", "functions")
            ),
            "the report says how far off they can be; repair slivers of the mesh, or use a lower --order",
        )),
    }
}

fn failure(path: &Path, error: &MonotoneError, remedy: &str) -> Failure {
    let what = format!("{}: {error}", path.display());
    match error {
        MonotoneError::Cancelled { .. } => Failure::usage(what, ""),
        MonotoneError::Factorisation { .. } | MonotoneError::NotFinite { .. } => {
            Failure::not_converged(what, "a lower --order is easier on the mesh")
        }
        _ => Failure::input(what, remedy),
    }
}
