//! The winding number by expansions: what lies far away is seen as a few moments (Barill, Dickson, Schmidt, Levin
//! and Jacobson 2018, "Fast winding numbers for soups and clouds").

use glam::DVec3;
use rayon::prelude::*;

use crate::turns::{LANES, TriangleBlock, Turns, answer_without_looking, triangle_blocks};
use crate::{MeshError, TriangleHierarchy, TriangleMesh};

/// The approximate winding number: near triangles by their solid angles, far groups of triangles by a Taylor
/// expansion up to second order of the dipole field that they make.
#[derive(Clone, Debug)]
pub struct FastWindingNumber {
    /// Four groups at a time; the first node is the root.
    nodes: Vec<Wide>,
    facets: Vec<TriangleBlock>,
    /// The expansions are kept relative to this point of the mesh ...
    origin: DVec3,
    /// ... in units of one over this, so that single precision holds them whatever the mesh's unit.
    scale: f64,
}

type Few = [f32; LANES];

/// Four groups of triangles, `[coefficient][lane]`.
#[derive(Clone, Copy, Debug)]
struct Wide {
    centre: [Few; 3],
    /// Squared distance from which on the expansion is used; negative in unused lanes, whose moments are zero.
    near: Few,
    /// `∫ n`.
    dipole: [Few; 3],
    /// Coefficients of xx, yy, zz, xy, xz, yz in the trace-free part of `∫ n d`.
    quadrupole: [Few; 6],
    /// Coefficients of xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz in the trace-free part of `∫ n d d`.
    octopole: [Few; 10],
    child: [Child; LANES],
}

#[derive(Clone, Copy, Debug)]
enum Child {
    Node(u32),
    Facets(u32),
}

/// Queries further away than this many sizes of the mesh see its total area vector only.
const FAR_IN_SIZES: f64 = 1e4;

impl FastWindingNumber {
    /// Expansions are used from this many radii of a group on, unless told otherwise. The paper takes 2 with radii that are
    /// too large; ours reach exactly to the farthest corner, and 2.4 of them keep the error below 0.003 on all test
    /// meshes (2 gives 0.007).
    pub const OPENING: f64 = 2.4;

    /// Builds the tree of expansions with an opening parameter of [`Self::OPENING`].
    pub fn precompute(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        Self::precompute_with_opening(mesh, Self::OPENING)
    }

    /// Builds the tree of expansions. `opening` is the distance from a group's centre in radii of the group from
    /// which on its expansion is used; it is at least 1, where expansions begin to converge, and not a number counts
    /// as [`Self::OPENING`].
    pub fn precompute_with_opening(mesh: &TriangleMesh, opening: f64) -> Result<Self, MeshError> {
        let boxes = TriangleHierarchy::new(mesh)?;
        let (low, high) = boxes.bounds_of(0).ok_or(MeshError::Empty)?;
        let size = 0.5 * low.distance(high);
        let (origin, scale) = (0.5 * low + 0.5 * high, if size > 0.0 { 1.0 / size } else { 1.0 });
        let scale = if scale.is_finite() { scale } else { 1.0 };
        let opening = if opening.is_nan() { Self::OPENING } else { opening.clamp(1.0, 1e6) };
        let fast = Self { nodes: Vec::new(), facets: Vec::new(), origin, scale };
        let mut builder = Builder { boxes, opening, fast };
        builder.add(&[0]);
        Ok(builder.fast)
    }

    /// The winding number at `point` (mesh unit), NaN where `point` is not finite, and on the surface that of one
    /// side or the mean of both.
    pub fn evaluate(&self, point: [f64; 3]) -> f64 {
        self.evaluate_with(point, &mut Vec::with_capacity(64))
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 3]]) -> Vec<f64> {
        points.par_iter().map_init(|| Vec::with_capacity(64), |stack, &p| self.evaluate_with(p, stack)).collect()
    }

    fn evaluate_with(&self, point: [f64; 3], stack: &mut Vec<u32>) -> f64 {
        if let Some(answer) = answer_without_looking(&point) {
            return answer;
        }
        let q = (DVec3::from(point) - self.origin) * self.scale;
        if q.abs().max_element() > FAR_IN_SIZES {
            return self.dipole_alone(q);
        }
        let q = [q.x as f32, q.y as f32, q.z as f32];
        let mut turns = Turns::new();
        let mut far = [0.0; LANES];
        let mut near_facets = false;
        stack.clear();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index as usize) else { continue };
            let (values, is_near) = expand(node, q);
            for l in 0..LANES {
                far[l] += values[l];
            }
            for l in 0..LANES {
                if !is_near[l] {
                    continue;
                }
                match node.child[l] {
                    Child::Node(child) => stack.push(child),
                    Child::Facets(block) => {
                        near_facets = true;
                        turns.add_triangles(&self.facets[block as usize], point);
                    }
                }
            }
        }
        let near = if near_facets { turns.total() } else { 0.0 };
        near + far.iter().map(|&f| f64::from(f)).sum::<f64>() / (4.0 * std::f64::consts::PI)
    }

    /// The root's dipole alone, at a distance where nothing else has a weight.
    fn dipole_alone(&self, q: DVec3) -> f64 {
        let Some(root) = self.nodes.first() else { return 0.0 };
        let lane = |few: &[Few; 3]| DVec3::new(f64::from(few[0][0]), f64::from(few[1][0]), f64::from(few[2][0]));
        let offset = lane(&root.centre) - q;
        let (length, dipole) = (offset.length(), lane(&root.dipole));
        (dipole.dot(offset / length) / length / length) / (4.0 * std::f64::consts::PI)
    }
}

/// The solid angles of four groups by their expansions, zero for those too near, and which those are.
#[inline]
fn expand(node: &Wide, q: [f32; 3]) -> (Few, [bool; LANES]) {
    let (mut values, mut is_near) = ([0.0; LANES], [false; LANES]);
    for l in 0..LANES {
        let (x, y, z) = (node.centre[0][l] - q[0], node.centre[1][l] - q[1], node.centre[2][l] - q[2]);
        let squared = x * x + y * y + z * z;
        is_near[l] = squared <= node.near[l];
        let inverse = 1.0 / squared.max(1e-30).sqrt();
        let (x, y, z) = (x * inverse, y * inverse, z * inverse);
        let (d, m, o) = (&node.dipole, &node.quadrupole, &node.octopole);
        let dipole = d[0][l] * x + d[1][l] * y + d[2][l] * z;
        let quadrupole =
            x * (m[0][l] * x + m[3][l] * y + m[4][l] * z) + y * (m[1][l] * y + m[5][l] * z) + m[2][l] * z * z;
        let octopole = x
            * (x * (o[0][l] * x + o[1][l] * y + o[2][l] * z) + y * (o[3][l] * y + o[4][l] * z) + o[5][l] * z * z)
            + y * (y * (o[6][l] * y + o[7][l] * z) + o[8][l] * z * z)
            + o[9][l] * z * z * z;
        let value = inverse * inverse * (dipole + inverse * (quadrupole + inverse * octopole));
        values[l] = if is_near[l] { 0.0 } else { value };
    }
    (values, is_near)
}

struct Builder {
    boxes: TriangleHierarchy,
    opening: f64,
    fast: FastWindingNumber,
}

impl Builder {
    /// Appends a wide node over up to four nodes of the binary tree and everything below; returns its index.
    fn add(&mut self, groups: &[usize]) -> u32 {
        let index = self.fast.nodes.len();
        let mut wide = Wide::empty();
        for (l, &group) in groups.iter().enumerate().take(LANES) {
            self.moments(group).store(&mut wide, l);
        }
        self.fast.nodes.push(wide);
        for (l, &group) in groups.iter().enumerate().take(LANES) {
            let below = self.grandchildren(group);
            let child = if below.is_empty() {
                let corners: Vec<_> =
                    self.boxes.slots_of(group).map(|s| self.boxes.corners_in(s).map(|p| p.to_array())).collect();
                self.fast.facets.extend(triangle_blocks(&corners).first().copied());
                Child::Facets(self.fast.facets.len() as u32 - 1)
            } else {
                Child::Node(self.add(&below))
            };
            self.fast.nodes[index].child[l] = child;
        }
        index as u32
    }

    /// The nodes two steps below a node of the binary tree, or one step where there is no second.
    fn grandchildren(&self, node: usize) -> Vec<usize> {
        let children = |node: usize| self.boxes.second_child(node).map(|second| [node + 1, second]);
        let Some(pair) = children(node) else { return Vec::new() };
        pair.into_iter().flat_map(|child| children(child).map_or(vec![child], Vec::from)).collect()
    }

    fn moments(&self, group: usize) -> Moments {
        let scaled = |p: DVec3| (p - self.fast.origin) * self.fast.scale;
        let slots = self.boxes.slots_of(group);
        let triangles = || slots.clone().map(|s| self.boxes.corners_in(s).map(scaled));
        let (mut centre, mut total, mut plain) = (DVec3::ZERO, 0.0, DVec3::ZERO);
        for [a, b, c] in triangles() {
            let (area, middle) = (0.5 * (b - a).cross(c - a).length(), (a + b + c) / 3.0);
            centre += area * middle;
            total += area;
            plain += middle;
        }
        let centre = if total > 0.0 { centre / total } else { plain / slots.len().max(1) as f64 };
        // The expansion is made around the centre as single precision will know it.
        let centre = centre.as_vec3().as_dvec3();
        let mut moments = Moments { centre, near: 0.0, n: DVec3::ZERO, nd: [[0.0; 3]; 3], ndd: [[[0.0; 3]; 3]; 3] };
        let mut radius_squared: f64 = 0.0;
        for corners in triangles() {
            let [a, b, c] = corners.map(|p| p - centre);
            radius_squared = radius_squared.max(a.length_squared()).max(b.length_squared()).max(c.length_squared());
            moments.add_triangle(a, b, c);
        }
        moments.near = self.opening * self.opening * radius_squared;
        moments
    }
}

/// Moments of area vectors `n` around a centre.
struct Moments {
    centre: DVec3,
    near: f64,
    n: DVec3,
    nd: [[f64; 3]; 3],
    ndd: [[[f64; 3]; 3]; 3],
}

impl Moments {
    fn add_triangle(&mut self, a: DVec3, b: DVec3, c: DVec3) {
        let (n, middle) = (0.5 * (b - a).cross(c - a), (a + b + c) / 3.0);
        self.n += n;
        for j in 0..3 {
            for k in 0..3 {
                // The mean of d·d over a triangle, exactly.
                let mean = (a[j] * a[k] + b[j] * b[k] + c[j] * c[k] + 9.0 * middle[j] * middle[k]) / 12.0;
                self.nd[j][k] += n[j] * middle[k];
                for i in 0..3 {
                    self.ndd[i][j][k] += n[i] * mean;
                }
            }
        }
    }

    /// Symmetrises, takes the traces out (derivatives of a harmonic function are blind to them) and multiplies by
    /// what the derivatives of `r/r³` leave: 1, -3 and 15/2.
    fn store(&self, wide: &mut Wide, l: usize) {
        let t = &self.ndd;
        let trace = (self.nd[0][0] + self.nd[1][1] + self.nd[2][2]) / 3.0;
        let second =
            |i: usize, j: usize| -3.0 * (0.5 * (self.nd[i][j] + self.nd[j][i]) - if i == j { trace } else { 0.0 });
        let symmetric = |i: usize, j: usize, k: usize| (t[i][j][k] + t[j][i][k] + t[k][i][j]) / 3.0;
        let traces: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| symmetric(i, i, k)).sum());
        let third = |i: usize, j: usize, k: usize| {
            let on = |a: usize, b: usize, c: usize| if a == b { traces[c] } else { 0.0 };
            7.5 * (symmetric(i, j, k) - 0.2 * (on(i, j, k) + on(i, k, j) + on(j, k, i)))
        };
        let quadrupole =
            [second(0, 0), second(1, 1), second(2, 2), 2.0 * second(0, 1), 2.0 * second(0, 2), 2.0 * second(1, 2)];
        let octopole = [
            third(0, 0, 0),
            3.0 * third(0, 0, 1),
            3.0 * third(0, 0, 2),
            3.0 * third(0, 1, 1),
            6.0 * third(0, 1, 2),
            3.0 * third(0, 2, 2),
            third(1, 1, 1),
            3.0 * third(1, 1, 2),
            3.0 * third(1, 2, 2),
            third(2, 2, 2),
        ];
        for k in 0..3 {
            wide.centre[k][l] = self.centre[k] as f32;
            wide.dipole[k][l] = self.n[k] as f32;
        }
        wide.near[l] = self.near as f32;
        (0..6).for_each(|k| wide.quadrupole[k][l] = quadrupole[k] as f32);
        (0..10).for_each(|k| wide.octopole[k][l] = octopole[k] as f32);
    }
}

impl Wide {
    const fn empty() -> Self {
        let none = [0.0; LANES];
        Self {
            centre: [none; 3],
            near: [-1.0; LANES],
            dipole: [none; 3],
            quadrupole: [none; 6],
            octopole: [none; 10],
            child: [Child::Facets(0); LANES],
        }
    }
}
