//! Momentum and gravity for reduced as-rigid-as-possible poses: an implicit step in time (thesis section 7.7).

use std::sync::Arc;

use glam::Vec3;

use super::error::ArapError;
use super::given::Resistance;
use super::reduction::Reduction;
use super::state::State;
use super::system::System;

/// How a shape moves on its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapDynamics {
    /// How fast it springs back (1/s²): a shape of mass one and radius one, pulled apart by its whole size, is pulled
    /// back with this acceleration. With 1,000 an ear swings a few times a second; with 100,000 it hardly moves.
    pub stiffness: f64,
    /// Rate of speed loss (1/s): anything moving freely keeps `exp(-damping · t)` of its speed.
    pub damping: f64,
    /// Acceleration of anything not held (mesh units/s²).
    pub gravity: Vec3,
}

impl Default for ArapDynamics {
    /// Quick to come to rest, without gravity.
    fn default() -> Self {
        Self { stiffness: 1000.0, damping: 4.0, gravity: Vec3::ZERO }
    }
}

/// Frame times are rounded to steps that differ by this factor, so that one step's matrices serve the frames that
/// follow; the remainder is carried over to the next frame.
const STEP_RATIO: f64 = 1.04;
/// The shortest and longest step (s). A longer frame is one step of this length; the remaining time is dropped.
const STEPS: [f64; 2] = [1e-4, 10.0];
/// Step lengths whose matrices are kept: two between which frames of a steady rate alternate, and two for a change of
/// rate.
const KEPT: usize = 4;

/// A time step in progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Seconds.
    length: f64,
    pub(super) resistance: Resistance,
}

/// What a moving shape remembers.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Rate of change of the stacked transformations per second, by axis.
    speed: [Vec<f64>; 3],
    /// The stacked transformations before a step.
    before: [Vec<f64>; 3],
    /// Where they would go freely, times their resistance.
    ahead: [Vec<f64>; 3],
    /// Time not yet stepped over (s).
    left: f64,
    /// The systems for the last few step lengths and what they were made for, the latest last.
    systems: Vec<(Resistance, Arc<System>)>,
}

impl Motion {
    pub(super) fn new(rows: usize) -> Self {
        let column = || [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
        Self { speed: column(), before: column(), ahead: column(), left: 0.0, systems: Vec::with_capacity(KEPT) }
    }

    /// At rest.
    pub(super) fn stop(&mut self) {
        self.speed.iter_mut().for_each(|column| column.fill(0.0));
        self.left = 0.0;
    }

    pub(super) fn forget_systems(&mut self) {
        self.systems.clear();
    }

    /// Starts an implicit step over about `seconds`: computes where everything would go under its speed and gravity
    /// alone.
    pub(super) fn begin(
        &mut self,
        reduction: &Reduction,
        state: &State,
        dynamics: &ArapDynamics,
        seconds: f64,
    ) -> Result<Step, ArapError> {
        let usable = |value: f64| value.is_finite() && (0.0..=1e12).contains(&value);
        let numbers = [dynamics.stiffness, dynamics.damping, f64::from(dynamics.gravity.abs().max_element())];
        if let Some(index) = numbers.iter().position(|n| !usable(*n)) {
            return Err(ArapError::NotFinite { what: "number of the dynamics", index });
        }
        let length = self.next_length(seconds);
        let weight = 1.0 / (dynamics.stiffness.max(1e-9) * length * length);
        self.look_ahead(reduction, state, dynamics, length, weight);
        Ok(Step { length, resistance: Resistance(weight) })
    }

    /// Derives the speed from where the step has moved the state, and keeps the system for the next step of this
    /// length.
    pub(super) fn end(&mut self, state: &State, step: Step, system: Arc<System>) {
        if self.systems.len() == KEPT {
            self.systems.remove(0);
        }
        self.systems.push((step.resistance, system));
        for axis in 0..3 {
            let rows = self.speed[axis].iter_mut().zip(&self.before[axis]);
            for ((speed, before), now) in rows.zip(&state.maps.transposed[axis]) {
                *speed = (now - before) / step.length;
            }
        }
    }

    /// Takes out the system of an earlier step of the same length.
    pub(super) fn take_system(&mut self, step: Step) -> Option<Arc<System>> {
        let place = self.systems.iter().position(|(of, _)| *of == step.resistance)?;
        Some(self.systems.remove(place).1)
    }

    /// The length of the step closest to the time not yet stepped over.
    fn next_length(&mut self, seconds: f64) -> f64 {
        self.left += if seconds.is_finite() { seconds.max(0.0) } else { 0.0 };
        let wanted = self.left.clamp(STEPS[0], STEPS[1]);
        let length = STEP_RATIO.powf((wanted.ln() / STEP_RATIO.ln()).round());
        // The remainder may be negative: then the next frame is shorter.
        self.left = (self.left - length).clamp(-length, length);
        length
    }

    /// Where everything would go freely, times its resistance.
    pub(super) fn ahead(&self) -> &[Vec<f64>; 3] {
        &self.ahead
    }

    fn look_ahead(&mut self, reduction: &Reduction, state: &State, dynamics: &ArapDynamics, length: f64, weight: f64) {
        let kept = (-dynamics.damping * length).exp();
        let gravity = dynamics.gravity.as_dvec3() / reduction.size;
        for axis in 0..3 {
            let fall = if reduction.planar && axis == 2 { 0.0 } else { gravity[axis] * length * length };
            self.before[axis].copy_from_slice(&state.maps.transposed[axis]);
            let now = state.maps.transposed[axis].iter().zip(&self.speed[axis]);
            for (row, (ahead, (now, speed))) in self.ahead[axis].iter_mut().zip(now).enumerate() {
                *ahead = weight * (now + kept * length * speed + if row % 4 == 3 { fall } else { 0.0 });
            }
        }
    }
}
