//! A mesh that follows a skeleton.

use armature_deform::{LinearBlendSkin, SkinError};
use armature_formats::Texture;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::Skeleton;

use crate::{BiharmonicTier, DomainKind};

/// Everything needed to pose and draw a character. All arrays belong to `mesh`'s vertices; a vertex stands here once
/// for every texture coordinate or normal it is drawn with.
#[derive(Clone, Debug, PartialEq)]
pub struct Character {
    /// For lists and exports.
    pub name: String,
    /// Rest shape in model space: right-handed, +Y up, looking along +Z, in its own unit.
    pub mesh: TriangleMesh,
    /// Unit rest normals, one a vertex.
    pub normals: Vec<[f32; 3]>,
    /// One a vertex; (0, 0) is the image's upper left corner.
    pub texture_coordinates: Option<Vec<[f32; 2]>>,
    /// Linear red, green, blue and opacity in 0..=1; multiplies the texture.
    pub base_color: [f32; 4],
    /// Base colour image, sRGB.
    pub texture: Option<Texture>,
    /// Bones in their rest pose, in model space.
    pub skeleton: Skeleton,
    /// One row a vertex.
    pub influences: Influences,
    /// How the weights came about.
    pub provenance: Provenance,
    /// What was odd on the way, in sentences for the user.
    pub warnings: Vec<String>,
}

/// How a character's weights came about.
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
    Biharmonic(BiharmonicRecord),
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

/// What bone heat was told, and how well it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatRecord {
    /// How strongly bones heat compared with how fast heat spreads (`c` of Baran and Popović).
    pub heat: f64,
    /// Most influences a vertex may have.
    pub max_influences: usize,
    /// Largest relative residual of the linear systems.
    pub residual: f64,
    /// Largest part of a vertex's weight that was dropped to keep within `max_influences`.
    pub max_dropped: f64,
}

/// What bounded biharmonic weights were computed on, and the certificate of all of them together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiharmonicRecord {
    /// How good they had to be.
    pub tier: BiharmonicTier,
    /// What they were computed on.
    pub domain: DomainKind,
    /// Vertices of that.
    pub domain_vertices: usize,
    /// Before normalising no weight is farther than this from the optimal one.
    pub error_bound: f64,
    /// The sum of the energies of all bones' weights; mesh unit to the power of the dimension less four.
    pub energy: f64,
    /// Bones whose weights are not as good as they had to be.
    pub unconverged: usize,
    /// Largest distance of a vertex's sum of weights from one, before normalising.
    pub largest_deviation: f64,
    /// Most influences a vertex may have.
    pub max_influences: usize,
    /// Largest part of a vertex's weight that was dropped to keep within `max_influences`.
    pub max_dropped: f64,
    /// Mean of the same over all vertices.
    pub mean_dropped: f64,
}

impl Character {
    /// Rest positions for pose time, n×3.
    pub fn rest_positions(&self) -> Vec<[f32; 3]> {
        self.mesh.vertices.iter().map(|p| p.map(|c| c as f32)).collect()
    }

    /// The character made ready to be skinned every frame.
    pub fn skin(&self) -> Result<LinearBlendSkin, SkinError> {
        LinearBlendSkin::precompute(
            &self.rest_positions(),
            &self.normals,
            &self.influences,
            &self.skeleton.rest_model_from_bone(),
        )
    }
}
