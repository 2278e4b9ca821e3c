//! A character's skin: blended towards its shapes, then posed.

use armature_deform::skin::{LinearBlendSkin, Morphs};
use glam::Affine3A;

use crate::characters::LoadedCharacter;
use crate::characters::shapes::{ShapeWeight, set_shapes};
use crate::failure::Failure;

/// The skin of a character and its latest pose; empty without a mesh.
#[derive(Debug)]
pub(super) struct ShapedSkin {
    skin: Option<LinearBlendSkin>,
    morphs: Option<Morphs>,
    /// Of the morph targets.
    weights: Vec<f32>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl ShapedSkin {
    /// The skin at rest.
    pub(super) fn new(character: &LoadedCharacter) -> Result<Self, Failure> {
        let (skin, morphs) = (character.precompute_skin()?, character.precompute_morphs()?);
        let (positions, normals) =
            character.shape.as_ref().map(|s| (s.positions.clone(), s.normals().to_vec())).unwrap_or_default();
        let weights = morphs.as_ref().map(|morphs| morphs.weights().to_vec()).unwrap_or_default();
        Ok(Self { skin, morphs, weights, positions, normals })
    }

    /// Blends it towards a shape of the character from the next pose on.
    pub(super) fn set_shape(&mut self, character: &LoadedCharacter, shape: &ShapeWeight) -> Result<(), Failure> {
        set_shapes(character, &mut self.weights, std::slice::from_ref(shape))?;
        let (Some(morphs), Some(skin)) = (&mut self.morphs, &mut self.skin) else { return Ok(()) };
        let blended = morphs.solve(&self.weights).and_then(|_| skin.set_rest(morphs));
        blended.map_err(|e| Failure::input(e.to_string(), "choose a weight between 0 and 1"))
    }

    /// Poses it.
    pub(super) fn pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), Failure> {
        let Some(skin) = &mut self.skin else { return Ok(()) };
        skin.solve(model_from_bone, &mut self.positions, &mut self.normals)
            .map_err(|e| Failure::not_converged(e.to_string(), "zero the puppet again"))
    }

    /// Positions and unit normals of the latest pose.
    pub(super) fn posed(&self) -> (&[[f32; 3]], &[[f32; 3]]) {
        (&self.positions, &self.normals)
    }
}
