//! The linear system of bone heat.

use armature_geometry::MeshError;
use armature_geometry::operators::{IntrinsicLaplacian, Lumping, SparseMatrix, intrinsic_delaunay_laplacian};

use super::settings::{BoneHeatError, BoneHeatReport};
use super::sources::Nearest;
use super::surface::HeatSurface;

/// Least mean heat per vertex of each component. A component far smaller than its distance from the bones takes so
/// little heat that conduction (of order one) would drown it in rounding, and the system would be singular. Its weights
/// are then nearly constant, and remain so when its sources are raised to this.
const LEAST_HEAT: f64 = 1e-7;

/// `(-L + M H) W = M H P`.
pub(crate) struct HeatSystem {
    pub(crate) matrix: SparseMatrix,
    /// One column for every hot bone.
    pub(crate) right_hand_sides: Vec<f64>,
    /// Bones that heat at least one vertex, in order.
    pub(crate) hot_bones: Vec<usize>,
    pub(crate) report: BoneHeatReport,
}

impl HeatSystem {
    pub(crate) fn new(
        surface: &HeatSurface,
        nearest: &[Nearest],
        bone_count: usize,
        heat: f64,
    ) -> Result<Self, BoneHeatError> {
        let n = surface.mesh.vertices.len();
        let IntrinsicLaplacian { mut matrix, mass, degenerate_triangles, clamped_edges, flips, .. } =
            operators(surface)?;
        matrix.values_mut().iter_mut().for_each(|value| *value = -*value);
        let mut report = BoneHeatReport {
            welded_vertices: n,
            components: surface.components.count,
            collapsed_triangles: surface.collapsed_triangles,
            duplicate_triangles: surface.duplicate_triangles,
            degenerate_triangles,
            clamped_edges,
            flipped_edges: flips,
            ..BoneHeatReport::default()
        };
        let sources = sources(surface, nearest, &mass, heat, &mut report);
        let mut shares: Vec<Vec<(u32, f64)>> = vec![Vec::new(); bone_count];
        for (vertex, (bones, each)) in sources.into_iter().enumerate() {
            for &bone in bones {
                shares[usize::from(bone)].push((vertex as u32, each));
            }
            add_to_diagonal(&mut matrix, vertex, each * bones.len() as f64);
        }
        report.cold_bones = (0..bone_count).filter(|&bone| shares[bone].is_empty()).collect();
        let hot_bones: Vec<usize> = (0..bone_count).filter(|&bone| !shares[bone].is_empty()).collect();
        let mut right_hand_sides = zeros(n, hot_bones.len())?;
        for (column, &bone) in right_hand_sides.chunks_exact_mut(n).zip(&hot_bones) {
            for &(vertex, share) in &shares[bone] {
                column[vertex as usize] = share;
            }
        }
        Ok(Self { matrix, right_hand_sides, hot_bones, report })
    }

    /// Largest relative residual over all columns, computed with the assembled matrix.
    pub(crate) fn residual(&self, solutions: &[f64]) -> f64 {
        let n = self.matrix.rows();
        let largest = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let norm = (0..n).map(|c| self.matrix.column(c).map(|(_, v)| v.abs()).sum::<f64>()).fold(0.0, f64::max);
        let columns = solutions.chunks_exact(n).zip(self.right_hand_sides.chunks_exact(n));
        columns.fold(0.0, |worst: f64, (w, b)| {
            let difference: Vec<f64> = self.matrix.multiply(w).iter().zip(b).map(|(x, y)| x - y).collect();
            let relative = largest(&difference) / (norm * largest(w) + largest(b));
            // `max` would drop a NaN.
            if relative.is_nan() { f64::INFINITY } else { worst.max(relative) }
        })
    }
}

/// For every vertex, the bones that heat it, and the heat `M H / k` that each of those `k` gives.
fn sources<'a>(
    surface: &HeatSurface,
    nearest: &'a [Nearest],
    mass: &[f64],
    heat: f64,
    report: &mut BoneHeatReport,
) -> Vec<(&'a [u16], f64)> {
    let component_of = |vertex: usize| surface.components.of_vertex[vertex] as usize;
    let blind = blind_components(surface, nearest, report);
    let mut totals = vec![(0.0, 0_u32); surface.components.count];
    let mut sources = Vec::with_capacity(nearest.len());
    for (vertex, seen) in nearest.iter().enumerate() {
        let component = component_of(vertex);
        let isolated = mass[vertex] <= 0.0;
        report.blind_vertices += usize::from(seen.visible.is_empty());
        report.isolated_vertices += usize::from(isolated);
        let bones = if isolated || blind[component] { &seen.bones } else { &seen.visible };
        // An isolated vertex exchanges no heat: any positive factor gives it its sources' shares.
        let each = if isolated { 1.0 } else { mass[vertex] * heat / (seen.distance * seen.distance) };
        let (total, count) = totals[component];
        totals[component] = (total + each * bones.len() as f64, count + 1);
        sources.push((bones.as_slice(), each));
    }
    for (vertex, (_, each)) in sources.iter_mut().enumerate() {
        let (total, count) = totals[component_of(vertex)];
        *each *= (LEAST_HEAT * f64::from(count) / total).max(1.0);
    }
    sources
}

/// The surface's operators; a mesh whose triangles have all collapsed has no conductance and no area.
fn operators(surface: &HeatSurface) -> Result<IntrinsicLaplacian, MeshError> {
    let n = surface.mesh.vertices.len();
    if !surface.mesh.triangles.is_empty() {
        return intrinsic_delaunay_laplacian(&surface.mesh, Lumping::VoronoiHybrid);
    }
    let diagonal: Vec<(u32, u32, f64)> = (0..n as u32).map(|v| (v, v, 0.0)).collect();
    Ok(IntrinsicLaplacian {
        // In range by construction.
        matrix: SparseMatrix::from_triplets(n, n, &diagonal).unwrap_or_default(),
        mass: vec![0.0; n],
        flips: 0,
        omitted_triangles: 0,
        degenerate_triangles: 0,
        clamped_edges: 0,
        doubled: false,
    })
}

fn add_to_diagonal(matrix: &mut SparseMatrix, index: usize, value: f64) {
    let range = matrix.column_starts()[index]..matrix.column_starts()[index + 1];
    if let Some(entry) = range.clone().find(|&entry| matrix.row_indices()[entry] == index) {
        matrix.values_mut()[entry] += value;
    }
}

/// Which components see no bone; the report lists each by its first vertex.
fn blind_components(surface: &HeatSurface, nearest: &[Nearest], report: &mut BoneHeatReport) -> Vec<bool> {
    let mut blind = vec![true; surface.components.count];
    for (vertex, seen) in nearest.iter().enumerate() {
        blind[surface.components.of_vertex[vertex] as usize] &= seen.visible.is_empty();
    }
    let mut named = vec![false; surface.components.count];
    for (vertex, &welded) in surface.welded_of.iter().enumerate() {
        let component = surface.components.of_vertex[welded as usize] as usize;
        if blind[component] && !named[component] {
            named[component] = true;
            report.blind_components.push(vertex);
        }
    }
    blind
}

/// A dense matrix of zeros; the numbers of vertices and bones both come from files, so their product may be anything.
pub(crate) fn zeros(vertices: usize, bones: usize) -> Result<Vec<f64>, BoneHeatError> {
    let out_of_memory = BoneHeatError::OutOfMemory { vertices, bones };
    let count = vertices.checked_mul(bones).ok_or_else(|| out_of_memory.clone())?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| out_of_memory)?;
    values.resize(count, 0.0);
    Ok(values)
}
