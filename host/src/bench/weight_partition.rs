//! The exact partition of unity against handles solved separately and scaled, compared as in the BBW paper's table 2.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_character::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeights, HandleWeightsSettings, Held, Partition, WeightMethod,
    WeightsOn, handle_weights,
};
use armature_weights::handles::FREE_NEAR_JOINTS;

use super::weight_convergence::shapes_of;
use super::{Measurement, shared_file};
use crate::characters;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::aside;

/// For each model the mean and the largest difference over all its vertices and handles, as in the paper's table.
pub(super) const NAMES: &[&str] = &[
    "weights/partition-hand",
    "weights/partition-hand-most",
    "weights/partition-armadillo",
    "weights/partition-armadillo-most",
    "weights/partition-elephant",
    "weights/partition-elephant-most",
    "weights/partition-arm",
    "weights/partition-arm-most",
    "weights/partition-woody",
    "weights/partition-woody-most",
];

const MODELS: [(&str, Option<&str>); 5] = [
    ("hand.mesh", Some("hand.tgf")),
    ("armadillo.obj", Some("armadillo.tgf")),
    ("elephant.obj", Some("elephant.tgf")),
    ("arm.obj", Some("arm.tgf")),
    ("woody.obj", None),
];
/// Points on the flat figure: hands, feet, head and belly, in its unit.
const WOODY: [[f64; 2]; 6] =
    [[25.0, 235.0], [325.0, 235.0], [115.0, 25.0], [255.0, 25.0], [170.0, 350.0], [175.0, 150.0]];
/// Approximate vertices of the volume.
const VERTICES: usize = 2_500;

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let mut measurements = Vec::new();
    for ((mesh, skeleton), names) in MODELS.into_iter().zip(NAMES.chunks_exact(2)) {
        let (Some(path), Some(skeleton)) =
            (shared_file(mesh), skeleton.map_or(Some(None), |s| shared_file(s).map(Some)))
        else {
            aside!("{}: skipped, the model is not here", names[0]);
            continue;
        };
        let shapes = match skeleton {
            Some(skeleton) => shapes_of(&inputs::skeleton(&skeleton)?),
            None => points(),
        };
        let (alone, seconds) = solved(&path, &shapes, Partition::Normalised)?;
        if alone.unconverged() > 0 {
            return Err(Failure::not_converged(format!("{}: the weights did not converge", path.display()), ""));
        }
        let (together, longer) = solved(&path, &shapes, Partition::Exact)?;
        let bound = together.error_bound();
        aside!(
            "{}: {} handles, {} vertices; alone in {seconds:.2} s, together in {longer:.2} s to {bound:.1e}",
            path.display(),
            shapes.len(),
            alone.domain_vertices
        );
        let of_handle = |handle: usize| alone.weights.bone(handle).into_iter().zip(together.weights.bone(handle));
        let apart = || (0..shapes.len()).flat_map(of_handle).map(|(a, b)| (a - b).abs());
        let mean = apart().sum::<f64>() / apart().count().max(1) as f64;
        // Slivers make the bound useless long before the weights are: the numbers are reported with what is known about
        // them.
        let note = (together.unconverged() > 0).then_some("stopped at the limit of steps, not certified");
        measurements.push(Measurement { note, ..Measurement::new(names[0], mean, "mean |Δw|", 1) });
        let most = apart().fold(0.0, f64::max);
        measurements.push(Measurement { note, ..Measurement::new(names[1], most, "max |Δw|", 1) });
    }
    Ok(measurements)
}

fn points() -> Vec<HandleShape> {
    let point = |(k, &[x, y]): (usize, &[f64; 2])| HandleShape {
        name: format!("point_{}", k + 1),
        place: HandlePlace::Point([x, y, 0.0]),
    };
    WOODY.iter().enumerate().map(point).collect()
}

fn solved(path: &Path, shapes: &[HandleShape], partition: Partition) -> Result<(HandleWeights, f64), Failure> {
    let mesh = inputs::model(path)?.mesh;
    let start = Instant::now();
    let on = WeightsOn::Volume { vertices: VERTICES };
    let settings = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier: BiharmonicTier::Interactive,
        on,
        partition,
        joint_release: FREE_NEAR_JOINTS,
    };
    let held = Held::Shapes { shapes, cage: &[] };
    let made = handle_weights(&mesh, None, held, &settings, &mut |_, _| ControlFlow::Continue(()))
        .map_err(|e| characters::weights_failure(path, &e))?;
    Ok((made, start.elapsed().as_secs_f64()))
}
