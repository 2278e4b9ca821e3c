//! Times the improvement of tetrahedra: `cargo run --release -p armature-geometry --example improve -- MESH...`.
//!
//! MESH is an OBJ or OFF file of a closed surface. Its vertices and a lattice of interior points are tetrahedralised,
//! and the tetrahedra inside are improved.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::improve::{DihedralStatistics, ImproveSettings, improve_tetrahedra};

#[path = "../tests/support/mod.rs"]
mod support;
#[path = "../tests/support/volume.rs"]
mod volume;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for name in std::env::args().skip(1) {
        let surface = support::read_triangles(Path::new(&name));
        let mut mesh = volume::volume_of(&surface, surface.vertices.len() / 2);
        let fixed = vec![false; mesh.vertices.len()];
        println!("{name}: {} vertices, {} tetrahedra", mesh.vertices.len(), mesh.tetrahedra.len());
        let settings = ImproveSettings::default();
        let start = Instant::now();
        let improvement = improve_tetrahedra(&mut mesh, &fixed, &[], &settings, &mut |_, _| ControlFlow::Continue(()))?;
        println!("  improved in {:.3} s: {:?}", start.elapsed().as_secs_f64(), improvement.outcome);
        println!("  {:?}", improvement.operations);
        let bad = (improvement.bad_before, improvement.bad_after, improvement.bad_without_free_corner);
        println!("  bad tetrahedra {} -> {}, of which {} have no free corner", bad.0, bad.1, bad.2);
        println!(
            "  {} vertices added, {} contracted",
            improvement.vertices_added,
            improvement.vertices_unreferenced.len()
        );
        describe("before", &improvement.before);
        describe("after", &improvement.after);
    }
    Ok(())
}

fn describe(when: &str, statistics: &DihedralStatistics) {
    let [five, ten, twenty] = [5, 10, 20].map(|degrees| 100.0 * statistics.share_below(degrees));
    let (smallest, largest) = (statistics.smallest.to_degrees(), statistics.largest.to_degrees());
    println!(
        "  {when}: {smallest:.2e}° to {largest:.2}°; {five:.4} % below 5°, {ten:.4} % below 10°, {twenty:.3} % below 20°"
    );
}
