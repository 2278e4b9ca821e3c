//! Endpoint weights of bones that stretch and twist (thesis 6.2.2): for every bone a smooth function on the shape that
//! goes from 0 at its head to 1 at its tail, linear along the bone, within 0..=1; computed directly as bounded
//! biharmonic weights.

use std::ops::ControlFlow;

use armature_geometry::Influences;
use armature_geometry::operators::SparseMatrix;

use super::sampled_skeleton::{EndpointError, SampledSkeleton};
use crate::biharmonic::BiharmonicError;
use crate::biharmonic::{BiharmonicProblem, BiharmonicSettings};
use crate::biharmonic::{BiharmonicWeights, HandleReport, bounded_biharmonic_weights};
use crate::weight_matrix::WeightMatrix;

/// The values of a bone's endpoint weights at the other bones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OtherBones {
    /// Their values where those bones join this one: 1 at everything that hangs on its tail, 0 at everything that hangs
    /// on its head. Where the skeleton leaves this open, because bones join this one in several places or nowhere,
    /// their vertices take the projection (thesis eq. 6.8). All bones then share one system and its factorisation.
    #[default]
    OnTheirSide,
    /// Whatever is smoothest, as in the thesis: each bone is a separate problem.
    Free,
}

/// Endpoint weights with their certificates.
#[derive(Clone, Debug, PartialEq)]
pub struct EndpointWeights {
    /// n vertices × m bones, `e_i`: each within 0..=1.
    pub weights: WeightMatrix,
    /// Bones without length, or whose vertices all project to one place along them: their weights are ½ everywhere.
    pub without_length: Vec<usize>,
    /// One for every bone.
    pub reports: Vec<HandleReport>,
    /// For each bone, how many vertices took the projection (eq. 6.8) because they are not connected to any fixed bone
    /// (with [`OtherBones::Free`]: to this bone).
    pub projected: Vec<usize>,
    /// For each bone, the other bones whose vertices were given the projection.
    pub told_by_projection: Vec<Vec<usize>>,
}

/// Computes every bone's endpoint weights. `laplacian` and `mass` as for [`BiharmonicProblem`].
///
/// Moving or scaling the mesh with its bones changes the weights by no more than rounding, and swapping a bone's head
/// and tail turns `e` into `1 - e`.
pub fn endpoint_weights(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    others: OtherBones,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<EndpointWeights, EndpointError> {
    skeleton.check(mass.len())?;
    let mut found = Found::default();
    match others {
        OtherBones::OnTheirSide => {
            let fixed = skeleton.held();
            let meetings = Meetings::new(skeleton, &fixed);
            let all: Vec<usize> = (0..skeleton.bones.len()).collect();
            let group = Group { laplacian, mass, skeleton, bones: &all, fixed: &fixed };
            group.solve(|bone| meetings.give(bone), settings, &mut found, progress)?;
        }
        OtherBones::Free => {
            let count = skeleton.bones.len() as f64;
            for bone in 0..skeleton.bones.len() {
                let fixed = skeleton.held_by(bone);
                let along = |bone| (fixed.iter().map(|&vertex| skeleton.along(bone, vertex)).collect(), Vec::new());
                let group = Group { laplacian, mass, skeleton, bones: &[bone], fixed: &fixed };
                let mut of_all = |_, done: f64| progress("solving for each bone's ends", (bone as f64 + done) / count);
                group.solve(along, settings, &mut found, &mut of_all).map_err(|error| name_bone(error, bone))?;
            }
        }
    }
    let (vertices, handles) = (mass.len(), skeleton.bones.len());
    let weights = WeightMatrix::from_sparse_columns(vertices, found.columns);
    let weights = weights.ok_or(BiharmonicError::OutOfMemory { vertices, handles })?;
    let Found { without_length, reports, projected, told_by_projection, .. } = found;
    Ok(EndpointWeights { weights, without_length, reports, projected, told_by_projection })
}

/// Endpoint weights in the order of a skin's influences: as long as `influences.bones()`, with the weight of that
/// slot's bone at that vertex, and ½ in unused slots. `endpoints`: n vertices × m bones. `None` if it has fewer
/// vertices or bones than the influences refer to.
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

/// One bone's weights, `(vertex, weight)` by ascending vertex.
type Column = Vec<(usize, f64)>;

/// What [`EndpointWeights`] will hold, for the bones solved so far.
#[derive(Default)]
struct Found {
    columns: Vec<Column>,
    without_length: Vec<usize>,
    reports: Vec<HandleReport>,
    projected: Vec<usize>,
    told_by_projection: Vec<Vec<usize>>,
}

/// Bones that are solved together, and the vertices where their weights are given.
struct Group<'a> {
    laplacian: &'a SparseMatrix,
    mass: &'a [f64],
    skeleton: &'a SampledSkeleton<'a>,
    bones: &'a [usize],
    fixed: &'a [usize],
}

impl Group<'_> {
    /// Solves; vertices not connected to any given one take the projection. `give` returns what a bone with a length
    /// has at the fixed vertices, and the bones at which that is the projection.
    fn solve(
        &self,
        give: impl Fn(usize) -> (Vec<f64>, Vec<usize>),
        settings: &BiharmonicSettings,
        found: &mut Found,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<(), BiharmonicError> {
        let &Self { laplacian, mass, skeleton, bones, fixed } = self;
        let mut fixed_weights = Vec::with_capacity(fixed.len() * bones.len());
        for &bone in bones {
            let (values, projected_at) = if skeleton.has_length(bone) {
                give(bone)
            } else {
                found.without_length.push(bone);
                (vec![0.5; fixed.len()], Vec::new())
            };
            fixed_weights.extend(values);
            found.told_by_projection.push(projected_at);
        }
        let (fixed_weights, handles) = (fixed_weights.as_slice(), bones.len());
        let problem = BiharmonicProblem { laplacian, mass, fixed, fixed_weights, handles, shape_preservation: None };
        let BiharmonicWeights { weights, reports, unreached, .. } =
            bounded_biharmonic_weights(&problem, settings, progress)?;
        let lost: Vec<usize> = unreached.into_iter().flatten().collect();
        for (at, &bone) in bones.iter().enumerate() {
            let projected = lost.iter().map(|&vertex| (vertex, skeleton.along(bone, vertex)));
            let mut column: Column = weights.column(at).chain(projected).collect();
            column.sort_unstable_by_key(|&(vertex, _)| vertex);
            found.columns.push(column);
            found.projected.push(lost.len());
        }
        found.reports.extend(reports);
        Ok(())
    }
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
    /// Each fixed vertex, and the bones that hold it.
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

    /// The values of `bone`'s endpoint weights at all fixed vertices, and the bones at which that is the projection.
    fn give(&self, bone: usize) -> (Vec<f64>, Vec<usize>) {
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
        untold.sort_unstable();
        (values, untold)
    }

    /// The bones connected to `start` other than through the excluded bone.
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

/// What a search over bones has visited.
struct Seen {
    bones: Vec<bool>,
    rows: Vec<Row>,
}

#[derive(Clone, Copy)]
enum Row {
    New,
    Seen,
    /// It belongs to the excluded bone.
    OnBone,
}

/// Connected bones.
#[derive(Default)]
struct Branch {
    bones: Vec<usize>,
    /// Their rows that are not on the excluded bone ...
    rows: Vec<usize>,
    /// ... and those that are.
    joined_at: Vec<usize>,
}
