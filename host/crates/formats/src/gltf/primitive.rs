//! Vertex and index data of one mesh primitive.

use gltf_json::Index;
use gltf_json::accessor::{Accessor, Type};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked;

use super::accessor::MAX_ELEMENTS;
use super::container::Document;
use crate::FormatError;

/// Four joints and weights for every vertex.
pub(super) type InfluenceSet = Vec<([u32; 4], [f32; 4])>;

/// A primitive's own vertices.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) textures: Option<Vec<[f32; 2]>>,
    /// Linear red, green, blue and opacity.
    pub(super) colors: Option<Vec<[f32; 4]>>,
    /// What weight 1 of each morph target adds.
    pub(super) targets: Vec<Target>,
    /// Skin joints and their weights, one entry per vertex for each set.
    pub(super) joints: Vec<InfluenceSet>,
}

/// Offsets of a morph target, one per vertex; empty where the file gives none.
#[derive(Debug, Default)]
pub(super) struct Target {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
}

impl Document<'_> {
    /// Vertices with the texture coordinates of the given set, moved by the morph targets' weights. Attributes of a
    /// different length than the positions are an error. Normals and texture coordinates may be infinite or NaN.
    pub(super) fn vertices(
        &self,
        primitive: &Primitive,
        texture_set: u32,
        morph_weights: &[f32],
    ) -> Result<Vertices, FormatError> {
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
            Err(self.error(format!("a primitive has {count} positions but {len} {what}")))
        };
        let accessor = self.get(&self.root.accessors, position, "accessor")?;
        if accessor.buffer_view.is_none() && accessor.sparse.is_none() && count > 0 {
            let what = "the positions of a primitive have no data; an unknown extension may hold them";
            return Err(FormatError::whole(self.file, what, "Export it without compression and special extensions"));
        }
        let mut out = Vertices { positions: self.floats(position)?, ..Vertices::default() };
        if let Some(index) = find(Semantic::Normals) {
            let normals = self.any_floats(index)?;
            check(normals.len(), "normals")?;
            out.normals = Some(normals);
        }
        if let Some(index) = find(Semantic::TexCoords(texture_set)) {
            let textures = self.any_floats(index)?;
            check(textures.len(), "texture coordinates")?;
            out.textures = Some(textures);
        }
        if let Some(index) = find(Semantic::Colors(0)) {
            let colors = self.colors(index)?;
            check(colors.len(), "colours")?;
            out.colors = Some(colors);
        }
        self.morph(primitive, morph_weights, &mut out)?;
        out.joints = self.influence_sets(primitive)?;
        for set in &out.joints {
            check(set.len(), "skin joints")?;
        }
        Ok(out)
    }

    /// Skin joints and their weights, one entry per vertex for each set.
    pub(super) fn influence_sets(&self, primitive: &Primitive) -> Result<Vec<InfluenceSet>, FormatError> {
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let sets = (0..).map_while(|set| find(Semantic::Joints(set)).zip(find(Semantic::Weights(set))));
        sets.map(|(joints, weights)| {
            let (joints, weights) = (self.integers::<4>(joints)?, self.floats::<4>(weights)?);
            if joints.len() != weights.len() {
                let what = format!("a primitive has {} skin joints and {} skin weights", joints.len(), weights.len());
                return Err(self.error(what));
            }
            Ok(joints.into_iter().zip(weights).collect())
        })
        .collect()
    }

    /// Opaque where there is no fourth number; white where one is not finite.
    fn colors(&self, index: Index<Accessor>) -> Result<Vec<[f32; 4]>, FormatError> {
        let accessor = self.get(&self.root.accessors, index, "accessor")?;
        let colors = if accessor.type_ == Checked::Valid(Type::Vec3) {
            let opaque = |[red, green, blue]: [f32; 3]| [red, green, blue, 1.0];
            self.any_floats::<3>(index)?.into_iter().map(opaque).collect()
        } else {
            self.any_floats::<4>(index)?
        };
        let usable = |color: [f32; 4]| if color.iter().all(|c| c.is_finite()) { color } else { [1.0; 4] };
        Ok(colors.into_iter().map(|color| usable(color).map(|c| c.clamp(0.0, 1.0))).collect())
    }

    /// Reads the morph targets, and adds them to positions and normals by their weights.
    fn morph(&self, primitive: &Primitive, weights: &[f32], out: &mut Vertices) -> Result<(), FormatError> {
        let count = out.positions.len();
        let offsets = |index: Option<Index<Accessor>>| {
            let Some(index) = index else { return Ok(Vec::new()) };
            let offsets = self.floats::<3>(index)?;
            if offsets.len() != count {
                let what = format!("a primitive has {count} vertices and {} morph offsets", offsets.len());
                return Err(self.error(what));
            }
            Ok(offsets)
        };
        let add = |values: &mut [[f32; 3]], offsets: &[[f32; 3]], weight: f32| {
            for (value, offset) in values.iter_mut().zip(offsets) {
                *value = std::array::from_fn(|k| value[k] + weight * offset[k]);
            }
        };
        for (index, target) in primitive.targets.as_deref().unwrap_or_default().iter().enumerate() {
            let target = Target { positions: offsets(target.positions)?, normals: offsets(target.normals)? };
            let weight = weights.get(index).copied().unwrap_or_default();
            if weight != 0.0 {
                add(&mut out.positions, &target.positions, weight);
                add(out.normals.as_deref_mut().unwrap_or_default(), &target.normals, weight);
            }
            out.targets.push(target);
        }
        Ok(())
    }

    /// Triangles over the primitive's vertices; `None` for points and lines.
    pub(super) fn triangles(&self, primitive: &Primitive, count: usize) -> Result<Option<Vec<[u32; 3]>>, FormatError> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(self.error("a primitive has an invalid mode"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(None);
        }
        let corners: Vec<u32> = match primitive.indices {
            Some(index) => self.integers::<1>(index)?.into_iter().map(|[i]| i).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(self.error(format!("a triangle refers to vertex {bad}, but there are only {count}")));
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

/// Strips and fans are joined with triangles that repeat a corner.
fn is_whole(t: &[u32; 3]) -> bool {
    t[0] != t[1] && t[1] != t[2] && t[2] != t[0]
}
