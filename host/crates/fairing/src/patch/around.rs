//! The surface around a patch: its rims, some rings of triangles beyond them, and the directions in which it goes on.

use std::collections::{BTreeMap, BTreeSet};

use armature_geometry::surface::Fans;
use glam::DVec3;

use super::bridge::Rim;

/// Local numbers: rims first, in order, then what is around them.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    /// Of every local vertex.
    pub(crate) places: Vec<DVec3>,
    /// The mesh's vertex of every local one.
    pub(crate) vertices: Vec<u32>,
    /// Triangles outside the patch, in local numbers.
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) rims: Vec<Rim>,
    /// Of every rim vertex, the unit direction in which the surface goes on outside, and its unit normal.
    pub(crate) frames: Vec<(DVec3, DVec3)>,
    /// Edges between rim vertices that the surface has, other than those of the rim.
    pub(crate) chords: BTreeSet<[u32; 2]>,
}

impl Around {
    /// Takes `layers` rings of triangles around rims of distinct vertices.
    pub(crate) fn of(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        fans: &Fans,
        rims: &[Vec<u32>],
        layers: usize,
    ) -> Self {
        let mut vertices: Vec<u32> = rims.iter().flatten().copied().collect();
        let rim_count = vertices.len();
        let mut local: BTreeMap<u32, u32> = vertices.iter().enumerate().map(|(k, &v)| (v, k as u32)).collect();
        let mut taken = BTreeSet::new();
        let mut from = 0;
        for _ in 0..layers.max(1) {
            let to = vertices.len();
            for k in from..to {
                for &t in fans.of(vertices[k] as usize) {
                    taken.insert(t);
                    for v in triangles[t as usize] {
                        local.entry(v).or_insert_with(|| {
                            vertices.push(v);
                            vertices.len() as u32 - 1
                        });
                    }
                }
            }
            from = to;
        }
        let outside: Vec<[u32; 3]> = taken.iter().map(|&t| triangles[t as usize].map(|v| local[&v])).collect();
        let places: Vec<DVec3> = vertices.iter().map(|&v| positions[v as usize]).collect();
        let mut around = Self {
            places,
            vertices,
            triangles: outside,
            rims: Vec::new(),
            frames: Vec::new(),
            chords: BTreeSet::new(),
        };
        let mut beyond: BTreeMap<[u32; 2], (DVec3, DVec3)> = BTreeMap::new();
        for &[a, b, c] in &around.triangles {
            for [from, to, apex] in [[a, b, c], [b, c, a], [c, a, b]] {
                // A patch runs along the edge the other way.
                beyond.insert([to, from], around.directions(from, to, apex));
                if (from as usize) < rim_count && (to as usize) < rim_count {
                    around.chords.insert([from.min(to), from.max(to)]);
                }
            }
        }
        let mut first = 0;
        around.frames = vec![(DVec3::ZERO, DVec3::ZERO); rim_count];
        for rim in rims {
            let count = rim.len() as u32;
            let mut sides = Vec::new();
            for k in 0..count {
                let edge = [first + k, first + (k + 1) % count];
                around.chords.remove(&[edge[0].min(edge[1]), edge[0].max(edge[1])]);
                let side = beyond.get(&edge).copied();
                if let Some((out, normal)) = side {
                    for end in edge {
                        around.frames[end as usize].0 += out;
                        around.frames[end as usize].1 += normal;
                    }
                }
                sides.push(side.map(|(_, normal)| normal).filter(|n| *n != DVec3::ZERO));
            }
            around.rims.push(Rim { vertices: (first..first + count).collect(), beyond: sides });
            first += count;
        }
        for (out, normal) in &mut around.frames {
            *normal = normal.normalize_or_zero();
            *out = (*out - *normal * out.dot(*normal)).normalize_or_zero();
        }
        around
    }

    /// Away from the edge, into the triangle; and the triangle's normal.
    fn directions(&self, from: u32, to: u32, apex: u32) -> (DVec3, DVec3) {
        let [a, b, c] = [from, to, apex].map(|v| self.places[v as usize]);
        let along = (b - a).normalize_or_zero();
        let inward = (c - a) - along * (c - a).dot(along);
        (inward.normalize_or_zero(), (b - a).cross(c - a).normalize_or_zero())
    }

    /// Edges of `triangles` with one triangle, as it runs along them, and the unit direction that leads out of it.
    pub(crate) fn borders(places: &[DVec3], triangles: &[[u32; 3]]) -> Vec<([u32; 2], DVec3)> {
        let sides: BTreeSet<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        let mut found = Vec::new();
        for &[a, b, c] in triangles {
            for [from, to, apex] in [[a, b, c], [b, c, a], [c, a, b]] {
                if !sides.contains(&[to, from]) {
                    let [p, q, r] = [from, to, apex].map(|v| places[v as usize]);
                    let along = (q - p).normalize_or_zero();
                    let inward = (r - p) - along * (r - p).dot(along);
                    found.push(([from, to], -inward.normalize_or_zero()));
                }
            }
        }
        found.sort_unstable_by_key(|(edge, _)| *edge);
        found.dedup_by_key(|(edge, _)| *edge);
        found
    }
}
