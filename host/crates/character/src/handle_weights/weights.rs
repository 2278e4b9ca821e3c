//! Weights of handles for the vertices of a mesh: computed on a volume, transferred to the surface, with their
//! certificates and warnings.

use armature_geometry::volume::VolumeError;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{
    BiharmonicError, BiharmonicProblem, ExactPartition, ExactPartitionSettings, bounded_biharmonic_weights,
    exact_partition_weights,
};
use armature_weights::extrema::Neighbours;
use armature_weights::finish::{follow_nearest_handle, normalise};
use armature_weights::handles::{
    Handle, HandleBoundary, HandleError, HandleKind, MOST_FREE_NEAR_JOINTS, free_joints, handle_boundary,
};
use armature_weights::monotone::{MonotoneProblem, MonotoneSettings, monotone_partition, monotone_weights};

use super::cage_facets::cage_facets;
use super::domain::{WeightDomain, weight_domain};
use super::error::HandleWeightsError;
use super::handle::{HandlePlace, HandleShape, Held};
use super::outcome::{Certificates, HandleWeights};
use super::settings::{BiharmonicTier, HandleWeightsSettings, Partition, WeightMethod, WeightsOn};
use super::spurious::{SpuriousExtrema, spurious_of};
use super::warnings::{Drawbacks, weight_warnings};
use crate::progress::Progress;
use crate::volume::MakeError;

/// The volume's share of the total time.
const VOLUME_SHARE: f64 = 0.4;

/// Weights of every handle for every vertex of `surface`: the volume or other elements, the solver, pieces without a
/// handle, normalising, and the transfer to the surface. `tetrahedra`, if the mesh has any, share the surface's
/// vertices. `progress` receives the current stage and the fraction of the whole that is done, and may stop the work.
pub fn handle_weights(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    held: Held<'_>,
    settings: &HandleWeightsSettings,
    progress: Progress<'_>,
) -> Result<HandleWeights, HandleWeightsError> {
    let (domain, boundary, columns) = prepare(surface, tetrahedra, held, settings, progress)?;
    let neighbours = Neighbours::of_matrix(&domain.laplacian);
    let names = held.names();
    let mut solved = solve(&domain, &neighbours, &boundary, (&columns, names.len()), settings, progress)?;
    let followed = follow_nearest_handle(&mut solved.weights, &solved.unreached, &boundary, &domain.vertices);
    let spurious = |weights: &_| spurious_of(&domain, &neighbours, &boundary, weights, (&columns, names.len()));
    let computed = spurious(&solved.weights)?;
    let normalisation = (settings.partition == Partition::Normalised).then(|| normalise(&mut solved.weights));
    let scaled = normalisation.as_ref().map(|_| spurious(&solved.weights)).transpose()?;
    let weights = whole(&domain, &solved.weights, &columns, names.len())?;
    let followed: Vec<usize> = followed.into_iter().map(|handle| columns[handle]).collect();
    // Of handles solved together the caller tells.
    let unconverged = if solved.certificates.together() { (0, 0.0) } else { solved.certificates.late() };
    let drawbacks = Drawbacks::find(&domain, &weights, unconverged, &solved.unreached, &followed);
    Ok(HandleWeights {
        warnings: weight_warnings(&drawbacks, &names),
        idle: drawbacks.idle,
        weights,
        certificates: solved.certificates,
        normalisation,
        spurious: SpuriousExtrema { computed, scaled },
        domain: domain.kind,
        domain_vertices: domain.vertices.len(),
        flat_elements: domain.degenerate,
        joint_release: matches!(held, Held::Shapes { .. }).then_some(settings.joint_release),
    })
}

/// The elements to compute on, what is fixed there, and which handles the columns of that belong to; the others hold
/// nothing.
fn prepare(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    held: Held<'_>,
    settings: &HandleWeightsSettings,
    progress: Progress<'_>,
) -> Result<(WeightDomain, HandleBoundary, Vec<usize>), HandleWeightsError> {
    if !(0.0..=MOST_FREE_NEAR_JOINTS).contains(&settings.joint_release) {
        return Err(HandleWeightsError::JointRelease { share: settings.joint_release });
    }
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
        MakeError::Solid(VolumeError::Cancelled)
        | MakeError::Flat(armature_geometry::planar::PlanarError::Cancelled) => HandleWeightsError::Cancelled { stage },
        other => HandleWeightsError::Volume(other),
    })?;
    let (boundary, columns) = match held {
        Held::Boundary(boundary) => (boundary.clone(), (0..boundary.handles).collect()),
        Held::Shapes { shapes, cage } => boundary_of(&domain, shapes, cage, settings.joint_release)?,
    };
    Ok((domain, boundary, columns))
}

/// The edges of a cage.
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

/// What the handles that hold something hold, and which those are.
fn boundary_of(
    domain: &WeightDomain,
    shapes: &[HandleShape],
    cage: &[[usize; 2]],
    joint_release: f64,
) -> Result<(HandleBoundary, Vec<usize>), HandleWeightsError> {
    let columns: Vec<usize> = (0..shapes.len()).filter(|&handle| !domain.held[handle].is_empty()).collect();
    if columns.is_empty() {
        return Err(HandleWeightsError::NothingHeld { handles: shapes.len() });
    }
    // All but cages may share vertices: two handles at one place are reported, not refused.
    let kind_of = |column: usize| {
        if cage.iter().flatten().any(|&end| end == column) { HandleKind::Own } else { HandleKind::Bone }
    };
    let handle = |&column: &usize| Handle { kind: kind_of(column), vertices: domain.held[column].clone() };
    let mut all: Vec<Handle> = columns.iter().map(handle).collect();
    free_joints(&domain.vertices, &mut all, joint_release);
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

/// Weights on the domain, with their certificates.
struct Solved {
    weights: WeightMatrix,
    certificates: Certificates,
    unreached: Vec<Vec<usize>>,
}

/// `columns` say which of all handles those of the boundary are.
fn solve(
    domain: &WeightDomain,
    neighbours: &Neighbours,
    boundary: &HandleBoundary,
    (columns, handles): (&[usize], usize),
    settings: &HandleWeightsSettings,
    progress: Progress<'_>,
) -> Result<Solved, HandleWeightsError> {
    let mut told = |stage: &'static str, done: f64| progress(stage, VOLUME_SHARE + (1.0 - VOLUME_SHARE) * done);
    match settings.method {
        WeightMethod::BoundedBiharmonic => {
            let problem = BiharmonicProblem::new(&domain.laplacian, &domain.mass, boundary);
            if settings.partition == Partition::Exact {
                let error_bound = settings.tier.settings().error_bound;
                let how = ExactPartitionSettings { error_bound, ..ExactPartitionSettings::default() };
                let ExactPartition { weights, report, unreached } = exact_partition_weights(&problem, &how, &mut told)?;
                return Ok(Solved { weights, certificates: Certificates::BoundedTogether(report), unreached });
            }
            let alone = bounded_biharmonic_weights(&problem, &settings.tier.settings(), &mut told)?;
            let certificates = Certificates::Bounded(by_handle(alone.reports, columns, handles));
            Ok(Solved { weights: alone.weights, certificates, unreached: alone.unreached })
        }
        WeightMethod::Monotone { order } => {
            let WeightDomain { laplacian, mass, .. } = domain;
            let problem = MonotoneProblem { neighbours, laplacian, mass, order, blend: None, data: None };
            let how = match settings.tier {
                BiharmonicTier::Interactive => MonotoneSettings::default(),
                BiharmonicTier::Certified => MonotoneSettings::certified(),
            };
            if settings.partition == Partition::Exact {
                let made = monotone_partition(&problem, boundary, &how, &mut told)?;
                let certificates = Certificates::MonotoneTogether(Box::new(made.report));
                return Ok(Solved { weights: made.weights, certificates, unreached: made.unreached });
            }
            let alone = monotone_weights(&problem, boundary, &how, &mut told)?;
            let certificates = Certificates::Monotone(by_handle(alone.reports, columns, handles));
            Ok(Solved { weights: alone.weights, certificates, unreached: alone.unreached })
        }
    }
}

fn by_handle<R: Clone>(reports: Vec<R>, columns: &[usize], handles: usize) -> Vec<Option<R>> {
    let mut all = vec![None; handles];
    columns.iter().zip(reports).for_each(|(&handle, report)| all[handle] = Some(report));
    all
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
