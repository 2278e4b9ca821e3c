//! Meshes of the unit square, with or without a margin (thesis, figures 3.8 and 3.11).

use spade::handles::FixedVertexHandle;
use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation as _};

/// A planar mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flat {
    /// n×2 positions.
    pub vertices: Vec<[f64; 2]>,
    /// m×3 indices, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
}

/// How a square is cut into triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Family {
    /// Squares halved along the same diagonal.
    Regular,
    /// Squares halved along diagonals that alternate: vertices of valence four and eight.
    UnionJack,
    /// Squares with a vertex in the middle.
    Crossed,
    /// Vertices of a grid moved at random, triangulated (Delaunay), with vertices added until no angle is smaller than this
    /// (degrees).
    Random {
        /// Smallest angle.
        degrees: f64,
        /// Which random mesh.
        seed: u64,
    },
}

/// How far vertices are moved at random, of a cell.
const DART: f64 = 0.45;

impl Family {
    /// The unit square with `cells` to a side, and `margin` more on each side.
    pub fn mesh(self, cells: usize, margin: usize) -> Flat {
        let (low, high) = (-(margin as i64), (cells + margin) as i64);
        let side = (high - low + 1) as u32;
        let step = 1.0 / cells as f64;
        let at = |i: u32, j: u32| {
            [i, j].map(|k| if k as i64 + low == cells as i64 { 1.0 } else { (k as i64 + low) as f64 * step })
        };
        let mut flat = Flat::default();
        if let Self::Random { degrees, seed } = self {
            return random(side, at, step, degrees, seed);
        }
        flat.vertices = (0..side).flat_map(|j| (0..side).map(move |i| at(i, j))).collect();
        for j in 0..side - 1 {
            for i in 0..side - 1 {
                let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| j * side + i);
                match self {
                    Self::Crossed => {
                        let middle = flat.vertices.len() as u32;
                        let (p, q) = (flat.vertices[a as usize], flat.vertices[c as usize]);
                        flat.vertices.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                        flat.triangles.extend([[a, b, middle], [b, c, middle], [c, d, middle], [d, a, middle]]);
                    }
                    Self::UnionJack if (i + j) % 2 == 1 => flat.triangles.extend([[a, b, d], [b, c, d]]),
                    _ => flat.triangles.extend([[a, b, c], [a, c, d]]),
                }
            }
        }
        flat
    }
}

/// A sequence of numbers from 0 to 1 that looks random (`SplitMix64`).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn random(side: u32, at: impl Fn(u32, u32) -> [f64; 2], step: f64, degrees: f64, seed: u64) -> Flat {
    let mut dice = Dice(seed);
    let mut points = Vec::new();
    for j in 0..side {
        for i in 0..side {
            let outer = i == 0 || j == 0 || i == side - 1 || j == side - 1;
            let [x, y] = at(i, j);
            let moved = [x, y].map(|c| if outer { c } else { c + DART * step * (2.0 * dice.roll() - 1.0) });
            points.push(Point2::new(moved[0], moved[1]));
        }
    }
    let rim: Vec<u32> = (0..side)
        .chain((1..side).map(|j| j * side + side - 1))
        .chain((0..side - 1).rev().map(|i| (side - 1) * side + i))
        .chain((1..side - 1).rev().map(|j| j * side))
        .collect();
    let count = points.len();
    let ring = |k: usize| [rim[k] as usize, rim[(k + 1) % rim.len()] as usize];
    let segments = (0..rim.len()).map(ring).collect();
    // Grid points moved by less than half a cell are distinct, and the rim does not cross itself.
    let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::bulk_load_cdt(points, segments).unwrap_or_default();
    let limits = RefinementParameters::new()
        .with_angle_limit(AngleLimit::from_deg(degrees))
        .with_max_additional_vertices(20 * count)
        .with_min_required_area(1e-6 * step * step);
    cdt.refine(limits);
    let place = |handle: FixedVertexHandle| handle.index() as u32;
    Flat {
        vertices: cdt.vertices().map(|v| [v.position().x, v.position().y]).collect(),
        triangles: cdt.inner_faces().map(|face| face.vertices().map(|v| place(v.fix()))).collect(),
    }
}
