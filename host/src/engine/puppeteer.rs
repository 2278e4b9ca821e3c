//! From a puppet's samples to a posed and skinned character: the pose-time heart of the program, pure.
//!
//! It reads no clock and no port: the [`pipeline`](super::pipeline) hands it the topology and the samples. Same calls,
//! same poses, same take.

mod dragging;
mod preparing;
mod takes;

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_character::Progress;
use armature_character::inverse_kinematics::{BoneRole, InverseKinematics};
use armature_rig::{
    BoneStatus, Calibration, Dynamics, Ground, JointTree, Mapping, MappingEntry, PartUid, Pose, PoseCompletion,
    PuppetHints, RawSample, SensorCalibration, SensorState, ShapeWeights, SolveError, StreamSolver, ZeroReport,
};
use armature_take::Record;
use glam::{Affine3A, Quat};

use self::dragging::Dragging;
use super::missed_pins::MissedPins;
use super::puppet_rest::{PuppetRest, RestMatcher, is_part_of};
use super::shaped_skin::ShapedSkin;
use crate::characters::LoadedCharacter;
use crate::characters::dynamics::DynamicsArgs;
use crate::characters::ground::GroundArgs;
use crate::characters::inverse_kinematics::IkArgs;
use crate::characters::shapes::{self, ShapeWeight};
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

/// A part that is plugged in again takes this long to bring its bone to where it is, and a joint whose readings are back
/// no longer than this, microseconds of the device's clock.
pub const ENGAGE_MICROS: u32 = 250_000;

/// After this many samples, a sensor without a good reading no longer delays the zeroing of the others.
pub(super) const PATIENCE_SAMPLES: u32 = 50;

/// Progress that nobody hears.
pub fn unheard(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// What a sample led to.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// No topology yet, or a sample of an older topology.
    Ignored,
    /// The character has a new pose.
    Posed {
        /// The rest pose was taken from this sample.
        zeroed: Option<ZeroReport>,
        /// What changed before this sample besides: targets. A take says so before it.
        told: Vec<Record>,
    },
}

/// A character that a puppet moves.
#[derive(Debug)]
pub struct Puppeteer {
    character: Arc<LoadedCharacter>,
    skin: ShapedSkin,
    chosen_mapping: Option<Mapping>,
    /// The last proposal and the puppet it was made for.
    proposed: Option<(JointTree, Mapping)>,
    mapping_doubts: Vec<String>,
    /// What joints without a bone turn, and the puppet for which that was found.
    carried: Option<(JointTree, Vec<MappingEntry>)>,
    rest: RestMatcher,
    hints: PuppetHints,
    replaced: Vec<PartUid>,
    zero_policy: ZeroPolicy,
    zero_wish: ZeroWish,
    waited_samples: u32,
    solver: StreamSolver,
    /// Shapes of the mapping that the character does not have, as far as that was said.
    missing_shapes: Vec<String>,
    ground: Option<Ground>,
    dynamics: Option<Dynamics>,
    inverse_kinematics: Option<InverseKinematics>,
    /// What its bones prefer, in the user's words.
    preferences: Vec<String>,
    dragging: Dragging,
    /// Which pinned bones were away from their places since the take began or the puppet came.
    pub(super) missed: MissedPins,
    /// A take that began without inverse kinematics goes on without.
    solves_joints_alone: bool,
    model_from_bone: Vec<Affine3A>,
}

impl Puppeteer {
    /// A character in its rest pose. `mapping`: as chosen by the user; without one it is proposed for each puppet.
    pub fn new(
        character: Arc<LoadedCharacter>,
        mapping: Option<Mapping>,
        calibration: Calibration,
        zero_policy: ZeroPolicy,
    ) -> Result<Self, Failure> {
        let skin = ShapedSkin::new(&character)?;
        let model_from_bone = character.skeleton.rest_model_from_bone();
        let solver = fresh_solver(&character, calibration);
        Ok(Self {
            inverse_kinematics: None,
            preferences: Vec::new(),
            solves_joints_alone: false,
            dragging: Dragging::default(),
            missed: MissedPins::default(),
            character,
            skin,
            chosen_mapping: mapping,
            proposed: None,
            mapping_doubts: Vec::new(),
            carried: None,
            rest: RestMatcher::default(),
            hints: PuppetHints::default(),
            replaced: Vec::new(),
            zero_policy,
            zero_wish: ZeroWish::Nothing,
            waited_samples: 0,
            solver,
            missing_shapes: Vec::new(),
            ground: None,
            dynamics: None,
            model_from_bone,
        })
    }

    /// With a puppet that is zeroed in this pose.
    #[must_use]
    pub fn with_puppet_rest(self, puppet_rest: PuppetRest) -> Self {
        Self { rest: RestMatcher::new(puppet_rest), ..self }
    }

    /// With what is known of the puppet besides its tree.
    #[must_use]
    pub fn with_hints(self, hints: PuppetHints) -> Self {
        Self { hints, ..self }
    }

    /// What is known of the puppet besides its tree; used from the next topology on.
    pub fn set_hints(&mut self, hints: PuppetHints) {
        self.hints = hints;
    }

    /// Lets bones without a joint follow, as chosen.
    pub fn with_inverse_kinematics(mut self, choice: &IkArgs) -> Result<Self, Failure> {
        self.inverse_kinematics = choice.for_character(&self.character)?;
        self.missed = MissedPins::of(self.inverse_kinematics.as_ref(), &self.character);
        self.preferences.clone_from(&choice.prefer);
        self.prepare_inverse_kinematics(&mut unheard);
        Ok(self)
    }

    /// With shapes of the character set by hand.
    pub fn with_shapes(mut self, shapes: &[ShapeWeight]) -> Result<Self, Failure> {
        shapes.iter().try_for_each(|shape| self.set_shape(shape))?;
        Ok(self)
    }

    /// Lets bones swing, as chosen.
    pub fn with_dynamics(mut self, choice: &DynamicsArgs) -> Result<Self, Failure> {
        self.dynamics = choice.for_character(&self.character)?;
        self.swing()?;
        Ok(self)
    }

    fn swing(&mut self) -> Result<(), Failure> {
        self.solver
            .set_dynamics(self.dynamics.clone())
            .map_err(|e| Failure::usage(e.to_string(), "choose other bones for --dynamics, or off"))
    }

    /// What swings; `None` where nothing does.
    pub fn dynamics(&self) -> Option<&Dynamics> {
        self.dynamics.as_ref()
    }

    /// Lets the roots follow the feet, as chosen.
    pub fn with_ground(mut self, choice: &GroundArgs) -> Result<Self, Failure> {
        self.ground = choice.for_character(&self.character, self.inverse_kinematics.as_ref())?;
        self.stand()?;
        Ok(self)
    }

    fn stand(&mut self) -> Result<(), Failure> {
        self.solver
            .set_ground(self.ground.clone())
            .map_err(|e| Failure::usage(e.to_string(), "choose other --contacts"))
    }

    /// How the roots follow the feet; `None` where they stay.
    pub fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref()
    }

    /// Takes a puppet as it is plugged together now. Parts that were there before go on without a jump. `progress` hears
    /// how far preparing inverse kinematics is.
    pub fn set_topology(&mut self, epoch: u16, tree: JointTree, progress: Progress<'_>) {
        let mut mapping = match &self.chosen_mapping {
            Some(mapping) => mapping.clone(),
            None => self.proposal(&tree),
        };
        if self.chosen_mapping.is_none() || self.rest.is_asked_for() {
            mapping.rest = self.rest.turns(&tree, &mapping, &self.character.skeleton, &self.hints);
        }
        mapping.carried = self.carried(&tree, &mapping);
        self.look_for_shapes(&tree, &mapping);
        let mut calibration = self.solver.calibration().clone();
        self.replaced = calibration.forget_misfits(&tree);
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
        self.prepare_inverse_kinematics(progress);
    }

    /// Warns of shapes that cannot be driven: the character lacks them, or the puppet lacks their joint.
    fn look_for_shapes(&mut self, tree: &JointTree, mapping: &Mapping) {
        for drive in &mapping.shapes {
            if !self.missing_shapes.contains(&drive.shape) && !shapes::has(&self.character, &drive.shape) {
                tracing::warn!("the mapping: {}", shapes::unknown(&self.character, &drive.shape).what);
                self.missing_shapes.push(drive.shape.clone());
            }
            if tree.find(drive.part).is_none() {
                let (shape, part) = (&drive.shape, drive.part);
                tracing::warn!("the shape {shape:?} waits for part {part}, which is not plugged in");
            }
        }
    }

    /// What was proposed for a puppet still holds while parts of it are unplugged, and when they are back: otherwise
    /// the rest of it would change bones in the middle of a performance.
    fn proposal(&mut self, tree: &JointTree) -> Mapping {
        if let Some((_, mapping)) = self.proposed.as_ref().filter(|(whole, _)| is_part_of(tree, whole)) {
            return mapping.clone();
        }
        let mut proposal = armature_rig::propose_with(tree, &self.character.skeleton, &self.hints);
        if self.inverse_kinematics.is_some() {
            // It poses the bones between by the character's shape, as preferences and limits say.
            proposal.mapping.shared.clear();
        }
        self.proposed = Some((tree.clone(), proposal.mapping.clone()));
        self.mapping_doubts = proposal.ambiguities;
        proposal.mapping
    }

    /// Why the character's rest pose was not turned to the puppet's, where that might be expected.
    pub fn rest_note(&self) -> Option<&str> {
        self.rest.note()
    }

    /// What joints without a bone turn; like a proposal, it holds while parts are unplugged.
    fn carried(&mut self, tree: &JointTree, mapping: &Mapping) -> Vec<MappingEntry> {
        if let Some((_, carried)) = self.carried.as_ref().filter(|(whole, _)| is_part_of(tree, whole)) {
            return carried.clone();
        }
        // A turn that cannot be used is an error of the first sample.
        let rested = mapping.rested(&self.character.skeleton).unwrap_or_else(|_| self.character.skeleton.clone());
        let mut carried = armature_rig::carried(tree, mapping, &Mapping::default(), &rested);
        if !carried.is_empty() {
            let likely = armature_rig::propose_with(tree, &self.character.skeleton, &self.hints).mapping;
            carried = armature_rig::carried(tree, mapping, &likely, &rested);
        }
        self.carried = Some((tree.clone(), carried.clone()));
        carried
    }

    /// Parts whose calibration was dropped with the latest topology, since it is that of another kind of part.
    pub fn replaced_parts(&self) -> &[PartUid] {
        &self.replaced
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

    /// Whether the whole puppet has to be in its rest pose for that.
    pub fn awaits_rest_pose(&self) -> bool {
        self.zero_wish == ZeroWish::Everything
    }

    /// Forgets what sensors said before, so that a take that begins now can be solved from its own samples alone.
    fn forget_past(&mut self) {
        self.missed.forget();
        self.solver.forget_past();
        if let Some(ik) = &mut self.inverse_kinematics {
            ik.restart();
        }
    }

    /// Another puppet is connected, and this is what is known of its joints: how they are calibrated, and what they are.
    pub fn expect_puppet(&mut self, calibration: Calibration, hints: PuppetHints) {
        self.hints = hints;
        let solver = fresh_solver(&self.character, calibration);
        let former = std::mem::replace(&mut self.solver, solver);
        for (shape, weight) in former.shapes().iter() {
            // It was finite before.
            let _ = self.solver.set_shape(shape, weight);
        }
        if let Err(failure) = self.stand().and_then(|()| self.swing()) {
            tracing::warn!("{failure}");
        }
        self.forget_past();
        self.dragging.forget();
        self.proposed = None;
        self.carried = None;
        self.rest.forget();
        self.mapping_doubts.clear();
        self.zero_wish = ZeroWish::Nothing;
        self.waited_samples = 0;
    }

    /// Poses and skins the character by one sample.
    pub fn follow(&mut self, sample: &RawSample) -> Result<Step, Failure> {
        let fits = self
            .solver
            .topology()
            .is_some_and(|(epoch, tree)| epoch == sample.epoch && tree.sensor_count() == sample.counts.len());
        if !fits {
            return Ok(Step::Ignored);
        }
        let zeroed = self.zero_if_wanted(sample)?;
        let told = self.drag(sample.device_micros);
        let ik = self.inverse_kinematics.as_mut().filter(|_| !self.solves_joints_alone);
        let pose = match self.solver.solve_completed(sample, ik.map(|ik| ik as &mut dyn PoseCompletion)) {
            Ok(pose) => pose,
            Err(SolveError::Mapping(error)) => {
                let remedy = "correct the mapping file, or leave --mapping away to have one proposed";
                return Err(Failure::input(error.to_string(), remedy));
            }
            Err(error) => return Err(Failure::device(error.to_string(), "unplug the puppet and connect again")),
        };
        pose.forward_kinematics(&self.character.skeleton, &mut self.model_from_bone);
        self.missed.see(&self.model_from_bone);
        self.skin.blend(&self.character, self.solver.shapes())?;
        self.skin.pose(&self.model_from_bone)?;
        Ok(Step::Posed { zeroed, told })
    }

    /// Blends the character towards one of its shapes, now and from now on. A joint that drives it sets it again with the
    /// next sample.
    pub fn set_shape(&mut self, shape: &ShapeWeight) -> Result<(), Failure> {
        if !shapes::has(&self.character, &shape.name) {
            return Err(shapes::unknown(&self.character, &shape.name));
        }
        let set = self.solver.set_shape(&shape.name, shape.weight);
        set.map_err(|error| Failure::usage(error.to_string(), "choose a weight between 0 and 1"))?;
        self.skin.blend(&self.character, self.solver.shapes())?;
        self.skin.pose(&self.model_from_bone)
    }

    /// The weights of shapes that were set by hand or by joints.
    pub fn shapes(&self) -> &ShapeWeights {
        self.solver.shapes()
    }

    /// Skins the character in a pose and with weights of shapes that were solved before, as of a take.
    pub fn show(&mut self, pose: &Pose, shapes: &ShapeWeights) -> Result<(), Failure> {
        pose.forward_kinematics(&self.character.skeleton, &mut self.model_from_bone);
        self.skin.blend(&self.character, shapes)?;
        self.skin.pose(&self.model_from_bone)
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
    pub fn character(&self) -> &Arc<LoadedCharacter> {
        &self.character
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
        self.solver.completed_pose()
    }

    /// The height of the skeleton at rest, mesh units.
    pub fn height(&self) -> f32 {
        let ends = self.character.skeleton.rest_segments().into_iter().flat_map(|(head, tail)| [head.y, tail.y]);
        let (low, high) = ends.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
        if high > low { high - low } else { 1.0 }
    }

    /// How far the puppet's legs dragged a foot that stood, mesh units.
    pub fn dragged_foot(&self) -> f32 {
        self.solver.ground().map_or(0.0, armature_rig::GroundContact::dragged)
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
        self.skin.posed()
    }
}

fn fresh_solver(character: &LoadedCharacter, calibration: Calibration) -> StreamSolver {
    let mut solver = StreamSolver::new(character.skeleton.clone());
    solver.set_calibration(calibration);
    solver.engage(ENGAGE_MICROS, false);
    solver.return_over(ENGAGE_MICROS);
    solver
}

#[cfg(test)]
#[path = "puppeteer_tests.rs"]
mod tests;
