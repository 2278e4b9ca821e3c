//! What the viewport draws of the state: the scene, its bones, what is selected.

use armature_render::{BoneMark, Bounds, Ground, MeshView, Scene};
use armature_rig::SensorState;
use glam::{Vec2, Vec3};

use crate::app::state::State;
use crate::characters::{LoadedCharacter, Shape};

/// What is kept for a character and a selection, so that an ordinary frame computes little.
#[derive(Debug)]
pub(super) struct Stage {
    /// The character this was made for.
    pub(super) character_number: u64,
    /// Its rest box.
    pub(super) bounds: Bounds,
    ground: Ground,
    rest_bones: Vec<([f32; 3], [f32; 3])>,
    highlight: Vec<f32>,
    highlighted: Option<usize>,
    marks: Vec<BoneMark>,
}

impl Default for Stage {
    fn default() -> Self {
        let bounds = Bounds { min: Vec3::new(-0.5, 0.0, -0.3), max: Vec3::new(0.5, 1.7, 0.3) };
        Self {
            character_number: 0,
            bounds,
            ground: Ground::under(&bounds),
            rest_bones: Vec::new(),
            highlight: Vec::new(),
            highlighted: None,
            marks: Vec::new(),
        }
    }
}

impl Stage {
    /// Follows the state. Returns whether there is another character than before.
    pub(super) fn follow(&mut self, state: &State) -> bool {
        let changed = self.character_number != state.character_number;
        if let Some(character) = state.character.as_deref().filter(|_| changed) {
            self.character_number = state.character_number;
            self.highlighted = None;
            self.rest_bones =
                character.skeleton.rest_segments().iter().map(|(a, b)| (a.to_array(), b.to_array())).collect();
            let joints: Vec<[f32; 3]> = self.rest_bones.iter().flat_map(|&(head, tail)| [head, tail]).collect();
            if let Some(bounds) =
                character.shape.as_ref().and_then(|shape| Bounds::of(&shape.positions)).or_else(|| Bounds::of(&joints))
            {
                self.bounds = bounds;
                self.ground = Ground::under(&bounds);
            }
        }
        let selected = state.selected.and_then(|part| state.bone(part));
        if selected != self.highlighted {
            self.highlighted = selected;
            self.highlight.clear();
            if let (Some(character), Some(bone)) = (&state.character, selected) {
                self.highlight = weights_of(character, bone);
            }
        }
        self.mark_bones(state, selected);
        changed
    }

    /// Everything to draw, borrowed.
    pub(super) fn scene<'a>(&'a self, state: &'a State) -> Scene<'a> {
        let mesh = state.character.as_deref().map(|character| self.mesh(state, character)).unwrap_or_default();
        Scene { mesh, bones: &self.marks, ground: self.ground, ..Scene::default() }
    }

    fn mesh<'a>(&'a self, state: &'a State, character: &'a LoadedCharacter) -> MeshView<'a> {
        let Some(shape) = &character.shape else { return MeshView::default() };
        let vertices = shape.positions.len();
        let posed = state.frame.as_deref().filter(|f| f.positions.len() == vertices && f.normals.len() == vertices);
        let (positions, normals) = match posed {
            Some(frame) => (frame.positions.as_slice(), frame.normals.as_slice()),
            None => (shape.positions.as_slice(), shape.normals()),
        };
        MeshView {
            positions,
            normals,
            triangles: shape.triangles(),
            uv: shape.texture_coordinates().filter(|uv| uv.len() == vertices),
            parts: &shape.parts,
            materials: &shape.materials,
            colors: shape.vertex_colors().filter(|colors| colors.len() == vertices),
            highlight: (self.highlight.len() == vertices && vertices > 0).then_some(self.highlight.as_slice()),
            revision: state.character_number,
        }
    }

    /// Head and tail of every bone now.
    fn bones<'a>(&'a self, state: &'a State) -> &'a [([f32; 3], [f32; 3])] {
        match &state.frame {
            Some(frame) if frame.bones.len() == self.rest_bones.len() => &frame.bones,
            _ => &self.rest_bones,
        }
    }

    fn mark_bones(&mut self, state: &State, selected: Option<usize>) {
        let mut marks = std::mem::take(&mut self.marks);
        marks.clear();
        for (bone, &(head, tail)) in self.bones(state).iter().enumerate() {
            let color = if selected == Some(bone) {
                [1.0, 0.80, 0.30, 0.95]
            } else if !state.show_bones {
                continue;
            } else {
                match state.bone_state(bone) {
                    Some(SensorState::Ok) => [0.42, 0.86, 0.68, 0.55],
                    Some(SensorState::MagnetWeak) => [0.96, 0.72, 0.29, 0.60],
                    Some(SensorState::Outlier) => [0.74, 0.51, 1.0, 0.60],
                    Some(SensorState::NoData) => [0.55, 0.58, 0.64, 0.45],
                    // Found from the shape: neither measured nor left as it was.
                    None if state.is_solved(bone) => [0.42, 0.68, 1.0, 0.50],
                    None => [0.62, 0.66, 0.74, 0.26],
                }
            };
            marks.push(BoneMark { head, tail, color });
        }
        self.marks = marks;
    }

    /// The bone nearest to a point of the picture, within `reach`; `project` gives where a world point is seen.
    pub(super) fn bone_at(
        &self,
        state: &State,
        pointer: Vec2,
        reach: f32,
        project: impl Fn(Vec3) -> Option<Vec2>,
    ) -> Option<usize> {
        let distance = |(head, tail): &([f32; 3], [f32; 3])| {
            let (a, b) = (project(Vec3::from(*head))?, project(Vec3::from(*tail))?);
            let along = b - a;
            let share = ((pointer - a).dot(along) / along.length_squared().max(1e-6)).clamp(0.0, 1.0);
            Some(pointer.distance(a + along * share))
        };
        let near = self.bones(state).iter().enumerate().filter_map(|(bone, ends)| Some((bone, distance(ends)?)));
        near.filter(|(_, d)| *d <= reach).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(bone, _)| bone)
    }
}

fn weights_of(character: &LoadedCharacter, bone: usize) -> Vec<f32> {
    let Some(influences) = character.shape.as_ref().map(Shape::influences) else { return Vec::new() };
    (0..influences.vertex_count())
        .map(|vertex| influences.of_vertex(vertex).filter(|(b, _)| usize::from(*b) == bone).map(|(_, w)| w).sum())
        .collect()
}
