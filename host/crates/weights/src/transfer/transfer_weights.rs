//! Weights of a mesh from the nearest places of another.

use std::ops::ControlFlow;

use armature_geometry::search::{TriangleHierarchy, barycentric};
use armature_geometry::surface::{NormalWeighting, vertex_normals, weld_vertices};
use armature_geometry::{Influences, MeshError, TriangleMesh};
use glam::DVec3;

use super::error::TransferError;
use super::inpaint_weights::{Inpainted, WeightRow, inpaint_weights};
use crate::extrema::Neighbours;
use crate::progress::report;

/// Places this close, as a fraction of the source's diagonal, are the same, whichever way they face.
const TOUCHING: f64 = 1e-6;
/// How many vertices are matched between two reports.
const BATCH: usize = 1024;

const STAGE: &str = "matching the surfaces";

/// When a place of the source is a match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransferSettings {
    /// No farther than this, as a fraction of the diagonal of the source's bounding box.
    pub max_distance: f64,
    /// The two surfaces turned by no more than this, radians.
    pub max_angle: f64,
}

impl Default for TransferSettings {
    /// As in the paper: 5 % and 30°.
    fn default() -> Self {
        Self { max_distance: 0.05, max_angle: std::f64::consts::FRAC_PI_6 }
    }
}

/// Weights for all vertices of the target.
#[derive(Clone, Debug, PartialEq)]
pub struct Transferred {
    /// One row per vertex; empty for `unreached` ones.
    pub rows: Vec<WeightRow>,
    /// Vertices with a match.
    pub matched: usize,
    /// Vertices filled in between matches.
    pub inpainted: usize,
    /// Vertices of pieces that have no match but are near: each such piece follows as one, like a button.
    pub carried: usize,
    /// Vertices that are too far from everything, ascending.
    pub unreached: Vec<u32>,
    /// Largest imbalance of the linear systems, relative to their largest right-hand side.
    pub residual: f64,
}

/// Gives `target` weights from `source` (`influences`: one row per vertex of it). Each vertex takes them from the nearest
/// place of the source if that is within reach and faces the same way; the others get the smoothest ones that fit. A piece
/// of the target that faces inwards as a whole is matched turned around. Both meshes in their rest pose, in one space.
pub fn transfer_weights(
    source: &TriangleMesh,
    influences: &Influences,
    target: &TriangleMesh,
    settings: &TransferSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Transferred, TransferError> {
    for (what, limit) in [("distance", settings.max_distance), ("angle", settings.max_angle)] {
        if !(limit.is_finite() && limit > 0.0) {
            return Err(TransferError::Limit { what });
        }
    }
    if influences.vertex_count() != source.vertices.len() {
        return Err(TransferError::RowCount { rows: influences.vertex_count(), vertices: source.vertices.len() });
    }
    let skin = Faced::new(source, "source")?;
    let cloth = Faced::new(target, "target")?;
    let places = nearest_places(source, &skin, target, progress)?;
    let (low, high) = source.bounds().unwrap_or_default();
    let diagonal = DVec3::from(low).distance(DVec3::from(high));
    let reach = settings.max_distance * diagonal;
    let pieces = cloth.pieces()?;
    let mut rows: Vec<Option<WeightRow>> = vec![None; target.vertices.len()];
    let (mut matched, mut carried) = (0, 0);
    for piece in &pieces {
        let near = |turned: f64| {
            let faces = |v: &&u32| {
                let place = &places[**v as usize];
                let angle = place.normal.angle_between(turned * cloth.normals[**v as usize]);
                // Without an area there is no normal, and the angle is NaN.
                place.distance <= TOUCHING * diagonal || (place.distance <= reach && angle <= settings.max_angle)
            };
            piece.iter().filter(faces).copied().collect::<Vec<u32>>()
        };
        let (ahead, turned) = (near(1.0), near(-1.0));
        let found = if turned.len() > ahead.len() { turned } else { ahead };
        matched += found.len();
        for &v in &found {
            rows[v as usize] = Some(row_at(source, influences, &places[v as usize]));
        }
        let distance = |v: &&u32| places[**v as usize].distance;
        let nearest = piece.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(nearest) = nearest.filter(|v| found.is_empty() && distance(v) <= reach) {
            let row = row_at(source, influences, &places[*nearest as usize]);
            piece.iter().for_each(|&v| rows[v as usize] = Some(row.clone()));
            carried += piece.len();
        }
    }
    let mut second_half = |stage: &'static str, done: f64| progress(stage, 0.5 + 0.5 * done);
    let Inpainted { rows, filled, unreached, residual, .. } = inpaint_weights(target, &rows, &mut second_half)?;
    Ok(Transferred { rows, matched, inpainted: filled, carried, unreached, residual })
}

/// The place of the source nearest to a vertex.
struct Place {
    triangle: u32,
    point: DVec3,
    distance: f64,
    normal: DVec3,
}

fn nearest_places(
    source: &TriangleMesh,
    skin: &Faced,
    target: &TriangleMesh,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Vec<Place>, TransferError> {
    let unusable = |error| TransferError::Mesh { which: "source", error };
    let hierarchy = TriangleHierarchy::new(source).map_err(unusable)?;
    let mut places = Vec::with_capacity(target.vertices.len());
    for (batch, vertices) in target.vertices.chunks(BATCH).enumerate() {
        let done = 0.5 * (batch * BATCH) as f64 / target.vertices.len() as f64;
        report(progress, STAGE, done).map_err(|stopped| TransferError::Cancelled { stage: stopped.stage })?;
        for &vertex in vertices {
            let found = hierarchy.closest_point(vertex).ok_or_else(|| unusable(MeshError::Empty))?;
            let point = DVec3::from(found.point);
            let corners = source.triangles[found.triangle as usize];
            let shares = barycentric(point, &corners.map(|v| DVec3::from(source.vertices[v as usize])));
            let normal = corners.iter().zip(shares).map(|(&v, share)| share * skin.normals[v as usize]).sum();
            places.push(Place { triangle: found.triangle, point, distance: found.distance_squared.sqrt(), normal });
        }
    }
    Ok(places)
}

/// The weights of a place in a triangle: those of its corners by their shares.
fn row_at(source: &TriangleMesh, influences: &Influences, place: &Place) -> WeightRow {
    let corners = source.triangles[place.triangle as usize];
    let shares = barycentric(place.point, &corners.map(|v| DVec3::from(source.vertices[v as usize])));
    let mut row = WeightRow::new();
    for (&corner, share) in corners.iter().zip(shares).filter(|(_, share)| *share > 0.0) {
        for (bone, weight) in influences.of_vertex(corner as usize) {
            let weight = share * f64::from(weight);
            match row.iter_mut().find(|(known, _)| *known == bone) {
                Some((_, sum)) => *sum += weight,
                None if weight > 0.0 => row.push((bone, weight)),
                None => {}
            }
        }
    }
    row
}

/// A mesh with the normals of its vertices, those at one place being one.
struct Faced {
    normals: Vec<DVec3>,
    /// Of each vertex, the one that stands for its place.
    welded_of: Vec<u32>,
    welded: TriangleMesh,
}

impl Faced {
    fn new(mesh: &TriangleMesh, which: &'static str) -> Result<Self, TransferError> {
        let unusable = |error| TransferError::Mesh { which, error };
        mesh.validate().map_err(unusable)?;
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let vertices = weld.representative.iter().map(|&v| mesh.vertices[v as usize]).collect();
        let corners = mesh.triangles.iter().map(|triangle| triangle.map(|v| weld.welded_of[v as usize]));
        let triangles = corners.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let welded = TriangleMesh { vertices, triangles };
        if welded.triangles.is_empty() {
            return Err(unusable(MeshError::Empty));
        }
        let found = vertex_normals(&welded, NormalWeighting::Angle).map_err(unusable)?;
        let normals = weld.welded_of.iter().map(|&v| DVec3::from(found[v as usize])).collect();
        Ok(Self { normals, welded_of: weld.welded_of, welded })
    }

    /// Its connected pieces, as vertices of the mesh.
    fn pieces(&self) -> Result<Vec<Vec<u32>>, TransferError> {
        let neighbours = Neighbours::of_elements(self.welded.vertices.len(), &self.welded.triangles)
            .map_err(|_| TransferError::Mesh { which: "target", error: MeshError::Empty })?;
        let of_welded = neighbours.pieces();
        let mut piece_of = vec![0; self.welded.vertices.len()];
        for (number, piece) in of_welded.iter().enumerate() {
            piece.iter().for_each(|&vertex| piece_of[vertex] = number);
        }
        let mut pieces = vec![Vec::new(); of_welded.len()];
        for (vertex, &welded) in (0..).zip(&self.welded_of) {
            pieces[piece_of[welded as usize]].push(vertex);
        }
        Ok(pieces)
    }
}
