//! What every implementation of skinning must do. `deform` runs this suite on its CPU kernels, `render` on their twins
//! on the graphics adapter: anything that implements [`Evaluator`].
//!
//! Bounds are those of the CPU kernels; an evaluator with coarser rounding says so in [`Evaluator::bound`].

mod character;
mod formulas;
pub(crate) mod frames;
pub(crate) mod shared;
pub(crate) mod stretched;

use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, SkinError, StretchTwist, StretchTwistSkin,
};
use armature_geometry::Influences;
use glam::{Affine3A, DVec3, Vec3};

pub(crate) use character::{Character, Dice, rigid_pose, sheared_frames, stretched_pose};

/// How bones move a character.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Method {
    LinearBlend,
    DualQuaternion,
    StretchTwist(BoneBlend),
}

pub(crate) const METHODS: [Method; 4] = [
    Method::LinearBlend,
    Method::DualQuaternion,
    Method::StretchTwist(BoneBlend::Linear),
    Method::StretchTwist(BoneBlend::DualQuaternion),
];

/// Poses of all bones, one after the other.
#[derive(Clone, Debug)]
pub(crate) enum Poses {
    Frames(Vec<Affine3A>),
    Stretched(Vec<StretchTwist>),
}

/// A character as given to an evaluator; arrays may disagree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest<'a> {
    pub(crate) positions: &'a [[f32; 3]],
    pub(crate) normals: &'a [[f32; 3]],
    pub(crate) influences: &'a Influences,
    pub(crate) ends: &'a [f32],
    pub(crate) frames: &'a [Affine3A],
    pub(crate) segments: &'a [BoneSegment],
}

/// Positions and normals of one pose.
pub(crate) type Skinned = (Vec<[f32; 3]>, Vec<[f32; 3]>);

pub(crate) trait Evaluator {
    /// How far off this evaluator may be where the CPU kernels may be off by `of_cpu`, for shapes of size about one.
    fn bound(&self, of_cpu: f64) -> f64;

    fn skin(&mut self, rest: Rest<'_>, method: Method, poses: &Poses) -> Result<Vec<Skinned>, SkinError>;

    /// One pose of a valid character.
    fn one(&mut self, character: &Character, method: Method, poses: &Poses) -> Skinned {
        let mut all = self.skin(character.rest(), method, poses).expect("a valid character and pose");
        assert_eq!(all.len(), 1);
        all.remove(0)
    }
}

/// The kernels of `deform`.
pub(crate) struct Cpu;

impl Evaluator for Cpu {
    fn bound(&self, of_cpu: f64) -> f64 {
        of_cpu
    }

    fn skin(&mut self, rest: Rest<'_>, method: Method, poses: &Poses) -> Result<Vec<Skinned>, SkinError> {
        let Rest { positions, normals, influences, ends, frames, segments } = rest;
        let room = || (vec![[f32::NAN; 3]; positions.len()], vec![[f32::NAN; 3]; positions.len()]);
        match (method, poses) {
            (Method::LinearBlend, Poses::Frames(poses)) => {
                let mut skin = LinearBlendSkin::precompute(positions, normals, influences, frames)?;
                each(poses, frames.len(), |pose, out| skin.solve(pose, &mut out.0, &mut out.1), room)
            }
            (Method::DualQuaternion, Poses::Frames(poses)) => {
                let mut skin = DualQuaternionSkin::precompute(positions, normals, influences, frames)?;
                each(poses, frames.len(), |pose, out| skin.solve(pose, &mut out.0, &mut out.1), room)
            }
            (Method::StretchTwist(blend), Poses::Stretched(poses)) => {
                let mut skin = StretchTwistSkin::precompute(positions, normals, influences, ends, segments, blend)?;
                each(poses, segments.len(), |pose, out| skin.solve(pose, &mut out.0, &mut out.1), room)
            }
            _ => panic!("{method:?} takes other poses"),
        }
    }
}

fn each<P>(
    poses: &[P],
    bones: usize,
    mut solve: impl FnMut(&[P], &mut Skinned) -> Result<(), SkinError>,
    room: impl Fn() -> Skinned,
) -> Result<Vec<Skinned>, SkinError> {
    let pose = |pose: &[P]| {
        let mut out = room();
        solve(pose, &mut out)?;
        Ok(out)
    };
    poses.chunks(bones).map(pose).collect()
}

pub(crate) fn apart(a: [f32; 3], b: DVec3) -> f64 {
    wide(a).distance(b)
}

pub(crate) fn wide(a: [f32; 3]) -> DVec3 {
    Vec3::from(a).as_dvec3()
}

/// Makes a test of every promise, for the evaluator that `$evaluator` makes; if it makes none, tests pass.
macro_rules! skin_suite {
    ($evaluator:expr) => {
        skin_suite!(@ $evaluator, shared:
            the_rest_pose_returns_the_rest_shape
            a_rigid_motion_of_all_bones_moves_everything_rigidly
            a_vertex_without_a_normal_stays_without_one
            what_cannot_be_skinned_is_named
            poses_that_are_not_finite_are_named
        );
        skin_suite!(@ $evaluator, frames:
            linear_blending_agrees_with_the_formula
            linear_blending_turns_normals_as_moved_triangles_do
            flattened_surfaces_keep_their_rest_normals
            dual_quaternions_agree_with_the_formula
            a_twisted_joint_keeps_its_girth
            scale_is_ignored_by_dual_quaternions_but_origins_are_followed
        );
        skin_suite!(@ $evaluator, stretched:
            stretching_and_twisting_agree_with_the_formulas
            bones_at_their_length_without_twist_give_the_underlying_method
            vertices_in_order_of_their_bones_agree_with_those_in_none
            five_and_more_influences_count
            twist_spreads_along_a_bone_and_stretch_ends_with_it
            a_bone_without_length_neither_twists_nor_stretches
        );
    };
    (@ $evaluator:expr, $part:ident: $($name:ident)+) => {
        $(
            #[test]
            fn $name() {
                if let Some(mut evaluator) = $evaluator {
                    skin_suite::$part::$name(&mut evaluator);
                }
            }
        )+
    };
}
