//! Fast automatic skinning transformations: as-rigid-as-possible energies minimised over the transformations of
//! skinning handles (thesis chapter 7).

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::arap_constraints::System;
use crate::arap_dynamics::Motion;
use crate::arap_energy::ArapEnergy;
use crate::arap_reduction::{Reduction, reduce};
use crate::arap_soft_joints::SoftJoint;
use crate::nearest_rotation::{LANES, Matrices};

/// A shape with its handles at rest.
#[derive(Clone, Copy, Debug)]
pub struct ArapShape<'a> {
    /// n×3 rest positions (mesh units); for a volume all of its vertices, not only those of its surface.
    pub positions: &'a [[f64; 3]],
    /// Its elements, and which of their edges share a rotation.
    pub energy: ArapEnergy<'a>,
    /// n×m weights, row by row. Those of a character's own handles sum to one a row; additional ones need not.
    pub weights: &'a [f64],
    /// m×3: where a handle whose position is given is held, a point or a bone's end (mesh units, at rest).
    pub handle_points: &'a [[f64; 3]],
    /// Where two handles stay together, such as bones that meet in a joint.
    pub joints: &'a [SharedJoint],
}

/// A point that two handles have to agree on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedJoint {
    /// The two zero-based handles.
    pub handles: [usize; 2],
    /// Where they meet at rest (mesh units).
    pub point: [f64; 3],
}

/// How a shape is reduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArapSettings {
    /// How many rotations are told apart; `None` is two a handle, as the thesis found enough.
    ///
    /// More than the shape has edge sets (its elements, or its vertices for the spokes' energies) are as many. Memory
    /// and the time of an iteration grow with the square: more than [`MOST_CLUSTERS`] are an error.
    pub clusters: Option<usize>,
    /// Start of the clustering's random numbers.
    pub seed: u64,
}

/// The most rotations a shape may tell apart: at this number its matrices take half a gigabyte.
pub const MOST_CLUSTERS: usize = 2048;

impl Default for ArapSettings {
    fn default() -> Self {
        Self { clusters: None, seed: 1 }
    }
}

/// What is known about a handle; the rest of its transformation is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HandleConstraint {
    /// Nothing (green in the thesis).
    #[default]
    Free,
    /// Where its handle point goes (yellow).
    Position,
    /// How it is turned (and scaled); its translation is solved.
    Orientation,
    /// The whole transformation (red).
    Full,
}

/// A point of the deformed shape that can be held: a blend of up to three vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Zero-based vertices.
    pub vertices: [u32; 3],
    /// Their barycentric coordinates.
    pub barycentric: [f64; 3],
}

/// When a solve ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapStop {
    /// Local and global steps at most. The thesis takes 15 a frame, warm started.
    pub iterations: usize,
    /// Ends earlier when no entry of a rotation has changed by more than this in a step; 0 never does.
    pub tolerance: f32,
}

impl Default for ArapStop {
    fn default() -> Self {
        Self { iterations: 15, tolerance: 1e-5 }
    }
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArapOutcome {
    /// The rotations stand still; the largest change of an entry in the last step.
    Converged {
        /// Largest change of an entry of a rotation in the last step.
        change: f32,
    },
    /// The iterations were used up; the next frame carries on from here.
    IterationLimit {
        /// Largest change of an entry of a rotation in the last step.
        change: f32,
    },
}

/// What was odd about a solve; its result is finite all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArapWarnings {
    /// How many targets were ignored for being NaN, infinite or further than a million model sizes away: the last
    /// good target of each was used.
    pub unusable_targets: usize,
    /// The largest distance by which a target or joint was missed, where targets contradict each other (mesh units).
    pub contradiction: Option<f64>,
    /// Degrees of freedom that no constraint and no stiffness decides, such as 3 for a shape whose position is given
    /// nowhere and 12 for a handle without weight. They are kept as close to the rest pose as the others allow.
    pub undetermined: usize,
}

/// The account of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapReport {
    /// How it ended.
    pub outcome: ArapOutcome,
    /// Steps taken.
    pub iterations: usize,
    /// The energy of eq. 7.4 with clustered rotations, for the rest shape's own units: length² for surfaces and
    /// planar shapes, length³ for volumes. Never rises over the steps of a solve.
    pub energy: f64,
    /// What was odd.
    pub warnings: ArapWarnings,
}

/// Why a shape cannot be reduced or solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArapError {
    /// There are no vertices, no elements or no handles.
    #[error("the shape has no {what}")]
    Empty {
        /// Which of them.
        what: &'static str,
    },
    /// Two arrays that have to agree in length do not.
    #[error("{what}: {got} given, {expected} needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it has to have.
        expected: usize,
    },
    /// An element names a vertex that is not there.
    #[error("element {element} names vertex {vertex}, but there are only {vertex_count} vertices")]
    VertexOutOfRange {
        /// Zero-based element (or anchor).
        element: usize,
        /// The offending zero-based vertex.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A joint names a handle that is not there.
    #[error("joint {joint} names handle {handle}, but there are only {handle_count} handles")]
    HandleOutOfRange {
        /// Zero-based joint.
        joint: usize,
        /// The offending zero-based handle.
        handle: usize,
        /// How many handles there are.
        handle_count: usize,
    },
    /// A number is NaN, infinite or beyond 1e30.
    #[error("{what} {index} holds a number that is not finite or beyond 1e30")]
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Zero-based row.
        index: usize,
    },
    /// A vertex follows no handle and would fall to the origin.
    #[error("vertex {vertex} has no weight on any handle")]
    Unweighted {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A soft joint has a stiffness or strength below 0 or above 10,000, or a limit that does not hold the rest pose or
    /// is no number.
    #[error(
        "soft joint {joint} cannot be used: stiffness and strength are from 0 to 10,000, a swing from 0 to π, twists from -π to 0 and from 0 to π"
    )]
    UnusableSoftJoint {
        /// Zero-based soft joint.
        joint: usize,
    },
    /// More rotations were to be told apart than memory is meant for.
    #[error("{clusters} rotations were to be told apart, more than {MOST_CLUSTERS}; set `clusters` to fewer")]
    TooManyClusters {
        /// How many the settings and the shape come to.
        clusters: usize,
    },
    /// The progress callback asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Beyond this, squares of differences leave the range in which they can be told apart from infinity in `f32` output.
const LARGEST: f64 = 1e30;

/// A shape reduced to the transformations of its handles, ready to be solved every frame.
///
/// Built once ([`precompute`](Self::precompute), `f64`), switched between sets of constraints now and then
/// ([`constrain`](Self::constrain), a fraction of a millisecond at 23 bones) and solved every frame
/// ([`solve`](Self::solve), `f32`, no allocation, starting from the frame before).
///
/// A clone is another character of the same shape with a pose of its own: it shares what was precomputed, and the
/// constraints until it switches to others. A crowd of clones stays in the processor's cache.
#[derive(Clone, Debug)]
pub struct ReducedArap {
    pub(crate) reduction: Arc<Reduction>,
    /// Without soft joints.
    bare: Arc<Reduction>,
    pub(crate) system: Arc<System>,
    pub(crate) state: State,
    pub(crate) motion: Motion,
    /// Those of the last [`constrain`](Self::constrain).
    pub(crate) anchors: Vec<Anchor>,
}

/// What a solve changes.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// Transposed rotations of the clusters, eight a block, before and after a local step.
    pub(crate) rotations: Vec<Matrices>,
    pub(crate) turned: Vec<Matrices>,
    /// What the rotations are fitted to.
    pub(crate) covariances: Vec<Matrices>,
    /// The part of the covariances that stands still while the rotations are sought.
    pub(crate) still: Vec<Matrices>,
    /// 4m values for each axis of stacked transposed transformations, normalised.
    pub(crate) transposed: [Vec<f64>; 3],
    pub(crate) base: [Vec<f64>; 3],
    pub(crate) right: [Vec<f64>; 3],
    /// What pulls at each row of `transposed`, where the shape moves by itself.
    pub(crate) force: [Vec<f64>; 3],
    /// The given rows of `transposed`, side by side.
    pub(crate) given: [Vec<f64>; 3],
    /// The rotations at the end of a solve, 3r a coordinate.
    pub(crate) wide: [Vec<f64>; 3],
    /// The last usable targets.
    pub(crate) handle_targets: Vec<Affine3A>,
    pub(crate) anchor_targets: Vec<Vec3>,
    pub(crate) transforms: Vec<Affine3A>,
}

impl ReducedArap {
    /// Reduces a shape to its handles; all of them are free at first.
    ///
    /// `progress` is called with the part done, 0 to 1, and can cancel.
    pub fn precompute(
        shape: &ArapShape,
        settings: &ArapSettings,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, ArapError> {
        validate(shape)?;
        let reduction = Arc::new(reduce(shape, settings, progress)?);
        let rows = 4 * reduction.handle_count;
        let column = |length| [vec![0.0; length], vec![0.0; length], vec![0.0; length]];
        let mut state = State {
            rotations: Vec::new(),
            turned: Vec::new(),
            covariances: Vec::new(),
            still: Vec::new(),
            transposed: column(rows),
            base: column(rows),
            right: column(0),
            force: column(rows),
            given: column(0),
            wide: column(0),
            handle_targets: vec![Affine3A::IDENTITY; reduction.handle_count],
            anchor_targets: Vec::new(),
            transforms: vec![Affine3A::IDENTITY; reduction.handle_count],
        };
        state.make_room_for(reduction.cluster_count);
        let (bare, system, motion) = (reduction.clone(), Arc::new(System::default()), Motion::new(rows));
        let mut arap = Self { reduction, bare, system, state, motion, anchors: Vec::new() };
        arap.restart();
        let free = vec![HandleConstraint::Free; arap.handle_count()];
        arap.constrain(&free, &[])?;
        if progress(1.0).is_break() {
            return Err(ArapError::Cancelled);
        }
        Ok(arap)
    }

    /// Switches to other constraints: one a handle, and points of the shape to be held. The pose reached so far
    /// remains the start of the next solve.
    pub fn constrain(&mut self, handles: &[HandleConstraint], anchors: &[Anchor]) -> Result<(), ArapError> {
        expect_length("constraints", handles.len(), self.handle_count())?;
        self.system = Arc::new(System::new(&self.reduction, handles, anchors, None)?);
        self.anchors = anchors.to_vec();
        self.motion.forget_systems();
        let equations = self.system.equation_count();
        self.state.right.iter_mut().for_each(|column| column.resize(equations, 0.0));
        self.state.given.iter_mut().for_each(|column| column.resize(self.system.known.len(), 0.0));
        self.state.anchor_targets.clear();
        for anchor in anchors {
            self.state.anchor_targets.push(self.reduction.rest_anchor(anchor));
        }
        Ok(())
    }

    /// Takes how the handles prefer to turn against each other, instead of what was given before; none at first. The
    /// pose reached so far remains the start of the next solve. The energy in reports includes these terms.
    pub fn soften(&mut self, joints: &[SoftJoint]) -> Result<(), ArapError> {
        if joints.is_empty() && Arc::ptr_eq(&self.reduction, &self.bare) {
            return Ok(());
        }
        self.reduction =
            if joints.is_empty() { self.bare.clone() } else { Arc::new(self.bare.with_soft_joints(joints)?) };
        // What an earlier limit allowed may be beyond this one's.
        self.state.make_room_for(self.bare.cluster_count);
        self.state.make_room_for(self.reduction.cluster_count);
        let system = System::new(&self.reduction, &self.system.constraints, &self.anchors, None)?;
        self.system = Arc::new(system);
        self.motion.forget_systems();
        Ok(())
    }

    /// Number of handles.
    pub fn handle_count(&self) -> usize {
        self.reduction.handle_count
    }

    /// Number of rotations told apart: as asked for, or fewer where weights are alike.
    pub fn cluster_count(&self) -> usize {
        self.bare.cluster_count
    }

    /// Elements without area or volume, which the energy leaves out.
    pub fn degenerate_elements(&self) -> usize {
        self.reduction.degenerate
    }

    /// Zero-based handles that no vertex follows; they stay at rest unless constrained.
    pub fn weightless_handles(&self) -> &[usize] {
        &self.reduction.weightless
    }

    /// The handles' `model_from_rest` transformations as the last solve left them (identities before the first).
    pub fn transforms(&self) -> &[Affine3A] {
        &self.state.transforms
    }

    /// Forgets the pose reached so far: the next solve or step starts from the rest pose, without speed.
    pub fn restart(&mut self) {
        self.motion.stop();
        for (axis, column) in self.state.transposed.iter_mut().enumerate() {
            column.iter_mut().enumerate().for_each(|(row, entry)| *entry = f64::from(u8::from(row % 4 == axis)));
        }
        self.state.rotations.fill(IDENTITIES);
    }

    /// Finds the transformations for these targets, starting from the frame before.
    ///
    /// `handle_targets`: one `model_from_rest` map a handle. A full constraint takes all of it, an orientation its
    /// linear part, a position only where it takes the handle point, a free handle nothing. `anchor_targets`: where
    /// each anchor goes. Allocates nothing. The shape stands still in its new pose: for momentum, see
    /// [`step`](Self::step).
    pub fn solve(
        &mut self,
        handle_targets: &[Affine3A],
        anchor_targets: &[Vec3],
        stop: ArapStop,
    ) -> Result<ArapReport, ArapError> {
        self.expect_targets(handle_targets, anchor_targets)?;
        self.motion.stop();
        Ok(self.local_global(handle_targets, anchor_targets, stop))
    }

    pub(crate) fn expect_targets(&self, handles: &[Affine3A], anchors: &[Vec3]) -> Result<(), ArapError> {
        expect_length("handle targets", handles.len(), self.handle_count())?;
        expect_length("anchor targets", anchors.len(), self.state.anchor_targets.len())
    }
}

const IDENTITIES: Matrices = {
    const ZERO: [f32; LANES] = [0.0; LANES];
    const ONE: [f32; LANES] = [1.0; LANES];
    [[ONE, ZERO, ZERO], [ZERO, ONE, ZERO], [ZERO, ZERO, ONE]]
};

impl State {
    /// Room for so many rotations; those that are new are the identity.
    fn make_room_for(&mut self, clusters: usize) {
        let blocks = clusters.div_ceil(LANES);
        for matrices in [&mut self.rotations, &mut self.turned, &mut self.covariances, &mut self.still] {
            matrices.resize(blocks, IDENTITIES);
        }
        for lane in clusters..blocks * LANES {
            for (row, columns) in self.rotations[lane / LANES].iter_mut().enumerate() {
                for (column, entry) in columns.iter_mut().enumerate() {
                    entry[lane % LANES] = if row == column { 1.0 } else { 0.0 };
                }
            }
        }
        self.wide.iter_mut().for_each(|column| column.resize(3 * clusters, 0.0));
    }
}

fn expect_length(what: &'static str, got: usize, expected: usize) -> Result<(), ArapError> {
    if got == expected { Ok(()) } else { Err(ArapError::Length { what, got, expected }) }
}

fn validate(shape: &ArapShape) -> Result<(), ArapError> {
    let (vertex_count, handle_count) = (shape.positions.len(), shape.handle_points.len());
    let empty = [
        ("vertices", vertex_count == 0),
        ("elements", shape.energy.element_count() == 0),
        ("handles", handle_count == 0),
    ];
    if let Some((what, _)) = empty.into_iter().find(|(_, empty)| *empty) {
        return Err(ArapError::Empty { what });
    }
    expect_length("weights", shape.weights.len(), vertex_count * handle_count)?;
    if let Some((element, vertex)) = shape.energy.out_of_range(vertex_count) {
        return Err(ArapError::VertexOutOfRange { element, vertex, vertex_count });
    }
    let joint_points: Vec<[f64; 3]> = shape.joints.iter().map(|j| j.point).collect();
    for (what, points) in
        [("position", shape.positions), ("handle point", shape.handle_points), ("joint", &joint_points)]
    {
        if let Some(index) = points.iter().position(|p| !p.iter().all(|c| c.abs() <= LARGEST)) {
            return Err(ArapError::NotFinite { what, index });
        }
    }
    for (vertex, row) in shape.weights.chunks_exact(handle_count).enumerate() {
        if !row.iter().all(|w| w.abs() <= LARGEST) {
            return Err(ArapError::NotFinite { what: "weights of vertex", index: vertex });
        }
        if row.iter().all(|&w| w == 0.0) {
            return Err(ArapError::Unweighted { vertex });
        }
    }
    for (joint, shared) in shape.joints.iter().enumerate() {
        if let Some(&handle) = shared.handles.iter().find(|h| **h >= handle_count) {
            return Err(ArapError::HandleOutOfRange { joint, handle, handle_count });
        }
    }
    Ok(())
}

/// The row of `M` that an affine map of a handle makes of a point: its coordinates and a one.
pub(crate) fn homogeneous(point: [f64; 3]) -> [f64; 4] {
    [point[0], point[1], point[2], 1.0]
}
