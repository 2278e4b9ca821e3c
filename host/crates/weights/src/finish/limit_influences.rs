//! Fewer influences per vertex.

use armature_geometry::Influences;

use super::sparsify::{Sparsification, SparsifyError};

/// Keeps the `most` heaviest influences of every vertex and scales them to sum to one. Rows with no more stay as they are,
/// bit for bit.
pub fn limit_influences(
    influences: &Influences,
    most: usize,
    bone_count: usize,
) -> Result<(Influences, Sparsification), SparsifyError> {
    if most == 0 {
        return Err(SparsifyError::NoInfluences);
    }
    let slots = influences.per_vertex().min(most);
    let vertices = influences.vertex_count();
    let (mut bones, mut weights) = (Vec::with_capacity(vertices * slots), Vec::with_capacity(vertices * slots));
    let mut report = Sparsification::default();
    let mut dropped_sum = 0.0;
    for vertex in 0..vertices {
        let row: Vec<(u16, f32)> = influences.of_vertex(vertex).collect();
        report.max_influences_before = report.max_influences_before.max(row.len());
        let sum = |row: &[(u16, f32)]| row.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
        let kept = row.len().min(slots);
        let share = sum(&row[..kept]);
        for slot in 0..slots {
            let (bone, weight) = row[..kept].get(slot).copied().unwrap_or((0, 0.0));
            bones.push(bone);
            weights.push(if kept < row.len() { (f64::from(weight) / share) as f32 } else { weight });
        }
        if kept < row.len() {
            let dropped = sum(&row[kept..]) / sum(&row);
            report.truncated_vertices += 1;
            report.max_dropped = report.max_dropped.max(dropped);
            dropped_sum += dropped;
        }
    }
    report.mean_dropped = dropped_sum / vertices.max(1) as f64;
    Ok((Influences::restore(slots.max(1), bones, weights, bone_count)?, report))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_rows_over_the_limit_change() {
        let bones = vec![2, 0, 1, 0, 3, 1, 0, 0];
        let weights = vec![0.5, 0.3, 0.15, 0.05, 0.7, 0.3, 0.0, 0.0];
        let painted = Influences::new(4, bones, weights, 4).unwrap();
        let (two, report) = limit_influences(&painted, 2, 4).unwrap();
        assert_eq!(two.of_vertex(0).collect::<Vec<_>>(), [(2, 0.625), (0, 0.375)]);
        assert_eq!(two.of_vertex(1).collect::<Vec<_>>(), painted.of_vertex(1).collect::<Vec<_>>());
        assert_eq!((report.truncated_vertices, report.max_influences_before), (1, 4));
        assert!((report.max_dropped - 0.2).abs() < 1e-6 && (report.mean_dropped - 0.1).abs() < 1e-6);
        assert_eq!(limit_influences(&painted, 9, 4).unwrap().0, painted);
        assert_eq!(limit_influences(&painted, 0, 4), Err(SparsifyError::NoInfluences));
    }
}
