//! Bone heat weights on a real model, compared with Blender's automatic weights if `bpy` is installed.

use std::ops::ControlFlow;
use std::path::PathBuf;

use armature_geometry::TriangleMesh;
use armature_rig::Skeleton;
use armature_weights::BoneSegment;
use armature_weights::heat::{BoneHeatSettings, bone_heat};

use super::{Measurement, median, of_peer, python_peer, shared_file, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &["heat/armadillo", "heat/model"];

const RUNS: usize = 3;
const PEER: &str = "Blender automatic weights";
const PEER_SCRIPT: &str = "blender_heat.py";
/// What Blender 5's automatic weights take on the same input on a machine with two cores.
const BUDGET_SECONDS: f64 = 6.0;

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let given = args.model.as_deref().and_then(|m| Some(("heat/model", m.first()?.clone(), m.get(1)?.clone())));
    let Some((name, mesh_path, skeleton_path)) = given.or_else(armadillo) else {
        aside!("heat/armadillo: skipped, the model is not here; name another with --model MESH SKELETON");
        return Ok(Vec::new());
    };
    let mesh = inputs::model(&mesh_path)?.mesh;
    let skeleton = inputs::skeleton(&skeleton_path)?;
    let mut measurement = measure(name, &mesh, &skeleton)?.at_most(BUDGET_SECONDS, "at most 6 s");
    if let Some(python) = &args.bpy_python {
        let peer = python_peer(python, PEER_SCRIPT, &[&mesh_path, &skeleton_path], "pip install bpy")?;
        measurement.peer = of_peer(&peer, "seconds", PEER);
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
        outcome = Some(bone_heat(mesh, &bones, &BoneHeatSettings::default(), &mut |_, _| ControlFlow::Continue(())));
    });
    match outcome {
        Some(Err(error)) => Err(Failure::not_converged(error.to_string(), "")),
        _ => Ok(Measurement::new(name, median(&seconds), "s", RUNS)),
    }
}

/// The model that the budget is stated for.
fn armadillo() -> Option<(&'static str, PathBuf, PathBuf)> {
    Some(("heat/armadillo", shared_file("armadillo.obj")?, shared_file("armadillo.tgf")?))
}
