//! A character's skin: blended towards its shapes, then posed.

use armature_character::skin::CharacterSkin;
use armature_deform::skin::Morphs;
use armature_rig::ShapeWeights;
use glam::Affine3A;

use crate::characters::LoadedCharacter;
use crate::failure::Failure;

/// The skin of a character and its latest pose; empty without a mesh.
#[derive(Debug)]
pub(super) struct ShapedSkin {
    skin: Option<CharacterSkin>,
    morphs: Option<Morphs>,
    /// Of the morph targets, as the file has them.
    rest_weights: Vec<f32>,
    /// Of the morph targets, as they are.
    weights: Vec<f32>,
    touched: Vec<bool>,
    /// The shapes it is blended to.
    shown: ShapeWeights,
    /// Names of shapes that came up, and the morph targets of each.
    known: Vec<(String, Vec<(usize, f32)>)>,
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
        let (rest_weights, touched) = (weights.clone(), vec![false; weights.len()]);
        let (shown, known) = (ShapeWeights::default(), Vec::new());
        Ok(Self { skin, morphs, rest_weights, weights, touched, shown, known, positions, normals })
    }

    /// Blends it towards shapes of the character from the next pose on: all that are set, the others stay as the file has
    /// them. Names that the character does not have change nothing. Does nothing while no weight changes.
    pub(super) fn blend(&mut self, character: &LoadedCharacter, shapes: &ShapeWeights) -> Result<(), Failure> {
        let (Some(morphs), Some(skin)) = (&mut self.morphs, &mut self.skin) else { return Ok(()) };
        if *shapes == self.shown {
            return Ok(());
        }
        self.shown.copy_from(shapes);
        for (name, _) in shapes.iter() {
            if !self.known.iter().any(|(known, _)| known == name) {
                let targets = character.character().map(|bound| bound.targets_of_shape(name)).unwrap_or_default();
                self.known.push((name.to_owned(), targets));
            }
        }
        let known = &self.known;
        let targets = |name: &str| known.iter().find(|(known, _)| known == name).map(|(_, targets)| targets.as_slice());
        self.weights.copy_from_slice(&self.rest_weights);
        let set = shapes.iter().filter_map(|(name, weight)| Some((targets(name)?, weight)));
        armature_formats::model::set_shapes(set, &mut self.weights, &mut self.touched);
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
