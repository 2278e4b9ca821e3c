//! Bone heat weights on a real model, beside Blender's automatic weights where `bpy` is installed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use armature_geometry::TriangleMesh;
use armature_rig::Skeleton;
use armature_weights::{BoneHeatSettings, BoneSegment, bone_heat};

use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::inputs;

pub(super) const NAMES: &[&str] = &["heat/armadillo", "heat/model"];

const RUNS: usize = 3;
const PEER: &str = "Blender automatic weights";
/// What Blender 5's automatic weights take on the same input on a machine of two cores.
const BUDGET_SECONDS: f64 = 6.0;

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let given = args.model.as_deref().and_then(|m| Some(("heat/model", m.first()?.clone(), m.get(1)?.clone())));
    let Some((name, mesh_path, skeleton_path)) = given.or_else(shared_model) else {
        eprintln!("heat/armadillo: skipped, the model is not here; name another with --model MESH SKELETON");
        return Ok(Vec::new());
    };
    let mesh = inputs::model(&mesh_path)?.mesh;
    let skeleton = inputs::skeleton(&skeleton_path)?;
    let mut measurement = measure(name, &mesh, &skeleton)?.at_most(BUDGET_SECONDS, "at most 6 s");
    if let Some(python) = &args.bpy_python {
        measurement.peer = Some((PEER.into(), blender_seconds(python, &mesh_path, &skeleton_path)?));
    }
    Ok(vec![measurement])
}

fn measure(name: &'static str, mesh: &TriangleMesh, skeleton: &Skeleton) -> Result<Measurement, Failure> {
    let bones: Vec<BoneSegment> = skeleton
        .rest_segments()
        .into_iter()
        .filter(|(head, tail)| head != tail)
        .map(|(head, tail)| BoneSegment { head: head.as_dvec3().to_array(), tail: tail.as_dvec3().to_array() })
        .collect();
    let mut outcome = None;
    let seconds = time_runs(RUNS, || {
        outcome = Some(bone_heat(mesh, &bones, &BoneHeatSettings::default(), &mut |_| ControlFlow::Continue(())));
    });
    match outcome {
        Some(Err(error)) => Err(Failure::not_converged(error.to_string(), "")),
        _ => Ok(Measurement::new(name, median(&seconds), "s", RUNS)),
    }
}

/// The model that the budgets are stated for, where a checkout has the shared data beside it.
fn shared_model() -> Option<(&'static str, PathBuf, PathBuf)> {
    let here = std::env::current_dir().ok()?;
    let folder = here.ancestors().map(|a| a.join("shared/data")).find(|d| d.is_dir())?;
    let (mesh, skeleton) = (folder.join("armadillo.obj"), folder.join("armadillo.tgf"));
    mesh.exists().then_some(("heat/armadillo", mesh, skeleton))
}

/// Seconds of Blender's automatic weights alone, by the script that also compares the values.
fn blender_seconds(python: &Path, mesh: &Path, skeleton: &Path) -> Result<f64, Failure> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/blender_heat.py");
    let failed = |what: String| Failure::usage(what, "give a Python that can `import bpy` (pip install bpy)");
    let output = Command::new(python)
        .arg(&script)
        .args([mesh, skeleton])
        .output()
        .map_err(|e| failed(format!("{} does not start: {e}", python.display())))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let seconds =
        text.lines().rev().find_map(|line| serde_json::from_str::<serde_json::Value>(line).ok()?["seconds"].as_f64());
    seconds.ok_or_else(|| {
        failed(format!("{} said no time: {}", script.display(), String::from_utf8_lossy(&output.stderr)))
    })
}
