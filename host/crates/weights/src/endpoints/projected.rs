//! Endpoint weights without a volume: where each point projects onto a bone (thesis eq. 6.8).

use glam::DVec3;

use crate::bone_segment::BoneSegment;
use crate::weight_matrix::WeightMatrix;

/// How far along a bone its nearest place to a point is: 0 at the head, 1 at the tail. ½ everywhere for a bone without
/// length or with an end that is not finite.
pub fn projected_endpoint_weight(bone: &BoneSegment, point: [f64; 3]) -> f64 {
    let (head, tail) = (DVec3::from(bone.head), DVec3::from(bone.tail));
    let along = tail - head;
    // Scaled by the largest coordinate first, so that squares neither underflow nor overflow.
    let scale = along.abs().max_element();
    let unit = along / scale;
    let share = ((DVec3::from(point) - head) / scale).dot(unit) / unit.length_squared();
    if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 }
}

/// `e_proj` (thesis eq. 6.8) of n points on m bones: within 0..=1 and linear along the bones, but blind to the shape
/// and with a kink where the bones end. For meshes without a volume, and as a starting point for painting.
pub fn projected_endpoint_weights(points: &[[f64; 3]], bones: &[BoneSegment]) -> WeightMatrix {
    let values: Vec<f64> =
        bones.iter().flat_map(|bone| points.iter().map(move |&point| projected_endpoint_weight(bone, point))).collect();
    WeightMatrix::from_columns(points.len(), bones.len(), &values).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_fall_onto_the_bone() {
        let bone = BoneSegment { head: [1.0, 0.0, 0.0], tail: [1.0, 4.0, 0.0] };
        let points = [[9.0, -1.0, 0.0], [0.0, 1.0, 7.0], [1.0, 3.0, 0.0], [2.0, 5.0, 0.0]];
        let weights = projected_endpoint_weights(&points, &[bone, BoneSegment { head: [2.0; 3], tail: [2.0; 3] }]);
        assert_eq!(weights.bone(0), [0.0, 0.25, 0.75, 1.0]);
        assert_eq!(weights.bone(1), [0.5; 4]);
        let small = BoneSegment { head: [0.0; 3], tail: [0.0, 1e-200, 0.0] };
        assert_eq!(projected_endpoint_weights(&[[0.0, 0.25e-200, 0.0]], &[small]).bone(0), [0.25]);
        assert_eq!(projected_endpoint_weights(&[[f64::NAN; 3]], &[bone]).bone(0), [0.5]);
    }
}
