//! Points spread evenly on a surface, by eliminating the most crowded of many candidates (Yuksel 2015, "Sample
//! Elimination for Generating Poisson Disk Sample Sets").

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

use crate::search::box_tree::{Bounds, BoxTree};
use crate::{MeshError, TriangleMesh};

/// Candidates per point kept; the paper uses 5 for its figures, and more hardly helps.
const CHOICE: usize = 5;
/// The paper's exponent for the weight of a neighbour.
const CROWDING: i32 = 8;
/// More candidates than this would not fit into the indices.
const MOST: usize = 400_000_000;

/// `count` points on the triangles, spread evenly over their area with no two much closer than necessary, for meshes in
/// which [`crate::simplify::simplify`] finds no surface. Overlapping and facing sheets share their points. Fewer points
/// are returned only for a mesh without area (its distinct vertices) or for more than 80 million.
///
/// The same mesh gives the same points.
pub(crate) fn sample_surface(mesh: &TriangleMesh, count: usize) -> Result<Vec<[f64; 3]>, MeshError> {
    mesh.validate()?;
    let extent = mesh.bounds().map_or(0.0, |(low, high)| (DVec3::from(high) - DVec3::from(low)).max_element());
    let unit = if extent > 0.0 { libm::scalbn(1.0, libm::ilogb(extent).clamp(-900, 900)) } else { 1.0 };
    let count = count.min(MOST / CHOICE);
    let (points, area) = candidates(mesh, unit, CHOICE * count);
    if area <= 0.0 {
        let weld = crate::surface::weld_vertices(&mesh.vertices, 0.0);
        return Ok(weld.representative.iter().take(count).map(|&v| mesh.vertices[v as usize]).collect());
    }
    // As far apart as in the densest packing of discs in the plane.
    let spacing = 2.0 * (area / (2.0 * 3.0_f64.sqrt() * count as f64)).sqrt();
    let kept = eliminate(&points, count, spacing);
    Ok(kept.into_iter().map(|k| (points[k] * unit).to_array()).collect())
}

/// `count` candidates, equally dense over the area, in units of `unit`; and the area.
fn candidates(mesh: &TriangleMesh, unit: f64, count: usize) -> (Vec<DVec3>, f64) {
    let corners = |t: &[u32; 3]| t.map(|v| DVec3::from(mesh.vertices[v as usize]) / unit);
    let area_of = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let area: f64 = mesh.triangles.iter().map(|t| area_of(corners(t))).sum();
    let mut points = Vec::with_capacity(count);
    if area <= 0.0 || count == 0 {
        return (points, area);
    }
    let (step, mut covered) = (area / count as f64, 0.0);
    for triangle in &mesh.triangles {
        let [a, b, c] = corners(triangle);
        covered += area_of([a, b, c]);
        while points.len() < count && (points.len() as f64 + 0.5) * step <= covered {
            // The plastic number's sequence fills the square evenly, whichever part of it falls on one triangle.
            let index = (points.len() + 1) as f64;
            let (u, v) = ((index * 0.754_877_666_246_692_8).fract(), (index * 0.569_840_290_998_053_3).fract());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            points.push(a + (b - a) * u + (c - a) * v);
        }
    }
    // Rounding of the sums may leave the last one over.
    while let Some(&last) = points.last().filter(|_| points.len() < count) {
        points.push(last);
    }
    (points, area)
}

/// Indices of the `count` points left after repeatedly removing the most crowded one, ascending.
fn eliminate(points: &[DVec3], count: usize, spacing: f64) -> Vec<usize> {
    let tree =
        BoxTree::new((0..points.len() as u32).collect(), points.len(), |k| Bounds::around(&[points[k as usize]]));
    let neighbours = |k: u32, visit: &mut dyn FnMut(u32, f64)| {
        let centre = points[k as usize];
        let around = Bounds { low: centre - spacing, high: centre + spacing };
        tree.visit(
            |b| b.overlaps(&around),
            |other| {
                let distance = centre.distance(points[other as usize]);
                if other != k && distance < spacing {
                    visit(other, (1.0 - distance / spacing).powi(CROWDING));
                }
            },
        );
    };
    let mut crowding = vec![0.0; points.len()];
    for k in 0..points.len() as u32 {
        neighbours(k, &mut |_, weight| crowding[k as usize] += weight);
    }
    // Weights only shrink: an entry that is too heavy goes back with its current weight.
    let key = |weight: f64| weight.max(0.0).to_bits();
    let mut heap: BinaryHeap<(u64, Reverse<u32>)> =
        crowding.iter().enumerate().map(|(k, &weight)| (key(weight), Reverse(k as u32))).collect();
    let (mut is_kept, mut left) = (vec![true; points.len()], points.len());
    while left > count
        && let Some((entered, Reverse(k))) = heap.pop()
    {
        let now = key(crowding[k as usize]);
        if now < entered {
            heap.push((now, Reverse(k)));
            continue;
        }
        is_kept[k as usize] = false;
        left -= 1;
        neighbours(k, &mut |other, weight| crowding[other as usize] -= weight);
    }
    (0..points.len()).filter(|&k| is_kept[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> TriangleMesh {
        let vertices = vec![[0.0; 3], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0], [0.0, 3.0, 0.0]];
        TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    #[test]
    fn points_keep_apart_and_leave_no_holes() {
        let points: Vec<DVec3> = sample_surface(&square(), 400).unwrap().into_iter().map(DVec3::from).collect();
        assert_eq!(points.len(), 400);
        let densest = 2.0 * (9.0 / (2.0 * 3.0_f64.sqrt() * 400.0)).sqrt();
        let nearest =
            |p: DVec3| points.iter().map(|q| q.distance(p)).filter(|&d| d > 0.0).fold(f64::INFINITY, f64::min);
        let closest = points.iter().map(|&p| nearest(p)).fold(f64::INFINITY, f64::min);
        assert!(closest > 0.55 * densest, "{closest} of {densest}");
        for x in 0..60 {
            for y in 0..60 {
                let hole = nearest(DVec3::new(f64::from(x) * 0.05 + 0.025, f64::from(y) * 0.05 + 0.025, 0.0));
                assert!(hole < 1.3 * densest, "a hole of {hole}");
            }
        }
    }

    #[test]
    fn no_area_and_no_points_are_no_panic() {
        let mut mesh = square();
        assert!(sample_surface(&mesh, 0).unwrap().is_empty());
        assert_eq!(sample_surface(&mesh, 1).unwrap().len(), 1);
        mesh.triangles = vec![[0, 1, 1]];
        assert_eq!(sample_surface(&mesh, 2).unwrap(), [[0.0; 3], [3.0, 0.0, 0.0]]);
        assert_eq!(sample_surface(&TriangleMesh::default(), 5), Err(MeshError::Empty));
        mesh.vertices[0][0] = f64::NAN;
        assert!(matches!(sample_surface(&mesh, 5), Err(MeshError::NotFinite { vertex: 0 })));
    }
}
