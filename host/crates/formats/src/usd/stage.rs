//! What all writers of prims share.

use armature_rig::Skeleton;

use super::identifiers::Identifiers;
use super::layer::Layer;

/// A stage while it is written.
pub(super) struct Stage {
    layer: Layer,
    /// The names below the root.
    names: Identifiers,
    /// The name of the root prim.
    root: String,
    joints: Joints,
}

impl Stage {
    /// A stage whose layer has begun.
    pub(super) fn new(layer: Layer, root: String, skeleton: &Skeleton) -> Self {
        Self { layer, names: Identifiers::default(), root, joints: Joints::of(skeleton) }
    }

    /// What is written to.
    pub(super) fn layer(&mut self) -> &mut Layer {
        &mut self.layer
    }

    /// A name below the root that nothing has yet.
    pub(super) fn name(&mut self, wanted: &str, fallback: &str) -> String {
        self.names.give(wanted, fallback)
    }

    /// The path of a prim below the root.
    pub(super) fn path(&self, name: &str) -> String {
        format!("/{}/{name}", self.root)
    }

    /// The name of the root prim.
    pub(super) fn root(&self) -> &str {
        &self.root
    }

    /// What is written to, and the bones.
    pub(super) fn layer_and_joints(&mut self) -> (&mut Layer, &Joints) {
        (&mut self.layer, &self.joints)
    }

    /// The text.
    pub(super) fn finish(self) -> String {
        self.layer.finish()
    }
}

/// The bones, in the skeleton's order.
pub(super) struct Joints {
    /// The path of each: the names of its ancestors and its own.
    pub(super) paths: Vec<String>,
}

impl Joints {
    pub(super) fn of(skeleton: &Skeleton) -> Self {
        let mut names = Identifiers::default();
        let mut paths: Vec<String> = Vec::with_capacity(skeleton.len());
        for (index, bone) in skeleton.bones().iter().enumerate() {
            let name = names.give(&bone.name, &format!("bone_{}", index + 1));
            paths.push(bone.parent.map_or(name.clone(), |parent| format!("{}/{name}", paths[parent])));
        }
        Self { paths }
    }
}
