//! A pose of rigid bones from the energy's affine handles: targets, solving, fitting rotations, holding pins.

use armature_deform::arap::{ArapStop, ReducedArap};
use armature_deform::nearest_rotation::{LANES, Matrices, nearest_rotations};
use armature_rig::Pose;
use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3};

use super::bone_roles::BoneRole;
use super::held_pins::{HeldPins, Pin};
use super::joint_limit::HandleLimit;
use super::jointed_pins::JointedPins;
use super::layout::Layout;
use super::pinned_bone::PinHold;
use super::rest::RestRig;

/// Local and global steps per frame, starting from the previous frame (thesis section 7.4).
const STEPS_A_FRAME: ArapStop = ArapStop { iterations: 15, tolerance: 1e-5 };
/// Without a previous frame.
const FIRST_STEPS: ArapStop = ArapStop { iterations: 400, tolerance: 1e-6 };
/// How much a rotation about the bone itself counts relative to where its ends go, when a rotation is fitted.
const TWIST_SHARE: f32 = 0.05;

/// A solved bone, and how to fit a rotation to its affine map.
#[derive(Clone, Debug)]
struct SolvedBone {
    handle: usize,
    /// Second moments of its joints about its head: where a fitted rotation has to be right.
    moments: Mat3A,
}

/// Everything for one set of driven bones.
#[derive(Clone, Debug)]
pub(super) struct SolvedSystem {
    pub(super) layout: Layout,
    pub(super) arap: ReducedArap,
    /// Its state before the first pose.
    pub(super) fresh: ReducedArap,
    pub(super) is_first: bool,
    solved: Vec<SolvedBone>,
    roots: Vec<usize>,
    pins: HeldPins,
    /// Where joints have limits.
    jointed: Option<JointedPins>,
    pub(super) worst_pin: f32,
    /// One per handle.
    targets: Vec<Affine3A>,
    /// `model_from_rest` of every handle's bone.
    turns: Vec<Quat>,
    /// How far each root is from its rest position.
    shifts: Vec<Vec3>,
    /// `model_from_bone` rotations.
    rotations: Vec<Quat>,
}

impl SolvedSystem {
    pub(super) fn new(rig: &RestRig, layout: Layout, arap: ReducedArap, limits: Vec<HandleLimit>) -> Self {
        let bones = rig.skeleton.bones();
        let roots: Vec<usize> = (0..bones.len()).filter(|&bone| bones[bone].parent.is_none()).collect();
        let handles = layout.handle_count();
        let is_solved = |handle: usize| layout.is_solved(handle);
        let solved = (0..handles)
            .filter(|&handle| is_solved(handle))
            .map(|handle| SolvedBone { handle, moments: moments(rig, &layout, handle) });
        let free_roots: Vec<bool> = roots.iter().map(|&root| !layout.placed[layout.handle_of_bone[root]]).collect();
        let size = rig.heads.iter().fold(0.0_f32, |size, head| size.max(head.distance(rig.heads[0])));
        let pins = (0..bones.len())
            .filter(|&bone| rig.pins[bone].is_some())
            .map(|bone| pin(rig, &layout, &roots, bone))
            .filter(|pin| !pin.segments.is_empty() || !layout.placed[layout.handle_of_bone[roots[pin.root]]]);
        let (pins, free_turns): (Vec<Pin>, Vec<bool>) = (pins.collect(), (0..handles).map(is_solved).collect());
        let jointed =
            (!limits.is_empty()).then(|| JointedPins::new(pins.clone(), limits, &free_turns, &free_roots, size));
        let pins = HeldPins::new(pins, free_turns, free_roots, size);
        Self {
            jointed,
            pins,
            solved: solved.collect(),
            fresh: arap.clone(),
            arap,
            is_first: true,
            worst_pin: 0.0,
            targets: vec![Affine3A::IDENTITY; handles],
            turns: vec![Quat::IDENTITY; handles],
            shifts: vec![Vec3::ZERO; roots.len()],
            rotations: vec![Quat::IDENTITY; bones.len()],
            roots,
            layout,
        }
    }

    pub(super) fn complete(&mut self, rig: &RestRig, roles: &[BoneRole], pose: &mut Pose) {
        self.set_targets(rig, roles, pose);
        let stop = if self.is_first { FIRST_STEPS } else { STEPS_A_FRAME };
        self.is_first = false;
        if self.arap.solve(&self.targets, &[], stop).is_err() {
            return;
        }
        self.fit_rotations();
        for (shift, &root) in self.shifts.iter_mut().zip(&self.roots) {
            let handle = self.layout.handle_of_bone[root];
            *shift = if self.layout.placed[handle] {
                Vec3::ZERO
            } else {
                self.arap.transforms()[handle].transform_point3(rig.heads[root]) - rig.heads[root]
            };
        }
        self.worst_pin = match &mut self.jointed {
            Some(jointed) => jointed.hold(&mut self.turns, &mut self.shifts),
            None => self.pins.hold(&mut self.turns, &mut self.shifts),
        };
        self.write(rig, pose);
    }

    /// Forward kinematics of driven and held bones. Their rotations are final.
    fn set_targets(&mut self, rig: &RestRig, roles: &[BoneRole], pose: &Pose) {
        for (bone, local) in pose.parent_from_bone.iter().enumerate() {
            let parent = rig.parent(bone);
            let stays = rig.stays(bone);
            let held = stays && roles[bone] == BoneRole::Held;
            self.rotations[bone] = match parent {
                Some(parent) if !held => (self.rotations[parent] * local.rotation).normalize(),
                Some(_) => rig.rotations[bone],
                None => local.rotation,
            };
            let handle = self.layout.handle_of_bone[bone];
            if self.layout.bone_of_handle[handle] != bone {
                continue;
            }
            let turn = (self.rotations[bone] * rig.rotations[bone].inverse()).normalize();
            self.turns[handle] = turn;
            let head = match parent {
                Some(parent) if !stays => {
                    self.targets[self.layout.handle_of_bone[parent]].transform_point3(rig.heads[bone])
                }
                _ => rig.heads[bone],
            };
            self.targets[handle] = Affine3A::from_rotation_translation(turn, head - turn * rig.heads[bone]);
        }
    }

    /// The nearest rotations of the solved handles' affine maps.
    fn fit_rotations(&mut self) {
        for bones in self.solved.chunks(LANES) {
            let mut fitted: Matrices = [[[0.0; LANES]; 3]; 3];
            for (lane, bone) in bones.iter().enumerate() {
                let matrix = self.arap.transforms()[bone.handle].matrix3 * bone.moments;
                for row in 0..3 {
                    let values = matrix.row(row).to_array();
                    (0..3).for_each(|column| fitted[row][column][lane] = values[column]);
                }
            }
            let rotations = nearest_rotations(&fitted);
            for (lane, bone) in bones.iter().enumerate() {
                let column = |c: usize| Vec3::from_array([0, 1, 2].map(|row| rotations[row][c][lane]));
                let matrix = Mat3::from_cols(column(0), column(1), column(2));
                self.turns[bone.handle] = Quat::from_mat3(&matrix).normalize();
            }
        }
    }

    /// Bone by bone, parents first. A bone that follows a parent known to forward kinematics keeps its bits.
    fn write(&mut self, rig: &RestRig, pose: &mut Pose) {
        for (bone, local) in pose.parent_from_bone.iter_mut().enumerate() {
            let parent = rig.parent(bone);
            let handle = self.layout.handle_of_bone[bone];
            let own = self.layout.bone_of_handle[handle] == bone;
            if own {
                self.rotations[bone] = (self.turns[handle] * rig.rotations[bone]).normalize();
            }
            let Some(parent) = parent else { continue };
            let above = self.layout.handle_of_bone[parent];
            if !own {
                self.rotations[bone] = (self.rotations[parent] * local.rotation).normalize();
            } else if self.is_found(handle) || self.is_found(above) {
                local.rotation = (self.rotations[parent].inverse() * self.rotations[bone]).normalize();
            }
        }
        for (root, shift) in self.roots.iter().zip(&self.shifts) {
            if !self.layout.placed[self.layout.handle_of_bone[*root]] && shift.is_finite() {
                pose.parent_from_bone[*root].translation += *shift;
            }
        }
    }

    /// Whether a handle's rotation differs from forward kinematics of the incoming pose.
    fn is_found(&self, handle: usize) -> bool {
        self.layout.is_solved(handle) || self.layout.held_apart[handle]
    }
}

/// Where a fitted rotation of a handle has to be right: at the joints it shares.
fn moments(rig: &RestRig, layout: &Layout, handle: usize) -> Mat3A {
    let bones = rig.skeleton.bones();
    let own = layout.bone_of_handle[handle];
    let head = rig.heads[own];
    let is_joint = |bone: usize| {
        let above = bones[bone].parent.map(|p| layout.handle_of_bone[p]);
        layout.handle_of_bone[bone] != handle && above == Some(handle)
    };
    let ends = (0..bones.len()).filter(|&bone| is_joint(bone)).map(|bone| rig.heads[bone]);
    let (mut sum, mut largest) = (Mat3::ZERO, 0.0_f32);
    for end in ends.chain([rig.tails[own]]) {
        let along = end - head;
        largest = largest.max(along.length_squared());
        sum += Mat3::from_cols(along * along.x, along * along.y, along * along.z);
    }
    if largest <= 0.0 {
        return Mat3A::IDENTITY;
    }
    Mat3A::from((sum + Mat3::from_diagonal(Vec3::splat(TWIST_SHARE * largest))) * (1.0 / largest))
}

/// The path from a root to a pinned bone.
fn pin(rig: &RestRig, layout: &Layout, roots: &[usize], bone: usize) -> Pin {
    let bones = rig.skeleton.bones();
    let mut segments: Vec<(usize, Vec3)> = Vec::new();
    let (mut at, mut end) = (bone, rig.heads[bone]);
    while let Some(parent) = bones[at].parent {
        let handle = layout.handle_of_bone[parent];
        let head = rig.heads[parent];
        match segments.last_mut() {
            Some((last, along)) if *last == handle => *along += end - head,
            _ => segments.push((handle, end - head)),
        }
        (at, end) = (parent, head);
    }
    let root = roots.iter().position(|&root| root == at).unwrap_or(0);
    let weight = if rig.pins[bone] == Some(PinHold::Upright) { Vec3::new(1.0, 0.0, 1.0) } else { Vec3::ONE };
    Pin { target: rig.heads[bone], weight, root, rest_root: rig.heads[at], segments }
}
