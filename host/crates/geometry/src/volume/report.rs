//! The result of making a volume for a surface.

use crate::TetrahedralMesh;
use crate::embed::Embedding;
use crate::improve::{DihedralStatistics, Improvement};

/// A volume.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Positive tetrahedra; every vertex belongs to one. In a conforming volume, the surface's vertices come first, in
    /// their order.
    pub mesh: TetrahedralMesh,
    /// Winding number of each tetrahedron.
    pub winding: Vec<f64>,
    /// The vertices along each bone, from head to tail.
    pub segment_vertices: Vec<Vec<u32>>,
    /// The vertex of each point handle.
    pub point_vertices: Vec<u32>,
    /// Where each vertex of the surface is in the volume.
    pub surface: Embedding,
    /// Its quality.
    pub report: VolumeReport,
}

/// Why the shell of an embedded volume is not as coarse as requested, or not a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShellShortfall {
    /// The surface could not be simplified further than this without gluing or tearing it.
    Vertices(usize),
    /// The triangles are not connected; points spread over them were used instead of a surface.
    Samples,
}

/// The quality of a volume.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeReport {
    /// Triangles of the surface that were reversed before anything else.
    pub triangles_turned: usize,
    /// Vertices of the shell, which is the surface itself or a simpler one.
    pub shell_vertices: usize,
    /// What could not be achieved for the shell.
    pub shortfall: Option<ShellShortfall>,
    /// If the surface was so rough, compared with the shell, that it was smoothed before anything else: how far a vertex
    /// moved at most, mesh unit. The surface's vertices keep their places in the volume, or next to it.
    pub roughness_smoothed: Option<f64>,
    /// Edges of the surface that are longer than those of the volume should be, but beside triangles too narrow to be
    /// worth so many vertices.
    pub edges_left_long: usize,
    /// Facets of the shell to recover: without duplicates and those without an area.
    pub facets: usize,
    /// Of those, facets that are facets of tetrahedra as they are.
    pub facets_whole: usize,
    /// Of those, facets that are covered by smaller facets of tetrahedra.
    pub facets_cut: usize,
    /// Fraction of the facets' area that facets of tetrahedra cover, 0 to 1.
    pub area_covered: f64,
    /// New vertices on the shell.
    pub shell_points_added: usize,
    /// Vertices along bones.
    pub bone_points: usize,
    /// Graded vertices inside.
    pub inner_points: usize,
    /// How many graded vertices inside the surface's edge lengths would require, if that is so many more than
    /// requested that the finest of them were left out.
    pub inner_points_wanted: Option<usize>,
    /// Whether the shell is closed and all of its facets are present, so that the winding number is one integer for
    /// each element.
    pub closed: bool,
    /// How far the winding number is from the labels: `∫ u dV` of thesis equation 8.9, over the volume inside. 0 for a
    /// closed surface; from 0.3 up, the inside was a guess.
    pub winding_error: f64,
    /// Elements that are inside only so that vertices of the surface are vertices of the volume.
    pub elements_for_vertices: usize,
    /// Elements that are inside only because of [`super::VolumeConstraints`].
    pub elements_for_constraints: usize,
    /// Facets, edges and vertices that do not satisfy those.
    pub constraints_unsatisfied: usize,
    /// Elements that are inside only so that bones are in one piece.
    pub elements_for_bones: usize,
    /// Elements at the boundary, flat up to rounding, that are not part of the volume.
    pub flat_elements_left_out: usize,
    /// Slivers at the boundary of an embedded volume that could not be improved and are not part of it.
    pub slivers_left_out: usize,
    /// Pieces of next to no volume that held no bone or point, and no vertex of a conforming volume's surface that
    /// another piece does not hold: left behind where surfaces cross, they are not part of the volume.
    pub pieces_left_out: usize,
    /// Pieces of the volume, connected through facets.
    pub pieces: usize,
    /// Groups of bones, connected through their ends, that are in more than one piece.
    pub bones_apart: usize,
    /// The sum of all volumes, mesh unit cubed.
    pub volume: f64,
    /// What sliver removal did, if requested.
    pub improvement: Option<Improvement>,
    /// The final angles between facets.
    pub dihedral_angles: Option<DihedralStatistics>,
}
