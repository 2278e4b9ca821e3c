//! Quadric errors (Garland and Heckbert 1997), plus how far a vertex is from everything it represents.

use glam::{DMat3, DVec3};

/// What a vertex of the coarse surface represents: weighted planes and weighted points, relative to a common origin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// `∑ w n nᵀ`: xx, yy, zz, xy, xz, yz.
    a: [f64; 6],
    /// `-∑ w (n·p) n`.
    b: DVec3,
    /// `∑ w (n·p)²`.
    c: f64,
    /// `∑ w` of planes.
    plane_weight: f64,
    /// `∑ w p` of points.
    first: DVec3,
    /// `∑ w p²` of points.
    second: f64,
    /// `∑ w` of points.
    point_weight: f64,
}

impl Quadric {
    /// Adds the squared distance from the plane through `p` with unit normal `n`, `weight` times.
    pub(super) fn add_plane(&mut self, n: DVec3, p: DVec3, weight: f64) {
        let d = n.dot(p);
        let entries = [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z];
        for (a, entry) in self.a.iter_mut().zip(entries) {
            *a += weight * entry;
        }
        self.b -= weight * d * n;
        self.c += weight * d * d;
        self.plane_weight += weight;
    }

    /// Adds the squared distance from `p`, `weight` times.
    pub(super) fn add_point(&mut self, p: DVec3, weight: f64) {
        self.first += weight * p;
        self.second += weight * p.length_squared();
        self.point_weight += weight;
    }

    pub(super) fn joined(&self, other: &Self) -> Self {
        Self {
            a: std::array::from_fn(|k| self.a[k] + other.a[k]),
            b: self.b + other.b,
            c: self.c + other.c,
            plane_weight: self.plane_weight + other.plane_weight,
            first: self.first + other.first,
            second: self.second + other.second,
            point_weight: self.point_weight + other.point_weight,
        }
    }

    /// Weighted squared distances of `x` from planes and points.
    pub(super) fn cost(&self, x: DVec3) -> f64 {
        let points = self.point_weight * x.length_squared() - 2.0 * self.first.dot(x) + self.second;
        self.plane_cost(x) + points.max(0.0)
    }

    /// Root of the mean squared distance of `x` from the planes.
    pub(super) fn distance(&self, x: DVec3) -> f64 {
        if self.plane_weight > 0.0 { (self.plane_cost(x) / self.plane_weight).sqrt() } else { 0.0 }
    }

    fn plane_cost(&self, x: DVec3) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        let quadratic =
            xx * x.x * x.x + yy * x.y * x.y + zz * x.z * x.z + 2.0 * (xy * x.x * x.y + xz * x.x * x.z + yz * x.y * x.z);
        (quadratic + 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// Where the cost is least; `None` if the points have so little weight that this is ill-conditioned.
    pub(super) fn best_place(&self) -> Option<DVec3> {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        let w = self.point_weight;
        let matrix = DMat3::from_cols_array(&[xx + w, xy, xz, xy, yy + w, yz, xz, yz, zz + w]);
        let determinant = matrix.determinant();
        let size = xx + yy + zz + w;
        if determinant <= 1e-12 * size * size * size {
            return None;
        }
        let place = matrix.inverse() * (self.first - self.b);
        place.is_finite().then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_the_best_place() {
        let corner = DVec3::new(0.3, -0.2, 0.7);
        let mut quadric = Quadric::default();
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            quadric.add_plane(axis, corner + 5.0 * axis.any_orthogonal_vector(), 2.0);
        }
        let place = quadric.best_place().unwrap();
        assert!(place.distance(corner) < 1e-12);
        assert!((quadric.distance(corner + DVec3::X) - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((quadric.cost(corner + DVec3::X) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_flat_quadric_needs_points_to_choose_a_place() {
        let mut quadric = Quadric::default();
        quadric.add_plane(DVec3::Z, DVec3::Z, 1.0);
        assert!(quadric.best_place().is_none());
        quadric.add_point(DVec3::new(1.0, 2.0, 1.0), 0.01);
        assert!(quadric.best_place().unwrap().distance(DVec3::new(1.0, 2.0, 1.0)) < 1e-12);
    }
}
