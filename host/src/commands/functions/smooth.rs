//! `armature smooth`

use std::path::Path;

use armature_formats::model::Model;
use armature_formats::tables::NumberTable;
use armature_geometry::TriangleMesh;
use armature_weights::FunctionDomain;
use armature_weights::extrema::{PersistentExtremum, persistence};
use armature_weights::geodesic::geodesic_distance;
use armature_weights::monotone::{Data, Keep, MonotoneProblem, Smoothed, smooth_keeping};
use serde_json::{Value, json};

use super::{all_converged, domain_name, domain_of, failure, outcome, report_json, settings};
use crate::cli::function_args::{DETAIL_EDGES, SmoothArgs};
use crate::failure::Failure;
use crate::files::inputs;
use crate::files::tables::{read_table, table_writer};
use crate::pictures::function::{Dot, FunctionPicture, Shown, write_function_pictures};
use crate::terminal::{Bar, Talk, counted, grouped, out};

/// Smooths data and keeps exactly the extrema that are asked for.
pub fn smooth(args: &SmoothArgs, talk: Talk) -> Result<(), Failure> {
    let write = table_writer(&args.output, "data")?;
    args.overwrite.check(&args.output)?;
    args.picture.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let keep = match (args.keep, args.persistence) {
        (Some(count), _) => Keep::Most(count),
        (None, Some(least)) => Keep::Persistence(least),
        (None, None) => return Err(Failure::usage("nothing says what to keep", "give --keep or --persistence")),
    };
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let domain = domain_of(&args.mesh, &model)?;
    let table = match &args.data {
        Some(path) => read_data(path, &model)?,
        None => distances(args, &model, &domain)?,
    };
    if args.picture.is_some() && !(1..=table.columns).contains(&args.picture_of) {
        return Err(Failure::usage(
            format!("there is no column {}", args.picture_of),
            format!("{} has {}", args.source().display(), counted(table.columns, "column", "columns")),
        ));
    }
    let detail = args.detail.unwrap_or(DETAIL_EDGES * domain.mean_edge());
    if detail <= 0.0 {
        return Err(Failure::input(
            format!("{}: the mesh has no edges", args.mesh.display()),
            "give a mesh with faces",
        ));
    }
    let mut columns = Vec::with_capacity(table.columns);
    let mut stages = bar.stages();
    for column in 0..table.columns {
        let values = domain.gathered(&table.values[column * table.rows..][..table.rows]);
        let mut told = |stage, done: f64| stages(stage, (column as f64 + done) / table.columns as f64);
        columns.push((smoothed(args, &domain, &values, (keep, detail), &mut told)?, values));
    }
    bar.finish();
    let whole: Vec<Vec<f64>> = columns.iter().map(|(made, _)| domain.spread(&made.function.values)).collect();
    let values = whole.concat();
    args.overwrite.write(&args.output, &write(&NumberTable { rows: table.rows, columns: table.columns, values }))?;
    let seconds = start.elapsed().as_secs_f64();
    let told = Told { args, columns: &columns, domain: &domain, on: domain_name(&model), detail, seconds };
    if args.json {
        out!("{}", told.json());
    } else if !talk.quiet {
        told.say();
    }
    draw(args, &model.mesh, &domain, &columns, talk)?;
    all_converged(args.source(), columns.iter().map(|(made, _)| &made.function.report))
}

fn read_data(path: &Path, model: &Model) -> Result<NumberTable, Failure> {
    let table = read_table(path)?;
    let bad = |what: String, remedy: &str| Failure::input(format!("{}: {what}", path.display()), remedy);
    let n = model.mesh.vertices.len();
    if table.rows != n || table.columns == 0 {
        let what = format!("{} × {} numbers for {}", table.rows, table.columns, counted(n, "vertex", "vertices"));
        return Err(bad(what, "give a row for each vertex of the mesh, in its order, and a column for each function"));
    }
    match table.values.iter().position(|value| !value.is_finite()) {
        Some(at) => {
            let what = format!("row {}, column {} holds {}", at % n + 1, at / n + 1, table.values[at]);
            Err(bad(what, "every vertex needs a finite number"))
        }
        None => Ok(table),
    }
}

/// Distances along the surface from the vertices that are asked for.
fn distances(args: &SmoothArgs, model: &Model, domain: &FunctionDomain) -> Result<NumberTable, Failure> {
    let bad = |what: String, remedy: &str| Failure::input(format!("{}: {what}", args.mesh.display()), remedy);
    if model.tetrahedra.is_some() {
        return Err(bad("distances are measured along a surface".into(), "give a mesh of triangles"));
    }
    let rows = domain.vertex_of.len();
    let here = |&vertex: &usize| domain.vertex_of.get(vertex).map(|&welded| welded as usize);
    let sources: Option<Vec<usize>> = args.geodesic.iter().map(here).collect();
    let no_vertex = || {
        let what = "--geodesic names a vertex that does not exist".to_owned();
        bad(what, &format!("vertices are numbered from 0 to {}", rows.saturating_sub(1)))
    };
    let sources = sources.ok_or_else(no_vertex)?;
    let corners = model.mesh.triangles.iter().map(|corners| corners.map(|v| domain.vertex_of[v as usize]));
    let triangles = corners.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let welded = TriangleMesh { vertices: domain.vertices.clone(), triangles };
    let values = geodesic_distance(&welded, &sources).map_err(|e| bad(e.to_string(), ""))?;
    // Vertices in no triangle have no distance, and play no part.
    let far = (0..values.len()).find(|&vertex| values[vertex].is_infinite() && domain.mass[vertex] > 0.0);
    if let Some(vertex) = far {
        let [x, y, z] = domain.vertices[vertex];
        let what = format!("the piece of the mesh around ({x}, {y}, {z}) has none of the vertices of --geodesic");
        return Err(bad(what, "name a vertex in each piece, or take the piece out of the mesh"));
    }
    let values: Vec<f64> = values.into_iter().map(|value| if value.is_finite() { value } else { 0.0 }).collect();
    Ok(NumberTable { rows, columns: 1, values: domain.spread(&values) })
}

fn smoothed(
    args: &SmoothArgs,
    domain: &FunctionDomain,
    values: &[f64],
    (keep, detail): (Keep, f64),
    progress: &mut dyn FnMut(&'static str, f64) -> std::ops::ControlFlow<()>,
) -> Result<Smoothed, Failure> {
    let order = usize::from(args.solver.order);
    let FunctionDomain { neighbours, laplacian, mass, .. } = domain;
    let problem = MonotoneProblem { neighbours, laplacian, mass, order, blend: None, data: None };
    let data = Data { values, fidelity: Data::fidelity_for(detail, order) };
    smooth_keeping(&problem, data, keep, &settings(args.solver), progress).map_err(|e| {
        failure(args.source(), &e, "keep more extrema, or fewer, so that every piece of the mesh has both kinds")
    })
}

/// What is reported.
struct Told<'a> {
    args: &'a SmoothArgs,
    /// With the data.
    columns: &'a [(Smoothed, Vec<f64>)],
    domain: &'a FunctionDomain,
    on: &'static str,
    detail: f64,
    seconds: f64,
}

fn largest_change((made, data): &(Smoothed, Vec<f64>)) -> f64 {
    made.function.values.iter().zip(data).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

impl Told<'_> {
    fn say(&self) {
        let Self { args, columns, domain, on, detail, seconds } = self;
        out!(
            "{}: {} on {on} of {}, waves of {detail:.4} halved; {seconds:.2} s",
            args.output.display(),
            counted(columns.len(), "function", "functions"),
            counted(domain.vertices.len(), "vertex", "vertices"),
        );
        out!("  column  extrema before  minima kept  maxima kept  largest change  error bound");
        for (index, column) in columns.iter().enumerate() {
            let minima = column.0.kept.iter().filter(|one| one.is_minimum).count();
            let report = &column.0.function.report;
            out!(
                "  {:6}  {:>14}  {:>11}  {:>11}  {:>14.1e}  {:>11.1e}  {}",
                index + 1,
                grouped(column.0.before),
                grouped(minima),
                grouped(column.0.kept.len() - minima),
                largest_change(column),
                report.error_bound,
                outcome(report.outcome),
            );
        }
    }

    fn json(&self) -> Value {
        let column = |column: &(Smoothed, Vec<f64>)| {
            let report = &column.0.function.report;
            let kept = column.0.kept.iter().map(|one| {
                json!({
                    "kind": if one.is_minimum { "minimum" } else { "maximum" },
                    "place": self.domain.vertices[one.vertex],
                    "value": one.value,
                    "persistence": one.persistence,
                })
            });
            let mut told = report_json(report);
            told["extrema_before"] = json!(column.0.before);
            told["kept"] = json!(kept.collect::<Vec<_>>());
            told["spurious_extrema"] = json!(report.spurious);
            told["largest_change"] = json!(largest_change(column));
            told
        };
        json!({
            "file": self.args.output.display().to_string(),
            "domain": self.on,
            "domain_vertices": self.domain.vertices.len(),
            "flat_elements": self.domain.degenerate,
            "order": self.args.solver.order,
            "detail": self.detail,
            "columns": self.columns.iter().map(column).collect::<Vec<_>>(),
            "seconds": self.seconds,
        })
    }
}

fn draw(
    args: &SmoothArgs,
    mesh: &TriangleMesh,
    domain: &FunctionDomain,
    columns: &[(Smoothed, Vec<f64>)],
    talk: Talk,
) -> Result<(), Failure> {
    let Some(path) = &args.picture else { return Ok(()) };
    let (made, data) = &columns[args.picture_of - 1];
    let range = [f64::min, f64::max].map(|pick| data.iter().copied().reduce(pick).unwrap_or(0.0));
    let dots = |values: &[f64]| -> Result<Vec<Dot>, Failure> {
        let all = persistence(&domain.neighbours, values).map_err(|e| failure(args.source(), &e.into(), ""))?;
        let dot = |one: &PersistentExtremum| Dot { place: domain.vertices[one.vertex], is_minimum: one.is_minimum };
        Ok(all.iter().map(dot).collect())
    };
    let (before, after) = (domain.spread(data), domain.spread(&made.function.values));
    let (dots_before, dots_after) = (dots(data)?, dots(&made.function.values)?);
    let picture = |values, title, extrema| {
        let shown = Shown::Values { values, range };
        FunctionPicture { mesh, shown, title, legend: &[], extrema }
    };
    let both = [picture(&before, "data", &dots_before[..]), picture(&after, "smoothed", &dots_after)];
    let by = write_function_pictures(args.overwrite, path, &both, 2)?;
    if !talk.quiet && !args.json {
        out!("{}: {by}", path.display());
    }
    Ok(())
}
