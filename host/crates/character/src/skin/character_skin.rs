//! The skin of a character, of the kind that was chosen for it.

use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, Morphs, SkinError, StretchTwist, StretchTwistSkin,
};
use armature_weights::endpoints::projected_endpoint_weight;
use glam::{Affine3A, DQuat};

use super::twisting_bones::TwistingBones;
use crate::character::Character;
use crate::skin_kind::{EndpointMethod, Endpoints, SkinKind};

/// A skin prepared for posing every frame.
#[derive(Clone, Debug)]
pub struct CharacterSkin(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Linear(LinearBlendSkin),
    Dual(DualQuaternionSkin),
    StretchTwist(Box<Stretching>),
}

#[derive(Clone, Debug)]
struct Stretching {
    skin: StretchTwistSkin,
    bones: TwistingBones,
    /// For each binding its bone, and the rotation of that bone when the vertices were bound, inverted.
    bound: Vec<(usize, DQuat)>,
    posed: Vec<StretchTwist>,
}

impl CharacterSkin {
    /// Takes a character at rest. Without endpoint weights, bones that stretch and twist use
    /// [`projected_endpoints`].
    pub fn precompute(character: &Character) -> Result<Self, SkinError> {
        let blend = match character.skin {
            SkinKind::Linear => return character.linear_skin().map(|skin| Self(Kind::Linear(skin))),
            SkinKind::DualQuaternion => return dual(character).map(|skin| Self(Kind::Dual(skin))),
            SkinKind::StretchTwist => BoneBlend::Linear,
            SkinKind::StretchTwistDualQuaternion => BoneBlend::DualQuaternion,
        };
        Stretching::new(character, blend).map(|skin| Self(Kind::StretchTwist(Box::new(skin))))
    }

    /// Moves the rest shape to where morph targets have it. Allocates nothing.
    pub fn set_rest(&mut self, morphs: &Morphs) -> Result<(), SkinError> {
        match &mut self.0 {
            Kind::Linear(skin) => skin.set_rest(morphs),
            Kind::Dual(skin) => skin.set_rest(morphs),
            Kind::StretchTwist(stretching) => stretching.skin.set_rest(morphs),
        }
    }

    /// Writes the posed positions and unit normals, n×3 each, for one frame per bone. Allocates nothing, under the same
    /// terms as [`LinearBlendSkin::solve`].
    ///
    /// Dual quaternions and bones that stretch and twist do not scale: of a frame, they use the rotation and the place.
    pub fn solve(
        &mut self,
        model_from_bone: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        match &mut self.0 {
            Kind::Linear(skin) => skin.solve(model_from_bone, positions, normals),
            Kind::Dual(skin) => skin.solve(model_from_bone, positions, normals),
            Kind::StretchTwist(stretching) => {
                let Stretching { skin, bones, bound, posed } = &mut **stretching;
                let of_bones = bones.solve(model_from_bone)?;
                for (posed, (bone, bound_inverse)) in posed.iter_mut().zip(bound) {
                    *posed = of_bones[*bone].since(*bound_inverse);
                }
                skin.solve(posed, positions, normals)
            }
        }
    }
}

fn dual(character: &Character) -> Result<DualQuaternionSkin, SkinError> {
    let rest = character.skeleton.rest_model_from_bone();
    let bindings = character.bindings(&rest)?;
    let influences = character.influences_of_bindings(rest.len(), bindings.len())?;
    let normals = &character.surface.normals;
    DualQuaternionSkin::precompute_bound(&character.rest_positions(), normals, &influences, &bindings, rest.len())
}

impl Stretching {
    fn new(character: &Character, blend: BoneBlend) -> Result<Self, SkinError> {
        let rest = character.skeleton.rest_model_from_bone();
        let bindings = character.bindings(&rest)?;
        let influences = character.influences_of_bindings(rest.len(), bindings.len())?;
        let tail = |bone: usize| character.skeleton.bones()[bone].tail;
        let segment = |frame: &Affine3A, bone: usize| BoneSegment {
            start: frame.translation.into(),
            end: frame.transform_point3(tail(bone)),
        };
        let segments: Vec<BoneSegment> =
            bindings.iter().map(|b| segment(&b.rest_model_from_bone, b.bone as usize)).collect();
        let rotation = |frame: &Affine3A| frame.to_scale_rotation_translation().1.as_dquat();
        let bound = bindings.iter().map(|b| (b.bone as usize, rotation(&b.rest_model_from_bone).inverse())).collect();
        let computed;
        let ends = if let Some(endpoints) = &character.surface.endpoints {
            &endpoints.weights
        } else {
            computed = projected_endpoints(character)?.weights;
            &computed
        };
        let (positions, normals) = (character.rest_positions(), &character.surface.normals);
        let skin = StretchTwistSkin::precompute(&positions, normals, &influences, ends, &segments, blend)?;
        let still = |s: &BoneSegment| StretchTwist {
            start: s.start,
            turn: glam::Quat::IDENTITY,
            stretch: 1.0,
            twist: [0.0; 2],
        };
        let posed = segments.iter().map(still).collect();
        Ok(Self { skin, bones: TwistingBones::new(&character.skeleton), bound, posed })
    }
}

/// Endpoint weights by projection onto the bones (thesis eq. 6.8): for characters that were bound without any.
pub fn projected_endpoints(character: &Character) -> Result<Endpoints, SkinError> {
    let positions = character.positions_in_rest_pose()?;
    let influences = &character.surface.influences;
    let segments: Vec<armature_weights::BoneSegment> = character.rest_bone_segments();
    let mut weights = vec![0.5; influences.bones().len()];
    for (vertex, row) in weights.chunks_exact_mut(influences.per_vertex().max(1)).enumerate() {
        let at = positions[vertex].map(f64::from);
        for (slot, (bone, _)) in row.iter_mut().zip(influences.of_vertex(vertex)) {
            *slot = projected_endpoint_weight(&segments[usize::from(bone)], at) as f32;
        }
    }
    Ok(Endpoints { method: EndpointMethod::Projection, weights })
}
