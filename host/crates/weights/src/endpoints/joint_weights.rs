//! Bounded biharmonic weights of a skeleton's joints as point handles, and the endpoint weights derived from them
//! (thesis 6.2.3, eq. 6.7).

use std::ops::ControlFlow;

use armature_geometry::operators::SparseMatrix;

use super::sampled_skeleton::{EndpointError, SampledSkeleton};
use crate::biharmonic::{BiharmonicProblem, BiharmonicSettings};
use crate::biharmonic::{BiharmonicWeights, bounded_biharmonic_weights};
use crate::weight_matrix::WeightMatrix;

/// Weights of the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointWeights {
    /// n vertices × joints, 1 at the joint and 0 at all others; not normalised, with a certificate for every joint.
    /// Vertices of [`BiharmonicWeights::unreached`] pieces have no weight.
    pub weights: BiharmonicWeights,
    /// The vertex of each joint, ascending.
    pub vertices: Vec<usize>,
    /// For each bone, the joints at its head and tail.
    pub ends: Vec<[usize; 2]>,
}

/// Computes a bounded biharmonic weight for every joint: each end of a bone, counted once where bones share a vertex.
/// `laplacian` and `mass` as for [`BiharmonicProblem`]; the bones between the joints hold nothing.
pub fn joint_weights(
    laplacian: &SparseMatrix,
    mass: &[f64],
    skeleton: &SampledSkeleton<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<JointWeights, EndpointError> {
    skeleton.check(mass.len())?;
    let end_vertices: Vec<[usize; 2]> = (0..skeleton.bones.len()).map(|bone| skeleton.ends(bone)).collect();
    let mut vertices: Vec<usize> = end_vertices.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let joints = vertices.len();
    let mut given = vec![0.0; joints * joints];
    (0..joints).for_each(|joint| given[joint * joints + joint] = 1.0);
    let problem = BiharmonicProblem {
        laplacian,
        mass,
        fixed: &vertices,
        fixed_weights: &given,
        handles: joints,
        shape_preservation: None,
    };
    let weights = bounded_biharmonic_weights(&problem, settings, progress)?;
    // Every end is one of the joints.
    let joint_of = |vertex: usize| vertices.partition_point(|&v| v < vertex);
    let ends = end_vertices.iter().map(|ends| ends.map(joint_of)).collect();
    Ok(JointWeights { weights, vertices, ends })
}

/// `e_i = ½ ((1 - j_a) + j_b)` (thesis eq. 6.7) for every bone, from the weights of the joints at its head and tail: 0
/// at the head, 1 at the tail, ½ where neither joint has any weight. `joints`: n vertices × joints, each within 0..=1;
/// `ends`: for each bone its joints at head and tail. `None` if a bone ends in a joint without weights.
pub fn endpoint_weights_from_joints(joints: &WeightMatrix, ends: &[[usize; 2]]) -> Option<WeightMatrix> {
    if ends.iter().flatten().any(|&joint| joint >= joints.bones()) {
        return None;
    }
    let one = |&[head, tail]: &[usize; 2]| {
        let (head, tail) = (joints.bone(head), joints.bone(tail));
        head.into_iter().zip(tail).map(|(at_head, at_tail)| 0.5 * ((1.0 - at_head) + at_tail)).collect::<Vec<_>>()
    };
    WeightMatrix::from_columns(joints.vertices(), ends.len(), &ends.iter().flat_map(one).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoint_weights_follow_from_joints() {
        let joints = WeightMatrix::from_columns(3, 2, &[1.0, 0.25, 0.0, 0.0, 0.75, 0.0]).unwrap();
        let endpoint = endpoint_weights_from_joints(&joints, &[[0, 1], [1, 0], [1, 1]]).unwrap();
        assert_eq!(endpoint.bone(0), [0.0, 0.75, 0.5]);
        assert_eq!(endpoint.bone(1), [1.0, 0.25, 0.5]);
        assert_eq!(endpoint.bone(2), [0.5, 0.5, 0.5]);
        assert_eq!(endpoint_weights_from_joints(&joints, &[[0, 2]]), None);
    }
}
