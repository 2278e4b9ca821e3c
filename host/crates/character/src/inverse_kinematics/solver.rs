//! Inverse kinematics of one character, for whichever bones are driven.

use std::ops::ControlFlow;

use armature_deform::arap::ArapError;
use armature_rig::{BoneQuality, BoneStatus, Pose, PoseCompletion};

use super::bone_roles::{BoneRole, bone_roles};
use super::comfort::{Comfort, check_comforts, soft_joints};
use super::error::{IkError, find_bone};
use super::joint_limit::{HandleLimit, JointLimit, LimitedBone};
use super::layout::Layout;
use super::pinned_bone::{PinHold, PinnedBone};
use super::preferred_bone::PreferredBone;
use super::rest::RestRig;
use super::shape::Shape;
use super::solved_system::SolvedSystem;
use crate::character::Character;

/// A bone with less weight than this many whole vertices moves nothing that could show where it is.
const LEAST_WEIGHT: f64 = 1.0;

/// Inverse kinematics of one character; see the [module](super).
///
/// Learns from the poses which bones are driven; a change prepares the reduced system again, which takes a few
/// hundredths of a second.
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    rig: RestRig,
    shape: Shape,
    comforts: Vec<Option<Comfort>>,
    limits: Vec<Option<JointLimit>>,
    moves: Vec<bool>,
    driven: Vec<bool>,
    roles: Vec<BoneRole>,
    system: Option<SolvedSystem>,
    problem: Option<IkError>,
}

impl InverseKinematics {
    /// Takes a character's shape, skeleton and weights. Nothing is driven at first. Without `pins` the skeleton's roots
    /// are fixed.
    pub fn new(character: &Character, pins: &[PinnedBone]) -> Result<Self, IkError> {
        let skeleton = character.skeleton.clone();
        let mut held = vec![None; skeleton.len()];
        for pin in pins {
            held[find_bone(&skeleton, &pin.bone)?] = Some(pin.hold);
        }
        if pins.is_empty() {
            let roots = skeleton.bones().iter().map(|bone| bone.parent.is_none().then_some(PinHold::Fixed));
            held = roots.collect();
        }
        let shape = Shape::of(character)?;
        let moves: Vec<bool> = shape.weight_of_bones(skeleton.len()).iter().map(|w| *w >= LEAST_WEIGHT).collect();
        let driven = vec![false; skeleton.len()];
        Ok(Self {
            roles: bone_roles(&skeleton, &driven, &held, &moves),
            comforts: vec![None; skeleton.len()],
            limits: vec![None; skeleton.len()],
            rig: RestRig::new(skeleton, held),
            shape,
            moves,
            driven,
            system: None,
            problem: None,
        })
    }

    /// Prepares for these driven bones (one flag per bone). `progress` receives the current stage and the fraction of
    /// the whole that is done, 0 to 1 and never falling; it can cancel.
    pub fn drive(
        &mut self,
        driven: &[bool],
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<(), IkError> {
        self.driven.clear();
        self.driven.extend((0..self.rig.skeleton.len()).map(|bone| driven.get(bone).copied().unwrap_or(false)));
        self.roles = bone_roles(&self.rig.skeleton, &self.driven, &self.rig.pins, &self.moves);
        self.system = None;
        self.problem = None;
        let made = self.prepare(progress);
        self.system = made.inspect_err(|error| self.problem = Some(error.clone()))?;
        Ok(())
    }

    fn prepare(
        &self,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<Option<SolvedSystem>, IkError> {
        let as_at_rest = |(bone, pin): (&armature_rig::Bone, &Option<PinHold>)| {
            *pin == bone.parent.is_none().then_some(PinHold::Fixed)
        };
        if self.rig.skeleton.bones().iter().zip(&self.rig.pins).all(as_at_rest)
            && !self.roles.contains(&BoneRole::Solved)
        {
            return Ok(None);
        }
        let layout = Layout::new(&self.rig, &self.roles);
        let mut arap = self.shape.reduce(&self.rig, &layout, progress)?;
        arap.soften(&soft_joints(&self.comforts, &self.rig, &layout))?;
        let limits = self.handle_limits(&layout);
        Ok(Some(SolvedSystem::new(&self.rig, layout, arap, limits)))
    }

    /// The limits of solved bones, parents first.
    fn handle_limits(&self, layout: &Layout) -> Vec<HandleLimit> {
        let of = |(bone, limit): (usize, &Option<JointLimit>)| {
            let limit = limit.as_ref().filter(|limit| **limit != JointLimit::FREE)?;
            let (own, above) = (layout.handle_of_bone[bone], layout.handle_of_bone[self.rig.parent(bone)?]);
            let is_own = layout.bone_of_handle[own] == bone && layout.is_solved(own);
            is_own.then(|| HandleLimit::new(&self.rig.skeleton, bone, [above, own], limit))
        };
        self.limits.iter().enumerate().filter_map(of).collect()
    }

    /// Limits how far bones turn against the bones above them; initially nothing is limited, and a later limit of the same
    /// bone replaces an earlier one. Applies where no joint turns the bone; pins yield to it. Whoever has prepared it with
    /// [`drive`](Self::drive) must do so again.
    pub fn limit_all(&mut self, bones: &[LimitedBone]) -> Result<(), IkError> {
        for limited in bones {
            let bone = find_bone(&self.rig.skeleton, &limited.bone)?;
            if !limited.limit.is_sound() {
                return Err(IkError::UnusableLimit { bone: limited.bone.clone() });
            }
            self.limits[bone] = Some(limited.limit);
        }
        self.system = None;
        self.driven.fill(false);
        self.roles = bone_roles(&self.rig.skeleton, &self.driven, &self.rig.pins, &self.moves);
        Ok(())
    }

    /// The limits in force, in the skeleton's order.
    pub fn limits(&self) -> impl Iterator<Item = LimitedBone> {
        let named = |(bone, limit): (&armature_rig::Bone, &Option<JointLimit>)| {
            let limit = limit.filter(|limit| *limit != JointLimit::FREE)?;
            Some(LimitedBone { bone: bone.name.clone(), limit })
        };
        self.rig.skeleton.bones().iter().zip(&self.limits).filter_map(named)
    }

    /// Sets what a bone (by its index in the skeleton) prefers; initially nothing. It applies where no joint turns the
    /// bone and the bone does not just follow the one above, and it yields to joints and pins.
    pub fn prefer(&mut self, bone: usize, comfort: Option<Comfort>) -> Result<(), IkError> {
        let handle_count = self.rig.skeleton.len();
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

    /// The same for bones by name.
    pub fn prefer_all(&mut self, bones: &[PreferredBone]) -> Result<(), IkError> {
        bones.iter().try_for_each(|preferred| {
            let bone = find_bone(&self.rig.skeleton, &preferred.bone)?;
            self.prefer(bone, Some(preferred.comfort))
        })
    }

    fn soften(&mut self) -> Result<(), ArapError> {
        let Some(mut system) = self.system.take() else { return check_comforts(&self.comforts) };
        let joints = soft_joints(&self.comforts, &self.rig, &system.layout);
        let softened = system.arap.soften(&joints).and_then(|()| system.fresh.soften(&joints));
        self.system = Some(system);
        softened.and_then(|()| check_comforts(&self.comforts))
    }

    /// Which bones it is prepared for.
    pub fn driven(&self) -> &[bool] {
        &self.driven
    }

    /// What determines how each bone is turned.
    pub fn roles(&self) -> &[BoneRole] {
        &self.roles
    }

    /// Whether it changes anything with the bones that are driven now.
    pub fn is_needed(&self) -> bool {
        self.system.is_some()
    }

    /// Why it does nothing although it should.
    pub fn problem(&self) -> Option<&IkError> {
        self.problem.as_ref()
    }

    /// What is held, in the skeleton's order.
    pub fn pins(&self) -> impl Iterator<Item = PinnedBone> {
        let named = |bone: &armature_rig::Bone, hold| PinnedBone { bone: bone.name.clone(), hold };
        self.rig.skeleton.bones().iter().zip(&self.rig.pins).filter_map(move |(bone, pin)| Some(named(bone, (*pin)?)))
    }

    /// How far the worst pin was missed in the last pose (mesh units); 0 if all are in place.
    pub fn worst_pin(&self) -> f32 {
        self.system.as_ref().map_or(0.0, |system| system.worst_pin)
    }
}

impl PoseCompletion for InverseKinematics {
    fn complete(&mut self, status: &[BoneStatus], pose: &mut Pose) {
        if pose.parent_from_bone.len() != self.rig.skeleton.len() || status.len() != self.rig.skeleton.len() {
            return;
        }
        let is_driven = |status: &BoneStatus| status.quality != BoneQuality::Unmapped;
        if !status.iter().map(is_driven).eq(self.driven.iter().copied()) {
            let driven: Vec<bool> = status.iter().map(is_driven).collect();
            // The error is kept for whoever asks; the pose then stays as the joints made it.
            let _ = self.drive(&driven, &mut |_, _| ControlFlow::Continue(()));
        }
        if let Some(system) = &mut self.system {
            system.complete(&self.rig, &self.roles, pose);
        }
    }

    fn restart(&mut self) {
        if let Some(system) = &mut self.system {
            system.arap.clone_from(&system.fresh);
            system.is_first = true;
        }
    }
}
