//! Computes bounded and monotone weights of the same handles, and prints their energies, extrema and times:
//! `cargo run --release -p armature-weights --example monotone -- mesh.mesh b.npy bc.npy [order]`.
//! The two arrays are those that libigl's `boundary_conditions` makes.

mod support;

use std::ops::ControlFlow;
use std::time::Instant;

use armature_weights::biharmonic::{BiharmonicSettings, bounded_biharmonic_weights};
use armature_weights::extrema::{Neighbours, local_extrema};
use armature_weights::handles::HandleBoundary;
use armature_weights::monotone::{MonotoneProblem, MonotoneSettings, monotone_weights};
use support::GivenOnMesh;

fn main() {
    let (given, rest) = GivenOnMesh::from_command_line("monotone", "[order]");
    let order = rest.first().and_then(|text| text.parse().ok()).unwrap_or(2);
    let bounded = given.problem();
    let neighbours = Neighbours::of_matrix(bounded.laplacian);
    let (laplacian, mass) = (bounded.laplacian, bounded.mass);
    let problem = MonotoneProblem { neighbours: &neighbours, laplacian, mass, order, blend: None, data: None };
    let held = HandleBoundary {
        fixed: bounded.fixed.to_vec(),
        fixed_weights: bounded.fixed_weights.to_vec(),
        handles: bounded.handles,
    };
    let mut on = |_: &'static str, _: f64| ControlFlow::Continue(());
    let start = Instant::now();
    let by_bounds = bounded_biharmonic_weights(&bounded, &BiharmonicSettings::interactive(), &mut on).expect("weights");
    let bounded_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let monotone = monotone_weights(&problem, &held, &MonotoneSettings::default(), &mut on).expect("weights");
    let seconds = start.elapsed().as_secs_f64();
    for (handle, report) in monotone.reports.iter().enumerate() {
        let found = local_extrema(&neighbours, &by_bounds.weights.bone(handle)).expect("finite weights");
        println!(
            "handle {handle}: bounded energy {:.6e} with {} spurious extrema, monotone {:.6e} with {}, within {:.1e}; \
             {} steps, {} factorisations, {} raised, {} mended, {:?}",
            by_bounds.reports[handle].energy,
            found.besides(&held.fixed).count(),
            report.energy,
            report.spurious,
            report.error_bound,
            report.steps,
            report.factorisations,
            report.raised,
            report.mended,
            report.outcome,
        );
    }
    println!("bounded {bounded_seconds:.2} s, monotone {seconds:.2} s, {:.1} times as long", seconds / bounded_seconds);
}
