//! Constrained Delaunay triangles of an outline, refined (Ruppert 1995, as implemented by the crate `spade`).

use spade::handles::FixedVertexHandle;
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, Point2, PositionInTriangulation, RefinementParameters,
    Triangulation as _,
};

use super::conform::ON;
use super::domain::Refinement;
use super::error::PlanarError;
use super::input::PlanarSettings;
use super::outline::doubled_area;

/// Triangles with a smaller area, where the outline is about 1 across, are not refined: circumcentres and midpoints of
/// larger ones are accurate enough to be where they should.
const SMALLEST_AREA: f64 = 1e-18;
/// Corners of the box around everything. Weighted means of two of these coordinates stay exactly on the side between
/// two corners, as they are powers of two.
const BOX: [[f64; 2]; 4] = [[1.0, 1.0], [4.0, 1.0], [4.0, 4.0], [1.0, 4.0]];

/// Triangles over a box around the outline.
#[derive(Clone, Debug)]
pub(super) struct Triangulated {
    /// Positions, the requested ones first.
    pub(super) vertices: Vec<[f64; 2]>,
    /// Counter-clockwise.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The triangle across the edge opposite each corner, `u32::MAX` for none.
    pub(super) neighbours: Vec<[u32; 3]>,
    pub(super) refinement: Refinement,
    /// How often segments had to be split where they cross.
    pub(super) crossings: usize,
}

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Triangulates `places`, all distinct and between 1 and 4, so that `segments` are edges or chains of edges. `largest`
/// is a rough bound on edges.
pub(super) fn triangulate(
    places: &[[f64; 2]],
    segments: &[[u32; 2]],
    largest: f64,
    settings: &PlanarSettings,
) -> Result<Triangulated, PlanarError> {
    let room = settings.most_vertices.saturating_sub(places.len());
    let mut points: Vec<Point2<f64>> = places.iter().map(|&[x, y]| Point2::new(x, y)).collect();
    points.extend(BOX.map(|[x, y]| Point2::new(x, y)));
    let count = points.len();
    let mut cdt = Cdt::bulk_load_cdt(points, Vec::new()).map_err(|_| PlanarError::Precision)?;
    if cdt.num_vertices() != count {
        return Err(PlanarError::Precision);
    }
    let crossings = constrain(&mut cdt, segments, room)?;
    let parameters = RefinementParameters::new()
        .with_angle_limit(AngleLimit::from_rad(settings.smallest_angle))
        .with_min_required_area(SMALLEST_AREA)
        .with_max_allowed_area((0.25 * 3.0_f64.sqrt() * largest * largest).max(2.0 * SMALLEST_AREA))
        .with_max_additional_vertices(room.saturating_sub(crossings));
    let refined = cdt.refine(parameters);
    let refinement = if refined.refinement_complete { Refinement::Complete } else { Refinement::LimitReached };
    let vertices = cdt.vertices().map(|v| [v.position().x, v.position().y]).collect();
    let mut triangles = Vec::with_capacity(cdt.num_inner_faces());
    let mut neighbours = Vec::with_capacity(cdt.num_inner_faces());
    for face in cdt.inner_faces() {
        triangles.push(face.vertices().map(|v| v.fix().index() as u32));
        // The edge opposite a corner is the one that starts at the next.
        let [ab, bc, ca] = face.adjacent_edges();
        // Inner faces are numbered from one.
        neighbours
            .push([bc, ca, ab].map(|e| e.rev().face().as_inner().map_or(u32::MAX, |f| f.fix().index() as u32 - 1)));
    }
    Ok(Triangulated { vertices, triangles, neighbours, refinement, crossings })
}

/// Makes edges of all segments and splits those that cross; returns the number of crossings.
fn constrain(cdt: &mut Cdt, segments: &[[u32; 2]], most: usize) -> Result<usize, PlanarError> {
    let handle = |v: u32| FixedVertexHandle::from_index(v as usize);
    let mut wanted: Vec<[FixedVertexHandle; 2]> = Vec::new();
    let mut crossings = 0;
    for segment in segments {
        wanted.push(segment.map(handle));
        while let Some([a, b]) = wanted.pop() {
            if a == b {
                continue;
            }
            let crossed = cdt.get_conflicting_edges_between_vertices(a, b).next();
            let Some(crossed) = crossed.map(|e| (e.fix().as_undirected(), [e.from().fix(), e.to().fix()])) else {
                if cdt.try_add_constraint(a, b).is_empty() {
                    return Err(PlanarError::Precision);
                }
                continue;
            };
            crossings += 1;
            if crossings > most {
                return Err(PlanarError::TooManyCrossings { most });
            }
            let (edge, [c, d]) = crossed;
            let at = |v: FixedVertexHandle| {
                let p = cdt.vertex(v).position();
                [p.x, p.y]
            };
            let [x, y] = crossing([at(a), at(b)], [at(c), at(d)]);
            cdt.remove_constraint_edge(edge);
            let middle = vertex_at(cdt, Point2::new(x, y))?;
            wanted.extend([[middle, b], [a, middle], [middle, d], [c, middle]]);
        }
    }
    Ok(crossings)
}

/// The vertex at a place, or one so close that it can be used instead, or else a new one.
fn vertex_at(cdt: &mut Cdt, place: Point2<f64>) -> Result<FixedVertexHandle, PlanarError> {
    let around: Vec<FixedVertexHandle> = match cdt.locate(place) {
        PositionInTriangulation::OnFace(face) => cdt.face(face).vertices().map(|v| v.fix()).to_vec(),
        PositionInTriangulation::OnEdge(edge) => cdt.directed_edge(edge).vertices().map(|v| v.fix()).to_vec(),
        PositionInTriangulation::OnVertex(vertex) => vec![vertex],
        PositionInTriangulation::OutsideOfConvexHull(_) | PositionInTriangulation::NoTriangulation => Vec::new(),
    };
    let squared = |v: &FixedVertexHandle| cdt.vertex(*v).position().distance_2(place);
    let nearest = around.into_iter().min_by(|a, b| squared(a).total_cmp(&squared(b)));
    match nearest.filter(|v| squared(v) <= ON * ON) {
        Some(vertex) => Ok(vertex),
        None => cdt.insert(place).map_err(|_| PlanarError::Precision),
    }
}

/// Where two segments that cross meet, rounded.
fn crossing([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> [f64; 2] {
    let (left, right) = (doubled_area(c, d, a), doubled_area(c, d, b));
    let t = left / (left - right);
    [0, 1].map(|k| a[k] + t * (b[k] - a[k]))
}
