//! Refining a patch: long edges are split, and edges are flipped until the triangles are Delaunay, so that they become
//! well-shaped and about as large as those around them (Liepa 2003). The rim is not touched.

use std::collections::BTreeSet;

use glam::DVec3;

/// An edge is split if it is so many times as long as those around it: halves are then as far below as it was above.
const LONG: f64 = 1.414;
/// Rounds of splitting; each halves the longest edges.
const SPLITS: usize = 40;
const FLIPS: usize = 60;
/// How often vertices are evened out and edges flipped after that.
const RELAXED: usize = 3;
/// Opposite angles may exceed a straight angle by this before an edge is flipped, so that flips end.
const SLACK: f64 = 1e-6;

/// Triangles of a patch, over local vertices; the first `held` of them belong to what is around it.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    pub(crate) places: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) held: usize,
    /// Wanted length of edges at each vertex.
    pub(crate) sizes: Vec<f64>,
    /// Edges that the surface around has; the patch must not have them too.
    pub(crate) chords: BTreeSet<[u32; 2]>,
}

/// An inner edge and its two triangles.
#[derive(Clone, Copy, Debug)]
struct Inner {
    /// As the first triangle runs.
    ends: [u32; 2],
    /// The two triangles, and their third corners.
    triangles: [u32; 2],
    apexes: [u32; 2],
}

impl Patch {
    /// Splits and flips, and evens out the vertices; returns how many edges were split. Stops early at `most` vertices.
    pub(crate) fn refine(&mut self, most: usize) -> usize {
        let mut splits = 0;
        self.flip();
        for _ in 0..SPLITS {
            let split = if self.places.len() < most { self.split() } else { 0 };
            splits += split;
            if split == 0 {
                break;
            }
            self.flip();
        }
        for _ in 0..RELAXED {
            self.relax(2);
            self.flip();
        }
        splits
    }

    fn inner_edges(&self) -> Vec<Inner> {
        let mut sides: Vec<(u32, u32, bool, u32, u32)> = Vec::with_capacity(3 * self.triangles.len());
        for (index, &[a, b, c]) in self.triangles.iter().enumerate() {
            for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
                sides.push((from.min(to), from.max(to), from > to, index as u32, apex));
            }
        }
        sides.sort_unstable();
        let pairs = sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)).filter(|group| group.len() == 2);
        pairs
            .map(|group| {
                let (first, second) = (group[0], group[1]);
                let ends = if first.2 { [first.1, first.0] } else { [first.0, first.1] };
                Inner { ends, triangles: [first.3, second.3], apexes: [first.4, second.4] }
            })
            .collect()
    }

    fn split(&mut self) -> usize {
        let mut long: Vec<(f64, Inner)> = Vec::new();
        for edge in self.inner_edges() {
            let [a, b] = edge.ends.map(|v| v as usize);
            let wanted = 0.5 * (self.sizes[a] + self.sizes[b]);
            let ratio = self.places[a].distance(self.places[b]) / wanted;
            let doubled = self.chords.contains(&[edge.ends[0].min(edge.ends[1]), edge.ends[0].max(edge.ends[1])]);
            if doubled {
                long.push((f64::INFINITY, edge));
            } else if ratio > LONG {
                long.push((ratio, edge));
            }
        }
        long.sort_by(|(x, e), (y, f)| y.total_cmp(x).then(e.ends.cmp(&f.ends)));
        let mut touched = vec![false; self.triangles.len()];
        let mut count = 0;
        for (_, edge) in long {
            if edge.triangles.iter().any(|&t| touched[t as usize]) {
                continue;
            }
            let [a, b] = edge.ends;
            let new = self.places.len() as u32;
            self.places.push(0.5 * (self.places[a as usize] + self.places[b as usize]));
            self.sizes.push(0.5 * (self.sizes[a as usize] + self.sizes[b as usize]));
            for t in edge.triangles {
                touched[t as usize] = true;
                touched.push(true);
                let old = self.triangles[t as usize];
                self.triangles[t as usize] = old.map(|v| if v == b { new } else { v });
                self.triangles.push(old.map(|v| if v == a { new } else { v }));
            }
            count += 1;
        }
        count
    }

    fn flip(&mut self) -> usize {
        let mut count = 0;
        for _ in 0..FLIPS {
            let edges = self.inner_edges();
            let mut present: BTreeSet<[u32; 2]> = self
                .triangles
                .iter()
                .flat_map(|&[a, b, c]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [a.min(c), a.max(c)]])
                .collect();
            let mut touched = vec![false; self.triangles.len()];
            let before = count;
            for edge in edges {
                let [s, t] = edge.triangles.map(|t| t as usize);
                let [c, d] = edge.apexes;
                let new = [c.min(d), c.max(d)];
                if touched[s] || touched[t] || c == d || present.contains(&new) || self.chords.contains(&new) {
                    continue;
                }
                let [a, b] = edge.ends;
                // s is a, b, c; t is b, a, d.
                let flipped = [[a, d, c], [d, b, c]];
                if self.wants_flip(edge) && self.keeps_side([[a, b, c], [b, a, d]], flipped) {
                    present.remove(&[a.min(b), a.max(b)]);
                    present.insert(new);
                    (self.triangles[s], self.triangles[t]) = (flipped[0], flipped[1]);
                    (touched[s], touched[t]) = (true, true);
                    count += 1;
                }
            }
            if count == before {
                break;
            }
        }
        count
    }

    /// Whether the angles opposite the edge add up to more than a straight angle.
    fn wants_flip(&self, edge: Inner) -> bool {
        let [a, b] = edge.ends.map(|v| self.places[v as usize]);
        let angle = |apex: u32| {
            let apex = self.places[apex as usize];
            let (u, v) = (a - apex, b - apex);
            u.cross(v).length().atan2(u.dot(v))
        };
        edge.apexes.map(angle).iter().sum::<f64>() > std::f64::consts::PI + SLACK
    }

    /// Whether both new triangles face as the old ones do on the whole.
    fn keeps_side(&self, old: [[u32; 3]; 2], new: [[u32; 3]; 2]) -> bool {
        let normal = |t: [u32; 3]| {
            let [a, b, c] = t.map(|v| self.places[v as usize]);
            (b - a).cross(c - a)
        };
        let whole = normal(old[0]) + normal(old[1]);
        new.iter().all(|&t| normal(t).dot(whole) > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_becomes_many_good_triangles() {
        let side = 8;
        let corner = |k: usize| {
            let (quarter, step) = (k / side, (k % side) as f64);
            let full = side as f64;
            match quarter {
                0 => DVec3::new(step, 0.0, 0.0),
                1 => DVec3::new(full, step, 0.0),
                2 => DVec3::new(full - step, full, 0.0),
                _ => DVec3::new(0.0, full - step, 0.0),
            }
        };
        let count = 4 * side;
        let mut patch = Patch {
            places: (0..count).map(corner).collect(),
            // A fan of very bad triangles.
            triangles: (1..count as u32 - 1).map(|k| [0, k, k + 1]).collect(),
            held: count,
            sizes: vec![1.0; count],
            chords: BTreeSet::new(),
        };
        patch.refine(10_000);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| patch.places[v as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        let total: f64 = patch.triangles.iter().map(area).sum();
        assert!((total - 64.0).abs() < 1e-9);
        let angles = patch.triangles.iter().flat_map(|t| {
            let p = t.map(|v| patch.places[v as usize]);
            (0..3).map(move |k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]).to_degrees())
        });
        let smallest = angles.fold(180.0, f64::min);
        assert!(smallest > 15.0, "{smallest}");
        assert!(patch.triangles.len() > 80, "{}", patch.triangles.len());
    }
}
