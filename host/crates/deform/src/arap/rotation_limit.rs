//! Two bones that meet, rotated as their covariances pull, as far as a limit allows: the local step of a limited joint.

use glam::{DMat3, DQuat, DVec3};

use crate::lanes::{LANES, Matrices};
use crate::nearest_rotation::nearest_rotations;

/// How far a child may turn from its rest orientation relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationLimit {
    /// The child's direction at rest (model space; need not be unit). Flat shapes always turn about z, which counts as
    /// twist.
    pub axis: [f64; 3],
    /// How far that axis itself may swing in any direction (radians, from 0 to π).
    pub swing: f64,
    /// How far the child may twist about it (radians, at least -π to 0 and at most 0 to π).
    pub twist: [f64; 2],
    /// How strongly the limit holds, in the unit of [`SoftJoint::stiffness`](super::SoftJoint::stiffness); it also
    /// keeps both bones from stretching.
    pub strength: f64,
}

/// Rounds of rotating both bones and rotating one relative to the other; the second gains little.
const ROUNDS: usize = 3;

/// A limited joint as the local step reads it: its two rotations are clusters `first` and `first + 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LimitedPair {
    pub(super) first: usize,
    axis: DVec3,
    /// Sine of half the largest swing.
    swing: f64,
    /// Half the twist limits.
    twist: [f64; 2],
}

impl LimitedPair {
    /// Flat shapes turn about z.
    pub(super) fn new(first: usize, limit: &RotationLimit, planar: bool) -> Self {
        Self {
            first,
            axis: if planar { DVec3::Z } else { DVec3::from(limit.axis).normalize_or_zero() },
            swing: (0.5 * limit.swing).sin(),
            twist: limit.twist.map(|angle| 0.5 * angle),
        }
    }

    /// Replaces the two rotations nearest to the pair's covariances by the nearest ones within the limit. Keeps those
    /// of the previous step if they are better, so no step makes things worse. All are transposed.
    pub(super) fn hold(&self, covariances: &[Matrices], before: &[Matrices], found: &mut [Matrices]) {
        let [parent, child] = [self.first, self.first + 1];
        // Transposed, rotations and linear parts alike: a relation `R_pᵀ R_c` is a product with the second transposed.
        let free = [parent, child].map(|cluster| at(found, cluster).transpose());
        let free_turn = between(free);
        let turn = self.clamped(free_turn);
        if turn.dot(free_turn).abs() > 1.0 - 1e-14 {
            return;
        }
        let pulls = [parent, child].map(|cluster| at(covariances, cluster).transpose());
        let gain = |pair: [DMat3; 2]| inner(pair[0], pulls[0]) + inner(pair[1], pulls[1]);
        let before = [parent, child].map(|cluster| at(before, cluster).transpose());
        let mut turn = turn;
        let mut best = before;
        for _ in 0..ROUNDS {
            let as_matrix = DMat3::from_quat(turn);
            let base = nearest(pulls[0] + pulls[1] * as_matrix.transpose());
            let pair = [base, base * as_matrix];
            if gain(pair) > gain(best) {
                best = pair;
            }
            turn = self.clamped(DQuat::from_mat3(&nearest(base.transpose() * pulls[1])).normalize());
        }
        put(found, parent, best[0].transpose());
        put(found, child, best[1].transpose());
    }

    /// The rotation within the limit with the same swing and twist directions.
    fn clamped(&self, turn: DQuat) -> DQuat {
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let along = turn.xyz().dot(self.axis);
        let half = along.atan2(turn.w);
        let twist = DQuat::from_axis_angle(self.axis_or_x(), 2.0 * half.clamp(self.twist[0], self.twist[1]));
        let whole = DQuat::from_axis_angle(self.axis_or_x(), 2.0 * half);
        let swing = turn * whole.conjugate();
        let swing = if swing.w < 0.0 { -swing } else { swing };
        let sine = swing.xyz().length();
        if sine <= self.swing {
            return (swing * twist).normalize();
        }
        let part = swing.xyz() * (self.swing / sine);
        let swing = DQuat::from_xyzw(part.x, part.y, part.z, (1.0 - self.swing * self.swing).max(0.0).sqrt());
        (swing * twist).normalize()
    }

    /// A child without direction does not twist.
    fn axis_or_x(&self) -> DVec3 {
        if self.axis == DVec3::ZERO { DVec3::X } else { self.axis }
    }
}

fn between([parent, child]: [DMat3; 2]) -> DQuat {
    DQuat::from_mat3(&(parent.transpose() * child)).normalize()
}

fn inner(a: DMat3, b: DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

fn nearest(matrix: DMat3) -> DMat3 {
    let mut lanes = [[[0.0; LANES]; 3]; 3];
    put(std::slice::from_mut(&mut lanes), 0, matrix);
    at(&[nearest_rotations(&lanes)], 0)
}

/// Entry `[row][column]` of a lane as row and column of a matrix.
fn at(blocks: &[Matrices], cluster: usize) -> DMat3 {
    let (block, lane) = (&blocks[cluster / LANES], cluster % LANES);
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|column| [0, 1, 2].map(|row: usize| f64::from(block[row][column][lane]))))
}

fn put(blocks: &mut [Matrices], cluster: usize, matrix: DMat3) {
    for row in 0..3 {
        for column in 0..3 {
            blocks[cluster / LANES][row][column][cluster % LANES] = matrix.col(column)[row] as f32;
        }
    }
}
