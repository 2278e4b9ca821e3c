//! Times the Delaunay tetrahedra of random points in a cube, or of the vertices of meshes:
//! `cargo run --release -p armature-geometry --example delaunay -- [NUMBER | MESH]...`.
//!
//! MESH is an OBJ or OFF file. Without arguments: 10⁴, 10⁵ and 10⁶ random points.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::delaunay::delaunay_tetrahedra;

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    if wanted.is_empty() {
        wanted = ["10000", "100000", "1000000"].map(String::from).to_vec();
    }
    for name in wanted {
        let points = match name.parse::<usize>() {
            Ok(count) => {
                let mut noise = support::noise();
                (0..count).map(|_| std::array::from_fn(|_| noise())).collect()
            }
            Err(_) => support::read_triangles(Path::new(&name)).vertices,
        };
        let start = Instant::now();
        let delaunay = delaunay_tetrahedra(&points, &mut |_, _| ControlFlow::Continue(()))?;
        let seconds = start.elapsed().as_secs_f64();
        let (points, tetrahedra) = (points.len(), delaunay.tetrahedra.len());
        println!(
            "{name}: {points} points, {tetrahedra} tetrahedra, {seconds:.3} s, {:.2} µs per point, {:.2} million tetrahedra per second",
            1e6 * seconds / points as f64,
            1e-6 * tetrahedra as f64 / seconds
        );
    }
    Ok(())
}
