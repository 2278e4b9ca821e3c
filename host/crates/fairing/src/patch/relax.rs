//! Relaxing a patch: vertices move along the surface towards the middle of their neighbours, so that triangles stay
//! well-shaped while rounds of solving move them.

use glam::DVec3;

use super::refine::Patch;

/// How far a vertex moves in each sweep, of the way.
const STEP: f64 = 0.5;

impl Patch {
    /// Area-weighted unit normals of the patch's vertices; zero where there are none.
    pub(super) fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.places.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.places[v as usize]);
            let normal = (b - a).cross(c - a);
            t.iter().for_each(|&v| normals[v as usize] += normal);
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// Moves inner vertices so many times; one whose triangles would turn over stays.
    pub(super) fn relax(&mut self, sweeps: usize) {
        let mut fans: Vec<Vec<u32>> = vec![Vec::new(); self.places.len()];
        for (index, t) in self.triangles.iter().enumerate() {
            t.iter().for_each(|&v| fans[v as usize].push(index as u32));
        }
        for _ in 0..sweeps {
            let normals = self.normals();
            for v in self.held..self.places.len() {
                let (place, normal) = (self.places[v], normals[v]);
                let corners = fans[v].iter().flat_map(|&t| self.triangles[t as usize]).filter(|&w| w as usize != v);
                let (sum, count) =
                    corners.fold((DVec3::ZERO, 0.0), |(sum, count), w| (sum + self.places[w as usize], count + 1.0));
                if count == 0.0 {
                    continue;
                }
                let step = sum / count - place;
                let areas = |patch: &Self| -> Vec<DVec3> { fans[v].iter().map(|&t| patch.area(t)).collect() };
                let before = areas(self);
                self.places[v] = place + STEP * (step - normal * normal.dot(step));
                let turned = areas(self).iter().zip(&before).any(|(new, old)| new.dot(*old) <= 0.0);
                if turned {
                    self.places[v] = place;
                }
            }
        }
    }

    /// A triangle's doubled area, along its normal.
    fn area(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.triangles[triangle as usize].map(|v| self.places[v as usize]);
        (b - a).cross(c - a)
    }
}
