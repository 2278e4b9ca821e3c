//! Which bones move as one, and the given part of each such group.

use armature_deform::arap::HandleConstraint;

use super::bone_roles::BoneRole;
use super::rest::RestRig;

/// Handles of the reduced system: one bone each, with all bones that follow it rigidly.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) handle_of_bone: Vec<usize>,
    pub(super) bone_of_handle: Vec<usize>,
    /// Whether forward kinematics determines where the handle's bone is.
    pub(super) placed: Vec<bool>,
    /// Whether a pin holds the bone's rest orientation although its parent is not held, or a target gives it another.
    pub(super) held_apart: Vec<bool>,
    pub(super) constraints: Vec<HandleConstraint>,
}

impl Layout {
    pub(super) fn new(rig: &RestRig, roles: &[BoneRole]) -> Self {
        let mut layout = Self {
            handle_of_bone: Vec::with_capacity(roles.len()),
            bone_of_handle: Vec::new(),
            placed: Vec::new(),
            held_apart: Vec::new(),
            constraints: Vec::new(),
        };
        for (bone, role) in roles.iter().enumerate() {
            let above = rig.parent(bone).map(|p| layout.handle_of_bone[p]);
            if let (BoneRole::Follows, Some(above)) = (role, above) {
                layout.handle_of_bone.push(above);
                continue;
            }
            let solved = matches!(role, BoneRole::Solved | BoneRole::Follows);
            let stays = rig.stays(bone);
            let placed = !solved && (stays || above.is_some_and(|h| layout.placed[h]));
            layout.handle_of_bone.push(layout.bone_of_handle.len());
            layout.bone_of_handle.push(bone);
            layout.placed.push(placed);
            let is_held_apart = *role == BoneRole::Held && stays && above.is_some();
            layout.held_apart.push(is_held_apart || *role == BoneRole::Dragged);
            layout.constraints.push(match (solved, placed) {
                (true, _) if stays => HandleConstraint::Position,
                (true, _) => HandleConstraint::Free,
                (false, true) => HandleConstraint::Full,
                (false, false) => HandleConstraint::Orientation,
            });
        }
        layout
    }

    pub(super) fn handle_count(&self) -> usize {
        self.bone_of_handle.len()
    }

    /// Whether the shape determines the handle's orientation.
    pub(super) fn is_solved(&self, handle: usize) -> bool {
        matches!(self.constraints[handle], HandleConstraint::Free | HandleConstraint::Position)
    }
}
