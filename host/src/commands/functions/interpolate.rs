//! `armature interpolate`

use armature_formats::tables::NumberTable;
use armature_geometry::TriangleMesh;
use armature_weights::FunctionDomain;
use armature_weights::monotone::{MonotoneInterpolation, MonotoneProblem, monotone_interpolation};
use serde_json::{Value, json};

use super::value_sources::read_value_sources;
use super::{all_converged, domain_name, domain_of, failure, report_json, settings};
use crate::cli::function_args::InterpolateArgs;
use crate::failure::Failure;
use crate::files::tables::table_writer;
use crate::files::{self, inputs};
use crate::pictures::function::{Dot, FunctionPicture, Shown, write_function_pictures};
use crate::terminal::{Bar, Talk, aside, counted, grouped, out};

/// Spreads values and colours over a mesh.
pub fn interpolate(args: &InterpolateArgs, talk: Talk) -> Result<(), Failure> {
    let write = table_writer(&args.output, "values")?;
    args.overwrite.check(&args.output)?;
    args.picture.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let domain = domain_of(&args.mesh, &model)?;
    let sources = read_value_sources(&args.values, &files::read(&args.values)?, &domain)?;
    let FunctionDomain { neighbours, laplacian, mass, .. } = &domain;
    let order = usize::from(args.solver.order);
    let problem = MonotoneProblem { neighbours, laplacian, mass, order, blend: None, data: None };
    let made = monotone_interpolation(&problem, &sources, &settings(args.solver), &mut bar.stages())
        .map_err(|e| failure(&args.values, &e, "give values farther from each other"))?;
    bar.finish();
    let columns: Vec<Vec<f64>> = made.columns.iter().map(|column| domain.spread(column)).collect();
    let (rows, count) = (domain.vertex_of.len(), columns.len());
    let table = NumberTable { rows, columns: count, values: columns.concat() };
    args.overwrite.write(&args.output, &write(&table))?;
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        out!("{}", told_json(args, &made, &domain, domain_name(&model), seconds));
    } else if !talk.quiet {
        out!(
            "{}: {} of {} on {} from {}, blended by {} of order {order}; {seconds:.2} s",
            args.output.display(),
            counted(columns.len(), "number", "numbers"),
            counted(domain.vertices.len(), "vertex", "vertices"),
            domain_name(&model),
            counted(sources.len(), "place", "places"),
            counted(made.reports.len(), "monotone function", "monotone functions"),
        );
        let worst = made.reports.iter().map(|report| report.error_bound).fold(0.0, f64::max);
        out!("  no blending value farther than {worst:.1e} from the best that rises along the same edges");
        let most = made.spurious.iter().flatten().map(|one| one.persistence).fold(0.0, f64::max);
        let how_much = if most > 0.0 { format!(" (up to {most:.1e} from their saddles)") } else { String::new() };
        out!("  spurious extrema of the result, away from what is given: {}{how_much}", grouped(spurious(&made)));
        if !made.unreached.is_empty() {
            let unreached = counted(made.unreached.len(), "vertex is", "vertices are");
            aside!("note: {unreached} in pieces of the mesh without a given value, and zero");
        }
    }
    draw(args, &model.mesh, &domain, (&made, &columns), talk)?;
    all_converged(&args.values, &made.reports)
}

fn spurious(made: &MonotoneInterpolation) -> usize {
    made.spurious.iter().map(Vec::len).sum()
}

fn told_json(
    args: &InterpolateArgs,
    made: &MonotoneInterpolation,
    domain: &FunctionDomain,
    on: &str,
    seconds: f64,
) -> Value {
    json!({
        "file": args.output.display().to_string(),
        "domain": on,
        "domain_vertices": domain.vertices.len(),
        "flat_elements": domain.degenerate,
        "order": args.solver.order,
        "functions": made.reports.iter().map(report_json).collect::<Vec<_>>(),
        "spurious_extrema": spurious(made),
        "unreached_vertices": made.unreached.len(),
        "seconds": seconds,
    })
}

fn draw(
    args: &InterpolateArgs,
    mesh: &TriangleMesh,
    domain: &FunctionDomain,
    (made, columns): (&MonotoneInterpolation, &[Vec<f64>]),
    talk: Talk,
) -> Result<(), Failure> {
    let Some(path) = &args.picture else { return Ok(()) };
    let dots: Vec<Dot> = made
        .spurious
        .iter()
        .flatten()
        .map(|one| Dot { place: domain.vertices[one.vertex], is_minimum: one.is_minimum })
        .collect();
    let colors: Vec<[f32; 3]>;
    let shown = match columns {
        [red, green, blue] => {
            let channel = |value: f64| value.clamp(0.0, 1.0) as f32;
            colors = (0..red.len()).map(|v| [red[v], green[v], blue[v]].map(channel)).collect();
            Shown::Colors(&colors)
        }
        [values, ..] => {
            let range = [f64::min, f64::max].map(|pick| values.iter().copied().reduce(pick).unwrap_or(0.0));
            Shown::Values { values, range }
        }
        [] => return Ok(()),
    };
    let picture = FunctionPicture { mesh, shown, title: "", legend: &[], extrema: &dots };
    let by = write_function_pictures(args.overwrite, path, &[picture], 1)?;
    if !talk.quiet && !args.json {
        out!("{}: {by}", path.display());
    }
    Ok(())
}
