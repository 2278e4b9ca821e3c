//! The loop of local and global steps (thesis section 7.3.1, "Final algorithm").
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use glam::{Affine3A, Vec3};

use super::constraint::HandleConstraint;
use super::reduction::Reduction;
use super::report::{ArapOutcome, ArapReport, ArapStop, ArapWarnings};
use super::state::State;
use super::system::{Source, System};
use crate::dense::dot_three;
use crate::lanes::{Kernel, LANES, Matrices, widest};
use crate::nearest_rotation::nearest_rotations_inlined;

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
    let mut warnings = ArapWarnings { undetermined: 3 * system.undetermined, ..ArapWarnings::default() };
    warnings.unusable_targets = take_targets(reduction, system, state, targets);
    set_known(reduction, system, state);
    let Solved { iterations, change, energy } = widest(Solve { reduction, system, state, stop });
    warnings.contradiction = contradiction(reduction, system, state);
    write_transforms(reduction, state);
    let outcome = if change <= stop.tolerance {
        ArapOutcome::Converged { change }
    } else {
        ArapOutcome::IterationLimit { change }
    };
    ArapReport { outcome, iterations, energy, warnings }
}

/// Replaces the stored targets with usable new ones; returns how many were unusable.
fn take_targets(reduction: &Reduction, system: &System, state: &mut State, targets: Targets<'_>) -> usize {
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
    for (handle, (stored, target)) in state.handle_targets.iter_mut().zip(targets.handles).enumerate() {
        let point = Vec3::from_array(reduction.handle_points[handle].map(|c| c as f32));
        let usable = match system.constraints[handle] {
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
    for (stored, target) in state.anchor_targets.iter_mut().zip(targets.anchors) {
        if near(*target) {
            *stored = *target;
        } else {
            unusable += 1;
        }
    }
    unusable
}

/// The given rows of `T`, and the right-hand sides of the equations.
fn set_known(reduction: &Reduction, system: &System, state: &mut State) {
    for &row in &system.known {
        let (handle, part) = (row / 4, row % 4);
        let given = matches!(system.constraints[handle], HandleConstraint::Full | HandleConstraint::Orientation);
        let target = if given { state.handle_targets[handle] } else { Affine3A::IDENTITY };
        let linear = target.matrix3;
        let value = if part < 3 {
            linear.col(part).as_dvec3().to_array()
        } else {
            let moved = linear.as_dmat3() * glam::DVec3::from(reduction.centre) + target.translation.as_dvec3();
            reduction.normalised(moved.to_array())
        };
        (0..3).for_each(|axis| state.transposed[axis][row] = value[axis]);
    }
    for (equation, source) in system.sources.iter().enumerate() {
        let value = match *source {
            Source::Handle(handle) => {
                let point = glam::DVec3::from(reduction.handle_points[handle]);
                let target = state.handle_targets[handle];
                let moved = target.matrix3.as_dmat3() * point + target.translation.as_dvec3();
                reduction.normalised(moved.to_array())
            }
            Source::Anchor(number) => reduction.normalised(state.anchor_targets[number].as_dvec3().to_array()),
            Source::Joint => [0.0; 3],
            Source::Rest(rest) => rest,
        };
        (0..3).for_each(|axis| state.right[axis][equation] = value[axis]);
    }
    for (spring, &anchor) in system.springs.anchors.iter().enumerate() {
        let at = reduction.normalised(state.anchor_targets[anchor].as_dvec3().to_array());
        (0..3).for_each(|axis| state.pulled[axis][spring] = if reduction.planar && axis == 2 { 0.0 } else { at[axis] });
    }
    if reduction.planar {
        // Flat shapes stay in their plane whatever the targets say.
        for &row in &system.known {
            state.transposed[2][row] = if row % 4 == 2 { 1.0 } else { 0.0 };
        }
        for (equation, source) in system.sources.iter().enumerate() {
            if !matches!(source, Source::Rest(_)) {
                state.right[2][equation] = 0.0;
            }
        }
    }
}

/// What `T` and the covariances would be without rotations.
#[inline(always)]
fn set_base(reduction: &Reduction, system: &System, state: &mut State) {
    for axis in 0..3 {
        for (given, &row) in state.given[axis].iter_mut().zip(&system.known) {
            *given = state.transposed[axis][row];
        }
    }
    let [x, y, z] = &state.right;
    let right = [x, y, z].map(|column| &column[..system.equations.rows]);
    for (i, &row) in system.open.iter().enumerate() {
        let fixed = dot_three(system.targets_to_open.row(i), right);
        let from_known = dot_three(system.known_to_open.row(i), slices(&state.given));
        let pushed = system.force_to_open.as_ref().map(|push| dot_three(push.row(i), slices(&state.force)));
        for axis in 0..3 {
            state.base[axis][row] = fixed[axis] - from_known[axis] + pushed.map_or(0.0, |pushed| pushed[axis]);
        }
    }
    if !system.springs.anchors.is_empty() {
        let springs = system.springs.anchors.len();
        for (i, &row) in system.open.iter().enumerate() {
            let [x, y, z] = &state.pulled;
            let pulled = dot_three(system.springs.to_open.row(i), [x, y, z].map(|column| &column[..springs]));
            (0..3).for_each(|axis| state.base[axis][row] += pulled[axis]);
        }
    }
    for axis in 0..3 {
        for &row in &system.known {
            state.base[axis][row] = state.transposed[axis][row];
        }
    }
    for cluster in 0..reduction.cluster_count {
        for rest in 0..3 {
            let values = dot_three(reduction.covariance.row(3 * cluster + rest), slices(&state.base));
            for axis in 0..3 {
                state.still[cluster / LANES][rest][axis][cluster % LANES] = values[axis] as f32;
            }
        }
    }
    if !reduction.cluster_count.is_multiple_of(LANES) {
        // Lanes without a cluster ask for the identity, which takes no iterations.
        let last = state.still.len() - 1;
        for lane in reduction.cluster_count % LANES..LANES {
            for rest in 0..3 {
                for axis in 0..3 {
                    state.still[last][rest][axis][lane] = if rest == axis { 1.0 } else { 0.0 };
                }
            }
        }
    }
}

struct Solve<'a> {
    reduction: &'a Reduction,
    system: &'a System,
    state: &'a mut State,
    stop: ArapStop,
}

struct Solved {
    iterations: usize,
    /// The largest change of a rotation in the last step.
    change: f32,
    energy: f64,
}

impl Kernel for Solve<'_> {
    type Output = Solved;

    #[inline(always)]
    fn run(self) -> Solved {
        let Self { reduction, system, state, stop } = self;
        set_base(reduction, system, state);
        let (iterations, change) = steps(reduction, system, state, stop);
        finish(system, state);
        Solved { iterations, change, energy: energy(reduction, system, state) }
    }
}

/// Local and global steps; returns how many, and the largest change in the last one.
#[inline(always)]
fn steps(reduction: &Reduction, system: &System, state: &mut State, stop: ArapStop) -> (usize, f32) {
    let State { rotations, turned, covariances, still, .. } = state;
    let columns = system.rotations_to_open.columns;
    let mut change = f32::INFINITY;
    for step in 0..stop.iterations {
        for (block, out) in turned.iter_mut().enumerate() {
            let panel = &system.panels[block * columns..(block + 1) * columns];
            covariances[block] = covariances_of(panel, &still[block], rotations);
            if reduction.planar {
                hold_upright(&mut covariances[block]);
            }
            *out = nearest_rotations_inlined(&covariances[block]);
        }
        reduction.limits.iter().for_each(|pair| pair.hold(covariances, rotations, turned));
        change = 0.0;
        for (now, before) in turned.iter().zip(&*rotations) {
            change = change.max(largest_change(now, before));
        }
        std::mem::swap(rotations, turned);
        if change <= stop.tolerance {
            return (step + 1, change);
        }
    }
    (stop.iterations, change)
}

/// `S = K̃ (Γ Rᵀ + base)` for eight clusters: the global step and the linear half of the local one together.
#[inline(always)]
fn covariances_of(panel: &[[[f32; LANES]; 3]], still: &Matrices, rotations: &[Matrices]) -> Matrices {
    let mut sums = *still;
    let mut columns = panel.iter();
    'all: for block in rotations {
        for lane in 0..LANES {
            for row in block {
                let Some(column) = columns.next() else { break 'all };
                for axis in 0..3 {
                    let factor = row[axis][lane];
                    for rest in 0..3 {
                        for l in 0..LANES {
                            sums[rest][axis][l] += column[rest][l] * factor;
                        }
                    }
                }
            }
        }
    }
    sums
}

/// Makes flipping a flat shape over cost more than any reflection in the plane gains.
#[inline(always)]
fn hold_upright(covariances: &mut Matrices) {
    for l in 0..LANES {
        let [[a, b, _], [c, d, _], _] = covariances.map(|row| row.map(|entry| entry[l]));
        covariances[2][2][l] = a.abs() + b.abs() + c.abs() + d.abs();
    }
}

#[inline(always)]
fn largest_change(a: &Matrices, b: &Matrices) -> f32 {
    let mut change = [0.0_f32; LANES];
    for row in 0..3 {
        for column in 0..3 {
            for l in 0..LANES {
                change[l] = change[l].max((a[row][column][l] - b[row][column][l]).abs());
            }
        }
    }
    change.into_iter().fold(0.0, f32::max)
}

/// The last global step, written out: `T = Γ Rᵀ + base`.
#[inline(always)]
fn finish(system: &System, state: &mut State) {
    for axis in 0..3 {
        for (cluster, three) in state.wide[axis].as_chunks_mut::<3>().0.iter_mut().enumerate() {
            for rest in 0..3 {
                three[rest] = f64::from(state.rotations[cluster / LANES][rest][axis][cluster % LANES]);
            }
        }
    }
    for (i, &row) in system.open.iter().enumerate() {
        let turned = dot_three(system.rotations_to_open.row(i), slices(&state.wide));
        for axis in 0..3 {
            state.transposed[axis][row] = state.base[axis][row] + turned[axis];
        }
    }
}

#[inline(always)]
fn slices(columns: &[Vec<f64>; 3]) -> [&[f64]; 3] {
    [&columns[0], &columns[1], &columns[2]]
}

fn contradiction(reduction: &Reduction, system: &System, state: &State) -> Option<f64> {
    let mut worst = 0.0_f64;
    for (equation, source) in system.sources.iter().enumerate() {
        if matches!(source, Source::Rest(_)) {
            continue;
        }
        let met = dot_three(system.equations.row(equation), slices(&state.transposed));
        let missed = (0..3).map(|axis| (met[axis] - state.right[axis][equation]).powi(2)).sum::<f64>().sqrt();
        let far = (0..3).fold(1.0_f64, |far, axis| far.max(state.right[axis][equation].abs()));
        if missed > MISSED * far {
            worst = worst.max(missed);
        }
    }
    (worst > 0.0).then_some(worst * reduction.size)
}

/// `½ tr(Tᵀ L̃ T) − tr(R K̃ T)` plus the constant, and what soft anchors add.
#[inline(always)]
fn energy(reduction: &Reduction, system: &System, state: &State) -> f64 {
    let mut sum = reduction.constant;
    let t = slices(&state.transposed);
    for row in 0..reduction.stiffness.rows {
        let pulled = dot_three(reduction.stiffness.row(row), t);
        for axis in 0..3 {
            sum += 0.5 * t[axis][row] * pulled[axis];
        }
    }
    for row in 0..reduction.covariance.rows {
        let covariance = dot_three(reduction.covariance.row(row), t);
        for axis in 0..3 {
            sum -= state.wide[axis][row] * covariance[axis];
        }
    }
    for (spring, strength) in system.springs.strengths.iter().enumerate() {
        let at = dot_three(system.springs.rows.row(spring), t);
        let miss: f64 = (0..3).map(|axis| (at[axis] - state.pulled[axis][spring]).powi(2)).sum();
        sum += 0.5 * strength * miss;
    }
    sum * reduction.energy_unit
}

fn write_transforms(reduction: &Reduction, state: &mut State) {
    let t = &state.transposed;
    for (handle, out) in state.transforms.iter_mut().enumerate() {
        let row =
            |part: usize| glam::DVec3::new(t[0][4 * handle + part], t[1][4 * handle + part], t[2][4 * handle + part]);
        let linear = glam::DMat3::from_cols(row(0), row(1), row(2));
        let centre = glam::DVec3::from(reduction.centre);
        let translation = row(3) * reduction.size + centre - linear * centre;
        *out = Affine3A { matrix3: linear.as_mat3().into(), translation: translation.as_vec3().into() };
    }
}
