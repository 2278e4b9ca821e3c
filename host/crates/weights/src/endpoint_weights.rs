//! Endpoint weights of bones that stretch and twist (thesis 6.2.2): for every bone a smooth function on the shape that
//! goes from 0 at its head to 1 at its tail, linear along the bone, within 0..=1; computed directly as bounded
//! biharmonic weights.

use std::ops::ControlFlow;

use armature_geometry::{Influences, SparseMatrix};

use crate::sampled_skeleton::{EndpointError, SampledSkeleton};
use crate::{
    BiharmonicError, BiharmonicProblem, BiharmonicSettings, BiharmonicWeights, HandleReport, Progress, WeightMatrix,
    bounded_biharmonic_weights,
};

/// What a bone's endpoint weights are at the other bones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OtherBones {
    /// What they are where those bones join this one: 1 at all that hang on its tail, 0 at all that hang on its head.
    /// Where the skeleton does not tell, because bones join this one in several places or nowhere, their vertices
    /// take the projection (thesis eq. 6.8). All bones then share one system, and its factorisation.
    #[default]
    OnTheirSide,
    /// Whatever is smoothest, as in the thesis: each bone is a problem of its own.
    Free,
}

/// Endpoint weights with their certificates.
#[derive(Clone, Debug, PartialEq)]
pub struct EndpointWeights {
    /// n vertices × m bones, `e_i`: each within 0..=1.
    pub weights: WeightMatrix,
    /// Bones without a length, or whose vertices are all at one place along them: their weights are ½ everywhere.
    pub without_length: Vec<usize>,
    /// One for every bone.
    pub reports: Vec<HandleReport>,
    /// For each bone how many vertices took the projection (eq. 6.8), as they hang together with no bone given
    /// (of [`OtherBones::Free`]: not with this one).
    pub projected: Vec<usize>,
    /// For each bone the other bones at whose vertices the projection was given.
    pub told_by_projection: Vec<Vec<usize>>,
}

/// Computes every bone's endpoint weights. `laplacian` and `mass` as for [`BiharmonicProblem`].
///
/// Moving or scaling the mesh with its bones changes nothing beside rounding, and swapping a bone's head and tail turns
/// `e` into `1 - e`.
pub fn endpoint_weights(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    others: OtherBones,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<EndpointWeights, EndpointError> {
    skeleton.check(mass.len())?;
    match others {
        OtherBones::OnTheirSide => all_together(laplacian, mass, skeleton, settings, progress),
        OtherBones::Free => one_by_one(laplacian, mass, skeleton, settings, progress),
    }
}

/// Endpoint weights in the order of a skin's influences: as long as `influences.bones()`, the weight of that slot's
/// bone at that vertex, and ½ in slots that are not used. `endpoints`: n vertices × m bones. `None` if there are fewer
/// vertices or bones than the influences name.
pub fn endpoint_weights_of_influences(endpoints: &WeightMatrix, influences: &Influences) -> Option<Vec<f32>> {
    if influences.vertex_count() != endpoints.vertices() {
        return None;
    }
    let columns = endpoints.to_columns()?;
    let mut of_slots = vec![0.5; influences.bones().len()];
    for (vertex, slots) in of_slots.chunks_exact_mut(influences.per_vertex().max(1)).enumerate() {
        for (slot, (bone, _)) in slots.iter_mut().zip(influences.of_vertex(vertex)) {
            *slot = *columns.get(usize::from(bone) * endpoints.vertices() + vertex)? as f32;
        }
    }
    Some(of_slots)
}

fn all_together(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<EndpointWeights, EndpointError> {
    let fixed = skeleton.held();
    let handles = skeleton.bones.len();
    let meetings = Meetings::new(skeleton, &fixed);
    let mut fixed_weights = Vec::with_capacity(fixed.len() * handles);
    let (mut without_length, mut told_by_projection) = (Vec::new(), Vec::with_capacity(handles));
    for bone in 0..handles {
        if skeleton.has_length(bone) {
            told_by_projection.push(meetings.give(bone, &mut fixed_weights));
        } else {
            without_length.push(bone);
            told_by_projection.push(Vec::new());
            fixed_weights.resize(fixed_weights.len() + fixed.len(), 0.5);
        }
    }
    let given = Given { fixed: &fixed, weights: &fixed_weights, bones: &(0..handles).collect::<Vec<usize>>() };
    let (columns, reports, lost) = solve(laplacian, mass, skeleton, &given, settings, progress)?;
    let weights = matrix(mass.len(), handles, columns)?;
    Ok(EndpointWeights { weights, without_length, reports, projected: vec![lost; handles], told_by_projection })
}

fn one_by_one(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<EndpointWeights, EndpointError> {
    let handles = skeleton.bones.len();
    let (mut columns, mut without_length) = (Vec::with_capacity(handles), Vec::new());
    let (mut reports, mut projected) = (Vec::with_capacity(handles), Vec::with_capacity(handles));
    for bone in 0..handles {
        let fixed = skeleton.held_by(bone);
        let fixed_weights: Vec<f64> = if skeleton.has_length(bone) {
            fixed.iter().map(|&vertex| skeleton.along(bone, vertex)).collect()
        } else {
            without_length.push(bone);
            vec![0.5; fixed.len()]
        };
        let given = Given { fixed: &fixed, weights: &fixed_weights, bones: &[bone] };
        let mut of_all = |at: Progress| progress(Progress { done: (bone as f64 + at.done) / handles as f64, ..at });
        let (column, report, lost) =
            solve(laplacian, mass, skeleton, &given, settings, &mut of_all).map_err(|error| name_bone(error, bone))?;
        columns.extend(column);
        reports.extend(report);
        projected.push(lost);
    }
    let weights = matrix(mass.len(), handles, columns)?;
    let told_by_projection = vec![Vec::new(); handles];
    Ok(EndpointWeights { weights, without_length, reports, projected, told_by_projection })
}

/// What some bones' weights are at some vertices.
struct Given<'a> {
    fixed: &'a [usize],
    /// `fixed.len()` × `bones.len()`, column-major.
    weights: &'a [f64],
    bones: &'a [usize],
}

/// One bone's weights, `(vertex, weight)` by ascending vertices.
type Column = Vec<(usize, f64)>;

/// Solves for some bones; vertices that hang together with none given take the projection. Returns columns, their
/// certificates and how many those vertices were.
fn solve(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    given: &Given<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Vec<Column>, Vec<HandleReport>, usize), BiharmonicError> {
    let problem = BiharmonicProblem {
        laplacian,
        mass,
        fixed: given.fixed,
        fixed_weights: given.weights,
        handles: given.bones.len(),
        shape_preservation: None,
    };
    let BiharmonicWeights { weights, reports, unreached, .. } =
        bounded_biharmonic_weights(&problem, settings, progress)?;
    let lost: Vec<usize> = unreached.into_iter().flatten().collect();
    let column = |(at, &bone): (usize, &usize)| {
        let projected = lost.iter().map(|&vertex| (vertex, skeleton.along(bone, vertex)));
        let mut column: Column = weights.column(at).chain(projected).collect();
        column.sort_unstable_by_key(|&(vertex, _)| vertex);
        column
    };
    Ok((given.bones.iter().enumerate().map(column).collect(), reports, lost.len()))
}

fn matrix(vertices: usize, handles: usize, columns: Vec<Column>) -> Result<WeightMatrix, BiharmonicError> {
    let out_of_memory = BiharmonicError::OutOfMemory { vertices, handles };
    WeightMatrix::from_sparse_columns(vertices, columns).ok_or(out_of_memory)
}

/// The error of a problem whose only handle was this bone.
fn name_bone(error: BiharmonicError, bone: usize) -> BiharmonicError {
    match error {
        BiharmonicError::NotFinite { .. } => BiharmonicError::NotFinite { handle: bone },
        BiharmonicError::EmptyHandle { .. } => BiharmonicError::EmptyHandle { handle: bone },
        error => error,
    }
}

/// Which bones meet at which vertices.
struct Meetings<'a> {
    skeleton: &'a SampledSkeleton<'a>,
    /// For each bone its vertices, as rows of the fixed ones.
    rows: Vec<Vec<usize>>,
    /// For each fixed vertex itself and the bones that hold it.
    fixed: &'a [usize],
    holders: Vec<Vec<usize>>,
}

impl<'a> Meetings<'a> {
    fn new(skeleton: &'a SampledSkeleton<'a>, fixed: &'a [usize]) -> Self {
        let row_of = |vertex: &usize| fixed.partition_point(|held| held < vertex);
        let rows: Vec<Vec<usize>> =
            (0..skeleton.bones.len()).map(|bone| skeleton.held_by(bone).iter().map(row_of).collect()).collect();
        let mut holders = vec![Vec::new(); fixed.len()];
        for (bone, rows) in rows.iter().enumerate() {
            rows.iter().for_each(|&row| holders[row].push(bone));
        }
        Self { skeleton, rows, fixed, holders }
    }

    /// Appends what `bone`'s endpoint weights are at all fixed vertices. Returns the bones that the projection was
    /// given at.
    fn give(&self, bone: usize, given: &mut Vec<f64>) -> Vec<usize> {
        let along: Vec<f64> = self.fixed.iter().map(|&vertex| self.skeleton.along(bone, vertex)).collect();
        let mut values = along.clone();
        let mut seen = Seen { bones: vec![false; self.rows.len()], rows: vec![Row::New; self.fixed.len()] };
        seen.bones[bone] = true;
        self.rows[bone].iter().for_each(|&row| seen.rows[row] = Row::OnBone);
        let mut untold = Vec::new();
        for start in 0..self.rows.len() {
            if std::mem::replace(&mut seen.bones[start], true) {
                continue;
            }
            let branch = self.branch(start, &mut seen);
            // Samples of one joint may differ by rounding.
            let alike = |&row: &usize| (along[row] - along[branch.joined_at[0]]).abs() < 1e-9;
            if !branch.joined_at.is_empty() && branch.joined_at.iter().all(alike) {
                branch.rows.iter().for_each(|&row| values[row] = along[branch.joined_at[0]]);
            } else {
                untold.extend(branch.bones);
            }
        }
        given.extend(values);
        untold.sort_unstable();
        untold
    }

    /// The bones that hang together with `start` without the one left out.
    fn branch(&self, start: usize, seen: &mut Seen) -> Branch {
        let mut branch = Branch::default();
        let mut open = vec![start];
        while let Some(bone) = open.pop() {
            branch.bones.push(bone);
            for &row in &self.rows[bone] {
                match std::mem::replace(&mut seen.rows[row], Row::Seen) {
                    Row::Seen => {}
                    Row::OnBone => {
                        seen.rows[row] = Row::OnBone;
                        branch.joined_at.push(row);
                    }
                    Row::New => {
                        branch.rows.push(row);
                        let next = self.holders[row].iter().filter(|&&next| !seen.bones[next]);
                        open.extend(next);
                        self.holders[row].iter().for_each(|&next| seen.bones[next] = true);
                    }
                }
            }
        }
        branch
    }
}

/// What a search over bones has met.
struct Seen {
    bones: Vec<bool>,
    rows: Vec<Row>,
}

#[derive(Clone, Copy)]
enum Row {
    New,
    Seen,
    /// It belongs to the bone that is left out.
    OnBone,
}

/// Bones that hang together.
#[derive(Default)]
struct Branch {
    bones: Vec<usize>,
    /// Their rows that are not on the bone left out ...
    rows: Vec<usize>,
    /// ... and those that are.
    joined_at: Vec<usize>,
}
