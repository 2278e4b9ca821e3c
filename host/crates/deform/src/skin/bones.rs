//! Bones as the kernels read them, prepared once for the CPU and for the shaders.
//!
//! Everything is computed in `f64` and rounded at the end, so that the rest pose gives the identity to the last bit
//! even for a bone far from the origin. A kernel only puts the numbers in the order in which it loads them.

use armature_geometry::Influences;
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3, Quat, Vec3};

use super::error::{SkinError, expect_length};
use crate::lanes::LANES;
use crate::nearest_rotation::nearest_rotations;

/// A bone at rest, a line segment (mesh units, model space).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneSegment {
    /// Where it starts.
    pub start: Vec3,
    /// Where it ends.
    pub end: Vec3,
}

/// A posed bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchTwist {
    /// Where the start goes.
    pub start: Vec3,
    /// The rotation since rest, which takes the rest direction to the posed one.
    pub turn: Quat,
    /// Posed length over rest length; 1 does not stretch.
    pub stretch: f32,
    /// Twists about the bone at its start and end (radians); 0 does not twist.
    pub twist: [f32; 2],
}

/// A bone's `model_from_rest` in rows of `(x, y, z, translation)`.
pub type BoneRows = [[f32; 4]; 3];

/// A bone's rigid motion since rest, a unit dual quaternion: real part `[w, x, y, z]`, then the dual part.
pub type BoneMotion = [f32; 8];

/// A bone and the frame in which vertices are bound to it. Most characters have one per bone, from the rest pose; a mesh
/// that was bound in another pose adds its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneBinding {
    /// Zero-based bone.
    pub bone: u32,
    /// Where the bone was when the vertices were bound; model space.
    pub rest_model_from_bone: Affine3A,
}

/// Bones at rest that are posed by frames.
#[derive(Clone, Debug)]
pub struct RestFrames {
    bone_count: usize,
    /// The bone of each binding.
    bones: Vec<u32>,
    bone_from_rest: Vec<DAffine3>,
    origins: Vec<DVec3>,
}

impl RestFrames {
    /// Checks a character in its rest pose and inverts the frames of its bones.
    ///
    /// `rest_positions`, `rest_normals`: n×3 in model space. `influences`: n rows. `rest_model_from_bone`: one frame
    /// per bone.
    pub fn new(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        rest_model_from_bone: &[Affine3A],
    ) -> Result<Self, SkinError> {
        let binding = |(bone, &rest_model_from_bone)| BoneBinding { bone, rest_model_from_bone };
        let bindings: Vec<BoneBinding> = (0..).zip(rest_model_from_bone).map(binding).collect();
        Self::bound(rest_positions, rest_normals, influences, &bindings, rest_model_from_bone.len())
    }

    /// The same for vertices bound in several poses: `influences` refer to `bindings`, which refer to bones.
    pub fn bound(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        bindings: &[BoneBinding],
        bone_count: usize,
    ) -> Result<Self, SkinError> {
        let vertex_count = rest_positions.len();
        expect_length("rest normals", rest_normals.len(), vertex_count)?;
        expect_length("rows of influences", influences.vertex_count(), vertex_count)?;
        let vectors = rest_positions.iter().zip(rest_normals);
        if let Some(vertex) = vectors.clone().position(|(p, n)| !p.iter().chain(n).all(|c| c.is_finite())) {
            return Err(SkinError::VertexNotFinite { vertex });
        }
        if let Some(binding) = bindings.iter().position(|binding| binding.bone as usize >= bone_count) {
            return Err(SkinError::BindingOutOfRange { binding, bone: bindings[binding].bone, bone_count });
        }
        for vertex in 0..vertex_count {
            if let Some((bone, _)) = influences.of_vertex(vertex).find(|(b, _)| usize::from(*b) >= bindings.len()) {
                return Err(SkinError::BoneOutOfRange { vertex, bone, bone_count: bindings.len() });
            }
        }
        let inverse = |binding: &BoneBinding| {
            invert(&binding.rest_model_from_bone).ok_or(SkinError::RestNotInvertible { bone: binding.bone as usize })
        };
        Ok(Self {
            bone_count,
            bones: bindings.iter().map(|binding| binding.bone).collect(),
            bone_from_rest: bindings.iter().map(inverse).collect::<Result<_, _>>()?,
            origins: bindings.iter().map(|binding| binding.rest_model_from_bone.translation.as_dvec3()).collect(),
        })
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        self.bone_count
    }

    /// Number of bindings: one per bone, unless vertices are bound in several poses.
    pub fn binding_count(&self) -> usize {
        self.bones.len()
    }

    /// Passes each binding's map since rest to `write`, in order. `model_from_bone`: one frame per bone. Allocates
    /// nothing.
    pub fn rows(&self, model_from_bone: &[Affine3A], mut write: impl FnMut(usize, BoneRows)) -> Result<(), SkinError> {
        expect_length("posed bones", model_from_bone.len(), self.bone_count())?;
        for (binding, (&bone, bone_from_rest)) in self.bones.iter().zip(&self.bone_from_rest).enumerate() {
            let moved = widen(&model_from_bone[bone as usize]) * *bone_from_rest;
            let m = moved.matrix3.transpose();
            let row = |r: DVec3, t: f64| r.extend(t).as_vec4().to_array();
            let [x, y, z] = moved.translation.to_array();
            let rows = [row(m.x_axis, x), row(m.y_axis, y), row(m.z_axis, z)];
            if !rows.as_flattened().iter().all(|c| c.is_finite()) {
                return Err(SkinError::PoseNotFinite { bone: bone as usize });
            }
            write(binding, rows);
        }
        Ok(())
    }

    /// Passes each binding's rigid motion since rest to `write`, in order: the nearest rotation of its map, and where
    /// it takes the bone's origin. `model_from_bone`: one frame per bone. Allocates nothing.
    pub fn motions(
        &self,
        model_from_bone: &[Affine3A],
        mut write: impl FnMut(usize, BoneMotion),
    ) -> Result<(), SkinError> {
        expect_length("posed bones", model_from_bone.len(), self.bone_count())?;
        for (number, eight) in self.bones.chunks(LANES).enumerate() {
            let mut linear = [[[0.0; LANES]; 3]; 3];
            for (lane, &bone) in eight.iter().enumerate() {
                let frame = &model_from_bone[bone as usize];
                let moved = (widen(frame) * self.bone_from_rest[number * LANES + lane]).matrix3;
                for row in 0..3 {
                    for column in 0..3 {
                        linear[row][column][lane] = moved.col(column)[row] as f32;
                    }
                }
                if !frame.is_finite() || !moved.as_mat3().is_finite() {
                    return Err(SkinError::PoseNotFinite { bone: bone as usize });
                }
            }
            let turned = nearest_rotations(&linear);
            for (lane, &bone) in eight.iter().enumerate() {
                let (frame, binding) = (&model_from_bone[bone as usize], number * LANES + lane);
                let column = |c: usize| DVec3::from_array([0, 1, 2].map(|r| f64::from(turned[r][c][lane])));
                let turn = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
                let shift = frame.translation.as_dvec3() - turn * self.origins[binding];
                let dual = DQuat::from_xyzw(shift.x, shift.y, shift.z, 0.0) * turn * 0.5;
                let parts = [turn.w, turn.x, turn.y, turn.z, dual.w, dual.x, dual.y, dual.z].map(|c| c as f32);
                if !parts.iter().all(|c| c.is_finite()) {
                    return Err(SkinError::PoseNotFinite { bone: bone as usize });
                }
                write(binding, parts);
            }
        }
        Ok(())
    }
}

/// Bones at rest that may stretch and twist.
#[derive(Clone, Debug)]
pub struct RestSegments(Vec<BoneSegment>);

impl RestSegments {
    /// Checks a character in its rest pose. `end_weights`: as long as `influences.bones()` and in its order.
    pub fn new(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        end_weights: &[f32],
        rest: &[BoneSegment],
    ) -> Result<Self, SkinError> {
        let segments = Self(rest.to_vec());
        RestFrames::new(rest_positions, rest_normals, influences, &segments.frames())?;
        if let Some(bone) = rest.iter().position(|bone| !bone.end.is_finite()) {
            return Err(SkinError::RestNotInvertible { bone });
        }
        expect_length("end weights", end_weights.len(), influences.bones().len())?;
        if let Some(slot) = end_weights.iter().position(|e| !e.is_finite()) {
            return Err(SkinError::VertexNotFinite { vertex: slot / influences.per_vertex() });
        }
        Ok(segments)
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        self.0.len()
    }

    /// The rest frames of the underlying method: translated to the bones' starts.
    pub fn frames(&self) -> Vec<Affine3A> {
        self.0.iter().map(|bone| Affine3A::from_translation(bone.start)).collect()
    }

    /// Passes each posed bone to `write`, in order, until one is refused. `pose`: one per bone. Allocates nothing.
    pub fn posed(
        &self,
        pose: &[StretchTwist],
        mut write: impl FnMut(usize, &PosedBone) -> Result<(), SkinError>,
    ) -> Result<(), SkinError> {
        expect_length("posed bones", pose.len(), self.bone_count())?;
        for (bone, (pose, rest)) in pose.iter().zip(&self.0).enumerate() {
            let posed = PosedBone::new(pose, rest).ok_or(SkinError::PoseNotFinite { bone })?;
            write(bone, &posed)?;
        }
        Ok(())
    }
}

/// A posed bone that may be stretched and twisted (thesis eqs. 6.4 and 6.5).
#[derive(Clone, Copy, Debug)]
pub struct PosedBone {
    /// Unit quaternion: its rotation since rest.
    pub turn: DQuat,
    /// Unit at rest, or zero for a bone without length, which has no axis to twist about.
    pub axis: DVec3,
    /// Where it starts at rest.
    pub rest_start: DVec3,
    /// Where it starts now.
    pub start: DVec3,
    /// What stretching adds to the end's position.
    pub longer: DVec3,
    /// Half the twist at its start, and how much it grows to the end (radians).
    pub half_twist: [f32; 2],
    /// Where the bone is, in the underlying method's terms.
    pub(super) frame: Affine3A,
}

/// How far the squared length of a quaternion normalised in `f32` may be from one.
const UNIT: f64 = 1e-6;

impl PosedBone {
    fn new(pose: &StretchTwist, rest: &BoneSegment) -> Option<Self> {
        let turn = DQuat::from_array(pose.turn.to_array().map(f64::from));
        let length = turn.length();
        let half_twist = [0.5 * pose.twist[0], 0.5 * (pose.twist[1] - pose.twist[0])];
        if !(length > 1e-12 && length.is_finite() && half_twist.iter().all(|t| t.is_finite())) {
            return None;
        }
        let unit = if (length * length - 1.0).abs() < UNIT { pose.turn } else { (turn * (1.0 / length)).as_quat() };
        let turn = turn * (1.0 / length);
        let along = (rest.end - rest.start).as_dvec3();
        let axis = along.normalize_or_zero();
        let longer = turn * (along * (f64::from(pose.stretch) - 1.0));
        if !(pose.start.is_finite() && longer.as_vec3().is_finite()) {
            return None;
        }
        Some(Self {
            turn,
            axis,
            rest_start: rest.start.as_dvec3(),
            start: pose.start.as_dvec3(),
            longer,
            half_twist: if axis == DVec3::ZERO { [0.0; 2] } else { half_twist },
            frame: Affine3A::from_rotation_translation(unit, pose.start),
        })
    }

    /// Neither stretched nor twisted.
    pub fn is_plain(&self) -> bool {
        self.half_twist.iter().all(|t| *t == 0.0) && self.longer == DVec3::ZERO
    }
}

fn widen(frame: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: frame.matrix3.as_dmat3(), translation: frame.translation.as_dvec3() }
}

fn invert(frame: &Affine3A) -> Option<DAffine3> {
    let inverse = widen(frame).inverse();
    (frame.is_finite() && inverse.is_finite()).then_some(inverse)
}

/// A rest normal, normalised; zero stays zero.
pub fn unit_normal(n: [f32; 3]) -> [f32; 3] {
    let wide = DVec3::new(n[0].into(), n[1].into(), n[2].into());
    wide.normalize_or_zero().as_vec3().to_array()
}
