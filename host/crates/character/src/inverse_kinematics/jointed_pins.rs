//! Moves pinned bones back to where they are pinned, as far as the limits of the joints allow.

use glam::{Quat, Vec3};

use super::held_pins::{Pin, solve_in_place};
use super::joint_limit::HandleLimit;

/// Maximum steps; what can be reached is reached after a few, what cannot is approached until nothing improves.
const STEPS: usize = 40;
/// Done once no pin is off by more than this fraction of the skeleton's size.
const CLOSE: f32 = 1e-6;
/// Damping relative to the largest error as a share of the skeleton's size: what is out of reach is approached without
/// overshooting, and what is in reach is met exactly.
const DAMPING: f32 = 0.3;
const LEAST_DAMPING: f32 = 1e-6;
/// A step that improves less than this share of the squared error is the last.
const IMPROVES: f32 = 1e-5;
/// A step that makes it worse is halved so often.
const HALVINGS: usize = 5;
/// No joint turns further in a step, radians: further away, the linearisation is no guide.
const FURTHEST: f32 = 0.5;

/// One way in which the skeleton can move.
#[derive(Clone, Copy, Debug)]
enum Freedom {
    /// A root along an axis.
    Shift { root: usize, axis: Vec3 },
    /// A rotation without limits about an axis in model space.
    Turn { handle: usize, axis: Vec3 },
    /// Bend, lean or roll of a limited joint.
    Joint { limit: usize, coordinate: usize },
}

/// Pins and limits of a skeleton, with working storage. A box-constrained least-squares problem in the coordinates of the
/// joints, solved by damped Gauss-Newton steps: a coordinate at its limit that pins pull beyond it stays there.
#[derive(Clone, Debug, Default)]
pub(super) struct JointedPins {
    pins: Vec<Pin>,
    limits: Vec<HandleLimit>,
    freedoms: Vec<Freedom>,
    /// For each pair of handles (row by row), whether the second turns with the first.
    attached: Vec<bool>,
    size: f32,
    /// Of every limit.
    coordinates: Vec<[f32; 3]>,
    /// Every freedom's effect on every pin, pin by pin, and its weight.
    effects: Vec<Vec3>,
    weights: Vec<f32>,
    steps: Vec<f32>,
    errors: Vec<f32>,
    multipliers: Vec<f32>,
    normal: Vec<f32>,
    before: (Vec<Quat>, Vec<Vec3>, Vec<[f32; 3]>),
}

impl JointedPins {
    /// `free_turns`: which handles are solved; `free_roots`: which roots may be moved.
    pub(super) fn new(
        pins: Vec<Pin>,
        limits: Vec<HandleLimit>,
        free_turns: &[bool],
        free_roots: &[bool],
        size: f32,
    ) -> Self {
        let handles = free_turns.len();
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let shifts = (0..free_roots.len()).filter(|&root| free_roots[root]);
        let mut freedoms: Vec<Freedom> =
            shifts.flat_map(|root| axes.map(|axis| Freedom::Shift { root, axis })).collect();
        let is_limited = |handle: usize| limits.iter().any(|limit| limit.own == handle);
        let on_the_way = |handle: usize| pins.iter().any(|pin| pin.segments.iter().any(|(turn, _)| *turn == handle));
        let turning = (0..handles).filter(|&handle| free_turns[handle] && !is_limited(handle) && on_the_way(handle));
        freedoms.extend(turning.flat_map(|handle| axes.map(|axis| Freedom::Turn { handle, axis })));
        let mut attached = vec![false; handles * handles];
        (0..handles).for_each(|handle| attached[handle * handles + handle] = true);
        for limit in &limits {
            (0..handles).for_each(|handle| {
                attached[handle * handles + limit.own] |= attached[handle * handles + limit.above];
            });
        }
        let moves_pin = |limit: &HandleLimit| (0..handles).any(|h| attached[limit.own * handles + h] && on_the_way(h));
        let joints = (0..limits.len()).filter(|&limit| moves_pin(&limits[limit]));
        freedoms.extend(joints.flat_map(|limit| [0, 1, 2].map(|coordinate| Freedom::Joint { limit, coordinate })));
        let rows = 3 * pins.len();
        Self {
            size,
            coordinates: vec![[0.0; 3]; limits.len()],
            effects: vec![Vec3::ZERO; pins.len() * freedoms.len()],
            weights: vec![0.0; freedoms.len()],
            steps: vec![0.0; freedoms.len()],
            errors: vec![0.0; rows],
            multipliers: vec![0.0; rows],
            normal: vec![0.0; rows * rows],
            before: (vec![Quat::IDENTITY; handles], vec![Vec3::ZERO; free_roots.len()], vec![[0.0; 3]; limits.len()]),
            pins,
            limits,
            freedoms,
            attached,
        }
    }

    /// Brings all joints within their limits, smoothly, then changes free rotations (`model_from_rest`) and free roots until
    /// every pin is at its place or as near as the limits allow; returns the largest remaining distance. Allocates nothing.
    /// `goals`: where each pin belongs now.
    pub(super) fn hold(
        &mut self,
        goals: impl IntoIterator<Item = Vec3>,
        turns: &mut [Quat],
        shifts: &mut [Vec3],
    ) -> f32 {
        self.pins.iter_mut().zip(goals).for_each(|(pin, goal)| pin.target = goal);
        for (limit, coordinates) in self.limits.iter().zip(&mut self.coordinates) {
            *coordinates = limit.eased(turns);
            limit.place(coordinates, turns);
        }
        let (mut worst, mut squares) = self.measure(turns, shifts);
        for _ in 0..STEPS {
            if worst <= CLOSE * self.size || self.freedoms.is_empty() {
                break;
            }
            self.linearise(turns);
            if !self.find_steps(worst) {
                break;
            }
            self.before.0.copy_from_slice(turns);
            self.before.1.copy_from_slice(shifts);
            self.before.2.copy_from_slice(&self.coordinates);
            let mut scale = 1.0;
            let mut improved = false;
            for _ in 0..HALVINGS {
                self.advance(scale, turns, shifts);
                let (now, sum) = self.measure(turns, shifts);
                if sum < squares {
                    improved = squares - sum > IMPROVES * squares;
                    (worst, squares) = (now, sum);
                    break;
                }
                turns.copy_from_slice(&self.before.0);
                shifts.copy_from_slice(&self.before.1);
                self.coordinates.copy_from_slice(&self.before.2);
                scale *= 0.5;
            }
            if !improved {
                break;
            }
        }
        self.measure(turns, shifts).0
    }

    /// Turns from which [`hold`](Self::hold) begins with these: what it brings within the limits smoothly is further away.
    pub(super) fn unease(&mut self, turns: &mut [Quat]) {
        for (limit, coordinates) in self.limits.iter().zip(&mut self.coordinates) {
            *coordinates = limit.uneased(&limit.coordinates(turns));
        }
        self.limits.iter().zip(&self.coordinates).for_each(|(limit, coordinates)| limit.place(coordinates, turns));
    }

    /// The largest error and the sum of their squares.
    fn measure(&mut self, turns: &[Quat], shifts: &[Vec3]) -> (f32, f32) {
        let (mut worst, mut squares) = (0.0_f32, 0.0);
        for (pin, error) in self.pins.iter().zip(self.errors.as_chunks_mut::<3>().0) {
            let off = (pin.target - pin.place(turns, shifts)) * pin.weight;
            *error = off.to_array();
            worst = worst.max(off.length());
            squares += off.length_squared();
        }
        (worst, squares)
    }

    /// What each freedom does to each pin, and how much it counts: a rotation as the way of the longest end that it moves.
    fn linearise(&mut self, turns: &[Quat]) {
        let handles = turns.len();
        for (number, freedom) in self.freedoms.iter().enumerate() {
            let (handle, axis) = match *freedom {
                Freedom::Shift { .. } => (0, Vec3::ZERO),
                Freedom::Turn { handle, axis } => (handle, axis),
                Freedom::Joint { limit, coordinate } => {
                    let joint = &self.limits[limit];
                    (joint.own, joint.axis(&self.coordinates[limit], coordinate, turns))
                }
            };
            let mut longest = 0.0_f32;
            for (index, pin) in self.pins.iter().enumerate() {
                let effect = if let Freedom::Shift { root, axis } = *freedom {
                    longest = 1.0;
                    if pin.root == root { axis } else { Vec3::ZERO }
                } else {
                    let with = pin.segments.iter().filter(|(turn, _)| self.attached[handle * handles + *turn]);
                    let end: Vec3 = with.map(|(turn, along)| turns[*turn] * *along).sum();
                    longest = longest.max(end.length_squared());
                    axis.cross(end)
                };
                self.effects[index * self.freedoms.len() + number] = effect * pin.weight;
            }
            self.weights[number] = if longest > 0.0 { longest.recip() } else { 0.0 };
        }
        // A coordinate at its limit that the pins pull beyond it stays.
        for (number, freedom) in self.freedoms.iter().enumerate() {
            let Freedom::Joint { limit, coordinate } = *freedom else { continue };
            let errors = self.errors.as_chunks::<3>().0.iter().enumerate();
            let pull: f32 = errors
                .map(|(pin, error)| self.effects[pin * self.freedoms.len() + number].dot(Vec3::from_array(*error)))
                .sum();
            if self.limits[limit].blocks(&self.coordinates[limit], coordinate, pull) {
                self.weights[number] = 0.0;
            }
        }
    }

    /// `W Jᵀ (J W Jᵀ + λ)⁻¹ e`.
    fn find_steps(&mut self, worst: f32) -> bool {
        let (rows, count) = (3 * self.pins.len(), self.freedoms.len());
        self.normal.fill(0.0);
        for i in 0..self.pins.len() {
            for j in 0..self.pins.len() {
                let (a, b) = (&self.effects[i * count..][..count], &self.effects[j * count..][..count]);
                for ((a, b), weight) in a.iter().zip(b).zip(&self.weights) {
                    for row in 0..3 {
                        for column in 0..3 {
                            self.normal[(3 * i + row) * rows + 3 * j + column] += weight * a[row] * b[column];
                        }
                    }
                }
            }
        }
        let damping = (DAMPING * worst / self.size).max(LEAST_DAMPING);
        self.normal.iter_mut().step_by(rows + 1).for_each(|diagonal| *diagonal += damping);
        self.multipliers.copy_from_slice(&self.errors);
        if !solve_in_place(&mut self.normal, &mut self.multipliers) {
            return false;
        }
        for (number, (step, weight)) in self.steps.iter_mut().zip(&self.weights).enumerate() {
            let multipliers = self.multipliers.as_chunks::<3>().0.iter().enumerate();
            let along: f32 =
                multipliers.map(|(pin, m)| self.effects[pin * count + number].dot(Vec3::from_array(*m))).sum();
            *step = weight * along;
        }
        self.steps.iter().all(|step| step.is_finite())
    }

    fn advance(&mut self, scale: f32, turns: &mut [Quat], shifts: &mut [Vec3]) {
        for (freedom, step) in self.freedoms.iter().zip(&self.steps) {
            let step = scale * step;
            match *freedom {
                Freedom::Shift { root, axis } => shifts[root] += step * axis,
                Freedom::Turn { handle, axis } => {
                    let half = 0.5 * step.clamp(-FURTHEST, FURTHEST) * axis;
                    let turn = Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize();
                    turns[handle] = (turn * turns[handle]).normalize();
                }
                Freedom::Joint { limit, coordinate } => {
                    let changed = self.coordinates[limit][coordinate] + step.clamp(-FURTHEST, FURTHEST);
                    self.coordinates[limit][coordinate] = self.limits[limit].within(coordinate, changed);
                }
            }
        }
        for (limit, coordinates) in self.limits.iter().zip(&self.coordinates) {
            limit.place(coordinates, turns);
        }
    }
}
