//! Random characters and poses, the same in every run.

use armature_deform::skin::{BoneSegment, StretchTwist};
use armature_geometry::Influences;
use glam::{Affine3A, Mat3, Quat, Vec3};

use super::{Method, Poses, Rest};

/// Numbers in [-1, 1): a linear congruential generator (Knuth's constants), using its upper bits.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn roll(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 / (1 << 23) as f32) - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.roll(), self.roll(), self.roll())
    }

    pub(crate) fn turn(&mut self) -> Quat {
        Quat::from_xyzw(self.roll(), self.roll(), self.roll(), self.roll()).normalize()
    }

    pub(crate) fn rigid(&mut self) -> Affine3A {
        Affine3A::from_rotation_translation(self.turn(), self.vector())
    }

    /// Scaled from 0.5 to 1.9 and sheared.
    pub(crate) fn frame(&mut self) -> Affine3A {
        let scale = Vec3::splat(1.2) + 0.7 * self.vector();
        let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.3 * self.roll(), 1.0, 0.0), Vec3::Z);
        let linear = Mat3::from_quat(self.turn()) * Mat3::from_diagonal(scale) * shear;
        Affine3A::from_mat3_translation(linear, 3.0 * self.vector())
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Character {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) influences: Influences,
    pub(crate) ends: Vec<f32>,
    pub(crate) frames: Vec<Affine3A>,
    pub(crate) segments: Vec<BoneSegment>,
}

impl Character {
    /// Neighbours follow different bones. Rest frames are rigid; a vertex's first weight is its largest.
    pub(crate) fn new(vertices: usize, bones: usize, per_vertex: usize, dice: &mut Dice) -> Self {
        let slots = vertices * per_vertex;
        let of_slot = |i: usize| ((i / per_vertex * 7 + i % per_vertex * 3) % bones) as u16;
        let weights = (0..slots).map(|i| if i % per_vertex == 0 { 1.1 + dice.roll() } else { dice.roll().max(0.0) });
        Self {
            influences: influences(per_vertex, (0..slots).map(of_slot).collect(), weights.collect(), bones),
            ends: (0..slots).map(|_| 0.5 + 0.5 * dice.roll()).collect(),
            positions: (0..vertices).map(|_| dice.vector().to_array()).collect(),
            normals: (0..vertices).map(|_| (dice.turn() * Vec3::Y).to_array()).collect(),
            frames: (0..bones).map(|_| dice.rigid()).collect(),
            segments: (0..bones).map(|_| BoneSegment { start: dice.vector(), end: dice.vector() }).collect(),
        }
    }

    /// Neighbours follow the same bones, as on real characters; four influences per vertex, nine bones.
    pub(crate) fn in_order(vertices: usize, dice: &mut Dice) -> Self {
        let bones = (0..4 * vertices).map(|i| ((i / 4 * 9 / vertices + i % 4) % 9) as u16).collect();
        let weights = (0..4 * vertices).map(|_| dice.roll().abs()).collect();
        Self { influences: influences(4, bones, weights, 9), ..Self::new(vertices, 9, 4, dice) }
    }

    pub(crate) fn rest(&self) -> Rest<'_> {
        let Self { positions, normals, influences, ends, frames, segments } = self;
        Rest { positions, normals, influences, ends, frames, segments }
    }
}

pub(crate) fn influences(per_vertex: usize, bones: Vec<u16>, weights: Vec<f32>, bone_count: usize) -> Influences {
    Influences::new(per_vertex, bones, weights, bone_count).expect("sound influences")
}

/// All bones moved together from rest.
pub(crate) fn rigid_pose(character: &Character, method: Method, motion: Affine3A) -> Poses {
    if let Method::StretchTwist(_) = method {
        let turn = Quat::from_mat3a(&motion.matrix3);
        let moved = |bone: &BoneSegment| StretchTwist {
            start: motion.transform_point3(bone.start),
            turn,
            stretch: 1.0,
            twist: [0.0; 2],
        };
        Poses::Stretched(character.segments.iter().map(moved).collect())
    } else {
        Poses::Frames(character.frames.iter().map(|rest| motion * *rest).collect())
    }
}

pub(crate) fn stretched_pose(bones: usize, twist: f32, stretch: f32, dice: &mut Dice) -> Vec<StretchTwist> {
    let bone = |_| StretchTwist {
        start: dice.vector(),
        turn: dice.turn(),
        stretch: 1.0 + stretch * dice.roll(),
        twist: [twist * dice.roll(), twist * dice.roll()],
    };
    (0..bones).map(bone).collect()
}

/// Rigid in the first three poses; then scaled, sheared and, in some cases, reflected.
pub(crate) fn sheared_frames(bones: usize, poses: usize, dice: &mut Dice) -> Vec<Affine3A> {
    let frame = |number: usize| {
        let rigid = dice.rigid();
        let last = if number.is_multiple_of(7) { -Vec3::Z } else { Vec3::Z };
        let odd = Mat3::from_cols(1.3 * Vec3::X, Vec3::new(0.2, 0.8, 0.0), last);
        if number < 3 * bones { rigid } else { rigid * Affine3A::from_mat3(odd) }
    };
    (0..bones * poses).map(frame).collect()
}
