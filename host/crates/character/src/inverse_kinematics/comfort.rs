//! How bones prefer to turn relative to the bones above them.

use armature_deform::arap::{ArapError, RotationLimit, SoftJoint};

use super::layout::Layout;
use super::rest::RestRig;

/// The preferences of a bone that the shape turns; soft, see [`SoftJoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comfort {
    /// Resistance to turning relative to the bone above, in the unit of [`SoftJoint::stiffness`]; 0 leaves it to the
    /// shape.
    pub stiffness: f64,
    /// How far it may swing and twist away from rest (radians): a swing in any direction, and the least and greatest
    /// twist about itself.
    pub limit: Option<(f64, [f64; 2])>,
}

/// The strength of a limit beyond its end.
const LIMIT_STRENGTH: f64 = 10.0;

/// For every bone, whether it is solved now or not.
pub(super) fn check_comforts(comforts: &[Option<Comfort>]) -> Result<(), ArapError> {
    let half = 0.0..=std::f64::consts::PI;
    let sound = |comfort: &Comfort| {
        let limit = |(swing, [least, most]): (f64, [f64; 2])| {
            half.contains(&swing) && half.contains(&-least) && half.contains(&most)
        };
        (0.0..=1e4).contains(&comfort.stiffness) && comfort.limit.is_none_or(limit)
    };
    match comforts.iter().position(|comfort| !comfort.as_ref().is_none_or(sound)) {
        Some(joint) => Err(ArapError::UnusableSoftJoint { joint }),
        None => Ok(()),
    }
}

/// The preferences of solved bones, between handles.
pub(super) fn soft_joints(comforts: &[Option<Comfort>], rig: &RestRig, layout: &Layout) -> Vec<SoftJoint> {
    let joint = |(handle, &bone): (usize, &usize)| {
        let comfort = comforts[bone].filter(|_| layout.is_solved(handle))?;
        let above = layout.handle_of_bone[rig.parent(bone)?];
        let axis = (rig.tails[bone] - rig.heads[bone]).as_dvec3().to_array();
        let limit = comfort.limit.map(|(swing, twist)| RotationLimit { axis, swing, twist, strength: LIMIT_STRENGTH });
        Some(SoftJoint { handles: [above, handle], stiffness: comfort.stiffness, limit })
    };
    layout.bone_of_handle.iter().enumerate().filter_map(joint).collect()
}
