//! How good one tetrahedron is.

use glam::DVec3;

/// The smallest sine of the six dihedral angles of the tetrahedron `a b c d`, below zero if it is inside out.
///
/// An angle near 180° is as bad as one near 0° (a flat tetrahedron has both). The sine at the edge i j is `6V·l /
/// (|n_k|·|n_l|)`, where the facets' normals have twice their areas. Edges below about 1e-19, in a mesh of size 1, make
/// it zero.
pub(super) fn smallest_sine([a, b, c, d]: [DVec3; 4]) -> f64 {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let (bc, bd, cd) = (c - b, d - b, d - c);
    let normal_d = ab.cross(ac);
    let six_volumes = normal_d.dot(ad);
    // Squared normals of the facets opposite each corner.
    let [na, nb, nc, nd] = [bc.cross(bd), ac.cross(ad), ab.cross(ad), normal_d].map(DVec3::length_squared);
    let product = (na * nb) * (nc * nd);
    let (pairs_ab, pairs_cd) = (na * nb, nc * nd);
    let least = (ab.length_squared() * pairs_ab)
        .min(cd.length_squared() * pairs_cd)
        .min(ac.length_squared() * (na * nc))
        .min(bd.length_squared() * (nb * nd))
        .min(ad.length_squared() * (na * nd))
        .min(bc.length_squared() * (nb * nc));
    let sine = six_volumes * (least / product).sqrt();
    if sine.is_nan() { 0.0 } else { sine }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(corners: [[f64; 3]; 4]) -> f64 {
        smallest_sine(corners.map(DVec3::from))
    }

    #[test]
    fn known_tetrahedra_have_their_known_angles() {
        // Regular: every angle is acos(1/3).
        let regular = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        assert!((sine(regular).abs() - 8.0_f64.sqrt() / 3.0).abs() < 1e-14);
        // The corner of a cube: three right angles, three of acos(1/√3).
        let corner = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((sine(corner) - (2.0_f64 / 3.0).sqrt()).abs() < 1e-14);
        let [a, b, c, d] = corner;
        assert!(sine([b, a, c, d]) < 0.0);
        // A kite of height h: small angles at four edges, nearly 180° at the two diagonals.
        let h = 1e-4;
        let kite = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, h], [0.0, -1.0, h]];
        assert!(sine(kite).abs() < 3.0 * h && sine(kite).abs() > 0.5 * h);
        assert!(sine([[0.0; 3]; 4]).abs() <= 0.0);
    }
}
