//! Bones that move and grow as the energy has them, for characters that are no rigs.

use armature_deform::nearest_rotation::{LANES, nearest_rotations};
use armature_rig::{Pose, Transform};
use glam::{Affine3A, Mat3, Quat, Vec3};

use super::layout::Layout;
use super::rest::RestRig;

/// Poses every solved bone, and those right below, by its handle's map: where its head goes, the nearest rotation, and how
/// much it grows. Stretch in one direction and shear are lost: below a bone that has them, a pose could not turn driven
/// bones exactly. `frames`: room for `model_from_bone` of every bone.
pub(super) fn loosen(rig: &RestRig, layout: &Layout, maps: &[Affine3A], frames: &mut [Affine3A], pose: &mut Pose) {
    for bone in 0..frames.len() {
        let handle = layout.handle_of_bone[bone];
        let above = rig.parent(bone).map_or(Affine3A::IDENTITY, |parent| frames[parent]);
        let own = layout.bone_of_handle[handle] == bone;
        let of_parent = rig.parent(bone).is_some_and(|parent| layout.is_solved(layout.handle_of_bone[parent]));
        if own && (layout.is_solved(handle) || of_parent) {
            let rest = Affine3A::from_rotation_translation(rig.rotations[bone], rig.heads[bone]);
            if let Some(local) = split(&(above.inverse() * maps[handle] * rest)) {
                let scale = rig.skeleton.bones()[bone].rest.scale;
                pose.parent_from_bone[bone] = Transform { scale: local.scale * scale, ..local };
            }
        }
        frames[bone] = above * pose.parent_from_bone[bone].to_affine();
    }
}

/// The nearest translation, rotation and uniform scale; `None` for a map that has collapsed.
fn split(map: &Affine3A) -> Option<Transform> {
    let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(Vec3::from);
    if !map.is_finite() || map.matrix3.determinant() <= f32::MIN_POSITIVE {
        return None;
    }
    let mut lanes = [[[0.0; LANES]; 3]; 3];
    for (column, values) in columns.iter().enumerate() {
        (0..3).for_each(|row| lanes[row][column][0] = values[row]);
    }
    let turned = nearest_rotations(&lanes);
    let turned = [0, 1, 2].map(|column| Vec3::from_array([0, 1, 2].map(|row| turned[row][column][0])));
    let scale = Vec3::splat([0, 1, 2].map(|axis| turned[axis].dot(columns[axis])).iter().sum::<f32>() / 3.0);
    let rotation = Quat::from_mat3(&Mat3::from_cols(turned[0], turned[1], turned[2])).normalize();
    (scale.min_element() > 0.0).then_some(Transform { translation: map.translation.into(), rotation, scale })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_similarity_is_split_exactly() {
        let whole = Transform {
            translation: Vec3::new(1.0, -2.0, 3.0),
            rotation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.3),
            scale: Vec3::splat(1.5),
        };
        let split = split(&whole.to_affine()).unwrap();
        assert!(split.to_affine().abs_diff_eq(whole.to_affine(), 1e-5), "{split:?}");
        assert_eq!(super::split(&Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))), None);
        assert_eq!(super::split(&Affine3A::from_translation(Vec3::splat(f32::NAN))), None);
    }
}
