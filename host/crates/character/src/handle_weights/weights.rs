//! Bounded biharmonic weights of handles for the vertices of a mesh: computed on a volume, transferred to the surface,
//! with their certificates and warnings.

use armature_geometry::volume::VolumeError;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{
    BiharmonicError, BiharmonicOutcome, BiharmonicProblem, ExactPartitionReport, ExactPartitionSettings, HandleReport,
    bounded_biharmonic_weights, exact_partition_weights,
};
use armature_weights::extrema::Neighbours;
use armature_weights::finish::{follow_nearest_handle, normalise};
use armature_weights::handles::{
    Handle, HandleBoundary, HandleError, HandleKind, MOST_FREE_NEAR_JOINTS, free_joints, handle_boundary,
};

use super::cage_facets::cage_facets;
use super::domain::{WeightDomain, weight_domain};
use super::error::HandleWeightsError;
use super::handle::{HandlePlace, HandleShape, Held};
use super::outcome::HandleWeights;
use super::settings::{HandleWeightsSettings, Partition, WeightsOn};
use super::spurious::{SpuriousExtrema, spurious_of};
use super::warnings::{Drawbacks, weight_warnings};
use crate::progress::Progress;
use crate::volume::MakeError;

/// The volume's share of the total time.
pub(super) const VOLUME_SHARE: f64 = 0.4;

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
    let mut solved = solve(&domain, &boundary, settings, progress)?;
    let names = held.names();
    let followed = follow_nearest_handle(&mut solved.weights, &solved.unreached, &boundary, &domain.vertices);
    let neighbours = Neighbours::of_matrix(&domain.laplacian);
    let spurious = |weights: &_| spurious_of(&domain, &neighbours, &boundary, weights, (&columns, names.len()));
    let computed = spurious(&solved.weights)?;
    let normalisation = (settings.partition == Partition::Normalised).then(|| normalise(&mut solved.weights));
    let scaled = normalisation.as_ref().map(|_| spurious(&solved.weights)).transpose()?;
    let weights = whole(&domain, &solved.weights, &columns, names.len())?;
    let mut reports = vec![None; names.len()];
    columns.iter().zip(solved.reports).for_each(|(&column, report)| reports[column] = Some(report));
    let followed: Vec<usize> = followed.into_iter().map(|handle| columns[handle]).collect();
    let late = reports.iter().flatten().filter(|report| report.outcome != BiharmonicOutcome::Converged);
    let unconverged = late.fold((0, 0.0), |(count, worst), r| (count + 1, f64::max(worst, r.error_bound)));
    let drawbacks = Drawbacks::find(&domain, &weights, unconverged, &solved.unreached, &followed);
    Ok(HandleWeights {
        warnings: weight_warnings(&drawbacks, &names),
        idle: drawbacks.idle,
        weights,
        reports,
        together: solved.together,
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
pub(super) fn prepare(
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
    progress: Progress<'_>,
) -> Result<Solved, HandleWeightsError> {
    let problem = BiharmonicProblem::new(&domain.laplacian, &domain.mass, boundary);
    let mut told = |stage: &'static str, done: f64| progress(stage, VOLUME_SHARE + (1.0 - VOLUME_SHARE) * done);
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
        BiharmonicError::Cancelled { stage } => HandleWeightsError::Cancelled { stage },
        other => HandleWeightsError::Biharmonic(other),
    })
}

/// The weights of the surface's vertices, with a column of zeros for every handle that holds nothing.
pub(super) fn whole(
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
