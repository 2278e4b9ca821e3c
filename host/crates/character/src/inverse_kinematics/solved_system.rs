//! A pose of rigid bones from the energy's affine handles: targets, solving, fitting rotations, holding pins.

use armature_deform::arap::{ArapStop, ReducedArap};
use armature_deform::nearest_rotation::{LANES, Matrices, nearest_rotations};
use armature_rig::{Pose, PoseMoment};
use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3};

use super::bone_roles::BoneRole;
use super::ease::{Easing, share_of};
use super::held_pins::{HeldPins, Pin};
use super::joint_limit::HandleLimit;
use super::jointed_pins::JointedPins;
use super::layout::Layout;
use super::loose_bones::loosen;
use super::pinned_bone::PinHold;
use super::refit_cost::RefitCost;
use super::rest::RestRig;
use super::targets::{Attachment, Followed, Way};

/// Local and global steps per frame, starting from the previous frame (thesis section 7.4).
const STEPS_A_FRAME: ArapStop = ArapStop { iterations: 15, tolerance: 1e-5 };
/// Without a previous frame.
const FIRST_STEPS: ArapStop = ArapStop { iterations: 400, tolerance: 1e-6 };
/// How much a rotation about the bone itself counts relative to where its ends go, when a rotation is fitted.
const TWIST_SHARE: f32 = 0.05;

/// No solved bone turns faster while points are dragged, radians a second: where wishes change over to another way of
/// meeting them, such as an elbow on the other side, the bones take a moment instead of jumping.
const FASTEST: f32 = 30.0;
/// Gaps between samples count as no longer and no shorter than this, seconds.
const STEP_SECONDS: [f32; 2] = [1e-3, 0.05];

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
    is_first: bool,
    solved: Vec<SolvedBone>,
    roots: Vec<usize>,
    /// The paths to pinned bones and to targets that can be moved, in this order; what the solver of the two tries to hold.
    paths: Vec<Pin>,
    /// The pinned bone of each of the first paths.
    pub(super) pinned: Vec<usize>,
    pins: HeldPins,
    /// Where joints have limits.
    jointed: Option<JointedPins>,
    /// How far each pinned bone was missed, mesh units.
    pub(super) missed: Vec<f32>,
    /// One per target.
    attached: Vec<Attachment>,
    /// Where each of them goes in this pose.
    anchors: Vec<Vec3>,
    goals: Vec<(Option<Vec3>, Option<Quat>)>,
    /// Where pinned bones belong in this pose.
    places: Vec<Vec3>,
    /// One per handle.
    targets: Vec<Affine3A>,
    /// `model_from_rest` of every handle's bone.
    turns: Vec<Quat>,
    /// Those of the pose before, and the device's clock then; `None` without one.
    before: Vec<Quat>,
    micros: Option<u64>,
    /// How far each root is from its rest position.
    shifts: Vec<Vec3>,
    /// `model_from_bone` rotations.
    rotations: Vec<Quat>,
    /// `model_from_bone` of every bone, where bones are loose.
    loose: Option<Vec<Affine3A>>,
    /// Of the last pose.
    energy: Option<f64>,
}

impl SolvedSystem {
    pub(super) fn new(
        rig: &RestRig,
        layout: Layout,
        arap: ReducedArap,
        limits: Vec<HandleLimit>,
        attached: Vec<Attachment>,
        loose: bool,
    ) -> Self {
        let bones = rig.skeleton.bones();
        let roots: Vec<usize> = roots(rig).collect();
        let handles = layout.handle_count();
        let is_solved = |handle: usize| layout.is_solved(handle);
        let solved = (0..handles)
            .filter(|&handle| is_solved(handle))
            .map(|handle| SolvedBone { handle, moments: moments(rig, &layout, handle) });
        let free_roots: Vec<bool> = roots.iter().map(|&root| !layout.placed[layout.handle_of_bone[root]]).collect();
        let size = rig.heads.iter().fold(0.0_f32, |size, head| size.max(head.distance(rig.heads[0])));
        let (pinned, mut paths): (Vec<usize>, Vec<Pin>) = (0..bones.len())
            .filter(|&bone| rig.pins[bone].is_some())
            .map(|bone| (bone, pin(rig, &layout, &roots, bone)))
            .filter(|(_, pin)| !pin.segments.is_empty() || !layout.placed[layout.handle_of_bone[roots[pin.root]]])
            .unzip();
        paths.extend(attached.iter().filter(|target| target.can_move).map(|target| target.pin.clone()));
        let free_turns: Vec<bool> = (0..handles).map(is_solved).collect();
        let jointed =
            (!limits.is_empty()).then(|| JointedPins::new(paths.clone(), limits, &free_turns, &free_roots, size));
        let pins = HeldPins::new(paths.clone(), free_turns, free_roots, size);
        Self {
            jointed,
            pins,
            missed: vec![0.0; pinned.len()],
            pinned,
            paths,
            anchors: vec![Vec3::ZERO; attached.iter().filter(|target| target.can_move).count()],
            goals: vec![(None, None); attached.len()],
            attached,
            places: rig.heads.clone(),
            solved: solved.collect(),
            fresh: arap.clone(),
            arap,
            is_first: true,
            targets: vec![Affine3A::IDENTITY; handles],
            turns: vec![Quat::IDENTITY; handles],
            before: vec![Quat::IDENTITY; handles],
            micros: None,
            shifts: vec![Vec3::ZERO; roots.len()],
            rotations: vec![Quat::IDENTITY; bones.len()],
            loose: loose.then(|| vec![Affine3A::IDENTITY; bones.len()]),
            energy: None,
            roots,
            layout,
        }
    }

    /// Forgets earlier poses.
    pub(super) fn start_afresh(&mut self) {
        self.arap.clone_from(&self.fresh);
        self.is_first = true;
        self.micros = None;
    }

    pub(super) fn complete(
        &mut self,
        rig: &RestRig,
        roles: &[BoneRole],
        moment: PoseMoment,
        followed: &mut [Followed],
        easing: &mut Easing,
        pose: &mut Pose,
    ) {
        easing.advance(moment.device_micros);
        for (goal, target) in self.goals.iter_mut().zip(followed.iter_mut()) {
            *goal = target.begin(moment, easing.former.as_ref(), rig);
        }
        self.ease_what_is_given(rig, roles, easing, pose);
        self.set_targets(rig, roles, followed, easing, pose);
        for (shift, &root) in self.shifts.iter_mut().zip(&self.roots) {
            *shift = self.places[root] - rig.heads[root];
        }
        self.set_anchors(moment, followed);
        let stop = if self.is_first { FIRST_STEPS } else { STEPS_A_FRAME };
        self.is_first = false;
        let Ok(report) = self.arap.solve(&self.targets, &self.anchors, stop) else { return };
        self.energy = Some(report.energy);
        self.fit_rotations();
        self.turn_softly(rig, followed);
        for (shift, &root) in self.shifts.iter_mut().zip(&self.roots) {
            let handle = self.layout.handle_of_bone[root];
            if !self.layout.placed[handle] {
                *shift = self.arap.transforms()[handle].transform_point3(rig.heads[root]) - rig.heads[root];
            }
        }
        self.ease_what_is_found(rig, easing, moment.device_micros);
        self.hold(moment, followed);
        if !self.attached.is_empty() || easing.left > 0.0 {
            self.slow_down(moment.device_micros);
        }
        self.measure(rig, followed);
        self.before.copy_from_slice(&self.turns);
        self.micros = Some(moment.device_micros);
        self.write(rig, pose);
        if let Some(frames) = &mut self.loose {
            loosen(rig, &self.layout, self.arap.transforms(), frames, pose);
        }
    }

    /// The energy of the last pose as it was solved, and as bones have it.
    pub(super) fn refit_cost(&self, rig: &RestRig, pose: &Pose) -> Option<RefitCost> {
        let minimiser = self.energy?;
        let mut frames = vec![Affine3A::IDENTITY; rig.skeleton.len()];
        pose.forward_kinematics(&rig.skeleton, &mut frames);
        let rest = rig.skeleton.rest_model_from_bone();
        let maps: Vec<Affine3A> =
            self.layout.bone_of_handle.iter().map(|&bone| frames[bone] * rest[bone].inverse()).collect();
        let posed = self.arap.energy_of(&maps).ok()?;
        Some(RefitCost { minimiser, posed })
    }

    /// No solved bone turns by more than it may since the pose before.
    fn slow_down(&mut self, micros: u64) {
        let Some(before) = self.micros else { return };
        let [least, most] = STEP_SECONDS;
        let most = FASTEST * (micros.saturating_sub(before) as f32 * 1e-6).clamp(least, most);
        for bone in &self.solved {
            let (turn, was) = (&mut self.turns[bone.handle], self.before[bone.handle]);
            let way = (*turn * was.inverse()).normalize();
            let angle = 2.0 * libm::atan2f(way.xyz().length(), way.w.abs());
            if angle > most {
                *turn = (share_of(way, most / angle) * was).normalize();
            }
        }
    }

    /// Pins and targets, by the smallest change to the rigid skeleton.
    fn hold(&mut self, moment: PoseMoment, followed: &mut [Followed]) {
        let mut number = self.pinned.len();
        for ((target, followed), (goal, _)) in self.attached.iter().zip(&mut *followed).zip(&self.goals) {
            let Some(goal) = goal.filter(|_| target.can_move) else { continue };
            // A soft target has reached where the energy lets it go.
            let at = if followed.target.strength >= 1.0 { goal } else { target.place(self.arap.transforms()) };
            let near = target.within_reach(at, &self.layout, &self.turns, &self.shifts);
            self.paths[number].target = followed.on_the_way(near, moment, Way::OfBones);
            number += 1;
        }
        for (path, &bone) in self.paths.iter_mut().zip(&self.pinned) {
            path.target = self.places[bone];
        }
        let (turns, shifts) = (&mut self.turns, &mut self.shifts);
        if !self.paths.is_empty() {
            let goals = self.paths.iter().map(|path| path.target);
            match &mut self.jointed {
                Some(jointed) => jointed.hold(goals, turns, shifts),
                None => self.pins.hold(goals, turns, shifts),
            };
        } else if let Some(jointed) = &mut self.jointed {
            jointed.hold(std::iter::empty(), turns, shifts);
        }
    }

    /// How far pins and targets are from their places.
    fn measure(&mut self, rig: &RestRig, followed: &mut [Followed]) {
        let (turns, shifts) = (&self.turns, &self.shifts);
        for ((missed, path), &bone) in self.missed.iter_mut().zip(&self.paths).zip(&self.pinned) {
            *missed = ((rig.heads[bone] - path.place(turns, shifts)) * path.weight).length();
        }
        let mut number = self.pinned.len();
        for ((target, followed), (goal, _)) in self.attached.iter().zip(followed).zip(&self.goals) {
            let Some(goal) = *goal else { continue };
            let mut wanted = goal;
            if target.can_move && followed.target.strength >= 1.0 {
                let near = target.within_reach(goal, &self.layout, turns, shifts);
                wanted += self.paths[number].target - near;
            }
            number += usize::from(target.can_move);
            followed.miss(wanted.distance(target.pin.place(turns, shifts)));
        }
    }

    fn set_anchors(&mut self, moment: PoseMoment, followed: &mut [Followed]) {
        let (layout, turns, shifts) = (&self.layout, &self.turns, &self.shifts);
        let targets = self.attached.iter().zip(followed).zip(&self.goals);
        let pulled = targets.filter(|((target, _), _)| target.can_move);
        for (anchor, ((target, followed), (goal, _))) in self.anchors.iter_mut().zip(pulled) {
            let Some(goal) = *goal else { continue };
            let near = target.within_reach(goal, layout, turns, shifts);
            *anchor = followed.on_the_way(near, moment, Way::OfEnergy);
        }
    }

    /// Soft orientations, between what the shape prefers and what is asked for.
    fn turn_softly(&mut self, rig: &RestRig, followed: &[Followed]) {
        for (followed, (_, wanted)) in followed.iter().zip(&self.goals) {
            let (bone, strength) = (followed.bone(), followed.target.strength);
            let handle = self.layout.handle_of_bone[bone];
            let is_own = self.layout.bone_of_handle[handle] == bone && self.layout.is_solved(handle);
            let Some(wanted) = wanted.filter(|_| is_own && strength < 1.0) else { continue };
            let turn = wanted * rig.rotations[bone].inverse();
            let way = turn * self.turns[handle].inverse();
            self.turns[handle] = (share_of(way, strength) * self.turns[handle]).normalize();
        }
    }

    /// Bones that follow others or are held go over from where they were before the targets changed.
    fn ease_what_is_given(&mut self, rig: &RestRig, roles: &[BoneRole], easing: &mut Easing, pose: &mut Pose) {
        if let Some(former) = &easing.former {
            for (bone, role) in roles.iter().enumerate() {
                let stays = rig.stays(bone);
                if stays {
                    easing.places.push((bone, former.heads[bone] - rig.heads[bone]));
                }
                let difference = |was: Quat, is: Quat| (was * is.inverse()).normalize();
                match role {
                    BoneRole::Held if stays && rig.parent(bone).is_some() => {
                        easing.held.push((bone, difference(former.rotations[bone], rig.rotations[bone])));
                    }
                    BoneRole::Held | BoneRole::Follows => {
                        let local = pose.parent_from_bone[bone].rotation;
                        let off = difference(former.locals[bone], local);
                        if off.xyz().length() > 1e-6 {
                            easing.locals.push((bone, off));
                        }
                    }
                    BoneRole::Driven | BoneRole::Solved | BoneRole::Dragged => {}
                }
            }
        }
        for (bone, off) in &easing.locals {
            let local = &mut pose.parent_from_bone[*bone].rotation;
            *local = (share_of(*off, easing.left) * *local).normalize();
        }
        self.places.copy_from_slice(&rig.heads);
        for (bone, off) in &easing.places {
            self.places[*bone] += *off * easing.left;
        }
    }

    /// Solved bones and free roots too.
    fn ease_what_is_found(&mut self, rig: &RestRig, easing: &mut Easing, micros: u64) {
        if let Some(former) = easing.former.take() {
            let mut was = self.turns.clone();
            for bone in &self.solved {
                let own = self.layout.bone_of_handle[bone.handle];
                was[bone.handle] = (former.rotations[own] * rig.rotations[own].inverse()).normalize();
            }
            self.before.copy_from_slice(&was);
            self.micros = self.micros.or(Some(micros));
            if let Some(jointed) = &mut self.jointed {
                jointed.unease(&mut was);
            }
            for bone in &self.solved {
                let off = was[bone.handle] * self.turns[bone.handle].inverse();
                easing.turns.push((bone.handle, off.normalize()));
            }
            for (slot, &root) in self.roots.iter().enumerate() {
                if !self.layout.placed[self.layout.handle_of_bone[root]] {
                    easing.shifts.push((slot, former.heads[root] - rig.heads[root] - self.shifts[slot]));
                }
            }
        }
        for (handle, off) in &easing.turns {
            self.turns[*handle] = (share_of(*off, easing.left) * self.turns[*handle]).normalize();
        }
        for (slot, off) in &easing.shifts {
            self.shifts[*slot] += *off * easing.left;
        }
    }

    /// Forward kinematics of driven and held bones. Their rotations are final.
    fn set_targets(&mut self, rig: &RestRig, roles: &[BoneRole], followed: &[Followed], easing: &Easing, pose: &Pose) {
        for (bone, local) in pose.parent_from_bone.iter().enumerate() {
            let parent = rig.parent(bone);
            let stays = rig.stays(bone);
            let held = stays && roles[bone] == BoneRole::Held;
            self.rotations[bone] = match parent {
                Some(parent) if !held => (self.rotations[parent] * local.rotation).normalize(),
                Some(_) => match easing.held.iter().find(|(held, _)| *held == bone) {
                    Some((_, off)) => (share_of(*off, easing.left) * rig.rotations[bone]).normalize(),
                    None => rig.rotations[bone],
                },
                None => local.rotation,
            };
            if roles[bone] == BoneRole::Dragged {
                let mut wanted = followed.iter().zip(&self.goals).filter(|(target, _)| target.bone() == bone);
                if let Some(turn) = wanted.find_map(|(target, (_, turn))| turn.filter(|_| target.turns())) {
                    self.rotations[bone] = turn;
                }
            }
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
                _ => self.places[bone],
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
            let Some(parent) = parent else {
                if self.layout.held_apart[handle] {
                    local.rotation = self.rotations[bone];
                }
                continue;
            };
            let above = self.layout.handle_of_bone[parent];
            if !own {
                self.rotations[bone] = (self.rotations[parent] * local.rotation).normalize();
            } else if self.is_found(handle) || self.is_found(above) {
                local.rotation = (self.rotations[parent].inverse() * self.rotations[bone]).normalize();
            }
        }
        for (root, shift) in self.roots.iter().zip(&self.shifts) {
            let is_moved = !self.layout.placed[self.layout.handle_of_bone[*root]] || *shift != Vec3::ZERO;
            if is_moved && shift.is_finite() {
                pose.parent_from_bone[*root].translation += *shift;
            }
        }
    }

    /// Whether a handle's rotation differs from forward kinematics of the incoming pose.
    fn is_found(&self, handle: usize) -> bool {
        self.layout.is_solved(handle) || self.layout.held_apart[handle]
    }
}

/// The bones without a parent.
pub(super) fn roots(rig: &RestRig) -> impl Iterator<Item = usize> {
    rig.skeleton.bones().iter().enumerate().filter(|(_, bone)| bone.parent.is_none()).map(|(index, _)| index)
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
