//! Times the winding numbers of curves in the plane, made by formula, and prints the error of the fast method:
//! `cargo run --release -p armature-geometry --example winding_2d -- [SEGMENTS]...`; without arguments, 10⁴, 10⁵ and
//! 10⁶. Runs on one thread with `RAYON_NUM_THREADS=1`.

use std::time::Instant;

use armature_geometry::MeshError;
use armature_geometry::winding::{FastWindingNumber2d, WindingNumberHierarchy2d, winding_number_2d};

#[path = "../tests/support/outlines.rs"]
mod outlines;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut wanted = std::env::args().skip(1).map(|n| n.parse()).collect::<Result<Vec<u32>, _>>()?;
    if wanted.is_empty() {
        wanted = vec![10_000, 100_000, 1_000_000];
    }
    for count in wanted {
        for (name, (vertices, segments)) in outlines::all(count) {
            println!("{name}, {count} segments");
            measure(&vertices, &segments)?;
        }
    }
    Ok(())
}

fn measure(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<(), MeshError> {
    let points = outlines::points_around(vertices, segments, 50_000);
    let (exact, build_exact) = timed(|| WindingNumberHierarchy2d::precompute(vertices, segments));
    let (fast, build_fast) = timed(|| FastWindingNumber2d::precompute(vertices, segments));
    let (exact, fast) = (exact?, fast?);
    println!("  precompute: hierarchy {build_exact:.3} s, fast {build_fast:.3} s");
    let few = &points[..100];
    let (direct, seconds) = timed(|| winding_number_2d(vertices, segments, few));
    println!("  direct    {:10.3} µs per point", 1e6 * seconds / few.len() as f64);
    let (exact, seconds) = timed(|| exact.evaluate_many(&points));
    println!("  hierarchy {:10.3} µs per point", 1e6 * seconds / points.len() as f64);
    let (fast, seconds) = timed(|| fast.evaluate_many(&points));
    println!("  fast      {:10.3} µs per point", 1e6 * seconds / points.len() as f64);
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let mean = exact.iter().zip(&fast).map(|(a, b)| (a - b).abs()).sum::<f64>() / points.len() as f64;
    println!(
        "  hierarchy is off by {:.1e}, fast by {:.1e}, {mean:.1e} on average",
        off(&direct?, &exact),
        off(&exact, &fast)
    );
    Ok(())
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}
