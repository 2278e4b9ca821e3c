//! Momentum and gravity in the reduced solve: against libigl's implicit steps, and laws that every motion must obey.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

mod support;

use std::ops::ControlFlow;

use armature_deform::arap::{
    ArapDynamics, ArapEnergy, ArapError, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
};
use glam::{Affine3A, DVec3, Quat, Vec3};
use support::{bar, smooth_weights};

use HandleConstraint::{Free, Full, Position};

const STOP: ArapStop = ArapStop { iterations: 200, tolerance: 1e-7 };

/// libigl's bar with every vertex its own handle; see `libigl/arap.py`.
struct Swing {
    numbers: Vec<f64>,
    rest: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    held: Vec<usize>,
    posed: Vec<[f64; 3]>,
}

impl Swing {
    fn read(text: &str) -> Self {
        let mut out = Self { numbers: vec![], rest: vec![], tetrahedra: vec![], held: vec![], posed: vec![] };
        for line in text.lines() {
            let (key, numbers) = line.split_once(' ').unwrap();
            let numbers: Vec<f64> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
            match key {
                "d" => out.numbers = numbers,
                "v" => out.rest.push([numbers[0], numbers[1], numbers[2]]),
                "e" => out.tetrahedra.push([0, 1, 2, 3].map(|i| numbers[i] as u32)),
                "h" => out.held.push(numbers[0] as usize),
                "p" => out.posed.push([numbers[0], numbers[1], numbers[2]]),
                _ => panic!("{line}"),
            }
        }
        out
    }

    fn arap(&self) -> ReducedArap {
        let n = self.rest.len();
        let weights: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i / n == i % n))).collect();
        let shape = ArapShape {
            positions: &self.rest,
            energy: ArapEnergy::Tetrahedra(&self.tetrahedra),
            weights: ArapWeights::Matrix(&weights),
            handle_points: &self.rest,
            joints: &[],
        };
        let settings = ArapSettings { clusters: Some(usize::MAX), ..ArapSettings::default() };
        let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let mut kinds = vec![Free; n];
        self.held.iter().for_each(|&vertex| kinds[vertex] = Position);
        arap.constrain(&kinds, &[]).unwrap();
        arap
    }

    fn size(&self) -> f64 {
        let low = self.rest.iter().fold(DVec3::INFINITY, |low, p| low.min(DVec3::from(*p)));
        let high = self.rest.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(DVec3::from(*p)));
        0.5 * high.distance(low)
    }

    /// libigl weights mass by `1 / ym` relative to its energy, which has no units: ours is for mass one and size one.
    fn dynamics(&self) -> ArapDynamics {
        let volume = masses(&self.rest, &self.tetrahedra).1;
        let (ym, length) = (self.numbers[0], self.numbers[1]);
        ArapDynamics {
            stiffness: ym * self.size() / (volume * length * length),
            damping: 0.0,
            gravity: DVec3::new(self.numbers[3], self.numbers[4], self.numbers[5]).as_vec3(),
        }
    }

    fn apart(&self, arap: &ReducedArap) -> f64 {
        let each = self.rest.iter().zip(arap.transforms()).zip(&self.posed);
        each.fold(0.0_f64, |worst, ((rest, transform), posed)| {
            let at = transform.transform_point3(DVec3::from(*rest).as_vec3()).as_dvec3();
            worst.max(at.distance(DVec3::from(*posed)))
        })
    }
}

/// Each vertex's share of the whole volume, and the volume.
fn masses(positions: &[[f64; 3]], tetrahedra: &[[u32; 4]]) -> (Vec<f64>, f64) {
    let mut masses = vec![0.0; positions.len()];
    for t in tetrahedra {
        let [a, b, c, d] = t.map(|v| DVec3::from(positions[v as usize]));
        let volume = (b - a).dot((c - a).cross(d - a)).abs() / 6.0;
        t.iter().for_each(|&v| masses[v as usize] += 0.25 * volume);
    }
    let whole: f64 = masses.iter().sum();
    (masses.iter().map(|m| m / whole).collect(), whole)
}

#[test]
fn a_bar_swings_as_in_libigl() {
    let swing = Swing::read(include_str!("libigl/swing.txt"));
    let (mut arap, dynamics) = (swing.arap(), swing.dynamics());
    let targets = vec![Affine3A::IDENTITY; swing.rest.len()];
    for _ in 0..swing.numbers[2] as usize {
        let report = arap.step(&dynamics, swing.numbers[1], &targets, &[], STOP).unwrap();
        assert_eq!((report.warnings.undetermined, report.warnings.contradiction), (0, None));
    }
    let moved =
        swing.posed.iter().zip(&swing.rest).fold(0.0_f64, |m, (a, b)| m.max(DVec3::from(*a).distance((*b).into())));
    assert!(moved > 0.05 * swing.size(), "{moved}");
    assert!(swing.apart(&arap) < 1e-4 * swing.size(), "{} of {}", swing.apart(&arap), swing.size());
}

#[test]
fn it_comes_to_rest_where_libigl_does_whatever_the_steps() {
    let swing = Swing::read(include_str!("libigl/hang.txt"));
    let targets = vec![Affine3A::IDENTITY; swing.rest.len()];
    for (damping, seconds, steps) in [(0.0, 5.0, 60), (6.0, 0.05, 400)] {
        let (mut arap, dynamics) = (swing.arap(), ArapDynamics { damping, ..swing.dynamics() });
        for _ in 0..steps {
            arap.step(&dynamics, seconds, &targets, &[], STOP).unwrap();
        }
        assert!(swing.apart(&arap) < 1e-4 * swing.size(), "{damping}: {} of {}", swing.apart(&arap), swing.size());
    }
}

struct Bar {
    positions: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    weights: Vec<f64>,
    points: Vec<[f64; 3]>,
}

fn five_handles() -> Bar {
    let (positions, tetrahedra) = bar([12, 2, 2]);
    let points: Vec<[f64; 3]> = (0..5).map(|i| [3.0 * f64::from(i), 1.0, 1.0]).collect();
    Bar { weights: smooth_weights(&positions, &points), positions, tetrahedra, points }
}

impl Bar {
    fn arap(&self, kinds: &[HandleConstraint]) -> ReducedArap {
        let shape = ArapShape {
            positions: &self.positions,
            energy: ArapEnergy::Tetrahedra(&self.tetrahedra),
            weights: ArapWeights::Matrix(&self.weights),
            handle_points: &self.points,
            joints: &[],
        };
        let settings = ArapSettings::default();
        let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        arap.constrain(kinds, &[]).unwrap();
        arap
    }

    fn posed(&self, arap: &ReducedArap) -> Vec<DVec3> {
        let rows = self.positions.iter().zip(self.weights.chunks_exact(5));
        let at = |p: &[f64; 3], t: &Affine3A| t.transform_point3(DVec3::from(*p).as_vec3()).as_dvec3();
        rows.map(|(p, row)| row.iter().zip(arap.transforms()).map(|(w, t)| *w * at(p, t)).sum()).collect()
    }
}

#[test]
fn what_nothing_holds_falls_freely() {
    let bar = five_handles();
    let mut arap = bar.arap(&[Free; 5]);
    let gravity = Vec3::new(0.0, -9.0, 1.0);
    let dynamics = ArapDynamics { damping: 0.0, gravity, ..ArapDynamics::default() };
    let length = 1.04_f64.powi(-105);
    for _ in 0..60 {
        let report = arap.step(&dynamics, length, &[Affine3A::IDENTITY; 5], &[], STOP).unwrap();
        assert_eq!(report.warnings.undetermined, 0);
        assert!(report.energy.abs() < 1e-4, "{report:?}");
    }
    // The sum of the distances fallen in each implicit step: 1 + 2 + … times g h².
    let fall = gravity.as_dvec3() * (length * length * 60.0 * 61.0 / 2.0);
    for (at, rest) in bar.posed(&arap).iter().zip(&bar.positions) {
        assert!(at.distance(DVec3::from(*rest) + fall) < 1e-3, "{at} {rest:?} {fall}");
    }
    // Damped, it reaches the speed at which damping takes as much as gravity adds.
    let damped = ArapDynamics { damping: 5.0, ..dynamics };
    let mut last = bar.posed(&arap)[0];
    for _ in 0..400 {
        last = bar.posed(&arap)[0];
        arap.step(&damped, length, &[Affine3A::IDENTITY; 5], &[], STOP).unwrap();
    }
    let speed = (bar.posed(&arap)[0] - last) / length;
    let kept = (-5.0 * length).exp();
    assert!(speed.distance(gravity.as_dvec3() * length / (1.0 - kept)) < 0.02, "{speed}");
}

#[test]
fn undamped_motion_gains_no_energy() {
    let bar = five_handles();
    let masses = masses(&bar.positions, &bar.tetrahedra).0;
    let low = bar.positions.iter().fold(DVec3::INFINITY, |low, p| low.min(DVec3::from(*p)));
    let high = bar.positions.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(DVec3::from(*p)));
    let size = 0.5 * high.distance(low);
    for frame in [1.0 / 240.0, 1.0 / 60.0, 0.1] {
        let mut arap = bar.arap(&[Full, Free, Free, Free, Free]);
        let gravity = Vec3::new(0.0, -10.0, 0.0);
        let dynamics = ArapDynamics { stiffness: 300.0, damping: 0.0, gravity };
        // A frame time is rounded to one of a few steps; this one is exactly one of them.
        let length = 1.04_f64.powf((f64::ln(frame) / 1.04_f64.ln()).round());
        let (mut before, mut total, mut lowest) = (bar.posed(&arap), 0.0_f64, 0.0_f64);
        for step in 0..200 {
            let report = arap.step(&dynamics, length, &[Affine3A::IDENTITY; 5], &[], STOP).unwrap();
            let now = bar.posed(&arap);
            let mut sum = dynamics.stiffness * report.energy / size;
            for ((mass, now), (before, rest)) in masses.iter().zip(&now).zip(before.iter().zip(&bar.positions)) {
                sum += 0.5 * mass * ((*now - *before) / length).length_squared();
                sum -= mass * gravity.as_dvec3().dot(*now - DVec3::from(*rest));
            }
            assert!(sum <= total + 2e-3, "{frame} {step}: {sum} after {total}");
            total = sum;
            lowest = lowest.min(now[now.len() - 1].y - bar.positions[now.len() - 1][1]);
            before = now;
        }
        assert!(lowest < -0.3, "it must move: {lowest}");
    }
}

#[test]
fn any_frame_time_is_survived_and_a_solve_stops_the_motion() {
    let bar = five_handles();
    let mut arap = bar.arap(&[Full, Free, Free, Free, Free]);
    let dynamics = ArapDynamics { gravity: Vec3::new(0.0, -10.0, 0.0), ..ArapDynamics::default() };
    let frames = [1.0, 1.0, 0.0, 1e-9, f64::NAN, f64::INFINITY, -3.0, 1e9, 1.0 / 60.0, 1.0, 1e-300, 0.3];
    for (number, seconds) in frames.into_iter().cycle().take(120).enumerate() {
        let turn = Affine3A::from_quat(Quat::from_rotation_z(if number % 7 < 3 { 1.5 } else { -1.5 }));
        let report = arap.step(&dynamics, seconds, &[turn; 5], &[], ArapStop::default()).unwrap();
        assert!(report.energy.is_finite());
        let far = bar.posed(&arap).iter().fold(0.0_f64, |far, p| far.max(p.length()));
        assert!(far < 100.0, "frame {number} of {seconds} s: {far}");
        // Given parts follow at once.
        assert!((arap.transforms()[0].matrix3.x_axis - turn.matrix3.x_axis).abs().max_element() < 1e-5);
    }
    let targets = [Affine3A::IDENTITY; 5];
    let mut fresh = bar.arap(&[Full, Free, Free, Free, Free]);
    arap.restart();
    for arap in [&mut arap, &mut fresh] {
        arap.solve(&targets, &[], STOP).unwrap();
    }
    let quiet = ArapDynamics::default();
    for arap in [&mut arap, &mut fresh] {
        arap.step(&quiet, 1.0 / 60.0, &targets, &[], STOP).unwrap();
    }
    assert_eq!(arap.transforms(), fresh.transforms());
    let far = bar.posed(&arap).iter().zip(&bar.positions).fold(0.0_f64, |far, (a, b)| far.max(a.distance((*b).into())));
    assert!(far < 1e-3, "{far}");
    let bad = ArapDynamics { stiffness: f64::NAN, ..quiet };
    assert!(matches!(arap.step(&bad, 0.1, &targets, &[], STOP), Err(ArapError::NotFinite { .. })));
    assert!(matches!(arap.step(&quiet, 0.1, &targets[1..], &[], STOP), Err(ArapError::Length { .. })));
}
