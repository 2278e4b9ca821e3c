//! Whole components that are inside out.

use glam::DVec3;

use crate::{FastWindingNumber, MeshError, TriangleMesh, connected_components, weld_vertices};

/// Components looked at, the largest first; a soup may have one for every triangle.
const COMPONENTS: usize = 2000;
/// Facets at which the winding number is taken, for each component.
const SAMPLES: usize = 48;
/// How far beside a facet they are taken, in the facet's size.
const ASIDE: f64 = 1e-4;
/// A mean winding number on the surface nearer to zero than this says neither inside nor outside.
const UNDECIDED: f64 = 0.1;

/// What was found about the components of a mesh, which are pieces joined through vertices at exactly one place.
#[derive(Clone, Debug, PartialEq)]
pub struct FlippedComponents {
    /// Component of every triangle, numbered by their first vertices.
    pub component_of: Vec<u32>,
    /// For every component the mean winding number of both sides of its surface, as it is, of itself and the (corrected) larger
    /// components around it: ½ for the sound skin of a solid or of a hole in a solid, -½ for one inside out, near
    /// 0 for a flat sheet. `None` for components not looked at because there are too many.
    pub mean_winding: Vec<Option<f64>>,
    /// Components that are inside out, ascending.
    pub flipped: Vec<u32>,
    /// Components that are too open to tell, or not looked at, ascending.
    pub undecided: Vec<u32>,
}

/// Finds components that are inside out: the winding number just inside is -1 or just outside is below 0. Components
/// are taken from the largest down, each judged beside the corrected ones already seen, so that a cavity within a
/// solid stays the way it is.
pub fn flipped_components(mesh: &TriangleMesh) -> Result<FlippedComponents, MeshError> {
    mesh.validate()?;
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let components = connected_components(weld.representative.len(), &triangles);
    let (component_of, count) = number_by_first_triangle(&triangles, &components.of_vertex, components.count);
    let mut parts: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (t, &component) in component_of.iter().enumerate() {
        parts[component as usize].push(t as u32);
    }
    let mut found =
        FlippedComponents { component_of, mean_winding: vec![None; count], flipped: Vec::new(), undecided: Vec::new() };
    let mut seen: Vec<Part> = Vec::new();
    for component in largest_first(mesh, &parts).into_iter().take(COMPONENTS) {
        let mut part = Part::new(mesh, &parts[component as usize])?;
        let samples = samples(mesh, &parts[component as usize]);
        let around =
            |p: [f64; 3]| seen.iter().filter(|s| s.holds(p)).map(|s| s.sign * s.winding.evaluate(p)).sum::<f64>();
        let total: f64 = samples.iter().map(|&p| part.winding.evaluate(p) + around(p)).sum();
        let mean = if samples.is_empty() { 0.0 } else { total / samples.len() as f64 };
        found.mean_winding[component as usize] = Some(mean);
        if mean < -UNDECIDED {
            part.sign = -1.0;
            found.flipped.push(component);
        }
        seen.push(part);
    }
    found.flipped.sort_unstable();
    let is_undecided = |mean: &Option<f64>| mean.is_none_or(|m| m.abs() <= UNDECIDED);
    found.undecided = (0..count as u32).filter(|&c| is_undecided(&found.mean_winding[c as usize])).collect();
    Ok(found)
}

impl FlippedComponents {
    /// `mesh` with the flipped components turned right side out. `mesh` is the one that was looked at; triangles that
    /// were not are left as they are.
    #[must_use]
    pub fn corrected(&self, mesh: &TriangleMesh) -> TriangleMesh {
        let mut corrected = mesh.clone();
        for (triangle, component) in corrected.triangles.iter_mut().zip(&self.component_of) {
            if self.flipped.binary_search(component).is_ok() {
                triangle.swap(1, 2);
            }
        }
        corrected
    }
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

fn number_by_first_triangle(triangles: &[[u32; 3]], of_vertex: &[u32], count: usize) -> (Vec<u32>, usize) {
    let mut number: Vec<Option<u32>> = vec![None; count];
    let mut next = 0;
    let component_of = triangles
        .iter()
        .map(|t| {
            *number[of_vertex[t[0] as usize] as usize].get_or_insert_with(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    (component_of, next as usize)
}

/// Components by the diagonal of their boxes.
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

/// Points a little to either side of the centres of facets that are evenly spread over the component's area.
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
