//! Compares weights that sum to one exactly with weights that are normalised, like table 2 of the BBW paper:
//! `cargo run --release -p armature-weights --example exact_partition -- mesh.mesh b.npy bc.npy [error bound]`.

mod support;

use std::ops::ControlFlow;
use std::time::Instant;

use armature_weights::biharmonic::{
    BiharmonicSettings, ExactPartitionSettings, bounded_biharmonic_weights, exact_partition_weights,
};
use armature_weights::finish::normalise;
use support::GivenOnMesh;

fn main() {
    let (given, rest) = GivenOnMesh::from_command_line("exact_partition", "[error bound]");
    let problem = given.problem();
    let mut go_on = |_, _: f64| ControlFlow::Continue(());
    let mut settings = ExactPartitionSettings::default();
    if let Some(bound) = rest.first().and_then(|bound| bound.parse().ok()) {
        settings.error_bound = bound;
    }
    let start = Instant::now();
    let exact = exact_partition_weights(&problem, &settings, &mut go_on).expect("a partition");
    println!("exact: {:.1} ms, {:?}", start.elapsed().as_secs_f64() * 1e3, exact.report);
    let start = Instant::now();
    let alone = bounded_biharmonic_weights(&problem, &BiharmonicSettings::certified(), &mut go_on).expect("weights");
    println!("alone: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    println!("energy alone {:.6}", alone.reports.iter().map(|report| report.energy).sum::<f64>());
    let mut normalised = alone.weights;
    println!("normalising: {:?}", normalise(&mut normalised).largest_deviation);
    let (normalised, exact) = (normalised.to_columns().expect("memory"), exact.weights.to_columns().expect("memory"));
    let differences = || normalised.iter().zip(&exact).map(|(a, b)| (a - b).abs());
    let mean = differences().sum::<f64>() / normalised.len() as f64;
    println!("exact to normalised: mean {mean:.2e}, largest {:.2e}", differences().fold(0.0, f64::max));
}
