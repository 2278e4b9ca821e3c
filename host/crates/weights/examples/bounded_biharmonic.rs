//! Computes bounded biharmonic weights and prints the certificates:
//! `cargo run --release -p armature-weights --example bounded_biharmonic -- mesh.mesh b.npy bc.npy [interactive|certified [reference.npy]]`.
//! The two arrays are as libigl's `boundary_conditions` makes them; reference weights, n × m, are compared with.

mod support;

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_weights::{BiharmonicSettings, bounded_biharmonic_weights};
use support::{GivenOnMesh, read_npy};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, fixed, given, rest @ ..] = arguments.as_slice() else {
        eprintln!("usage: bounded_biharmonic mesh.mesh b.npy bc.npy [interactive|certified [reference.npy]]");
        std::process::exit(2);
    };
    let given = GivenOnMesh::read(mesh, fixed, given);
    let interactive = rest.first().is_none_or(|tier| tier == "interactive");
    let settings = if interactive { BiharmonicSettings::interactive() } else { BiharmonicSettings::certified() };
    let start = Instant::now();
    let mut last: Option<(_, Instant)> = None;
    let mut progress = |at: armature_weights::Progress| {
        let entered = last.is_none_or(|(phase, _)| phase != at.phase);
        if entered && let Some((phase, since)) = last.replace((at.phase, Instant::now())) {
            println!("{phase:?}: {:.1} ms", since.elapsed().as_secs_f64() * 1e3);
        }
        ControlFlow::Continue(())
    };
    match bounded_biharmonic_weights(&given.problem(), &settings, &mut progress) {
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
