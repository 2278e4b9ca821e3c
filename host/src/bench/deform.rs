//! Skinning kernels, and poses by as-rigid-as-possible energies.

use std::hint::black_box;
use std::ops::ControlFlow;

use armature_deform::arap::{
    ArapEnergy, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap, SharedJoint,
};
use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, SkinError, StretchTwist, StretchTwistSkin,
};
use armature_geometry::Influences;
use glam::{Affine3A, Quat, Vec3};

use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "deform/lbs-43k",
    "deform/lbs-43k-bandwidth",
    "deform/dqs-43k",
    "deform/stretch-twist-lbs-43k",
    "deform/stretch-twist-dqs-43k",
    "deform/crowd-of-100",
    "deform/switch-23",
    "deform/iteration-armadillo",
    "deform/iteration-gingerbread",
    "deform/iteration-bubble-man",
    "deform/iteration-octopus",
    "deform/iteration-ogre",
    "deform/iteration-bar",
    "deform/iteration-wiener-dog",
    "deform/switch-armadillo",
    "deform/switch-gingerbread",
    "deform/switch-bubble-man",
    "deform/switch-octopus",
    "deform/switch-ogre",
    "deform/switch-bar",
    "deform/switch-wiener-dog",
];

/// As many vertices and bones as the armadillo.
const VERTICES: usize = 43_243;
const BONES: usize = 23;
const SKIN_RUNS: usize = 101;
const SOLVE_RUNS: usize = 101;
const SWITCH_RUNS: usize = 41;
/// The thesis's number, for every frame.
const ITERATIONS: usize = 15;
pub(super) const CROWD: usize = 100;

/// A row of thesis table 7.1: an iteration's time does not depend on the model, only on how many handles and rotation
/// clusters it has. The last two were measured for the thesis on a Core i7-2860QM at 2.5 GHz.
struct Model {
    iteration: &'static str,
    switch: &'static str,
    planar: bool,
    handles: usize,
    clusters: usize,
    iteration_words: &'static str,
    switch_words: &'static str,
}

#[rustfmt::skip]
const TABLE: [Model; 7] = [
    Model { iteration: "deform/iteration-armadillo", switch: "deform/switch-armadillo", planar: false, handles: 17, clusters: 34, iteration_words: "thesis: 20 µs; libigl's arap_dof (C++ only, not in PyPI's module): 9 µs in f32", switch_words: "thesis: 15 ms" },
    Model { iteration: "deform/iteration-gingerbread", switch: "deform/switch-gingerbread", planar: true, handles: 9, clusters: 18, iteration_words: "thesis: 11 µs", switch_words: "thesis: 14 ms" },
    Model { iteration: "deform/iteration-bubble-man", switch: "deform/switch-bubble-man", planar: true, handles: 5, clusters: 10, iteration_words: "thesis: 7 µs", switch_words: "thesis: 3 ms" },
    Model { iteration: "deform/iteration-octopus", switch: "deform/switch-octopus", planar: false, handles: 9, clusters: 18, iteration_words: "thesis: 10 µs", switch_words: "thesis: 9 ms" },
    Model { iteration: "deform/iteration-ogre", switch: "deform/switch-ogre", planar: false, handles: 20, clusters: 40, iteration_words: "thesis: 22 µs", switch_words: "thesis: 6 ms" },
    Model { iteration: "deform/iteration-bar", switch: "deform/switch-bar", planar: false, handles: 32, clusters: 64, iteration_words: "thesis: 42 µs", switch_words: "thesis: 32 ms" },
    Model { iteration: "deform/iteration-wiener-dog", switch: "deform/switch-wiener-dog", planar: false, handles: 33, clusters: 66, iteration_words: "thesis: 43 µs", switch_words: "thesis: 77 ms" },
];

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| defect(e.to_string()))?;
    let mut out = pool.install(skins)?;
    let (crowd, switch) = (crowd()?, switch_bones()?);
    out.extend([crowd, switch]);
    for model in &TABLE {
        out.extend(table_row(model)?);
    }
    Ok(out)
}

pub(super) fn defect(what: String) -> Failure {
    Failure::not_converged(what, "this is a defect; please report it")
}

/// n×3.
type Vectors = [[f32; 3]];

/// As large as the armadillo, with four influences per vertex.
pub(super) struct Shape {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) influences: Influences,
    pub(super) rest: Vec<Affine3A>,
    /// Every bone turned.
    pub(super) pose: Vec<Affine3A>,
}

fn bone_start(bone: usize) -> Vec3 {
    Vec3::Y * (bone as f32 * 0.1)
}

fn bone_turn(bone: usize) -> Quat {
    Quat::from_rotation_x(bone as f32 * 0.05)
}

impl Shape {
    pub(super) fn new() -> Result<Self, Failure> {
        let bones: Vec<u16> = (0..VERTICES * 4).map(|i| ((i / 4 * BONES / VERTICES + i % 4) % BONES) as u16).collect();
        let weights: Vec<f32> = (0..VERTICES * 4).map(|i| [0.4, 0.3, 0.2, 0.1][i % 4]).collect();
        Ok(Self {
            positions: (0..VERTICES).map(|i| spiral(i as f32)).collect(),
            influences: Influences::new(4, bones, weights, BONES).map_err(|e| defect(e.to_string()))?,
            rest: (0..BONES).map(|b| Affine3A::from_translation(bone_start(b))).collect(),
            pose: (0..BONES).map(|b| Affine3A::from_rotation_translation(bone_turn(b), bone_start(b))).collect(),
        })
    }
}

/// Every bone turned, stretched and twisted.
fn skins() -> Result<Vec<Measurement>, Failure> {
    let Shape { positions, influences, rest, pose } = Shape::new()?;
    let ends: Vec<f32> = (0..VERTICES * 4).map(|i| (i % 97) as f32 / 96.0).collect();
    let segment = |b: usize| BoneSegment { start: bone_start(b), end: bone_start(b + 1) };
    let segments: Vec<BoneSegment> = (0..BONES).map(segment).collect();
    let twisted: Vec<StretchTwist> = (0..BONES)
        .map(|b| StretchTwist { start: bone_start(b), turn: bone_turn(b), stretch: 1.1, twist: [0.1, 0.1 * b as f32] })
        .collect();
    let failed = |e: SkinError| defect(e.to_string());
    let mut linear = LinearBlendSkin::precompute(&positions, &positions, &influences, &rest).map_err(failed)?;
    let mut dual = DualQuaternionSkin::precompute(&positions, &positions, &influences, &rest).map_err(failed)?;
    let stretched = |blend| StretchTwistSkin::precompute(&positions, &positions, &influences, &ends, &segments, blend);
    let mut linear_twist = stretched(BoneBlend::Linear).map_err(failed)?;
    let mut dual_twist = stretched(BoneBlend::DualQuaternion).map_err(failed)?;
    let (mut out, mut normals) = (positions.clone(), positions.clone());
    let mut outcome = Ok(());
    let mut time = |work: &mut dyn FnMut(&mut Vectors, &mut Vectors) -> Result<(), SkinError>| {
        let seconds = time_runs(SKIN_RUNS, || {
            if let Err(error) = work(&mut out, &mut normals) {
                outcome = Err(error);
            }
        });
        median(&seconds) * 1e3
    };
    let by_linear = time(&mut |out, normals| linear.solve(black_box(&pose), out, normals));
    let others = [
        ("deform/dqs-43k", time(&mut |out, normals| dual.solve(black_box(&pose), out, normals))),
        ("deform/stretch-twist-lbs-43k", time(&mut |out, n| linear_twist.solve(black_box(&twisted), out, n))),
        ("deform/stretch-twist-dqs-43k", time(&mut |out, n| dual_twist.solve(black_box(&twisted), out, n))),
    ];
    outcome.map_err(failed)?;
    let linear = Measurement::new("deform/lbs-43k", by_linear, "ms", SKIN_RUNS);
    let mut all = vec![linear.at_most(0.5, "at most 0.5 ms on one core"), bandwidth(by_linear)];
    all.extend(others.map(|(name, millis)| Measurement {
        peer: Some(("linear blending".into(), by_linear)),
        ..Measurement::new(name, millis, "ms", SKIN_RUNS).at_most(2.0 * by_linear, "at most twice linear blending")
    }));
    Ok(all)
}

/// What linear blending reads and writes per second, compared with copying large arrays.
fn bandwidth(millis: f64) -> Measurement {
    // Position, normal and their results; a bone's number and weight for each of four influences; a block's header.
    let bytes = VERTICES * (4 * 12 + 4 * 6 + 1);
    let from = vec![1.0_f32; 1 << 24];
    let mut to = vec![0.0_f32; 1 << 24];
    let seconds = time_runs(7, || black_box(&mut to).copy_from_slice(black_box(&from)));
    let copying = 2.0 * f64::from(1 << 26) / median(&seconds);
    let share = bytes as f64 / (millis * 1e-3) / copying;
    Measurement {
        note: Some("of what copying 64 MiB reads and writes a second; the arrays skinned fit the last cache"),
        ..Measurement::new("deform/lbs-43k-bandwidth", 100.0 * share, "%", SKIN_RUNS)
    }
}

fn spiral(i: f32) -> [f32; 3] {
    let (height, angle) = (i / VERTICES as f32 * 2.0 - 1.0, i * 2.399_963);
    let radius = (1.0 - height * height).max(0.0).sqrt();
    [radius * angle.cos(), height, radius * angle.sin()]
}

/// A bar along x with its handles in a row, each meeting the next at a joint: a volume, or a strip in the plane.
fn row_of_handles(planar: bool, handles: usize, clusters: usize) -> Result<ReducedArap, Failure> {
    const LENGTH: usize = 60;
    let across = if planar { [6, 0] } else { [4, 4] };
    let at = |x: usize, y: usize, z: usize| ((x * (across[0] + 1) + y) * (across[1] + 1) + z) as u32;
    let mut positions = Vec::new();
    for x in 0..=LENGTH {
        for y in 0..=across[0] {
            for z in 0..=across[1] {
                positions.push([x as f64 + 0.1 * ((x * 7 + y * 3 + z) % 5) as f64, y as f64, z as f64]);
            }
        }
    }
    let (mut triangles, mut tetrahedra) = (Vec::new(), Vec::new());
    for x in 0..LENGTH {
        for y in 0..across[0] {
            triangles.push([at(x, y, 0), at(x + 1, y, 0), at(x + 1, y + 1, 0)]);
            triangles.push([at(x, y, 0), at(x + 1, y + 1, 0), at(x, y + 1, 0)]);
            for z in 0..across[1] {
                for [a, b] in [[4, 6], [6, 2], [2, 3], [3, 1], [1, 5], [5, 4]] {
                    let corner = |bits: usize| at(x + (bits >> 2 & 1), y + (bits >> 1 & 1), z + (bits & 1));
                    tetrahedra.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    let middle = across.map(|a| 0.5 * a as f64);
    let along = |part: f64| [LENGTH as f64 * part / handles as f64, middle[0], middle[1]];
    let points: Vec<[f64; 3]> = (0..handles).map(|h| along(h as f64 + 0.5)).collect();
    let mut weights = Vec::with_capacity(positions.len() * handles);
    for p in &positions {
        let near = |h: &[f64; 3]| {
            let squared: f64 = (0..3).map(|axis| (p[axis] - h[axis]).powi(2)).sum();
            Some(1.0 / (squared + 0.05).powi(2)).filter(|w| *w > 1e-4).unwrap_or(0.0)
        };
        let row: Vec<f64> = points.iter().map(near).collect();
        let sum: f64 = row.iter().sum();
        weights.extend(row.iter().map(|w| w / sum));
    }
    let joints: Vec<SharedJoint> =
        (1..handles).map(|h| SharedJoint { handles: [h - 1, h], point: along(h as f64) }).collect();
    let energy = if planar { ArapEnergy::PlanarTriangles(&triangles) } else { ArapEnergy::Tetrahedra(&tetrahedra) };
    let shape = ArapShape {
        positions: &positions,
        energy,
        weights: ArapWeights::Matrix(&weights),
        handle_points: &points,
        joints: &joints,
    };
    let settings = ArapSettings { clusters: Some(clusters), ..ArapSettings::default() };
    ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).map_err(|e| defect(e.to_string()))
}

/// The first handle fully given, the last one's position.
fn held_at_both_ends(handles: usize) -> Vec<HandleConstraint> {
    let mut kinds = vec![HandleConstraint::Free; handles];
    kinds[0] = HandleConstraint::Full;
    kinds[handles - 1] = HandleConstraint::Position;
    kinds
}

/// Never stops early.
fn steps(iterations: usize) -> ArapStop {
    ArapStop { iterations, tolerance: -1.0 }
}

fn table_row(model: &Model) -> Result<[Measurement; 2], Failure> {
    let mut arap = row_of_handles(model.planar, model.handles, model.clusters)?;
    let kinds = held_at_both_ends(model.handles);
    let mut outcome = Ok(());
    let switched = time_runs(SWITCH_RUNS, || outcome = arap.constrain(black_box(&kinds), &[]));
    outcome.map_err(|e| defect(e.to_string()))?;
    let targets = vec![Affine3A::from_translation(Vec3::new(0.1, 0.2, 0.0)); model.handles];
    let mut time = |iterations: usize| {
        median(&time_runs(SOLVE_RUNS, || {
            black_box(arap.solve(black_box(&targets), &[], steps(iterations))).ok();
        }))
    };
    let iteration = (time(201) - time(1)) / 200.0 * 1e6;
    let mut iteration = Measurement {
        note: Some(model.iteration_words),
        ..Measurement::new(model.iteration, iteration, "µs", SOLVE_RUNS)
    };
    if model.handles == 17 {
        iteration = iteration.at_most(3.0, "at most 3 µs");
    }
    let switch = Measurement::new(model.switch, median(&switched) * 1e3, "ms", SWITCH_RUNS);
    Ok([iteration, Measurement { note: Some(model.switch_words), ..switch }])
}

/// Any of these sets of constraints; the slowest is reported.
fn switch_bones() -> Result<Measurement, Failure> {
    let mut arap = row_of_handles(false, BONES, 2 * BONES)?;
    let kinds = [HandleConstraint::Free, HandleConstraint::Position, HandleConstraint::Orientation];
    let mixed = (0..BONES).map(|b| kinds[b % 3]).collect();
    let mut worst = 0.0_f64;
    for set in [vec![HandleConstraint::Free; BONES], held_at_both_ends(BONES), mixed] {
        let mut outcome = Ok(());
        worst = worst.max(median(&time_runs(SWITCH_RUNS, || outcome = arap.constrain(black_box(&set), &[]))));
        outcome.map_err(|e| defect(e.to_string()))?;
    }
    Ok(Measurement::new("deform/switch-23", worst * 1e3, "ms", SWITCH_RUNS).at_most(1.0, "at most 1 ms at 23 bones"))
}

fn crowd() -> Result<Measurement, Failure> {
    let mut one = row_of_handles(false, 17, 34)?;
    one.constrain(&held_at_both_ends(17), &[]).map_err(|e| defect(e.to_string()))?;
    let mut all = vec![one; CROWD];
    let mut frame = 0_usize;
    let seconds = time_runs(SOLVE_RUNS, || {
        frame += 1;
        for (number, arap) in all.iter_mut().enumerate() {
            let turn = Quat::from_rotation_z(0.3 * ((frame + number) as f32 * 0.1).sin());
            let target = Affine3A::from_rotation_translation(turn, Vec3::Y * (0.01 * number as f32));
            black_box(arap.solve(&[target; 17], &[], steps(ITERATIONS))).ok();
        }
    });
    Ok(Measurement {
        note: Some("thesis: 30 a second"),
        ..Measurement::new("deform/crowd-of-100", 1.0 / median(&seconds), "1/s", SOLVE_RUNS)
            .at_least(200.0, "at least 200 poses of 100 armadillos a second on one core")
    })
}
