//! How the time and memory of bounded biharmonic weights grow with the number of handles and with the volume.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::TetrahedralMesh;
use armature_geometry::operators::{Lumping, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_geometry::volume::Resolution;
use armature_weights::biharmonic::{
    BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, BiharmonicWeights, bounded_biharmonic_weights,
};
use armature_weights::handles::{Handle, HandleKind, handle_boundary};
use glam::DVec3;

use super::peak_memory::{peak, reset_peak};
use super::volume::volume_of;
use super::volume_growth::exponent;
use super::{Measurement, shared_file};
use crate::characters::volumes::Handles;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::aside;

/// Exponents of seconds, of peak memory and of the number of stored weights over handles, and the seconds for each
/// number; the exponent of seconds over vertices, and the seconds for each volume.
pub(super) const NAMES: &[&str] = &[
    "weights/growth-with-handles",
    "weights/growth-with-handles-memory",
    "weights/growth-with-handles-stored",
    "weights/growth-10-handles",
    "weights/growth-30-handles",
    "weights/growth-100-handles",
    "weights/growth-300-handles",
    "weights/growth-1000-handles",
    "weights/growth-1000-handles-memory",
    "weights/growth-with-vertices",
    "weights/growth-2500-vertices",
    "weights/growth-5000-vertices",
    "weights/growth-10000-vertices",
    "weights/growth-20000-vertices",
];

const MODEL: &str = "elephant.obj";
const HANDLES: [usize; 5] = [10, 30, 100, 300, 1000];
const DEFAULT_VERTICES: usize = 10_000;
const VERTICES: [usize; 4] = [2_500, 5_000, 10_000, 20_000];
/// Handles in all of the volumes.
const FEW: usize = 100;

/// One problem's size and cost.
struct Sample {
    vertices: usize,
    seconds: f64,
    peak_megabytes: Option<f64>,
    stored: usize,
}

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let Some(path) = shared_file(MODEL) else {
        aside!("{}: skipped, the model is not here", NAMES[0]);
        return Ok(Vec::new());
    };
    let surface = inputs::model(&path)?.mesh;
    let volume = |vertices| volume_of(&surface, &Handles::default(), Resolution::Embedded { vertices }, &path);
    let mut measurements = Vec::new();
    if asked(args, &NAMES[..9]) {
        let mesh = volume(DEFAULT_VERTICES)?.mesh;
        let samples = HANDLES.iter().map(|&handles| measure(&mesh, handles, &path));
        let samples = samples.collect::<Result<Vec<Sample>, Failure>>()?;
        let power = |value: &dyn Fn(&Sample) -> f64| {
            exponent(&HANDLES.iter().zip(&samples).map(|(&m, s)| (m as f64, value(s))).collect::<Vec<_>>())
        };
        let seconds = power(&|sample| sample.seconds);
        measurements.push(Measurement::new(NAMES[0], seconds, "power", 1).at_most(1.0, "at most 1"));
        let peaks: Option<Vec<f64>> = samples.iter().map(|sample| sample.peak_megabytes).collect();
        match &peaks {
            Some(peaks) => {
                let points: Vec<_> = HANDLES.iter().zip(peaks).map(|(&m, &peak)| (m as f64, peak)).collect();
                measurements.push(Measurement::new(NAMES[1], exponent(&points), "power", 1).at_most(1.0, "at most 1"));
            }
            None => aside!("{}: skipped, this system does not report memory", NAMES[1]),
        }
        let stored = power(&|sample| sample.stored as f64);
        measurements.push(Measurement::new(NAMES[2], stored, "power", 1).at_most(1.0, "at most 1"));
        let seconds = NAMES[3..8].iter().zip(&samples);
        measurements.extend(seconds.map(|(name, sample)| Measurement::new(name, sample.seconds, "s", 1)));
        let last = peaks.and_then(|peaks| peaks.last().copied());
        measurements.extend(last.map(|peak| Measurement::new(NAMES[8], peak, "MB", 1)));
    }
    if asked(args, &NAMES[9..]) {
        let mut points = Vec::new();
        for (&vertices, name) in VERTICES.iter().zip(&NAMES[10..]) {
            let sample = measure(&volume(vertices)?.mesh, FEW, &path)?;
            points.push((sample.vertices as f64, sample.seconds));
            measurements.push(Measurement::new(name, sample.seconds, "s", 1));
        }
        let at = measurements.len() - points.len();
        measurements.insert(at, Measurement::new(NAMES[9], exponent(&points), "power", 1));
    }
    Ok(measurements)
}

/// Whether any of these names was requested.
fn asked(args: &BenchArgs, names: &[&str]) -> bool {
    args.what.as_deref().is_none_or(|what| names.iter().any(|name| name.contains(what)))
}

/// Weights of point handles that are as far from each other as possible.
fn measure(mesh: &TetrahedralMesh, handles: usize, path: &Path) -> Result<Sample, Failure> {
    let failed = |what: String| Failure::not_converged(format!("{}: {what}", path.display()), "");
    let point = |vertex: usize| Handle { kind: HandleKind::Own, vertices: vec![vertex] };
    let points: Vec<Handle> = farthest_points(&mesh.vertices, handles).into_iter().map(point).collect();
    reset_peak();
    let start = Instant::now();
    let boundary = handle_boundary(&mesh.vertices, &points, &[]).map_err(|e| failed(e.to_string()))?;
    let laplacian = cotangent_laplacian_tetrahedra(mesh).map_err(|e| failed(e.to_string()))?.matrix;
    let mass = lumped_mass_tetrahedra(mesh, Lumping::Barycentric).map_err(|e| failed(e.to_string()))?;
    let problem = BiharmonicProblem {
        laplacian: &laplacian,
        mass: &mass,
        fixed: &boundary.fixed,
        fixed_weights: &boundary.fixed_weights,
        handles: boundary.handles,
        shape_preservation: None,
    };
    let settings = BiharmonicSettings::interactive();
    let BiharmonicWeights { weights, reports, .. } =
        bounded_biharmonic_weights(&problem, &settings, &mut |_, _| ControlFlow::Continue(()))
            .map_err(|e| failed(e.to_string()))?;
    let seconds = start.elapsed().as_secs_f64();
    let peak_megabytes = peak();
    if reports.iter().any(|report| report.outcome != BiharmonicOutcome::Converged) {
        return Err(failed("the weights did not converge".into()));
    }
    let (vertices, stored) = (mesh.vertices.len(), weights.stored());
    aside!(
        "{handles:>5} handles, {vertices:>6} vertices: {seconds:>7.2} s, {:>8.2} ms a handle, {:>6.0} vertices follow \
         each, {} at most",
        1e3 * seconds / handles as f64,
        stored as f64 / handles as f64,
        peak_megabytes.map_or("unknown memory".into(), |peak| format!("{peak:.0} MB")),
    );
    Ok(Sample { vertices, seconds, peak_megabytes, stored })
}

/// This many of `points`, starting with the first, each the farthest from all before it; ascending.
fn farthest_points(points: &[[f64; 3]], count: usize) -> Vec<usize> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut chosen = Vec::with_capacity(count);
    let mut next = 0;
    while chosen.len() < count.min(points.len()) {
        chosen.push(next);
        let last = DVec3::from(points[next]);
        for (distance, &point) in distances.iter_mut().zip(points) {
            *distance = distance.min(last.distance_squared(point.into()));
        }
        next = (0..points.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_keep_away_from_each_other() {
        let line: Vec<[f64; 3]> = (0..9).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        assert_eq!(farthest_points(&line, 3), [0, 4, 8]);
        assert_eq!(farthest_points(&line, 20), (0..9).collect::<Vec<_>>());
        assert!(farthest_points(&[], 3).is_empty());
    }
}
