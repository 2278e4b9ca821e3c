//! Exact signs, with a fast floating-point answer where that is certain.

use robust::Coord3D;

/// Above the largest error of the determinant in [`orientation`], in units of (largest |Δx|)·(largest |Δy|)·(largest
/// |Δz|): Shewchuk (1997) bounds it by (7 + 56ε)ε times a sum of six such products, with ε = 2⁻⁵³.
const ORIENTATION_ERROR: f64 = 5e-15;
/// The same for [`in_sphere`]: (16 + 224ε)ε times a sum of 24 products, each with a squared distance as well.
const IN_SPHERE_ERROR: f64 = 5e-14;

/// Positive if `(b-a)·((c-a)×(d-a)) > 0`, zero exactly if the four points lie in one plane.
pub(crate) fn orientation(a: &[f64; 3], b: &[f64; 3], c: &[f64; 3], d: &[f64; 3]) -> f64 {
    let [a_d, b_d, c_d] = [difference(a, d), difference(b, d), difference(c, d)];
    let det = a_d[2] * (b_d[0] * c_d[1] - c_d[0] * b_d[1])
        + b_d[2] * (c_d[0] * a_d[1] - a_d[0] * c_d[1])
        + c_d[2] * (a_d[0] * b_d[1] - b_d[0] * a_d[1]);
    let [x, y, z] = std::array::from_fn(|k| a_d[k].abs().max(b_d[k].abs()).max(c_d[k].abs()));
    if det.abs() > ORIENTATION_ERROR * (x * y * z) {
        return -det;
    }
    -robust::orient3d(coordinates(a), coordinates(b), coordinates(c), coordinates(d))
}

/// Positive if `e` lies inside the sphere through the positively oriented tetrahedron `a b c d`, zero exactly if it
/// lies on the sphere.
pub(crate) fn in_sphere(a: &[f64; 3], b: &[f64; 3], c: &[f64; 3], d: &[f64; 3], e: &[f64; 3]) -> f64 {
    let corners = [difference(a, e), difference(b, e), difference(c, e), difference(d, e)];
    let minor = |i: usize, j: usize| corners[i][0] * corners[j][1] - corners[j][0] * corners[i][1];
    let (ab, bc, cd, da, ac, bd) = (minor(0, 1), minor(1, 2), minor(2, 3), minor(3, 0), minor(0, 2), minor(1, 3));
    let [az, bz, cz, dz] = corners.map(|corner| corner[2]);
    let abc = az * bc - bz * ac + cz * ab;
    let bcd = bz * cd - cz * bd + dz * bc;
    let cda = cz * da + dz * ac + az * cd;
    let dab = dz * ab + az * bd + bz * da;
    let lift = corners.map(|[x, y, z]| x * x + y * y + z * z);
    let det = (lift[3] * abc - lift[2] * dab) + (lift[1] * cda - lift[0] * bcd);
    let largest = |k: usize| corners.iter().fold(0.0, |most: f64, corner| most.max(corner[k].abs()));
    let farthest = lift.iter().fold(0.0, |most: f64, &l| most.max(l));
    if det.abs() > IN_SPHERE_ERROR * (largest(0) * largest(1) * largest(2)) * farthest {
        return -det;
    }
    -robust::insphere(coordinates(a), coordinates(b), coordinates(c), coordinates(d), coordinates(e))
}

/// Whether the three points lie on one line.
pub(crate) fn collinear(a: &[f64; 3], b: &[f64; 3], c: &[f64; 3]) -> bool {
    [[0, 1], [1, 2], [2, 0]].iter().all(|&[i, j]| {
        let flat = |p: &[f64; 3]| robust::Coord { x: p[i], y: p[j] };
        robust::orient2d(flat(a), flat(b), flat(c)) == 0.0
    })
}

/// Whether all three coordinates are equal; 0 and -0 count as equal.
#[expect(clippy::float_cmp, reason = "a duplicate is at exactly the same place; anything else is a different point")]
pub(crate) fn same_place(a: &[f64; 3], b: &[f64; 3]) -> bool {
    a == b
}

fn difference(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn coordinates(&[x, y, z]: &[f64; 3]) -> Coord3D<f64> {
    Coord3D { x, y, z }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn signs_are_those_the_documentation_says() {
        let [a, b, c, d] = &CORNER;
        assert!(orientation(a, b, c, d) > 0.0 && orientation(b, a, c, d) < 0.0);
        assert!(in_sphere(a, b, c, d, &[0.5; 3]) > 0.0);
        assert!(in_sphere(a, b, c, d, &[1.1; 3]) < 0.0);
        assert!(in_sphere(a, b, c, d, &[1.0; 3]).abs() <= 0.0);
        assert!(collinear(a, b, &[3.0, 0.0, 0.0]) && !collinear(a, b, c));
    }

    #[test]
    fn a_last_bit_decides() {
        let [a, b, c, d] = &CORNER;
        assert!(in_sphere(a, b, c, d, &[1.0, 1.0, 1.0 - f64::EPSILON]) > 0.0);
        assert!(in_sphere(a, b, c, d, &[1.0, 1.0, 1.0 + f64::EPSILON]) < 0.0);
        assert!(orientation(a, b, c, &[0.3, 0.3, 1e-40]) > 0.0);
    }
}
