//! Draws what the thesis shows in chapter 3: holes filled in five ways, a blend with reflection lines, blends on
//! parameter domains, conditions on a sheet, creases, a displacement.
//! `cargo run --release --example figures -- FOLDER [MODEL.obj]`

#[path = "support/draw.rs"]
mod draw;

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature_fairing::edit::{RegionEditor, RegionSettings, SharpCurve, near_vertices, vertices_within};
use armature_fairing::holes::{Holes, blend_on_domain, blend_rims, fill_holes, find_holes};
use armature_fairing::mixed::{Conditions, Elements, Energy, Fairing, Settings, Values};
use armature_fairing::{Domain, DomainSettings, Join, PatchSettings, RimShape};
use armature_geometry::TriangleMesh;
use draw::{Paint, View, write_row};
use glam::DVec3;

fn go(_stage: &'static str, _done: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("give a folder")?);
    std::fs::create_dir_all(&folder)?;
    holes(&folder)?;
    blend(&folder)?;
    domains(&folder)?;
    sheet_figures(&folder)?;
    creases(&folder)?;
    if let Some(model) = arguments.next() {
        displacement(&folder, Path::new(&model))?;
    }
    Ok(())
}

/// The upper half of a sphere is cut off and made again (figure 3.14).
fn holes(folder: &Path) -> Result<(), Box<dyn Error>> {
    let (around, along) = (48_u32, 14_u32);
    let place = |i: u32, j: u32| {
        let (s, c) = (0.5 * std::f64::consts::PI * f64::from(j + 1) / f64::from(along)).sin_cos();
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(around)).sin_cos();
        [s * cos, -c, -s * sin]
    };
    let mut vertices: Vec<[f64; 3]> = (0..along).flat_map(|j| (0..around).map(move |i| place(i, j))).collect();
    vertices.push([0.0, -1.0, 0.0]);
    let pole = vertices.len() as u32 - 1;
    let at = |i: u32, j: u32| j * around + i % around;
    let mut triangles: Vec<[u32; 3]> = (0..around).map(|i| [pole, at(i + 1, 0), at(i, 0)]).collect();
    for (i, j) in (0..around).flat_map(|i| (0..along - 1).map(move |j| (i, j))) {
        triangles.extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
    }
    let bowl = TriangleMesh { vertices, triangles };
    let found = find_holes(&bowl)?;
    let mut views = Vec::new();
    for join in [
        Join::Tangent,
        Join::Angle { degrees: -60.0, strength: 1.0 },
        Join::Angle { degrees: 40.0, strength: 2.0 },
        Join::Curvature,
        Join::Bent { degrees: 0.0, strength: 1.0, curvature: 3.0 },
    ] {
        let settings = PatchSettings { join, ..PatchSettings::default() };
        let filled = fill_holes(&bowl, &found, &[0], &settings, &mut go)?;
        let patch = &filled.patches[0];
        println!("{join:?}: {:?}, {} rounds, {} vertices", patch.outcome, patch.rounds, patch.vertices.len());
        let patch_from = patch.triangles.start;
        views.push(View { mesh: filled.mesh, patch_from, paint: Paint::Clay, yaw: 0.5, pitch: 0.25 });
    }
    write_row(&folder.join("holes.png"), &views)
}

/// Points around a section of a tube.
const AROUND: u32 = 48;

/// The radius of a tube by the sine and cosine of the direction.
type Section<'a> = &'a dyn Fn(f64, f64) -> f64;

/// Two tubes along z with a gap around the origin: their sections, and where they start.
fn two_tubes(tubes: [(Section<'_>, f64); 2]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for (radius, low) in tubes {
        let first = mesh.vertices.len() as u32;
        let rows = 12;
        for j in 0..=rows {
            mesh.vertices.extend((0..AROUND).map(|i| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(AROUND)).sin_cos();
                let radius = radius(sin, cos);
                [radius * cos, radius * sin, low + 1.7 * f64::from(j) / f64::from(rows)]
            }));
        }
        let at = |i: u32, j: u32| first + j * AROUND + i % AROUND;
        for (i, j) in (0..AROUND).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            mesh.triangles
                .extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
        }
    }
    mesh
}

/// The holes on both sides of the gap.
fn inner_holes(found: &Holes) -> Vec<usize> {
    (0..found.holes.len()).filter(|&h| found.holes[h].centre[2].abs() < 1.5).collect()
}

/// A mesh along z, drawn along x.
fn lying(mesh: &TriangleMesh, patch_from: usize, paint: Paint) -> View {
    let vertices = mesh.vertices.iter().map(|p| [p[2], p[0], p[1]]).collect();
    let mesh = TriangleMesh { vertices, triangles: mesh.triangles.clone() };
    View { mesh, patch_from, paint, yaw: 0.35, pitch: 0.45 }
}

/// A tube with a square and one with a round section are joined (figure 3.15).
fn blend(folder: &Path) -> Result<(), Box<dyn Error>> {
    // A square with round corners.
    let square = |sin: f64, cos: f64| 1.1 / (cos.powi(8) + sin.powi(8)).powf(0.125);
    let mesh = two_tubes([(&square, -2.6), (&|_, _| 0.8, 0.9)]);
    let found = find_holes(&mesh)?;
    let inner = inner_holes(&found);
    let mut views = Vec::new();
    for join in [Join::Tangent, Join::Curvature] {
        let settings = PatchSettings { join, coarseness: 0.7, ..PatchSettings::default() };
        let joined = blend_rims(&mesh, &found, &inner, &settings, &mut go)?;
        println!("blend {join:?}: {:?}, {} rounds", joined.patches[0].outcome, joined.patches[0].rounds);
        let patch_from = joined.patches[0].triangles.start;
        views.extend([Paint::Clay, Paint::Lines].map(|paint| lying(&joined.mesh, patch_from, paint)));
    }
    write_row(&folder.join("blend.png"), &views)
}

/// A wide tube and a narrow one are joined by functions on a cylinder, and on an annulus (figure 3.17).
fn domains(folder: &Path) -> Result<(), Box<dyn Error>> {
    let mesh = two_tubes([(&|_, _| 1.1, -2.6), (&|_, _| 0.6, 0.9)]);
    let found = find_holes(&mesh)?;
    let ends: [usize; 2] = inner_holes(&found).try_into().map_err(|_| "two rims face each other")?;
    let mut views = Vec::new();
    for (domain, angles, curvature) in [
        (Domain::Cylinder, [0.0, 0.0], None),
        (Domain::Cylinder, [40.0, 40.0], None),
        (Domain::Cylinder, [40.0, -40.0], None),
        (Domain::Cylinder, [0.0, 0.0], Some(0.0)),
        (Domain::Cylinder, [0.0, 0.0], Some(3.0)),
        (Domain::Annulus, [40.0, 40.0], None),
    ] {
        let shapes = angles.map(|degrees| RimShape { degrees, strength: 1.0, curvature });
        let settings = DomainSettings { domain, shapes, coarseness: 0.7, ..DomainSettings::default() };
        let joined = blend_on_domain(&mesh, &found, ends, &settings, &mut go)?;
        println!("{domain:?} {angles:?} {curvature:?}: residual {:.1e}", joined.patches[0].residual);
        views.push(lying(&joined.mesh, joined.patches[0].triangles.start, Paint::Clay));
    }
    write_row(&folder.join("domains.png"), &views)
}

/// A sheet with regions, curves and points (figures 3.2 to 3.5).
fn sheet_figures(folder: &Path) -> Result<(), Box<dyn Error>> {
    let (rings, around) = (30_u32, 96_u32);
    let mut vertices = vec![[0.0, 0.0]];
    for j in 1..=rings {
        vertices.extend((0..around).map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(around)).sin_cos();
            let radius = f64::from(j) / f64::from(rings);
            [radius * cos, radius * sin]
        }));
    }
    let at = |i: u32, j: u32| 1 + (j - 1) * around + i % around;
    let mut triangles: Vec<[u32; 3]> = (0..around).map(|i| [0, at(i, 1), at(i + 1, 1)]).collect();
    for (i, j) in (0..around).flat_map(|i| (1..rings).map(move |j| (i, j))) {
        triangles.extend([[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]);
    }
    let radius = |v: u32| (vertices[v as usize][0]).hypot(vertices[v as usize][1]);
    let elements = Elements::of_positions(&vertices, &triangles)?;
    let rim: Vec<u32> = (0..around).map(|i| at(i, rings)).collect();
    let edges: Vec<[u32; 2]> = (0..around).map(|i| [at(i, rings), at(i + 1, rings)]).collect();
    let all = 0..vertices.len() as u32;
    // Region: outer rings and a lifted disc; curve: the rim alone; point: the rim and one vertex.
    let region: Vec<u32> = all.filter(|&v| radius(v) < 0.25 || radius(v) > 0.87).collect();
    let mut pinned = rim.clone();
    pinned.push(0);
    let lifted =
        |list: &[u32]| -> Vec<[f64; 1]> { list.iter().map(|&v| [if radius(v) < 0.5 { 0.7 } else { 0.0 }]).collect() };
    let wave = |k: u32| 1.6 * (3.0 * std::f64::consts::TAU * f64::from(k) / f64::from(around)).sin() - 1.0;
    let tangents = |steep: &dyn Fn(u32) -> f64| -> Vec<[[f64; 1]; 2]> {
        (0..around).map(|k| [[steep(k)], [steep(k + 1)]]).collect()
    };
    let mut views = Vec::new();
    let mut show =
        |energy, conditions: Conditions, steep: &dyn Fn(u32) -> f64, bent: f64| -> Result<(), Box<dyn Error>> {
            let fairing = Fairing::precompute(&elements, &conditions, &Settings::new(energy))?;
            let tangents = if conditions.borders.is_empty() { Vec::new() } else { tangents(steep) };
            // On a circle of radius 1 the Laplacian is the second plus the first derivative outwards.
            let laplacians: Vec<[f64; 1]> =
                conditions.bent.iter().enumerate().map(|(k, _)| [bent + steep(k as u32)]).collect();
            let fixed = lifted(&conditions.fixed);
            let values = Values { fixed: &fixed, tangents: &tangents, laplacians: &laplacians, source: &[] };
            let solution = fairing.solve(&values)?;
            println!("sheet {energy:?}: residual {:.1e}", solution.residual);
            let places = vertices.iter().zip(&solution.values).map(|(p, u)| [p[0], u[0], -p[1]]).collect();
            let mesh = TriangleMesh { vertices: places, triangles: triangles.clone() };
            views.push(View { mesh, patch_from: 0, paint: Paint::Clay, yaw: 0.4, pitch: 0.55 });
            Ok(())
        };
    let of = |fixed: &[u32]| Conditions { fixed: fixed.to_vec(), ..Conditions::default() };
    let curve = |fixed: &[u32], bent: bool| Conditions {
        fixed: fixed.to_vec(),
        borders: edges.clone(),
        bent: if bent { rim.clone() } else { Vec::new() },
    };
    let flat = |_: u32| 0.0;
    show(Energy::Laplacian, of(&region), &flat, 0.0)?;
    show(Energy::LaplacianGradient, of(&region), &flat, 0.0)?;
    show(Energy::Laplacian, curve(&pinned, false), &flat, 0.0)?;
    show(Energy::Laplacian, curve(&rim, false), &wave, 0.0)?;
    show(Energy::LaplacianGradient, curve(&rim, true), &|_| -1.0, 0.0)?;
    show(Energy::LaplacianGradient, curve(&rim, true), &|_| -1.0, 8.0)?;
    show(Energy::LaplacianGradient, curve(&pinned, true), &flat, 0.0)?;
    write_row(&folder.join("sheets.png"), &views)
}

/// A sheet is lifted along a curve: smoothly, with a crease, and with slopes on both sides of it (figure 3.16).
fn creases(folder: &Path) -> Result<(), Box<dyn Error>> {
    let (wide, deep) = (60_u32, 40_u32);
    let at = |i: u32, j: u32| j * (wide + 1) + i;
    let place = |i: u32, j: u32| [f64::from(i) / 20.0 - 1.5, 0.0, 1.0 - f64::from(j) / 20.0];
    let vertices = (0..=deep).flat_map(|j| (0..=wide).map(move |i| place(i, j))).collect();
    let squares = (0..deep).flat_map(|j| (0..wide).map(move |i| (i, j)));
    let triangles = squares
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    let sheet = TriangleMesh { vertices, triangles };
    let region: Vec<u32> = (3..=deep - 3).flat_map(|j| (3..=wide - 3).map(move |i| at(i, j))).collect();
    let ridge: Vec<u32> = (10..=deep - 10).map(|j| at(wide / 2, j)).collect();
    let (down, up) = ([0.0, -1.2, 0.0], [0.0, 0.8, 0.0]);
    let mut views = Vec::new();
    for slopes in [None, Some(None), Some(Some([down, down])), Some(Some([up, down]))] {
        let sharp: Vec<SharpCurve> =
            slopes.iter().map(|&slopes| SharpCurve { vertices: ridge.clone(), slopes }).collect();
        let settings = RegionSettings { energy: Energy::LaplacianGradient };
        let editor = RegionEditor::precompute(&sheet, &region, &ridge, &sharp, &settings)?;
        let (edited, residual) = editor.edited(&sheet, &vec![[0.0, 0.6, 0.0]; ridge.len()])?;
        println!("crease {slopes:?}: residual {residual:.1e}");
        views.push(View { mesh: edited, patch_from: 0, paint: Paint::Clay, yaw: 0.3, pitch: 0.5 });
    }
    write_row(&folder.join("creases.png"), &views)
}

/// The vertex furthest along -Z, with what is around it, is drawn out (figure 3.18).
fn displacement(folder: &Path, model: &Path) -> Result<(), Box<dyn Error>> {
    let read = armature_test_support::read_obj(model);
    let mesh = TriangleMesh { vertices: read.vertices, triangles: read.triangles };
    let (low, high) = mesh.bounds().ok_or("the model is empty")?;
    let size = DVec3::from(low).distance(high.into());
    let front = mesh.vertices.iter().min_by(|a, b| a[2].total_cmp(&b[2])).ok_or("the model is empty")?;
    let tip = near_vertices(&mesh, &[*front]).ok_or("the model has no triangles")?;
    let nose = vertices_within(&mesh, &tip, 0.05 * size);
    let region = vertices_within(&mesh, &tip, 0.28 * size);
    let mut views = vec![View { mesh: mesh.clone(), patch_from: 0, paint: Paint::Clay, yaw: 2.2, pitch: 0.15 }];
    for energy in [Energy::Laplacian, Energy::LaplacianGradient] {
        let editor = RegionEditor::precompute(&mesh, &region, &nose, &[], &RegionSettings { energy })?;
        let pull = vec![[0.0, 0.02 * size, -0.14 * size]; nose.len()];
        let (edited, residual) = editor.edited(&mesh, &pull)?;
        println!("{energy:?}: {} vertices follow, residual {residual:.1e}", editor.free_count());
        views.push(View { mesh: edited, patch_from: 0, paint: Paint::Clay, yaw: 2.2, pitch: 0.15 });
    }
    write_row(&folder.join("displacement.png"), &views)
}
