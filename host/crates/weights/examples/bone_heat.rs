//! Computes bone heat weights for a mesh and a skeleton, and prints the findings and how long each stage took:
//! `cargo run --release -p armature-weights --example bone_heat -- mesh.obj skeleton.tgf [weights.f64 [heat]]`.
//! The optional third file receives the weights as little-endian f64, column-major; `heat` is the setting `c`.

mod support;

use std::path::Path;
use std::time::Instant;

use armature_weights::heat::{BoneHeatSettings, bone_heat};
use support::{read_obj, read_tgf, stopwatch};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, skeleton, rest @ ..] = arguments.as_slice() else {
        eprintln!("usage: bone_heat mesh.obj skeleton.tgf [weights.f64 [heat]]");
        std::process::exit(2);
    };
    let mesh = read_obj(Path::new(mesh));
    let bones = read_tgf(Path::new(skeleton));
    println!("{} vertices, {} triangles, {} bones", mesh.vertices.len(), mesh.triangles.len(), bones.len());
    let mut settings = BoneHeatSettings::default();
    if let Some(heat) = rest.get(1) {
        settings.heat = heat.parse().expect("heat is a number");
    }
    let start = Instant::now();
    match bone_heat(&mesh, &bones, &settings, &mut stopwatch()) {
        Ok(heat) => {
            println!("all: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
            println!("residual {:.1e}, deviation {:.1e}", heat.residual, heat.deviation);
            println!("{:?}", heat.report);
            if let Some(out) = rest.first() {
                let bytes: Vec<u8> =
                    heat.weights.to_columns().expect("memory").iter().flat_map(|v| v.to_le_bytes()).collect();
                std::fs::write(out, bytes).expect("the output file can be written");
            }
        }
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(5);
        }
    }
}
