//! Filling many holes, and dragging a region again and again, against one factorisation.

use std::ops::ControlFlow;
use std::time::Instant;

use armature_fairing::edit::{RegionEditor, RegionSettings};
use armature_fairing::holes::{FillSettings, fill_holes, find_holes};
use armature_fairing::mixed::{Conditions, Elements, Energy, Fairing, Settings};
use armature_geometry::TriangleMesh;

use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;
use crate::terminal::aside;

/// Seconds for all holes, as a part of one factorisation of the whole mesh's bi-Laplacian; milliseconds to solve for a drag,
/// to add up influences for it, and that as a part of the region's factorisation.
pub(super) const NAMES: &[&str] =
    &["surface/fill", "surface/fill-ratio", "surface/drag-solved", "surface/drag", "surface/drag-ratio"];

const HOLES: usize = 100;
const RUNS: usize = 9;

pub(super) fn run(_args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let defect = |what: String| Failure::not_converged(what, "this is a defect; please report it");
    let mut measurements = Vec::new();

    let torn = torn_torus(250, 100);
    let holes = find_holes(&torn).map_err(|e| defect(e.to_string()))?;
    let all: Vec<usize> = (0..holes.holes.len()).collect();
    let mut stay = |_: &'static str, _: f64| ControlFlow::Continue(());
    let start = Instant::now();
    let filled =
        fill_holes(&torn, &holes, &all, &FillSettings::default(), &mut stay).map_err(|e| defect(e.to_string()))?;
    let seconds = start.elapsed().as_secs_f64();
    let done = filled.patches.iter().filter(|p| p.outcome.is_filled()).count();
    if done != HOLES {
        return Err(defect(format!("{done} of {HOLES} holes were filled")));
    }
    let whole = factorisation_seconds(&filled.mesh)?;
    aside!("surface/fill: {} triangles, {done} holes; one factorisation takes {whole:.2} s", torn.triangles.len());
    measurements.push(Measurement::new(NAMES[0], seconds, "s", 1));
    measurements
        .push(Measurement::new(NAMES[1], seconds / whole, "of one", 1).at_most(1.0, "at most one factorisation"));

    let sheet = torus(250, 100, |_, _| true);
    // Eighty of a hundred columns are free.
    let region: Vec<u32> = (0..sheet.vertices.len() as u32).filter(|v| v % 100 < 80).collect();
    let handles: Vec<u32> = (0..40).map(|k| k * 600 + 40).collect();
    let settings = RegionSettings { energy: Energy::Laplacian };
    let start = Instant::now();
    let editor =
        RegionEditor::precompute(&sheet, &region, &handles, &[], &settings).map_err(|e| defect(e.to_string()))?;
    let factor = start.elapsed().as_secs_f64();
    let solved = drag_seconds(&editor, handles.len()).map_err(defect)?;
    let start = Instant::now();
    let editor = editor.with_influences().map_err(|e| defect(e.to_string()))?;
    let influences = start.elapsed().as_secs_f64();
    let summed = drag_seconds(&editor, handles.len()).map_err(defect)?;
    aside!(
        "surface/drag: {} vertices follow; factorising takes {factor:.2} s, the influences of {} handles {influences:.2} s",
        editor.free_count(),
        handles.len()
    );
    measurements.push(Measurement::new(NAMES[2], 1e3 * solved, "ms", RUNS));
    measurements.push(Measurement::new(NAMES[3], 1e3 * summed, "ms", RUNS));
    measurements.push(Measurement::new(NAMES[4], summed / factor, "of one", RUNS).at_most(0.05, "at most a twentieth"));
    Ok(measurements)
}

/// The median over several drags, each to another place.
fn drag_seconds(editor: &RegionEditor, handles: usize) -> Result<f64, String> {
    let mut failed = None;
    let mut height = 0.0;
    let runs = time_runs(RUNS, || {
        height += 0.01;
        let dragged = vec![[0.1, 0.2, height]; handles];
        failed = editor.displacements(&dragged).err().or(failed.take());
    });
    failed.map_or(Ok(median(&runs)), |error| Err(error.to_string()))
}

/// Seconds to factorise the bi-Laplacian of a whole mesh, one vertex of which is held, and those in no triangle.
fn factorisation_seconds(mesh: &TriangleMesh) -> Result<f64, Failure> {
    let start = Instant::now();
    let made = Elements::of_positions(&mesh.vertices, &mesh.triangles).and_then(|elements| {
        let mut alone = vec![true; mesh.vertices.len()];
        mesh.triangles.iter().flatten().for_each(|&v| alone[v as usize] = false);
        let held = mesh.triangles[0][0];
        let fixed = (0..alone.len() as u32).filter(|&v| alone[v as usize] || v == held).collect();
        let conditions = Conditions { fixed, ..Conditions::default() };
        Fairing::precompute(&elements, &conditions, &Settings::new(Energy::Laplacian))
    });
    made.map_err(|e| Failure::not_converged(e.to_string(), ""))?;
    Ok(start.elapsed().as_secs_f64())
}

/// A torus of 50,000 triangles without small discs at regular places.
fn torn_torus(around: u32, across: u32) -> TriangleMesh {
    let gone = |i: u32, j: u32| i % 25 < 3 && j % 10 < 3;
    torus(around, across, |i, j| !gone(i, j))
}

/// Squares in two triangles each, where `keep` says so.
fn torus(around: u32, across: u32, keep: impl Fn(u32, u32) -> bool) -> TriangleMesh {
    let angle = |k: u32, count: u32| std::f64::consts::TAU * f64::from(k) / f64::from(count);
    let place = |i: u32, j: u32| {
        let ((s, c), (sin, cos)) = (angle(i, around).sin_cos(), angle(j, across).sin_cos());
        let radius = 2.5 + cos;
        [radius * c, radius * s, sin]
    };
    let vertices = (0..around).flat_map(|i| (0..across).map(move |j| place(i, j))).collect();
    let at = |i: u32, j: u32| i % around * across + j % across;
    let squares = (0..around).flat_map(|i| (0..across).map(move |j| (i, j))).filter(|&(i, j)| keep(i, j));
    let triangles = squares
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    TriangleMesh { vertices, triangles }
}
