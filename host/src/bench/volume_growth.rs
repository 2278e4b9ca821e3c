//! How the time of a conforming volume grows with the size of its surface.

use std::time::Instant;

use armature_geometry::TriangleMesh;
use armature_geometry::surface::{Edge, edges};
use armature_geometry::volume::Resolution;
use glam::DVec3;
use plotters::prelude::*;

use super::volume::volume_of;
use super::{Measurement, shared_file};
use crate::characters::volumes::Handles;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::{Overwrite, inputs};
use crate::terminal::aside;

/// The exponent, and the seconds at each size.
pub(super) const NAMES: &[&str] =
    &["volume/growth", "volume/growth-12k", "volume/growth-48k", "volume/growth-193k", "volume/growth-772k"];

const MODEL: &str = "elephant.obj";
const PLOT_SIZE: (u32, u32) = (960, 640);

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let Some(path) = shared_file(MODEL) else {
        aside!("{}: skipped, the model is not here", NAMES[0]);
        return Ok(Vec::new());
    };
    let mut mesh = inputs::model(&path)?.mesh;
    let handles = shared_file("elephant.tgf")
        .map(|skeleton| inputs::skeleton(&skeleton).map(|s| Handles::of_skeleton(&s)))
        .transpose()?
        .unwrap_or_default();
    let mut points = Vec::new();
    let mut measurements = Vec::new();
    for &name in &NAMES[1..] {
        let start = Instant::now();
        let volume = volume_of(&mesh, &handles, Resolution::Conforming, &path)?;
        let seconds = start.elapsed().as_secs_f64();
        points.push((mesh.triangles.len() as f64, seconds));
        measurements.push(Measurement::new(name, seconds, "s", 1));
        aside!(
            "{:>9} triangles, {:>9} tetrahedra: {seconds:>8.2} s, {:.1} µs a triangle",
            mesh.triangles.len(),
            volume.mesh.tetrahedra.len(),
            1e6 * seconds / mesh.triangles.len() as f64,
        );
        mesh = loop_subdivision(&mesh);
    }
    measurements.insert(0, Measurement::new(NAMES[0], exponent(&points), "power", 1).at_most(1.3, "at most 1.3"));
    if let Some(file) = &args.plot {
        let svg = plot(&points).map_err(|e| Failure::not_converged(format!("{}: {e}", file.display()), ""))?;
        Overwrite { force: true }.write(file, svg.as_bytes())?;
    }
    Ok(measurements)
}

/// The power of the size that the time grows with: the slope of the line through the logarithms.
pub(super) fn exponent(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|(n, s)| (n.ln(), s.ln())).collect();
    let count = logs.len() as f64;
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / count, logs.iter().map(|p| p.1).sum::<f64>() / count);
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    covariance / logs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}

/// One step of Loop subdivision of a closed surface: four triangles for each one.
pub(super) fn loop_subdivision(mesh: &TriangleMesh) -> TriangleMesh {
    let count = mesh.vertices.len();
    let edges = edges(&mesh.triangles);
    let at = |v: u32| DVec3::from(mesh.vertices[v as usize]);
    let edge_of = |a: u32, b: u32| {
        let key = [a.min(b), a.max(b)];
        edges.binary_search_by_key(&key, |e: &Edge| e.vertices).map_or(0, |index| index)
    };
    let mut middles = vec![DVec3::ZERO; edges.len()];
    for &[a, b, c] in &mesh.triangles {
        for [from, to, opposite] in [[a, b, c], [b, c, a], [c, a, b]] {
            // Each of the two triangles at an edge contributes half of the ends' share.
            middles[edge_of(from, to)] += 3.0 / 16.0 * (at(from) + at(to)) + at(opposite) / 8.0;
        }
    }
    let mut around = vec![(DVec3::ZERO, 0.0); count];
    for edge in &edges {
        let [a, b] = edge.vertices;
        for (v, other) in [(a, b), (b, a)] {
            around[v as usize].0 += at(other);
            around[v as usize].1 += 1.0;
        }
    }
    let moved = (0..count).map(|v| {
        let (sum, valence) = around[v];
        let share = if valence > 3.0 { 3.0 / (8.0 * valence) } else { 3.0 / 16.0 };
        ((1.0 - valence * share) * at(v as u32) + share * sum).to_array()
    });
    let vertices = moved.chain(middles.iter().map(DVec3::to_array)).collect();
    let middle = |a: u32, b: u32| (count + edge_of(a, b)) as u32;
    let split = |&[a, b, c]: &[u32; 3]| {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    };
    TriangleMesh { vertices, triangles: mesh.triangles.iter().flat_map(split).collect() }
}

/// Time against size, both logarithmic, with a line of power one for comparison.
fn plot(points: &[(f64, f64)]) -> Result<String, Box<dyn std::error::Error>> {
    let (first, last) = (points.first().ok_or("nothing was measured")?, points.last().ok_or("nothing was measured")?);
    let linear = |n: f64| first.1 * n / first.0;
    let highest = last.1.max(linear(last.0));
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, PLOT_SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption("Conforming volume of a subdivided surface", ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d(
                (first.0 * 0.7..last.0 * 1.4).log_scale(),
                (first.1 * 0.6..highest * 1.7).log_scale(),
            )?;
        chart.configure_mesh().x_desc("triangles").y_desc("seconds").draw()?;
        let measured = RGBColor(0x1f, 0x4e, 0x9c);
        chart
            .draw_series(LineSeries::new([first.0, last.0].map(|n| (n, linear(n))), BLACK.mix(0.35)))?
            .label("first power")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 22, y)], BLACK.mix(0.35)));
        chart
            .draw_series(LineSeries::new(points.iter().copied(), measured.stroke_width(2)).point_size(4))?
            .label("measured")
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], measured.stroke_width(2)));
        chart.configure_series_labels().position(SeriesLabelPosition::UpperLeft).border_style(BLACK.mix(0.3)).draw()?;
        area.present()?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> TriangleMesh {
        let vertices = vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        TriangleMesh { vertices, triangles }
    }

    #[test]
    fn subdivision_makes_a_rounder_closed_surface() {
        let mut mesh = octahedron();
        for step in 1..4 {
            mesh = loop_subdivision(&mesh);
            assert_eq!(mesh.triangles.len(), 8 << (2 * step));
            let diagnosis = armature_geometry::surface::diagnose(&mesh).unwrap();
            assert!(diagnosis.closed && diagnosis.signed_volume > 0.0 && diagnosis.euler_characteristic == 2);
        }
        let radii: Vec<f64> = mesh.vertices.iter().map(|&p| DVec3::from(p).length()).collect();
        let (least, most) = radii.iter().fold((f64::MAX, 0.0_f64), |(l, m), &r| (l.min(r), m.max(r)));
        assert!(most / least < 1.3, "{least} {most}");
    }

    #[test]
    fn powers_are_found_and_plotted() {
        let points: Vec<(f64, f64)> = [1e4, 1e5, 1e6].map(|n: f64| (n, 3e-6 * n.powf(1.2))).to_vec();
        assert!((exponent(&points) - 1.2).abs() < 1e-12);
        let svg = plot(&points).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("measured") && svg.trim_end().ends_with("</svg>"));
        assert!(plot(&[]).is_err());
    }
}
