//! How bones that meet prefer to turn relative to each other: stiffness and rotation limits, as soft terms of the
//! energy.
//!
//! Both keep the form of thesis eq. 7.15, so that local and global steps stay as they are and the energy still never
//! rises. With `A` a handle's linear part, a stiff joint adds `½ s ‖A_child − A_parent‖²`, which is quadratic. A
//! limited one adds `½ s (‖A_parent − R_p‖² + ‖A_child − R_c‖²)`, where `R_p` and `R_c` are the two nearest rotations
//! among those whose difference `R_pᵀ R_c` is within the limit: two more rotations for the local step to find.

use super::error::ArapError;
use super::reduction::Reduction;
use super::rotation_limit::{LimitedPair, RotationLimit};
use super::settings::GlobalStep;

/// Two handles that meet, and what they prefer. Soft: targets and the shape can overcome it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftJoint {
    /// Zero-based parent and child.
    pub handles: [usize; 2],
    /// Resistance to turning relative to each other, in units of the whole shape's resistance if it were compressed to
    /// a point: 0 leaves it to the shape, 0.1 is noticeable, 10 nearly makes them one.
    pub stiffness: f64,
    /// How far the child may turn.
    pub limit: Option<RotationLimit>,
}

/// Beyond this, a term overwhelms the shape's own.
pub(super) const STRONGEST: f64 = 1e4;

impl Reduction {
    /// The same shape with soft joints; it must not have any yet.
    pub(super) fn with_soft_joints(&self, joints: &[SoftJoint]) -> Result<Self, ArapError> {
        let mut out = self.clone();
        let unit = self.constant.max(f64::MIN_POSITIVE);
        for (joint, soft) in joints.iter().enumerate() {
            check(joint, soft, self.handle_count)?;
            let [parent, child] = soft.handles;
            for axis in 0..3 {
                let pairs = [(parent, parent, 1.0), (child, child, 1.0), (parent, child, -1.0), (child, parent, -1.0)];
                for (row, column, sign) in pairs {
                    out.stiffness.at_mut(row, column as u32)[axis][axis] += sign * soft.stiffness * unit;
                }
            }
            if let Some(limit) = &soft.limit {
                out.limits.push(LimitedPair::new(out.cluster_count, limit, self.planar));
                for handle in soft.handles {
                    out.add_rotation_of(handle, limit.strength * unit);
                }
            }
        }
        if out.with_zeros.is_some() {
            out.fill_in(GlobalStep::Inverse);
        }
        Ok(out)
    }

    /// `½ s ‖A − R‖²` for a handle's linear part and a rotation of its own.
    fn add_rotation_of(&mut self, handle: usize, strength: f64) {
        let mut block = [[0.0; 4]; 3];
        let own = self.stiffness.at_mut(handle, handle as u32);
        for axis in 0..3 {
            block[axis][axis] = strength;
            own[axis][axis] += strength;
        }
        self.covariance.push_row(vec![(handle as u32, block)]);
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
