//! A volume for a surface: tetrahedra whose vertices lie on the surface, along bones and graded in between, and which of
//! them are inside (thesis chapter 8).

mod closed_winding;
mod compact;
mod constraints;
mod elements;
mod inside;
mod octree;
mod peel;
mod peel_slivers;
mod recover;
mod report;
mod shell;
mod sites;
mod solid;
mod tessellate;

use std::ops::ControlFlow;

use crate::{
    DelaunayError, EmbedError, Embedding, FastWindingNumber, ImproveError, ImproveSettings, MeshError,
    SegmentationError, SegmentationSettings, TetrahedralMesh, TriangleHierarchy, TriangleMesh, orient_patches,
    plane_of,
};
use inside::find_inside;
pub use report::VolumeReport;
use shell::Shell;
pub use shell::ShellShortfall;
use solid::Solid;
use tessellate::tessellate;

/// What a volume is made for.
#[derive(Clone, Copy, Debug)]
pub struct VolumeInput<'a> {
    /// The surface; open, crossing itself, in pieces, as it comes.
    pub surface: &'a TriangleMesh,
    /// Bones, head and tail in the mesh's unit: vertices are put along each, both ends included.
    pub segments: &'a [[[f64; 3]; 2]],
    /// Point handles in the mesh's unit: each becomes a vertex.
    pub points: &'a [[f64; 3]],
}

/// How fine a volume is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// Every vertex of the surface is a vertex of the volume.
    Conforming,
    /// A coarser volume around a simplified surface, in which each vertex of the surface has its place.
    Embedded {
        /// Vertices of the volume, about.
        vertices: usize,
    },
}

/// Hard constraints on the inside (thesis 8.5.2). What cannot be obeyed is counted in the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VolumeConstraints {
    /// Every recovered facet of the shell has an element inside: thin accessories stay.
    pub facets: bool,
    /// The boundary is a manifold: no two parts meet in an edge or a vertex alone.
    pub manifold: bool,
}

/// How to make a volume.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeSettings {
    /// How fine it is.
    pub resolution: Resolution,
    /// How many times the lengths of the surface's edges the spacing just inside is; further in it doubles again and
    /// again.
    pub grading: f64,
    /// The balance of winding number and coherence.
    pub segmentation: SegmentationSettings,
    /// What the inside has to obey besides.
    pub constraints: VolumeConstraints,
    /// How slivers are removed; `None` to leave them.
    pub improve: Option<ImproveSettings>,
}

impl Default for VolumeSettings {
    /// An embedded volume of 10,000 vertices. The grading of 2 leaves a layer of well-shaped elements under the
    /// surface; half of it makes three times as many vertices inside, for no better angles.
    fn default() -> Self {
        Self {
            resolution: Resolution::Embedded { vertices: 10_000 },
            grading: 2.0,
            segmentation: SegmentationSettings::default(),
            constraints: VolumeConstraints::default(),
            improve: Some(ImproveSettings::default()),
        }
    }
}

/// A volume.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Positive tetrahedra; every vertex belongs to one. Of a conforming volume the vertices that are the surface's
    /// come first, in their order.
    pub mesh: TetrahedralMesh,
    /// Winding number of each tetrahedron.
    pub winding: Vec<f64>,
    /// The vertices along each bone given, from head to tail.
    pub segment_vertices: Vec<Vec<u32>>,
    /// The vertex of each point handle given.
    pub point_vertices: Vec<u32>,
    /// Where each vertex of the surface is in the volume.
    pub surface: Embedding,
    /// How good it is.
    pub report: VolumeReport,
}

/// What a volume is being made of just now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeStage {
    /// Turning triangles round, and simplifying the surface.
    Shell,
    /// Placing vertices.
    Sites,
    /// Connecting them.
    Tetrahedra,
    /// Making the surface's facets facets of tetrahedra.
    Recovery,
    /// Telling inside from outside.
    Segmentation,
    /// Removing slivers.
    Improvement,
    /// Finding the place of each vertex of the surface.
    Embedding,
}

/// Why there is no volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// The surface cannot be used as it is.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A bone or point handle has no position.
    #[error("{what} {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// "bone" or "point".
        what: &'static str,
        /// Zero-based.
        index: usize,
    },
    /// The points have no tetrahedra.
    #[error(transparent)]
    Delaunay(DelaunayError),
    /// The triangles have no area.
    #[error("no triangle of the surface has an area; there is nothing to make a volume for")]
    NoArea,
    /// Settings out of range, or numbers so large that nothing can be computed with them.
    #[error("the surface could not be segmented: {0}")]
    Segmentation(SegmentationError),
    /// Slivers could not be removed.
    #[error("slivers could not be removed: {0}")]
    Improvement(ImproveError),
    /// The surface's vertices have no place in the volume.
    #[error("the surface's vertices could not be placed in the volume: {0}")]
    Embedding(#[from] EmbedError),
    /// A bone has no element around it.
    #[error("a bone or point lies where no element could be kept; move it nearer to the surface")]
    HandleLost,
    /// All vertices lie in one plane.
    #[error("the surface is flat, so it has no volume; a flat shape has a planar domain instead")]
    Flat,
    /// Nothing is inside.
    #[error("the surface encloses nothing: it may be a flat sheet, or its triangles may face all ways")]
    Empty,
    /// The progress callback asked to stop.
    #[error("making the volume was cancelled")]
    Cancelled,
}

/// What the winding number and distances are taken from.
struct Field {
    surface: TriangleHierarchy,
    winding: FastWindingNumber,
}

/// A volume for a surface: its triangles are oriented consistently, the volume of its convex hull is tessellated with
/// its facets, or those of a simpler surface, as far as they can be had (thesis 8.5), elements inside are told from
/// those outside by their winding number and a graph cut (8.5.1), and slivers are removed. `progress` is told the
/// stage and the fraction of it done, and cancels by [`ControlFlow::Break`].
pub fn volume(
    input: &VolumeInput<'_>,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(VolumeStage, f64) -> ControlFlow<()>,
) -> Result<Volume, VolumeError> {
    input.validate()?;
    if plane_of(input.surface)?.is_some() {
        return Err(VolumeError::Flat);
    }
    let oriented = orient_patches(input.surface)?;
    let shell = Shell::new(&oriented.mesh, settings.resolution, &mut |done| progress(VolumeStage::Shell, done))?;
    let source = if shell.mesh.triangles.is_empty() { &oriented.mesh } else { &shell.mesh };
    let field = Field { surface: TriangleHierarchy::new(source)?, winding: FastWindingNumber::precompute(source)? };
    let mut whole = tessellate(&shell, &field, input, settings.grading, progress)?;
    whole.report.triangles_turned = oriented.turned.len();
    whole.report.shortfall = shell.shortfall;
    let every_vertex = settings.resolution == Resolution::Conforming;
    let mut told = |done| progress(VolumeStage::Segmentation, done);
    let inside = find_inside(&mut whole, &field.winding, every_vertex, settings, &mut told)?;
    let mut solid = Solid::new(&whole, &inside);
    if let Some(improve) = &settings.improve {
        let keep_shell = every_vertex.then_some(inside.labels.as_slice());
        solid.improve(improve, keep_shell, &mut whole, &mut |done| progress(VolumeStage::Improvement, done))?;
    }
    if progress(VolumeStage::Embedding, 0.0).is_break() {
        return Err(VolumeError::Cancelled);
    }
    solid.finish(input, &shell, &field, whole)
}

impl From<DelaunayError> for VolumeError {
    fn from(error: DelaunayError) -> Self {
        match error {
            DelaunayError::Cancelled => Self::Cancelled,
            error => Self::Delaunay(error),
        }
    }
}

impl From<SegmentationError> for VolumeError {
    fn from(error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled => Self::Cancelled,
            error => Self::Segmentation(error),
        }
    }
}

impl VolumeInput<'_> {
    fn validate(&self) -> Result<(), VolumeError> {
        self.surface.validate()?;
        let bad = |p: &[f64; 3]| !p.iter().all(|c| c.is_finite());
        if let Some(index) = self.segments.iter().position(|s| s.iter().any(bad)) {
            return Err(VolumeError::NotFinite { what: "bone", index });
        }
        match self.points.iter().position(bad) {
            Some(index) => Err(VolumeError::NotFinite { what: "point", index }),
            None => Ok(()),
        }
    }
}
