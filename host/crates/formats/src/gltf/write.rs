//! From skinned mesh, skeleton and clips to GLB.

use std::borrow::Cow;

use gltf_json::buffer::Buffer;
use gltf_json::scene::{Node, UnitQuaternion};
use gltf_json::validation::USize64;
use gltf_json::{Index, Scene};

use super::buffer::Builder;
use super::scene::{GlbScene, bad};
use super::write_clip::write_clip;
use super::write_skin::{rest_frames, write_skin};
use super::write_surface::write_surface;
use crate::FormatError;

/// Writes a GLB: the parts as skinned meshes with their materials and morph targets, a skin for the rest pose (even
/// without a mesh) and one for every other pose that parts were bound in, the bones as nodes below a node named after
/// the character, and every clip as an animation that holds only what moves. Positions are single precision.
///
/// ```
/// use armature_formats::gltf::{GlbClip, GlbScene, write_glb};
/// use armature_rig::{Bone, Motion, Skeleton, Transform};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let skeleton = Skeleton::new(vec![bone]).unwrap();
/// let frames = vec![skeleton.rest_pose(); 2];
/// let motion = Motion::new(skeleton, 0.5, frames).unwrap();
/// let clips = vec![GlbClip::of_motion("wave", &motion)];
/// let bytes = write_glb(&GlbScene { name: "robot", skeleton: &motion.skeleton, mesh: None, clips })?;
/// assert!(bytes.starts_with(b"glTF"));
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_glb(scene: &GlbScene) -> Result<Vec<u8>, FormatError> {
    let mut builder = Builder::default();
    builder.root.asset.generator = Some(concat!("Armature ", env!("CARGO_PKG_VERSION")).to_owned());
    let (armature, joints) = write_skeleton(&mut builder, scene);
    let mut roots: Vec<Index<Node>> = armature.into_iter().collect();
    let mut meshes = Vec::new();
    if let Some(mesh) = &scene.mesh {
        meshes = write_surface(&mut builder, scene, mesh, &joints)?;
        roots.extend(meshes.iter().map(|mesh| mesh.node));
    } else if !joints.is_empty() {
        // Programs make an armature of a skin; without one the bones would be plain nodes.
        write_skin(&mut builder, scene.name, &rest_frames(scene.skeleton), &joints);
    }
    for clip in &scene.clips {
        write_clip(&mut builder, scene.skeleton, clip, &joints, &meshes, scene.mesh.as_ref())?;
    }
    if roots.is_empty() {
        return Err(bad("there is neither a mesh nor a skeleton to write", "Export a character"));
    }
    let default = Index::push(
        &mut builder.root.scenes,
        Scene { extensions: None, extras: gltf_json::Extras::default(), name: None, nodes: roots },
    );
    builder.root.scene = Some(default);
    finish(builder)
}

fn finish(mut builder: Builder) -> Result<Vec<u8>, FormatError> {
    let remedy = "Export fewer or shorter clips";
    if !builder.binary.is_empty() {
        builder.root.buffers.push(Buffer {
            byte_length: USize64::from(builder.binary.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: gltf_json::Extras::default(),
        });
    }
    let json = builder.root.to_vec().map_err(|error| bad(error.to_string(), remedy))?;
    let length = json.len() + builder.binary.len() + 64;
    let length = u32::try_from(length).map_err(|_| bad("the file would be longer than 4 GB", remedy))?;
    let glb = gltf::binary::Glb {
        header: gltf::binary::Header { magic: *b"glTF", version: 2, length },
        json: Cow::Owned(json),
        bin: (!builder.binary.is_empty()).then_some(Cow::Owned(builder.binary)),
    };
    glb.to_vec().map_err(|error| bad(error.to_string(), remedy))
}

/// The parent node of the bones, and the bones' nodes.
fn write_skeleton(builder: &mut Builder, scene: &GlbScene) -> (Option<Index<Node>>, Vec<Index<Node>>) {
    let bones = scene.skeleton.bones();
    if bones.is_empty() {
        return (None, Vec::new());
    }
    let joints: Vec<Index<Node>> = bones
        .iter()
        .map(|bone| {
            let rest = &bone.rest;
            let node = Node {
                name: Some(bone.name.clone()),
                translation: (rest.translation != glam::Vec3::ZERO).then(|| rest.translation.to_array()),
                rotation: (rest.rotation != glam::Quat::IDENTITY)
                    .then(|| UnitQuaternion(rest.rotation.normalize().to_array())),
                scale: (rest.scale != glam::Vec3::ONE).then(|| rest.scale.to_array()),
                ..Node::default()
            };
            Index::push(&mut builder.root.nodes, node)
        })
        .collect();
    let mut roots = Vec::new();
    for (bone, &joint) in bones.iter().zip(&joints) {
        match bone.parent {
            None => roots.push(joint),
            Some(parent) => {
                builder.root.nodes[joints[parent].value()].children.get_or_insert_default().push(joint);
            }
        }
    }
    let carrier = Node { name: Some(format!("{}_skeleton", scene.name)), children: Some(roots), ..Node::default() };
    (Some(Index::push(&mut builder.root.nodes, carrier)), joints)
}
