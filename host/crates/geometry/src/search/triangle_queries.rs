//! Where a segment meets a triangle, and the closest places to a point on segments and triangles.

use glam::DVec3;

/// The point of the segment from `a` to `b` closest to `query`; `a` where they coincide.
pub fn closest_on_segment(query: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let along = b - a;
    let squared = along.length_squared();
    if squared > 0.0 { a + along * ((query - a).dot(along) / squared).clamp(0.0, 1.0) } else { a }
}

/// By the triangle's Voronoi regions (Ericson, Real-Time Collision Detection, 5.1.5); a degenerate triangle is
/// treated as its edges.
pub(crate) fn closest_on_triangle(query: DVec3, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    let normal = (*b - *a).cross(*c - *a);
    let squared = normal.length_squared();
    if squared > 0.0 {
        let offset = query - *a;
        let gamma = (*b - *a).cross(offset).dot(normal) / squared;
        let beta = offset.cross(*c - *a).dot(normal) / squared;
        if beta >= 0.0 && gamma >= 0.0 && beta + gamma <= 1.0 {
            return *a + (*b - *a) * beta + (*c - *a) * gamma;
        }
    }
    [(a, b), (b, c), (c, a)]
        .map(|(from, to)| closest_on_segment(query, *from, *to))
        .into_iter()
        .min_by(|p, q| p.distance_squared(query).total_cmp(&q.distance_squared(query)))
        .unwrap_or(*a)
}

/// The shares of a triangle's corners in a point of it: none negative, sum 1. A triangle without area is treated as its
/// longest edge.
pub fn barycentric(point: DVec3, [a, b, c]: &[DVec3; 3]) -> [f64; 3] {
    let normal = (*b - *a).cross(*c - *a);
    let parts = [(b, c), (c, a), (a, b)].map(|(p, q)| (*p - point).cross(*q - point).dot(normal).max(0.0));
    let sum = parts.iter().sum::<f64>();
    if sum > 0.0 && sum.is_finite() {
        return parts.map(|part| part / sum);
    }
    let edges = [(0, 1, *a, *b), (1, 2, *b, *c), (2, 0, *c, *a)];
    let longest = edges.iter().max_by(|x, y| x.2.distance_squared(x.3).total_cmp(&y.2.distance_squared(y.3)));
    let mut at = [1.0, 0.0, 0.0];
    if let Some(&(i, j, p, q)) = longest.filter(|(_, _, p, q)| p.distance_squared(*q) > 0.0) {
        let along = ((point - p).dot(q - p) / p.distance_squared(q)).clamp(0.0, 1.0);
        at = [0.0; 3];
        (at[i], at[j]) = (1.0 - along, along);
    }
    at
}

/// Möller and Trumbore's test on an unnormalised direction; edges count as inside.
pub(crate) fn segment_meets_triangle(from: DVec3, direction: DVec3, [a, b, c]: &[DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (*b - *a, *c - *a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    // Parallel up to rounding: the products above carry an error of this order.
    let rounding = 1e-14 * direction.length() * ab.length() * ac.length();
    if determinant.abs() <= rounding {
        return None;
    }
    let inverse = 1.0 / determinant;
    let s = from - *a;
    let q = s.cross(ab);
    let (u, v, along) = (s.dot(p) * inverse, direction.dot(q) * inverse, ac.dot(q) * inverse);
    // A hair wider than the triangle, so that nothing slips through between two that share an edge.
    let hair = 1e-12;
    let inside = u >= -hair && v >= -hair && u + v <= 1.0 + hair && (0.0..=1.0).contains(&along);
    inside.then_some(along)
}
