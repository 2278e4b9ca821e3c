//! From a model and a skeleton to a character that can be posed.

use std::ops::ControlFlow;

use armature_formats::{Model, ModelRig};
use armature_geometry::{InfluencesError, MeshError, NormalWeighting, vertex_normals};
use armature_rig::{Skeleton, SkeletonError};
use armature_weights::{BoneHeatError, BoneHeatSettings, SparsifyError};

use crate::bind_weights::{Rib, bone_weights};
use crate::{BiharmonicTier, Character, HandleWeightsError, Misfit, Provenance, WeightsOn};

/// What is drawn where a model says nothing: light grey clay.
const PLAIN: [f32; 4] = [0.6, 0.58, 0.55, 1.0];
/// About so many vertices has the volume that weights are computed on by default: on the armadillo, the elephant and the
/// hand, twice as many bring weights no nearer to those of four times as many (`armature bench weights/convergence`).
pub const WEIGHT_VOLUME_VERTICES: usize = 5_000;

/// How weights are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindMethod {
    /// Bounded biharmonic weights.
    Biharmonic(BiharmonicTier),
    /// Bone heat on the surface.
    BoneHeat,
}

/// How to bind.
#[derive(Clone, Debug, PartialEq)]
pub struct BindSettings {
    /// Compute new weights even where the model brings an artist's.
    pub replace_rig: bool,
    /// Most influences a vertex may have, 1 to 8.
    pub max_influences: usize,
    /// How weights are computed.
    pub method: BindMethod,
    /// What bounded biharmonic weights are computed on.
    pub on: WeightsOn,
    /// Of the bone heat method.
    pub heat: BoneHeatSettings,
}

impl Default for BindSettings {
    fn default() -> Self {
        Self {
            replace_rig: false,
            // Smooth weights reach far: where many bones meet, four would leave seams.
            max_influences: 8,
            method: BindMethod::Biharmonic(BiharmonicTier::Interactive),
            on: WeightsOn::Volume { vertices: WEIGHT_VOLUME_VERTICES },
            heat: BoneHeatSettings::default(),
        }
    }
}

/// How far binding has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BindProgress {
    /// A few words for a progress bar.
    pub stage: &'static str,
    /// How much of the whole is done, 0 to 1, never falling.
    pub done: f64,
}

/// Why a model was not bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BindError {
    /// There is no skeleton anywhere.
    #[error(
        "the model brings no skeleton: give one beside it, as a TGF graph, a BVH motion, a rigged glTF, or one of the \
         program's own characters"
    )]
    NoSkeleton,
    /// No bone has a length, so none can move a part of the mesh.
    #[error(
        "none of the {bones} bones of the skeleton has a length; bones move what lies around them between head and tail"
    )]
    NoBoneWithLength {
        /// Bones given.
        bones: usize,
    },
    /// There is no vertex or no face.
    #[error(
        "the model has {vertices} vertices and {faces} faces; binding needs a surface (points, lines and curves are none)"
    )]
    NoSurface {
        /// Vertices given.
        vertices: usize,
        /// Faces given.
        faces: usize,
    },
    /// An index or coordinate of the mesh is not usable.
    #[error("the model's mesh is not usable: {0}")]
    Mesh(MeshError),
    /// Arrays of the model disagree in length or index what is not there.
    #[error("the model's {what} do not belong to its mesh; export the model again")]
    Inconsistent {
        /// Which arrays.
        what: &'static str,
    },
    /// Skeleton and mesh do not lie in one place.
    #[error("the skeleton does not fit the mesh: {0}")]
    Misfit(Misfit),
    /// Too few or too many influences a vertex.
    #[error("{0} influences a vertex are not possible; choose 1 to 8")]
    InfluenceCount(usize),
    /// The bones make no skeleton.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// Bone heat weights could not be computed.
    #[error(transparent)]
    Heat(BoneHeatError),
    /// Bounded biharmonic weights could not be computed.
    #[error(transparent)]
    Biharmonic(HandleWeightsError),
    /// The weights could not be made sparse.
    #[error(transparent)]
    Sparsify(#[from] SparsifyError),
    /// The weights are not usable.
    #[error(transparent)]
    Influences(#[from] InfluencesError),
    /// The progress callback asked to stop.
    #[error("binding was cancelled while {stage}")]
    Cancelled {
        /// What was going on.
        stage: &'static str,
    },
}

impl From<BoneHeatError> for BindError {
    fn from(error: BoneHeatError) -> Self {
        match error {
            BoneHeatError::Cancelled(phase) => Self::Cancelled { stage: phase.label() },
            other => Self::Heat(other),
        }
    }
}

impl From<HandleWeightsError> for BindError {
    fn from(error: HandleWeightsError) -> Self {
        match error {
            HandleWeightsError::Cancelled { stage } => Self::Cancelled { stage },
            other => Self::Biharmonic(other),
        }
    }
}

/// Binds a model.
///
/// A rigged model keeps its own skeleton and weights (a given skeleton is then left aside, with a warning) unless
/// `settings.replace_rig` is set; texture and colour are always kept. Without a rig the weights are computed;
/// with `replace_rig` and no `skeleton` given, the model's own skeleton is used with new weights. Bones without
/// length (hubs) get no weight. `progress` may stop the work at any report.
pub fn bind(
    model: Model,
    skeleton: Option<Skeleton>,
    settings: &BindSettings,
    progress: &mut dyn FnMut(BindProgress) -> ControlFlow<()>,
) -> Result<Character, BindError> {
    bind_with_ribs(model, skeleton, &[], settings, progress)
}

/// [`bind`], with ribs.
pub(crate) fn bind_with_ribs(
    model: Model,
    skeleton: Option<Skeleton>,
    ribs: &[Rib],
    settings: &BindSettings,
    progress: &mut dyn FnMut(BindProgress) -> ControlFlow<()>,
) -> Result<Character, BindError> {
    let mut report = |stage, done| match progress(BindProgress { stage, done }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(BindError::Cancelled { stage }),
    };
    report("checking the model", 0.0)?;
    check(&model, settings)?;
    let mut model = model;
    let provenance = match model.rig.take() {
        Some(rig) if !settings.replace_rig => {
            if skeleton.is_some_and(|given| given != rig.skeleton) {
                let text = "the model brings its own skeleton and weights, so the skeleton given was left aside; ask \
                            for the rig to be replaced to use it";
                model.warnings.push(text.to_owned());
            }
            model.rig = Some(rig);
            Provenance::Artist
        }
        old => {
            let skeleton = skeleton.or(old.map(|rig| rig.skeleton)).ok_or(BindError::NoSkeleton)?;
            drop_loose_vertices(&mut model);
            let weights = bone_weights(&model.mesh, &skeleton, ribs, settings, progress)?;
            model.warnings.extend(weights.warnings);
            model.rig = Some(ModelRig { skeleton, influences: weights.influences });
            Provenance::Computed(weights.record)
        }
    };
    let mut report = |stage, done| match progress(BindProgress { stage, done }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(BindError::Cancelled { stage }),
    };
    report("putting the character together", 0.97)?;
    let character = assemble(model, provenance)?;
    report("done", 1.0)?;
    Ok(character)
}

/// What every later step relies on.
fn check(model: &Model, settings: &BindSettings) -> Result<(), BindError> {
    if !(1..=8).contains(&settings.max_influences) {
        return Err(BindError::InfluenceCount(settings.max_influences));
    }
    model.mesh.validate().map_err(|error| match error {
        MeshError::Empty => {
            BindError::NoSurface { vertices: model.mesh.vertices.len(), faces: model.mesh.triangles.len() }
        }
        other => BindError::Mesh(other),
    })?;
    let (vertices, drawn) = (model.mesh.vertices.len(), model.drawn_vertex_count());
    let belongs = |what, yes: bool| if yes { Ok(()) } else { Err(BindError::Inconsistent { what }) };
    if let Some(split) = &model.split {
        belongs("drawn vertices", split.mesh_vertex.iter().all(|&v| (v as usize) < vertices))?;
        belongs("drawn triangles", split.triangles.iter().flatten().all(|&v| (v as usize) < drawn))?;
        belongs("drawn triangles", split.triangles.len() == model.mesh.triangles.len())?;
    }
    belongs("normals", model.normals.as_ref().is_none_or(|n| n.len() == drawn))?;
    belongs("texture coordinates", model.texture_coordinates.as_ref().is_none_or(|t| t.len() == drawn))?;
    if let Some(rig) = &model.rig {
        belongs("weights", rig.influences.vertex_count() == vertices)?;
        let bones = rig.skeleton.len();
        let mut followed = (0..vertices).flat_map(|v| rig.influences.of_vertex(v));
        belongs("bones", followed.all(|(bone, _)| usize::from(bone) < bones))?;
    }
    Ok(())
}

/// The inner points of a volume, and points in no face, would be moved but never seen.
fn drop_loose_vertices(model: &mut Model) {
    let mut used = vec![false; model.mesh.vertices.len()];
    model.mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    if model.split.is_some() || used.iter().all(|&u| u) {
        return;
    }
    let loose = used.iter().filter(|&&u| !u).count();
    if model.tetrahedra.is_none() {
        model.warnings.push(format!("{loose} vertices belong to no face and were left out"));
    }
    let mut renumbered = Vec::with_capacity(used.len());
    let mut next = 0_u32;
    for &u in &used {
        renumbered.push(next);
        next += u32::from(u);
    }
    model.tetrahedra = None;
    model.mesh.triangles.iter_mut().flatten().for_each(|v| *v = renumbered[*v as usize]);
    keep(&mut model.mesh.vertices, &used);
    if let Some(normals) = &mut model.normals {
        keep(normals, &used);
    }
    if let Some(coordinates) = &mut model.texture_coordinates {
        keep(coordinates, &used);
    }
}

fn keep<T>(values: &mut Vec<T>, used: &[bool]) {
    let mut used = used.iter();
    values.retain(|_| used.next().copied().unwrap_or(false));
}

/// One array length for everything.
fn assemble(model: Model, provenance: Provenance) -> Result<Character, BindError> {
    let model = if model.split.is_some() { model.split_at_seams() } else { model };
    let ModelRig { skeleton, influences } = model.rig.ok_or(BindError::NoSkeleton)?;
    if influences.vertex_count() != model.mesh.vertices.len() {
        return Err(BindError::Inconsistent { what: "weights" });
    }
    let mut warnings = model.warnings;
    let usable = |n: &Vec<[f32; 3]>| n.iter().flatten().all(|c| c.is_finite());
    if model.normals.as_ref().is_some_and(|n| !usable(n)) {
        warnings.push("the model's normals are not finite numbers and were computed anew".to_owned());
    }
    let computed = || -> Result<Vec<[f32; 3]>, BindError> {
        let normals = vertex_normals(&model.mesh, NormalWeighting::Angle).map_err(BindError::Mesh)?;
        Ok(normals.iter().map(|n| n.map(|c| c as f32)).collect())
    };
    let normals = model.normals.filter(usable).map_or_else(computed, Ok)?;
    let coordinates = model.texture_coordinates.map(|mut all| {
        let bad = all.iter().filter(|t| !t.iter().all(|c| c.is_finite())).count();
        if bad > 0 {
            warnings.push(format!("{bad} texture coordinates are not finite numbers and were set to zero"));
            all.iter_mut().filter(|t| !t.iter().all(|c| c.is_finite())).for_each(|t| *t = [0.0; 2]);
        }
        all
    });
    Ok(Character {
        name: model.name,
        mesh: model.mesh,
        normals,
        texture_coordinates: coordinates,
        base_color: model.base_color.filter(|c| c.iter().all(|x| x.is_finite())).unwrap_or(PLAIN),
        texture: model.texture,
        skeleton,
        influences,
        provenance,
        warnings,
    })
}

#[cfg(test)]
#[path = "bind_tests.rs"]
mod tests;
