//! A skeleton from the frames of its bones.

use armature_rig::{Bone, Skeleton, Transform};
use glam::{DAffine3, Vec3};

use super::tails::set_tails;
use crate::text::names::UniqueNames;

/// A bone as a file has it; parents come first.
#[derive(Clone, Debug)]
pub(crate) struct NamedFrame {
    pub(crate) name: String,
    pub(crate) parent: Option<usize>,
    pub(crate) model_from_bone: DAffine3,
}

/// Bones with unique names whose rest frames are these, or the nearest ones without shear.
pub(crate) fn skeleton_from_frames(frames: &[NamedFrame], warnings: &mut Vec<String>) -> Result<Skeleton, String> {
    let mut names = UniqueNames::default();
    let mut bones: Vec<Bone> = Vec::with_capacity(frames.len());
    let mut made: Vec<DAffine3> = Vec::with_capacity(frames.len());
    let mut worst = 0.0_f64;
    for (index, NamedFrame { name, parent, model_from_bone }) in frames.iter().enumerate() {
        let local = parent.map_or(*model_from_bone, |p| made[p].inverse() * *model_from_bone);
        let rest = decompose(local);
        let own = affine(&rest);
        made.push(parent.map_or(own, |p| made[p] * own));
        let size = model_from_bone.matrix3.determinant().abs().cbrt();
        let off = made[index].matrix3 - model_from_bone.matrix3;
        worst = off.to_cols_array().iter().fold(worst, |w, d| w.max(d.abs() / size));
        let name = names.give(name, &format!("bone_{}", index + 1));
        bones.push(Bone { name, parent: *parent, rest, tail: Vec3::ZERO });
    }
    if worst > 1e-3 {
        warnings.push(
            "Some bones are sheared by their parents' scales; their rest is the nearest transform without shear."
                .to_owned(),
        );
    }
    set_tails(&mut bones, &[]);
    Skeleton::new(bones).map_err(|error| error.to_string())
}

/// The nearest translation, rotation and scale in single precision.
pub(crate) fn decompose(affine: DAffine3) -> Transform {
    let (scale, rotation, translation) = affine.to_scale_rotation_translation();
    Transform {
        translation: translation.as_vec3(),
        rotation: rotation.normalize().as_quat().normalize(),
        scale: scale.as_vec3(),
    }
}

/// A single-precision transform in double precision.
pub(crate) fn affine(transform: &Transform) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        transform.scale.as_dvec3(),
        transform.rotation.as_dquat().normalize(),
        transform.translation.as_dvec3(),
    )
}
