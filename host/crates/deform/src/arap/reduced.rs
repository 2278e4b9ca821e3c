//! A shape reduced to its handles, solved every frame.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use super::constraint::{Anchor, HandleConstraint};
use super::dynamics::{ArapDynamics, Motion, Step};
use super::energy_of::energy_of;
use super::error::{ArapError, expect_length};
use super::reduction::{Reduction, proceed, reduce};
use super::report::{ArapReport, ArapStop};
use super::settings::ArapSettings;
use super::shape::ArapShape;
use super::soft_joints::SoftJoint;
use super::solve::{Targets, local_global};
use super::state::State;
use super::system::{Solver, System};
use crate::lanes::LANES;

/// A shape reduced to the transformations of its handles, ready to be solved every frame.
///
/// Built once ([`precompute`](Self::precompute), `f64`), switched between sets of constraints now and then
/// ([`constrain`](Self::constrain), a fraction of a millisecond for 23 bones) and solved every frame
/// ([`solve`](Self::solve), `f32`, no allocation, starting from the previous frame).
///
/// A clone is another character of the same shape with its own pose: it shares everything precomputed, and the
/// constraints until it switches to others. A crowd of clones stays in the processor's cache.
#[derive(Clone, Debug)]
pub struct ReducedArap {
    reduction: Arc<Reduction>,
    /// Without soft joints.
    bare: Arc<Reduction>,
    system: Arc<System>,
    state: State,
    motion: Motion,
    /// Those of the last [`constrain`](Self::constrain).
    anchors: Vec<Anchor>,
}

impl ReducedArap {
    /// Reduces a shape to its handles; all of them are free at first.
    ///
    /// `progress` receives the current stage and the fraction of the whole that is done, 0 to 1 and never falling; it
    /// can cancel.
    pub fn precompute(
        shape: &ArapShape,
        settings: &ArapSettings,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<Self, ArapError> {
        shape.validate()?;
        let reduction = Arc::new(reduce(shape, settings, progress)?);
        let state = State::new(&reduction);
        let motion = Motion::new(4 * reduction.handle_count);
        let (bare, system) = (reduction.clone(), Arc::new(System::default()));
        let mut arap = Self { reduction, bare, system, state, motion, anchors: Vec::new() };
        let free = vec![HandleConstraint::Free; arap.handle_count()];
        arap.constrain(&free, &[])?;
        proceed(progress, "done", 1.0)?;
        Ok(arap)
    }

    /// Switches to other constraints: one per handle, and points of the shape to hold. The current pose remains the
    /// start of the next solve.
    pub fn constrain(&mut self, handles: &[HandleConstraint], anchors: &[Anchor]) -> Result<(), ArapError> {
        expect_length("constraints", handles.len(), self.handle_count())?;
        self.system = Arc::new(System::new(&self.reduction, handles, anchors, None)?);
        self.anchors = anchors.to_vec();
        self.motion.forget_systems();
        self.state.make_room_for_system(&self.system);
        self.state.ends.anchor_targets.clear();
        for anchor in anchors {
            self.state.ends.anchor_targets.push(self.reduction.rest_anchor(anchor));
        }
        Ok(())
    }

    /// Replaces how handles prefer to turn against each other (initially no preferences). The current pose remains the
    /// start of the next solve. The energy in reports includes these terms.
    pub fn soften(&mut self, joints: &[SoftJoint]) -> Result<(), ArapError> {
        if joints.is_empty() && Arc::ptr_eq(&self.reduction, &self.bare) {
            return Ok(());
        }
        self.reduction =
            if joints.is_empty() { self.bare.clone() } else { Arc::new(self.bare.with_soft_joints(joints)?) };
        // What an earlier limit allowed may be beyond the new one.
        self.state.make_room_for(self.bare.cluster_count);
        self.state.make_room_for(self.reduction.cluster_count);
        let system = System::new(&self.reduction, &self.system.given.constraints, &self.anchors, None)?;
        self.system = Arc::new(system);
        self.state.make_room_for_system(&self.system);
        self.motion.forget_systems();
        Ok(())
    }

    /// Number of handles.
    pub fn handle_count(&self) -> usize {
        self.reduction.handle_count
    }

    /// Number of rotation clusters: as requested, or fewer where weights are alike.
    pub fn cluster_count(&self) -> usize {
        self.bare.cluster_count
    }

    /// How many numbers an iteration reads: what its time grows with.
    pub fn numbers_per_iteration(&self) -> usize {
        match &self.system.solver {
            Solver::Inverse(inverse) => 3 * LANES * inverse.panels.len(),
            Solver::Factor(factor) => 2 * factor.blocks.stored() + 2 * 12 * self.reduction.covariance.stored(),
        }
    }

    /// Elements without area or volume, which the energy ignores.
    pub fn degenerate_elements(&self) -> usize {
        self.reduction.degenerate
    }

    /// Zero-based handles that no vertex follows; they stay at rest unless constrained.
    pub fn weightless_handles(&self) -> &[usize] {
        &self.reduction.weightless
    }

    /// The handles' `model_from_rest` transformations after the last solve (identities before the first).
    pub fn transforms(&self) -> &[Affine3A] {
        &self.state.ends.transforms
    }

    /// The energy of the shape under these transformations of its handles, whatever is given of them, with the rotations
    /// that suit them best; in the unit of [`ArapReport::energy`].
    pub fn energy_of(&self, transforms: &[Affine3A]) -> Result<f64, ArapError> {
        expect_length("transformations", transforms.len(), self.handle_count())?;
        Ok(energy_of(&self.reduction, transforms))
    }

    /// Forgets the current pose: the next solve or step starts from the rest pose, at rest.
    pub fn restart(&mut self) {
        self.motion.stop();
        self.state.restart();
    }

    /// Finds the transformations for these targets, starting from the previous frame.
    ///
    /// `handle_targets`: one `model_from_rest` map per handle. A full constraint uses all of it, an orientation its
    /// linear part, a position only where it takes the handle point, a free handle nothing. `anchor_targets`: where
    /// each anchor goes. Allocates nothing. The shape is at rest in its new pose: for momentum, see
    /// [`step`](Self::step).
    pub fn solve(
        &mut self,
        handle_targets: &[Affine3A],
        anchor_targets: &[Vec3],
        stop: ArapStop,
    ) -> Result<ArapReport, ArapError> {
        let targets = self.targets(handle_targets, anchor_targets)?;
        self.motion.stop();
        Ok(local_global(&self.reduction, &self.system, &mut self.state, targets, stop))
    }

    /// Advances by `seconds` towards these targets, with the momentum left by earlier frames.
    ///
    /// Targets are those of [`solve`](Self::solve); given parts follow them at once, the rest swings. One implicit
    /// step, stable for any length (long steps lose energy, none gains any); a frame of zero or NaN length moves only
    /// the given parts and leaves the rest to the next frame. Time is stepped over to within 2 % of a frame; the
    /// difference carries over. Allocates nothing, except when the frame time or the constraints are new: then the
    /// small inverse is computed for them, at the cost of [`constrain`](Self::constrain).
    pub fn step(
        &mut self,
        dynamics: &ArapDynamics,
        seconds: f64,
        handle_targets: &[Affine3A],
        anchor_targets: &[Vec3],
        stop: ArapStop,
    ) -> Result<ArapReport, ArapError> {
        let targets = self.targets(handle_targets, anchor_targets)?;
        let step = self.motion.begin(&self.reduction, &self.state, dynamics, seconds)?;
        self.state.pull(&self.reduction, self.motion.ahead());
        let system = match self.motion.take_system(step) {
            Some(system) => system,
            None => Arc::new(self.moving_system(step)?),
        };
        self.state.make_room_for_system(&system);
        let report = local_global(&self.reduction, &system, &mut self.state, targets, stop);
        self.motion.end(&self.state, step, system);
        Ok(report)
    }

    fn moving_system(&self, step: Step) -> Result<System, ArapError> {
        System::new(&self.reduction, &self.system.given.constraints, &self.anchors, Some(step.resistance))
    }

    fn targets<'a>(&self, handles: &'a [Affine3A], anchors: &'a [Vec3]) -> Result<Targets<'a>, ArapError> {
        expect_length("handle targets", handles.len(), self.handle_count())?;
        expect_length("anchor targets", anchors.len(), self.state.ends.anchor_targets.len())?;
        Ok(Targets { handles, anchors })
    }
}
