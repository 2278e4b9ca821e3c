//! Dihedral angles of a tetrahedral mesh, counted by degrees.

use glam::DVec3;
use rayon::prelude::*;

use crate::{MeshError, TetrahedralMesh};

/// The dihedral angles of a tetrahedral mesh, six per tetrahedron.
#[derive(Clone, Debug, PartialEq)]
pub struct DihedralStatistics {
    /// How many angles are in [i°, i+1°), the last including 180°.
    pub histogram: [usize; 180],
    /// Radians.
    pub smallest: f64,
    /// Radians.
    pub largest: f64,
}

impl DihedralStatistics {
    /// All angles: six times the number of tetrahedra.
    pub fn count(&self) -> usize {
        self.histogram.iter().sum()
    }

    /// The share of all angles, between 0 and 1, that are smaller than a whole number of degrees.
    pub fn share_below(&self, degrees: usize) -> f64 {
        let below: usize = self.histogram[..degrees.min(180)].iter().sum();
        below as f64 / self.count().max(1) as f64
    }
}

/// Tetrahedra per task; counts and extremes do not depend on it.
const BLOCK: usize = 8192;

/// The dihedral angles of every tetrahedron; those of flat ones are 0 or 180°, and 0 where a facet has no area.
pub fn dihedral_angles(mesh: &TetrahedralMesh) -> Result<DihedralStatistics, MeshError> {
    mesh.validate()?;
    let empty = || DihedralStatistics { histogram: [0; 180], smallest: f64::INFINITY, largest: 0.0 };
    let scale = libm::scalbn(1.0, -libm::ilogb(largest_coordinate(mesh)).clamp(-1000, 1000));
    let of_block = |block: &[[u32; 4]]| {
        let mut statistics = empty();
        for tetrahedron in block {
            let corners = tetrahedron.map(|v| DVec3::from(mesh.vertices[v as usize]) * scale);
            for angle in angles(corners) {
                let degree = (angle.to_degrees() as usize).min(179);
                statistics.histogram[degree] += 1;
                statistics.smallest = statistics.smallest.min(angle);
                statistics.largest = statistics.largest.max(angle);
            }
        }
        statistics
    };
    let merge = |mut all: DihedralStatistics, part: DihedralStatistics| {
        all.histogram.iter_mut().zip(part.histogram).for_each(|(sum, more)| *sum += more);
        all.smallest = all.smallest.min(part.smallest);
        all.largest = all.largest.max(part.largest);
        all
    };
    Ok(mesh.tetrahedra.par_chunks(BLOCK).map(of_block).reduce(empty, merge))
}

fn largest_coordinate(mesh: &TetrahedralMesh) -> f64 {
    mesh.vertices.iter().flatten().fold(f64::MIN_POSITIVE, |most: f64, c| most.max(c.abs()))
}

/// Radians at the edges ab, ac, ad, bc, bd, cd; whether the tetrahedron is inside out does not matter.
pub(super) fn angles([a, b, c, d]: [DVec3; 4]) -> [f64; 6] {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let (bc, bd, cd) = (c - b, d - b, d - c);
    // Outward normals, of twice the facets' areas.
    let [na, nb, nc, nd] = [bc.cross(bd), ad.cross(ac), ab.cross(ad), ac.cross(ab)];
    let six_volumes = nd.dot(ad).abs();
    // Subtracted from zero: a negated zero would turn a facet without area by 180°.
    let at = |edge: DVec3, n: DVec3, m: DVec3| libm::atan2(six_volumes * edge.length(), 0.0 - n.dot(m));
    [at(ab, nc, nd), at(ac, nb, nd), at(ad, nb, nc), at(bc, na, nd), at(bd, na, nc), at(cd, na, nb)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corner_of_a_cube_at_any_scale() {
        for size in [1e-200, 1e-3, 1.0, 1e59] {
            let vertices = vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
            let mesh = TetrahedralMesh { vertices, tetrahedra: vec![[0, 1, 2, 3]] };
            let statistics = dihedral_angles(&mesh).unwrap();
            let acute = (1.0 / 3.0_f64.sqrt()).acos();
            assert!((statistics.smallest - acute).abs() < 1e-14, "{size}");
            assert!((statistics.largest - std::f64::consts::FRAC_PI_2).abs() < 1e-14);
            assert_eq!(statistics.histogram[54], 3);
            assert_eq!(statistics.count(), 6);
            assert!((statistics.share_below(55) - 0.5).abs() < 1e-15 && statistics.share_below(54) <= 0.0);
            assert!((statistics.share_below(1000) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn flat_and_hostile_tetrahedra() {
        let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let mut mesh = TetrahedralMesh { vertices, tetrahedra: vec![[0, 1, 2, 3], [0, 0, 0, 0]] };
        let statistics = dihedral_angles(&mesh).unwrap();
        assert_eq!((statistics.histogram[0], statistics.histogram[179]), (4 + 6, 2));
        mesh.vertices[2][1] = f64::NAN;
        assert_eq!(dihedral_angles(&mesh), Err(MeshError::NotFinite { vertex: 2 }));
        assert_eq!(dihedral_angles(&TetrahedralMesh::default()), Err(MeshError::Empty));
    }
}
