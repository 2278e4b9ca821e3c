//! How bones prefer to turn against the bones above them.

use armature_deform::{ArapError, RotationLimit, SoftJoint};

use crate::PreferredBone;
use crate::inverse_kinematics::{IkError, InverseKinematics, Layout, find_bone};

/// What a bone that the shape turns prefers; soft, see [`SoftJoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comfort {
    /// What resists its turning against the bone above, in the unit of [`SoftJoint::stiffness`]; 0 leaves it to the
    /// shape.
    pub stiffness: f64,
    /// How far it swings and twists away from rest at most (radians): a swing to any side, and the least and the
    /// greatest twist about itself.
    pub limit: Option<(f64, [f64; 2])>,
}

/// As stiff as a limit is beyond its end.
const LIMIT_STRENGTH: f64 = 10.0;

impl InverseKinematics {
    /// Says what a bone (its number in the skeleton) prefers; nothing at first. It counts where a joint does not turn
    /// the bone and it does not go along with the one above, and it gives way to joints and pins.
    pub fn prefer(&mut self, bone: usize, comfort: Option<Comfort>) -> Result<(), IkError> {
        let handle_count = self.skeleton.len();
        if bone >= handle_count {
            return Err(IkError::Shape(ArapError::HandleOutOfRange { joint: bone, handle: bone, handle_count }));
        }
        let before = std::mem::replace(&mut self.comforts[bone], comfort);
        let softened = self.soften();
        if softened.is_err() {
            self.comforts[bone] = before;
        }
        softened.map_err(|_| IkError::Shape(ArapError::UnusableSoftJoint { joint: bone }))
    }

    /// The same for bones by their names.
    pub fn prefer_all(&mut self, bones: &[PreferredBone]) -> Result<(), IkError> {
        bones.iter().try_for_each(|preferred| {
            let bone = find_bone(&self.skeleton, &preferred.bone)?;
            self.prefer(bone, Some(preferred.comfort))
        })
    }

    fn soften(&mut self) -> Result<(), ArapError> {
        let Some(mut system) = self.system.take() else { return self.check_comforts() };
        let joints = self.soft_joints(&system.layout);
        let softened = system.arap.soften(&joints).and_then(|()| system.fresh.soften(&joints));
        self.system = Some(system);
        softened.and_then(|()| self.check_comforts())
    }

    /// Of every bone, whether it is solved now or not.
    fn check_comforts(&self) -> Result<(), ArapError> {
        let half = 0.0..=std::f64::consts::PI;
        let sound = |comfort: &Comfort| {
            let limit = |(swing, [least, most]): (f64, [f64; 2])| {
                half.contains(&swing) && half.contains(&-least) && half.contains(&most)
            };
            (0.0..=1e4).contains(&comfort.stiffness) && comfort.limit.is_none_or(limit)
        };
        match self.comforts.iter().position(|comfort| !comfort.as_ref().is_none_or(sound)) {
            Some(joint) => Err(ArapError::UnusableSoftJoint { joint }),
            None => Ok(()),
        }
    }

    /// The preferences of solved bones, between handles.
    pub(crate) fn soft_joints(&self, layout: &Layout) -> Vec<SoftJoint> {
        let joint = |(handle, &bone): (usize, &usize)| {
            let comfort = self.comforts[bone].filter(|_| layout.is_solved(handle))?;
            let above = layout.handle_of_bone[self.skeleton.bones()[bone].parent?];
            let axis = (self.rest.tails[bone] - self.rest.heads[bone]).as_dvec3().to_array();
            let limit =
                comfort.limit.map(|(swing, twist)| RotationLimit { axis, swing, twist, strength: LIMIT_STRENGTH });
            Some(SoftJoint { handles: [above, handle], stiffness: comfort.stiffness, limit })
        };
        layout.bone_of_handle.iter().enumerate().filter_map(joint).collect()
    }
}
