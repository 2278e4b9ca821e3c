//! Why no skeleton was fitted.

use armature_geometry::MeshError;
use armature_rig::SkeletonError;

/// Why no skeleton was fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// An index or coordinate of the mesh is not usable, or there is no face.
    #[error("the mesh is not usable: {0}")]
    Mesh(#[from] MeshError),
    /// All vertices are in one plane.
    #[error("the mesh is flat, and a skeleton is fitted into the inside of a solid")]
    Flat,
    /// The winding number finds no inside, or hardly any.
    #[error(
        "the mesh has no inside to speak of: only {found} of {sampled} points in its box are inside, where at least \
         {least} are needed"
    )]
    NoInside {
        /// Points inside.
        found: usize,
        /// Points that were looked at.
        sampled: usize,
        /// How many are needed.
        least: usize,
    },
    /// Too few bones for a template, or none with a length.
    #[error("the template has no bone with a length")]
    NoBones,
    /// More limbs than the search can place.
    #[error("the template has {limbs} limbs that end; at most {most} can be placed")]
    TooManyLimbs {
        /// Limbs of the template.
        limbs: usize,
        /// Limbs that can be placed.
        most: usize,
    },
    /// Up and front are the same or opposite.
    #[error("up and front point along the same line; the character looks along its front and stands along its up")]
    FrontAlongUp,
    /// The fitted bones are not a valid skeleton.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The progress callback asked to stop.
    #[error("fitting the skeleton was cancelled while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}
