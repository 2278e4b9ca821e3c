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
use crate::engine::actor::Actor;
use crate::engine::completion::{IkArgs, IkMode};
use crate::engine::latency::percentile;
use crate::engine::perform::{Next, Source};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::simulated::SimulatedArgs;
use crate::engine::stage::Stage;
use crate::engine::virtual_clock::VirtualPuppet;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "skin/lbs-43k",
    "character/human",
    "pose/human-solve-and-skin-p99",
    "pose/human8-ik-solve-and-skin-p99",
    "pose/human8-ik-prepare",
];

const VERTICES: usize = 43_243;
const BONES: usize = 23;
const SKIN_RUNS: usize = 101;
const CHARACTER_RUNS: usize = 3;
const POSES: usize = 4_000;
const PREPARE_RUNS: usize = 5;
/// What a puppet of eight joints drives.
const EIGHT: [&str; 8] = [
    "UpperChest",
    "Head",
    "LeftUpperArm",
    "RightUpperArm",
    "LeftLowerArm",
    "RightLowerArm",
    "LeftUpperLeg",
    "RightUpperLeg",
];

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let human = Arc::new(characters::find("human", &mut |_| ControlFlow::Continue(()))?.actor);
    let all_joints = IkArgs { ik: IkMode::Off, pin: Vec::new() };
    Ok(vec![
        skin()?,
        character()?,
        pose("pose/human-solve-and-skin-p99", &human, "human", &all_joints)?.at_most(2000.0, "below 2 ms"),
        pose("pose/human8-ik-solve-and-skin-p99", &human, "human8", &IkArgs::default())?.at_most(1000.0, "below 1 ms"),
        prepare(&human)?,
    ])
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

/// What a puppet of eight joints waits for when it is plugged in: inverse kinematics for another set of joints.
fn prepare(human: &Arc<Actor>) -> Result<Measurement, Failure> {
    let failed = |what: String| Failure::not_converged(what, "this is a defect; please report it");
    let mut ik = IkArgs::default().of_actor(human)?.ok_or_else(|| failed("the human has no mesh".into()))?;
    let driven: Vec<bool> = human.skeleton.bones().iter().map(|bone| EIGHT.contains(&bone.name.as_str())).collect();
    let mut outcome = Ok(());
    let seconds =
        time_runs(PREPARE_RUNS, || outcome = ik.drive(black_box(&driven), &mut |_| ControlFlow::Continue(())));
    outcome.map_err(|e| failed(e.to_string()))?;
    Ok(Measurement::new("pose/human8-ik-prepare", median(&seconds) * 1e3, "ms", PREPARE_RUNS))
}

/// A sample of a simulated human, from decoded counts to skinned vertices.
fn pose(name: &'static str, human: &Arc<Actor>, puppet: &str, ik: &IkArgs) -> Result<Measurement, Failure> {
    let performance = Performance::new(human.clone(), None, Calibration::default(), ZeroPolicy::AtStart)?
        .with_inverse_kinematics(ik)?;
    let mut stage: Stage<Vec<u8>> = Stage::new(performance);
    let mut puppet = VirtualPuppet::new(puppet, &SimulatedArgs::default(), 1000.0)?;
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
    Ok(Measurement::new(name, p99, "µs", POSES))
}
