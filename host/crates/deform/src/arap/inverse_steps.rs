//! Local and global steps with an inverse (thesis section 7.3.1, "Final algorithm").
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use super::given::Given;
use super::inverse::Inverse;
use super::local_step::{Solved, hold_upright, largest_change};
use super::reduction::{Reduction, WithZeros};
use super::report::ArapStop;
use super::state::{State, Turns};
use crate::dense::dot_three;
use crate::lanes::{Kernel, LANES, Matrices};
use crate::nearest_rotation::nearest_rotations_inlined;

pub(super) struct InverseSteps<'a> {
    pub(super) reduction: &'a Reduction,
    pub(super) given: &'a Given,
    pub(super) inverse: &'a Inverse,
    pub(super) state: &'a mut State,
    pub(super) stop: ArapStop,
}

impl Kernel for InverseSteps<'_> {
    type Output = Solved;

    #[inline(always)]
    fn run(self) -> Solved {
        let Self { reduction, given, inverse, state, stop } = self;
        let Some(with_zeros) = &reduction.with_zeros else {
            return Solved { iterations: 0, change: 0.0, energy: reduction.constant };
        };
        set_base(reduction, with_zeros, given, inverse, state);
        let (iterations, change) = steps(reduction, inverse, state, stop);
        finish(given, inverse, state);
        Solved { iterations, change, energy: energy(reduction, with_zeros, given, state) }
    }
}

/// What `T` and the covariances would be without rotations.
#[inline(always)]
fn set_base(reduction: &Reduction, with_zeros: &WithZeros, given: &Given, inverse: &Inverse, state: &mut State) {
    for axis in 0..3 {
        for (given, &row) in state.maps.given[axis].iter_mut().zip(&given.known) {
            *given = state.maps.transposed[axis][row];
        }
    }
    let [x, y, z] = &state.maps.right;
    let right = [x, y, z].map(|column| &column[..given.equations.len()]);
    for (i, &row) in given.open.iter().enumerate() {
        let fixed = dot_three(inverse.targets_to_open.row(i), right);
        let from_known = dot_three(inverse.known_to_open.row(i), slices(&state.maps.given));
        let pushed = inverse.force_to_open.as_ref().map(|push| dot_three(push.row(i), slices(&state.maps.force)));
        for axis in 0..3 {
            state.maps.base[axis][row] = fixed[axis] - from_known[axis] + pushed.map_or(0.0, |pushed| pushed[axis]);
        }
    }
    if !given.springs.is_empty() {
        let springs = given.springs.len();
        for (i, &row) in given.open.iter().enumerate() {
            let [x, y, z] = &state.maps.pulled;
            let pulled = dot_three(inverse.springs_to_open.row(i), [x, y, z].map(|column| &column[..springs]));
            (0..3).for_each(|axis| state.maps.base[axis][row] += pulled[axis]);
        }
    }
    for axis in 0..3 {
        for &row in &given.known {
            state.maps.base[axis][row] = state.maps.transposed[axis][row];
        }
    }
    for cluster in 0..reduction.cluster_count {
        for rest in 0..3 {
            let values = dot_three(with_zeros.covariance.row(3 * cluster + rest), slices(&state.maps.base));
            for axis in 0..3 {
                state.turns.still[cluster / LANES][rest][axis][cluster % LANES] = values[axis] as f32;
            }
        }
    }
    if !reduction.cluster_count.is_multiple_of(LANES) {
        // Lanes without a cluster ask for the identity, which takes no iterations.
        let last = state.turns.still.len() - 1;
        for lane in reduction.cluster_count % LANES..LANES {
            for rest in 0..3 {
                for axis in 0..3 {
                    state.turns.still[last][rest][axis][lane] = if rest == axis { 1.0 } else { 0.0 };
                }
            }
        }
    }
}

/// Local and global steps; returns how many, and the largest change in the last one.
#[inline(always)]
fn steps(reduction: &Reduction, inverse: &Inverse, state: &mut State, stop: ArapStop) -> (usize, f32) {
    let Turns { rotations, turned, covariances, still, .. } = &mut state.turns;
    let columns = inverse.rotations_to_open.columns;
    let mut change = f32::INFINITY;
    for step in 0..stop.iterations {
        for (block, out) in turned.iter_mut().enumerate() {
            let panel = &inverse.panels[block * columns..(block + 1) * columns];
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

/// The last global step, written out: `T = Γ Rᵀ + base`.
#[inline(always)]
fn finish(given: &Given, inverse: &Inverse, state: &mut State) {
    for axis in 0..3 {
        for (cluster, three) in state.turns.wide[axis].as_chunks_mut::<3>().0.iter_mut().enumerate() {
            for rest in 0..3 {
                three[rest] = f64::from(state.turns.rotations[cluster / LANES][rest][axis][cluster % LANES]);
            }
        }
    }
    for (i, &row) in given.open.iter().enumerate() {
        let turned = dot_three(inverse.rotations_to_open.row(i), slices(&state.turns.wide));
        for axis in 0..3 {
            state.maps.transposed[axis][row] = state.maps.base[axis][row] + turned[axis];
        }
    }
}

#[inline(always)]
fn slices(columns: &[Vec<f64>; 3]) -> [&[f64]; 3] {
    [&columns[0], &columns[1], &columns[2]]
}

/// `½ tr(Tᵀ L̃ T) − tr(R K̃ T)` plus the constant, and what springs add.
#[inline(always)]
fn energy(reduction: &Reduction, with_zeros: &WithZeros, given: &Given, state: &State) -> f64 {
    let mut sum = reduction.constant;
    let t = slices(&state.maps.transposed);
    for row in 0..with_zeros.stiffness.rows {
        let pulled = dot_three(with_zeros.stiffness.row(row), t);
        for axis in 0..3 {
            sum += 0.5 * t[axis][row] * pulled[axis];
        }
    }
    for row in 0..with_zeros.covariance.rows {
        let covariance = dot_three(with_zeros.covariance.row(row), t);
        for axis in 0..3 {
            sum -= state.turns.wide[axis][row] * covariance[axis];
        }
    }
    sum += given.energy_of_springs(&state.maps.transposed, &state.maps.pulled);
    sum * reduction.energy_unit
}
