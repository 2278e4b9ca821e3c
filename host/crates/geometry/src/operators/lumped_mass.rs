//! Lumped (diagonal) mass matrices of triangle and tetrahedral meshes (thesis 2.1.3, "Lumping").

use glam::DVec3;

use crate::vectors::{DEGENERATE, area_of_lengths, difference, dot, doubled_area, six_volumes};
use crate::{MeshError, TetrahedralMesh, TriangleMesh};

/// How an element's area or volume is shared among its corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lumping {
    /// Equal shares: always positive, whatever the element's shape.
    #[default]
    Barycentric,
    /// The part of the element closest to each corner, if its circumcentre is inside. An obtuse triangle gives half to
    /// its obtuse corner and a quarter to each other (Meyer et al. 2003; the thesis has the two fractions swapped,
    /// which would not add up to the triangle). A tetrahedron whose circumcentre is outside is shared equally. Smaller
    /// errors than barycentric on irregular meshes.
    VoronoiHybrid,
}

/// Area of each vertex; n long, mesh unit squared, summing to the surface's area.
pub fn lumped_mass(mesh: &TriangleMesh, lumping: Lumping) -> Result<Vec<f64>, MeshError> {
    mesh.validate()?;
    Ok(lumped_mass_of_triangles(&mesh.vertices, &mesh.triangles, lumping))
}

/// Like [`lumped_mass`], for triangles in any dimension, in particular two and three.
///
/// # Panics
/// If a triangle refers to a vertex that does not exist.
pub fn lumped_mass_of_triangles<const D: usize>(
    vertices: &[[f64; D]],
    triangles: &[[u32; 3]],
    lumping: Lumping,
) -> Vec<f64> {
    let mut mass = vec![0.0; vertices.len()];
    for corners in triangles {
        let shares = triangle_shares(corners.map(|v| vertices[v as usize]), lumping);
        for (&vertex, share) in corners.iter().zip(shares) {
            mass[vertex as usize] += share;
        }
    }
    mass
}

/// Volume of each vertex; n long, mesh unit cubed, summing to the mesh's volume. Inside-out tetrahedra count with their
/// absolute volume.
pub fn lumped_mass_tetrahedra(mesh: &TetrahedralMesh, lumping: Lumping) -> Result<Vec<f64>, MeshError> {
    mesh.validate()?;
    let mut mass = vec![0.0; mesh.vertices.len()];
    for corners in &mesh.tetrahedra {
        let shares = tetrahedron_shares(corners.map(|v| mesh.vertices[v as usize].into()), lumping);
        for (&vertex, share) in corners.iter().zip(shares) {
            mass[vertex as usize] += share;
        }
    }
    Ok(mass)
}

fn triangle_shares<const D: usize>([a, b, c]: [[f64; D]; 3], lumping: Lumping) -> [f64; 3] {
    let (ab, bc, ca) = (difference(b, a), difference(c, b), difference(a, c));
    let (area_2, squares) = (doubled_area(ab, ca), [dot(ab, ab), dot(bc, bc), dot(ca, ca)]);
    shares(area_2, squares, lumping)
}

/// Shares of the corners a, b, c of a triangle with sides ab, bc, ca this long.
pub(crate) fn shares_of_intrinsic_triangle(lengths: [f64; 3], lumping: Lumping) -> [f64; 3] {
    shares(2.0 * area_of_lengths(lengths), lengths.map(|length| length * length), lumping)
}

fn shares(area_2: f64, squares: [f64; 3], lumping: Lumping) -> [f64; 3] {
    let area = 0.5 * area_2;
    let [ab, bc, ca] = squares;
    let flat = area_2 < DEGENERATE * ab.max(bc).max(ca);
    if lumping == Lumping::Barycentric || flat {
        return [area / 3.0; 3];
    }
    let doubled_dots = [ab + ca - bc, ab + bc - ca, bc + ca - ab];
    if doubled_dots.iter().any(|&at| at < 0.0) {
        return doubled_dots.map(|at| if at < 0.0 { area / 2.0 } else { area / 4.0 });
    }
    let [at_a, at_b, at_c] = doubled_dots.map(|at| at / (2.0 * area_2));
    [(ab * at_c + ca * at_b) / 8.0, (ab * at_c + bc * at_a) / 8.0, (bc * at_a + ca * at_b) / 8.0]
}

fn tetrahedron_shares(p: [DVec3; 4], lumping: Lumping) -> [f64; 4] {
    let volume = (six_volumes(p) / 6.0).abs();
    let equal = [volume / 4.0; 4];
    if lumping == Lumping::Barycentric {
        return equal;
    }
    circumcentre(p).map_or(equal, |centre| voronoi_shares(p, centre))
}

/// The circumcentre, if it is inside or on the tetrahedron.
fn circumcentre(p: [DVec3; 4]) -> Option<DVec3> {
    let (u, v, w) = (p[1] - p[0], p[2] - p[0], p[3] - p[0]);
    let offset = (u.length_squared() * v.cross(w) + v.length_squared() * w.cross(u) + w.length_squared() * u.cross(v))
        / (2.0 * u.dot(v.cross(w)));
    let centre = p[0] + offset;
    let whole = six_volumes(p) / 6.0;
    let inside = (0..4).all(|corner| {
        let mut part = p;
        part[corner] = centre;
        // NaN and infinity, from a flat tetrahedron, fail this comparison too.
        six_volumes(part) / 6.0 / whole >= 0.0
    });
    (inside && centre.is_finite()).then_some(centre)
}

/// Volume nearest to each corner, for a circumcentre inside: each edge's two halves, each face's circumcentre and
/// the centre span the pieces.
fn voronoi_shares(p: [DVec3; 4], centre: DVec3) -> [f64; 4] {
    let mut shares = [0.0; 4];
    for [i, j, k] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
        let normal = (p[j] - p[i]).cross(p[k] - p[i]);
        let foot = centre - normal * ((centre - p[i]).dot(normal) / normal.length_squared());
        for (a, b, opposite) in [(i, j, k), (j, k, i), (k, i, j)] {
            let middle = 0.5 * (p[a] + p[b]);
            let edge = p[b] - p[a];
            // Signed, because a face's circumcentre may lie across one of the face's edges.
            let inward = (p[opposite] - p[a]) - edge * ((p[opposite] - p[a]).dot(edge) / edge.length_squared());
            let sign = if (foot - middle).dot(inward) < 0.0 { -1.0 } else { 1.0 };
            let piece = sign * (six_volumes([p[a], middle, foot, centre]) / 6.0).abs();
            shares[a] += piece;
            shares[b] += piece;
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn obtuse_corner_takes_half() {
        let shares = triangle_shares([[0.0, 0.0], [2.0, 0.2], [-2.0, 0.2]], Lumping::VoronoiHybrid);
        let area = 0.4;
        for (share, expected) in shares.iter().zip([area / 2.0, area / 4.0, area / 4.0]) {
            assert!((share - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn shares_add_up_and_favour_no_corner_of_a_regular_element() {
        let regular = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from);
        let shares = tetrahedron_shares(regular, Lumping::VoronoiHybrid);
        let volume = (six_volumes(regular) / 6.0).abs();
        assert!(shares.iter().all(|s| (s - volume / 4.0).abs() < 1e-14));
        let acute = [[0.0, 0.0], [1.0, 0.1], [0.4, 0.9]];
        let sum: f64 = triangle_shares(acute, Lumping::VoronoiHybrid).iter().sum();
        assert!((sum - 0.5 * (1.0 * 0.9 - 0.1 * 0.4)).abs() < 1e-15);
    }

    #[test]
    fn tetrahedron_share_is_the_volume_nearest_to_the_corner() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.05, 0.0], [0.4, 0.9, 0.1], [0.5, 0.3, 0.8]].map(DVec3::from);
        assert!(circumcentre(p).is_some());
        let shares = tetrahedron_shares(p, Lumping::VoronoiHybrid);
        let volume = (six_volumes(p) / 6.0).abs();
        assert!((shares.iter().sum::<f64>() - volume).abs() < 1e-14);
        // An independent count: barycentric grid points, each given to the nearest corner.
        let (steps, mut counts, mut total) = (60, [0_u32; 4], 0_u32);
        for i in 0..steps {
            for j in 0..steps - i {
                for k in 0..steps - i - j {
                    let weights = [i, j, k, steps - 1 - i - j - k].map(|n| (f64::from(n) + 0.25) / f64::from(steps));
                    let point: DVec3 = p.iter().zip(weights).map(|(&corner, w)| corner * w).sum();
                    let nearest = (0..4).min_by(|&a, &b| point.distance(p[a]).total_cmp(&point.distance(p[b])));
                    counts[nearest.unwrap()] += 1;
                    total += 1;
                }
            }
        }
        for (share, count) in shares.iter().zip(counts) {
            let counted = f64::from(count) / f64::from(total) * volume;
            assert!((share - counted).abs() < 0.02 * volume, "{share} is not near {counted}");
        }
    }

    #[test]
    fn flat_tetrahedra_weigh_nothing_and_stay_finite() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from);
        assert_eq!(tetrahedron_shares(flat, Lumping::VoronoiHybrid).to_vec(), [0.0; 4]);
    }
}
