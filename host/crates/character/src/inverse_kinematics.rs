//! The bones that no joint drives, found from the shape: as rigid as possible (thesis chapter 7).
//!
//! What the puppet says is kept: a driven bone is turned exactly as its joints turn it, and stands exactly where
//! forward kinematics puts it as long as everything between it and a pin is driven or held. The rest minimises the
//! energy of the whole shape over the transformations of the bones ([`ReducedArap`]). Its affine result becomes a
//! pose of rigid bones: the nearest rotation of each solved bone, bone lengths as at rest from parent to child, and
//! then the least change that puts pins back in place. Everything after (skinning, takes, exports) uses that pose.

use std::ops::ControlFlow;

use armature_deform::{
    ArapEnergy, ArapError, ArapSettings, ArapShape, ArapStop, HandleConstraint, LANES, Matrices, ReducedArap,
    SharedJoint, nearest_rotations,
};
use armature_rig::{BoneQuality, BoneStatus, Pose, PoseCompletion, Skeleton};
use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3};

use crate::bone_roles::bone_roles;
use crate::comfort::Comfort;
use crate::held_pins::{HeldPins, Pin};
use crate::{BoneRole, Character, PinHold, PinnedBone};

/// Local and global steps a frame, from the frame before (thesis section 7.4).
const STEPS_A_FRAME: ArapStop = ArapStop { iterations: 15, tolerance: 1e-5 };
/// Without a frame before.
const FIRST_STEPS: ArapStop = ArapStop { iterations: 400, tolerance: 1e-6 };
/// A bone with less weight than this many whole vertices moves nothing that could tell where it is.
const LEAST_WEIGHT: f64 = 1.0;
/// What a turn about the bone itself counts beside where its ends go, when a rotation is fitted.
const TWIST_SHARE: f32 = 0.05;

/// Why a character has no inverse kinematics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The skeleton has no such bone.
    #[error("there is no bone {name:?}{}", nearest.as_ref().map_or_else(String::new, |n| format!("; did you mean {n:?}?")))]
    UnknownBone {
        /// The name given.
        name: String,
        /// A bone whose name differs in case only.
        nearest: Option<String>,
    },
    /// The shape cannot be reduced to its bones.
    #[error("the shape cannot be posed by a few of its bones: {0}")]
    Shape(#[from] ArapError),
}

/// Inverse kinematics of one character; see the [module](self).
///
/// Which bones are driven is learned from the poses; a change of it prepares the reduced system anew, which takes
/// some hundredths of a second.
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    pub(crate) skeleton: Skeleton,
    shape: Shape,
    /// Model space, in the rest pose.
    pub(crate) rest: RestFrames,
    pins: Vec<Option<PinHold>>,
    pub(crate) comforts: Vec<Option<Comfort>>,
    moves: Vec<bool>,
    driven: Vec<bool>,
    roles: Vec<BoneRole>,
    pub(crate) system: Option<SolvedSystem>,
    problem: Option<IkError>,
}

/// The character's shape as the energy sees it.
#[derive(Clone, Debug)]
struct Shape {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    influences: armature_geometry::Influences,
}

#[derive(Clone, Debug)]
pub(crate) struct RestFrames {
    pub(crate) heads: Vec<Vec3>,
    pub(crate) tails: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl InverseKinematics {
    /// Takes a character's shape, skeleton and weights. Nothing is driven at first. Without `pins` the skeleton's roots
    /// are fixed.
    pub fn new(character: &Character, pins: &[PinnedBone]) -> Result<Self, IkError> {
        let skeleton = character.skeleton.clone();
        let mut held = vec![None; skeleton.len()];
        for pin in pins {
            held[find_bone(&skeleton, &pin.bone)?] = Some(pin.hold);
        }
        if pins.is_empty() {
            let roots = skeleton.bones().iter().map(|bone| bone.parent.is_none().then_some(PinHold::Fixed));
            held = roots.collect();
        }
        let mut weight = vec![0.0; skeleton.len()];
        for vertex in 0..character.influences.vertex_count() {
            character.influences.of_vertex(vertex).for_each(|(bone, w)| weight[usize::from(bone)] += f64::from(w));
        }
        let moves: Vec<bool> = weight.iter().map(|w| *w >= LEAST_WEIGHT).collect();
        let driven = vec![false; skeleton.len()];
        Ok(Self {
            shape: Shape {
                positions: character.mesh.vertices.clone(),
                triangles: character.mesh.triangles.clone(),
                influences: character.influences.clone(),
            },
            rest: RestFrames::of(&skeleton),
            roles: bone_roles(&skeleton, &driven, &held, &moves),
            comforts: vec![None; skeleton.len()],
            skeleton,
            pins: held,
            moves,
            driven,
            system: None,
            problem: None,
        })
    }

    /// Prepares for these driven bones (one flag a bone). `progress` is called with the part done and can cancel.
    pub fn drive(&mut self, driven: &[bool], progress: &mut dyn FnMut(f64) -> ControlFlow<()>) -> Result<(), IkError> {
        self.driven.clear();
        self.driven.extend((0..self.skeleton.len()).map(|bone| driven.get(bone).copied().unwrap_or(false)));
        self.roles = bone_roles(&self.skeleton, &self.driven, &self.pins, &self.moves);
        self.system = None;
        self.problem = None;
        let made = self.prepare(progress);
        self.system = made.inspect_err(|error| self.problem = Some(error.clone()))?;
        Ok(())
    }

    fn prepare(&self, progress: &mut dyn FnMut(f64) -> ControlFlow<()>) -> Result<Option<SolvedSystem>, IkError> {
        let as_at_rest = |(bone, pin): (&armature_rig::Bone, &Option<PinHold>)| {
            *pin == bone.parent.is_none().then_some(PinHold::Fixed)
        };
        if self.skeleton.bones().iter().zip(&self.pins).all(as_at_rest) && !self.roles.contains(&BoneRole::Solved) {
            return Ok(None);
        }
        let layout = Layout::new(&self.skeleton, &self.roles, &self.pins);
        let arap = layout.precompute(self, progress)?;
        Ok(Some(SolvedSystem::new(self, layout, arap)))
    }

    /// Which bones it is prepared for.
    pub fn driven(&self) -> &[bool] {
        &self.driven
    }

    /// What decides how each bone is turned.
    pub fn roles(&self) -> &[BoneRole] {
        &self.roles
    }

    /// Whether it changes anything for the bones that are driven now.
    pub fn is_needed(&self) -> bool {
        self.system.is_some()
    }

    /// Why it does nothing although it should.
    pub fn problem(&self) -> Option<&IkError> {
        self.problem.as_ref()
    }

    /// What is held, in the skeleton's order.
    pub fn pins(&self) -> impl Iterator<Item = PinnedBone> {
        let named = |bone: &armature_rig::Bone, hold| PinnedBone { bone: bone.name.clone(), hold };
        self.skeleton.bones().iter().zip(&self.pins).filter_map(move |(bone, pin)| Some(named(bone, (*pin)?)))
    }

    /// By how far the worst pin was missed in the last pose (mesh units); 0 where all are in place.
    pub fn worst_pin(&self) -> f32 {
        self.system.as_ref().map_or(0.0, |system| system.worst_pin)
    }
}

impl PoseCompletion for InverseKinematics {
    fn complete(&mut self, status: &[BoneStatus], pose: &mut Pose) {
        if pose.parent_from_bone.len() != self.skeleton.len() || status.len() != self.skeleton.len() {
            return;
        }
        let is_driven = |status: &BoneStatus| status.quality != BoneQuality::Unmapped;
        if !status.iter().map(is_driven).eq(self.driven.iter().copied()) {
            let driven: Vec<bool> = status.iter().map(is_driven).collect();
            // What went wrong is kept for those who ask; the pose then stays as the joints made it.
            let _ = self.drive(&driven, &mut |_| ControlFlow::Continue(()));
        }
        if let Some(system) = &mut self.system {
            system.complete(&self.skeleton, &self.rest, &self.roles, &self.pins, pose);
        }
    }

    fn restart(&mut self) {
        if let Some(system) = &mut self.system {
            system.arap.clone_from(&system.fresh);
            system.is_first = true;
        }
    }
}

pub(crate) fn find_bone(skeleton: &Skeleton, name: &str) -> Result<usize, IkError> {
    skeleton.find(name).ok_or_else(|| {
        let alike = skeleton.bones().iter().find(|bone| bone.name.eq_ignore_ascii_case(name));
        IkError::UnknownBone { name: name.to_owned(), nearest: alike.map(|bone| bone.name.clone()) }
    })
}

impl RestFrames {
    fn of(skeleton: &Skeleton) -> Self {
        let segments = skeleton.rest_segments();
        let mut rotations: Vec<Quat> = Vec::with_capacity(skeleton.len());
        for bone in skeleton.bones() {
            rotations.push(bone.parent.map_or(bone.rest.rotation, |p| rotations[p] * bone.rest.rotation).normalize());
        }
        let (heads, tails) = segments.into_iter().unzip();
        Self { heads, tails, rotations }
    }
}

/// Handles of the reduced system: a bone each, with all bones that go along with it.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) handle_of_bone: Vec<usize>,
    pub(crate) bone_of_handle: Vec<usize>,
    /// Whether forward kinematics knows where the handle's bone stands.
    placed: Vec<bool>,
    /// Whether a pin holds the bone turned as at rest although its parent is not.
    held_apart: Vec<bool>,
    constraints: Vec<HandleConstraint>,
}

impl Layout {
    fn new(skeleton: &Skeleton, roles: &[BoneRole], pins: &[Option<PinHold>]) -> Self {
        let mut layout = Self {
            handle_of_bone: Vec::with_capacity(roles.len()),
            bone_of_handle: Vec::new(),
            placed: Vec::new(),
            held_apart: Vec::new(),
            constraints: Vec::new(),
        };
        for (bone, role) in roles.iter().enumerate() {
            let above = skeleton.bones()[bone].parent.map(|p| layout.handle_of_bone[p]);
            if let (BoneRole::Follows, Some(above)) = (role, above) {
                layout.handle_of_bone.push(above);
                continue;
            }
            let solved = matches!(role, BoneRole::Solved | BoneRole::Follows);
            let stays = matches!(pins[bone], Some(PinHold::Fixed | PinHold::Turning));
            let placed = !solved && (stays || above.is_some_and(|h| layout.placed[h]));
            layout.handle_of_bone.push(layout.bone_of_handle.len());
            layout.bone_of_handle.push(bone);
            layout.placed.push(placed);
            layout.held_apart.push(*role == BoneRole::Held && stays && above.is_some());
            layout.constraints.push(match (solved, placed) {
                (true, _) if stays => HandleConstraint::Position,
                (true, _) => HandleConstraint::Free,
                (false, true) => HandleConstraint::Full,
                (false, false) => HandleConstraint::Orientation,
            });
        }
        layout
    }

    /// Whether the shape decides how the handle is turned.
    pub(crate) fn is_solved(&self, handle: usize) -> bool {
        matches!(self.constraints[handle], HandleConstraint::Free | HandleConstraint::Position)
    }

    fn precompute(
        &self,
        ik: &InverseKinematics,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<ReducedArap, IkError> {
        let handles = self.bone_of_handle.len();
        let shape = &ik.shape;
        let mut weights = vec![0.0; shape.positions.len() * handles];
        for (vertex, row) in weights.chunks_exact_mut(handles).enumerate() {
            for (bone, weight) in shape.influences.of_vertex(vertex) {
                row[self.handle_of_bone[usize::from(bone)]] += f64::from(weight);
            }
        }
        let head = |bone: usize| ik.rest.heads[bone].as_dvec3().to_array();
        let handle_points: Vec<[f64; 3]> = self.bone_of_handle.iter().map(|&bone| head(bone)).collect();
        let joint = |(handle, &bone): (usize, &usize)| {
            let above = self.handle_of_bone[ik.skeleton.bones()[bone].parent?];
            let redundant = self.placed[above] && self.placed[handle];
            (!redundant).then(|| SharedJoint { handles: [above, handle], point: head(bone) })
        };
        let joints: Vec<SharedJoint> = self.bone_of_handle.iter().enumerate().filter_map(joint).collect();
        let mut arap = ReducedArap::precompute(
            &ArapShape {
                positions: &shape.positions,
                energy: ArapEnergy::SpokesAndRims(&shape.triangles),
                weights: &weights,
                handle_points: &handle_points,
                joints: &joints,
            },
            &ArapSettings::default(),
            progress,
        )?;
        arap.constrain(&self.constraints, &[])?;
        arap.soften(&ik.soft_joints(self))?;
        Ok(arap)
    }
}

/// A solved bone, and how to fit a rotation to its affine map.
#[derive(Clone, Debug)]
struct SolvedBone {
    handle: usize,
    /// Second moments of its joints about its head: where a fitted rotation has to be right.
    moments: Mat3A,
}

/// Everything for one set of driven bones.
#[derive(Clone, Debug)]
pub(crate) struct SolvedSystem {
    pub(crate) layout: Layout,
    pub(crate) arap: ReducedArap,
    /// As it was before the first pose.
    pub(crate) fresh: ReducedArap,
    is_first: bool,
    solved: Vec<SolvedBone>,
    roots: Vec<usize>,
    pins: HeldPins,
    worst_pin: f32,
    /// One a handle.
    targets: Vec<Affine3A>,
    /// `model_from_rest` of every handle's bone.
    turns: Vec<Quat>,
    /// How far each root is from its rest position.
    shifts: Vec<Vec3>,
    /// `model_from_bone` rotations.
    rotations: Vec<Quat>,
}

impl SolvedSystem {
    fn new(ik: &InverseKinematics, layout: Layout, arap: ReducedArap) -> Self {
        let bones = ik.skeleton.bones();
        let roots: Vec<usize> = (0..bones.len()).filter(|&bone| bones[bone].parent.is_none()).collect();
        let handles = layout.bone_of_handle.len();
        let is_solved = |handle: usize| layout.is_solved(handle);
        let solved = (0..handles)
            .filter(|&handle| is_solved(handle))
            .map(|handle| SolvedBone { handle, moments: moments(ik, &layout, handle) });
        let free_roots = roots.iter().map(|&root| !layout.placed[layout.handle_of_bone[root]]).collect();
        let size = ik.rest.heads.iter().fold(0.0_f32, |size, head| size.max(head.distance(ik.rest.heads[0])));
        let pins = (0..bones.len())
            .filter(|&bone| ik.pins[bone].is_some())
            .map(|bone| pin(ik, &layout, &roots, bone))
            .filter(|pin| !pin.segments.is_empty() || !layout.placed[layout.handle_of_bone[roots[pin.root]]]);
        Self {
            pins: HeldPins::new(pins.collect(), (0..handles).map(is_solved).collect(), free_roots, size),
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

    fn complete(
        &mut self,
        skeleton: &Skeleton,
        rest: &RestFrames,
        roles: &[BoneRole],
        pins: &[Option<PinHold>],
        pose: &mut Pose,
    ) {
        self.set_targets(skeleton, rest, roles, pins, pose);
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
                self.arap.transforms()[handle].transform_point3(rest.heads[root]) - rest.heads[root]
            };
        }
        self.worst_pin = self.pins.hold(&mut self.turns, &mut self.shifts);
        self.write(skeleton, rest, pose);
    }

    /// What forward kinematics says of driven and held bones. Their turns are the final ones.
    fn set_targets(
        &mut self,
        skeleton: &Skeleton,
        rest: &RestFrames,
        roles: &[BoneRole],
        pins: &[Option<PinHold>],
        pose: &Pose,
    ) {
        for (bone, local) in pose.parent_from_bone.iter().enumerate() {
            let parent = skeleton.bones()[bone].parent;
            let stays = matches!(pins[bone], Some(PinHold::Fixed | PinHold::Turning));
            let held = stays && roles[bone] == BoneRole::Held;
            self.rotations[bone] = match parent {
                Some(parent) if !held => (self.rotations[parent] * local.rotation).normalize(),
                Some(_) => rest.rotations[bone],
                None => local.rotation,
            };
            let handle = self.layout.handle_of_bone[bone];
            if self.layout.bone_of_handle[handle] != bone {
                continue;
            }
            let turn = (self.rotations[bone] * rest.rotations[bone].inverse()).normalize();
            self.turns[handle] = turn;
            let head = match parent {
                Some(parent) if !stays => {
                    self.targets[self.layout.handle_of_bone[parent]].transform_point3(rest.heads[bone])
                }
                _ => rest.heads[bone],
            };
            self.targets[handle] = Affine3A::from_rotation_translation(turn, head - turn * rest.heads[bone]);
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

    /// Bone by bone, parents first. What is turned with a parent that forward kinematics knew keeps its bits.
    fn write(&mut self, skeleton: &Skeleton, rest: &RestFrames, pose: &mut Pose) {
        for (bone, local) in pose.parent_from_bone.iter_mut().enumerate() {
            let parent = skeleton.bones()[bone].parent;
            let handle = self.layout.handle_of_bone[bone];
            let own = self.layout.bone_of_handle[handle] == bone;
            if own {
                self.rotations[bone] = (self.turns[handle] * rest.rotations[bone]).normalize();
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

    /// Whether a handle's turn is not what forward kinematics of the pose as it came would give.
    fn is_found(&self, handle: usize) -> bool {
        self.layout.is_solved(handle) || self.layout.held_apart[handle]
    }
}

/// Where a fitted rotation of a handle has to be right: at the joints it shares.
fn moments(ik: &InverseKinematics, layout: &Layout, handle: usize) -> Mat3A {
    let bones = ik.skeleton.bones();
    let own = layout.bone_of_handle[handle];
    let head = ik.rest.heads[own];
    let is_joint = |bone: usize| {
        let above = bones[bone].parent.map(|p| layout.handle_of_bone[p]);
        layout.handle_of_bone[bone] != handle && above == Some(handle)
    };
    let ends = (0..bones.len()).filter(|&bone| is_joint(bone)).map(|bone| ik.rest.heads[bone]);
    let (mut sum, mut largest) = (Mat3::ZERO, 0.0_f32);
    for end in ends.chain([ik.rest.tails[own]]) {
        let along = end - head;
        largest = largest.max(along.length_squared());
        sum += Mat3::from_cols(along * along.x, along * along.y, along * along.z);
    }
    if largest <= 0.0 {
        return Mat3A::IDENTITY;
    }
    Mat3A::from((sum + Mat3::from_diagonal(Vec3::splat(TWIST_SHARE * largest))) * (1.0 / largest))
}

/// The way from a root to a pinned bone.
fn pin(ik: &InverseKinematics, layout: &Layout, roots: &[usize], bone: usize) -> Pin {
    let bones = ik.skeleton.bones();
    let mut segments: Vec<(usize, Vec3)> = Vec::new();
    let (mut at, mut end) = (bone, ik.rest.heads[bone]);
    while let Some(parent) = bones[at].parent {
        let handle = layout.handle_of_bone[parent];
        let head = ik.rest.heads[parent];
        match segments.last_mut() {
            Some((last, along)) if *last == handle => *along += end - head,
            _ => segments.push((handle, end - head)),
        }
        (at, end) = (parent, head);
    }
    let root = roots.iter().position(|&root| root == at).unwrap_or(0);
    let weight = if ik.pins[bone] == Some(PinHold::Upright) { Vec3::new(1.0, 0.0, 1.0) } else { Vec3::ONE };
    Pin { target: ik.rest.heads[bone], weight, root, rest_root: ik.rest.heads[at], segments }
}
