//! Times the winding numbers of one mesh: `cargo run --release -p armature-geometry --example winding -- MESH [POINTS]`.
//!
//! MESH is an OBJ or OFF file. The points are random, in a box 1.2 times that of the mesh; a file POINTS (one `x y z`
//! per line) is used instead if given, and with a third argument the three columns direct, hierarchy and fast are
//! written to that file. Runs on one thread with `RAYON_NUM_THREADS=1`.

use std::path::Path;
use std::time::Instant;

use armature_geometry::TriangleMesh;
use armature_geometry::orientation::flipped_components;
use armature_geometry::surface::self_intersections;
use armature_geometry::winding::{FastWindingNumber, WindingNumberHierarchy, winding_number};

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().ok_or("which mesh? name an OBJ or OFF file")?;
    let mesh = support::read_triangles(Path::new(&name));
    let points = match arguments.next() {
        Some(file) => points_in(&std::fs::read_to_string(file)?)?,
        None => spread(&mesh, 100_000)?,
    };
    let (hierarchy, build_hierarchy) = timed(|| WindingNumberHierarchy::precompute(&mesh));
    let (fast, build_fast) = timed(|| FastWindingNumber::precompute(&mesh));
    let (hierarchy, fast) = (hierarchy?, fast?);
    println!("{name}: {} triangles, {} points", mesh.triangles.len(), points.len());
    println!("  precompute: hierarchy {build_hierarchy:.3} s, fast {build_fast:.3} s");
    let few = &points[..points.len().min(500)];
    let (direct, seconds) = timed(|| winding_number(&mesh, few));
    let direct = direct?;
    println!("  direct    {:10.3} µs per point", 1e6 * seconds / few.len() as f64);
    let (exact, seconds) = timed(|| hierarchy.evaluate_many(&points));
    println!("  hierarchy {:10.3} µs per point", 1e6 * seconds / points.len() as f64);
    let (quick, seconds) = timed(|| fast.evaluate_many(&points));
    println!("  fast      {:10.3} µs per point", 1e6 * seconds / points.len() as f64);
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let mean = exact.iter().zip(&quick).map(|(a, b)| (a - b).abs()).sum::<f64>() / points.len() as f64;
    println!(
        "  hierarchy is off by {:.1e}, fast by {:.1e}, {mean:.1e} on average",
        off(&direct, &exact),
        off(&exact, &quick)
    );
    let (flipped, seconds) = timed(|| flipped_components(&mesh));
    let flipped = flipped?;
    let (count, wrong, open) = (flipped.mean_winding.len(), flipped.flipped.len(), flipped.undecided.len());
    println!("  {count} components, {wrong} inside out, {open} undecided: {seconds:.3} s");
    let (found, seconds) = timed(|| self_intersections(&mesh));
    println!("  {} pairs of triangles meet: {seconds:.3} s", found?.pairs.len());
    if let Some(file) = arguments.next() {
        let lines: Vec<String> = exact.iter().zip(&quick).map(|(e, q)| format!("{e:?} {q:?}\n")).collect();
        std::fs::write(file, lines.concat())?;
    }
    Ok(())
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn points_in(text: &str) -> Result<Vec<[f64; 3]>, Box<dyn std::error::Error>> {
    let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    Ok(numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

fn spread(mesh: &TriangleMesh, count: usize) -> Result<Vec<[f64; 3]>, Box<dyn std::error::Error>> {
    let (low, high) = mesh.bounds().ok_or("the mesh is empty")?;
    let mut noise = support::noise();
    Ok((0..count)
        .map(|_| std::array::from_fn(|k| f64::midpoint(low[k], high[k]) + 0.6 * noise() * (high[k] - low[k])))
        .collect())
}
