//! Monotone functions on surfaces as large as those of the paper (Jacobson, Weinkauf & Sorkine 2012, table 1; thesis table
//! 5.1), beside Clarabel on the conic form of the same problem, in one run.

use std::ops::ControlFlow;
use std::time::Instant;

use armature_character::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, WeightMethod, WeightsOn,
    handle_weights,
};
use armature_geometry::TriangleMesh;
use armature_geometry::operators::{Lumping, cotangent_laplacian, lumped_mass};
use armature_weights::extrema::Neighbours;
use armature_weights::handles::FREE_NEAR_JOINTS;
use armature_weights::monotone::{
    ConicProblem, MonotoneProblem, MonotoneSettings, PrescribedFunction, interior_point, least_squares_form,
    monotone_functions,
};

use super::{Measurement, shared_file};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::files::{self, inputs};
use crate::terminal::aside;

pub(super) const NAMES: &[&str] = &[
    "weights/monotone-2403-order-2",
    "weights/monotone-2403-order-3",
    "weights/monotone-2403-order-4",
    "weights/monotone-8229-order-2",
    "weights/monotone-14636-order-3",
    "weights/monotone-26294-order-2",
    "weights/monotone-28136-order-2",
    "weights/monotone-29021-order-2",
    "weights/monotone-38656-order-2",
    "weights/monotone-armadillo",
];

/// Triangles and order of each row, and the paper's seconds.
const ROWS: [(u32, usize, &str); 9] = [
    (2_403, 2, "the paper: 0.1246 s"),
    (2_403, 3, "the paper: 1.3135 s"),
    (2_403, 4, "the paper: 0.2324 s"),
    (8_229, 2, "the paper: 0.2306 s"),
    (14_636, 3, "the paper: 86.393 s"),
    (26_294, 2, "the paper: 6.1345 s"),
    (28_136, 2, "the paper: 2.4564 s"),
    (29_021, 2, "the paper: 5.1707 s"),
    (38_656, 2, "the paper: 6.0263 s"),
];
const PEER: &str = "Clarabel with QDLDL, conic form";
/// The volume's vertices.
const VOLUME: usize = 5_000;

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let asked = |name: &str| args.what.as_deref().is_none_or(|what| name.contains(what));
    let mut measurements = Vec::new();
    for (&name, (triangles, order, note)) in NAMES.iter().zip(ROWS).filter(|(name, _)| asked(name)) {
        measurements.push(measure(name, &lumpy_torus(triangles), order, note)?);
    }
    let last = NAMES[NAMES.len() - 1];
    if asked(last) {
        measurements.extend(armadillo(last)?);
    }
    Ok(measurements)
}

/// One function by either method.
fn measure(name: &'static str, mesh: &TriangleMesh, order: usize, note: &'static str) -> Result<Measurement, Failure> {
    let defect = |what: String| Failure::not_converged(what, "this is a defect; please report it");
    let laplacian = cotangent_laplacian(mesh).map_err(|e| defect(e.to_string()))?.matrix;
    let mass = lumped_mass(mesh, Lumping::VoronoiHybrid).map_err(|e| defect(e.to_string()))?;
    let n = mesh.vertices.len();
    let neighbours = Neighbours::of_elements(n, &mesh.triangles).map_err(|e| defect(e.to_string()))?;
    // One handle, and three others around the torus.
    let fixed = [0, n / 4, n / 2, 3 * n / 4];
    let values = [1.0, 0.0, 0.0, 0.0];
    let problem =
        MonotoneProblem { neighbours: &neighbours, laplacian: &laplacian, mass: &mass, order, blend: None, data: None };
    let mut on = |_: &'static str, _: f64| ControlFlow::Continue(());
    let start = Instant::now();
    let prescribed = PrescribedFunction::between_extremes(&values);
    let settings = MonotoneSettings::certified();
    let ours = monotone_functions(&problem, &fixed, &[prescribed], &settings, &mut on);
    let ours = ours.map_err(|e| defect(e.to_string()))?.remove(0);
    let seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let (root, rows) = least_squares_form(&mesh.vertices, &mesh.triangles, &laplacian, &mass, order);
    let conic = ConicProblem {
        count: n,
        root,
        rows,
        linear: Vec::new(),
        fixed: fixed.into_iter().zip(values).collect(),
        rising: ours.rising.iter().map(|edge| edge.map(|vertex| vertex as usize)).collect(),
        margin: ours.report.margin,
    };
    let theirs = interior_point(&conic).map_err(|e| defect(e.to_string()))?;
    let peer = start.elapsed().as_secs_f64();
    let apart = ours.values.iter().zip(&theirs.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    aside!(
        "{name}: {} triangles; {:?} after {} steps with {} factorisations, within {:.1e}; Clarabel {:?} after {} \
         iterations; values {apart:.1e} apart, energies {:.10e} and {:.10e}",
        mesh.triangles.len(),
        ours.report.outcome,
        ours.report.steps,
        ours.report.factorisations,
        ours.report.error_bound,
        theirs.outcome,
        theirs.iterations,
        ours.report.energy,
        theirs.energy,
    );
    let met = seconds * 3.0 <= peer;
    let measured = Measurement::new(name, seconds, "s", 1);
    Ok(Measurement {
        peer: Some((PEER.into(), peer)),
        budget: Some(("at most a third of Clarabel's", met)),
        note: Some(note),
        ..measured
    })
}

/// A torus with lumps of about this many triangles.
fn lumpy_torus(triangles: u32) -> TriangleMesh {
    let across = (f64::from(triangles) / 5.0).sqrt().round() as u32;
    let around = (f64::from(triangles) / f64::from(2 * across)).round() as u32;
    let angle = |k: u32, count: u32| std::f64::consts::TAU * f64::from(k) / f64::from(count);
    let place = |i: u32, j: u32| {
        let (s, t) = (angle(i, around), angle(j, across));
        let radius = 1.0 + 0.25 * (5.0 * s).sin() * (2.0 * t).cos();
        let reach = 2.5 + radius * t.cos();
        [reach * s.cos(), reach * s.sin(), radius * t.sin() + 0.4 * (3.0 * s).sin()]
    };
    let vertices = (0..around).flat_map(|i| (0..across).map(move |j| place(i, j))).collect();
    let at = |i: u32, j: u32| i % around * across + j % across;
    let squares = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    let triangles = squares
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    TriangleMesh { vertices, triangles }
}

/// All bones of the armadillo by monotone and by bounded weights, on volumes that are made alike.
fn armadillo(name: &'static str) -> Result<Option<Measurement>, Failure> {
    let [Some(mesh), Some(bones)] = ["armadillo.obj", "armadillo.tgf"].map(shared_file) else {
        aside!("{name}: skipped, the model is not here");
        return Ok(None);
    };
    let model = inputs::model(&mesh)?;
    let graph = armature_formats::skeleton::read_tgf(&files::read(&bones)?);
    let graph = graph.map_err(|e| e.in_file(&bones.display().to_string()))?;
    let shape = |(k, ends): (usize, &[usize; 2])| HandleShape {
        name: format!("bone_{}", k + 1),
        place: HandlePlace::Segments(vec![ends.map(|point| graph.points[point])]),
    };
    let shapes: Vec<HandleShape> = graph.edges.iter().enumerate().map(shape).collect();
    let held = Held::Shapes { shapes: &shapes, cage: &[] };
    let settings = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier: BiharmonicTier::Interactive,
        on: WeightsOn::Volume { vertices: VOLUME },
        partition: Partition::Normalised,
        joint_release: FREE_NEAR_JOINTS,
    };
    // The volume takes the same time for both, and is not counted.
    let solving = |begin: &mut Option<Instant>, stage: &'static str| {
        if ["preparing the energy", "preparing the weights"].contains(&stage) {
            begin.get_or_insert_with(Instant::now);
        }
        ControlFlow::Continue(())
    };
    let mut begun = None;
    let ours = HandleWeightsSettings { method: WeightMethod::Monotone { order: 2 }, ..settings };
    let monotone = handle_weights(&model.mesh, None, held, &ours, &mut |stage, _| solving(&mut begun, stage));
    let monotone = monotone.map_err(|e| crate::characters::weights_failure(&mesh, &e))?;
    let seconds = begun.map_or(f64::NAN, |start| start.elapsed().as_secs_f64());
    let mut begun = None;
    let bounded = handle_weights(&model.mesh, None, held, &settings, &mut |stage, _| solving(&mut begun, stage));
    let bounded = bounded.map_err(|e| crate::characters::weights_failure(&mesh, &e))?;
    let peer = begun.map_or(f64::NAN, |start| start.elapsed().as_secs_f64());
    aside!(
        "{name}: {} vertices; {} of {} bones did not converge, within {:.1e}; bounded weights within {:.1e}",
        monotone.domain_vertices,
        monotone.unconverged(),
        shapes.len(),
        monotone.error_bound(),
        bounded.error_bound(),
    );
    let measured = Measurement::new(name, seconds, "s", 1);
    let budget = Some(("at most 4 times that of bounded weights", seconds <= 4.0 * peer));
    Ok(Some(Measurement { peer: Some(("bounded weights".into(), peer)), budget, ..measured }))
}
