//! The inside of a character and how much it follows each bone, for the energy of a volume.
//!
//! Files hold the weights of the surface only. Those inside are found again: near the surface they are what the surface
//! next to them has, and farther in they are, of all weights between zero and one, those of least Laplacian energy with
//! these values, which is what bounded biharmonic weights are.

use std::ops::ControlFlow;

use armature_deform::arap::{ArapError, WeightRows};
use armature_geometry::operators::{Lumping, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_geometry::volume::{Resolution, Volume, VolumeError, VolumeInput, VolumeSettings};
use armature_geometry::{Influences, TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{
    BiharmonicError, BiharmonicProblem, BiharmonicSettings, bounded_biharmonic_weights,
};
use armature_weights::finish::normalise;
use armature_weights::handles::HandleBoundary;

use super::error::IkError;
use crate::handle_weights::without_flat;
use crate::progress::Progress;
use crate::volume::{Made, MakeError, make_volume};

/// Vertices of the volume; weights are as smooth as these resolve.
const VERTICES: usize = 5_000;
/// A vertex takes the weights of surface vertices that make up at least so much of one.
const NEAR: f64 = 0.05;
/// Weights below this move nothing that could be seen.
const LEAST_WEIGHT: f64 = 1e-4;
/// The volume's share of the time.
const VOLUME_SHARE: f64 = 0.6;

/// Tetrahedra that fill a character, and their weights.
#[derive(Clone, Debug)]
pub(super) struct Inside {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) tetrahedra: Vec<[u32; 4]>,
    /// By bone.
    pub(super) weights: WeightRows,
}

impl Inside {
    /// Fills a surface whose vertices follow these bones.
    pub(super) fn of(
        surface: &TriangleMesh,
        influences: &Influences,
        bones: usize,
        progress: Progress<'_>,
    ) -> Result<Self, IkError> {
        let input = VolumeInput { surface, segments: &[], points: &[] };
        let settings =
            VolumeSettings { resolution: Resolution::Embedded { vertices: VERTICES }, ..VolumeSettings::default() };
        let mut told = |stage, done: f64| progress(stage, VOLUME_SHARE * done);
        let made = match make_volume(&input, &settings, &mut told).map_err(no_volume)? {
            Made::Solid(made) => *made,
            Made::Flat(_) => return Err(IkError::NoInside),
        };
        let mut moving: Vec<bool> = vec![false; bones];
        for vertex in 0..influences.vertex_count() {
            influences.of_vertex(vertex).for_each(|(bone, weight)| moving[usize::from(bone)] |= weight > 0.0);
        }
        let moving: Vec<usize> = (0..bones).filter(|bone| moving[*bone]).collect();
        let held = near_the_surface(&made, influences, &moving);
        let (solid, _) = without_flat(&made.mesh);
        let mut told = |stage, done: f64| progress(stage, VOLUME_SHARE + (1.0 - VOLUME_SHARE) * done);
        let weights = spread(&solid, &held, &mut told)?;
        Ok(Self::with_weights(&solid, &weights, &moving))
    }

    /// Leaves out elements with a vertex that follows no bone.
    fn with_weights(solid: &TetrahedralMesh, weights: &WeightMatrix, moving: &[usize]) -> Self {
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); solid.vertices.len()];
        for (column, &bone) in moving.iter().enumerate() {
            weights.column(column).filter(|(_, w)| *w >= LEAST_WEIGHT).for_each(|(v, w)| rows[v].push((bone, w)));
        }
        let follows = |corners: &&[u32; 4]| corners.iter().all(|&vertex| !rows[vertex as usize].is_empty());
        let mut tetrahedra: Vec<[u32; 4]> = solid.tetrahedra.iter().filter(follows).copied().collect();
        let mut place = vec![u32::MAX; rows.len()];
        let (mut positions, mut kept) = (Vec::new(), WeightRows::default());
        for vertex in tetrahedra.iter_mut().flatten() {
            let old = *vertex as usize;
            if place[old] == u32::MAX {
                place[old] = positions.len() as u32;
                positions.push(solid.vertices[old]);
                let sum: f64 = rows[old].iter().map(|(_, weight)| weight).sum();
                kept.push(rows[old].iter().map(|(bone, weight)| (*bone, weight / sum)));
            }
            *vertex = place[old];
        }
        Self { positions, tetrahedra, weights: kept }
    }
}

fn no_volume(error: MakeError) -> IkError {
    match error {
        MakeError::Solid(VolumeError::Cancelled) => IkError::Shape(ArapError::Cancelled),
        other => IkError::Volume(other),
    }
}

/// The weights of the volume's vertices that have vertices of the surface around them: the mean of those, by how near
/// they are.
fn near_the_surface(made: &Volume, influences: &Influences, moving: &[usize]) -> HandleBoundary {
    let vertices = made.mesh.vertices.len();
    let mut share = vec![0.0; vertices];
    let mut sums: Vec<Vec<(u16, f64)>> = vec![Vec::new(); vertices];
    for vertex in 0..influences.vertex_count() {
        let corners = made.mesh.tetrahedra[made.surface.tetrahedra[vertex] as usize];
        for (corner, part) in corners.into_iter().zip(made.surface.barycentric[vertex]) {
            let (corner, part) = (corner as usize, part.clamp(0.0, 1.0));
            share[corner] += part;
            for (bone, weight) in influences.of_vertex(vertex) {
                let value = part * f64::from(weight);
                match sums[corner].iter_mut().find(|(own, _)| *own == bone) {
                    Some((_, sum)) => *sum += value,
                    None => sums[corner].push((bone, value)),
                }
            }
        }
    }
    let fixed: Vec<usize> = (0..vertices).filter(|vertex| share[*vertex] >= NEAR).collect();
    let mut fixed_weights = vec![0.0; fixed.len() * moving.len()];
    for (row, &vertex) in fixed.iter().enumerate() {
        let whole: f64 = sums[vertex].iter().map(|(_, sum)| sum).sum();
        for (bone, sum) in &sums[vertex] {
            if let Ok(column) = moving.binary_search(&usize::from(*bone)) {
                fixed_weights[column * fixed.len() + row] = (sum / whole.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            }
        }
    }
    HandleBoundary { fixed, fixed_weights, handles: moving.len() }
}

fn spread(solid: &TetrahedralMesh, held: &HandleBoundary, progress: Progress<'_>) -> Result<WeightMatrix, IkError> {
    let no_inside = |_| IkError::NoInside;
    let laplacian = cotangent_laplacian_tetrahedra(solid).map_err(no_inside)?;
    let mass = lumped_mass_tetrahedra(solid, Lumping::Barycentric).map_err(no_inside)?;
    let problem = BiharmonicProblem::new(&laplacian.matrix, &mass, held);
    let mut told = |stage: &'static str, done: f64| -> ControlFlow<()> { progress(stage, done) };
    let solved = bounded_biharmonic_weights(&problem, &BiharmonicSettings::interactive(), &mut told);
    let solved = solved.map_err(|error| match error {
        BiharmonicError::Cancelled { .. } => IkError::Shape(ArapError::Cancelled),
        other => IkError::Weights(other),
    });
    let mut weights = solved?.weights;
    normalise(&mut weights);
    Ok(weights)
}
