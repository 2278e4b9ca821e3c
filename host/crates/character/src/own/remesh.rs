//! From a fine, uniform mesh of a field's zero set to one with triangles as large as the shape allows: edges shorter
//! than wanted collapse, edges flip towards Delaunay, and vertices slide along the surface towards the centre of their
//! neighbours and back onto the zero set (Botsch and Kobbelt 2004, with sizes that follow curvature).
//!
//! The seam of a half mesh stays at x = 0, and no inner edge may join two seam vertices: its mirror image would be a
//! second edge between the same two.

use glam::DVec3;
use rayon::prelude::*;

use super::field::Field;
use super::surface::Surface;

/// Wanted triangle sizes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// Radius of curvature from which the longest edges are wanted; below it they shrink with its power 0.6.
    pub(super) broad: f64,
    /// Shortest edge wanted.
    pub(super) min: f64,
    /// Longest edge wanted.
    pub(super) max: f64,
}

/// Edge lengths may grow this much per unit of distance along the surface.
const GRADATION: f64 = 0.35;
/// An edge collapses below this fraction of the wanted length.
const SHORT: f64 = 0.75;
/// No collapse makes an edge longer than this fraction of the wanted length.
const LONG: f64 = 1.4;
/// Rounds of collapsing, flipping and sliding; the last ones only flip and slide.
const ROUNDS: usize = 14;
const LAST_ROUNDS: usize = 4;

struct Remesh<'a> {
    field: &'a Field,
    surface: Surface,
    wanted: Vec<f64>,
    seam: Vec<bool>,
}

/// Coarsens `surface`, whose vertices are within about a cell of `field`'s zero set.
pub(super) fn remesh(field: &Field, mut surface: Surface, sizes: Sizes) -> Surface {
    let seam: Vec<bool> = surface.positions.iter().map(|p| field.symmetric && p.x == 0.0).collect();
    let settle = |(p, &seam): (&DVec3, &bool)| {
        let mut settled = field.project(*p, sizes.min);
        if seam {
            settled.x = 0.0;
        }
        settled
    };
    surface.positions = surface.positions.par_iter().zip(&seam).map(settle).collect();
    let wanted = wanted_lengths(field, &surface, sizes);
    let mut work = Remesh { field, surface, wanted, seam };
    for round in 0..ROUNDS {
        if round + LAST_ROUNDS < ROUNDS {
            work.collapse_short_edges();
        }
        work.flip_edges();
        work.slide_vertices();
    }
    work.flip_edges();
    work.surface
}

/// The edge length wanted at each vertex: a fraction of the radius of curvature, within bounds, changing gradually.
fn wanted_lengths(field: &Field, surface: &Surface, sizes: Sizes) -> Vec<f64> {
    let normals: Vec<DVec3> =
        surface.positions.par_iter().map(|&p| field.gradient(p, 0.1 * sizes.min).normalize_or(DVec3::Y)).collect();
    let edges = surface.edges();
    let mut wanted = vec![sizes.max; surface.positions.len()];
    for &[a, b] in &edges {
        let bend = normals[a as usize].distance(normals[b as usize]);
        let length = surface.at(a).distance(surface.at(b)).max(0.5 * sizes.min);
        let radius = length / bend.max(1e-9);
        let size = (sizes.max * libm::pow(radius / sizes.broad, 0.6)).clamp(sizes.min, sizes.max);
        for v in [a, b] {
            wanted[v as usize] = wanted[v as usize].min(size);
        }
    }
    let limit = |wanted: &mut Vec<f64>, [a, b]: [u32; 2]| {
        let more = GRADATION * surface.at(a).distance(surface.at(b));
        let (at_a, at_b) = (wanted[a as usize], wanted[b as usize]);
        wanted[a as usize] = at_a.min(at_b + more);
        wanted[b as usize] = at_b.min(at_a + more);
    };
    // Forward and back along the numbering carries a bound far in few sweeps.
    for _ in 0..4 {
        for &edge in edges.iter().chain(edges.iter().rev()) {
            limit(&mut wanted, edge);
        }
    }
    wanted
}

impl Remesh<'_> {
    /// Length as a fraction of the wanted length.
    fn relative_length(&self, a: u32, b: u32) -> f64 {
        let wanted = f64::midpoint(self.wanted[a as usize], self.wanted[b as usize]);
        self.surface.at(a).distance(self.surface.at(b)) / wanted
    }

    fn collapse_short_edges(&mut self) {
        let mut short: Vec<(f64, [u32; 2])> = self
            .surface
            .edges()
            .into_iter()
            .map(|[a, b]| (self.relative_length(a, b), [a, b]))
            .filter(|(length, _)| *length < SHORT)
            .collect();
        short.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, [a, b]) in short {
            if self.surface.joined(a, b) && self.relative_length(a, b) < SHORT {
                self.collapse(a, b);
            }
        }
    }

    /// Merges two vertices, if the surface stays a surface and no triangle flips.
    fn collapse(&mut self, a: u32, b: u32) {
        let (seam_a, seam_b) = (self.seam[a as usize], self.seam[b as usize]);
        let (kept, gone) = if seam_b && !seam_a { (b, a) } else { (a, b) };
        let sides = self.surface.sides(a, b);
        if seam_a && seam_b && sides.len() != 1 {
            return;
        }
        let of_gone = self.surface.neighbours(gone);
        let of_kept = self.surface.neighbours(kept);
        let common = of_gone.iter().filter(|v| of_kept.binary_search(v).is_ok()).count();
        let new_seam_edge = self.seam[kept as usize]
            && !(seam_a && seam_b)
            && of_gone.iter().any(|&v| v != kept && self.seam[v as usize] && of_kept.binary_search(&v).is_err());
        if common != sides.len() || new_seam_edge || of_gone.len() + of_kept.len() < common + 5 {
            return;
        }
        let middle =
            if seam_a == seam_b { (self.surface.at(a) + self.surface.at(b)) / 2.0 } else { self.surface.at(kept) };
        let place = self.settled(middle, seam_a || seam_b, self.wanted[kept as usize]);
        let longest =
            of_gone.iter().chain(&of_kept).filter(|&&v| v != kept && v != gone).fold(0.0_f64, |longest, &v| {
                longest
                    .max(place.distance(self.surface.at(v)) / (self.wanted[v as usize].min(self.wanted[kept as usize])))
            });
        if longest > LONG || !self.stays_upright(kept, gone, place) {
            return;
        }
        let wanted = self.wanted[a as usize].min(self.wanted[b as usize]);
        self.surface.merge(kept, gone);
        self.surface.positions[kept as usize] = place;
        self.wanted[kept as usize] = wanted;
    }

    /// Whether the triangles around two vertices keep their side and a decent shape when both move to `place`.
    fn stays_upright(&self, kept: u32, gone: u32, place: DVec3) -> bool {
        let around = self.surface.fan(kept).chain(self.surface.fan(gone));
        around.filter(|t| !(t.contains(&kept) && t.contains(&gone))).all(|t| {
            let corners = t.map(|v| if v == kept || v == gone { place } else { self.surface.at(v) });
            let edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];
            let (old, new) = (self.surface.normal(t), edges[0].cross(edges[1]));
            let squares: f64 = edges.iter().map(|e| e.length_squared()).sum();
            old.dot(new) > 0.3 * old.length() * new.length() && new.length() > 0.15 * squares
        })
    }

    fn settled(&self, p: DVec3, seam: bool, size: f64) -> DVec3 {
        let mut settled = self.field.project(p, 0.5 * size);
        if seam {
            settled.x = 0.0;
        }
        settled
    }

    fn flip_edges(&mut self) {
        for [a, b] in self.surface.edges() {
            if let [(t, corners), (s, others)] = self.surface.sides(a, b)[..] {
                self.flip(a, b, (t, corners), (s, others));
            }
        }
    }

    /// Flips the edge between two triangles if it is not Delaunay and the surface bends little there.
    fn flip(&mut self, a: u32, b: u32, first: (u32, [u32; 3]), second: (u32, [u32; 3])) {
        let opposite = |t: [u32; 3]| t.into_iter().find(|&v| v != a && v != b);
        let (Some(c), Some(d)) = (opposite(first.1), opposite(second.1)) else { return };
        let surface = &self.surface;
        let cotangent = |at: u32| {
            let (p, q) = (surface.at(a) - surface.at(at), surface.at(b) - surface.at(at));
            p.dot(q) / p.cross(q).length().max(1e-300)
        };
        let few = surface.fan_size(a) < 5 || surface.fan_size(b) < 5;
        let both_on_seam = self.seam[c as usize] && self.seam[d as usize];
        if few || both_on_seam || cotangent(c) + cotangent(d) > -0.02 || surface.joined(c, d) {
            return;
        }
        // The first triangle runs a → b → c or b → a → c; the new ones keep its orientation.
        let runs_ab = (0..3).any(|k| first.1[k] == a && first.1[(k + 1) % 3] == b);
        let (from, to) = if runs_ab { (a, b) } else { (b, a) };
        let new = [[from, d, c], [d, to, c]];
        let old = (surface.normal(first.1) + surface.normal(second.1)).normalize_or_zero();
        let upright = new.iter().all(|&t| surface.normal(t).normalize_or_zero().dot(old) > 0.7);
        if upright {
            self.surface.replace(first.0, new[0]);
            self.surface.replace(second.0, new[1]);
        }
    }

    fn slide_vertices(&mut self) {
        let (surface, wanted, seam) = (&self.surface, &self.wanted, &self.seam);
        let slid = |v: u32| {
            let p = surface.at(v);
            if surface.fan_size(v) == 0 {
                return p;
            }
            let mut weighted = (DVec3::ZERO, 0.0);
            let mut normal = DVec3::ZERO;
            for t in surface.fan(v) {
                let n = surface.normal(t);
                normal += n;
                let size: f64 = t.iter().map(|&w| wanted[w as usize]).sum();
                let weight = n.length() / (size * size);
                let middle = t.iter().map(|&w| surface.at(w)).sum::<DVec3>() / 3.0;
                weighted = (weighted.0 + middle * weight, weighted.1 + weight);
            }
            if seam[v as usize] {
                let along: Vec<DVec3> =
                    surface.neighbours(v).iter().filter(|&&w| seam[w as usize]).map(|&w| surface.at(w)).collect();
                weighted = (along.iter().sum(), along.len() as f64);
            }
            let normal = normal.normalize_or_zero();
            let step = weighted.0 / weighted.1.max(1e-300) - p;
            self.settled(p + 0.6 * (step - normal * normal.dot(step)), seam[v as usize], wanted[v as usize])
        };
        self.surface.positions = (0..surface.positions.len() as u32).into_par_iter().map(slid).collect();
    }
}
