//! The formulas, written out literally in `f64`.

use armature_deform::skin::StretchTwist;
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};

use super::{Character, wide};

fn widen(frame: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: frame.matrix3.as_dmat3(), translation: frame.translation.as_dvec3() }
}

/// Linear blending (thesis eq. 2.1): where a vertex goes, and its blended map.
pub(crate) fn linear_blend(character: &Character, pose: &[Affine3A], vertex: usize) -> (DVec3, DMat3) {
    let at = wide(character.positions[vertex]);
    let (mut moved, mut blended) = (DVec3::ZERO, DMat3::ZERO);
    for (bone, weight) in character.influences.of_vertex(vertex) {
        let map = widen(&pose[usize::from(bone)]) * widen(&character.frames[usize::from(bone)]).inverse();
        moved += f64::from(weight) * map.transform_point3(at);
        blended += map.matrix3 * f64::from(weight);
    }
    (moved, blended)
}

/// The rigid motion that weighted rotations and translations blend to as dual quaternions, `q` and `½ t q` divided by
/// the length of the real part; each on the side of the first one.
pub(crate) fn dual_quaternion_blend(terms: &[(f64, DQuat, DVec3)]) -> (DQuat, DVec3) {
    let (mut real, mut dual) = (DQuat::from_array([0.0; 4]), DQuat::from_array([0.0; 4]));
    for (weight, turn, shift) in terms {
        let weight = if turn.dot(terms[0].1) < 0.0 { -weight } else { *weight };
        real += *turn * weight;
        dual += DQuat::from_vec4(shift.extend(0.0)) * *turn * (0.5 * weight);
    }
    let length = real.length();
    let (real, dual) = (real * (1.0 / length), dual * (1.0 / length));
    let shift = dual * 2.0 * real.conjugate();
    (real, DVec3::new(shift.x, shift.y, shift.z))
}

/// The motions since rest of a vertex's bones, rigid frames.
pub(crate) fn rigid_terms(character: &Character, pose: &[Affine3A], vertex: usize) -> Vec<(f64, DQuat, DVec3)> {
    let term = |(bone, weight): (u16, f32)| {
        let moved = widen(&pose[usize::from(bone)]) * widen(&character.frames[usize::from(bone)]).inverse();
        (f64::from(weight), DQuat::from_mat3(&moved.matrix3).normalize(), moved.translation)
    };
    character.influences.of_vertex(vertex).map(term).collect()
}

/// The same where bones stretch and twist (thesis eq. 6.5); slots without weight are skipped.
pub(crate) fn stretched_terms(character: &Character, pose: &[StretchTwist], vertex: usize) -> Vec<(f64, DQuat, DVec3)> {
    let per_vertex = character.influences.per_vertex();
    let term = |slot: usize| {
        let bone = usize::from(character.influences.bones()[slot]);
        let (weight, e) = (f64::from(character.influences.weights()[slot]), f64::from(character.ends[slot]));
        let (rest, pose) = (&character.segments[bone], &pose[bone]);
        let along = (rest.end - rest.start).as_dvec3();
        let [first, last] = pose.twist.map(f64::from);
        let twist = DQuat::from_axis_angle(along.normalize(), (1.0 - e) * first + e * last);
        let turn = pose.turn.as_dquat().normalize() * twist;
        let stretch = along * (f64::from(pose.stretch) - 1.0) * e;
        (weight, turn, pose.start.as_dvec3() + turn * (stretch - rest.start.as_dvec3()))
    };
    (per_vertex * vertex..per_vertex * (vertex + 1)).map(term).filter(|term| term.0 > 0.0).collect()
}
