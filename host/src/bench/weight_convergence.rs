//! How weights on the surface change as the embedded volume they are computed in is refined.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_character::bind::WEIGHT_VOLUME_VERTICES;
use armature_character::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeights, HandleWeightsSettings, Held, Partition, WeightMethod,
    WeightsOn, handle_weights,
};
use armature_geometry::TriangleMesh;
use armature_rig::Skeleton;
use armature_weights::WeightMatrix;
use armature_weights::handles::FREE_NEAR_JOINTS;
use plotters::prelude::*;

use super::{Measurement, shared_file};
use crate::characters;
use crate::characters::volumes::Handles;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::{Overwrite, inputs};
use crate::terminal::aside;

/// For each model, the mean and largest difference (where a weight is above [`COUNTS`]) between weights in a volume of
/// [`WEIGHT_VOLUME_VERTICES`] and those in the finest.
pub(super) const NAMES: &[&str] = &[
    "weights/convergence-armadillo",
    "weights/convergence-armadillo-most",
    "weights/convergence-elephant",
    "weights/convergence-elephant-most",
    "weights/convergence-hand",
    "weights/convergence-hand-most",
];

const MODELS: [(&str, &str, &str); 3] = [
    ("armadillo", "armadillo.obj", "armadillo.tgf"),
    ("elephant", "elephant.obj", "elephant.tgf"),
    ("hand", "hand.mesh", "hand.tgf"),
];
/// Approximate vertices of the embedded volume; the others are compared with the last.
const SIZES: [usize; 5] = [1_250, 2_500, 5_000, 10_000, 20_000];
/// Weights below this on both sides do not count, so that empty regions do not flatter the mean.
const COUNTS: f64 = 0.01;
const PLOT_SIZE: (u32, u32) = (960, 480);

/// One model at one resolution.
struct Sample {
    vertices: usize,
    seconds: f64,
    /// Mean and largest difference from the finest; `None` for the finest itself.
    error: Option<(f64, f64)>,
}

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let mut measurements = Vec::new();
    let mut curves = Vec::new();
    for (&(label, model, skeleton), names) in MODELS.iter().zip(NAMES.chunks_exact(2)) {
        let (Some(model), Some(skeleton)) = (shared_file(model), shared_file(skeleton)) else {
            aside!("{}: skipped, the model is not here", names[0]);
            continue;
        };
        let mesh = inputs::model(&model)?.mesh;
        let shapes = shapes_of(&inputs::skeleton(&skeleton)?);
        let samples = refine(&mesh, &shapes, &model)?;
        let at_default = SIZES.iter().position(|&size| size == WEIGHT_VOLUME_VERTICES).and_then(|k| samples[k].error);
        if let Some((mean, most)) = at_default {
            measurements.push(Measurement::new(names[0], mean, "mean |Δw|", 1));
            measurements.push(Measurement::new(names[1], most, "max |Δw|", 1));
        }
        curves.push((label, samples));
    }
    if let Some(file) = &args.plot {
        let svg = plot(&curves).map_err(|e| Failure::not_converged(format!("{}: {e}", file.display()), ""))?;
        Overwrite { force: true }.write(file, svg.as_bytes())?;
    }
    Ok(measurements)
}

fn refine(mesh: &TriangleMesh, shapes: &[HandleShape], path: &Path) -> Result<Vec<Sample>, Failure> {
    let mut found: Vec<(HandleWeights, f64)> = Vec::new();
    for vertices in SIZES {
        let start = Instant::now();
        let settings = HandleWeightsSettings {
            method: WeightMethod::BoundedBiharmonic,
            tier: BiharmonicTier::Interactive,
            on: WeightsOn::Volume { vertices },
            partition: Partition::Normalised,
            joint_release: FREE_NEAR_JOINTS,
        };
        let held = Held::Shapes { shapes, cage: &[] };
        let made = handle_weights(mesh, None, held, &settings, &mut |_, _| ControlFlow::Continue(()))
            .map_err(|e| characters::weights_failure(path, &e))?;
        if made.unconverged() > 0 {
            return Err(Failure::not_converged(format!("{}: the weights did not converge", path.display()), ""));
        }
        let seconds = start.elapsed().as_secs_f64();
        aside!("{}: {} vertices in {seconds:.2} s", path.display(), made.domain_vertices);
        found.push((made, seconds));
    }
    let finest = found.last().map(|(made, _)| made.weights.clone()).unwrap_or_default();
    let last = found.len() - 1;
    let sample = |(index, (made, seconds)): (usize, &(HandleWeights, f64))| {
        let error = (index < last).then(|| difference(&made.weights, &finest));
        if let Some((mean, most)) = error {
            aside!("{}: {} vertices: mean {mean:.4}, largest {most:.3}", path.display(), made.domain_vertices);
        }
        Sample { vertices: made.domain_vertices, seconds: *seconds, error }
    };
    Ok(found.iter().enumerate().map(sample).collect())
}

/// The bones with a length.
pub(super) fn shapes_of(skeleton: &Skeleton) -> Vec<HandleShape> {
    let bones = Handles::of_skeleton(skeleton);
    let shape = |(name, ends)| HandleShape { name, place: HandlePlace::Segments(vec![ends]) };
    bones.names.into_iter().zip(bones.segments).map(shape).collect()
}

/// Mean and largest difference where either weight counts.
fn difference(a: &WeightMatrix, b: &WeightMatrix) -> (f64, f64) {
    let of_bone = |bone: usize| a.bone(bone).into_iter().zip(b.bone(bone));
    let pairs = || (0..a.bones()).flat_map(of_bone).filter(|(a, b)| *a > COUNTS || *b > COUNTS);
    let (sum, most) =
        pairs().fold((0.0, 0.0_f64), |(sum, most), (a, b)| (sum + (a - b).abs(), most.max((a - b).abs())));
    (sum / pairs().count().max(1) as f64, most)
}

/// Where the points of a curve are.
type Points = fn(&[Sample]) -> Vec<(f64, f64)>;

/// Errors and seconds against vertices, both logarithmic, side by side.
fn plot(curves: &[(&str, Vec<Sample>)]) -> Result<String, Box<dyn std::error::Error>> {
    let all = || curves.iter().flat_map(|(_, samples)| samples);
    let (least, most) = range(all().map(|s| s.vertices as f64)).ok_or("nothing was measured")?;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, PLOT_SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let halves = area.split_evenly((1, 2));
        let means = |samples: &[Sample]| -> Vec<(f64, f64)> {
            samples.iter().filter_map(|s| s.error.map(|(mean, _)| (s.vertices as f64, mean))).collect()
        };
        let times = |samples: &[Sample]| -> Vec<(f64, f64)> {
            samples.iter().map(|s| (s.vertices as f64, s.seconds)).collect()
        };
        let panels: [(&str, &str, Points); 2] = [
            ("Mean difference to the finest, where w > 0.01", "mean |Δw|", means),
            ("Volume and weights together", "seconds", times),
        ];
        for (half, (caption, unit, points)) in halves.iter().zip(panels) {
            let values = curves.iter().flat_map(|(_, samples)| points(samples)).map(|(_, y)| y);
            let (low, high) = range(values).ok_or("nothing was measured")?;
            let mut chart = ChartBuilder::on(half)
                .caption(caption, ("sans-serif", 18))
                .margin(14)
                .x_label_area_size(42)
                .y_label_area_size(60)
                .build_cartesian_2d((least * 0.8..most * 1.25).log_scale(), (low * 0.7..high * 1.4).log_scale())?;
            chart.configure_mesh().x_desc("vertices of the volume").y_desc(unit).draw()?;
            for (index, (label, samples)) in curves.iter().enumerate() {
                let colour = Palette99::pick(index).to_rgba();
                chart
                    .draw_series(LineSeries::new(points(samples), colour.stroke_width(2)).point_size(3))?
                    .label(*label)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(2)));
            }
            let corner =
                if unit == "seconds" { SeriesLabelPosition::UpperLeft } else { SeriesLabelPosition::UpperRight };
            chart.configure_series_labels().position(corner).border_style(BLACK.mix(0.3)).draw()?;
        }
        area.present()?;
    }
    Ok(svg)
}

/// The least and greatest of some positive numbers.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) =
        values.filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
    (low <= high).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_count_where_a_weight_does() {
        let matrix = |values: [f64; 4]| WeightMatrix::from_columns(2, 2, &values).unwrap();
        let (mean, most) = difference(&matrix([0.5, 0.001, 0.2, 0.0]), &matrix([0.4, 0.002, 0.0, 0.0]));
        assert!((mean - 0.15).abs() < 1e-12 && (most - 0.2).abs() < 1e-12, "{mean} {most}");
    }

    #[test]
    fn curves_are_plotted() {
        let sample = |vertices, seconds, error| Sample { vertices, seconds, error };
        let samples =
            vec![sample(100, 0.1, Some((0.1, 0.4))), sample(1000, 1.0, Some((0.01, 0.1))), sample(9000, 9.0, None)];
        let svg = plot(&[("bar", samples)]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("bar") && svg.trim_end().ends_with("</svg>"));
        assert!(plot(&[]).is_err());
    }
}
