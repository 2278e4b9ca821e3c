//! VRM 0.x avatars look along −Z; they are turned to look along +Z, as VRM 1.0 and all other characters do.

use armature_rig::{Skeleton, Transform};
use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};

use crate::model::Model;

/// Turns a model half round about +Y. Signs change and nothing is rounded.
pub(super) fn turn_around(model: &mut Model) -> Result<(), String> {
    model.mesh.vertices.iter_mut().for_each(|[x, _, z]| (*x, *z) = (0.0 - *x, 0.0 - *z));
    model.normals.iter_mut().flatten().for_each(turn);
    for target in &mut model.morph_targets {
        target.positions.iter_mut().chain(&mut target.normals).for_each(turn);
    }
    if let Some(rig) = &mut model.rig {
        rig.skeleton = turned(&rig.skeleton)?;
        for frame in rig.skins.iter_mut().flat_map(|skin| &mut skin.bound_model_from_bone) {
            let half_round = Mat3A::from_cols(Vec3A::NEG_X, Vec3A::Y, Vec3A::NEG_Z);
            *frame = Affine3A { matrix3: half_round, translation: Vec3A::ZERO } * *frame;
        }
    }
    for (_, motion) in &mut model.motions {
        motion.skeleton = turned(&motion.skeleton)?;
        for pose in &mut motion.frames {
            let bones = motion.skeleton.bones().iter().zip(&mut pose.parent_from_bone);
            bones.filter(|(bone, _)| bone.parent.is_none()).for_each(|(_, root)| *root = turned_root(*root));
        }
    }
    let springs = model.avatar.iter_mut().flat_map(|avatar| &mut avatar.springs);
    springs.flat_map(|chain| &mut chain.joints).for_each(|joint| turn(&mut joint.gravity_direction));
    Ok(())
}

fn turn([x, _, z]: &mut [f32; 3]) {
    (*x, *z) = (0.0 - *x, 0.0 - *z);
}

fn turned(skeleton: &Skeleton) -> Result<Skeleton, String> {
    let mut bones = skeleton.bones().to_vec();
    bones.iter_mut().filter(|bone| bone.parent.is_none()).for_each(|root| root.rest = turned_root(root.rest));
    Skeleton::new(bones).map_err(|error| error.to_string())
}

fn turned_root(Transform { translation, rotation, scale }: Transform) -> Transform {
    let [x, y, z, w] = rotation.to_array();
    Transform {
        translation: Vec3::new(-translation.x, translation.y, -translation.z),
        // The quaternion of half a turn about +Y, times this one.
        rotation: Quat::from_xyzw(z, w, -x, -y),
        scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_turn_as_matrices_do() {
        let root = Transform {
            translation: Vec3::new(1.0, 2.0, 3.0),
            rotation: Quat::from_rotation_x(0.5) * Quat::from_rotation_z(1.0),
            scale: Vec3::new(1.0, 2.0, 3.0),
        };
        let expected = Affine3A::from_rotation_y(std::f32::consts::PI) * root.to_affine();
        assert!(turned_root(root).to_affine().abs_diff_eq(expected, 1e-6));
    }
}
