//! Why a model was not bound.

use armature_deform::skin::SkinError;
use armature_formats::model::PartError;
use armature_geometry::{InfluencesError, MeshError};
use armature_rig::SkeletonError;
use armature_weights::finish::SparsifyError;
use armature_weights::heat::BoneHeatError;
use armature_weights::monotone::MonotoneError;
use armature_weights::transfer::TransferError;

use super::misfit::Misfit;
use super::settings::MOST_INFLUENCES;
use crate::handle_weights::HandleWeightsError;

/// Why a model was not bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BindError {
    /// There is no skeleton.
    #[error(
        "the model has no skeleton: give one as well, as a TGF graph, a BVH motion, a rigged glTF, or one of the \
         program's own characters"
    )]
    NoSkeleton,
    /// No bone has a length, so none can move a part of the mesh.
    #[error(
        "none of the {bones} bones of the skeleton has a length; bones move what is around them between head and tail"
    )]
    NoBoneWithLength {
        /// Bones given.
        bones: usize,
    },
    /// There is no vertex or no face.
    #[error(
        "the model has {vertices} vertices and {faces} faces; binding needs a surface (not points, lines or curves)"
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
    /// Arrays of the model differ in length or contain invalid indices.
    #[error("the model's {what} do not belong to its mesh; export the model again")]
    Inconsistent {
        /// Which arrays.
        what: &'static str,
    },
    /// Parts, materials, skins or morph targets do not fit the surface.
    #[error("the model's parts do not fit together: {0}; export the model again")]
    Parts(#[from] PartError),
    /// The skeleton is not where the mesh is.
    #[error("the skeleton does not fit the mesh: {0}")]
    Misfit(Misfit),
    /// Too few or too many influences per vertex.
    #[error("{0} influences per vertex are not possible; choose 1 to {MOST_INFLUENCES}")]
    InfluenceCount(usize),
    /// No part has this name.
    #[error("the model has no part {name:?}{}", among(names))]
    NoSuchPart {
        /// The name.
        name: String,
        /// Those there are.
        names: Vec<String>,
    },
    /// A twist curve is for a bone that the skeleton does not have.
    #[error("the skeleton has no bone {name:?}{}", among(names))]
    NoSuchBone {
        /// The name.
        name: String,
        /// Those there are.
        names: Vec<String>,
    },
    /// The skin is not usable.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// Every part is to take its weights from the others.
    #[error("no part is left to take weights from")]
    NothingToTransfer,
    /// Weights could not be taken from other parts, or filled in.
    #[error(transparent)]
    Transfer(TransferError),
    /// The bones are not a valid skeleton.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// Bone heat weights could not be computed.
    #[error(transparent)]
    Heat(BoneHeatError),
    /// Bounded biharmonic weights could not be computed.
    #[error(transparent)]
    Biharmonic(HandleWeightsError),
    /// Weights that came with the model could not be smoothed.
    #[error("its weights could not be smoothed: {0}")]
    Smooth(MonotoneError),
    /// The weights could not be made sparse.
    #[error(transparent)]
    Sparsify(#[from] SparsifyError),
    /// The weights are not usable.
    #[error(transparent)]
    Influences(#[from] InfluencesError),
    /// The progress callback asked to stop.
    #[error("binding was cancelled while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

fn among(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!("; it has {}", names.join(", ")) }
}

impl From<TransferError> for BindError {
    fn from(error: TransferError) -> Self {
        match error {
            TransferError::Cancelled { stage } => Self::Cancelled { stage },
            other => Self::Transfer(other),
        }
    }
}

impl From<BoneHeatError> for BindError {
    fn from(error: BoneHeatError) -> Self {
        match error {
            BoneHeatError::Cancelled { stage } => Self::Cancelled { stage },
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

impl From<MonotoneError> for BindError {
    fn from(error: MonotoneError) -> Self {
        match error {
            MonotoneError::Cancelled { stage } => Self::Cancelled { stage },
            other => Self::Smooth(other),
        }
    }
}
