//! Draws bounded weights, monotone ones, and monotone ones that were solved together, of shapes with long appendages: at
//! rest with their spurious extrema, and posed; and noisy data before and after they are smoothed, into this folder or another:
//! `cargo run --release --example controlled_extrema -- [FOLDER]`.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature::failure::Failure;
use armature::files::Overwrite;
use armature::pictures::function::{Dot, FunctionPicture, Shown, write_function_pictures};
use armature_character::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, SpuriousExtrema,
    SpuriousExtremum, WeightMethod, WeightsOn, handle_weights,
};
use armature_geometry::TriangleMesh;
use armature_weights::extrema::{PersistentExtremum, persistence};
use armature_weights::monotone::{Data, Keep, MonotoneProblem, MonotoneSettings, smooth_keeping};
use armature_weights::{FunctionDomain, WeightMatrix};
use glam::{DQuat, DVec3};

/// A shape with point handles, one of which is turned about an axis (degrees) and moved.
struct Shot {
    file: &'static str,
    mesh: TriangleMesh,
    handles: Vec<[f64; 3]>,
    on: WeightsOn,
    /// The handle whose weights are shown, and which moves.
    moved: usize,
    turn: (DVec3, f64),
    by: DVec3,
}

fn main() -> Result<(), Failure> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("."), PathBuf::from);
    for shot in shots() {
        draw_shot(&folder, &shot)?;
    }
    let wave = |[x, y, _]: [f64; 3]| (2.6 * x).sin() + (2.1 * y + 0.5).cos();
    smooth(&folder.join("extrema-disc.png"), &disc(60), &wave, Keep::Persistence(0.6))?;
    let lobes = |[x, y, z]: [f64; 3]| (1.0 - z * z) * (3.0 * y.atan2(x)).sin() + 0.3 * z;
    smooth(
        &folder.join("extrema-sphere.png"),
        &tube(60, |s| (s * TAU / 2.0).sin(), |s| -(s * TAU / 2.0).cos()),
        &lobes,
        Keep::Most(6),
    )
}

fn shots() -> Vec<Shot> {
    let within = |v: f64, from: f64, to: f64| (from..to).contains(&v);
    // What hangs on the middle of each shape runs along the direction in which the weights change.
    let propeller = flat(0.05, [5.0, 5.2], |x, y| {
        let (along, across) = (0.6 * (x - 2.2) + 0.8 * (y - 2.5), 0.8 * (x - 2.2) - 0.6 * (y - 2.5));
        (within(y, 2.0, 3.0) && x < 4.4) || (across.abs() < 0.35 && along.abs() < 3.0)
    });
    let cactus = flat(0.05, [4.0, 5.0], |x, y| {
        within(x, 1.5, 2.5)
            || (within(x, 0.5, 1.5) && within(y, 0.8, 2.0))
            || (within(x, 0.5, 1.3) && within(y, 0.8, 4.5))
            || (within(x, 2.5, 3.5) && within(y, 1.6, 2.6))
            || (within(x, 2.8, 3.5) && within(y, 1.6, 4.0))
    });
    // A trunk with a tail that hangs off its back and turns up, and a pipe with a bell that opens beside it.
    let tailed = rounded(voxels(0.1, [2.6, 4.4, 0.8], |[x, y, _]| {
        within(x, 1.7, 2.5) || (x < 1.7 && within(y, 1.1, 1.9)) || (x < 0.6 && within(y, 1.1, 4.4))
    }));
    let horn = rounded(voxels(0.1, [3.4, 4.4, 2.0], |[x, y, z]| {
        let radius = if y < 3.2 { 0.45 } else { 0.45 + 0.5 * (y - 3.2) };
        let bell = (x - 1.0).hypot(z - 1.0) < radius && y > 1.0;
        let bend = within(x, 1.0, 2.8) && within(y, 1.0, 1.9) && within(z, 0.6, 1.4);
        bell || bend || (within(x, 2.3, 3.1) && within(z, 0.6, 1.4))
    }));
    let volume = WeightsOn::Volume { vertices: 2500 };
    vec![
        Shot {
            file: "extrema-propeller.png",
            mesh: propeller,
            handles: vec![[0.3, 2.5, 0.0], [4.1, 2.5, 0.0]],
            on: WeightsOn::Surface,
            moved: 0,
            turn: (DVec3::Z, 0.0),
            by: DVec3::new(-1.5, 3.0, 0.0),
        },
        Shot {
            file: "extrema-cactus.png",
            mesh: cactus,
            handles: vec![[2.0, 0.3, 0.0], [2.0, 2.5, 0.0], [2.0, 4.7, 0.0]],
            on: WeightsOn::Surface,
            moved: 1,
            turn: (DVec3::Z, 0.0),
            by: DVec3::new(3.0, 0.6, 0.0),
        },
        Shot {
            file: "extrema-tail.png",
            mesh: tailed,
            handles: vec![[2.1, 0.3, 0.4], [2.1, 4.1, 0.4]],
            on: volume,
            moved: 1,
            turn: (DVec3::Z, 0.0),
            by: DVec3::new(4.5, 0.5, 0.0),
        },
        Shot {
            file: "extrema-horn.png",
            mesh: horn,
            handles: vec![[2.7, 0.3, 1.0], [2.7, 4.1, 1.0]],
            on: volume,
            moved: 1,
            turn: (DVec3::Z, 0.0),
            by: DVec3::new(4.5, 0.5, 0.0),
        },
    ]
}

fn on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn failed(error: impl Into<Box<dyn std::error::Error>>) -> Failure {
    Failure::not_converged(error.into().to_string(), "")
}

fn draw_shot(folder: &Path, shot: &Shot) -> Result<(), Failure> {
    let shape =
        |(k, &place): (usize, &[f64; 3])| HandleShape { name: format!("{k}"), place: HandlePlace::Point(place) };
    let shapes: Vec<HandleShape> = shot.handles.iter().enumerate().map(shape).collect();
    let held = Held::Shapes { shapes: &shapes, cage: &[] };
    let solve = |method, partition| {
        let settings = HandleWeightsSettings {
            method,
            tier: BiharmonicTier::Interactive,
            on: shot.on,
            partition,
            joint_release: 0.0,
        };
        handle_weights(&shot.mesh, None, held, &settings, &mut on).map_err(failed)
    };
    let monotone = WeightMethod::Monotone { order: 2 };
    let all = [
        ("bounded", solve(WeightMethod::BoundedBiharmonic, Partition::Normalised)?),
        ("monotone, scaled", solve(monotone, Partition::Normalised)?),
        ("monotone, together", solve(monotone, Partition::Exact)?),
    ];
    let parts: Vec<_> = all
        .iter()
        .map(|(title, made)| {
            let of_all = |all: &[Vec<SpuriousExtremum>]| all.iter().map(Vec::len).sum::<usize>();
            println!(
                "{} {title}: {} vertices, energy {:.5}, spurious extrema of all handles {}, scaled {:?}; converged: {}",
                shot.file,
                made.domain_vertices,
                made.energy(),
                of_all(&made.spurious.computed),
                made.spurious.scaled.as_deref().map(of_all),
                made.converged(),
            );
            let most = SpuriousExtrema::total(made.spurious.last()).1;
            println!("    the worst is {most:.4} from its saddle");
            let dots: Vec<Dot> = made.spurious.last()[shot.moved].iter().map(dot).collect();
            (*title, made.weights.bone(shot.moved), dots, posed(shot, &made.weights))
        })
        .collect();
    let range = [0.0, 1.0];
    let at_rest = parts.iter().map(|(title, values, dots, _)| FunctionPicture {
        mesh: &shot.mesh,
        shown: Shown::Values { values, range },
        title,
        legend: &[],
        extrema: dots,
    });
    let moved = parts.iter().map(|(_, values, _, mesh)| FunctionPicture {
        mesh,
        shown: Shown::Values { values, range },
        title: "",
        legend: &[],
        extrema: &[],
    });
    let pictures: Vec<FunctionPicture> = at_rest.chain(moved).collect();
    let path = folder.join(shot.file);
    write_function_pictures(Overwrite { force: true }, &path, &pictures, parts.len()).map(|_| ())
}

fn dot(one: &SpuriousExtremum) -> Dot {
    Dot { place: one.place, is_minimum: one.extremum.is_minimum }
}

/// Linear blending with one handle moved and the others at rest.
fn posed(shot: &Shot, weights: &WeightMatrix) -> TriangleMesh {
    let turn = DQuat::from_axis_angle(shot.turn.0, shot.turn.1.to_radians());
    let pivot = DVec3::from(shot.handles[shot.moved]);
    let mut mesh = shot.mesh.clone();
    for (vertex, weight) in weights.column(shot.moved) {
        let at = DVec3::from(mesh.vertices[vertex]);
        let there = pivot + turn * (at - pivot) + shot.by;
        mesh.vertices[vertex] = at.lerp(there, weight).to_array();
    }
    mesh
}

fn smooth(path: &Path, mesh: &TriangleMesh, clean: &dyn Fn([f64; 3]) -> f64, keep: Keep) -> Result<(), Failure> {
    let domain = FunctionDomain::of_triangles(mesh).map_err(failed)?;
    let noise = |k: usize| ((k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 23) - 1.0;
    let data: Vec<f64> = domain.vertices.iter().enumerate().map(|(k, &v)| clean(v) + 0.2 * noise(k)).collect();
    let FunctionDomain { neighbours, laplacian, mass, .. } = &domain;
    let problem = MonotoneProblem { neighbours, laplacian, mass, order: 2, blend: None, data: None };
    let fidelity = Data::fidelity_for(10.0 * domain.mean_edge(), problem.order);
    let settings = MonotoneSettings { convexifications: 3, ..MonotoneSettings::default() };
    let made = smooth_keeping(&problem, Data { values: &data, fidelity }, keep, &settings, &mut on).map_err(failed)?;
    println!(
        "{}: {} extrema before, {} after; {:?}",
        path.display(),
        made.before,
        made.kept.len(),
        made.function.report
    );
    let dots = |values: &[f64]| -> Result<Vec<Dot>, Failure> {
        let dot = |one: &PersistentExtremum| Dot { place: domain.vertices[one.vertex], is_minimum: one.is_minimum };
        Ok(persistence(neighbours, values).map_err(failed)?.iter().map(dot).collect())
    };
    let (before, after) = (dots(&data)?, dots(&made.function.values)?);
    let (data, smoothed) = (domain.spread(&data), domain.spread(&made.function.values));
    let range = [f64::min, f64::max].map(|pick| data.iter().copied().reduce(pick).unwrap_or(0.0));
    let picture = |values, title, extrema| {
        let shown = Shown::Values { values, range };
        FunctionPicture { mesh, shown, title, legend: &[], extrema }
    };
    let both = [picture(&data, "data", &before[..]), picture(&smoothed, "smoothed", &after)];
    write_function_pictures(Overwrite { force: true }, path, &both, 2).map(|_| ())
}

/// A flat figure of right triangles, wherever `inside` says for the middle of a square.
fn flat(h: f64, [width, height]: [f64; 2], inside: impl Fn(f64, f64) -> bool) -> TriangleMesh {
    let (nx, ny) = ((width / h).round() as usize, (height / h).round() as usize);
    let mut number = std::collections::BTreeMap::new();
    let mut mesh = TriangleMesh::default();
    for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
        if !inside((i as f64 + 0.5) * h, (j as f64 + 0.5) * h) {
            continue;
        }
        let mut at = |i: usize, j: usize| {
            *number.entry((i, j)).or_insert_with(|| {
                mesh.vertices.push([i as f64 * h, j as f64 * h, 0.0]);
                mesh.vertices.len() as u32 - 1
            })
        };
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        mesh.triangles.extend(if (i + j) % 2 == 0 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
    }
    mesh
}

/// A disc of radius one.
fn disc(cells: u32) -> TriangleMesh {
    let h = 2.0 / f64::from(cells);
    flat(h, [2.0, 2.0], |x, y| (x - 1.0).hypot(y - 1.0) < 1.0)
}

/// A closed surface of revolution about z, with this radius and height from 0 to 1 along it.
fn tube(around: u32, radius: impl Fn(f64) -> f64, height: impl Fn(f64) -> f64) -> TriangleMesh {
    let rings = around + around / 2;
    let mut vertices = vec![[0.0, 0.0, height(0.0)], [0.0, 0.0, height(1.0)]];
    for ring in 1..rings {
        let s = f64::from(ring) / f64::from(rings);
        vertices.extend((0..around).map(|k| {
            let (sin, cos) = (TAU * (f64::from(k) + 0.5 * f64::from(ring % 2)) / f64::from(around)).sin_cos();
            [radius(s) * cos, radius(s) * sin, height(s)]
        }));
    }
    let at = |ring: u32, k: u32| 2 + ring * around + k % around;
    let mut triangles = Vec::new();
    for k in 0..around {
        triangles.push([0, at(0, k + 1), at(0, k)]);
        triangles.push([1, at(rings - 2, k), at(rings - 2, k + 1)]);
    }
    for (ring, k) in (0..rings - 2).flat_map(|ring| (0..around).map(move |k| (ring, k))) {
        let [a, b, c, d] = [at(ring, k), at(ring, k + 1), at(ring + 1, k), at(ring + 1, k + 1)];
        // Odd rings are turned by half a step.
        triangles.extend(if ring % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
    }
    TriangleMesh { vertices, triangles }
}

/// The surface of a solid of cubes with edges of length `h`, wherever `inside` says for the middle of a cube.
fn voxels(h: f64, size: [f64; 3], inside: impl Fn([f64; 3]) -> bool) -> TriangleMesh {
    let cells = size.map(|length| (length / h).round() as i32);
    let filled = |cell: [i32; 3]| {
        (0..3).all(|k| (0..cells[k]).contains(&cell[k])) && inside(cell.map(|k| (f64::from(k) + 0.5) * h))
    };
    let mut number = std::collections::BTreeMap::new();
    let mut mesh = TriangleMesh::default();
    let all = (0..cells[2]).flat_map(|z| (0..cells[1]).flat_map(move |y| (0..cells[0]).map(move |x| [x, y, z])));
    for cell in all.filter(|&cell| filled(cell)) {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beyond = cell;
            beyond[axis] += 2 * side - 1;
            if filled(beyond) {
                continue;
            }
            let mut corner = |u: i32, v: i32| {
                let mut at = cell;
                at[axis] += side;
                at[(axis + 1) % 3] += u;
                at[(axis + 2) % 3] += v;
                *number.entry(at).or_insert_with(|| {
                    mesh.vertices.push(at.map(|k| f64::from(k) * h));
                    mesh.vertices.len() as u32 - 1
                })
            };
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            mesh.triangles.extend(if side == 1 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    mesh
}

/// Each vertex moves to the middle of its neighbours a few times.
fn rounded(mut mesh: TriangleMesh) -> TriangleMesh {
    for _ in 0..6 {
        let mut sums = vec![(DVec3::ZERO, 0.0); mesh.vertices.len()];
        for &[a, b, c] in &mesh.triangles {
            for (to, from) in [(a, b), (b, c), (c, a)] {
                sums[to as usize].0 += DVec3::from(mesh.vertices[from as usize]);
                sums[to as usize].1 += 1.0;
            }
        }
        mesh.vertices = sums.into_iter().map(|(sum, count)| (sum / count).to_array()).collect();
    }
    mesh
}
