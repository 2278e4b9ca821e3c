//! Skeletons from bone ends in model space.

use armature_rig::{Bone, Skeleton, SkeletonError, Transform};
use glam::DVec3;

/// The bones so far, with their heads in model space.
#[derive(Default)]
pub(super) struct Bones {
    bones: Vec<Bone>,
    heads: Vec<DVec3>,
}

impl Bones {
    /// Adds a bone from its head to its tail, both in model space; rest rotations are the identity.
    pub(super) fn add(&mut self, name: &str, parent: Option<&str>, [head, tail]: [DVec3; 2]) {
        let parent = parent.and_then(|name| self.bones.iter().position(|b| b.name == name));
        let origin = parent.map_or(DVec3::ZERO, |p| self.heads[p]);
        self.bones.push(Bone {
            name: name.to_owned(),
            parent,
            rest: Transform { translation: (head - origin).as_vec3(), ..Transform::IDENTITY },
            tail: (tail - head).as_vec3(),
        });
        self.heads.push(head);
    }

    /// Adds a bone of the left side, or its mirror image in x for any other side; the parent is a bone on the same side
    /// if there is one.
    pub(super) fn add_on_side(&mut self, side: &str, name: &str, parent: &str, ends: [DVec3; 2]) {
        let ends = if side == "Left" { ends } else { ends.map(|p| DVec3::new(-p.x, p.y, p.z)) };
        let own = format!("{side}{parent}");
        let parent = if self.bones.iter().any(|b| b.name == own) { own } else { parent.to_owned() };
        self.add(&format!("{side}{name}"), Some(&parent), ends);
    }

    pub(super) fn finish(self) -> Result<Skeleton, SkeletonError> {
        Skeleton::new(self.bones)
    }
}
