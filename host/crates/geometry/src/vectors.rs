//! Lengths, areas and volumes of elements, in any dimension where they have one.

use glam::DVec3;

/// A triangle counts as degenerate if twice its area is below this times its longest edge squared; its area is raised
/// to that bound, so that its cotangents stay finite. The same number times the longest edge cubed bounds six times a
/// tetrahedron's volume. Far below any shape that a mesher makes, far above rounding in f64.
pub(crate) const DEGENERATE: f64 = 1e-10;

pub(crate) fn difference<const D: usize>(to: [f64; D], from: [f64; D]) -> [f64; D] {
    std::array::from_fn(|k| to[k] - from[k])
}

pub(crate) fn dot<const D: usize>(u: [f64; D], v: [f64; D]) -> f64 {
    u.iter().zip(&v).map(|(x, y)| x * y).sum()
}

/// Area of the parallelogram over `u` and `v`: the length of their cross product, in any dimension.
pub(crate) fn doubled_area<const D: usize>(u: [f64; D], v: [f64; D]) -> f64 {
    let mut sum = 0.0;
    for i in 0..D {
        for j in i + 1..D {
            let minor = u[i] * v[j] - u[j] * v[i];
            sum += minor * minor;
        }
    }
    sum.sqrt()
}

/// Area of a triangle with these sides, by Kahan's arrangement of Heron's formula, which keeps its precision for
/// needles and caps; zero if they violate the triangle inequality.
pub(crate) fn area_of_lengths(mut sides: [f64; 3]) -> f64 {
    sides.sort_unstable_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    0.25 * product.max(0.0).sqrt()
}

/// The positions of some vertices.
pub(crate) fn places<const K: usize>(vertices: &[[f64; 3]], of: [u32; K]) -> [DVec3; K] {
    of.map(|v| DVec3::from(vertices[v as usize]))
}

/// Six times the volume of a tetrahedron, positive if its corners are oriented so.
pub(crate) fn six_volumes([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot((c - a).cross(d - a))
}

/// The longest edge of a tetrahedron.
pub(crate) fn longest_edge(p: [DVec3; 4]) -> f64 {
    (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max)
}

/// Whether the smallest height of a tetrahedron is at most `height` of its longest edge.
pub(crate) fn is_flatter(p: [DVec3; 4], height: f64) -> bool {
    // The smallest height is over the largest facet.
    let doubled = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
    let largest = (0..4).map(|k| doubled([1, 2, 3].map(|step| p[(k + step) % 4]))).fold(0.0, f64::max);
    six_volumes(p) <= height * longest_edge(p) * largest
}
