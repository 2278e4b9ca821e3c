//! Where a plane cuts cells and triangles.

use armature_geometry::{TetrahedralMesh, TriangleMesh};

/// An axis of the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Axis {
    /// Seen from +X: -Z is on the right, +Y up.
    X,
    /// Seen from above (+Y): +X is on the right, -Z up.
    Y,
    /// Seen from the front (+Z): +X is on the right, +Y up.
    Z,
}

/// One direction of a picture: an axis of the mesh, and whether it runs along or against it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub(super) axis: usize,
    pub(super) sign: f64,
}

impl Axis {
    /// 0, 1 or 2.
    pub fn index(self) -> usize {
        self as usize
    }

    /// x, y or z.
    pub fn name(self) -> &'static str {
        ["x", "y", "z"][self.index()]
    }

    /// Across the shortest side of a box, so that a slice shows as much as possible.
    pub fn across_shortest(low: [f64; 3], high: [f64; 3]) -> Self {
        let side = |axis: &Self| high[axis.index()] - low[axis.index()];
        [Self::Z, Self::X, Self::Y].into_iter().min_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(Self::Z)
    }

    /// The directions to the right and up in a picture of a slice across this axis.
    pub(super) fn directions(self) -> [Direction; 2] {
        let along = |axis, sign| Direction { axis, sign };
        match self {
            Self::X => [along(2, -1.0), along(1, 1.0)],
            Self::Y => [along(0, 1.0), along(2, -1.0)],
            Self::Z => [along(0, 1.0), along(1, 1.0)],
        }
    }
}

/// A plane across an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlicePlane {
    /// The axis it is perpendicular to.
    pub axis: Axis,
    /// Its position on that axis, mesh unit.
    pub position: f64,
}

impl SlicePlane {
    /// The picture's coordinates of a point: right and up, mesh unit.
    pub(super) fn flatten(&self, p: [f64; 3]) -> [f64; 2] {
        self.axis.directions().map(|d| d.sign * p[d.axis])
    }

    /// The point of the plane with these coordinates of the picture.
    pub(super) fn unflatten(&self, flat: [f64; 2]) -> [f64; 3] {
        let mut p = [self.position; 3];
        for (direction, value) in self.axis.directions().into_iter().zip(flat) {
            p[direction.axis] = direction.sign * value;
        }
        p
    }

    /// How far above the plane a point is. A point on the plane counts as above it, consistently for every cell.
    fn height(&self, p: [f64; 3]) -> f64 {
        p[self.axis.index()] - self.position
    }

    /// Where the edge between two points on different sides crosses the plane; the same from either end.
    fn crossing(&self, below: [f64; 3], above: [f64; 3]) -> [f64; 2] {
        let (under, over) = (self.height(below), self.height(above));
        let share = (-under / (over - under)).clamp(0.0, 1.0);
        self.flatten(std::array::from_fn(|k| below[k] + share * (above[k] - below[k])))
    }
}

/// The part of a cell in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct CutCell {
    /// Three or four corners in order, in the picture's coordinates (right and up, mesh unit).
    pub corners: Vec<[f64; 2]>,
    /// The cell's winding number.
    pub winding: f64,
}

/// Cuts every tetrahedron. `winding` has a number for each.
pub(super) fn cut_tetrahedra(mesh: &TetrahedralMesh, winding: &[f64], plane: &SlicePlane) -> Vec<CutCell> {
    let cut = |(t, &winding): (&[u32; 4], &f64)| {
        let corners = t.map(|v| mesh.vertices[v as usize]);
        let (above, below): (Vec<_>, Vec<_>) = corners.into_iter().partition(|&p| plane.height(p) >= 0.0);
        let corners = match (below.as_slice(), above.as_slice()) {
            (&[a], &[b, c, d]) => [b, c, d].map(|p| plane.crossing(a, p)).to_vec(),
            (&[a, b, c], &[d]) => [a, b, c].map(|p| plane.crossing(p, d)).to_vec(),
            (&[a, b], &[c, d]) => [(a, c), (a, d), (b, d), (b, c)].map(|(p, q)| plane.crossing(p, q)).to_vec(),
            _ => return None,
        };
        Some(CutCell { corners, winding })
    };
    mesh.tetrahedra.iter().zip(winding).filter_map(cut).collect()
}

/// The triangles of a flat domain as they are.
pub(super) fn flat_triangles(mesh: &TriangleMesh, winding: &[f64], plane: &SlicePlane) -> Vec<CutCell> {
    let corners = |t: &[u32; 3]| t.map(|v| plane.flatten(mesh.vertices[v as usize])).to_vec();
    mesh.triangles.iter().zip(winding).map(|(t, &winding)| CutCell { corners: corners(t), winding }).collect()
}

/// Cuts every triangle of a surface; returns the segments' ends.
pub(super) fn cut_surface(mesh: &TriangleMesh, plane: &SlicePlane) -> Vec<[[f64; 2]; 2]> {
    let cut = |t: &[u32; 3]| {
        let corners = t.map(|v| mesh.vertices[v as usize]);
        let (above, below): (Vec<_>, Vec<_>) = corners.into_iter().partition(|&p| plane.height(p) >= 0.0);
        match (below.as_slice(), above.as_slice()) {
            (&[a], &[b, c]) => Some([plane.crossing(a, b), plane.crossing(a, c)]),
            (&[a, b], &[c]) => Some([plane.crossing(a, c), plane.crossing(b, c)]),
            _ => None,
        }
    };
    mesh.triangles.iter().filter_map(cut).collect()
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "numbers that are exact or copied")]
mod tests {
    use super::*;

    fn area(corners: &[[f64; 2]]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        0.5 * corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs()
    }

    /// The unit cube in five tetrahedra.
    fn cube() -> TetrahedralMesh {
        let vertices = (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
        TetrahedralMesh {
            vertices,
            tetrahedra: vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]],
        }
    }

    #[test]
    fn cuts_of_a_cube_fill_its_square() {
        let mesh = cube();
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            for position in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let cells = cut_tetrahedra(&mesh, &[1.0; 5], &SlicePlane { axis, position });
                let total: f64 = cells.iter().map(|c| area(&c.corners)).sum();
                // The lower side is not below the plane, so nothing is cut there.
                let expected = if position > 0.0 { 1.0 } else { 0.0 };
                assert!((total - expected).abs() < 1e-12, "{axis:?} at {position}: {total}");
            }
        }
    }

    #[test]
    fn flat_coordinates_are_of_the_plane() {
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let plane = SlicePlane { axis, position: 0.3 };
            let [right, up] = plane.axis.directions();
            assert_ne!(right.axis, up.axis);
            let flat = [0.7, -0.2];
            let p = plane.unflatten(flat);
            assert_eq!(plane.flatten(p), flat);
            assert_eq!(plane.height(p), 0.0);
        }
    }

    #[test]
    fn the_shortest_side_shows_most() {
        assert_eq!(Axis::across_shortest([0.0; 3], [3.0, 2.0, 1.0]), Axis::Z);
        assert_eq!(Axis::across_shortest([0.0; 3], [1.0, 2.0, 3.0]), Axis::X);
        assert_eq!(Axis::across_shortest([0.0; 3], [2.0, 1.0, 3.0]), Axis::Y);
    }
}
