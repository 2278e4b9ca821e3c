//! Bounded biharmonic weights on a tetrahedral mesh with given boundary values, compared with libigl if it is
//! installed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use armature_character::handle_weights::{
    BiharmonicTier, HandleWeights, HandleWeightsSettings, Held, Partition, WeightMethod, WeightsOn, handle_weights,
};
use armature_formats::model::Model;
use armature_formats::tables::{NumberTable, read_npy};
use armature_weights::handles::{FREE_NEAR_JOINTS, HandleBoundary};

use super::{Measurement, of_peer, python_peer, shared_file};
use crate::characters;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::{self, inputs};
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &[
    "weights/hand-certified",
    "weights/hand-certified-difference",
    "weights/hand-certified-energy",
    "weights/hand-interactive",
    "weights/hand-interactive-difference",
    "weights/hand-interactive-bound",
];

const RUNS: usize = 3;
const PEER: &str = "libigl bbw";
const PEER_SCRIPT: &str = "libigl_bbw.py";
const INSTALL: &str = "pip install libigl==2.6.3";
/// The largest difference from the reference allowed for the certified tier.
const DIFFERENCE: f64 = 1e-4;
/// The meaning of "within 2e-3 of certified" for the interactive tier.
const INTERACTIVE: f64 = 2e-3;
/// The energy of libigl's own weights for the hand, with some allowance for rounding.
const LIBIGL_ENERGY: f64 = 14_470.638_565_25 * (1.0 + 1e-9);

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let files = [
        shared_file("hand.mesh"),
        reference("hand-bbw-b.npy"),
        reference("hand-bbw-bc.npy"),
        reference("hand-bbw-w.npy"),
    ];
    let [Some(mesh), Some(fixed), Some(given), Some(expected)] = files else {
        aside!("{}: skipped, the model is not here", NAMES[0]);
        return Ok(Vec::new());
    };
    let model = inputs::model(&mesh)?;
    let indices = table(&fixed)?.indices();
    let indices = indices.ok_or_else(|| Failure::input(format!("{}: no indices", fixed.display()), ""))?;
    let weights = table(&given)?;
    let boundary = HandleBoundary { fixed: indices, fixed_weights: weights.values, handles: weights.columns };
    let expected = table(&expected)?;
    let (certified_seconds, certified) = timed(&model, &boundary, BiharmonicTier::Certified, &mesh)?;
    let (interactive_seconds, interactive) = timed(&model, &boundary, BiharmonicTier::Interactive, &mesh)?;
    let peer = match &args.igl_python {
        None => None,
        Some(python) => Some(python_peer(python, PEER_SCRIPT, &[&mesh, &fixed, &given], INSTALL)?),
    };
    let peers = |key| peer.as_ref().and_then(|measured| of_peer(measured, key, PEER));
    let seconds = |name, seconds| Measurement { peer: peers("seconds"), ..Measurement::new(name, seconds, "s", RUNS) };
    let energy = Measurement::new(NAMES[2], certified.energy(), "", 1).at_most(LIBIGL_ENERGY, "not above libigl's");
    Ok(vec![
        seconds(NAMES[0], certified_seconds),
        Measurement::new(NAMES[1], largest_difference(&certified, &expected), "", 1)
            .at_most(DIFFERENCE, "at most 1e-4"),
        Measurement { peer: peers("energy"), ..energy },
        seconds(NAMES[3], interactive_seconds),
        Measurement::new(NAMES[4], largest_difference(&interactive, &expected), "", 1)
            .at_most(INTERACTIVE, "at most 2e-3"),
        Measurement::new(NAMES[5], interactive.error_bound(), "", 1).at_most(INTERACTIVE, "at most 2e-3"),
    ])
}

/// A reference result, next to the models.
fn reference(name: &str) -> Option<PathBuf> {
    shared_file("hand.mesh").map(|mesh| mesh.with_file_name("../reference").join(name)).filter(|file| file.exists())
}

fn table(path: &Path) -> Result<NumberTable, Failure> {
    Ok(read_npy(&files::read(path)?).map_err(|e| e.in_file(&path.display().to_string()))?)
}

/// The fastest of a few runs.
fn timed(
    model: &Model,
    boundary: &HandleBoundary,
    tier: BiharmonicTier,
    path: &Path,
) -> Result<(f64, HandleWeights), Failure> {
    let settings = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier,
        on: WeightsOn::OwnElements,
        partition: Partition::Left,
        joint_release: FREE_NEAR_JOINTS,
    };
    let mut fastest: Option<(f64, HandleWeights)> = None;
    for _ in 0..RUNS {
        let start = Instant::now();
        let held = Held::Boundary(boundary);
        let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
        let made = handle_weights(&model.mesh, model.tetrahedra.as_ref(), held, &settings, go_on);
        let made = made.map_err(|e| characters::weights_failure(path, &e))?;
        let seconds = start.elapsed().as_secs_f64();
        if fastest.as_ref().is_none_or(|(best, _)| seconds < *best) {
            fastest = Some((seconds, made));
        }
    }
    fastest.ok_or_else(|| Failure::not_converged("no run was made", ""))
}

fn largest_difference(made: &HandleWeights, expected: &NumberTable) -> f64 {
    let Some(made) = made.weights.to_columns().filter(|made| made.len() == expected.values.len()) else {
        return f64::INFINITY;
    };
    made.iter().zip(&expected.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
