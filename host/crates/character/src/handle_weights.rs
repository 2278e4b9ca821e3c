//! Bounded biharmonic weights of handles for the vertices of a mesh: on a volume, carried to the surface, with their
//! certificates and with what was odd.

use std::ops::ControlFlow;

use armature_geometry::{MeshError, TetrahedralMesh, TriangleMesh, VolumeError};
use armature_weights::{
    BiharmonicError, BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, ExactPartitionReport,
    ExactPartitionSettings, FREE_NEAR_JOINTS, Handle, HandleBoundary, HandleError, HandleKind, HandleReport,
    Normalisation, Progress, WeightMatrix, bounded_biharmonic_weights, exact_partition_weights, follow_nearest_handle,
    free_joints, handle_boundary, normalise,
};

use crate::cage_facets::cage_facets;
use crate::make_volume::MakeError;
use crate::weight_domain::{DomainKind, HandlePlace, HandleShape, WeightDomain, WeightsOn, weight_domain};
use crate::weight_warnings::{Drawbacks, weight_warnings};

/// How good bounded biharmonic weights have to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BiharmonicTier {
    /// Within 2e-3 of the optimal ones, which no deformation shows.
    #[default]
    Interactive,
    /// Optimal to 1e-5 and to ten digits in the energy.
    Certified,
}

impl BiharmonicTier {
    /// When the solver may stop.
    pub fn settings(self) -> BiharmonicSettings {
        match self {
            Self::Interactive => BiharmonicSettings::interactive(),
            Self::Certified => BiharmonicSettings::certified(),
        }
    }
}

/// How a vertex's weights come to sum to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Partition {
    /// Each handle is solved by itself, and a vertex's weights are scaled afterwards.
    #[default]
    Normalised,
    /// Each handle is solved by itself, and its weights stay as they are: the sums differ from one.
    Left,
    /// All handles are solved together with the sum as a constraint: slower, and smoother where many meet.
    Exact,
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleWeightsSettings {
    /// How good.
    pub tier: BiharmonicTier,
    /// On what.
    pub on: WeightsOn,
    /// Whether and how they sum to one.
    pub partition: Partition,
}

/// What weights are fixed where.
#[derive(Clone, Copy, Debug)]
pub enum Held<'a> {
    /// Handles.
    Shapes {
        /// They may share vertices, and then share their weights equally. Bones let go near the joints they share
        /// ([`free_joints`]).
        shapes: &'a [HandleShape],
        /// Edges of cages, open or closed, as pairs of points among the shapes: weights are linear along them. Their
        /// ends share their vertices with no other handle.
        cage: &'a [[usize; 2]],
    },
    /// Vertices of the mesh itself with given weights; only for weights on [`WeightsOn::OwnElements`].
    Boundary(&'a HandleBoundary),
}

/// Weights with their certificates.
#[derive(Clone, Debug)]
pub struct HandleWeights {
    /// n vertices of the surface × m handles.
    pub weights: WeightMatrix,
    /// One for every handle solved by itself; `None` where it holds nothing, and its weights are zero.
    pub reports: Vec<Option<HandleReport>>,
    /// The one certificate of handles that were solved together; `reports` are then all `None`.
    pub together: Option<ExactPartitionReport>,
    /// What normalising changed, if it was asked for.
    pub normalisation: Option<Normalisation>,
    /// What they were computed on.
    pub domain: DomainKind,
    /// How many vertices that has.
    pub domain_vertices: usize,
    /// Handles that move no vertex of the surface by more than dust.
    pub idle: Vec<usize>,
    /// What the user should know, in sentences.
    pub warnings: Vec<String>,
}

impl HandleWeights {
    /// No weight, before normalising, is farther than this from the optimal one.
    pub fn error_bound(&self) -> f64 {
        self.known().map(|report| report.error_bound).chain(self.together.map(|t| t.error_bound)).fold(0.0, f64::max)
    }

    /// The sum of all handles' energies.
    pub fn energy(&self) -> f64 {
        self.known().map(|report| report.energy).chain(self.together.map(|t| t.energy)).sum()
    }

    /// Handles that were solved by themselves and whose weights are not as good as they were asked to be.
    pub fn unconverged(&self) -> usize {
        self.known().filter(|report| report.outcome != BiharmonicOutcome::Converged).count()
    }

    /// Whether all weights are as good as they were asked to be.
    pub fn converged(&self) -> bool {
        let together = self.together.is_none_or(|report| report.outcome == BiharmonicOutcome::Converged);
        together && self.unconverged() == 0
    }

    fn known(&self) -> impl Iterator<Item = &HandleReport> {
        self.reports.iter().flatten()
    }
}

/// Why there are no weights.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HandleWeightsError {
    /// No handle holds a vertex.
    #[error("none of the {handles} handles holds a part of the shape; check that they lie in it and in its unit")]
    NothingHeld {
        /// Handles given.
        handles: usize,
    },
    /// Vertices were fixed by number, but the weights are not computed on the mesh's own elements.
    #[error("weights can be fixed at vertices only of the mesh's own elements")]
    BoundaryElsewhere,
    /// An edge of a cage has to join two points.
    #[error("edge {edge} of the cage does not join two of the points", edge = .edge + 1)]
    CageEdge {
        /// Zero-based edge.
        edge: usize,
    },
    /// A point of a cage lies where another handle does.
    #[error("{first} and {second} are at one place, but a point of a cage holds its place alone; move one of them")]
    CagePoint {
        /// One handle's name.
        first: String,
        /// The other's.
        second: String,
    },
    /// On an edge of a cage lies another handle's vertex, or one of another edge with other weights.
    #[error("the edge of the cage between {from} and {to} meets another handle on its way; let it end there")]
    CageCrossed {
        /// The name of the handle where it starts.
        from: String,
        /// Where it ends.
        to: String,
    },
    /// There is no volume.
    #[error(transparent)]
    Volume(#[from] MakeError),
    /// Handles do not fit on the elements.
    #[error(transparent)]
    Handles(#[from] HandleError),
    /// The weights could not be computed.
    #[error(transparent)]
    Biharmonic(#[from] BiharmonicError),
    /// The progress callback asked to stop.
    #[error("computing the weights was cancelled while {stage}")]
    Cancelled {
        /// What was going on.
        stage: &'static str,
    },
}

/// The volume's share of the whole time.
const VOLUME_SHARE: f64 = 0.4;

/// Weights of every handle for every vertex of `surface`: the volume or other elements, the solver, pieces without a
/// handle, normalising, and the way back to the surface. `tetrahedra`, if the mesh brings any, have the surface's
/// vertices. `progress` hears a few words and the part of the whole that is done, and may stop the work.
pub fn handle_weights(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    held: Held<'_>,
    settings: &HandleWeightsSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<HandleWeights, HandleWeightsError> {
    let (shapes, cage): (&[HandleShape], &[[usize; 2]]) = match held {
        Held::Shapes { shapes, cage } => (shapes, cage),
        Held::Boundary(_) if settings.on != WeightsOn::OwnElements => {
            return Err(HandleWeightsError::BoundaryElsewhere);
        }
        Held::Boundary(_) => (&[], &[]),
    };
    let cage_segments = cage_segments(shapes, cage)?;
    let mut stage = "preparing the shape";
    let mut told = |label: &'static str, done: f64| {
        stage = label;
        progress(label, VOLUME_SHARE * done)
    };
    let made = weight_domain(surface, tetrahedra, shapes, &cage_segments, settings.on, &mut told);
    let domain = made.map_err(|error| match error {
        MakeError::Solid(VolumeError::Cancelled) | MakeError::Flat(armature_geometry::PlanarError::Cancelled) => {
            HandleWeightsError::Cancelled { stage }
        }
        other => HandleWeightsError::Volume(other),
    })?;
    // The columns that have to be solved for; the others hold nothing.
    let (boundary, columns) = match held {
        Held::Boundary(boundary) => (boundary.clone(), (0..boundary.handles).collect()),
        Held::Shapes { shapes, cage } => boundary_of(&domain, shapes, cage)?,
    };
    let mut solved = solve(&domain, &boundary, settings, progress)?;
    let followed = follow_nearest_handle(&mut solved.weights, &solved.unreached, &boundary, &domain.vertices);
    let normalisation = (settings.partition == Partition::Normalised).then(|| normalise(&mut solved.weights));
    let names: Vec<String> = match held {
        Held::Shapes { shapes, .. } => shapes.iter().map(|shape| shape.name.clone()).collect(),
        Held::Boundary(boundary) => (1..=boundary.handles).map(|handle| format!("handle {handle}")).collect(),
    };
    let weights = whole(&domain, &solved.weights, &columns, names.len())?;
    let mut reports = vec![None; names.len()];
    columns.iter().zip(solved.reports).for_each(|(&column, report)| reports[column] = Some(report));
    let followed: Vec<usize> = followed.into_iter().map(|handle| columns[handle]).collect();
    let drawbacks = Drawbacks::find(&domain, &weights, &reports, &solved.unreached, &followed);
    Ok(HandleWeights {
        warnings: weight_warnings(&drawbacks, &names),
        idle: drawbacks.idle,
        weights,
        reports,
        together: solved.together,
        normalisation,
        domain: domain.kind,
        domain_vertices: domain.vertices.len(),
    })
}

/// Where the edges of a cage run.
fn cage_segments(shapes: &[HandleShape], cage: &[[usize; 2]]) -> Result<Vec<[[f64; 3]; 2]>, HandleWeightsError> {
    let segment = |(edge, ends): (usize, &[usize; 2])| {
        let place = |end: usize| match shapes.get(end).map(|shape| &shape.place) {
            Some(HandlePlace::Point(point)) if ends[0] != ends[1] => Ok(*point),
            _ => Err(HandleWeightsError::CageEdge { edge }),
        };
        Ok([place(ends[0])?, place(ends[1])?])
    };
    cage.iter().enumerate().map(segment).collect()
}

/// What the handles that hold something hold, and which they are.
fn boundary_of(
    domain: &WeightDomain,
    shapes: &[HandleShape],
    cage: &[[usize; 2]],
) -> Result<(HandleBoundary, Vec<usize>), HandleWeightsError> {
    let columns: Vec<usize> = (0..shapes.len()).filter(|&handle| !domain.held[handle].is_empty()).collect();
    if columns.is_empty() {
        return Err(HandleWeightsError::NothingHeld { handles: shapes.len() });
    }
    // All but cages may share vertices: two handles at one place are told of, not refused.
    let kind_of = |column: usize| {
        if cage.iter().flatten().any(|&end| end == column) { HandleKind::Own } else { HandleKind::Bone }
    };
    let handle = |&column: &usize| Handle { kind: kind_of(column), vertices: domain.held[column].clone() };
    let mut all: Vec<Handle> = columns.iter().map(handle).collect();
    free_joints(&domain.vertices, &mut all, FREE_NEAR_JOINTS);
    let facets = cage_facets(domain, &columns, cage);
    let name = |handle: usize| shapes[columns[handle]].name.clone();
    let boundary = handle_boundary(&domain.vertices, &all, &facets).map_err(|error| match error {
        HandleError::TwoHandles { first, second, .. } => {
            HandleWeightsError::CagePoint { first: name(first), second: name(second) }
        }
        HandleError::OffFacet { facet, .. } => {
            let ends = &facets[facet].corners;
            HandleWeightsError::CageCrossed { from: name(ends[0]), to: name(ends[1]) }
        }
        other => other.into(),
    })?;
    Ok((boundary, columns))
}

/// Weights on the domain, with either kind of certificate.
struct Solved {
    weights: WeightMatrix,
    reports: Vec<HandleReport>,
    together: Option<ExactPartitionReport>,
    unreached: Vec<Vec<usize>>,
}

fn solve(
    domain: &WeightDomain,
    boundary: &HandleBoundary,
    settings: &HandleWeightsSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Solved, HandleWeightsError> {
    let problem = BiharmonicProblem {
        laplacian: &domain.laplacian,
        mass: &domain.mass,
        fixed: &boundary.fixed,
        fixed_weights: &boundary.fixed_weights,
        handles: boundary.handles,
        shape_preservation: None,
    };
    let mut told = |at: Progress| progress(at.phase.label(), VOLUME_SHARE + (1.0 - VOLUME_SHARE) * at.done);
    let solved = if settings.partition == Partition::Exact {
        let error_bound = settings.tier.settings().error_bound;
        let how = ExactPartitionSettings { error_bound, ..ExactPartitionSettings::default() };
        exact_partition_weights(&problem, &how, &mut told).map(|exact| Solved {
            weights: exact.weights,
            reports: Vec::new(),
            together: Some(exact.report),
            unreached: exact.unreached,
        })
    } else {
        bounded_biharmonic_weights(&problem, &settings.tier.settings(), &mut told).map(|alone| Solved {
            weights: alone.weights,
            reports: alone.reports,
            together: None,
            unreached: alone.unreached,
        })
    };
    solved.map_err(|error| match error {
        BiharmonicError::Cancelled(phase) => HandleWeightsError::Cancelled { stage: phase.label() },
        other => HandleWeightsError::Biharmonic(other),
    })
}

/// The weights of the surface's vertices, with a column of zeros for every handle that holds nothing.
fn whole(
    domain: &WeightDomain,
    solved: &WeightMatrix,
    columns: &[usize],
    handles: usize,
) -> Result<WeightMatrix, HandleWeightsError> {
    let n = domain.surface_vertices();
    let out_of_memory = HandleWeightsError::Biharmonic(BiharmonicError::OutOfMemory { vertices: n, handles });
    let carried = domain.carry(solved).ok_or(out_of_memory.clone())?;
    if columns.len() == handles {
        return Ok(carried);
    }
    let column = |handle: usize| {
        let solved = columns.binary_search(&handle).ok();
        solved.into_iter().flat_map(|column| carried.column(column))
    };
    WeightMatrix::from_sparse_columns(n, (0..handles).map(column)).ok_or(out_of_memory)
}

impl From<MeshError> for MakeError {
    fn from(error: MeshError) -> Self {
        Self::Solid(VolumeError::Mesh(error))
    }
}
