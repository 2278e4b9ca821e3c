//! `armature smooth` and `armature interpolate`

mod interpolate;
mod smooth;
mod value_sources;

pub use interpolate::interpolate;
pub use smooth::smooth;

use std::path::Path;

use armature_formats::model::Model;
use armature_weights::FunctionDomain;
use armature_weights::monotone::{MonotoneError, MonotoneOutcome, MonotoneSettings};

use crate::cli::function_args::SolverArgs;
use crate::failure::Failure;

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

fn outcome(outcome: MonotoneOutcome) -> &'static str {
    match outcome {
        MonotoneOutcome::Converged => "converged",
        MonotoneOutcome::LimitReached => "limit reached",
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
