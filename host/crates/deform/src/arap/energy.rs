//! The edge sets of as-rigid-as-possible energies (thesis eq. 7.4 and figure 7.5).

/// Which edges share a local rotation; the kind of elements the shape has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArapEnergy<'a> {
    /// Triangles in the plane z = 0, one rotation about z per triangle (Liu et al. 2008). The positions' z is ignored.
    PlanarTriangles(&'a [[u32; 3]]),
    /// A surface, one rotation per vertex for the edges that meet there (Sorkine and Alexa 2007).
    Spokes(&'a [[u32; 3]]),
    /// A surface, one rotation per vertex for all edges of its triangles (Chao et al. 2010): a thin shell.
    SpokesAndRims(&'a [[u32; 3]]),
    /// A volume, one rotation per tetrahedron (Chao et al. 2010).
    Tetrahedra(&'a [[u32; 4]]),
}

/// One term `c ‖(v'_i − v'_j) − R_set (v_i − v_j)‖²`.
#[derive(Clone, Copy, Debug)]
pub(super) struct SetEdge {
    pub(super) set: u32,
    pub(super) ends: [u32; 2],
    pub(super) weight: f64,
}

#[derive(Clone, Debug)]
pub(super) struct EdgeSets {
    pub(super) edges: Vec<SetEdge>,
    /// The vertices whose mean weights represent a set: the vertex itself, or an element's corners.
    pub(super) corners: Vec<[u32; 4]>,
    pub(super) corner_count: usize,
    /// One mass per vertex; they sum to one.
    pub(super) mass: Vec<f64>,
    /// Elements without area or volume, which are ignored.
    pub(super) degenerate: usize,
}

/// Elements whose area or volume is smaller than this fraction of what their longest edge would allow have no angles.
const DEGENERATE: f64 = 1e-12;

const OPPOSITE: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];
/// The six edges of a tetrahedron, each followed by the opposite one.
const TETRAHEDRON: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];

impl ArapEnergy<'_> {
    pub(super) fn element_count(&self) -> usize {
        match self {
            Self::PlanarTriangles(t) | Self::Spokes(t) | Self::SpokesAndRims(t) => t.len(),
            Self::Tetrahedra(t) => t.len(),
        }
    }

    /// Zero-based element and vertex of the first index that is out of range.
    pub(super) fn out_of_range(&self, vertex_count: usize) -> Option<(usize, u32)> {
        fn first<const K: usize>(elements: &[[u32; K]], count: usize) -> Option<(usize, u32)> {
            let all = elements.iter().enumerate().flat_map(|(e, corners)| corners.iter().map(move |&v| (e, v)));
            all.into_iter().find(|&(_, v)| v as usize >= count)
        }
        match self {
            Self::PlanarTriangles(t) | Self::Spokes(t) | Self::SpokesAndRims(t) => first(t, vertex_count),
            Self::Tetrahedra(t) => first(t, vertex_count),
        }
    }

    /// Energies of surfaces grow with the square of lengths, those of volumes with the cube.
    pub(super) fn length_power(&self) -> i32 {
        if matches!(self, Self::Tetrahedra(_)) { 3 } else { 2 }
    }

    pub(super) fn is_planar(&self) -> bool {
        matches!(self, Self::PlanarTriangles(_))
    }

    pub(super) fn edge_sets(&self, positions: &[[f64; 3]]) -> EdgeSets {
        let mut sets = EdgeSets {
            edges: Vec::new(),
            corners: Vec::new(),
            corner_count: 1,
            mass: vec![0.0; positions.len()],
            degenerate: 0,
        };
        match self {
            Self::PlanarTriangles(triangles) => {
                sets.corner_count = 3;
                sets.corners = triangles.iter().map(|&[a, b, c]| [a, b, c, a]).collect();
                sets.add_triangles(positions, triangles, |element, _| [Some(element), None, None]);
            }
            Self::Spokes(triangles) => {
                sets.corners = (0..positions.len() as u32).map(|v| [v; 4]).collect();
                sets.add_triangles(positions, triangles, |_, [i, j, _]| [Some(i), Some(j), None]);
            }
            Self::SpokesAndRims(triangles) => {
                sets.corners = (0..positions.len() as u32).map(|v| [v; 4]).collect();
                sets.add_triangles(positions, triangles, |_, corners| corners.map(Some));
            }
            Self::Tetrahedra(tetrahedra) => {
                sets.corner_count = 4;
                sets.corners = tetrahedra.to_vec();
                sets.add_tetrahedra(positions, tetrahedra);
            }
        }
        let total: f64 = sets.mass.iter().sum();
        let even = 1.0 / positions.len() as f64;
        sets.mass.iter_mut().for_each(|m| *m = if total > 0.0 { *m / total } else { even });
        sets
    }
}

impl EdgeSets {
    /// `sets_of(triangle, [i, j, opposite])` lists the sets an edge belongs to.
    fn add_triangles(
        &mut self,
        positions: &[[f64; 3]],
        triangles: &[[u32; 3]],
        sets_of: impl Fn(u32, [u32; 3]) -> [Option<u32>; 3],
    ) {
        for (element, triangle) in triangles.iter().enumerate() {
            let p = triangle.map(|v| positions[v as usize]);
            let doubled_area = length(cross(minus(p[1], p[0]), minus(p[2], p[0])));
            let longest = OPPOSITE.iter().fold(0.0_f64, |l, &[a, b]| l.max(squared(minus(p[a], p[b]))));
            if doubled_area <= DEGENERATE * longest {
                self.degenerate += 1;
                continue;
            }
            for (corner, [a, b]) in OPPOSITE.into_iter().enumerate() {
                self.mass[triangle[corner] as usize] += doubled_area;
                let cotangent = dot(minus(p[a], p[corner]), minus(p[b], p[corner])) / doubled_area;
                let ends = [triangle[a], triangle[b]];
                for set in sets_of(element as u32, [ends[0], ends[1], triangle[corner]]).into_iter().flatten() {
                    self.edges.push(SetEdge { set, ends, weight: 0.5 * cotangent });
                }
            }
        }
    }

    fn add_tetrahedra(&mut self, positions: &[[f64; 3]], tetrahedra: &[[u32; 4]]) {
        for (element, tetrahedron) in tetrahedra.iter().enumerate() {
            let p = tetrahedron.map(|v| positions[v as usize]);
            let sixfold = dot(minus(p[1], p[0]), cross(minus(p[2], p[0]), minus(p[3], p[0]))).abs();
            let longest = TETRAHEDRON.iter().fold(0.0_f64, |l, &[a, b, ..]| l.max(squared(minus(p[a], p[b]))));
            if sixfold <= DEGENERATE * longest * longest.sqrt() {
                self.degenerate += 1;
                continue;
            }
            for [i, j, k, l] in TETRAHEDRON {
                // Length times cotangent of the dihedral angle at the opposite edge, from the normals there.
                let axis = minus(p[l], p[k]);
                let normals = dot(cross(axis, minus(p[i], p[k])), cross(axis, minus(p[j], p[k])));
                let ends = [tetrahedron[i], tetrahedron[j]];
                self.edges.push(SetEdge { set: element as u32, ends, weight: normals / (6.0 * sixfold) });
            }
            tetrahedron.iter().for_each(|&v| self.mass[v as usize] += sixfold);
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn squared(a: [f64; 3]) -> f64 {
    dot(a, a)
}

fn length(a: [f64; 3]) -> f64 {
    squared(a).sqrt()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
