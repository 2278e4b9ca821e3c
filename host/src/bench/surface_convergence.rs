//! How the error of biharmonic and triharmonic surfaces falls with the length of edges (thesis 3.5).

use armature_fairing::mixed::{Energy, FairingError, Form, Settings};
use armature_fairing::study::{Condition, Family, Sample, Wave, sample, slope};
use armature_geometry::operators::Lumping;
use plotters::prelude::*;

use super::Measurement;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::terminal::aside;

/// The least slope over all meshes, for each lumping.
pub(super) const NAMES: &[&str] = &[
    "surface/convergence-biharmonic-region-barycentric",
    "surface/convergence-biharmonic-region",
    "surface/convergence-biharmonic-curve-barycentric",
    "surface/convergence-biharmonic-curve",
    "surface/convergence-triharmonic-region-barycentric",
    "surface/convergence-triharmonic-region",
    "surface/convergence-triharmonic-curve-barycentric",
    "surface/convergence-triharmonic-curve",
];

/// Cells along the unit square's side.
const CELLS: [usize; 6] = [4, 8, 16, 32, 64, 128];
/// Slopes are those of a line through so many of the finest.
const FINEST: usize = 4;
/// Random meshes of each size. Errors on single ones differ by a factor of two.
const SEEDS: u64 = 12;
const FAMILIES: [(&str, Family); 5] = [
    ("regular", Family::Regular),
    ("alternating diagonals", Family::UnionJack),
    ("crossed squares", Family::Crossed),
    ("random, 30°", Family::Random { degrees: 30.0, seed: 7 }),
    ("random, 1°", Family::Random { degrees: 1.0, seed: 7 }),
];
const LUMPINGS: [(&str, Lumping); 2] = [("barycentric", Lumping::Barycentric), ("Voronoi", Lumping::VoronoiHybrid)];
const PLOT_SIZE: (u32, u32) = (1400, 1000);

/// One line of a panel.
struct Curve {
    label: String,
    lumping: usize,
    family: usize,
    samples: Vec<Sample>,
}

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let problems = [
        ("biharmonic, region", Energy::Laplacian, Condition::Region, Some((1.5, "at least 1.5"))),
        ("biharmonic, curve", Energy::Laplacian, Condition::Curve, Some((1.5, "at least 1.5"))),
        ("triharmonic, region", Energy::LaplacianGradient, Condition::Region, None),
        ("triharmonic, curve", Energy::LaplacianGradient, Condition::Curve, Some((1.0, "at least 1.0"))),
    ];
    let mut measurements = Vec::new();
    let mut panels = Vec::new();
    for ((title, energy, condition, budget), names) in problems.into_iter().zip(NAMES.chunks_exact(2)) {
        let mut curves = Vec::new();
        for (family, (family_name, meshes)) in FAMILIES.into_iter().enumerate() {
            for (lumping, (lumping_name, lumped)) in LUMPINGS.into_iter().enumerate() {
                let settings = Settings { form: Form::Reduced(lumped), ..Settings::new(energy) };
                let samples = CELLS
                    .into_iter()
                    .map(|cells| mean_sample(meshes, cells, condition, settings))
                    .collect::<Result<Vec<Sample>, _>>()
                    .map_err(|e| Failure::not_converged(format!("{title}, {family_name}: {e}"), ""))?;
                let label = format!("{family_name}, {lumping_name}: {:.2}", slope(&samples, FINEST));
                let errors: Vec<String> = samples.iter().map(|s| format!("{:.1e}", s.error)).collect();
                aside!("{title}: {label}; errors {}", errors.join(" "));
                curves.push(Curve { label, lumping, family, samples });
            }
        }
        for (lumping, &name) in names.iter().enumerate() {
            let slopes = curves.iter().filter(|c| c.lumping == lumping).map(|c| slope(&c.samples, FINEST));
            let measured = Measurement::new(name, slopes.fold(f64::INFINITY, f64::min), "power", 1);
            // The program uses Voronoi areas; the others are for comparison.
            measurements.push(match budget.filter(|_| LUMPINGS[lumping].1 == Lumping::VoronoiHybrid) {
                Some((limit, words)) => measured.at_least(limit, words),
                None => measured,
            });
        }
        panels.push((title, curves));
    }
    if let Some(file) = &args.plot {
        let svg = plot(&panels).map_err(|e| Failure::not_converged(format!("{}: {e}", file.display()), ""))?;
        Overwrite { force: true }.write(file, svg.as_bytes())?;
    }
    Ok(measurements)
}

/// Of random meshes, the geometric mean over several.
fn mean_sample(family: Family, cells: usize, condition: Condition, settings: Settings) -> Result<Sample, FairingError> {
    let families = match family {
        Family::Random { degrees, .. } => (0..SEEDS).map(|seed| Family::Random { degrees, seed }).collect(),
        regular => vec![regular],
    };
    let samples: Vec<Sample> = families
        .into_iter()
        .map(|family| sample(family, cells, condition, &settings, &Wave::STUDY))
        .collect::<Result<_, _>>()?;
    let mean = |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / samples.len() as f64;
    Ok(Sample { edge: mean(|s| s.edge), error: mean(|s| s.error.ln()).exp(), ..samples[0] })
}

/// A panel for each problem, both axes logarithmic; lines of Voronoi areas are thick.
fn plot(panels: &[(&str, Vec<Curve>)]) -> Result<String, Box<dyn std::error::Error>> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, PLOT_SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        for (part, (title, curves)) in area.split_evenly((2, 2)).iter().zip(panels) {
            let samples = || curves.iter().flat_map(|c| &c.samples);
            let bounds = |of: fn(&Sample) -> f64| {
                samples().map(of).fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)))
            };
            let ((left, right), (low, high)) = (bounds(|s| s.edge), bounds(|s| s.error));
            if low > high || left > right {
                return Err("nothing was measured".into());
            }
            let mut chart = ChartBuilder::on(part)
                .caption(format!("{title} (slopes)"), ("sans-serif", 18))
                .margin(12)
                .x_label_area_size(40)
                .y_label_area_size(64)
                .build_cartesian_2d((left * 0.9..right * 1.1).log_scale(), (low * 0.02..high * 1.4).log_scale())?;
            chart
                .configure_mesh()
                .x_desc("average edge length")
                .y_desc("L² error")
                .label_style(("sans-serif", 13))
                .x_labels(4)
                .y_labels(8)
                .max_light_lines(1)
                .x_label_formatter(&|x| format!("{x:.0e}"))
                .y_label_formatter(&|y| format!("{y:.0e}"))
                .draw()?;
            for curve in curves {
                let colour = Palette99::pick(curve.family).to_rgba();
                let style = colour.stroke_width(1 + 2 * curve.lumping as u32);
                let points = curve.samples.iter().map(|s| (s.edge, s.error));
                chart
                    .draw_series(LineSeries::new(points, style).point_size(2))?
                    .label(curve.label.as_str())
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
            }
            let box_style = BLACK.mix(0.3);
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::LowerRight)
                .background_style(WHITE.mix(0.8))
                .border_style(box_style)
                .label_font(("sans-serif", 11))
                .draw()?;
        }
        area.present()?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_plotted() {
        let sample = |edge: f64| Sample { edge, error: edge * edge, residual: 0.0, unknowns: 9 };
        let samples = vec![sample(0.2), sample(0.1), sample(0.05)];
        let curve = Curve { label: "regular".into(), lumping: 1, family: 0, samples };
        let svg = plot(&[("biharmonic", vec![curve])]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("regular") && svg.trim_end().ends_with("</svg>"));
        assert!(plot(&[("biharmonic", Vec::new())]).is_err());
    }
}
