//! Momentum and gravity for reduced as-rigid-as-possible poses: an implicit step in time (thesis section 7.7).

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::arap_constraints::{Resistance, System};
use crate::reduced_arap::{Anchor, ArapError, ArapReport, ArapStop, ReducedArap};

/// How a shape moves by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapDynamics {
    /// How fast it springs back (1/s²): a shape of mass one and radius one, pulled apart by its whole size, is drawn
    /// back with this acceleration. With 1,000 an ear swings a few times a second, with 100,000 it hardly moves.
    pub stiffness: f64,
    /// Part of the speed that is lost (1/s): what moves freely keeps `exp(-damping · t)` of it.
    pub damping: f64,
    /// Acceleration of what nothing holds (mesh units/s²).
    pub gravity: Vec3,
}

impl Default for ArapDynamics {
    /// Quick to come to rest, without weight.
    fn default() -> Self {
        Self { stiffness: 1000.0, damping: 4.0, gravity: Vec3::ZERO }
    }
}

/// Frame times are rounded to steps this much apart (by a factor), so that one step's matrices serve the frames that
/// follow; what rounding leaves over is carried to the next frame.
const STEP_RATIO: f64 = 1.04;
/// The shortest and the longest step (s). A longer frame is one step of this length: time beyond it is dropped.
const STEPS: [f64; 2] = [1e-4, 10.0];
/// Step lengths whose matrices are kept: two that frames of a steady rate alternate between, and two for a change.
const KEPT: usize = 4;

/// What a moving shape remembers.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// Change of the stacked transformations a second, by axis.
    pub(crate) speed: [Vec<f64>; 3],
    /// The stacked transformations before a step.
    pub(crate) before: [Vec<f64>; 3],
    /// Where they would go without resistance; then the pull of this on the open ones.
    pub(crate) ahead: [Vec<f64>; 3],
    /// Time that has not been stepped over yet (s).
    pub(crate) left: f64,
    /// The systems of the last few step lengths and what they were made for, the latest last.
    systems: Vec<(Resistance, Arc<System>)>,
}

impl Motion {
    pub(crate) fn new(rows: usize) -> Self {
        let column = || [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
        Self { speed: column(), before: column(), ahead: column(), left: 0.0, systems: Vec::with_capacity(KEPT) }
    }

    /// Stands still.
    pub(crate) fn stop(&mut self) {
        self.speed.iter_mut().for_each(|column| column.fill(0.0));
        self.left = 0.0;
    }

    pub(crate) fn forget_systems(&mut self) {
        self.systems.clear();
    }
}

impl ReducedArap {
    /// Moves on by `seconds` towards these targets, with the momentum that the frames before have left.
    ///
    /// Targets are those of [`solve`](Self::solve); what they give is followed at once, the rest swings. One implicit
    /// step, stable however long it is (long steps lose energy, none gains any); a frame without time, or one that is
    /// not a number, moves what is given only and leaves the rest to the next. Time is stepped over to within 2 % of a
    /// frame and carries over. Allocates nothing but where a frame time or the constraints are new: then the small
    /// inverse is made for them, at the price of [`constrain`](Self::constrain).
    pub fn step(
        &mut self,
        dynamics: &ArapDynamics,
        seconds: f64,
        handle_targets: &[Affine3A],
        anchor_targets: &[Vec3],
        stop: ArapStop,
    ) -> Result<ArapReport, ArapError> {
        self.expect_targets(handle_targets, anchor_targets)?;
        let usable = |value: f64| value.is_finite() && (0.0..=1e12).contains(&value);
        let numbers = [dynamics.stiffness, dynamics.damping, f64::from(dynamics.gravity.abs().max_element())];
        if let Some(index) = numbers.iter().position(|n| !usable(*n)) {
            return Err(ArapError::NotFinite { what: "number of the dynamics", index });
        }
        let length = self.next_step(seconds);
        let weight = 1.0 / (dynamics.stiffness.max(1e-9) * length * length);
        self.look_ahead(dynamics, length, weight);
        let system = self.system_for(Resistance(weight))?;
        // As many equations as constraints and joints; those that hold a resting shape are not needed here.
        let equations = system.equation_count().max(self.state.right[0].len());
        self.state.right.iter_mut().for_each(|column| column.resize(equations, 0.0));
        let resting = std::mem::replace(&mut self.system, system);
        let report = self.local_global(handle_targets, anchor_targets, stop);
        let moving = std::mem::replace(&mut self.system, resting);
        self.motion.systems.push((Resistance(weight), moving));
        for axis in 0..3 {
            let rows = self.motion.speed[axis].iter_mut().zip(&self.motion.before[axis]);
            for ((speed, before), now) in rows.zip(&self.state.transposed[axis]) {
                *speed = (now - before) / length;
            }
        }
        Ok(report)
    }

    /// The length of the step that comes closest to the time not stepped over yet.
    fn next_step(&mut self, seconds: f64) -> f64 {
        let motion = &mut self.motion;
        motion.left += if seconds.is_finite() { seconds.max(0.0) } else { 0.0 };
        let wanted = motion.left.clamp(STEPS[0], STEPS[1]);
        let length = STEP_RATIO.powf((wanted.ln() / STEP_RATIO.ln()).round());
        // Less than nothing may be left: then the next frame is shorter.
        motion.left = (motion.left - length).clamp(-length, length);
        length
    }

    /// Sets where everything would go by its speed and weight alone, as a force.
    fn look_ahead(&mut self, dynamics: &ArapDynamics, length: f64, weight: f64) {
        let Self { reduction, state, motion, .. } = self;
        let viscosity = reduction.viscosity();
        let kept = (-dynamics.damping * length).exp();
        let gravity = dynamics.gravity.as_dvec3() / reduction.size;
        for axis in 0..3 {
            let fall = if reduction.planar && axis == 2 { 0.0 } else { gravity[axis] * length * length };
            motion.before[axis].copy_from_slice(&state.transposed[axis]);
            let now = state.transposed[axis].iter().zip(&motion.speed[axis]);
            for (row, (ahead, (now, speed))) in motion.ahead[axis].iter_mut().zip(now).enumerate() {
                *ahead = weight * (now + kept * length * speed + if row % 4 == 3 { fall } else { 0.0 });
            }
        }
        for axis in 0..3 {
            reduction.closeness.times_vector(&motion.ahead[axis], &mut state.force[axis]);
            let now = state.force[axis].iter_mut().zip(&state.transposed[axis]);
            now.for_each(|(force, now)| *force += viscosity * now);
        }
    }

    fn system_for(&mut self, resistance: Resistance) -> Result<Arc<System>, ArapError> {
        let systems = &mut self.motion.systems;
        if let Some(place) = systems.iter().position(|(of, _)| of == &resistance) {
            return Ok(systems.remove(place).1);
        }
        if systems.len() == KEPT {
            systems.remove(0);
        }
        let anchors: &[Anchor] = &self.anchors;
        Ok(Arc::new(System::new(&self.reduction, &self.system.constraints, anchors, Some(resistance))?))
    }
}
