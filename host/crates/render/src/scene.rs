//! What is drawn, borrowed.

use glam::Vec3;

use crate::{Bounds, RenderError};

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

/// A triangle mesh as it is now.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshView<'a> {
    /// n positions, world space.
    pub positions: &'a [[f32; 3]],
    /// n unit normals.
    pub normals: &'a [[f32; 3]],
    /// m zero-based vertex triples.
    pub triangles: &'a [[u32; 3]],
    /// n texture coordinates, origin at the upper left; required for a texture.
    pub uv: Option<&'a [[f32; 2]]>,
    /// Base colour texture.
    pub texture: Option<TextureView<'a>>,
    /// sRGB, 0 to 1; multiplies the texture. `None`: [`Look::clay`] (white where there is a texture).
    pub base_color: Option<[f32; 3]>,
    /// n colours, sRGB 0 to 1, in linear light between vertices; they multiply texture and base colour.
    pub colors: Option<&'a [[f32; 3]]>,
    /// n values 0 to 1: how much of [`Look::highlight`] a vertex shows.
    pub highlight: Option<&'a [f32]>,
    /// Has to change whenever triangles, colours, texture coordinates or texture change: a [`crate::Renderer`] sends those to
    /// the GPU only then. Positions, normals and highlight are sent every frame.
    pub revision: u64,
}

/// An image in memory.
#[derive(Clone, Copy, Debug)]
pub struct TextureView<'a> {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 4·width·height bytes: sRGB and alpha, rows from the top.
    pub rgba: &'a [u8],
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
    /// Where the pool of light is (y is not used).
    pub center: Vec3,
    /// Size of the character (half the diagonal of its rest box), world units; grid and fading follow it.
    pub radius: f32,
}

impl Default for Ground {
    fn default() -> Self {
        Self { height: 0.0, center: Vec3::ZERO, radius: 1.0 }
    }
}

impl Ground {
    /// A floor on which something with these bounds stands.
    pub fn under(bounds: &Bounds) -> Self {
        Self { height: bounds.min.y, center: bounds.center(), radius: bounds.radius() }
    }
}

/// Colours, sRGB 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Backdrop high above.
    pub backdrop_top: [f32; 3],
    /// Backdrop where it meets the floor.
    pub backdrop_horizon: [f32; 3],
    /// Floor in the pool of light.
    pub floor: [f32; 3],
    /// Lines of the grid.
    pub grid: [f32; 3],
    /// How dark the contact shadow is, 0 to 1.
    pub shadow: f32,
    /// Skin without a colour of its own.
    pub clay: [f32; 3],
    /// Tint of what is selected.
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
    /// Not at all.
    One,
    /// Four samples a pixel.
    #[default]
    Four,
}

impl Samples {
    /// Samples a pixel.
    pub fn count(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 4,
        }
    }
}

impl Scene<'_> {
    /// Checks lengths, indices and the texture; positions may be anything (what is not finite is not drawn).
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
        let Some(texture) = &self.texture else { return Ok(()) };
        let expected = (u64::from(texture.width) * u64::from(texture.height)).saturating_mul(4);
        let fits = texture.width.max(texture.height) <= texture_limit;
        if expected == 0 || expected != texture.rgba.len() as u64 || !fits {
            return Err(RenderError::BadTexture {
                width: texture.width,
                height: texture.height,
                expected,
                got: texture.rgba.len(),
                limit: texture_limit,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_named() {
        let positions = [[0.0; 3]; 3];
        let mesh =
            MeshView { positions: &positions, normals: &positions, triangles: &[[0, 1, 3]], ..MeshView::default() };
        let check = |mesh| Scene { mesh, ..Scene::default() }.validate(64);
        assert!(matches!(check(mesh), Err(RenderError::IndexOutOfRange { vertex: 3, .. })));
        let mesh = MeshView { triangles: &[[0, 1, 2]], ..mesh };
        assert!(check(mesh).is_ok());
        let short = MeshView { normals: &positions[..2], ..mesh };
        assert!(matches!(check(short), Err(RenderError::LengthMismatch { got: 2, .. })));
        let huge = TextureView { width: u32::MAX, height: u32::MAX, rgba: &[] };
        assert!(matches!(check(MeshView { texture: Some(huge), ..mesh }), Err(RenderError::BadTexture { .. })));
    }
}
