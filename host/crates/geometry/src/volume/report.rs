//! What became of a surface in its volume.

use super::ShellShortfall;
use crate::{DihedralStatistics, Improvement};

/// How good a volume is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeReport {
    /// Triangles of the surface that were turned round before anything else.
    pub triangles_turned: usize,
    /// Vertices of the shell, which is the surface itself or a simpler one.
    pub shell_vertices: usize,
    /// What about the shell could not be had.
    pub shortfall: Option<ShellShortfall>,
    /// Facets of the shell asked for: without duplicates and those without an area.
    pub facets: usize,
    /// Of those, facets of tetrahedra as they are.
    pub facets_whole: usize,
    /// Of those, covered by smaller facets of tetrahedra.
    pub facets_cut: usize,
    /// Share of the facets' area that facets of tetrahedra cover, 0 to 1.
    pub area_covered: f64,
    /// New vertices on the shell.
    pub shell_points_added: usize,
    /// Vertices along bones.
    pub bone_points: usize,
    /// Graded vertices inside.
    pub inner_points: usize,
    /// Whether the shell is closed and all of its facets are there, so that the winding number is one integer for
    /// each element.
    pub closed: bool,
    /// How far the winding number is from the labels: `∫ u dV` of thesis equation 8.9, over the volume inside. 0 for a
    /// closed surface; from 0.3 up, what is inside was a guess.
    pub winding_error: f64,
    /// Elements inside only so that vertices of the surface are vertices of the volume.
    pub elements_for_vertices: usize,
    /// Elements inside only because of [`super::VolumeConstraints`].
    pub elements_for_constraints: usize,
    /// Facets, edges and vertices that do not obey those.
    pub constraints_unsatisfied: usize,
    /// Elements inside only so that bones are in one piece.
    pub elements_for_bones: usize,
    /// Elements at the boundary, flat up to rounding, that are not part of the volume.
    pub flat_elements_left_out: usize,
    /// Slivers at the boundary of an embedded volume that could not be made better and are not part of it.
    pub slivers_left_out: usize,
    /// Pieces of the volume, joined through facets.
    pub pieces: usize,
    /// Groups of bones, joined through their ends, that lie in more than one piece.
    pub bones_apart: usize,
    /// The sum of all volumes, mesh unit cubed.
    pub volume: f64,
    /// What the removal of slivers did, if it was asked for.
    pub improvement: Option<Improvement>,
    /// The angles between facets, in the end.
    pub dihedral_angles: Option<DihedralStatistics>,
}
