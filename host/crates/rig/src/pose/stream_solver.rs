//! Solving a stream of samples while puppet, calibration and mapping change.

use glam::Vec3;

use super::completion::{PoseCompletion, PoseMoment};
use super::shape_weights::{ShapeError, ShapeWeights};
use super::solver::{PoseSolver, SampleError};
use super::status::BoneQuality;
use crate::calibration::Calibration;
use crate::dynamics::{Dynamics, DynamicsError, SpringBones};
use crate::ground::{Ground, GroundContact, GroundError, Standing};
use crate::mapping::{Mapping, MappingError};
use crate::puppet::{JointTree, RawSample};
use crate::skeleton::{Pose, Skeleton};

/// From samples to poses, with every change taking effect from the next sample on.
///
/// A pose depends on earlier samples too (a sensor without data keeps its last reading), so a replay is exact only if
/// it follows the recording step by step. This type does that: the live program and the replay of a take both use it.
/// Give it every sample that goes into the take, in order, and every change that goes into the take, at its place.
#[derive(Clone, Debug)]
pub struct StreamSolver {
    skeleton: Skeleton,
    topology: Option<(u16, JointTree)>,
    calibration: Calibration,
    mapping: Option<Mapping>,
    /// The latest solver that could be built, even if it is out of date: the next one continues from it.
    solver: Option<PoseSolver>,
    /// Why there is no solver for the current settings.
    unusable: Option<MappingError>,
    /// Something changed since the last sample.
    stale: bool,
    engage_micros: u32,
    return_micros: u32,
    /// The whole puppet comes back with the next sample.
    engage_all: bool,
    pose: Pose,
    /// The latest pose including the bones that no joint drives; in `pose` itself those are at rest.
    completed: Pose,
    standing: Option<Standing>,
    dynamics: Option<SpringBones>,
    shapes: ShapeWeights,
    /// Where the mapping's shapes are among them.
    driven_shapes: Vec<usize>,
    /// For each bone, whether a joint turned it in the latest pose.
    driven: Vec<bool>,
}

/// Why a sample has no pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// No joint tree was given.
    #[error("there is no joint tree yet; wait for the puppet's topology")]
    NoTopology,
    /// No mapping was given.
    #[error("no joint is mapped to a bone yet; map the puppet to the character")]
    NoMapping,
    /// The sample is numbered by another joint tree than the current one.
    #[error("the sample belongs to topology {sample}, but the current one is {topology}; later samples will match")]
    OtherEpoch {
        /// The sample's epoch.
        sample: u16,
        /// The topology's epoch.
        topology: u16,
    },
    /// The mapping or calibration does not fit the puppet or skeleton.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// The sample does not fit the joint tree.
    #[error(transparent)]
    Sample(#[from] SampleError),
}

impl StreamSolver {
    /// A solver for this skeleton, in the rest pose.
    pub fn new(skeleton: Skeleton) -> Self {
        Self {
            pose: skeleton.rest_pose(),
            completed: skeleton.rest_pose(),
            skeleton,
            topology: None,
            calibration: Calibration::default(),
            mapping: None,
            solver: None,
            unusable: None,
            stale: true,
            engage_micros: 0,
            return_micros: 0,
            engage_all: false,
            standing: None,
            dynamics: None,
            shapes: ShapeWeights::default(),
            driven_shapes: Vec::new(),
            driven: Vec::new(),
        }
    }

    /// From now on the puppet is plugged together like this.
    pub fn set_topology(&mut self, epoch: u16, tree: JointTree) {
        self.topology = Some((epoch, tree));
        self.stale = true;
    }

    /// From now on counts are converted by this calibration.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        self.calibration = calibration;
        self.stale = true;
    }

    /// From now on parts drive these bones.
    pub fn set_mapping(&mut self, mapping: Mapping) {
        self.driven_shapes = mapping.shapes.iter().map(|drive| self.shapes.place(&drive.shape)).collect();
        self.mapping = Some(mapping);
        self.stale = true;
    }

    /// From the next sample on, parts that come back move their bones to their readings over this time, microseconds of
    /// the device's clock (initially 0: immediately). `all`: the whole puppet was away and comes back with the next
    /// sample.
    pub fn engage(&mut self, micros: u32, all: bool) {
        self.engage_micros = micros;
        self.engage_all |= all;
        if let Some(solver) = &mut self.solver {
            solver.engage_over(micros);
        }
    }

    /// From the next sample on, joints whose readings were missing move their bones to what they read over as long as
    /// that was, but no longer than this, microseconds of the device's clock (0 at first: at once).
    pub fn return_over(&mut self, micros: u32) {
        self.return_micros = micros;
        if let Some(solver) = &mut self.solver {
            solver.return_over(micros);
        }
    }

    /// From the next sample on, the roots follow the foot on the floor, beginning where the skeleton rests; with `None`
    /// (as at first) they stay where they are.
    pub fn set_ground(&mut self, ground: Option<Ground>) -> Result<(), GroundError> {
        self.standing = ground.map(|ground| Standing::new(&self.skeleton, ground)).transpose()?;
        Ok(())
    }

    /// From the next sample on, these bones swing, beginning from their pose; with `None` (as at first) none do.
    pub fn set_dynamics(&mut self, dynamics: Option<Dynamics>) -> Result<(), DynamicsError> {
        self.dynamics = dynamics.map(|dynamics| SpringBones::new(&self.skeleton, dynamics)).transpose()?;
        Ok(())
    }

    /// How bones swing.
    pub fn dynamics(&self) -> Option<&SpringBones> {
        self.dynamics.as_ref()
    }

    /// How the roots follow the feet.
    pub fn ground(&self) -> Option<&GroundContact> {
        self.standing.as_ref().map(Standing::contact)
    }

    /// From now on this shape has this weight; a joint that drives it sets it again with the next sample.
    pub fn set_shape(&mut self, shape: &str, weight: f32) -> Result<(), ShapeError> {
        self.shapes.set(shape, weight)
    }

    /// The weights of all shapes that were set or are driven, after the latest sample.
    pub fn shapes(&self) -> &ShapeWeights {
        &self.shapes
    }

    /// Forgets earlier readings; skeleton, topology, calibration, mapping, the way parts come back and
    /// the weights of shapes are kept. From
    /// now on poses depend only on samples from now on, as in the replay of a take that begins here.
    pub fn forget_past(&mut self) {
        self.solver = None;
        self.unusable = None;
        self.stale = true;
        self.engage_all = false;
        self.pose = self.skeleton.rest_pose();
        if let Some(standing) = &mut self.standing {
            standing.restart();
        }
        if let Some(dynamics) = &mut self.dynamics {
            dynamics.restart();
        }
    }

    /// The skeleton.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Epoch and joint tree in use.
    pub fn topology(&self) -> Option<(u16, &JointTree)> {
        self.topology.as_ref().map(|(epoch, tree)| (*epoch, tree))
    }

    /// The calibration in use.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The mapping in use.
    pub fn mapping(&self) -> Option<&Mapping> {
        self.mapping.as_ref()
    }

    /// The latest pose from the joints alone; the rest pose before the first.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The latest pose that [`solve_completed`](Self::solve_completed) returned; the rest pose before the first.
    pub fn completed_pose(&self) -> &Pose {
        &self.completed
    }

    /// The solver in use, for the state of its bones; `None` before the first solved sample.
    pub fn solver(&self) -> Option<&PoseSolver> {
        self.solver.as_ref()
    }

    /// The whole pose of the next sample: first the bones that joints drive ([`solve`](Self::solve)), then the others
    /// by `completion`; without one they stay at rest. Then the roots follow the feet and legs that no joint turns bend, where
    /// [`Self::set_ground`] says so and no target holds the roots, and last bones swing ([`Self::set_dynamics`]). The weights of
    /// shapes are there afterwards.
    /// Playback, replay and export all pose with this function, so that they cannot diverge.
    pub fn solve_completed(
        &mut self,
        sample: &RawSample,
        completion: Option<&mut (dyn PoseCompletion + '_)>,
    ) -> Result<&Pose, SolveError> {
        self.solve(sample)?;
        self.completed.parent_from_bone.clone_from(&self.pose.parent_from_bone);
        let mut is_held = false;
        let offset = self.standing.as_ref().map_or(Vec3::ZERO, Standing::offset);
        if let (Some(completion), Some(solver)) = (completion, &self.solver) {
            let moment = PoseMoment { device_micros: sample.device_micros, offset };
            completion.complete(moment, solver.bone_status(), &mut self.completed);
            is_held = completion.holds_root();
        }
        if let Some(standing) = &mut self.standing {
            let status = self.solver.as_ref().map_or(&[][..], PoseSolver::bone_status);
            self.driven.clear();
            self.driven.extend(status.iter().map(|status| status.quality != BoneQuality::Unmapped));
            standing.stand(sample.device_micros, is_held, &self.skeleton, &self.driven, &mut self.completed);
        }
        if let (Some(dynamics), Some(solver)) = (&mut self.dynamics, &self.solver) {
            let status = solver.bone_status();
            let is_driven = |bone: usize| status[bone].quality > BoneQuality::Unmapped;
            dynamics.follow(sample.device_micros, &self.skeleton, &mut self.completed, &is_driven);
        }
        Ok(&self.completed)
    }

    /// The pose of the next sample from its joints alone. Does not allocate unless something changed since the last
    /// one.
    pub fn solve(&mut self, sample: &RawSample) -> Result<&Pose, SolveError> {
        let (epoch, tree) = self.topology.as_ref().ok_or(SolveError::NoTopology)?;
        if *epoch != sample.epoch {
            return Err(SolveError::OtherEpoch { sample: sample.epoch, topology: *epoch });
        }
        let mapping = self.mapping.as_ref().ok_or(SolveError::NoMapping)?;
        if self.stale {
            self.stale = false;
            let made = PoseSolver::new(tree, &self.calibration, mapping, &self.skeleton);
            self.unusable = match made {
                Ok(mut solver) => {
                    solver.engage_over(self.engage_micros);
                    if let Some(previous) = &self.solver {
                        solver.continue_from(previous);
                    }
                    solver.return_over(self.return_micros);
                    self.solver = Some(solver);
                    None
                }
                Err(error) => Some(error),
            };
        }
        if let Some(error) = &self.unusable {
            return Err(error.clone().into());
        }
        let solver = self.solver.as_mut().ok_or(SolveError::NoMapping)?;
        if std::mem::take(&mut self.engage_all) {
            solver.engage_all();
        }
        solver.solve(sample.device_micros, &sample.counts, &sample.states, &mut self.pose)?;
        solver.solve_shapes(sample.device_micros, &sample.counts, &sample.states, &mut |drive, weight| {
            self.shapes.put(self.driven_shapes[drive], weight);
        });
        Ok(&self.pose)
    }
}
