//! Inverse kinematics of one character, for whichever bones are driven.

use std::ops::ControlFlow;

use armature_deform::arap::{Anchor, AnchorPoint, ArapError};
use armature_rig::{
    BoneQuality, BoneStatus, Pose, PoseCompletion, PoseMoment, Target, TargetChange, TargetError, TargetPoint,
};
use glam::{Affine3A, Quat, Vec3};

use super::bone_roles::{BoneRole, Dragged, bases, bone_roles};
use super::comfort::{Comfort, check_comforts, soft_joints};
use super::ease::{Easing, FormerPose};
use super::error::{IkError, find_bone};
use super::joint_limit::{HandleLimit, JointLimit, LimitedBone};
use super::layout::Layout;
use super::pinned_bone::{PinHold, PinnedBone};
use super::preferred_bone::PreferredBone;
use super::refit_cost::RefitCost;
use super::rest::RestRig;
use super::settings::{IkBones, IkEnergy, IkSettings};
use super::shape::Shape;
use super::solved_system::{SolvedSystem, roots};
use super::targets::{Attachment, Followed, Missed};
use crate::character::Character;

/// A bone with less weight than this many whole vertices moves nothing that could show where it is.
const LEAST_WEIGHT: f64 = 1.0;
/// A soft target never pulls harder than this, in the unit of [`Anchor::strength`].
const STRONGEST_SPRING: f64 = 1e3;

/// What share of the time of preparing the volume takes, where the energy needs it.
const FILLING_SHARE: f64 = 0.8;

/// Inverse kinematics of one character; see the [module](super).
///
/// Learns from the poses which bones are driven; a change prepares the reduced system again: a few hundredths
/// of a second for tens of bones, less than a second for hundreds.
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    /// With the pins in force; those that targets have replaced are left out.
    rig: RestRig,
    /// As chosen.
    pins: Vec<Option<PinHold>>,
    shape: Shape,
    settings: IkSettings,
    comforts: Vec<Option<Comfort>>,
    limits: Vec<Option<JointLimit>>,
    moves: Vec<bool>,
    driven: Vec<bool>,
    roles: Vec<BoneRole>,
    system: Option<SolvedSystem>,
    problem: Option<IkError>,
    targets: Vec<Followed>,
    /// Whether one of them drags a root.
    holds_root: bool,
    easing: Easing,
    /// The targets are others than those that the system was prepared for, and the change takes this long, microseconds.
    retargeted: Option<u32>,
    /// The pose before.
    latest: Option<Pose>,
    /// Targets that have been let go since the last restart.
    let_go: Vec<Missed>,
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
            roles: bone_roles(&skeleton, &driven, &held, &moves, &vec![Dragged::default(); skeleton.len()], false),
            comforts: vec![None; skeleton.len()],
            limits: vec![None; skeleton.len()],
            rig: RestRig::new(skeleton, held.clone()),
            pins: held,
            shape,
            settings: IkSettings::default(),
            moves,
            driven,
            system: None,
            problem: None,
            targets: Vec::new(),
            holds_root: false,
            easing: Easing::default(),
            retargeted: None,
            latest: None,
            let_go: Vec::new(),
        })
    }

    /// With other settings; nothing is driven then.
    #[must_use]
    pub fn with_settings(mut self, settings: IkSettings) -> Self {
        self.settings = settings;
        self.forget_driven();
        self
    }

    /// How the shape is reduced.
    pub fn settings(&self) -> &IkSettings {
        &self.settings
    }

    /// Takes the pins off roots of trees in which nothing is driven, dragged or pinned.
    fn let_roots_go(&mut self) {
        let bones = self.rig.skeleton.bones();
        let root = |mut bone: usize| {
            while let Some(parent) = bones[bone].parent {
                bone = parent;
            }
            bone
        };
        let mut is_asked = vec![false; bones.len()];
        for bone in 0..bones.len() {
            is_asked[root(bone)] |= self.driven[bone] || (self.pins[bone].is_some() && root(bone) != bone);
        }
        self.targets.iter().for_each(|target| is_asked[root(target.bone())] = true);
        // Something has to stay.
        let some_stay = is_asked.contains(&true);
        for bone in (0..bones.len()).filter(|&bone| some_stay && root(bone) == bone && !is_asked[bone]) {
            self.rig.pins[bone] = None;
        }
    }

    fn forget_driven(&mut self) {
        self.system = None;
        self.driven.fill(false);
        self.give_out_roles();
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
        self.give_out_roles();
        self.system = None;
        self.problem = None;
        let made = self.prepare(progress);
        self.system = made.inspect_err(|error| self.problem = Some(error.clone()))?;
        Ok(())
    }

    fn prepare(
        &mut self,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<Option<SolvedSystem>, IkError> {
        let as_at_rest = |(bone, pin): (&armature_rig::Bone, &Option<PinHold>)| {
            *pin == bone.parent.is_none().then_some(PinHold::Fixed)
        };
        let is_dragged = !self.targets.is_empty() || self.retargeted.is_some();
        if !is_dragged
            && self.rig.skeleton.bones().iter().zip(&self.rig.pins).all(as_at_rest)
            && !self.roles.contains(&BoneRole::Solved)
        {
            return Ok(None);
        }
        let layout = Layout::new(&self.rig, &self.roles);
        let filled = if self.settings.energy == IkEnergy::Volume { FILLING_SHARE } else { 0.0 };
        let mut told = |stage: &'static str, done: f64| progress(stage, filled * done);
        self.shape.fill(self.rig.skeleton.len(), self.settings.energy, &mut told)?;
        let mut told = |stage: &'static str, done: f64| progress(stage, filled + (1.0 - filled) * done);
        let mut arap = self.shape.reduce(&self.rig, &layout, &self.settings, &mut told)?;
        arap.soften(&soft_joints(&self.comforts, &self.rig, &layout))?;
        let limits = self.handle_limits(&layout);
        let roots: Vec<usize> = roots(&self.rig).collect();
        let attach = |target: &Followed| Attachment::new(target, &self.rig, &layout, &roots, &limits);
        let attached: Vec<Attachment> = self.targets.iter().map(attach).collect();
        let pulled = self.targets.iter().zip(&attached).filter(|(_, attachment)| attachment.can_move);
        let anchor = |(target, attachment): (&Followed, &Attachment)| Anchor {
            point: AnchorPoint::OnHandles(attachment.on_handles.clone()),
            strength: (target.target.strength < 1.0).then(|| spring(target.target.strength)),
        };
        let anchors: Vec<Anchor> = pulled.map(anchor).collect();
        if !anchors.is_empty() {
            arap.constrain(&layout.constraints, &anchors)?;
        }
        let loose = self.settings.bones == IkBones::Loose;
        Ok(Some(SolvedSystem::new(&self.rig, layout, arap, limits, attached, loose)))
    }

    /// The role of every bone, and which pins are in force: a target takes the place of the pin of its bone, and a bone of
    /// the base that is dragged takes the root along.
    fn give_out_roles(&mut self) {
        let skeleton = &self.rig.skeleton;
        let base = bases(skeleton, &self.driven, &self.moves);
        let mut dragged = vec![Dragged::default(); skeleton.len()];
        self.rig.pins.clone_from(&self.pins);
        if self.settings.free_roots {
            self.let_roots_go();
        }
        let skeleton = &self.rig.skeleton;
        self.holds_root = false;
        for target in &self.targets {
            target.mark(&mut dragged);
            let bone = target.bone();
            let is_head = matches!(target.target.point, TargetPoint::Head(_));
            if let (Some(pin), Some(_)) = (&mut self.rig.pins[bone], target.target.position)
                && !base[bone]
            {
                // The end of a pinned bone swings about its beginning.
                if is_head {
                    self.rig.pins[bone] = None;
                } else {
                    *pin = PinHold::Turning;
                }
            }
            if base[bone] && target.target.position.is_some() {
                // A point handle is a root of its own, on which nothing stands.
                self.holds_root |= skeleton.bones().iter().any(|other| other.parent == Some(bone))
                    || skeleton.bones()[bone].parent.is_some();
                let mut at = Some(bone);
                while let Some(above) = at {
                    self.rig.pins[above] = None;
                    at = skeleton.bones()[above].parent;
                }
            }
        }
        let free_roots = self.settings.free_roots;
        self.roles = bone_roles(skeleton, &self.driven, &self.rig.pins, &self.moves, &dragged, free_roots);
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
        self.forget_driven();
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
        self.system.is_some() || self.retargeted.is_some()
    }

    /// Why it does nothing although it should.
    pub fn problem(&self) -> Option<&IkError> {
        self.problem.as_ref()
    }

    /// What is held, in the skeleton's order.
    pub fn pins(&self) -> impl Iterator<Item = PinnedBone> {
        let named = |bone: &armature_rig::Bone, hold| PinnedBone { bone: bone.name.clone(), hold };
        self.rig.skeleton.bones().iter().zip(&self.pins).filter_map(move |(bone, pin)| Some(named(bone, (*pin)?)))
    }

    /// The points that are dragged, in the order in which they were taken.
    pub fn targets(&self) -> impl Iterator<Item = &Target> {
        self.targets.iter().map(|followed| &followed.target)
    }

    /// Every pin and target that is held by bones which can move, and by how much it was missed in the last pose; a
    /// target that is only on its way to its place is compared with where it is to be now.
    pub fn missed(&self) -> impl Iterator<Item = Missed> {
        let skeleton = &self.rig.skeleton;
        let pins = self.system.iter().flat_map(|system| system.pinned.iter().zip(&system.missed));
        let pins = pins.map(|(&bone, &distance)| Missed { name: skeleton.bones()[bone].name.clone(), distance });
        let targets = self.targets.iter().filter(|followed| followed.target.position.is_some());
        let targets =
            targets.map(|followed| Missed { name: followed.target.point.name(skeleton), distance: followed.missed });
        pins.chain(targets)
    }

    /// Hard targets that were missed by more than this (mesh units) in some pose since the last restart, and by how much at
    /// most.
    pub fn missed_targets(&self, by: f32) -> Vec<Missed> {
        let skeleton = &self.rig.skeleton;
        let mut targets = self.let_go.clone();
        targets.extend(self.targets.iter().map(|target| target.worst(skeleton)));
        let mut out: Vec<Missed> = Vec::new();
        for missed in targets.into_iter().filter(|missed| missed.distance > by) {
            match out.iter_mut().find(|known| known.name == missed.name) {
                Some(known) => known.distance = known.distance.max(missed.distance),
                None => out.push(missed),
            }
        }
        out
    }

    /// What it costs that bones are rigid, in this pose, which must be the last one completed; `None` if nothing was
    /// solved.
    pub fn refit_cost(&self, pose: &Pose) -> Option<RefitCost> {
        self.system.as_ref()?.refit_cost(&self.rig, pose)
    }

    /// How far the worst pin was missed in the last pose (mesh units); 0 if all are in place.
    pub fn worst_pin(&self) -> f32 {
        self.system.as_ref().map_or(0.0, |system| system.missed.iter().fold(0.0, |worst, miss| miss.max(worst)))
    }

    /// Whether a change of targets can be followed.
    pub fn check_target(&self, change: &TargetChange) -> Result<(), TargetError> {
        change.check(&self.rig.skeleton)?;
        match change {
            TargetChange::Set { target, .. } => Followed::new(*target, 0, &self.rig, &self.shape).map(|_| ()),
            TargetChange::Release { .. } => Ok(()),
        }
    }

    /// Drags a point from the next pose on; where it has a target already, that one is replaced. `over_micros`: over how
    /// long it goes there from where it is. An error changes nothing.
    pub fn set_target(&mut self, target: Target, over_micros: u32) -> Result<(), TargetError> {
        target.check(&self.rig.skeleton)?;
        let known = self.targets.iter().position(|followed| followed.target.point.is(&target.point));
        if let Some(index) = known.filter(|&index| self.targets[index].is_moved_by(&target)) {
            self.targets[index].go_to(target, over_micros);
            return Ok(());
        }
        let followed = Followed::new(target, over_micros, &self.rig, &self.shape)?;
        match known {
            Some(index) => {
                let before = std::mem::replace(&mut self.targets[index], followed);
                self.let_go.push(before.worst(&self.rig.skeleton));
            }
            None if self.targets.len() == Target::MOST => return Err(TargetError::TooMany),
            None => self.targets.push(followed),
        }
        self.retarget(over_micros);
        Ok(())
    }

    /// Lets a point go; the character goes back to where it would be over so long. Nothing where it has no target.
    pub fn release(&mut self, point: TargetPoint, over_micros: u32) {
        if let Some(index) = self.targets.iter().position(|followed| followed.target.point.is(&point)) {
            let before = self.targets.remove(index);
            self.let_go.push(before.worst(&self.rig.skeleton));
            self.retarget(over_micros);
        }
    }

    /// What is to be solved is another one from the next pose on.
    fn retarget(&mut self, over_micros: u32) {
        self.retargeted = Some(self.retargeted.map_or(over_micros, |other| other.max(over_micros)));
        self.targets.iter_mut().for_each(|followed| followed.begin_again(over_micros));
        self.give_out_roles();
    }

    /// The system for the targets that there are now. An error is kept for whoever asks; the pose then stays as the joints
    /// made it.
    fn follow_targets(&mut self, pose: &Pose) {
        let made = self.prepare(&mut |_, _| ControlFlow::Continue(()));
        self.problem = made.as_ref().err().cloned();
        self.system = made.unwrap_or_default();
        if let Some(over_micros) = self.retargeted.take() {
            // Without a pose before, this one as the joints made it.
            self.easing.begin(self.former(self.latest.as_ref().unwrap_or(pose)), over_micros);
        }
    }

    fn former(&self, pose: &Pose) -> FormerPose {
        let bones = self.rig.skeleton.bones();
        let mut rotations: Vec<Quat> = Vec::with_capacity(bones.len());
        for (bone, local) in bones.iter().zip(&pose.parent_from_bone) {
            rotations.push(bone.parent.map_or(local.rotation, |p| (rotations[p] * local.rotation).normalize()));
        }
        let mut frames = vec![Affine3A::IDENTITY; bones.len()];
        pose.forward_kinematics(&self.rig.skeleton, &mut frames);
        let heads = frames.iter().map(|frame| Vec3::from(frame.translation)).collect();
        FormerPose { rotations, heads, locals: pose.parent_from_bone.iter().map(|local| local.rotation).collect() }
    }
}

/// What a strength below 1 means for the energy: 0.5 pulls as hard as the whole shape resists.
fn spring(strength: f32) -> f64 {
    let strength = f64::from(strength);
    (strength / (1.0 - strength)).min(STRONGEST_SPRING)
}

impl PoseCompletion for InverseKinematics {
    fn complete(&mut self, moment: PoseMoment, status: &[BoneStatus], pose: &mut Pose) {
        if pose.parent_from_bone.len() != self.rig.skeleton.len() || status.len() != self.rig.skeleton.len() {
            return;
        }
        let is_driven = |status: &BoneStatus| status.quality != BoneQuality::Unmapped;
        if !status.iter().map(is_driven).eq(self.driven.iter().copied()) {
            let driven: Vec<bool> = status.iter().map(is_driven).collect();
            // The error is kept for whoever asks; the pose then stays as the joints made it.
            let _ = self.drive(&driven, &mut |_, _| ControlFlow::Continue(()));
        }
        if self.retargeted.is_some() {
            self.follow_targets(pose);
        }
        if let Some(system) = &mut self.system {
            system.complete(&self.rig, &self.roles, moment, &mut self.targets, &mut self.easing, pose);
        }
        match &mut self.latest {
            Some(latest) => latest.parent_from_bone.clone_from(&pose.parent_from_bone),
            None => self.latest = Some(pose.clone()),
        }
    }

    fn change_target(&mut self, change: &TargetChange) -> Result<(), TargetError> {
        match *change {
            TargetChange::Set { target, over_micros } => self.set_target(target, over_micros),
            TargetChange::Release { point, over_micros } => {
                point.check(&self.rig.skeleton)?;
                self.release(point, over_micros);
                Ok(())
            }
        }
    }

    fn holds_root(&self) -> bool {
        self.holds_root
    }

    fn restart(&mut self) {
        self.latest = None;
        self.easing.forget();
        self.let_go.clear();
        if !self.targets.is_empty() || self.retargeted.is_some() {
            self.targets.clear();
            self.retargeted = None;
            let driven = self.driven.clone();
            // The error is kept for whoever asks.
            let _ = self.drive(&driven, &mut |_, _| ControlFlow::Continue(()));
        }
        if let Some(system) = &mut self.system {
            system.start_afresh();
        }
    }
}
