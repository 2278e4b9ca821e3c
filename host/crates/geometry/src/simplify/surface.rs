//! The surface being simplified: vertices, triangles, and which triangles are around each vertex.

use glam::DVec3;

use crate::TriangleMesh;
use crate::search::box_tree::{Bounds, BoxTree, morton_order};
use crate::surface::weld_vertices;

/// Marks a vertex or triangle that does not exist.
pub(super) const NONE: u32 = u32::MAX;

/// A removed triangle.
const GONE: [u32; 3] = [NONE; 3];

/// A welded surface without repeated triangles. Vertices and triangles keep their numbers while others are removed.
#[derive(Debug)]
pub(super) struct Surface {
    /// In units of [`Self::unit`].
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// For each vertex, where in `around` its triangles are listed, and how many there are.
    stars: Vec<[u32; 2]>,
    /// Triangles around vertices, including some that have been removed.
    around: Vec<u32>,
    boxes: BoxTree,
    /// Number of triangles when `boxes` were last built.
    boxed: usize,
    pub(super) live_vertices: usize,
    pub(super) live_triangles: usize,
    /// A power of two that makes the surface about one unit large.
    pub(super) unit: f64,
    /// Centre of the surface.
    pub(super) centre: DVec3,
}

impl Surface {
    /// Merges vertices at one place, and drops triangles with equal corners, repeated triangles, and vertices without a
    /// triangle. Also returns what each given vertex became ([`NONE`] if dropped).
    pub(super) fn new(mesh: &TriangleMesh) -> (Self, Vec<u32>) {
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let unit = unit_of(mesh);
        let place = |welded: u32| DVec3::from(mesh.vertices[weld.representative[welded as usize] as usize]) / unit;
        let mut triangles = distinct(mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])));
        let order = morton_order((0..triangles.len() as u32).collect(), |t| {
            triangles[t as usize].map(place).into_iter().sum::<DVec3>() / 3.0
        });
        triangles = order.into_iter().map(|t| triangles[t as usize]).collect();
        let (mut name, mut positions) = (vec![NONE; weld.representative.len()], Vec::new());
        for triangle in &mut triangles {
            for corner in triangle {
                let welded = *corner as usize;
                if name[welded] == NONE {
                    name[welded] = positions.len() as u32;
                    positions.push(place(*corner));
                }
                *corner = name[welded];
            }
        }
        let given = weld.welded_of.iter().map(|&welded| name[welded as usize]).collect();
        let (stars, around) = stars_of(positions.len(), &triangles);
        let bounds = Bounds::around(&positions);
        let (live_vertices, live_triangles) = (positions.len(), triangles.len());
        let mut surface = Self {
            positions,
            triangles,
            stars,
            around,
            boxes: BoxTree::default(),
            boxed: 0,
            live_vertices,
            live_triangles,
            unit,
            centre: if live_vertices > 0 { 0.5 * bounds.low + 0.5 * bounds.high } else { DVec3::ZERO },
        };
        surface.build_boxes();
        (surface, given)
    }

    pub(super) fn is_alive(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize] != GONE
    }

    /// Triangles at a vertex.
    pub(super) fn star(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let [first, count] = self.stars[vertex as usize].map(|k| k as usize);
        self.around[first..first + count].iter().copied().filter(|&t| self.is_alive(t))
    }

    /// An upper bound on the number of triangles at a vertex, without going through them.
    pub(super) fn star_bound(&self, vertex: u32) -> usize {
        self.stars[vertex as usize][1] as usize
    }

    pub(super) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Twice the area, along the normal.
    pub(super) fn area_vector(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Calls `visit` with every triangle that may reach into boxes for which `keep` holds.
    pub(super) fn visit(&self, keep: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(u32)) {
        self.boxes.visit(keep, |t| {
            if self.is_alive(t) {
                visit(t);
            }
        });
    }

    /// Moves `kept` to `place` and makes it a corner of all triangles of `lost`; triangles with both are removed.
    pub(super) fn collapse(&mut self, kept: u32, lost: u32, place: DVec3) {
        let first = self.around.len();
        for vertex in [kept, lost] {
            let [start, count] = self.stars[vertex as usize].map(|k| k as usize);
            for slot in start..start + count {
                let t = self.around[slot];
                let corners = &mut self.triangles[t as usize];
                if *corners == GONE {
                    continue;
                }
                if corners.contains(&kept) && corners.contains(&lost) {
                    *corners = GONE;
                    self.live_triangles -= 1;
                    continue;
                }
                for corner in corners {
                    if *corner == lost {
                        *corner = kept;
                    }
                }
                self.around.push(t);
            }
        }
        self.stars[kept as usize] = [first as u32, (self.around.len() - first) as u32];
        self.stars[lost as usize] = [0, 0];
        self.positions[kept as usize] = place;
        self.live_vertices -= 1;
        for slot in first..self.around.len() {
            let t = self.around[slot];
            let bounds = Bounds::around(&self.corners(t));
            self.boxes.grow(t, &bounds);
        }
        // Boxes only ever grow, and half of their triangles are gone.
        if 2 * self.live_triangles < self.boxed {
            self.build_boxes();
        }
    }

    fn build_boxes(&mut self) {
        let live = (0..self.triangles.len() as u32).filter(|&t| self.is_alive(t)).collect();
        self.boxes = BoxTree::new(live, self.triangles.len(), |t| Bounds::around(&self.corners(t)));
        self.boxed = self.live_triangles;
    }

    /// The remaining triangles, in the mesh's own unit, and the number of every vertex in that mesh.
    pub(super) fn to_mesh(&self) -> (TriangleMesh, Vec<u32>) {
        let (mut mesh, mut name) = (TriangleMesh::default(), vec![NONE; self.positions.len()]);
        for triangle in self.triangles.iter().filter(|&&t| t != GONE) {
            mesh.triangles.push(triangle.map(|v| {
                if name[v as usize] == NONE {
                    name[v as usize] = mesh.vertices.len() as u32;
                    mesh.vertices.push((self.positions[v as usize] * self.unit).to_array());
                }
                name[v as usize]
            }));
        }
        (mesh, name)
    }
}

/// Multiplying and dividing by a power of two rounds nothing.
fn unit_of(mesh: &TriangleMesh) -> f64 {
    let extent = mesh.bounds().map_or(0.0, |(low, high)| (DVec3::from(high) - DVec3::from(low)).max_element());
    if extent > 0.0 { libm::scalbn(1.0, libm::ilogb(extent).clamp(-900, 900)) } else { 1.0 }
}

fn distinct(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
    let mut keyed: Vec<([u32; 3], u32, [u32; 3])> = triangles
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .enumerate()
        .map(|(index, triangle)| {
            let mut key = triangle;
            key.sort_unstable();
            (key, index as u32, triangle)
        })
        .collect();
    keyed.sort_unstable();
    keyed.dedup_by_key(|(key, ..)| *key);
    keyed.into_iter().map(|(_, _, triangle)| triangle).collect()
}

fn stars_of(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 2]>, Vec<u32>) {
    let mut stars = vec![[0_u32; 2]; vertices];
    triangles.iter().flatten().for_each(|&v| stars[v as usize][1] += 1);
    let mut next = 0;
    for star in &mut stars {
        star[0] = next;
        next += std::mem::take(&mut star[1]);
    }
    let mut around = vec![0; next as usize];
    for (index, triangle) in triangles.iter().enumerate() {
        for &v in triangle {
            let [first, count] = &mut stars[v as usize];
            around[(*first + *count) as usize] = index as u32;
            *count += 1;
        }
    }
    (stars, around)
}
