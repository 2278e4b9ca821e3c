//! What happens between a sample and the picture, without the wire.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use armature_deform::LinearBlendSkin;
use armature_geometry::Influences;
use armature_rig::Calibration;
use glam::{Affine3A, Quat, Vec3};

use super::{Measurement, median, time_runs};
use crate::characters;
use crate::cli::args::BenchArgs;
use crate::engine::latency::percentile;
use crate::engine::perform::{Next, Source};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::simulated::SimulatedArgs;
use crate::engine::stage::Stage;
use crate::engine::virtual_clock::VirtualPuppet;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &["skin/lbs-43k", "character/human", "pose/human-solve-and-skin-p99"];

const VERTICES: usize = 43_243;
const BONES: usize = 23;
const SKIN_RUNS: usize = 101;
const CHARACTER_RUNS: usize = 3;
const POSES: usize = 4_000;

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    Ok(vec![skin()?, character()?, pose()?])
}

/// As many vertices and bones as the armadillo, four influences each.
fn skin() -> Result<Measurement, Failure> {
    let failed = |what: String| Failure::not_converged(what, "this is a defect; please report it");
    let positions: Vec<[f32; 3]> = (0..VERTICES).map(|i| spiral(i as f32)).collect();
    let bones: Vec<u16> = (0..VERTICES * 4).map(|i| ((i / 4 * BONES / VERTICES + i % 4) % BONES) as u16).collect();
    let weights: Vec<f32> = (0..VERTICES * 4).map(|i| [0.4, 0.3, 0.2, 0.1][i % 4]).collect();
    let influences = Influences::new(4, bones, weights, BONES).map_err(|e| failed(e.to_string()))?;
    let rest = vec![Affine3A::IDENTITY; BONES];
    let mut skin =
        LinearBlendSkin::precompute(&positions, &positions, &influences, &rest).map_err(|e| failed(e.to_string()))?;
    let pose: Vec<Affine3A> = (0..BONES)
        .map(|b| Affine3A::from_rotation_translation(Quat::from_rotation_y(b as f32 * 0.05), Vec3::X * b as f32 * 0.01))
        .collect();
    let (mut out, mut normals) = (positions.clone(), positions);
    let mut outcome = Ok(());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| failed(e.to_string()))?;
    let seconds =
        pool.install(|| time_runs(SKIN_RUNS, || outcome = skin.solve(black_box(&pose), &mut out, &mut normals)));
    outcome.map_err(|e| failed(e.to_string()))?;
    Ok(Measurement::new("skin/lbs-43k", median(&seconds) * 1e3, "ms", SKIN_RUNS)
        .at_most(0.5, "at most 0.5 ms on one core"))
}

fn spiral(i: f32) -> [f32; 3] {
    let (height, angle) = (i / VERTICES as f32 * 2.0 - 1.0, i * 2.399_963);
    let radius = (1.0 - height * height).max(0.0).sqrt();
    [radius * angle.cos(), height, radius * angle.sin()]
}

/// The human made anew, not from the cache.
fn character() -> Result<Measurement, Failure> {
    let mut outcome = Ok(());
    let seconds = time_runs(CHARACTER_RUNS, || {
        if let Err(error) = armature_character::human() {
            outcome = Err(Failure::not_converged(error.to_string(), "this is a defect; please report it"));
        }
    });
    outcome?;
    Ok(Measurement::new("character/human", median(&seconds), "s", CHARACTER_RUNS))
}

/// A sample of the simulated human, from decoded counts to skinned vertices.
fn pose() -> Result<Measurement, Failure> {
    let found = characters::find("human", &mut |_| ControlFlow::Continue(()))?;
    let performance = Performance::new(Arc::new(found.actor), None, Calibration::default(), ZeroPolicy::AtStart)?;
    let mut stage: Stage<Vec<u8>> = Stage::new(performance);
    let mut puppet = VirtualPuppet::new("human", &SimulatedArgs::default(), 1000.0)?;
    let mut micros = Vec::with_capacity(POSES);
    while micros.len() < POSES {
        let Next::Event(event) = puppet.next() else { continue };
        let start = std::time::Instant::now();
        if stage.handle(&event)?.posed {
            micros.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    micros.sort_by(f64::total_cmp);
    let p99 = percentile(&micros, 0.99);
    Ok(Measurement::new("pose/human-solve-and-skin-p99", p99, "µs", POSES).at_most(2000.0, "below 2 ms"))
}
