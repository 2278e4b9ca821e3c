//! Computes bounded biharmonic weights and prints the certificates:
//! `cargo run --release -p armature-weights --example bounded_biharmonic -- mesh.mesh b.npy bc.npy [interactive|certified [reference.npy]]`.
//! The two arrays are those that libigl's `boundary_conditions` makes; the result is compared with the reference
//! weights (n × m), if given.

mod support;

use std::path::Path;
use std::time::Instant;

use armature_test_support::read_npy;
use armature_weights::biharmonic::{BiharmonicSettings, bounded_biharmonic_weights};
use support::{GivenOnMesh, stopwatch};

fn main() {
    let further = "[interactive|certified [reference.npy]]";
    let (given, rest) = GivenOnMesh::from_command_line("bounded_biharmonic", further);
    let interactive = rest.first().is_none_or(|tier| tier == "interactive");
    let settings = if interactive { BiharmonicSettings::interactive() } else { BiharmonicSettings::certified() };
    let start = Instant::now();
    match bounded_biharmonic_weights(&given.problem(), &settings, &mut stopwatch()) {
        Ok(result) => {
            println!("all: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
            result.reports.iter().for_each(|report| println!("{report:?}"));
            println!("energy {:.6}", result.reports.iter().map(|report| report.energy).sum::<f64>());
            println!("active sets {}", result.reports.iter().map(|report| report.active_sets).sum::<usize>());
            if let Some(reference) = rest.get(1) {
                let reference = read_npy(Path::new(reference)).values;
                let weights = result.weights.to_columns().expect("memory");
                let difference = weights.iter().zip(&reference).map(|(a, b)| (a - b).abs());
                println!("largest difference {:.1e}", difference.fold(0.0, f64::max));
            }
        }
        Err(error) => {
            eprintln!("error: {error}");
            std::process::exit(1);
        }
    }
}
