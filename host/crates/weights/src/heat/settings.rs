//! How heat spreads, what was found along the way, and why weights could not be computed.

use armature_geometry::MeshError;

use crate::progress::Stopped;
use crate::sparse::cholesky::CholeskyError;

/// How heat spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneHeatSettings {
    /// `c` in `H_jj = c / d²`: how strongly bones heat compared with how fast heat spreads; larger values make narrower
    /// transitions. The paper's `c = 1` is 3 here: its authors' program weights `H` by the whole area of the triangles
    /// around a vertex, of which a third is the vertex's own; likewise, 3 to 4 best matches Blender's weights on the
    /// shared test characters. (Their other value, 0.22, for transitions as wide as those of heat that spreads through
    /// the volume, becomes 0.66.)
    pub heat: f64,
    /// Bones whose distances from a vertex agree within this fraction are equally near and share it.
    pub tie_ratio: f64,
    /// Vertices closer to each other than this fraction of half the mesh's largest extent conduct heat as one vertex:
    /// this joins the seams of texture coordinates and triangle soups. Zero joins only equal positions.
    pub weld_ratio: f64,
    /// Whether bones behind a wall heat a vertex.
    pub visibility: Visibility,
}

impl Default for BoneHeatSettings {
    fn default() -> Self {
        Self { heat: 3.0, tie_ratio: 1e-4, weld_ratio: 1e-7, visibility: Visibility::Inside }
    }
}

/// Whether a bone must be seen from a vertex to heat it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Visibility {
    /// The shortest way from the vertex to the bone must lie inside the shape (Baran & Popović 2007).
    #[default]
    Inside,
    /// The nearest bone heats a vertex wherever it lies; for flat figures and bones outside the shape.
    Ignored,
}

/// What was found along the way; all of it may be shown to an animator.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BoneHeatReport {
    /// Vertices left after joining those at one place.
    pub welded_vertices: usize,
    /// Connected pieces of the surface; a vertex in no triangle is a piece of its own.
    pub components: usize,
    /// First vertex of every piece that sees no bone from any of its vertices. These follow their nearest bones
    /// regardless.
    pub blind_components: Vec<usize>,
    /// Vertices that see none of their nearest bones; heat reaches them along the surface.
    pub blind_vertices: usize,
    /// Bones that heat no vertex; their weights are zero everywhere.
    pub cold_bones: Vec<usize>,
    /// Vertices that are in no triangle with an area. They follow their nearest bones.
    pub isolated_vertices: usize,
    /// Triangles ignored because two of their corners are one vertex.
    pub collapsed_triangles: usize,
    /// Triangles with almost no area, between three different vertices; they conduct like very thin ones.
    pub degenerate_triangles: usize,
    /// Triangles ignored because another has the same corners.
    pub duplicate_triangles: usize,
    /// Edges flipped within the surface, so that heat flows from warm to cold across each.
    pub flipped_edges: usize,
    /// Edges that were insulated because heat would still have flowed backwards across them.
    pub clamped_edges: usize,
}

/// Why the weights could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BoneHeatError {
    /// The mesh is empty, refers to vertices that do not exist, or is not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There are no bones.
    #[error("there are no bones to follow; add at least one bone or point handle")]
    NoBones,
    /// More bones than an influence can index.
    #[error("there are {count} bones; at most {limit} can be used")]
    TooManyBones {
        /// Bones given.
        count: usize,
        /// The most there can be.
        limit: usize,
    },
    /// A bone's end is NaN, infinite, or so far from the mesh that distances overflow.
    #[error("bone {bone} is nowhere near the mesh, or its position is not finite")]
    BoneOutOfReach {
        /// Zero-based bone.
        bone: usize,
    },
    /// A setting is out of range.
    #[error("the setting {name} is {value}; it must be {allowed}")]
    BadSetting {
        /// The setting's name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The linear system could not be factorised.
    #[error("the heat equation could not be solved: {0}; repair the mesh's degenerate triangles and try again")]
    Factorisation(#[from] CholeskyError),
    /// The solution is too inaccurate to use.
    #[error(
        "the heat equation was solved only to a residual of {residual:.1e} and weights that miss their range or sum \
         by {deviation:.1e}; repair the mesh's degenerate triangles and try again"
    )]
    Inaccurate {
        /// Relative residual reached.
        residual: f64,
        /// Largest distance of a weight from 0..=1 or of a sum from one.
        deviation: f64,
    },
    /// The dense weights do not fit in memory.
    #[error("not enough memory for the weights of {vertices} vertices on {bones} bones")]
    OutOfMemory {
        /// Vertices of the mesh.
        vertices: usize,
        /// Bones that need a column.
        bones: usize,
    },
    /// The progress callback asked to stop.
    #[error("stopped while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

impl From<Stopped> for BoneHeatError {
    fn from(Stopped { stage }: Stopped) -> Self {
        Self::Cancelled { stage }
    }
}

impl BoneHeatSettings {
    pub(crate) fn check(&self) -> Result<(), BoneHeatError> {
        let bad = |name, value, allowed| Err(BoneHeatError::BadSetting { name, value, allowed });
        if !(1e-6..=1e6).contains(&self.heat) {
            return bad("heat", self.heat, "between 1e-6 and 1e6");
        }
        if !(0.0..=1.0).contains(&self.tie_ratio) {
            return bad("tie_ratio", self.tie_ratio, "between 0 and 1");
        }
        if !(0.0..=0.1).contains(&self.weld_ratio) {
            return bad("weld_ratio", self.weld_ratio, "between 0 and 0.1");
        }
        Ok(())
    }
}
