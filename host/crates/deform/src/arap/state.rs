//! What a solve changes: rotations, transformations and the last usable targets.

use glam::{Affine3A, Vec3};

use super::reduction::Reduction;
use super::system::{Solver, System};
use crate::lanes::{LANES, Matrices};

/// What a solve changes.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) turns: Turns,
    pub(super) maps: Maps,
    pub(super) ends: Ends,
}

/// The rotations of the clusters.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    /// Transposed, eight per block, before and after a local step.
    pub(super) rotations: Vec<Matrices>,
    pub(super) turned: Vec<Matrices>,
    /// What the rotations are fitted to.
    pub(super) covariances: Vec<Matrices>,
    /// The part of the covariances that stays constant while the rotations are sought.
    pub(super) still: Vec<Matrices>,
    /// The rotations at the end of a solve, 3r per coordinate.
    pub(super) wide: [Vec<f64>; 3],
}

/// The transformations of the handles, normalised, and what they follow from.
#[derive(Clone, Debug)]
pub(super) struct Maps {
    /// 4m values for each axis of stacked transposed transformations.
    pub(super) transposed: [Vec<f64>; 3],
    pub(super) base: [Vec<f64>; 3],
    pub(super) right: [Vec<f64>; 3],
    /// Where springs are pulled to.
    pub(super) pulled: [Vec<f64>; 3],
    /// The force on each row of `transposed`, for a shape that moves on its own.
    pub(super) force: [Vec<f64>; 3],
    /// The given rows of `transposed`, side by side.
    pub(super) given: [Vec<f64>; 3],
    /// For a global step by a factor: `T` row by row, the unknowns, and their right-hand side without rotations.
    pub(super) stacked: Vec<[f64; 4]>,
    pub(super) unknowns: Vec<[f64; 4]>,
    pub(super) fixed: Vec<[f64; 4]>,
}

/// What goes in and what comes out.
#[derive(Clone, Debug)]
pub(super) struct Ends {
    /// The last usable targets.
    pub(super) handle_targets: Vec<Affine3A>,
    pub(super) anchor_targets: Vec<Vec3>,
    pub(super) transforms: Vec<Affine3A>,
}

const IDENTITIES: Matrices = {
    const ZERO: [f32; LANES] = [0.0; LANES];
    const ONE: [f32; LANES] = [1.0; LANES];
    [[ONE, ZERO, ZERO], [ZERO, ONE, ZERO], [ZERO, ZERO, ONE]]
};

impl State {
    /// At rest.
    pub(super) fn new(reduction: &Reduction) -> Self {
        let rows = 4 * reduction.handle_count;
        let column = |length| [vec![0.0; length], vec![0.0; length], vec![0.0; length]];
        let turns = Turns {
            rotations: Vec::new(),
            turned: Vec::new(),
            covariances: Vec::new(),
            still: Vec::new(),
            wide: column(0),
        };
        let maps = Maps {
            transposed: column(rows),
            base: column(rows),
            right: column(0),
            pulled: column(0),
            force: column(rows),
            given: column(0),
            stacked: Vec::new(),
            unknowns: Vec::new(),
            fixed: Vec::new(),
        };
        let ends = Ends {
            handle_targets: vec![Affine3A::IDENTITY; reduction.handle_count],
            anchor_targets: Vec::new(),
            transforms: vec![Affine3A::IDENTITY; reduction.handle_count],
        };
        let mut state = Self { turns, maps, ends };
        state.make_room_for(reduction.cluster_count);
        state.restart();
        state
    }

    /// Back to the rest pose.
    pub(super) fn restart(&mut self) {
        for (axis, column) in self.maps.transposed.iter_mut().enumerate() {
            column.iter_mut().enumerate().for_each(|(row, entry)| *entry = f64::from(u8::from(row % 4 == axis)));
        }
        self.turns.rotations.fill(IDENTITIES);
    }

    /// Sets a force towards `ahead`, and one that resists every change.
    pub(super) fn pull(&mut self, reduction: &Reduction, ahead: &[Vec<f64>; 3]) {
        let viscosity = reduction.viscosity();
        for axis in 0..3 {
            match &reduction.with_zeros {
                Some(with_zeros) => with_zeros.closeness.times_vector(&ahead[axis], &mut self.maps.force[axis]),
                None => reduction.closeness.times_vector(&ahead[axis], &mut self.maps.force[axis]),
            }
            let now = self.maps.force[axis].iter_mut().zip(&self.maps.transposed[axis]);
            now.for_each(|(force, now)| *force += viscosity * now);
        }
    }

    /// Grows to the size of a system's inputs and outputs. Never shrinks, so that alternating systems allocate nothing.
    pub(super) fn make_room_for_system(&mut self, system: &System) {
        let equations = system.given.equations.len().max(self.maps.right[0].len());
        self.maps.right.iter_mut().for_each(|column| column.resize(equations, 0.0));
        self.maps.given.iter_mut().for_each(|column| column.resize(system.given.known.len(), 0.0));
        let springs = system.given.springs.len().max(self.maps.pulled[0].len());
        self.maps.pulled.iter_mut().for_each(|column| column.resize(springs, 0.0));
        if let Solver::Factor(factor) = &system.solver {
            self.maps.stacked.resize(self.maps.transposed[0].len(), [0.0; 4]);
            self.maps.unknowns.resize(factor.blocks.size(), [0.0; 4]);
            self.maps.fixed.resize(factor.blocks.size(), [0.0; 4]);
        }
    }

    /// Grows to `clusters` rotations; new ones are the identity.
    pub(super) fn make_room_for(&mut self, clusters: usize) {
        let blocks = clusters.div_ceil(LANES);
        for matrices in
            [&mut self.turns.rotations, &mut self.turns.turned, &mut self.turns.covariances, &mut self.turns.still]
        {
            matrices.resize(blocks, IDENTITIES);
        }
        for lane in clusters..blocks * LANES {
            for (row, columns) in self.turns.rotations[lane / LANES].iter_mut().enumerate() {
                for (column, entry) in columns.iter_mut().enumerate() {
                    entry[lane % LANES] = if row == column { 1.0 } else { 0.0 };
                }
            }
        }
        self.turns.wide.iter_mut().for_each(|column| column.resize(3 * clusters, 0.0));
    }
}
