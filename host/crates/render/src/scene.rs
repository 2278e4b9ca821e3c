//! What is drawn, borrowed.

use std::ops::Range;

use glam::Vec3;

use crate::material::MaterialUniforms;
use crate::{Alpha, Bounds, Camera, Material, RenderError};

/// A character, its bones, and where it stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scene<'a> {
    /// The skin; `MeshView::default()` for none.
    pub mesh: MeshView<'a>,
    /// Bones to draw over it, through the skin.
    pub bones: &'a [BoneMark],
    /// The floor.
    pub ground: Ground,
    /// Colours and lights.
    pub look: Look,
}

/// A triangle mesh in its current pose.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshView<'a> {
    /// n positions, world space.
    pub positions: &'a [[f32; 3]],
    /// n unit normals.
    pub normals: &'a [[f32; 3]],
    /// m zero-based vertex triples.
    pub triangles: &'a [[u32; 3]],
    /// n texture coordinates, origin at the upper left; without them maps are not drawn.
    pub uv: Option<&'a [[f32; 2]]>,
    /// Which triangles are drawn with which material; empty: all of them with the first. Where parts overlap, the first
    /// one counts; triangles in no part are not drawn.
    pub parts: &'a [MeshPart],
    /// The materials of the parts; empty: one without colour or texture.
    pub materials: &'a [Material],
    /// n times red, green, blue (linear light) and opacity, 0 to 1; they multiply the base colour and its map.
    pub colors: Option<&'a [[f32; 4]]>,
    /// n values 0 to 1: how much of [`Look::highlight`] a vertex shows.
    pub highlight: Option<&'a [f32]>,
    /// Must change whenever triangles, parts, colours, texture coordinates or textures change: a [`crate::Renderer`]
    /// sends those to the GPU only then. Positions, normals and highlight are sent every frame.
    pub revision: u64,
}

/// Triangles drawn with one material.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshPart {
    /// Which of the mesh's triangles.
    pub triangles: Range<u32>,
    /// Zero-based material.
    pub material: u32,
}

/// One bone of the overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneMark {
    /// World space.
    pub head: [f32; 3],
    /// World space.
    pub tail: [f32; 3],
    /// sRGB and opacity, 0 to 1.
    pub color: [f32; 4],
}

/// The floor under the character.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// World height of the floor.
    pub height: f32,
    /// Where the pool of light is (y is ignored).
    pub center: Vec3,
    /// Size of the character (half the diagonal of its rest box), world units; grid and fading scale with it.
    pub radius: f32,
}

impl Default for Ground {
    fn default() -> Self {
        Self { height: 0.0, center: Vec3::ZERO, radius: 1.0 }
    }
}

impl Ground {
    /// A floor under something with these bounds.
    pub fn under(bounds: &Bounds) -> Self {
        Self { height: bounds.min.y, center: bounds.center(), radius: bounds.radius() }
    }
}

/// Colours, sRGB 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Backdrop at the top.
    pub backdrop_top: [f32; 3],
    /// Backdrop where it meets the floor.
    pub backdrop_horizon: [f32; 3],
    /// Floor in the pool of light.
    pub floor: [f32; 3],
    /// Lines of the grid.
    pub grid: [f32; 3],
    /// How dark the contact shadow is, 0 to 1.
    pub shadow: f32,
    /// Skin without its own colour.
    pub clay: [f32; 3],
    /// Tint of selected parts.
    pub highlight: [f32; 3],
}

impl Default for Look {
    fn default() -> Self {
        Self {
            backdrop_top: [0.085, 0.095, 0.115],
            backdrop_horizon: [0.185, 0.200, 0.230],
            floor: [0.245, 0.262, 0.295],
            grid: [0.42, 0.45, 0.50],
            shadow: 0.95,
            clay: [0.80, 0.755, 0.71],
            highlight: [0.32, 0.66, 0.98],
        }
    }
}

/// How edges are smoothed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Samples {
    /// Not smoothed.
    One,
    /// Four samples per pixel.
    #[default]
    Four,
}

impl Samples {
    /// Samples per pixel.
    pub fn count(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 4,
        }
    }
}

impl Scene<'_> {
    /// Checks lengths, indices and the texture; positions may be anything (those that are not finite are not drawn).
    pub fn validate(&self, texture_limit: u32) -> Result<(), RenderError> {
        self.mesh.validate_lengths()?;
        self.mesh.validate_topology(texture_limit)
    }
}

impl MeshView<'_> {
    /// What may change every frame.
    pub(crate) fn validate_lengths(&self) -> Result<(), RenderError> {
        let vertices = self.positions.len();
        let lengths = [
            ("normals", Some(self.normals.len())),
            ("texture coordinates", self.uv.map(<[_]>::len)),
            ("colours", self.colors.map(<[_]>::len)),
            ("highlight values", self.highlight.map(<[_]>::len)),
        ];
        match lengths.into_iter().find_map(|(what, got)| got.filter(|&got| got != vertices).map(|got| (what, got))) {
            Some((what, got)) => Err(RenderError::LengthMismatch { what, got, vertices }),
            None => Ok(()),
        }
    }

    /// What changes only with the revision.
    pub(crate) fn validate_topology(&self, texture_limit: u32) -> Result<(), RenderError> {
        let vertices = self.positions.len();
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(RenderError::IndexOutOfRange { triangle, vertex, vertices });
            }
        }
        let materials = self.materials.len().max(1);
        for (part, MeshPart { triangles, material }) in self.parts.iter().enumerate() {
            let within = triangles.start <= triangles.end && triangles.end as usize <= self.triangles.len();
            if !within || *material as usize >= materials {
                return Err(RenderError::PartOutOfRange { part, triangles: self.triangles.len(), materials });
            }
        }
        self.materials.iter().try_for_each(|material| material.validate(texture_limit))
    }

    /// The material of each triangle, or [`NO_MATERIAL`]. Where parts overlap, the first one counts.
    pub(crate) fn material_of_triangles(&self) -> Vec<u32> {
        if self.parts.is_empty() {
            return vec![0; self.triangles.len()];
        }
        let mut material_of = vec![NO_MATERIAL; self.triangles.len()];
        for MeshPart { triangles, material } in self.parts {
            let own = &mut material_of[triangles.start as usize..triangles.end as usize];
            own.iter_mut().filter(|number| **number == NO_MATERIAL).for_each(|number| *number = *material);
        }
        material_of
    }

    /// The materials that parts refer to: at least one.
    pub(crate) fn drawn_materials(&self) -> &[Material] {
        const PLAIN: &[Material] = &[Material::CLAY];
        if self.materials.is_empty() { PLAIN } else { self.materials }
    }

    /// Whether triangles with this material are blended over what lies behind.
    pub(crate) fn is_blended(&self, material: u32) -> bool {
        self.drawn_materials().get(material as usize).is_some_and(|material| material.alpha == Alpha::Blend)
    }

    /// What shaders read of each material.
    pub(crate) fn material_uniforms(&self, look: &Look) -> impl Iterator<Item = MaterialUniforms> {
        let (clay, has_maps) = (look.clay, self.uv.is_some());
        self.drawn_materials().iter().map(move |material| MaterialUniforms::new(material, clay, has_maps))
    }

    /// Sorts triangles, given with their distances, for blending: the farthest first.
    pub(crate) fn sort_farthest_first(&self, camera: &Camera, triangles: &mut [(f32, u32)]) {
        let (eye, (_, _, forward)) = (camera.eye(), camera.basis());
        for (distance, triangle) in &mut *triangles {
            let corners = self.triangles[*triangle as usize].map(|corner| Vec3::from(self.positions[corner as usize]));
            *distance = ((corners[0] + corners[1] + corners[2]) / 3.0 - eye).dot(forward);
        }
        triangles.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    }
}

/// A triangle that belongs to no part, and is not drawn.
pub(crate) const NO_MATERIAL: u32 = u32::MAX;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Map, Picture};

    #[test]
    fn nonsense_is_named() {
        fn check(mesh: MeshView<'_>) -> Result<(), RenderError> {
            Scene { mesh, ..Scene::default() }.validate(64)
        }
        let positions = [[0.0; 3]; 3];
        let mesh =
            MeshView { positions: &positions, normals: &positions, triangles: &[[0, 1, 3]], ..MeshView::default() };
        assert!(matches!(check(mesh), Err(RenderError::IndexOutOfRange { vertex: 3, .. })));
        let mesh = MeshView { triangles: &[[0, 1, 2]], ..mesh };
        assert!(check(mesh).is_ok());
        let short = MeshView { normals: &positions[..2], ..mesh };
        assert!(matches!(check(short), Err(RenderError::LengthMismatch { got: 2, .. })));
        let huge = Picture { width: u32::MAX, height: u32::MAX, rgba: Vec::new() };
        let huge = Some(Map::repeating(Arc::new(huge)));
        let materials = [Material::default(), Material { normal_map: huge, ..Material::default() }];
        let painted = MeshView { materials: &materials, ..mesh };
        assert!(matches!(check(painted), Err(RenderError::BadTexture { .. })));
        let part = |triangles, material| [MeshPart { triangles, material }];
        for wrong in [part(0..2, 0), part(0..1, 1), part(0..u32::MAX, 0)] {
            let divided = MeshView { parts: &wrong, ..mesh };
            assert!(matches!(check(divided), Err(RenderError::PartOutOfRange { part: 0, .. })));
        }
        assert!(check(MeshView { parts: &part(0..1, 0), ..mesh }).is_ok());
    }
}
