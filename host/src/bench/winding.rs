//! Generalized winding numbers on a real model, compared with libigl if it is installed.

use std::hint::black_box;
use std::path::{Path, PathBuf};

use armature_geometry::winding::{FastWindingNumber, WindingNumberHierarchy};
use armature_geometry::{MeshError, TriangleMesh};

use super::{Measurement, median, of_peer, python_peer, shared_file, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::aside;

pub(super) const NAMES: &[&str] =
    &["winding/exact-armadillo", "winding/fast-armadillo", "winding/exact-truck", "winding/fast-truck"];

const RUNS: usize = 5;
const POINTS: usize = 20_000;
const PEER_SCRIPT: &str = "libigl_winding.py";

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let mut measurements = Vec::new();
    for (file, names) in [("armadillo.obj", [NAMES[0], NAMES[1]]), ("truck.obj", [NAMES[2], NAMES[3]])] {
        match shared_file(file) {
            Some(path) => measurements.extend(measure(names, &path, args.igl_python.as_deref())?),
            None => aside!("{}: skipped, the model is not here", names[0]),
        }
    }
    Ok(measurements)
}

fn measure(names: [&'static str; 2], path: &PathBuf, python: Option<&Path>) -> Result<[Measurement; 2], Failure> {
    let mesh = inputs::model(path)?.mesh;
    let unusable = |e: MeshError| Failure::input(format!("{}: {e}", path.display()), "");
    let exact = WindingNumberHierarchy::precompute(&mesh).map_err(unusable)?;
    let fast = FastWindingNumber::precompute(&mesh).map_err(unusable)?;
    let points = spread(&mesh);
    let exact = micros_a_point(&points, |p| exact.evaluate(p));
    let fast = micros_a_point(&points, |p| fast.evaluate(p));
    let mut measurements =
        [Measurement::new(names[0], exact, "µs/point", RUNS), Measurement::new(names[1], fast, "µs/point", RUNS)];
    if let Some(python) = python {
        let peer = python_peer(python, PEER_SCRIPT, &[path], "pip install libigl")?;
        for (measurement, (key, name)) in
            measurements.iter_mut().zip([("exact", "libigl winding_number"), ("fast", "libigl fast_winding_number")])
        {
            measurement.peer = of_peer(&peer, key, name);
        }
    }
    Ok(measurements)
}

/// Point by point, on one core like the other program.
fn micros_a_point(points: &[[f64; 3]], evaluate: impl Fn([f64; 3]) -> f64) -> f64 {
    let seconds = time_runs(RUNS, || {
        black_box(points.iter().map(|&point| evaluate(point)).sum::<f64>());
    });
    median(&seconds) * 1e6 / points.len() as f64
}

/// Points spread over a box 1.2 times that of the mesh, the same every time.
fn spread(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    // Steps of an additive recurrence with the plastic number fill a box evenly.
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
    let (low, high) = mesh.bounds().unwrap_or_default();
    let at = |i: usize, k: usize| {
        let share = (0.5 + STEPS[k] * i as f64).fract() - 0.5;
        f64::midpoint(low[k], high[k]) + 1.2 * share * (high[k] - low[k])
    };
    (0..POINTS).map(|i| std::array::from_fn(|k| at(i, k))).collect()
}
