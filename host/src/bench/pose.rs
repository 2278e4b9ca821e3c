//! What happens between a sample and the picture, without the wire.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use armature_rig::Calibration;

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
    "character/human",
    "pose/human-solve-and-skin-p99",
    "pose/human8-ik-solve-and-skin-p99",
    "pose/human8-ik-prepare",
];

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
    let all_joints = IkArgs { ik: IkMode::Off, ..IkArgs::default() };
    Ok(vec![
        character()?,
        pose("pose/human-solve-and-skin-p99", &human, "human", &all_joints)?.at_most(2000.0, "below 2 ms"),
        pose("pose/human8-ik-solve-and-skin-p99", &human, "human8", &IkArgs::default())?.at_most(1000.0, "below 1 ms"),
        prepare(&human)?,
    ])
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
