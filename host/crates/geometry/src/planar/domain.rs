//! The result of filling an outline.

/// Triangles that fill an outline.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarDomain {
    /// n×2 positions, in the input's unit. Those of the input come first.
    pub vertices: Vec<[f64; 2]>,
    /// m×3 corners, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// The vertices along each bone, from its start to its end; samples outside the domain are omitted.
    pub segment_vertices: Vec<Vec<u32>>,
    /// The vertex of each point handle.
    pub point_vertices: Vec<u32>,
    /// The vertex at each of the input's vertices, at the same position; vertices less than 1e-15 of the size apart may
    /// be merged. Not part of any triangle if it is outside.
    pub input_vertices: Vec<u32>,
    /// The mean winding number of each triangle.
    pub winding: Vec<f64>,
    /// How it went.
    pub report: PlanarReport,
}

/// How the filling of an outline went.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarReport {
    /// Whether all triangles are as small and as well shaped as requested.
    pub refinement: Refinement,
    /// The smallest angle of a triangle, in radians.
    pub smallest_angle: f64,
    /// How many triangles have an angle below the requested one: next to sharp corners of the input itself.
    pub sharp_triangles: usize,
    /// How often segments crossed and were split.
    pub crossings: usize,
    /// Whether the outline as a whole ran clockwise and was reversed.
    pub turned_over: bool,
    /// The area of all triangles, in the input's unit squared.
    pub area: f64,
    /// `∫ |w - x|` over the domain and its surroundings, over `area`, where `x` is 1 inside and 0 outside: 0 for a
    /// sound outline, more for one with gaps and overlaps.
    pub winding_error: f64,
    /// Pieces connected through edges.
    pub pieces: usize,
    /// Pieces that bones pass through; more than one if not even bridging could connect them.
    pub pieces_with_bones: usize,
    /// Triangles that were made inside to connect pieces along bones.
    pub bridging_triangles: usize,
    /// Samples along bones that are outside and were omitted.
    pub bone_vertices_outside: usize,
    /// Point handles that are outside, ascending; their vertices are in no triangle.
    pub points_outside: Vec<u32>,
}

/// How refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refinement {
    /// There was nothing left to refine.
    Complete,
    /// The number of vertices reached its limit first; ask for larger triangles or smaller angles.
    LimitReached,
}
