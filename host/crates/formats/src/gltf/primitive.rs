//! Vertex and index data of one mesh primitive.

use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked;

use super::accessor::MAX_ELEMENTS;
use super::container::Document;
use crate::FormatError;

/// Vertices as a primitive has them.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) textures: Option<Vec<[f32; 2]>>,
    /// Skin joints and their weights, as many a vertex as there are sets.
    pub(super) joints: Vec<Vec<([u32; 4], [f32; 4])>>,
}

impl Document<'_> {
    /// Vertices with the texture coordinates of the given set. Attributes of another length than the positions are
    /// an error.
    pub(super) fn vertices(&self, primitive: &Primitive, texture_set: u32) -> Result<Vertices, FormatError> {
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let position = find(Semantic::Positions).ok_or_else(|| self.error("a primitive has no positions"))?;
        let count = self.count(position)?;
        if count > MAX_ELEMENTS {
            let what = format!("a primitive has {count} vertices");
            return Err(FormatError::whole(self.file, what, "Simplify the mesh to fewer than 16 million"));
        }
        let check = |len: usize, what: &str| {
            if len == count {
                return Ok(());
            }
            Err(self.error(format!("a primitive has {count} positions and {len} {what}")))
        };
        let mut out = Vertices { positions: self.floats(position)?, ..Vertices::default() };
        if let Some(index) = find(Semantic::Normals) {
            let normals = self.floats(index)?;
            check(normals.len(), "normals")?;
            out.normals = Some(normals);
        }
        if let Some(index) = find(Semantic::TexCoords(texture_set)) {
            let textures = self.floats(index)?;
            check(textures.len(), "texture coordinates")?;
            out.textures = Some(textures);
        }
        let sets = (0..).map_while(|set| find(Semantic::Joints(set)).zip(find(Semantic::Weights(set))));
        for (joints, weights) in sets {
            let (joints, weights) = (self.integers::<4>(joints)?, self.floats::<4>(weights)?);
            check(joints.len(), "skin joints")?;
            check(weights.len(), "skin weights")?;
            out.joints.push(joints.into_iter().zip(weights).collect());
        }
        Ok(out)
    }

    /// Triangles over the primitive's vertices; `None` for points and lines.
    pub(super) fn triangles(&self, primitive: &Primitive, count: usize) -> Result<Option<Vec<[u32; 3]>>, FormatError> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(self.error("a primitive has no valid mode"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(None);
        }
        let corners: Vec<u32> = match primitive.indices {
            Some(index) => self.integers::<1>(index)?.into_iter().map(|[i]| i).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(self.error(format!("a triangle names vertex {bad}, but there are only {count}")));
        }
        Ok(Some(match mode {
            Mode::TriangleStrip => {
                // Every second triangle of a strip runs the other way.
                let turn = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
                corners.windows(3).enumerate().map(turn).filter(is_whole).collect()
            }
            Mode::TriangleFan => {
                let tip = corners.first().copied().unwrap_or_default();
                corners.get(1..).unwrap_or_default().windows(2).map(|w| [tip, w[0], w[1]]).filter(is_whole).collect()
            }
            _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        }))
    }
}

/// Strips and fans are glued together with triangles that repeat a corner.
fn is_whole(t: &[u32; 3]) -> bool {
    t[0] != t[1] && t[1] != t[2] && t[2] != t[0]
}
