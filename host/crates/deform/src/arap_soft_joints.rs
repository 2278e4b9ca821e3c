//! How bones that meet prefer to turn against each other: stiffness and rotation limits, as soft terms of the energy.
//!
//! Both keep the shape of thesis eq. 7.15, so that local and global steps go on as they are and the energy still never
//! rises. With `A` a handle's linear part, a stiff joint adds `½ s ‖A_child − A_parent‖²`, which is quadratic. A limited
//! one adds `½ s (‖A_parent − R_p‖² + ‖A_child − R_c‖²)`, where `R_p` and `R_c` are the two nearest rotations among
//! those whose difference `R_pᵀ R_c` is within the limit: two more rotations for the local step to find.

use glam::{DMat3, DQuat, DVec3};

use crate::arap_reduction::Reduction;
use crate::nearest_rotation::{LANES, Matrices, nearest_rotations};
use crate::reduced_arap::ArapError;

/// Two handles that meet, and what they prefer. Soft: targets and the shape can overcome it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftJoint {
    /// Zero-based parent and child.
    pub handles: [usize; 2],
    /// What resists their turning against each other, beside what the whole shape would resist with if it were pressed
    /// to a point: 0 leaves it to the shape, 0.1 is felt, 10 nearly makes them one.
    pub stiffness: f64,
    /// How far the child may turn.
    pub limit: Option<RotationLimit>,
}

/// How far a child may be turned from where it is at rest against its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationLimit {
    /// Along the child at rest (model space; need not be unit). Flat shapes turn about z whatever it is, which is a
    /// twist.
    pub axis: [f64; 3],
    /// How far the axis itself may swing to any side (radians, from 0 to π).
    pub swing: f64,
    /// How far the child may twist about it (radians, at least -π to 0 and at most 0 to π).
    pub twist: [f64; 2],
    /// What holds the child within, in the unit of [`SoftJoint::stiffness`]; it also keeps both bones from stretching.
    pub strength: f64,
}

/// Beyond this a term drowns the shape's own.
const STRONGEST: f64 = 1e4;
/// Rounds of turning both bones and turning one against the other; the second gains little.
const ROUNDS: usize = 3;

/// A limited joint as the local step reads it: its two rotations are clusters `first` and `first + 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LimitedPair {
    pub(crate) first: usize,
    axis: DVec3,
    /// Sine of half the largest swing.
    swing: f64,
    /// Half the twists.
    twist: [f64; 2],
}

impl Reduction {
    /// The same shape with soft joints, of which it may have none yet.
    pub(crate) fn with_soft_joints(&self, joints: &[SoftJoint]) -> Result<Self, ArapError> {
        let mut out = self.clone();
        let unit = self.constant.max(f64::MIN_POSITIVE);
        for (joint, soft) in joints.iter().enumerate() {
            check(joint, soft, self.handle_count)?;
            let [parent, child] = soft.handles;
            for axis in 0..3 {
                let [p, c] = [4 * parent + axis, 4 * child + axis];
                for (row, column, sign) in [(p, p, 1.0), (c, c, 1.0), (p, c, -1.0), (c, p, -1.0)] {
                    out.stiffness.row_mut(row)[column] += sign * soft.stiffness * unit;
                }
            }
            if let Some(limit) = &soft.limit {
                out.limits.push(LimitedPair {
                    first: out.cluster_count,
                    axis: if self.planar { DVec3::Z } else { DVec3::from(limit.axis).normalize_or_zero() },
                    swing: (0.5 * limit.swing).sin(),
                    twist: limit.twist.map(|angle| 0.5 * angle),
                });
                for handle in soft.handles {
                    out.add_rotation_of(handle, limit.strength * unit);
                }
            }
        }
        Ok(out)
    }

    /// `½ s ‖A − R‖²` for a handle's linear part and a rotation of its own.
    fn add_rotation_of(&mut self, handle: usize, strength: f64) {
        for axis in 0..3 {
            let mut row = vec![0.0; 4 * self.handle_count];
            row[4 * handle + axis] = strength;
            self.covariance.push_row(&row);
            self.stiffness.row_mut(4 * handle + axis)[4 * handle + axis] += strength;
        }
        self.constant += 1.5 * strength;
        self.cluster_count += 1;
    }
}

fn check(joint: usize, soft: &SoftJoint, handle_count: usize) -> Result<(), ArapError> {
    if let Some(&handle) = soft.handles.iter().find(|handle| **handle >= handle_count) {
        return Err(ArapError::HandleOutOfRange { joint, handle, handle_count });
    }
    let strong = |value: f64| (0.0..=STRONGEST).contains(&value);
    let sound = soft.limit.is_none_or(|limit| {
        let half = 0.0..=std::f64::consts::PI;
        limit.axis.iter().all(|c| c.abs() <= 1e30)
            && half.contains(&limit.swing)
            && half.contains(&-limit.twist[0])
            && half.contains(&limit.twist[1])
            && strong(limit.strength)
    });
    if strong(soft.stiffness) && sound { Ok(()) } else { Err(ArapError::UnusableSoftJoint { joint }) }
}

impl LimitedPair {
    /// Replaces the two rotations nearest to the pair's covariances by the nearest within the limit. What the step
    /// before had stays if that is better: no step loses anything. All are transposed.
    pub(crate) fn hold(&self, covariances: &[Matrices], before: &[Matrices], found: &mut [Matrices]) {
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

    /// The rotation within the limit that swings and twists the same way.
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
