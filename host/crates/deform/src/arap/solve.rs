//! The loop of local and global steps (thesis section 7.3.1, "Final algorithm").

use glam::{Affine3A, Vec3};

use super::constraint::HandleConstraint;
use super::factor_steps::FactorSteps;
use super::given::{Given, Source, value_of};
use super::inverse_steps::InverseSteps;
use super::local_step::Solved;
use super::reduction::Reduction;
use super::report::{ArapOutcome, ArapReport, ArapStop, ArapWarnings};
use super::state::State;
use super::system::{Solver, System};
use crate::lanes::widest;

/// Targets farther away than this many model sizes, or larger than this in a linear part, are not followed.
const FAR: f32 = 1e6;
/// A miss smaller than this fraction of the model's size (and of the distance moved) is rounding.
const MISSED: f64 = 1e-5;

/// Where the given parts have to go.
#[derive(Clone, Copy)]
pub(super) struct Targets<'a> {
    /// One per handle.
    pub(super) handles: &'a [Affine3A],
    /// One per anchor.
    pub(super) anchors: &'a [Vec3],
}

/// Applies the targets and solves for the rest of the transformations, by local and global steps from the previous
/// frame.
pub(super) fn local_global(
    reduction: &Reduction,
    system: &System,
    state: &mut State,
    targets: Targets<'_>,
    stop: ArapStop,
) -> ArapReport {
    let given = &system.given;
    let mut warnings = ArapWarnings { undetermined: 3 * given.undetermined, ..ArapWarnings::default() };
    warnings.unusable_targets = take_targets(reduction, given, state, targets);
    set_known(reduction, given, state);
    let Solved { iterations, change, energy } = match &system.solver {
        Solver::Inverse(inverse) => widest(InverseSteps { reduction, given, inverse, state, stop }),
        Solver::Factor(factor) => widest(FactorSteps { reduction, given, factor, state, stop }),
    };
    warnings.contradiction = contradiction(reduction, given, state);
    write_transforms(reduction, state);
    let outcome = if change <= stop.tolerance {
        ArapOutcome::Converged { change }
    } else {
        ArapOutcome::IterationLimit { change }
    };
    ArapReport { outcome, iterations, energy, warnings }
}

/// Replaces the stored targets with usable new ones; returns how many were unusable.
fn take_targets(reduction: &Reduction, given: &Given, state: &mut State, targets: Targets<'_>) -> usize {
    let mut unusable = 0;
    let reach = FAR * (reduction.size as f32).max(f32::MIN_POSITIVE);
    let near = |point: Vec3| {
        let centre = Vec3::from_array(reduction.centre.map(|c| c as f32));
        (point - centre).abs().max_element() <= reach && point.is_finite()
    };
    let calm = |target: &Affine3A| {
        let m = target.matrix3;
        [m.x_axis, m.y_axis, m.z_axis].iter().all(|c| c.is_finite() && c.abs().max_element() <= FAR)
    };
    for (handle, (stored, target)) in state.ends.handle_targets.iter_mut().zip(targets.handles).enumerate() {
        let point = Vec3::from_array(reduction.handle_points[handle].map(|c| c as f32));
        let usable = match given.constraints[handle] {
            HandleConstraint::Free => continue,
            HandleConstraint::Position => near(target.transform_point3(point)),
            HandleConstraint::Orientation => calm(target),
            HandleConstraint::Full => calm(target) && near(target.transform_point3(point)),
        };
        if usable {
            *stored = *target;
        } else {
            unusable += 1;
        }
    }
    for (stored, target) in state.ends.anchor_targets.iter_mut().zip(targets.anchors) {
        if near(*target) {
            *stored = *target;
        } else {
            unusable += 1;
        }
    }
    unusable
}

/// The given rows of `T`, and the right-hand sides of the equations.
fn set_known(reduction: &Reduction, given: &Given, state: &mut State) {
    for &row in &given.known {
        let (handle, part) = (row / 4, row % 4);
        let given = matches!(given.constraints[handle], HandleConstraint::Full | HandleConstraint::Orientation);
        let target = if given { state.ends.handle_targets[handle] } else { Affine3A::IDENTITY };
        let linear = target.matrix3;
        let value = if part < 3 {
            linear.col(part).as_dvec3().to_array()
        } else {
            let moved = linear.as_dmat3() * glam::DVec3::from(reduction.centre) + target.translation.as_dvec3();
            reduction.normalised(moved.to_array())
        };
        (0..3).for_each(|axis| state.maps.transposed[axis][row] = value[axis]);
    }
    for (number, equation) in given.equations.iter().enumerate() {
        let value = match equation.source {
            Source::Handle(handle) => {
                let point = glam::DVec3::from(reduction.handle_points[handle]);
                let target = state.ends.handle_targets[handle];
                let moved = target.matrix3.as_dmat3() * point + target.translation.as_dvec3();
                reduction.normalised(moved.to_array())
            }
            Source::Anchor(number) => reduction.normalised(state.ends.anchor_targets[number].as_dvec3().to_array()),
            Source::Joint => [0.0; 3],
            Source::Rest(rest) => rest,
        };
        (0..3).for_each(|axis| state.maps.right[axis][number] = value[axis]);
    }
    for (number, spring) in given.springs.iter().enumerate() {
        let at = reduction.normalised(state.ends.anchor_targets[spring.anchor].as_dvec3().to_array());
        (0..3).for_each(|axis| {
            state.maps.pulled[axis][number] = if reduction.planar && axis == 2 { 0.0 } else { at[axis] }
        });
    }
    if reduction.planar {
        // Flat shapes stay in their plane whatever the targets say.
        for &row in &given.known {
            state.maps.transposed[2][row] = if row % 4 == 2 { 1.0 } else { 0.0 };
        }
        for (number, equation) in given.equations.iter().enumerate() {
            if !matches!(equation.source, Source::Rest(_)) {
                state.maps.right[2][number] = 0.0;
            }
        }
    }
}

fn contradiction(reduction: &Reduction, given: &Given, state: &State) -> Option<f64> {
    let mut worst = 0.0_f64;
    for (number, equation) in given.equations.iter().enumerate() {
        if matches!(equation.source, Source::Rest(_)) {
            continue;
        }
        let met = value_of(&equation.terms, &state.maps.transposed);
        let missed = (0..3).map(|axis| (met[axis] - state.maps.right[axis][number]).powi(2)).sum::<f64>().sqrt();
        let far = (0..3).fold(1.0_f64, |far, axis| far.max(state.maps.right[axis][number].abs()));
        if missed > MISSED * far {
            worst = worst.max(missed);
        }
    }
    (worst > 0.0).then_some(worst * reduction.size)
}

fn write_transforms(reduction: &Reduction, state: &mut State) {
    let t = &state.maps.transposed;
    for (handle, out) in state.ends.transforms.iter_mut().enumerate() {
        let row =
            |part: usize| glam::DVec3::new(t[0][4 * handle + part], t[1][4 * handle + part], t[2][4 * handle + part]);
        let linear = glam::DMat3::from_cols(row(0), row(1), row(2));
        let centre = glam::DVec3::from(reduction.centre);
        let translation = row(3) * reduction.size + centre - linear * centre;
        *out = Affine3A { matrix3: linear.as_mat3().into(), translation: translation.as_vec3().into() };
    }
}
