//! Weights that come with a model, smoothed: noise goes, and of each bone's extrema exactly those stay that matter (thesis
//! 5.3.3).

use armature_geometry::{Influences, TriangleMesh};
use armature_weights::extrema::persistence;
use armature_weights::finish::sparsify;
use armature_weights::monotone::{
    Data, Keep, MonotoneError, MonotoneOutcome, MonotoneProblem, MonotoneSettings, smooth_keeping,
};
use armature_weights::{FunctionDomain, WeightMatrix};

use super::error::BindError;
use crate::progress::Progress;

/// Waves of this many mean edges lose half of their height: brushes leave wider ones, noise shorter ones.
const NOISE_EDGES: f64 = 8.0;

/// Smoothed weights, and what the user should know.
pub(super) struct SmoothedInfluences {
    pub(super) influences: Influences,
    pub(super) told: String,
}

/// Smooths each bone's weights and keeps the extrema that are at least this persistent. Weights without others stay as they
/// are; so do those of pieces of the mesh whose weights vary less.
pub(super) fn smooth_influences(
    mesh: &TriangleMesh,
    influences: &Influences,
    bone_count: usize,
    least: f64,
    progress: Progress<'_>,
) -> Result<SmoothedInfluences, BindError> {
    let domain = FunctionDomain::of_triangles(mesh).map_err(BindError::Mesh)?;
    let n = mesh.vertices.len();
    let mut columns = vec![Vec::new(); bone_count];
    for vertex in 0..n {
        for (bone, weight) in influences.of_vertex(vertex) {
            columns[usize::from(bone)].push((vertex, f64::from(weight)));
        }
    }
    let FunctionDomain { neighbours, laplacian, mass, .. } = &domain;
    let problem = MonotoneProblem { neighbours, laplacian, mass, order: 2, blend: None, data: None };
    let fidelity = Data::fidelity_for(NOISE_EDGES * domain.mean_edge(), problem.order);
    let (mut before, mut kept, mut smoothed, mut late) = (0, 0, 0, 0);
    for (bone, column) in columns.iter_mut().enumerate() {
        let mut told = |stage: &'static str, done: f64| {
            progress(stage, 0.02 + 0.92 * (bone as f64 + done.clamp(0.0, 1.0)) / bone_count as f64)
        };
        let mut values = vec![0.0; n];
        column.iter().for_each(|&(vertex, weight)| values[vertex] = weight);
        let values = domain.gathered(&values);
        let extrema = persistence(neighbours, &values).map_err(MonotoneError::from)?;
        let stay = extrema.iter().filter(|one| one.persistence >= least).count();
        before += extrema.len();
        if stay == 0 || stay == extrema.len() {
            kept += extrema.len();
            continue;
        }
        let data = Data { values: &values, fidelity };
        let made = smooth_keeping(&problem, data, Keep::Persistence(least), &MonotoneSettings::default(), &mut told)?;
        kept += stay;
        smoothed += 1;
        late += usize::from(made.function.report.outcome != MonotoneOutcome::Converged);
        let whole = domain.spread(&made.function.values);
        *column = whole.into_iter().map(|weight| weight.clamp(0.0, 1.0)).enumerate().collect();
    }
    let unconverged = if late > 0 { format!(", {late} of them only to the limit of steps") } else { String::new() };
    let told = format!(
        "the weights of {smoothed} of {bone_count} bones were smoothed{unconverged}: {kept} of {before} minima and maxima \
         stay, those at least {least} from their saddles"
    );
    let too_large = MonotoneError::OutOfMemory { vertices: n, functions: bone_count };
    let weights = WeightMatrix::from_sparse_columns(n, columns).ok_or(too_large)?;
    let bones: Vec<u16> = (0..bone_count).map(|bone| bone as u16).collect();
    let influences = sparsify(&weights, influences.per_vertex(), &bones, bone_count)?.0;
    Ok(SmoothedInfluences { influences, told })
}
