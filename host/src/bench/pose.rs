//! What happens between a sample and the picture, without the wire.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use armature_rig::Calibration;

use super::{Measurement, median, time_runs};
use crate::characters::ground::{GroundArgs, GroundChoice};
use crate::characters::inverse_kinematics::{IkArgs, IkMode};
use crate::characters::{self, LoadedCharacter};
use crate::cli::args::BenchArgs;
use crate::engine::latency::percentile;
use crate::engine::pipeline::Pipeline;
use crate::engine::puppeteer::{Puppeteer, ZeroPolicy};
use crate::engine::sources::VirtualSource;
use crate::engine::sources::simulated::SimulatedArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "character/human",
    "pose/human-solve-and-skin-p99",
    "pose/human8-ik-solve-and-skin-p99",
    "pose/human-standing-p99",
    "pose/human8-standing-p99",
    "pose/human8-ik-prepare",
];

const CHARACTER_RUNS: usize = 3;
const POSES: usize = 4_000;
const PREPARE_RUNS: usize = 5;
/// The bones that a puppet with eight joints drives.
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
    let human = Arc::new(characters::find("human", &mut |_, _| ControlFlow::Continue(()))?.character);
    let all_joints = IkArgs { ik: IkMode::Off, ..IkArgs::default() };
    let (off, walk) = (GroundArgs::default(), GroundArgs { ground: Some(GroundChoice::Walk), contacts: Vec::new() });
    let plain = pose("pose/human-solve-and-skin-p99", &human, "human", &all_joints, &off)?;
    let beside_plain = |name: &'static str, puppet: &str, ik: &IkArgs| {
        let standing = pose(name, &human, puppet, ik, &walk)?;
        let limit = 3.0 * plain.value;
        let standing = standing.at_most(limit, "at most 3 times the plain one");
        Ok::<_, Failure>(Measurement {
            peer: Some(("without floor and inverse kinematics".into(), plain.value)),
            ..standing
        })
    };
    Ok(vec![
        character()?,
        beside_plain("pose/human-standing-p99", "human", &all_joints)?,
        // With the limits of a human's joints.
        beside_plain("pose/human8-standing-p99", "human8", &IkArgs::default())?,
        pose("pose/human8-ik-solve-and-skin-p99", &human, "human8", &IkArgs::default(), &off)?
            .at_most(1000.0, "below 1 ms"),
        plain.at_most(2000.0, "below 2 ms"),
        prepare(&human)?,
    ])
}

/// The human, made from scratch rather than read from the cache.
fn character() -> Result<Measurement, Failure> {
    let mut outcome = Ok(());
    let seconds = time_runs(CHARACTER_RUNS, || {
        if let Err(error) = armature_character::own::human() {
            outcome = Err(Failure::not_converged(error.to_string(), "this is a defect; please report it"));
        }
    });
    outcome?;
    Ok(Measurement::new("character/human", median(&seconds), "s", CHARACTER_RUNS))
}

/// The wait when a puppet with eight joints is plugged in: inverse kinematics is prepared for another set of joints.
fn prepare(human: &Arc<LoadedCharacter>) -> Result<Measurement, Failure> {
    let failed = |what: String| Failure::not_converged(what, "this is a defect; please report it");
    let mut ik = IkArgs::default().for_character(human)?.ok_or_else(|| failed("the human has no mesh".into()))?;
    let driven: Vec<bool> = human.skeleton.bones().iter().map(|bone| EIGHT.contains(&bone.name.as_str())).collect();
    let mut outcome = Ok(());
    let seconds =
        time_runs(PREPARE_RUNS, || outcome = ik.drive(black_box(&driven), &mut |_, _| ControlFlow::Continue(())));
    outcome.map_err(|e| failed(e.to_string()))?;
    Ok(Measurement::new("pose/human8-ik-prepare", median(&seconds) * 1e3, "ms", PREPARE_RUNS))
}

/// A sample of a simulated human, from decoded counts to skinned vertices.
fn pose(
    name: &'static str,
    human: &Arc<LoadedCharacter>,
    puppet: &str,
    ik: &IkArgs,
    ground: &GroundArgs,
) -> Result<Measurement, Failure> {
    let puppeteer = Puppeteer::new(human.clone(), None, Calibration::default(), ZeroPolicy::AtStart)?
        .with_inverse_kinematics(ik)?
        .with_ground(ground)?;
    let mut pipeline: Pipeline<Vec<u8>> = Pipeline::new(puppeteer);
    let mut puppet = VirtualSource::new(puppet, &SimulatedArgs::default(), 1000.0)?;
    let mut micros = Vec::with_capacity(POSES);
    while micros.len() < POSES {
        let Some(event) = puppet.next_event() else { continue };
        let start = std::time::Instant::now();
        if pipeline.handle(&event)?.posed {
            micros.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    micros.sort_by(f64::total_cmp);
    let p99 = percentile(&micros, 0.99);
    Ok(Measurement::new(name, p99, "µs", POSES))
}
