//! Volumes of a real model, compared with `TetGen` if it is installed.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::TriangleMesh;
use armature_geometry::volume::{Resolution, Volume, VolumeSettings};

use super::peak_memory::{peak, reset_peak};
use super::{Measurement, of_peer, python_peer, shared_file};
use crate::characters::volumes::{Handles, Made, make, make_failure};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &[
    "volume/conforming-armadillo",
    "volume/conforming-vertices-missing",
    "volume/conforming-facets",
    "volume/conforming-inverted",
    "volume/conforming-dihedrals",
    "volume/conforming-memory",
    "volume/embedded-armadillo",
    "volume/embedded-vertices",
];

const RUNS: usize = 3;
const PEER: &str = "TetGen pq1.414Y";
const PEER_SCRIPT: &str = "tetgen_volume.py";
const EMBEDDED_VERTICES: usize = 10_000;
/// What `TetGen` 0.8.4 takes on the same input on a machine with two cores.
const BUDGET_SECONDS: f64 = 11.5;

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let (Some(mesh_path), Some(skeleton_path)) = (shared_file("armadillo.obj"), shared_file("armadillo.tgf")) else {
        aside!("{}: skipped, the model is not here", NAMES[0]);
        return Ok(Vec::new());
    };
    let mesh = inputs::model(&mesh_path)?.mesh;
    let handles = Handles::of_skeleton(&inputs::skeleton(&skeleton_path)?);
    let (conforming, volume) = timed(&mesh, &handles, Resolution::Conforming, &mesh_path)?;
    let (embedded, coarse) = timed(&mesh, &handles, Resolution::Embedded { vertices: EMBEDDED_VERTICES }, &mesh_path)?;
    let mut seconds =
        Measurement::new(NAMES[0], conforming.seconds, "s", RUNS).at_most(BUDGET_SECONDS, "at most 11.5 s");
    if let Some(python) = &args.tetgen_python {
        let peer = python_peer(python, PEER_SCRIPT, &[&mesh_path, &skeleton_path], "pip install tetgen==0.8.4")?;
        seconds.peer = of_peer(&peer, "seconds", PEER);
    }
    let report = &volume.report;
    let facets = (report.facets_whole + report.facets_cut) as f64 / report.facets.max(1) as f64;
    let thin = report.dihedral_angles.as_ref().map_or(1.0, |a| a.share_below(5));
    let mut measurements = vec![
        seconds,
        Measurement::new(NAMES[1], missing(&mesh, &volume) as f64, "of all", 1).at_most(0.0, "none"),
        Measurement::new(NAMES[2], 100.0 * facets, "%", 1).at_least(99.0, "at least 99 %"),
        Measurement::new(NAMES[3], inverted(&volume) as f64, "of all", 1).at_most(0.0, "none"),
        Measurement::new(NAMES[4], 100.0 * (1.0 - thin), "% ≥ 5°", 1).at_least(99.9, "at least 99.9 %"),
    ];
    match conforming.peak_megabytes {
        Some(peak) => measurements.push(Measurement::new(NAMES[5], peak, "MB", 1).at_most(1000.0, "below 1 GB")),
        None => aside!("{}: skipped, this system does not report memory", NAMES[5]),
    }
    measurements.push(Measurement::new(NAMES[6], embedded.seconds, "s", RUNS).at_most(1.5, "at most 1.5 s"));
    measurements.push(Measurement::new(NAMES[7], coarse.mesh.vertices.len() as f64, "vertices", 1));
    Ok(measurements)
}

/// What a run took.
pub(super) struct Cost {
    /// The median.
    pub(super) seconds: f64,
    /// Peak memory during the run; `None` if the system does not report it.
    pub(super) peak_megabytes: Option<f64>,
}

/// Makes a volume a few times.
fn timed(
    mesh: &TriangleMesh,
    handles: &Handles,
    resolution: Resolution,
    path: &Path,
) -> Result<(Cost, Volume), Failure> {
    let mut seconds = Vec::new();
    let mut made = None;
    let mut peak_megabytes = None;
    for _ in 0..RUNS {
        // Memory of an earlier run must not count for this one.
        drop(made.take());
        reset_peak();
        let start = Instant::now();
        made = Some(volume_of(mesh, handles, resolution, path)?);
        seconds.push(start.elapsed().as_secs_f64());
        peak_megabytes = peak().map(|now| peak_megabytes.map_or(now, |before: f64| before.max(now)));
    }
    seconds.sort_by(f64::total_cmp);
    let volume = made.ok_or_else(|| Failure::not_converged("no run was made", ""))?;
    Ok((Cost { seconds: super::median(&seconds), peak_megabytes }, volume))
}

pub(super) fn volume_of(
    mesh: &TriangleMesh,
    handles: &Handles,
    resolution: Resolution,
    path: &Path,
) -> Result<Volume, Failure> {
    let settings = VolumeSettings { resolution, ..VolumeSettings::default() };
    match make(mesh, handles, &settings, &mut |_, _| ControlFlow::Continue(())).map_err(|e| make_failure(&e, path))? {
        Made::Solid(volume) => Ok(*volume),
        Made::Flat(_) => Err(Failure::input(format!("{} is flat", path.display()), "choose a solid")),
    }
}

/// Vertices of the surface that are not vertices of the volume, compared bit by bit.
fn missing(mesh: &TriangleMesh, volume: &Volume) -> usize {
    let bits = |p: &[f64; 3]| p.map(f64::to_bits);
    let mut there: Vec<[u64; 3]> = volume.mesh.vertices.iter().map(bits).collect();
    there.sort_unstable();
    mesh.vertices.iter().filter(|p| there.binary_search(&bits(p)).is_err()).count()
}

/// Tetrahedra without a positive volume.
fn inverted(volume: &Volume) -> usize {
    let at = |v: u32| glam::DVec3::from(volume.mesh.vertices[v as usize]);
    let six = |t: &[u32; 4]| {
        let [a, b, c, d] = t.map(at);
        (b - a).dot((c - a).cross(d - a))
    };
    volume.mesh.tetrahedra.iter().filter(|t| six(t) <= 0.0 || six(t).is_nan()).count()
}
