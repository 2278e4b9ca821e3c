//! The inside as a mesh of its own, with its measurements.

use super::domain::{PlanarDomain, PlanarReport};
use super::error::PlanarError;
use super::input::{PlanarInput, PlanarSettings};
use super::inside::{Inside, NO_PIECE};
use super::outline::{Outline, doubled_area};
use super::places::Places;
use super::triangulate::Triangulated;

const DROPPED: u32 = u32::MAX;

pub(super) fn assemble(
    input: &PlanarInput,
    settings: &PlanarSettings,
    outline: &Outline,
    places: &Places,
    mesh: &Triangulated,
    inside: &Inside,
) -> Result<PlanarDomain, PlanarError> {
    let chosen: Vec<usize> = (0..mesh.triangles.len()).filter(|&t| inside.piece_of[t] != NO_PIECE).collect();
    let mut used = vec![false; mesh.vertices.len()];
    chosen.iter().flat_map(|&t| mesh.triangles[t]).for_each(|v| used[v as usize] = true);
    let mut kept = used.clone();
    let named = places.of_vertex.iter().chain(places.of_point.iter().flatten());
    named.for_each(|&v| kept[v as usize] = true);
    let mut vertices = Vec::new();
    let mut new_of = vec![DROPPED; mesh.vertices.len()];
    for (v, &p) in mesh.vertices.iter().enumerate().filter(|&(v, _)| kept[v]) {
        new_of[v] = vertices.len() as u32;
        vertices.push(places.input.get(v).copied().unwrap_or_else(|| outline.frame.input_from_unit(p)));
    }
    let triangles: Vec<[u32; 3]> = chosen.iter().map(|&t| mesh.triangles[t].map(|v| new_of[v as usize])).collect();
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let areas: Vec<f64> = triangles.iter().map(corners).map(|[a, b, c]| 0.5 * doubled_area(a, b, c)).collect();
    // Adding a large centre back has rounded positions.
    if areas.iter().any(|&area| area.is_nan() || area <= 0.0) {
        return Err(PlanarError::Precision);
    }
    let angles: Vec<f64> = triangles.iter().map(|t| smallest_angle(corners(t))).collect();
    let is_used = |v: &u32| used[*v as usize];
    let samples_outside = places.of_bone.iter().flatten().filter(|v| !is_used(v)).count() + places.samples_far_out;
    let points_outside = (0..input.points.len() as u32)
        .filter(|&p| !places.of_point[p as usize].as_ref().is_some_and(is_used))
        .collect();
    let report = PlanarReport {
        refinement: mesh.refinement,
        smallest_angle: angles.iter().copied().fold(f64::INFINITY, f64::min),
        // Angles are measured with some rounding.
        sharp_triangles: angles.iter().filter(|&&a| a < settings.smallest_angle - 1e-9).count(),
        crossings: mesh.crossings,
        turned_over: inside.turned_over,
        area: areas.iter().sum(),
        winding_error: winding_error(mesh, inside),
        pieces: inside.pieces,
        pieces_with_bones: inside.pieces_with_bones,
        bridging_triangles: inside.bridging,
        bone_vertices_outside: samples_outside,
        points_outside,
    };
    let mut point_vertices = Vec::with_capacity(input.points.len());
    for (place, &p) in places.of_point.iter().zip(input.points) {
        point_vertices.push(place.map_or(vertices.len() as u32, |v| new_of[v as usize]));
        if place.is_none() {
            vertices.push(p);
        }
    }
    let along = |bone: &Vec<u32>| bone.iter().filter(|v| is_used(v)).map(|&v| new_of[v as usize]).collect();
    Ok(PlanarDomain {
        segment_vertices: places.of_bone.iter().map(along).collect(),
        point_vertices,
        input_vertices: places.of_vertex.iter().map(|&v| new_of[v as usize]).collect(),
        winding: chosen.iter().map(|&t| inside.winding[t]).collect(),
        vertices,
        triangles,
        report,
    })
}

/// `∫ |w - x|` over everything, over the area inside.
fn winding_error(mesh: &Triangulated, inside: &Inside) -> f64 {
    let (mut error, mut area_inside) = (0.0, 0.0);
    for (t, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| mesh.vertices[v as usize]);
        let area = 0.5 * doubled_area(a, b, c);
        let wanted = if inside.piece_of[t] == NO_PIECE { 0.0 } else { 1.0 };
        error += area * (inside.winding[t] - wanted).abs();
        area_inside += area * wanted;
    }
    error / area_inside
}

fn smallest_angle(corners: [[f64; 2]; 3]) -> f64 {
    let [a, b, c] = corners.map(glam::DVec2::from);
    let at =
        |p: glam::DVec2, q: glam::DVec2, r: glam::DVec2| libm::atan2((q - p).perp_dot(r - p), (q - p).dot(r - p)).abs();
    at(a, b, c).min(at(b, c, a)).min(at(c, a, b))
}
