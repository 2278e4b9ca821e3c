//! Meshes that follow a skeleton.

use std::sync::Arc;

use armature_deform::skin::bones::{BoneBinding, unit_normal};
use armature_deform::skin::{LinearBlendSkin, MorphOffsets, Morphs, SkinError};
use armature_formats::gltf::GlbMesh;
use armature_formats::model::{
    Avatar, Expression, Material, MeshPart, MorphTarget, PartError, Skin, check_parts, targets_of_shape,
};
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::Skeleton;
use armature_weights::BoneSegment;
use glam::{Affine3A, Vec3};

use crate::handle_weights::{BiharmonicTier, DomainKind};
use crate::skin_kind::{Endpoints, SkinKind};

/// Everything needed to pose and draw a character.
#[derive(Clone, Debug, PartialEq)]
pub struct Character {
    /// Its name in lists and exports.
    pub name: String,
    /// Everything per vertex and per triangle; shared by everything that skins, draws or solves it.
    pub surface: Arc<Surface>,
    /// The materials of its parts; materials share images.
    pub materials: Vec<Material>,
    /// Bones in their rest pose, in model space.
    pub skeleton: Skeleton,
    /// Poses, other than the skeleton's rest pose, in which parts were bound.
    pub skins: Vec<Skin>,
    /// What a VRM avatar says of itself.
    pub avatar: Option<Avatar>,
    /// How the skin follows the bones.
    pub skin: SkinKind,
    /// How the weights were made.
    pub provenance: Provenance,
    /// What went wrong along the way, in sentences for the user.
    pub warnings: Vec<String>,
}

/// All meshes of a character, one after the other. All arrays belong to `mesh`'s vertices; a vertex is listed once for
/// each texture coordinate or normal it is drawn with.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Rest shape in model space: right-handed, +Y up, looking along +Z, in its own unit.
    pub mesh: TriangleMesh,
    /// Unit rest normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// One per vertex; (0, 0) is the image's upper left corner.
    pub texture_coordinates: Option<Vec<[f32; 2]>>,
    /// One per vertex: linear red, green, blue and opacity, which multiply the material's.
    pub vertex_colors: Option<Vec<[f32; 4]>>,
    /// One row per vertex.
    pub influences: Influences,
    /// How far along its bones each vertex is, for bones that stretch and twist.
    pub endpoints: Option<Endpoints>,
    /// The meshes, in order: at least one, and together the whole surface.
    pub parts: Vec<MeshPart>,
    /// Shapes that parts can be blended towards; the rest shape has them at their default weights.
    pub morph_targets: Vec<MorphTarget>,
}

impl Surface {
    /// The whole mesh as one part, drawn with the first material.
    pub fn one_part(mesh: &TriangleMesh) -> MeshPart {
        let (vertices, triangles) = (0..mesh.vertices.len() as u32, 0..mesh.triangles.len() as u32);
        MeshPart { vertices, triangles, material: Some(0), ..MeshPart::default() }
    }
}

/// How a character's weights were made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Provenance {
    /// Painted by an artist; they came with the model and were not touched.
    Artist,
    /// Computed for a model from a file.
    Computed(WeightsRecord),
    /// The program made the shape, and computed the weights.
    Generated(WeightsRecord),
}

/// How weights were computed, and how well it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WeightsRecord {
    /// By bone heat.
    BoneHeat(HeatRecord),
    /// As bounded biharmonic weights.
    Biharmonic(SolvedRecord),
    /// As monotone weights.
    Monotone(MonotoneRecord),
}

impl Provenance {
    /// How the weights were computed; `None` for an artist's.
    pub fn record(&self) -> Option<&WeightsRecord> {
        match self {
            Self::Artist => None,
            Self::Computed(record) | Self::Generated(record) => Some(record),
        }
    }
}

/// Bone heat's settings, and how well it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatRecord {
    /// How strongly bones heat compared with how fast heat spreads (`c` of Baran and Popović).
    pub heat: f64,
    /// The most influences a vertex may have.
    pub max_influences: usize,
    /// Largest relative residual of the linear systems.
    pub residual: f64,
    /// Largest fraction of a vertex's weight that was dropped to keep within `max_influences`.
    pub max_dropped: f64,
}

/// Monotone weights: smooth, and without extrema of their own before they were scaled to sum to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonotoneRecord {
    /// Order of smoothness, 2 to 4.
    pub order: u8,
    /// Extrema of their own that scaling made, on what they were computed on.
    pub spurious: usize,
    /// The rest is as for bounded biharmonic weights; the certificate is about functions that rise along the same edges.
    pub solved: SolvedRecord,
}

/// What bounded biharmonic or monotone weights were computed on, and the certificate of all of them together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolvedRecord {
    /// How accurate they had to be.
    pub tier: BiharmonicTier,
    /// What they were computed on.
    pub domain: DomainKind,
    /// Its number of vertices.
    pub domain_vertices: usize,
    /// The fraction of their length over which bones were released from it at shared joints.
    pub joint_release: f64,
    /// Its elements that were ignored because they are flat; `None` in files that do not say.
    pub flat_elements: Option<usize>,
    /// No weight, before normalising, is farther than this from the optimal one.
    pub error_bound: f64,
    /// The sum of the energies of all bones' weights; mesh unit to the power of the dimension minus four.
    pub energy: f64,
    /// Bones whose weights are not as accurate as they had to be.
    pub unconverged: usize,
    /// Largest distance of a vertex's sum of weights from one, before normalising.
    pub largest_deviation: f64,
    /// The most influences a vertex may have.
    pub max_influences: usize,
    /// Largest fraction of a vertex's weight that was dropped to keep within `max_influences`.
    pub max_dropped: f64,
    /// Mean of the same over all vertices.
    pub mean_dropped: f64,
}

impl Character {
    /// Rest positions for pose time, n×3.
    pub fn rest_positions(&self) -> Vec<[f32; 3]> {
        self.surface.mesh.vertices.iter().map(|p| p.map(|c| c as f32)).collect()
    }

    /// Where the skeleton's rest pose puts the vertices, n×3: the rest positions, except of parts that were bound in
    /// another pose.
    pub fn positions_in_rest_pose(&self) -> Result<Vec<[f32; 3]>, SkinError> {
        let mut positions = self.rest_positions();
        if self.surface.parts.iter().any(|part| part.skin.is_some()) {
            let mut normals = self.surface.normals.clone();
            self.linear_skin()?.solve(&self.skeleton.rest_model_from_bone(), &mut positions, &mut normals)?;
        }
        Ok(positions)
    }

    /// Checks that parts, materials, skins and morph targets fit together.
    pub fn check_parts(&self) -> Result<(), PartError> {
        let Surface { mesh, parts, morph_targets, .. } = &*self.surface;
        let counts = [self.materials.len(), self.skins.len()];
        check_parts(parts, morph_targets, mesh.vertices.len(), &mesh.triangles, counts)
    }

    /// Its meshes, how they follow the bones, and its materials, to be written to a file.
    pub fn glb_mesh(&self) -> GlbMesh<'_> {
        let surface = &*self.surface;
        GlbMesh {
            mesh: &surface.mesh,
            split: None,
            normals: Some(&surface.normals),
            texture_coordinates: surface.texture_coordinates.as_deref(),
            vertex_colors: surface.vertex_colors.as_deref(),
            influences: Some(&surface.influences),
            parts: &surface.parts,
            morph_targets: &surface.morph_targets,
            skins: &self.skins,
            materials: &self.materials,
        }
    }

    /// Its bones at rest, model space.
    pub(crate) fn rest_bone_segments(&self) -> Vec<BoneSegment> {
        let wide = |p: Vec3| p.as_dvec3().to_array();
        let segment = |(head, tail)| BoneSegment { head: wide(head), tail: wide(tail) };
        self.skeleton.rest_segments().into_iter().map(segment).collect()
    }

    /// The character prepared for linear blend skinning every frame, whatever kind its skin is of.
    pub fn linear_skin(&self) -> Result<LinearBlendSkin, SkinError> {
        let Surface { normals, influences, parts, .. } = &*self.surface;
        let (positions, rest) = (self.rest_positions(), self.skeleton.rest_model_from_bone());
        if parts.iter().all(|part| part.skin.is_none()) {
            return LinearBlendSkin::precompute(&positions, normals, influences, &rest);
        }
        let bindings = self.bindings(&rest)?;
        let influences = self.influences_of_bindings(rest.len(), bindings.len())?;
        LinearBlendSkin::precompute_bound(&positions, normals, &influences, &bindings, rest.len())
    }

    /// Its morph targets, prepared for blending before the skin is posed; `None` if there are none.
    pub fn morphs(&self) -> Result<Option<Morphs>, SkinError> {
        let Surface { normals, parts, morph_targets, .. } = &*self.surface;
        if morph_targets.is_empty() {
            return Ok(None);
        }
        let first = |part: u32| parts.get(part as usize).map_or(usize::MAX, |part| part.vertices.start as usize);
        let offsets = morph_targets.iter().map(|target| MorphOffsets {
            first_vertex: first(target.part),
            positions: &target.positions,
            normals: &target.normals,
            rest_weight: target.default_weight,
        });
        let offsets: Vec<MorphOffsets> = offsets.collect();
        Morphs::precompute(&self.rest_positions(), normals, &offsets).map(Some)
    }

    /// What can be set of its shape: its expressions and the names of its morph targets, each once.
    pub fn shape_names(&self) -> Vec<&str> {
        let expressions = self.avatar.iter().flat_map(|avatar| &avatar.expressions);
        let expressions = expressions.filter(|expression| !expression.targets.is_empty());
        let mut names: Vec<&str> = Vec::new();
        let targets = self.surface.morph_targets.iter().map(|target| target.name.as_str());
        for name in expressions.map(|expression| expression.name.as_str()).chain(targets) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// The weights of its morph targets as the file has them.
    pub fn default_weights(&self) -> Vec<f32> {
        self.surface.morph_targets.iter().map(|target| target.default_weight).collect()
    }

    /// Sets the weights of an expression's morph targets, or of all morph targets with a name. Returns whether there are
    /// any. `weights`: one per target.
    pub fn set_shape(&self, weights: &mut [f32], name: &str, weight: f32) -> bool {
        let targets = self.targets_of_shape(name);
        targets.iter().for_each(|&(target, full)| weights[target] = full * weight);
        !targets.is_empty()
    }

    /// The morph targets of a shape, and the weight of each when it is fully there; empty for a name that nothing has.
    pub fn targets_of_shape(&self, name: &str) -> Vec<(usize, f32)> {
        targets_of_shape(self.expressions(), &self.surface.morph_targets, name)
    }

    /// Its expressions: morph targets that are set together.
    pub fn expressions(&self) -> &[Expression] {
        self.avatar.as_ref().map_or(&[], |avatar| avatar.expressions.as_slice())
    }

    /// The same character with other weights of its morph targets (one per target) as default, and its rest shape
    /// blended by them.
    #[must_use]
    pub fn reshaped(&self, weights: &[f32]) -> Self {
        let mut reshaped = self.clone();
        let Surface { mesh, normals, parts, morph_targets, .. } = Arc::make_mut(&mut reshaped.surface);
        let mut turned = vec![false; normals.len()];
        for (target, &weight) in morph_targets.iter_mut().zip(weights) {
            let more = weight - target.default_weight;
            target.default_weight = weight;
            let Some(part) = parts.get(target.part as usize).filter(|_| more != 0.0) else { continue };
            let first = part.vertices.start as usize;
            for (vertex, offset) in mesh.vertices[first..].iter_mut().zip(&target.positions) {
                *vertex = std::array::from_fn(|k| vertex[k] + f64::from(more) * f64::from(offset[k]));
            }
            for (k, offset) in target.normals.iter().enumerate() {
                normals[first + k] = std::array::from_fn(|c| normals[first + k][c] + more * offset[c]);
                turned[first + k] = true;
            }
        }
        for (normal, _) in normals.iter_mut().zip(turned).filter(|(_, turned)| *turned) {
            *normal = unit_normal(*normal);
        }
        reshaped
    }

    /// The bones in their rest pose, then those of each skin.
    pub(crate) fn bindings(&self, rest: &[Affine3A]) -> Result<Vec<BoneBinding>, SkinError> {
        let poses = std::iter::once(rest).chain(self.skins.iter().map(|skin| skin.bound_model_from_bone.as_slice()));
        let mut bindings = Vec::with_capacity((1 + self.skins.len()) * rest.len());
        for pose in poses {
            if pose.len() != rest.len() {
                return Err(SkinError::Length { what: "bones of a bind pose", got: pose.len(), expected: rest.len() });
            }
            let binding = |(bone, &rest_model_from_bone)| BoneBinding { bone, rest_model_from_bone };
            bindings.extend((0..).zip(pose).map(binding));
        }
        Ok(bindings)
    }

    /// The influences with each part's bones renumbered to the bindings of its skin.
    pub(crate) fn influences_of_bindings(&self, bones: usize, bindings: usize) -> Result<Influences, SkinError> {
        let Surface { influences, parts, .. } = &*self.surface;
        let (per_vertex, too_many) = (influences.per_vertex(), SkinError::TooManyBindings { bindings });
        let mut slots = influences.bones().to_vec();
        for part in parts {
            let first = part.skin.map_or(0, |skin| (1 + skin as usize) * bones);
            let vertices = part.vertices.start as usize..part.vertices.end as usize;
            let expected = vertices.end;
            let own = slots.get_mut(vertices.start * per_vertex..vertices.end * per_vertex);
            let length = SkinError::Length { what: "rows of weights", got: influences.vertex_count(), expected };
            for slot in own.ok_or(length)? {
                *slot = u16::try_from(first + usize::from(*slot)).map_err(|_| too_many.clone())?;
            }
        }
        Influences::restore(per_vertex, slots, influences.weights().to_vec(), bindings).map_err(|_| too_many)
    }
}
