//! Which side of parts of a surface is the inside, by the winding number on them.

use glam::DVec3;

use crate::winding::FastWindingNumber;
use crate::{MeshError, TriangleMesh};

/// Most parts tested, the largest first; a triangle soup may have one for every triangle.
const PARTS: usize = 2000;
/// Facets per part at which the winding number is sampled.
const SAMPLES: usize = 48;
/// Offset of the samples from the facet, relative to its size.
const ASIDE: f64 = 1e-4;
/// A mean winding number on the surface closer to zero than this means neither inside nor outside.
pub(crate) const UNDECIDED: f64 = 0.1;

/// The mean winding numbers of both sides of a part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides {
    /// Due to the part itself, as it is: ½ for a closed part whose normals point outwards, -½ for one inside out, near
    /// 0 for a flat one.
    pub(crate) own: f64,
    /// Due to the larger parts around it, as decided.
    pub(crate) around: f64,
}

/// Tests parts, given as lists of triangles of `mesh`, from the largest down. `is_flipped` is called for each with its
/// index, and parts it wants reversed count as reversed for all smaller ones, so that a cavity within a solid stays as
/// it is. `None` for parts not tested because there are too many.
pub(crate) fn sides(
    mesh: &TriangleMesh,
    parts: &[Vec<u32>],
    mut is_flipped: impl FnMut(usize, Sides) -> bool,
) -> Result<Vec<Option<Sides>>, MeshError> {
    let mut found = vec![None; parts.len()];
    let mut seen: Vec<Part> = Vec::new();
    for index in largest_first(mesh, parts).into_iter().take(PARTS) {
        let triangles = &parts[index as usize];
        let mut part = Part::new(mesh, triangles)?;
        let samples = samples(mesh, triangles);
        let mean = |total: f64| if samples.is_empty() { 0.0 } else { total / samples.len() as f64 };
        let own = mean(samples.iter().map(|&p| part.winding.evaluate(p)).sum());
        let others =
            |p: [f64; 3]| -> f64 { seen.iter().filter(|s| s.holds(p)).map(|s| s.sign * s.winding.evaluate(p)).sum() };
        let around = mean(samples.iter().map(|&p| others(p)).sum());
        let sides = Sides { own, around };
        found[index as usize] = Some(sides);
        if is_flipped(index as usize, sides) {
            part.sign = -1.0;
        }
        seen.push(part);
    }
    Ok(found)
}

struct Part {
    winding: FastWindingNumber,
    low: DVec3,
    high: DVec3,
    sign: f64,
}

impl Part {
    fn new(mesh: &TriangleMesh, triangles: &[u32]) -> Result<Self, MeshError> {
        let corners = || triangles.iter().flat_map(|&t| mesh.triangles[t as usize]);
        let vertices: Vec<[f64; 3]> = corners().map(|v| mesh.vertices[v as usize]).collect();
        let triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let part = TriangleMesh { vertices, triangles };
        let (low, high) = part.bounds().ok_or(MeshError::Empty)?;
        let winding = FastWindingNumber::precompute(&part)?;
        Ok(Self { winding, low: low.into(), high: high.into(), sign: 1.0 })
    }

    /// Outside its box a closed component winds around nothing, and an open one around hardly anything.
    fn holds(&self, p: [f64; 3]) -> bool {
        let p = DVec3::from(p);
        p.cmpge(self.low).all() && p.cmple(self.high).all()
    }
}

/// Parts by the diagonal of their boxes.
fn largest_first(mesh: &TriangleMesh, parts: &[Vec<u32>]) -> Vec<u32> {
    let diagonal = |part: &Vec<u32>| {
        let places =
            part.iter().flat_map(|&t| mesh.triangles[t as usize]).map(|v| DVec3::from(mesh.vertices[v as usize]));
        let (low, high) = places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        low.distance(high)
    };
    let sizes: Vec<f64> = parts.iter().map(diagonal).collect();
    let mut order: Vec<u32> = (0..parts.len() as u32).collect();
    order.sort_by(|&a, &b| sizes[b as usize].total_cmp(&sizes[a as usize]));
    order
}

/// Points slightly to either side of the centres of facets that are evenly spread over the part's area.
fn samples(mesh: &TriangleMesh, part: &[u32]) -> Vec<[f64; 3]> {
    let corners = |t: u32| mesh.triangles[t as usize].map(|v| DVec3::from(mesh.vertices[v as usize]));
    let area = |t: u32| {
        let [a, b, c] = corners(t);
        (b - a).cross(c - a).length()
    };
    let total: f64 = part.iter().map(|&t| area(t)).sum();
    let mut passed = 0.0;
    let mut samples = Vec::with_capacity(2 * SAMPLES);
    for &t in part {
        let before = passed;
        passed += area(t);
        let share = |area: f64| (area / total * SAMPLES as f64).floor();
        let is_due = share(before) < share(passed) || part.len() <= SAMPLES;
        if samples.len() < 2 * SAMPLES && is_due && area(t) > 0.0 {
            let [a, b, c] = corners(t);
            let centre = (a + b + c) / 3.0;
            let aside = ASIDE * (b - a).cross(c - a) / area(t).sqrt();
            samples.extend([(centre + aside).to_array(), (centre - aside).to_array()]);
        }
    }
    samples
}
