//! Meshes of a file gathered one after the other, in the rest pose, and welded into one.

use armature_geometry::{Influences, TriangleMesh};
use armature_rig::Skeleton;
use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::contents::{Model, ModelRig, Split};
use super::parts::{MeshPart, MorphTarget};
use super::seams::{position_key, weld};
use crate::text::counted;

/// Influences kept per vertex if a file has more.
const MAX_INFLUENCES: usize = 16;
/// Most vertices of all meshes together.
const MAX_VERTICES: usize = 1 << 24;

/// What has been gathered so far: drawn vertices and triangles over them.
#[derive(Debug, Default)]
pub(crate) struct Collected {
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    textures: Vec<[f32; 2]>,
    colors: Vec<[f32; 4]>,
    /// Bones and weights, as many as each vertex has.
    influences: Vec<Vec<(u16, f32)>>,
    /// Whether they are made up, because the file has none.
    unbound: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<MeshPart>,
    morph_targets: Vec<MorphTarget>,
    /// Parts whose normals the file does not give.
    without_normals: Vec<usize>,
    has_textures: bool,
    has_colors: bool,
    /// Texture coordinates that are not finite.
    bad_textures: usize,
    /// Of the vertices of the part that is being added, without their translations.
    frames: Vec<DMat3>,
    has_normals: bool,
}

/// What a vertex follows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Following {
    /// Bones and weights.
    pub(crate) influences: Vec<(u16, f32)>,
    /// Whether they are made up, because the file does not say.
    pub(crate) unbound: bool,
}

impl Following {
    /// A vertex that the file binds to these bones.
    pub(crate) fn bound(influences: Vec<(u16, f32)>) -> Self {
        Self { influences, unbound: false }
    }

    /// A vertex of which the file says nothing, on a bone that is likely to carry it.
    pub(crate) fn made_up(bone: u16) -> Self {
        Self { influences: vec![(bone, 1.0)], unbound: true }
    }
}

/// A drawn vertex as the file has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileVertex {
    pub(crate) position: DVec3,
    pub(crate) normal: Option<[f32; 3]>,
    pub(crate) texture: Option<[f32; 2]>,
    pub(crate) color: Option<[f32; 4]>,
}

/// A morph target as the file has it: offsets of the part's vertices, none or one for each.
#[derive(Debug)]
pub(crate) struct FileTarget {
    pub(crate) name: String,
    pub(crate) default_weight: f32,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
}

impl Collected {
    /// Adds a vertex to the part that [`end_part`](Self::end_part) closes; the frame takes it to the rest pose.
    pub(crate) fn add_vertex(
        &mut self,
        frame: &DAffine3,
        vertex: &FileVertex,
        following: Following,
    ) -> Result<(), &'static str> {
        let position = frame.transform_point3(vertex.position);
        if !position.is_finite() {
            return Err("a vertex is moved to a position that is not finite");
        }
        if self.positions.len() >= MAX_VERTICES {
            return Err("all meshes together have more than 16 million vertices");
        }
        self.positions.push(position.to_array());
        self.has_normals |= vertex.normal.is_some();
        let normal = vertex.normal.unwrap_or_default();
        let turned = frame.matrix3.inverse().transpose() * DVec3::from(normal.map(f64::from));
        self.normals.push(turned.try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array());
        self.has_textures |= vertex.texture.is_some();
        let texture = vertex.texture.unwrap_or_default();
        let is_number = texture.iter().all(|c| c.is_finite());
        self.bad_textures += usize::from(!is_number);
        self.textures.push(if is_number { texture } else { [0.0; 2] });
        self.has_colors |= vertex.color.is_some();
        self.colors.push(vertex.color.unwrap_or([1.0; 4]));
        self.influences.push(following.influences);
        self.unbound.push(following.unbound);
        self.frames.push(frame.matrix3);
        Ok(())
    }

    /// Makes a part of the vertices added since the last one. Triangles count from the first of them.
    pub(crate) fn end_part(
        &mut self,
        name: &str,
        material: Option<u32>,
        triangles: &[[u32; 3]],
        targets: Vec<FileTarget>,
    ) -> Result<(), &'static str> {
        let frames = std::mem::take(&mut self.frames);
        let first = self.parts.last().map_or(0, |part| part.vertices.end);
        let first_triangle = self.triangles.len() as u32;
        // What a mirror shows runs the other way.
        let mirrored = 2 * frames.iter().filter(|frame| frame.determinant() < 0.0).count() > frames.len();
        let turn = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        self.triangles.extend(triangles.iter().map(|t| turn(t.map(|corner| first + corner))));
        if !std::mem::take(&mut self.has_normals) {
            self.without_normals.push(self.parts.len());
        }
        for target in targets {
            let moved = moved_target(target, &frames, self.parts.len() as u32);
            self.morph_targets.push(moved.ok_or("an offset of a morph target is too large")?);
        }
        self.parts.push(MeshPart {
            name: name.to_owned(),
            vertices: first..self.positions.len() as u32,
            triangles: first_triangle..self.triangles.len() as u32,
            material,
            skin: None,
        });
        Ok(())
    }

    /// Welds the drawn vertices into the model's mesh. `skeleton`: what the influences are of, if there is one.
    pub(crate) fn finish(mut self, skeleton: Option<&Skeleton>, model: &mut Model) -> Result<(), String> {
        let key = |vertex: usize| {
            let row: Vec<(u16, u32)> = self.influences[vertex].iter().map(|(bone, w)| (*bone, w.to_bits())).collect();
            (position_key(self.positions[vertex]), row, self.unbound[vertex])
        };
        let (firsts, groups) = weld((0..self.positions.len()).map(key));
        let has_normals = self.without_normals.len() < self.parts.len();
        let in_parts = self.parts.len() > 1 || !self.morph_targets.is_empty();
        if firsts.len() < self.positions.len() && (has_normals || self.has_textures || self.has_colors || in_parts) {
            model.split = Some(Split { mesh_vertex: groups.clone(), triangles: self.triangles.clone() });
        }
        model.mesh = TriangleMesh {
            vertices: firsts.iter().map(|&first| self.positions[first as usize]).collect(),
            triangles: self.triangles.iter().map(|t| t.map(|v| groups[v as usize])).collect(),
        };
        if has_normals {
            self.make_missing_normals();
        }
        if self.bad_textures > 0 {
            let vertices = counted(self.bad_textures, ["vertex has", "vertices have"]);
            model.warnings.push(format!("{vertices} a texture coordinate that is not finite: taken as 0."));
        }
        model.normals = has_normals.then_some(self.normals);
        model.texture_coordinates = self.has_textures.then_some(self.textures);
        model.vertex_colors = self.has_colors.then_some(self.colors);
        if let Some(skeleton) = skeleton {
            let rows: Vec<&[(u16, f32)]> = firsts.iter().map(|&f| self.influences[f as usize].as_slice()).collect();
            let influences = influences(&rows, skeleton.len(), &mut model.warnings).map_err(|e| e.to_string())?;
            let numbered = (0..).zip(&firsts).filter(|(_, first)| self.unbound[**first as usize]);
            let unbound = numbered.map(|(vertex, _)| vertex).collect();
            model.rig = Some(ModelRig { skeleton: skeleton.clone(), influences, skins: Vec::new(), unbound });
        }
        if in_parts {
            (model.parts, model.morph_targets) = (self.parts, self.morph_targets);
        }
        Ok(())
    }

    /// Normals of the parts that came without: the mean of the triangles around, larger ones more.
    fn make_missing_normals(&mut self) {
        for &part in &self.without_normals {
            let part = &self.parts[part];
            let first = part.vertices.start as usize;
            let mut sums = vec![DVec3::ZERO; part.vertices.len()];
            for triangle in &self.triangles[part.triangles.start as usize..part.triangles.end as usize] {
                let [a, b, c] = triangle.map(|corner| DVec3::from(self.positions[corner as usize]));
                let area = (b - a).cross(c - a);
                triangle.iter().for_each(|&corner| sums[corner as usize - first] += area);
            }
            for (normal, sum) in self.normals[first..].iter_mut().zip(sums) {
                *normal = sum.try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array();
            }
        }
    }
}

/// A morph target in the rest pose; `None` if an offset becomes infinite.
fn moved_target(target: FileTarget, frames: &[DMat3], part: u32) -> Option<MorphTarget> {
    let none = [0.0; 3];
    let positions = (0..frames.len()).map(|k| {
        let offset = Vec3::from(target.positions.get(k).copied().unwrap_or(none)).as_dvec3();
        (frames[k] * offset).as_vec3().to_array()
    });
    let positions: Vec<[f32; 3]> = positions.collect();
    let turned = |(offset, frame): (&[f32; 3], &DMat3)| {
        let cofactor = frame.inverse().transpose();
        // Scaled as much as the normals were when they became unit vectors.
        let turned = cofactor * Vec3::from(*offset).as_dvec3() / cofactor.determinant().abs().cbrt();
        if turned.is_finite() { turned.as_vec3().to_array() } else { none }
    };
    let normals = target.normals.iter().zip(frames).map(turned).collect();
    let finite = positions.iter().flatten().all(|c| c.is_finite());
    let FileTarget { name, default_weight, .. } = target;
    finite.then_some(MorphTarget { name, part, default_weight, positions, normals })
}

/// Turns rows of differing length into a table, at most [`MAX_INFLUENCES`] wide, keeping the largest.
fn influences(
    rows: &[&[(u16, f32)]],
    bone_count: usize,
    warnings: &mut Vec<String>,
) -> Result<Influences, armature_geometry::InfluencesError> {
    let most = rows.iter().map(|r| r.len()).max().unwrap_or(1);
    let per_vertex = most.clamp(1, MAX_INFLUENCES);
    if most > per_vertex {
        let rich = rows.iter().filter(|row| row.len() > per_vertex).count();
        let vertices = counted(rich, ["vertex follows", "vertices follow"]);
        warnings.push(format!("{vertices} more than {per_vertex} bones, up to {most}: the strongest are kept."));
    }
    let mut bones = Vec::with_capacity(rows.len() * per_vertex);
    let mut weights = Vec::with_capacity(rows.len() * per_vertex);
    for row in rows {
        let mut sorted = row.to_vec();
        sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
        sorted.resize(per_vertex, (0, 0.0));
        bones.extend(sorted.iter().map(|(bone, _)| *bone));
        weights.extend(sorted.iter().map(|(_, weight)| *weight));
    }
    Influences::new(per_vertex, bones, weights, bone_count)
}
