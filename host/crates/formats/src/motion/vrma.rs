//! VRM animations (`.vrma`): a humanoid's motion for any VRM avatar.

use armature_rig::{Motion, humanoid_motion};
use serde_json::{Map, Value, json};

use super::glb_animation::File;
use crate::FormatError;
use crate::gltf::{GlbClip, GlbScene, write_glb};

const EXTENSION: &str = "VRMC_vrm_animation";
/// The bones that every avatar has.
const EXPECTED: [&str; 15] = [
    "hips",
    "spine",
    "head",
    "leftUpperLeg",
    "leftLowerLeg",
    "leftFoot",
    "rightUpperLeg",
    "rightLowerLeg",
    "rightFoot",
    "leftUpperArm",
    "leftLowerArm",
    "leftHand",
    "rightUpperArm",
    "rightLowerArm",
    "rightHand",
];

/// A VRM animation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VrmaFile {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// What is not in it, in sentences.
    pub left_out: Vec<String>,
}

/// Writes the motion of the bones that are recognised as a human's, as glTF with the extension `VRMC_vrm_animation` 1.0:
/// they rest in a T-pose with the axes of the model ([`humanoid_motion`]). Only the hips move; the other bones turn. The
/// avatar's own proportions scale the way.
pub fn write_vrma(name: &str, clip_name: &str, motion: &Motion) -> Result<VrmaFile, FormatError> {
    let human = humanoid_motion(motion).map_err(|error| {
        let remedy = "`armature inspect` says which bones are recognised; other figures go into a .glb";
        FormatError::whole("VRMA", error.to_string(), remedy)
    })?;
    let clips = vec![GlbClip::of_motion(clip_name, &human)];
    let scene = GlbScene { name, skeleton: &human.skeleton, mesh: None, clips };
    let mut file = File::read(&write_glb(&scene).map_err(|error| error.in_file("VRMA"))?)?;
    // Bones are the first nodes, in their order.
    let bones = human.skeleton.bones().iter().enumerate();
    let bones: Map<String, Value> = bones.map(|(node, bone)| (bone.name.clone(), json!({ "node": node }))).collect();
    let missing: Vec<&str> = EXPECTED.iter().copied().filter(|bone| !bones.contains_key(*bone)).collect();
    file.set("extensionsUsed", &[EXTENSION])?;
    file.set("extensions", &json!({ EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": bones}} }))?;
    let mut left_out = Vec::new();
    if !missing.is_empty() {
        left_out.push(format!("not recognised, so they stay at rest in an avatar: {}", missing.join(", ")));
    }
    let (recognised, all) = (human.skeleton.len(), motion.skeleton.len());
    if recognised < all {
        left_out.push(format!("VRMA holds the bones that all humanoids share: {recognised} of {all}"));
    }
    Ok(VrmaFile { bytes: file.write()?, left_out })
}
