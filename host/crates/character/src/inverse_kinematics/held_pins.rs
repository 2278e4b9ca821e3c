//! Moves pinned bones back to where they are pinned, with the smallest change to a skeleton of rigid bones.

use glam::{Mat3, Quat, Vec3};

/// Maximum Newton steps; from a pose that is nearly right, two or three are enough.
const STEPS: usize = 12;
/// Done once no pin is off by more than this fraction of the skeleton's size.
const CLOSE: f32 = 1e-6;
/// Damping, relative to a diagonal of one for each way that a pin can be reached.
const DAMPING: f32 = 1e-3;

/// A point held at a place, and the rigid segments that lead to it.
#[derive(Clone, Debug)]
pub(super) struct Pin {
    /// Where it belongs.
    pub(super) target: Vec3,
    /// How much each coordinate counts: one for those that are held, zero for others.
    pub(super) weight: Vec3,
    /// The root's slot in the list of roots.
    pub(super) root: usize,
    /// The root's head at rest.
    pub(super) rest_root: Vec3,
    /// For every rotation on the path from the root: which one, and the segment it turns, at rest.
    pub(super) segments: Vec<(usize, Vec3)>,
}

impl Pin {
    /// Where its point is in this pose.
    pub(super) fn place(&self, turns: &[Quat], shifts: &[Vec3]) -> Vec3 {
        let start = self.rest_root + shifts[self.root];
        self.segments.iter().fold(start, |at, (turn, along)| at + turns[*turn] * *along)
    }
}

/// All pins of a skeleton, with working storage.
#[derive(Clone, Debug, Default)]
pub(super) struct HeldPins {
    pub(super) pins: Vec<Pin>,
    /// Whether a rotation may be changed.
    pub(super) free_turns: Vec<bool>,
    /// Whether a root may be translated.
    pub(super) free_roots: Vec<bool>,
    /// The length that errors are compared with.
    pub(super) size: f32,
    /// 3p×3p, row by row.
    normal: Vec<f32>,
    /// Errors, then the multipliers.
    errors: Vec<f32>,
}

impl HeldPins {
    pub(super) fn new(pins: Vec<Pin>, free_turns: Vec<bool>, free_roots: Vec<bool>, size: f32) -> Self {
        let rows = 3 * pins.len();
        Self { pins, free_turns, free_roots, size, normal: vec![0.0; rows * rows], errors: vec![0.0; rows] }
    }

    /// Changes free rotations (`model_from_rest`) and translations of free roots until every pin is at its place or as
    /// close as possible; returns the largest remaining distance. Allocates nothing. `goals`: where each pin belongs now.
    ///
    /// Each step is the shortest one that satisfies the linearised pins, where a rotation counts as the length of its
    /// segment end's path; it is damped, so that a pin out of reach stretches nothing.
    pub(super) fn hold(
        &mut self,
        goals: impl IntoIterator<Item = Vec3>,
        turns: &mut [Quat],
        shifts: &mut [Vec3],
    ) -> f32 {
        self.pins.iter_mut().zip(goals).for_each(|(pin, goal)| pin.target = goal);
        let mut worst = self.measure(turns, shifts);
        for _ in 0..STEPS {
            if worst <= CLOSE * self.size || !self.can_move() {
                break;
            }
            self.assemble(turns);
            if !solve_in_place(&mut self.normal, &mut self.errors) {
                break;
            }
            self.step(turns, shifts);
            worst = self.measure(turns, shifts);
        }
        worst
    }

    fn can_move(&self) -> bool {
        self.pins
            .iter()
            .any(|pin| self.free_roots[pin.root] || pin.segments.iter().any(|(turn, _)| self.free_turns[*turn]))
    }

    fn measure(&mut self, turns: &[Quat], shifts: &[Vec3]) -> f32 {
        let mut worst = 0.0_f32;
        for (pin, error) in self.pins.iter().zip(self.errors.as_chunks_mut::<3>().0) {
            let off = (pin.target - pin.place(turns, shifts)) * pin.weight;
            *error = off.to_array();
            worst = worst.max(off.length());
        }
        worst
    }

    /// `J W Jᵀ` and its damping.
    fn assemble(&mut self, turns: &[Quat]) {
        let rows = 3 * self.pins.len();
        for (i, a) in self.pins.iter().enumerate() {
            for (j, b) in self.pins.iter().enumerate() {
                let mut block = Mat3::ZERO;
                if a.root == b.root && self.free_roots[a.root] {
                    block += Mat3::IDENTITY;
                }
                for (turn, along) in a.segments.iter().filter(|(turn, _)| self.free_turns[*turn]) {
                    let Some((_, other)) = b.segments.iter().find(|(t, _)| t == turn) else { continue };
                    // −[v]× divided by |v|, times its transpose: rotations move their segment's end at right angles.
                    let (v, w) = (turns[*turn] * *along, turns[*turn] * *other);
                    let lengths = v.length_squared().max(w.length_squared());
                    if lengths > 0.0 {
                        block += (skew(v) * skew(w).transpose()) * (1.0 / lengths);
                    }
                }
                block = Mat3::from_diagonal(a.weight) * block * Mat3::from_diagonal(b.weight);
                if i == j {
                    block += Mat3::from_diagonal(Vec3::splat(DAMPING));
                }
                for row in 0..3 {
                    let out = &mut self.normal[(3 * i + row) * rows + 3 * j..][..3];
                    out.copy_from_slice(&block.row(row).to_array());
                }
            }
        }
    }

    /// `W Jᵀ` times the multipliers.
    fn step(&self, turns: &mut [Quat], shifts: &mut [Vec3]) {
        let multipliers = self.errors.as_chunks::<3>().0;
        for (root, shift) in shifts.iter_mut().enumerate().filter(|(root, _)| self.free_roots[*root]) {
            let own = self.pins.iter().zip(multipliers).filter(|(pin, _)| pin.root == root);
            *shift += own.map(|(_, m)| Vec3::from_array(*m)).sum::<Vec3>();
        }
        for (number, turn) in turns.iter_mut().enumerate().filter(|(number, _)| self.free_turns[*number]) {
            let (mut about, mut longest) = (Vec3::ZERO, 0.0_f32);
            for (pin, m) in self.pins.iter().zip(multipliers) {
                for (_, along) in pin.segments.iter().filter(|(t, _)| *t == number) {
                    let v = *turn * *along;
                    about += v.cross(Vec3::from_array(*m));
                    longest = longest.max(v.length_squared());
                }
            }
            if longest > 0.0 {
                // At most half a radian per step: further away, the linearisation is no guide.
                let about = (about / longest).clamp_length_max(0.5);
                let half = 0.5 * about;
                *turn = (Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize() * *turn).normalize();
            }
        }
    }
}

/// `skew(v) · x = v × x`.
fn skew(v: Vec3) -> Mat3 {
    Mat3::from_cols(Vec3::new(0.0, v.z, -v.y), Vec3::new(-v.z, 0.0, v.x), Vec3::new(v.y, -v.x, 0.0))
}

/// Solves a symmetric positive definite system by Cholesky, in place; `false` if it is not definite.
pub(super) fn solve_in_place(matrix: &mut [f32], right: &mut [f32]) -> bool {
    let n = right.len();
    for j in 0..n {
        for i in j..n {
            let mut sum = matrix[i * n + j];
            for k in 0..j {
                sum -= matrix[i * n + k] * matrix[j * n + k];
            }
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return false;
                }
                matrix[j * n + j] = sum.sqrt();
            } else {
                matrix[i * n + j] = sum / matrix[j * n + j];
            }
        }
    }
    for i in 0..n {
        let sum = (0..i).fold(right[i], |sum, k| sum - matrix[i * n + k] * right[k]);
        right[i] = sum / matrix[i * n + i];
    }
    for i in (0..n).rev() {
        let sum = (i + 1..n).fold(right[i], |sum, k| sum - matrix[k * n + i] * right[k]);
        right[i] = sum / matrix[i * n + i];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pelvis at the origin and two legs of two segments each; the thighs' rotations are given, the shins are free.
    fn legs(apart: f32) -> HeldPins {
        let leg = |side: f32, thigh: usize| Pin {
            target: Vec3::new(0.1 * side, -0.8, apart * side),
            weight: Vec3::ONE,
            root: 0,
            rest_root: Vec3::ZERO,
            segments: vec![
                (4, Vec3::new(0.1 * side, 0.0, 0.0)),
                (thigh, Vec3::new(0.0, -0.4, 0.0)),
                (thigh + 1, Vec3::new(0.0, -0.4, 0.0)),
            ],
        };
        HeldPins::new(vec![leg(1.0, 0), leg(-1.0, 2)], vec![false, true, false, true, false], vec![true], 1.0)
    }

    #[test]
    fn a_squat_keeps_both_feet_in_place() {
        let mut pins = legs(0.0);
        let thigh = Quat::from_rotation_x(-1.0);
        let mut turns = [thigh, Quat::IDENTITY, thigh, Quat::IDENTITY, Quat::IDENTITY];
        let mut shifts = [Vec3::ZERO];
        let left = pins.hold([], &mut turns, &mut shifts);
        assert!(left < 1e-5, "{left}");
        assert_eq!((turns[0], turns[4]), (thigh, Quat::IDENTITY), "given rotations stay");
        assert!(shifts[0].y < -0.1 || shifts[0].z < -0.1, "the pelvis follows: {:?}", shifts[0]);
    }

    #[test]
    fn a_pelvis_held_upright_sinks_straight_down() {
        let mut pins = legs(0.0).pins;
        pins.push(Pin {
            target: Vec3::ZERO,
            weight: Vec3::new(1.0, 0.0, 1.0),
            root: 0,
            rest_root: Vec3::ZERO,
            segments: Vec::new(),
        });
        let mut pins = HeldPins::new(pins, vec![false, true, false, true, false], vec![true], 1.0);
        let thigh = Quat::from_rotation_x(-1.0);
        let mut turns = [thigh, Quat::IDENTITY, thigh, Quat::IDENTITY, Quat::IDENTITY];
        let mut shifts = [Vec3::ZERO];
        let left = pins.hold([], &mut turns, &mut shifts);
        assert!(left < 1e-5, "{left}");
        // Thigh and shin make an isosceles triangle over the ankle.
        let sunk = 0.8 - 2.0 * 0.4 * 1.0_f32.cos();
        assert!(shifts[0].distance(Vec3::new(0.0, -sunk, 0.0)) < 1e-4, "{:?}", shifts[0]);
    }

    #[test]
    fn a_pin_out_of_reach_is_missed_without_harm() {
        let mut pins = legs(3.0);
        let mut turns = [Quat::IDENTITY; 5];
        let mut shifts = [Vec3::ZERO];
        let left = pins.hold([], &mut turns, &mut shifts);
        assert!(left.is_finite() && left > 1.0);
        assert!(turns.iter().all(|t| t.is_normalized()) && shifts[0].is_finite());
    }
}
