//! The skeleton, once for each pose that parts were bound in.

use armature_rig::Skeleton;
use glam::DAffine3;

use super::layer::{list, matrix, text};
use super::stage::Stage;
use crate::FormatError;
use crate::gltf::GlbScene;
use crate::gltf::pieces::bound_frames;
use crate::gltf::write_skin::rest_frames;
use crate::skeleton::frames::affine;

/// The paths of skeletons, by the skin that is bound to each.
pub(super) struct Skeletons(Vec<(Option<u32>, String)>);

impl Skeletons {
    /// The skeleton for parts of this skin; `None` without bones.
    pub(super) fn path(&self, skin: Option<u32>) -> Option<&str> {
        self.0.iter().find(|(known, _)| *known == skin).map(|(_, path)| path.as_str())
    }
}

/// Writes the skeleton bound in its rest pose, and the same for every other pose that parts were bound in. `played`: the
/// path of the animation that moves them.
pub(super) fn write_skeletons(stage: &mut Stage, scene: &GlbScene, played: &str) -> Result<Skeletons, FormatError> {
    let mut written = Vec::new();
    if scene.skeleton.is_empty() {
        return Ok(Skeletons(written));
    }
    write_skeleton(stage, scene.skeleton, None, "", &rest_frames(scene.skeleton), played, &mut written);
    if let Some(surface) = &scene.mesh {
        for skin in surface.parts.iter().filter_map(|part| part.skin) {
            if written.iter().all(|(known, _)| *known != Some(skin)) {
                let (frames, name) = bound_frames(surface, scene.skeleton, Some(skin))?;
                write_skeleton(stage, scene.skeleton, Some(skin), name, &frames, played, &mut written);
            }
        }
    }
    Ok(Skeletons(written))
}

fn write_skeleton(
    stage: &mut Stage,
    skeleton: &Skeleton,
    skin: Option<u32>,
    suffix: &str,
    bound: &[DAffine3],
    played: &str,
    written: &mut Vec<(Option<u32>, String)>,
) {
    let wanted = if skin.is_none() { "Skeleton".to_owned() } else { format!("Skeleton_{suffix}") };
    let name = stage.name(&wanted, "Skeleton");
    let (layer, joints) = stage.layer_and_joints();
    layer.open("def Skeleton", &name, &["SkelBindingAPI"], "");
    layer.line(format_args!("uniform token[] joints = {}", list(joints.paths.iter().map(|path| text(path)))));
    let names = skeleton.bones().iter().map(|bone| text(&bone.name));
    layer.line(format_args!("uniform token[] jointNames = {}", list(names)));
    layer.line(format_args!("uniform matrix4d[] bindTransforms = {}", list(bound.iter().map(matrix))));
    let rests = skeleton.bones().iter().map(|bone| matrix(&affine(&bone.rest)));
    layer.line(format_args!("uniform matrix4d[] restTransforms = {}", list(rests)));
    layer.line(format_args!("rel skel:animationSource = <{played}>"));
    layer.close();
    written.push((skin, stage.path(&name)));
}
