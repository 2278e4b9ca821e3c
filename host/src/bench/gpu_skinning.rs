//! A crowd skinned on the graphics adapter, if there is one.

use std::hint::black_box;

use armature_deform::skin::LinearBlendSkin;
use armature_render::{Gpu, GpuSkin, RestShape, SkinMethod, SkinPoses};
use glam::{Affine3A, Vec3};

use super::deform::{CROWD, Shape, defect};
use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &["gpu/skin-crowd-of-100"];

const RUNS: usize = 21;

/// A hundred poses of 43,243 vertices, from bones in memory to positions and normals on the adapter, compared with the
/// kernel that does the same on one core.
pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let gpu = match Gpu::request() {
        Ok(gpu) => gpu,
        Err(error) => {
            aside!("note: gpu/… is skipped: {error}");
            return Ok(Vec::new());
        }
    };
    let Shape { positions, influences, rest, pose } = Shape::new()?;
    let crowd = |frame: usize| -> Vec<Affine3A> {
        let place = |number: usize| Affine3A::from_translation(Vec3::X * (number + frame) as f32);
        (0..CROWD).flat_map(|number| pose.iter().map(move |bone| place(number) * *bone)).collect()
    };
    let shape = RestShape { positions: &positions, normals: &positions, influences: &influences };
    let failed = |e: armature_render::RenderError| defect(e.to_string());
    let mut skin = GpuSkin::precompute(&gpu, &shape, &SkinMethod::LinearBlend(&rest), CROWD).map_err(failed)?;
    let mut outcome = Ok(());
    let mut frame = 0;
    let by_gpu = time_runs(RUNS, || {
        frame += 1;
        let skinned = skin.solve(&gpu, &SkinPoses::Frames(&crowd(frame))).and_then(|()| gpu.wait());
        outcome = std::mem::replace(&mut outcome, Ok(())).and(skinned);
    });
    outcome.map_err(failed)?;
    let mut twin =
        LinearBlendSkin::precompute(&positions, &positions, &influences, &rest).map_err(|e| defect(e.to_string()))?;
    let (mut out, mut normals) = (positions.clone(), positions.clone());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| defect(e.to_string()))?;
    let poses = crowd(0);
    let by_cpu = pool.install(|| {
        time_runs(RUNS, || {
            for pose in poses.chunks(rest.len()) {
                black_box(twin.solve(pose, &mut out, &mut normals)).ok();
            }
        })
    });
    let peer = format!("one core, beside {}", gpu.label());
    Ok(vec![Measurement {
        peer: Some((peer, median(&by_cpu) * 1e3)),
        ..Measurement::new(NAMES[0], median(&by_gpu) * 1e3, "ms", RUNS)
    }])
}
