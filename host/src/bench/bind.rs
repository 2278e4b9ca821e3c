//! From an OBJ and a skeleton to a bound character, as a user does it: the program as a process, first without and then
//! with its cache, compared with Blender's automatic weights if `bpy` is installed.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::peak_memory::peak_of;
use super::{Measurement, median, of_peer, python_peer, shared_file};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &["bind/armadillo", "bind/armadillo-memory", "bind/armadillo-cached", "bind/model"];

const RUNS: usize = 3;
const PEER: &str = "Blender automatic weights";
const PEER_SCRIPT: &str = "blender_heat.py";
/// How often a running program's memory is measured.
const LOOK_EVERY: Duration = Duration::from_millis(5);

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let given = args.model.as_deref().and_then(|m| Some((m.first()?.clone(), m.get(1)?.clone())));
    let is_given = given.is_some();
    let Some((mesh, skeleton)) = given.or_else(|| shared_file("armadillo.obj").zip(shared_file("armadillo.tgf")))
    else {
        aside!("{}: skipped, the model is not here; name another with --model MESH SKELETON", NAMES[0]);
        return Ok(Vec::new());
    };
    let folder = std::env::temp_dir().join(format!("armature-bench-bind-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| trouble(&e))?;
    let measured = measure(&mesh, &skeleton, &folder);
    // Left-overs in the system's temporary folder do no harm.
    let _ = std::fs::remove_dir_all(&folder);
    let (mut whole, cached) = measured?;
    if is_given {
        whole.seconds.name = NAMES[3];
        return Ok(vec![whole.seconds]);
    }
    if let Some(python) = &args.bpy_python {
        let peer = python_peer(python, PEER_SCRIPT, &[&mesh, &skeleton], "pip install bpy")?;
        whole.seconds.peer = of_peer(&peer, "seconds", PEER);
    }
    let mut measurements = vec![whole.seconds.at_most(6.0, "at most 6 s")];
    match whole.megabytes {
        Some(peak) => measurements.push(Measurement::new(NAMES[1], peak, "MB", 1).at_most(1500.0, "below 1.5 GB")),
        None => aside!("{}: skipped, this system does not report memory", NAMES[1]),
    }
    measurements.push(cached.at_most(0.3, "at most 0.3 s"));
    Ok(measurements)
}

struct Whole {
    seconds: Measurement,
    /// Peak memory; `None` where the system does not report it.
    megabytes: Option<f64>,
}

fn measure(mesh: &PathBuf, skeleton: &PathBuf, folder: &Path) -> Result<(Whole, Measurement), Failure> {
    let (mut fresh, mut kept) = (Vec::new(), Vec::new());
    let mut megabytes: Option<f64> = None;
    for _ in 0..RUNS {
        let (seconds, peak) = bind(mesh, skeleton, folder, &["--no-cache"])?;
        fresh.push(seconds);
        megabytes = peak.map(|now| megabytes.map_or(now, |before| before.max(now)));
    }
    for _ in 0..RUNS {
        kept.push(bind(mesh, skeleton, folder, &[])?.0);
    }
    fresh.sort_by(f64::total_cmp);
    kept.sort_by(f64::total_cmp);
    let seconds = Measurement::new(NAMES[0], median(&fresh), "s", RUNS);
    Ok((Whole { seconds, megabytes }, Measurement::new(NAMES[2], median(&kept), "s", RUNS)))
}

/// Runs `armature bind` with settings and cache in `folder`; returns its seconds and peak memory.
fn bind(mesh: &PathBuf, skeleton: &PathBuf, folder: &Path, more: &[&str]) -> Result<(f64, Option<f64>), Failure> {
    let program = std::env::current_exe().map_err(|e| trouble(&e))?;
    let mut command = Command::new(program);
    command.arg("bind").arg(mesh).arg("--skeleton").arg(skeleton).arg("--output").arg(folder.join("bound.armature"));
    for variable in ["HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"] {
        command.env(variable, folder);
    }
    command.arg("--quiet").args(more).stdin(Stdio::null()).stdout(Stdio::null());
    let start = Instant::now();
    let mut child = command.spawn().map_err(|e| trouble(&e))?;
    let mut peak = None;
    let status = loop {
        peak = peak_of(child.id()).or(peak);
        if let Some(status) = child.try_wait().map_err(|e| trouble(&e))? {
            break status;
        }
        std::thread::sleep(LOOK_EVERY);
    };
    let seconds = start.elapsed().as_secs_f64();
    if !status.success() {
        return Err(Failure::not_converged(format!("binding {} ended with {status}", mesh.display()), ""));
    }
    Ok((seconds, peak))
}

fn trouble(error: &std::io::Error) -> Failure {
    Failure::input(format!("the benchmark cannot run: {error}"), "")
}
