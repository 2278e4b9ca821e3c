//! From a puppet's samples to a posed and skinned character: the pose-time heart of the program, pure.
//!
//! It reads no clock and no port: whoever drives it (the command line, the window's engine, the virtual clock)
//! hands it the topology and the samples. Same calls, same poses, same take.

use std::sync::Arc;

use armature_character::{BoneRole, InverseKinematics};
use armature_rig::{
    BoneStatus, Calibration, JointTree, Mapping, PartUid, Pose, PoseCompletion, RawSample, SensorCalibration,
    SensorState, SolveError, StreamSolver, ZeroReport,
};
use armature_take::InverseKinematicsHeader;
use glam::{Affine3A, Quat};

use super::actor::Actor;
use super::completion::IkArgs;
use crate::failure::Failure;

/// When the rest pose is taken. A part that is plugged in later and was never zeroed is zeroed by itself, unless the
/// policy is [`OnRequest`](Self::OnRequest).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZeroPolicy {
    /// From the first good sample, whatever is known already.
    AtStart,
    /// From the first good sample if a joint of the puppet was never zeroed.
    WhenUnknown,
    /// Only when asked.
    OnRequest,
}

/// What the next good sample is to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ZeroWish {
    Nothing,
    /// Parts that were plugged in just now and never zeroed; the others may be in the middle of a motion.
    NewParts,
    Everything,
}

/// A part that is plugged in again takes so long to bring its bone to where it is, microseconds of the device's clock.
pub const ENGAGE_MICROS: u32 = 250_000;

/// After so many samples a sensor that still has no good reading no longer holds up the zeroing of the others.
const PATIENCE_SAMPLES: u32 = 50;

/// What a sample led to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// No topology yet, or a sample of an older topology.
    Ignored,
    /// The character has a new pose.
    Posed {
        /// The rest pose was taken from this sample.
        zeroed: Option<ZeroReport>,
    },
}

/// A character that a puppet moves.
#[derive(Debug)]
pub struct Performance {
    actor: Arc<Actor>,
    skin: Option<armature_deform::LinearBlendSkin>,
    chosen_mapping: Option<Mapping>,
    /// The last proposal and the puppet it was made for.
    proposed: Option<(JointTree, Mapping)>,
    mapping_doubts: Vec<String>,
    zero_policy: ZeroPolicy,
    zero_wish: ZeroWish,
    waited_samples: u32,
    solver: StreamSolver,
    inverse_kinematics: Option<InverseKinematics>,
    /// What its bones prefer, in the user's words.
    preferences: Vec<String>,
    /// A take that began without inverse kinematics goes on without.
    solves_joints_alone: bool,
    pose: Pose,
    model_from_bone: Vec<Affine3A>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Performance {
    /// A character in its rest pose. `mapping`: as chosen by the user; without one it is proposed for each puppet.
    pub fn new(
        actor: Arc<Actor>,
        mapping: Option<Mapping>,
        calibration: Calibration,
        zero_policy: ZeroPolicy,
    ) -> Result<Self, Failure> {
        let skin = actor.precompute_skin()?;
        let model_from_bone = actor.skeleton.rest_model_from_bone();
        let (positions, normals) =
            actor.shape.as_ref().map(|s| (s.positions.clone(), s.normals.clone())).unwrap_or_default();
        let mut solver = StreamSolver::new(actor.skeleton.clone());
        solver.set_calibration(calibration);
        solver.engage(ENGAGE_MICROS, false);
        Ok(Self {
            inverse_kinematics: None,
            preferences: Vec::new(),
            solves_joints_alone: false,
            pose: actor.skeleton.rest_pose(),
            actor,
            skin,
            chosen_mapping: mapping,
            proposed: None,
            mapping_doubts: Vec::new(),
            zero_policy,
            zero_wish: ZeroWish::Nothing,
            waited_samples: 0,
            solver,
            model_from_bone,
            positions,
            normals,
        })
    }

    /// Lets bones without a joint follow, as chosen.
    pub fn with_inverse_kinematics(mut self, choice: &IkArgs) -> Result<Self, Failure> {
        self.inverse_kinematics = choice.of_actor(&self.actor)?;
        self.preferences.clone_from(&choice.prefer);
        self.prepare_inverse_kinematics();
        Ok(self)
    }

    /// Prepares for the bones that the mapping drives before samples come; those would do it too, but late.
    fn prepare_inverse_kinematics(&mut self) {
        let (Some(ik), Some(mapping)) = (&mut self.inverse_kinematics, self.solver.mapping()) else { return };
        let mut driven = vec![false; self.actor.skeleton.len()];
        for bone in mapping.entries.iter().filter_map(|entry| self.actor.skeleton.find(&entry.bone)) {
            driven[bone] = true;
        }
        if ik.driven() == driven {
            return;
        }
        if let Err(error) = ik.drive(&driven, &mut |_| std::ops::ControlFlow::Continue(())) {
            tracing::warn!("bones without a joint stay at rest: {error}");
        }
    }

    /// Takes a puppet as it is plugged together now. Parts that were there before go on without a jump.
    pub fn set_topology(&mut self, epoch: u16, tree: JointTree) {
        let mapping = match &self.chosen_mapping {
            Some(mapping) => mapping.clone(),
            None => self.proposal(&tree),
        };
        let mut calibration = self.solver.calibration().clone();
        let unknown = tree.parts().iter().any(|part| {
            let sensors = calibration.part(part.uid).unwrap_or_default();
            sensors.len() != part.kind.axes().len() || sensors.iter().any(|s| s.zero_counts.is_none())
        });
        let first = self.solver.topology().is_none();
        let wish = match self.zero_policy {
            ZeroPolicy::AtStart if first => ZeroWish::Everything,
            ZeroPolicy::WhenUnknown if first && unknown => ZeroWish::Everything,
            ZeroPolicy::AtStart | ZeroPolicy::WhenUnknown if unknown => ZeroWish::NewParts,
            _ => ZeroWish::Nothing,
        };
        self.zero_wish = self.zero_wish.max(wish);
        self.waited_samples = 0;
        calibration.add_missing(&tree);
        self.solver.set_calibration(calibration);
        self.solver.set_mapping(mapping);
        self.solver.set_topology(epoch, tree);
        self.prepare_inverse_kinematics();
    }

    /// What was proposed for a puppet still holds while parts of it are unplugged, and when they are back: otherwise
    /// the rest of it would change bones in the middle of a performance.
    fn proposal(&mut self, tree: &JointTree) -> Mapping {
        if let Some((_, mapping)) = self.proposed.as_ref().filter(|(whole, _)| is_part_of(tree, whole)) {
            return mapping.clone();
        }
        let proposal = armature_rig::propose(tree, &self.actor.skeleton);
        self.proposed = Some((tree.clone(), proposal.mapping.clone()));
        self.mapping_doubts = proposal.ambiguities;
        proposal.mapping
    }

    /// The next good sample becomes the rest pose.
    pub fn request_zero(&mut self) {
        self.zero_wish = ZeroWish::Everything;
        self.waited_samples = 0;
    }

    /// Counts mean this from the next sample on.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        self.solver.set_calibration(calibration);
    }

    /// The whole puppet was away: with the next sample the character goes over to it without a jump.
    pub fn engage_all(&mut self) {
        self.solver.engage(ENGAGE_MICROS, true);
    }

    /// By how much the filters delay the quickest and the slowest joint now, seconds.
    pub fn lag_seconds(&self) -> (f64, f64) {
        self.solver.solver().map_or((0.0, 0.0), armature_rig::PoseSolver::lag_seconds)
    }

    /// The part nearest to the puppet's root that drives a bone, and how it turns that bone away from the rest pose.
    pub fn root_turn(&self) -> Option<(PartUid, Quat)> {
        self.solver.solver().and_then(armature_rig::PoseSolver::root_turn)
    }

    /// Whether the rest pose is still to be taken.
    pub fn waits_for_zero(&self) -> bool {
        self.zero_wish != ZeroWish::Nothing
    }

    /// Forgets what sensors said before, so that a take that begins now can be solved from its own samples alone.
    fn forget_past(&mut self) {
        let mut fresh = StreamSolver::new(self.actor.skeleton.clone());
        fresh.set_calibration(self.solver.calibration().clone());
        fresh.engage(ENGAGE_MICROS, false);
        if let Some(mapping) = self.solver.mapping() {
            fresh.set_mapping(mapping.clone());
        }
        if let Some((epoch, tree)) = self.solver.topology() {
            fresh.set_topology(epoch, tree.clone());
        }
        self.solver = fresh;
        if let Some(ik) = &mut self.inverse_kinematics {
            ik.restart();
        }
    }

    /// A take begins: the past is forgotten, and what the take's header has to say of inverse kinematics is returned.
    /// Where no bone needs it now, the take does without to its end.
    pub fn begin_take(&mut self) -> Option<InverseKinematicsHeader> {
        self.forget_past();
        let needed = self.inverse_kinematics.as_ref().filter(|ik| ik.is_needed());
        self.solves_joints_alone = needed.is_none();
        needed.map(|ik| InverseKinematicsHeader {
            pins: ik.pins().map(|pin| pin.to_string()).collect(),
            preferences: self.preferences.clone(),
        })
    }

    /// The take has ended.
    pub fn end_take(&mut self) {
        self.solves_joints_alone = false;
    }

    /// Poses and skins the character by one sample.
    pub fn perform(&mut self, sample: &RawSample) -> Result<Step, Failure> {
        let fits = self
            .solver
            .topology()
            .is_some_and(|(epoch, tree)| epoch == sample.epoch && tree.sensor_count() == sample.counts.len());
        if !fits {
            return Ok(Step::Ignored);
        }
        let zeroed = self.zero_if_wanted(sample)?;
        let pose = match self.solver.solve(sample) {
            Ok(pose) => pose,
            Err(SolveError::Mapping(error)) => {
                let remedy = "correct the mapping file, or leave --mapping away to have one proposed";
                return Err(Failure::input(error.to_string(), remedy));
            }
            Err(error) => return Err(Failure::device(error.to_string(), "unplug the puppet and connect again")),
        };
        self.pose.parent_from_bone.clone_from(&pose.parent_from_bone);
        let ik = self.inverse_kinematics.as_mut().filter(|_| !self.solves_joints_alone);
        if let (Some(ik), Some(state)) = (ik, self.solver.solver()) {
            ik.complete(state.bone_status(), &mut self.pose);
        }
        self.pose.forward_kinematics(&self.actor.skeleton, &mut self.model_from_bone);
        if let Some(skin) = &mut self.skin {
            let skinned = skin.solve(&self.model_from_bone, &mut self.positions, &mut self.normals);
            skinned.map_err(|e| Failure::not_converged(e.to_string(), "zero the puppet again"))?;
        }
        Ok(Step::Posed { zeroed })
    }

    fn zero_if_wanted(&mut self, sample: &RawSample) -> Result<Option<ZeroReport>, Failure> {
        let Some((_, tree)) = self.solver.topology().filter(|_| self.waits_for_zero()) else { return Ok(None) };
        let all_good = sample.states.iter().all(|s| *s == SensorState::Ok);
        if !all_good && self.waited_samples < PATIENCE_SAMPLES {
            self.waited_samples += 1;
            return Ok(None);
        }
        let before = self.solver.calibration().clone();
        let mut calibration = before.clone();
        let mut report = calibration
            .zero(tree, sample)
            .map_err(|e| Failure::input(e.to_string(), "remove the part's entry from the calibration file"))?;
        if self.zero_wish == ZeroWish::NewParts {
            let is_known = |sensors: &[SensorCalibration]| sensors.iter().all(|s| s.zero_counts.is_some());
            for (uid, sensors) in before.parts().filter(|(uid, s)| tree.find(*uid).is_some() && is_known(s)) {
                let skipped = report.skipped.len();
                report.skipped.retain(|s| s.part != uid);
                report.zeroed -= sensors.len() - (skipped - report.skipped.len());
                calibration.set_part(uid, sensors.to_vec());
            }
        }
        self.solver.set_calibration(calibration);
        self.zero_wish = ZeroWish::Nothing;
        Ok(Some(report))
    }

    /// The character.
    pub fn actor(&self) -> &Arc<Actor> {
        &self.actor
    }

    /// The puppet and the number of its present topology.
    pub fn topology(&self) -> Option<(u16, &JointTree)> {
        self.solver.topology()
    }

    /// The mapping in use.
    pub fn mapping(&self) -> Option<&Mapping> {
        self.solver.mapping()
    }

    /// What a person should look at in the proposed mapping, one sentence each; empty for a chosen one.
    pub fn mapping_doubts(&self) -> &[String] {
        &self.mapping_doubts
    }

    /// The calibration in use.
    pub fn calibration(&self) -> &Calibration {
        self.solver.calibration()
    }

    /// How far each bone can be trusted, in the skeleton's order; empty before the first sample.
    pub fn bone_status(&self) -> &[BoneStatus] {
        self.solver.solver().map_or(&[], |solver| solver.bone_status())
    }

    /// The latest pose.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// What decides how each bone is turned; `None` where bones without a joint stay at rest.
    pub fn bone_roles(&self) -> Option<&[BoneRole]> {
        self.inverse_kinematics.as_ref().filter(|_| !self.solves_joints_alone).map(InverseKinematics::roles)
    }

    /// `model_from_bone` of the latest pose.
    pub fn model_from_bone(&self) -> &[Affine3A] {
        &self.model_from_bone
    }

    /// The skinned positions and unit normals of the latest pose; empty for a character without a mesh.
    pub fn skinned(&self) -> (&[[f32; 3]], &[[f32; 3]]) {
        (&self.positions, &self.normals)
    }
}

/// Whether every joint of a tree hangs on the same joint in a larger one. Splitters between them do not count: one that
/// is swapped for another, or plugged together in another order, leaves the joints the bones they had.
fn is_part_of(tree: &JointTree, whole: &JointTree) -> bool {
    let joint_above = |tree: &JointTree, part: usize| {
        let mut above = tree.parts()[part].parent;
        while let Some(index) = above.filter(|&index| tree.parts()[index].kind.axes().is_empty()) {
            above = tree.parts()[index].parent;
        }
        above.map(|index| tree.parts()[index].uid)
    };
    let joints = tree.parts().iter().enumerate().filter(|(_, part)| !part.kind.axes().is_empty());
    joints.into_iter().all(|(index, part)| {
        whole.find(part.uid).is_some_and(|same| {
            whole.parts()[same].kind == part.kind && joint_above(whole, same) == joint_above(tree, index)
        })
    })
}

#[cfg(test)]
mod tests {
    use armature_rig::{Bone, Part, PartKind, Skeleton, Transform};
    use glam::Vec3;

    use super::*;

    const UID: PartUid = PartUid([3; 12]);

    fn performance(policy: ZeroPolicy, calibration: Calibration) -> Performance {
        let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::Y };
        let actor = Actor::bare("arm", "arm", Skeleton::new(vec![bone]).unwrap());
        let mut performance = Performance::new(Arc::new(actor), None, calibration, policy).unwrap();
        let part = Part { uid: UID, kind: PartKind::Bend, parent: None, outlet: 0, counts_per_turn: 4096 };
        performance.set_topology(1, JointTree::new(vec![part]).unwrap());
        performance
    }

    fn sample(counts: u16, state: SensorState) -> RawSample {
        RawSample { epoch: 1, counts: vec![counts], states: vec![state], ..RawSample::default() }
    }

    fn angle(performance: &Performance) -> f32 {
        performance.pose().parent_from_bone[0].rotation.to_axis_angle().1
    }

    #[test]
    fn the_first_good_sample_is_the_rest_pose() {
        let mut performance = performance(ZeroPolicy::WhenUnknown, Calibration::default());
        let early = performance.perform(&sample(9, SensorState::NoData)).unwrap();
        assert_eq!(early, Step::Posed { zeroed: None });
        assert!(performance.waits_for_zero());
        let Step::Posed { zeroed: Some(report) } = performance.perform(&sample(1000, SensorState::Ok)).unwrap() else {
            panic!("the first good sample is taken as zero")
        };
        assert_eq!(report.zeroed, 1);
        assert!(angle(&performance).abs() < 1e-6);
        performance.perform(&sample(1000 + 1024, SensorState::Ok)).unwrap();
        assert!((angle(&performance) - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
    }

    #[test]
    fn a_calibrated_joint_is_not_zeroed_again_unless_asked() {
        let mut first = performance(ZeroPolicy::WhenUnknown, Calibration::default());
        first.perform(&sample(1000, SensorState::Ok)).unwrap();
        let known = first.calibration().clone();
        let mut second = performance(ZeroPolicy::WhenUnknown, known.clone());
        assert!(!second.waits_for_zero());
        second.perform(&sample(2024, SensorState::Ok)).unwrap();
        assert!(angle(&second) > 1.5);
        second.request_zero();
        second.perform(&sample(2024, SensorState::Ok)).unwrap();
        assert!(angle(&second).abs() < 1e-6);
        assert!(performance(ZeroPolicy::AtStart, known).waits_for_zero());
    }

    #[test]
    fn a_sensor_that_never_answers_does_not_hold_up_the_others_for_ever() {
        let mut performance = performance(ZeroPolicy::AtStart, Calibration::default());
        for _ in 0..=PATIENCE_SAMPLES {
            performance.perform(&sample(0, SensorState::NoData)).unwrap();
        }
        assert!(!performance.waits_for_zero());
    }

    #[test]
    fn samples_of_another_topology_are_ignored() {
        let mut performance = performance(ZeroPolicy::OnRequest, Calibration::default());
        let other = RawSample { epoch: 2, ..sample(0, SensorState::Ok) };
        assert_eq!(performance.perform(&other).unwrap(), Step::Ignored);
    }
}
