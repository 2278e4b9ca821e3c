//! A triangle mesh under construction: vertices with their triangles.

use glam::DVec3;

/// A removed triangle.
const GONE: [u32; 3] = [u32::MAX; 3];

/// Positions, triangles, and for every vertex the triangles around it. Removed triangles leave a hole in the list;
/// removed vertices have no triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub(super) positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    around: Vec<Vec<u32>>,
}

impl Surface {
    pub(super) fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let mut around = vec![Vec::new(); positions.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for &v in corners {
                around[v as usize].push(t as u32);
            }
        }
        Self { positions, triangles, around }
    }

    /// Positions in use and triangles over them.
    pub(super) fn compact(&self) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut renumbered = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        for v in (0..self.positions.len()).filter(|&v| !self.around[v].is_empty()) {
            renumbered[v] = positions.len() as u32;
            positions.push(self.positions[v]);
        }
        (positions, self.living().map(|(_, t)| t.map(|v| renumbered[v as usize])).collect())
    }

    /// Existing triangles, with their numbers.
    pub(super) fn living(&self) -> impl Iterator<Item = (u32, [u32; 3])> + '_ {
        self.triangles.iter().enumerate().filter(|(_, t)| **t != GONE).map(|(i, t)| (i as u32, *t))
    }

    /// Triangles around a vertex.
    pub(super) fn fan(&self, v: u32) -> impl Iterator<Item = [u32; 3]> + Clone + '_ {
        self.around[v as usize].iter().map(|&t| self.triangles[t as usize])
    }

    /// How many triangles a vertex has.
    pub(super) fn fan_size(&self, v: u32) -> usize {
        self.around[v as usize].len()
    }

    /// Vertices joined to `v` by an edge, ascending.
    pub(super) fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut out: Vec<u32> = self.fan(v).flatten().filter(|&w| w != v).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Whether an edge joins the two.
    pub(super) fn joined(&self, a: u32, b: u32) -> bool {
        self.fan(a).any(|t| t.contains(&b))
    }

    /// Triangles on both sides of an edge, with their numbers (one at a border).
    pub(super) fn sides(&self, a: u32, b: u32) -> Vec<(u32, [u32; 3])> {
        let around = self.around[a as usize].iter().map(|&t| (t, self.triangles[t as usize]));
        around.filter(|(_, t)| t.contains(&b)).collect()
    }

    /// Every edge once, smaller vertex first, ascending.
    pub(super) fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self
            .living()
            .flat_map(|(_, [a, b, c])| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Position of a vertex.
    pub(super) fn at(&self, v: u32) -> DVec3 {
        self.positions[v as usize]
    }

    /// Twice the area times the unit normal.
    pub(super) fn normal(&self, [a, b, c]: [u32; 3]) -> DVec3 {
        (self.at(b) - self.at(a)).cross(self.at(c) - self.at(a))
    }

    /// Merges `gone` into `kept`: their common triangles vanish, the rest of `gone`'s now belong to `kept`.
    pub(super) fn merge(&mut self, kept: u32, gone: u32) {
        for t in std::mem::take(&mut self.around[gone as usize]) {
            let corners = self.triangles[t as usize];
            if corners.contains(&kept) {
                self.triangles[t as usize] = GONE;
                for v in corners.into_iter().filter(|&v| v != gone) {
                    self.around[v as usize].retain(|&other| other != t);
                }
            } else {
                self.triangles[t as usize] = corners.map(|v| if v == gone { kept } else { v });
                self.around[kept as usize].push(t);
            }
        }
    }

    /// Gives a triangle other corners.
    pub(super) fn replace(&mut self, t: u32, corners: [u32; 3]) {
        for v in self.triangles[t as usize] {
            self.around[v as usize].retain(|&other| other != t);
        }
        for v in corners {
            self.around[v as usize].push(t);
        }
        self.triangles[t as usize] = corners;
    }
}
