//! From weights on many bones to a few influences per vertex.

use armature_geometry::{Influences, InfluencesError};

use crate::weight_matrix::WeightMatrix;

/// Weights below this are numerical dust and are dropped first: at such a weight a vertex moves by less than a
/// ten-thousandth of what the bone moves.
const DUST: f64 = 1e-4;

/// What was lost by keeping only a few influences.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sparsification {
    /// Largest sum of weights dropped at one vertex, as a fraction of its whole.
    pub max_dropped: f64,
    /// Mean over all vertices of the same.
    pub mean_dropped: f64,
    /// Vertices that lost more than dust.
    pub truncated_vertices: usize,
    /// The most influences any vertex would have had.
    pub max_influences_before: usize,
}

/// Why weights could not be made sparse.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SparsifyError {
    /// The limit on influences is zero.
    #[error("at least one influence per vertex must be kept")]
    NoInfluences,
    /// There are not as many bones as columns.
    #[error("{columns} columns of weights, but {bones} bones to assign them to")]
    ColumnCount {
        /// Columns of the matrix.
        columns: usize,
        /// Bones given.
        bones: usize,
    },
    /// A weight is NaN, infinite or clearly negative, a vertex follows no bone, or a bone is out of range.
    #[error(transparent)]
    Influences(#[from] InfluencesError),
}

/// Keeps the `max_influences` heaviest weights of every vertex, without dust, and scales them to sum to one.
/// `bone_of_column[j]` is the bone that column `j` belongs to (columns of the same bone are added); `bone_count` is the
/// number of bones in the skeleton. Negative rounding errors count as zero.
pub fn sparsify(
    weights: &WeightMatrix,
    max_influences: usize,
    bone_of_column: &[u16],
    bone_count: usize,
) -> Result<(Influences, Sparsification), SparsifyError> {
    if max_influences == 0 {
        return Err(SparsifyError::NoInfluences);
    }
    if bone_of_column.len() != weights.bones() {
        return Err(SparsifyError::ColumnCount { columns: weights.bones(), bones: bone_of_column.len() });
    }
    // More slots than columns would stay empty.
    let slots = max_influences.min(weights.bones().max(1));
    let mut bones = Vec::with_capacity(weights.vertices() * slots);
    let mut values = Vec::with_capacity(weights.vertices() * slots);
    let mut report = Sparsification::default();
    let mut dropped_sum = 0.0;
    let mut row: Vec<(u16, f64)> = Vec::with_capacity(weights.bones());
    let rows = weights.rows();
    for vertex in 0..weights.vertices() {
        gather_row(rows.of(vertex), vertex, bone_of_column, &mut row)?;
        let total: f64 = row.iter().map(|(_, weight)| weight).sum();
        if total <= 0.0 {
            return Err(InfluencesError::Unweighted { vertex }.into());
        }
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        // The heaviest stays even if there are so many bones that every weight is dust.
        let kept_before = row.iter().take_while(|(_, weight)| *weight > DUST * total).count().max(1);
        let kept = kept_before.min(slots);
        let dropped = row[kept..].iter().map(|(_, weight)| weight).sum::<f64>() / total;
        report.max_dropped = report.max_dropped.max(dropped);
        report.truncated_vertices += usize::from(kept_before > kept);
        report.max_influences_before = report.max_influences_before.max(kept_before);
        dropped_sum += dropped;
        for slot in 0..slots {
            let (bone, weight) = if slot < kept { row[slot] } else { (0, 0.0) };
            bones.push(bone);
            values.push(weight as f32);
        }
    }
    report.mean_dropped = dropped_sum / (weights.vertices().max(1) as f64);
    Ok((Influences::new(slots, bones, values, bone_count)?, report))
}

/// The positive weights of one vertex by bone; columns of one bone are added.
fn gather_row(
    weights: &[(u32, f64)],
    vertex: usize,
    bone_of_column: &[u16],
    row: &mut Vec<(u16, f64)>,
) -> Result<(), InfluencesError> {
    row.clear();
    for &(column, weight) in weights {
        let bone = bone_of_column[column as usize];
        if !weight.is_finite() || weight < -DUST {
            return Err(InfluencesError::BadWeight { vertex, weight: weight as f32 });
        }
        if weight <= 0.0 {
            continue;
        }
        match row.iter_mut().find(|(b, _)| *b == bone) {
            Some((_, sum)) => *sum += weight,
            None => row.push((bone, weight)),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_heaviest_and_says_what_it_dropped() {
        let columns = vec![0.5, 0.0, 0.3, 1.0, 0.2, 0.0, -1e-12, 1e-6];
        let weights = WeightMatrix::from_columns(2, 4, &columns).unwrap();
        let (influences, report) = sparsify(&weights, 2, &[4, 5, 6, 7], 8).unwrap();
        assert_eq!(influences.of_vertex(0).collect::<Vec<_>>(), [(4, 0.625), (5, 0.375)]);
        assert_eq!(influences.of_vertex(1).collect::<Vec<_>>(), [(5, 1.0)]);
        assert!((report.max_dropped - 0.2).abs() < 1e-9);
        assert!((report.mean_dropped - 0.1).abs() < 1e-6);
        assert_eq!((report.truncated_vertices, report.max_influences_before), (1, 3));
    }

    #[test]
    fn columns_of_one_bone_are_added() {
        let weights = WeightMatrix::from_columns(1, 3, &[0.25, 0.4, 0.35]).unwrap();
        let (influences, report) = sparsify(&weights, 1, &[0, 1, 0], 2).unwrap();
        assert_eq!(influences.of_vertex(0).collect::<Vec<_>>(), [(0, 1.0)]);
        assert!((report.max_dropped - 0.4).abs() < 1e-12);
    }

    #[test]
    fn nonsense_is_named() {
        let weights = WeightMatrix::from_columns(1, 1, &[f64::NAN]).unwrap();
        assert_eq!(sparsify(&weights, 0, &[0], 1), Err(SparsifyError::NoInfluences));
        assert_eq!(sparsify(&weights, 1, &[], 1), Err(SparsifyError::ColumnCount { columns: 1, bones: 0 }));
        assert!(matches!(
            sparsify(&weights, 1, &[0], 1),
            Err(SparsifyError::Influences(InfluencesError::BadWeight { vertex: 0, .. }))
        ));
        let nothing = WeightMatrix::from_columns(1, 1, &[0.0]).unwrap();
        assert_eq!(sparsify(&nothing, 1, &[0], 1), Err(InfluencesError::Unweighted { vertex: 0 }.into()));
        let one = WeightMatrix::from_columns(1, 1, &[1.0]).unwrap();
        assert!(matches!(
            sparsify(&one, 1, &[3], 2),
            Err(SparsifyError::Influences(InfluencesError::BoneOutOfRange { bone: 3, .. }))
        ));
    }
}
