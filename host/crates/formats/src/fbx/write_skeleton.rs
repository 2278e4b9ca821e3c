//! Bones as limb nodes below one plain node, which programs turn into an armature.

use armature_rig::{Bone, Skeleton};
use glam::{DAffine3, DMat4, DQuat};

use super::euler::nearest_angles;
use super::write_document::{
    Document, Id, Node, SCENE, Value, enum_property, number_property, properties, property, vector_property,
};

/// Lengths of bones without one, in the skeleton's unit, are drawn as this.
const HUB: f64 = 0.01;
/// Parents scale their children as any matrix would.
const PLAIN_INHERITANCE: i32 = 1;

/// The rest rotation that a bone's own angles follow: a joint's angles are zero at rest.
pub(super) fn rest_rotation(bone: &Bone) -> DQuat {
    bone.rest.rotation.as_dquat().normalize()
}

/// One limb node for each bone, in the skeleton's order. `notes`: names and texts that the armature carries.
pub(super) fn write_skeleton(
    document: &mut Document,
    name: &str,
    skeleton: &Skeleton,
    notes: &[(String, String)],
) -> Vec<Id> {
    if skeleton.is_empty() {
        return Vec::new();
    }
    let attribute = document.add("NodeAttribute", [name, "NodeAttribute"], "Null", vec![Node::of("TypeFlags", "Null")]);
    let text = |(key, value): &(String, String)| property(key, ["KString", "", "U"], vec![value.as_str().into()]);
    let mut own = vec![enum_property("InheritType", PLAIN_INHERITANCE)];
    own.extend(notes.iter().map(text));
    let armature = document.add("Model", [name, "Model"], "Null", model(own));
    document.connect(armature, SCENE);
    document.connect(attribute, armature);
    let mut limbs: Vec<Id> = Vec::with_capacity(skeleton.len());
    for bone in skeleton.bones() {
        let length = f64::from(bone.tail.length());
        let size = number_property("Size", if length > 0.0 { length } else { HUB });
        let children = vec![Node::of("TypeFlags", "Skeleton"), properties(vec![size])];
        let attribute = document.add("NodeAttribute", [&bone.name, "NodeAttribute"], "LimbNode", children);
        let limb = document.add("Model", [&bone.name, "Model"], "LimbNode", model(rest(bone)));
        document.connect(limb, bone.parent.map_or(armature, |parent| limbs[parent]));
        document.connect(attribute, limb);
        limbs.push(limb);
    }
    limbs
}

fn rest(bone: &Bone) -> Vec<Node> {
    let animated = |name| [name, "", "A"];
    let part = |v: glam::Vec3| v.as_dvec3().to_array();
    vec![
        property("RotationActive", ["bool", "", ""], vec![1.into()]),
        enum_property("InheritType", PLAIN_INHERITANCE),
        vector_property("PreRotation", ["Vector3D", "Vector", ""], nearest_angles(rest_rotation(bone), [0.0; 3])),
        vector_property("Lcl Translation", animated("Lcl Translation"), part(bone.rest.translation)),
        vector_property("Lcl Rotation", animated("Lcl Rotation"), [0.0; 3]),
        vector_property("Lcl Scaling", animated("Lcl Scaling"), part(bone.rest.scale)),
    ]
}

/// What a model node holds besides its properties.
pub(super) fn model(own: Vec<Node>) -> Vec<Node> {
    vec![
        Node::of("Version", 232),
        properties(own),
        Node::of("MultiLayer", 0),
        Node::of("Shading", Value::Flag(true)),
        Node::of("Culling", "CullingOff"),
    ]
}

/// Where meshes and bones are when they are bound.
pub(super) fn write_bind_pose(document: &mut Document, name: &str, nodes: &[(Id, DAffine3)]) {
    if nodes.is_empty() {
        return;
    }
    let mut children =
        vec![Node::of("Type", "BindPose"), Node::of("Version", 100), Node::of("NbPoseNodes", nodes.len() as i32)];
    children.extend(nodes.iter().map(|(node, frame)| {
        Node::with("PoseNode", Vec::new(), vec![Node::of("Node", *node), Node::of("Matrix", matrix(*frame))])
    }));
    document.add("Pose", [name, "Pose"], "BindPose", children);
}

/// Columns one after the other.
pub(super) fn matrix(frame: DAffine3) -> Value {
    Value::Reals(DMat4::from(frame).to_cols_array().to_vec())
}
