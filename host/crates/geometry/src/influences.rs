//! Sparse skinning weights: a few influences per vertex.

/// For every vertex the same number of `(bone, weight)` pairs, largest first, with weight 0 in unused slots.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    per_vertex: usize,
    bones: Vec<u16>,
    weights: Vec<f32>,
}

/// Why influences are invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InfluencesError {
    /// The two arrays differ in length or are not a multiple of the influences per vertex.
    #[error("{bones} bone indices and {weights} weights do not make {per_vertex} influences per vertex")]
    Shape {
        /// Length of the bone index array.
        bones: usize,
        /// Length of the weight array.
        weights: usize,
        /// Requested influences per vertex.
        per_vertex: usize,
    },
    /// A vertex has a weight that is negative, NaN or infinite.
    #[error("vertex {vertex} has the weight {weight}; weights must be finite and not negative")]
    BadWeight {
        /// Zero-based vertex.
        vertex: usize,
        /// The offending value.
        weight: f32,
    },
    /// A vertex follows a bone that the skeleton does not have.
    #[error("vertex {vertex} follows bone {bone}, but there are only {bone_count} bones")]
    BoneOutOfRange {
        /// Zero-based vertex.
        vertex: usize,
        /// The offending zero-based bone index.
        bone: u16,
        /// How many bones there are.
        bone_count: usize,
    },
    /// A vertex does not follow any bone.
    #[error("vertex {vertex} has no weight on any bone")]
    Unweighted {
        /// Zero-based vertex.
        vertex: usize,
    },
}

impl Influences {
    /// Takes `per_vertex` bone indices and weights per vertex (vertex-major, both `n·per_vertex` long), sorts each
    /// vertex's influences by decreasing weight (ties by bone) and scales them to sum to one.
    pub fn new(
        per_vertex: usize,
        mut bones: Vec<u16>,
        mut weights: Vec<f32>,
        bone_count: usize,
    ) -> Result<Self, InfluencesError> {
        if per_vertex == 0 || bones.len() != weights.len() || !weights.len().is_multiple_of(per_vertex) {
            return Err(InfluencesError::Shape { bones: bones.len(), weights: weights.len(), per_vertex });
        }
        let mut order: Vec<(u16, f32)> = Vec::with_capacity(per_vertex);
        let rows = bones.chunks_exact_mut(per_vertex).zip(weights.chunks_exact_mut(per_vertex));
        for (vertex, (bones, weights)) in rows.enumerate() {
            if let Some(&weight) = weights.iter().find(|w| !w.is_finite() || **w < 0.0) {
                return Err(InfluencesError::BadWeight { vertex, weight });
            }
            let offending = bones.iter().zip(weights.iter()).find(|(b, w)| **w > 0.0 && usize::from(**b) >= bone_count);
            if let Some((&bone, _)) = offending {
                return Err(InfluencesError::BoneOutOfRange { vertex, bone, bone_count });
            }
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            if sum <= 0.0 {
                return Err(InfluencesError::Unweighted { vertex });
            }
            order.clear();
            order.extend(bones.iter().copied().zip(weights.iter().copied()));
            order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            for ((bone, weight), &(b, w)) in bones.iter_mut().zip(weights.iter_mut()).zip(&order) {
                let used = w > 0.0;
                *bone = if used { b } else { 0 };
                *weight = if used { (f64::from(w) / sum) as f32 } else { 0.0 };
            }
        }
        Ok(Self { per_vertex, bones, weights })
    }

    /// Takes influences as returned by [`bones`](Self::bones) and [`weights`](Self::weights) (largest first, summing to
    /// one within 1e-5), bit for bit, so that what was stored in a file comes back the same. Anything else goes through
    /// [`new`](Self::new).
    pub fn restore(
        per_vertex: usize,
        bones: Vec<u16>,
        weights: Vec<f32>,
        bone_count: usize,
    ) -> Result<Self, InfluencesError> {
        let checked = Self::new(per_vertex, bones.clone(), weights.clone(), bone_count)?;
        let same = checked.weights.iter().zip(&weights).all(|(new, kept)| (new - kept).abs() < 1e-5);
        Ok(if same && checked.bones == bones { Self { per_vertex, bones, weights } } else { checked })
    }

    /// Influences per vertex, used or not.
    pub fn per_vertex(&self) -> usize {
        self.per_vertex
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.weights.len().checked_div(self.per_vertex).unwrap_or(0)
    }

    /// Bone indices, vertex-major, `vertex_count · per_vertex` long.
    pub fn bones(&self) -> &[u16] {
        &self.bones
    }

    /// Weights, vertex-major; each vertex's sum to one.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The used influences of one vertex, largest first.
    pub fn of_vertex(&self, vertex: usize) -> impl Iterator<Item = (u16, f32)> + '_ {
        let row = vertex * self.per_vertex..(vertex + 1) * self.per_vertex;
        self.bones[row.clone()].iter().copied().zip(self.weights[row].iter().copied()).take_while(|(_, w)| *w > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_sorted_and_sum_to_one() {
        let influences = Influences::new(2, vec![3, 1, 9, 2], vec![1.0, 3.0, 0.0, 0.5], 4).unwrap();
        assert_eq!(influences.vertex_count(), 2);
        assert_eq!(influences.of_vertex(0).collect::<Vec<_>>(), [(1, 0.75), (3, 0.25)]);
        assert_eq!(influences.of_vertex(1).collect::<Vec<_>>(), [(2, 1.0)]);
    }

    #[test]
    fn nonsense_is_named() {
        assert!(matches!(Influences::new(2, vec![0; 3], vec![0.0; 3], 1), Err(InfluencesError::Shape { .. })));
        assert!(matches!(
            Influences::new(1, vec![0], vec![f32::NAN], 1),
            Err(InfluencesError::BadWeight { vertex: 0, .. })
        ));
        assert!(matches!(Influences::new(1, vec![1], vec![1.0], 1), Err(InfluencesError::BoneOutOfRange { .. })));
        assert!(matches!(Influences::new(1, vec![0], vec![0.0], 1), Err(InfluencesError::Unweighted { vertex: 0 })));
    }
}
