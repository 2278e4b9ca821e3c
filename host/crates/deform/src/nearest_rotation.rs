//! Nearest rotations to eight 3×3 matrices at once.
//!
//! ```
//! use armature_deform::nearest_rotation::{LANES, nearest_rotations};
//!
//! // Stretched along x, in every lane: the nearest rotation is the identity.
//! let stretched = [[[3.0; LANES], [0.0; LANES], [0.0; LANES]], [[0.0; LANES], [1.0; LANES], [0.0; LANES]], [[0.0; LANES], [0.0; LANES], [1.0; LANES]]];
//! let turned = nearest_rotations(&stretched);
//! assert!((turned[0][0][0] - 1.0).abs() < 1e-6 && turned[1][0][0].abs() < 1e-6);
//! ```
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use crate::lanes::{Kernel, Lane, widest};
pub use crate::lanes::{LANES, Matrices};

/// With this many squarings, a relative gap of 1e-6 between the two largest eigenvalues, the smallest that `f32` can
/// represent, is resolved.
const SQUARINGS: usize = 21;
/// A trace this close to one leaves no second eigenvector that `f32` would notice.
const PURE: f32 = 1.0 - 2.0e-7;

/// The rotations `R` that maximise `tr(Rᵀ S)`, the rotations nearest to `S` in the Frobenius norm, of eight
/// matrices at once.
///
/// `matrices`: `[row][column][lane]`. The result is always a rotation, never a reflection: for `det S < 0` it is the
/// best of the rotations, for a singular `S` one of the best, and the identity for a zero matrix or one with an entry
/// that is not finite. The error is about `f32::EPSILON · σ₁ / (σ₂ ± σ₃)`, as good as the conditioning allows: nothing
/// is squared on the way to the unit quaternion, which is the dominant eigenvector of a symmetric 4×4 matrix linear in
/// `S` (Horn 1987), found by repeated squaring.
pub fn nearest_rotations(matrices: &Matrices) -> Matrices {
    widest(Nearest(matrices))
}

struct Nearest<'a>(&'a Matrices);

impl Kernel for Nearest<'_> {
    type Output = Matrices;

    #[inline(always)]
    fn run(self) -> Matrices {
        nearest_rotations_inlined(self.0)
    }
}

/// The upper triangle of a symmetric 4×4 matrix, row by row.
type Symmetric = [Lane; 10];

#[inline(always)]
pub(crate) fn nearest_rotations_inlined(matrices: &Matrices) -> Matrices {
    let mut power = horn_matrix(matrices);
    for _ in 0..SQUARINGS {
        let purity = square(&mut power);
        let mut all_pure = true;
        for l in 0..LANES {
            // Lanes that are not finite are sorted out at the end and delay no other.
            all_pure &= purity[l] > PURE || purity[l].is_nan();
        }
        if all_pure {
            break;
        }
    }
    rotations_of(&dominant(&power))
}

/// Horn's matrix of `S`, shifted so that its largest eigenvalue is the largest in size too, with trace one.
#[inline(always)]
fn horn_matrix(m: &Matrices) -> Symmetric {
    let mut out = [[0.0; LANES]; 10];
    for l in 0..LANES {
        let mut largest = 0.0_f32;
        for row in m {
            for entry in row {
                largest = largest.max(entry[l].abs());
            }
        }
        // NaN passes `max` unnoticed and reaches the result through the entries.
        let shrink = 1.0 / largest.max(1e-37);
        let at = |row: usize, column: usize| m[row][column][l] * shrink;
        let (xx, xy, xz) = (at(0, 0), at(0, 1), at(0, 2));
        let (yx, yy, yz) = (at(1, 0), at(1, 1), at(1, 2));
        let (zx, zy, zz) = (at(2, 0), at(2, 1), at(2, 2));
        let squared = xx * xx + xy * xy + xz * xz + yx * yx + yy * yy + yz * yz + zx * zx + zy * zy + zz * zz;
        // The Frobenius norm: the eigenvalues of Horn's matrix are within ±√3 of it. The floor turns zeros into the
        // identity.
        let shift = squared.sqrt().max(1e-30);
        let unit = 0.25 / shift;
        out[0][l] = (shift + xx + yy + zz) * unit;
        out[1][l] = (zy - yz) * unit;
        out[2][l] = (xz - zx) * unit;
        out[3][l] = (yx - xy) * unit;
        out[4][l] = (shift + xx - yy - zz) * unit;
        out[5][l] = (xy + yx) * unit;
        out[6][l] = (xz + zx) * unit;
        out[7][l] = (shift - xx + yy - zz) * unit;
        out[8][l] = (yz + zy) * unit;
        out[9][l] = (shift - xx - yy + zz) * unit;
    }
    out
}

/// Squares a matrix of trace one and scales the square to trace one; returns the trace before scaling, the sum of
/// the squared eigenvalues.
#[inline(always)]
fn square(p: &mut Symmetric) -> Lane {
    let mut traces = [0.0; LANES];
    for l in 0..LANES {
        let [aa, ab, ac, ad] = [p[0][l], p[1][l], p[2][l], p[3][l]];
        let [bb, bc, bd] = [p[4][l], p[5][l], p[6][l]];
        let [cc, cd, dd] = [p[7][l], p[8][l], p[9][l]];
        let (ab2, ac2, ad2) = (ab * ab, ac * ac, ad * ad);
        let (bc2, bd2, cd2) = (bc * bc, bd * bd, cd * cd);
        let sa = aa * aa + ab2 + (ac2 + ad2);
        let sb = ab2 + bb * bb + (bc2 + bd2);
        let sc = ac2 + bc2 + (cc * cc + cd2);
        let sd = ad2 + bd2 + (cd2 + dd * dd);
        let trace = (sa + sb) + (sc + sd);
        let unit = 1.0 / trace;
        p[0][l] = sa * unit;
        p[1][l] = (ab * (aa + bb) + (ac * bc + ad * bd)) * unit;
        p[2][l] = (ac * (aa + cc) + (ab * bc + ad * cd)) * unit;
        p[3][l] = (ad * (aa + dd) + (ab * bd + ac * cd)) * unit;
        p[4][l] = sb * unit;
        p[5][l] = (bc * (bb + cc) + (ab * ac + bd * cd)) * unit;
        p[6][l] = (bd * (bb + dd) + (ab * ad + bc * cd)) * unit;
        p[7][l] = sc * unit;
        p[8][l] = (cd * (cc + dd) + (ac * ad + bc * bd)) * unit;
        p[9][l] = sd * unit;
        traces[l] = trace;
    }
    traces
}

/// The column with the largest diagonal entry, as a unit quaternion `[w, x, y, z]`.
#[inline(always)]
fn dominant(p: &Symmetric) -> [Lane; 4] {
    let mut out = [[0.0; LANES]; 4];
    for l in 0..LANES {
        let (mut w, mut x, mut y, mut z) = (p[0][l], p[1][l], p[2][l], p[3][l]);
        let mut best = p[0][l];
        let mut take = |diagonal: f32, column: [f32; 4]| {
            let better = diagonal > best;
            w = if better { column[0] } else { w };
            x = if better { column[1] } else { x };
            y = if better { column[2] } else { y };
            z = if better { column[3] } else { z };
            best = if better { diagonal } else { best };
        };
        take(p[4][l], [p[1][l], p[4][l], p[5][l], p[6][l]]);
        take(p[7][l], [p[2][l], p[5][l], p[7][l], p[8][l]]);
        take(p[9][l], [p[3][l], p[6][l], p[8][l], p[9][l]]);
        let squared = w * w + x * x + y * y + z * z;
        let unit = 1.0 / squared.sqrt();
        // With trace one the largest entry is at least a quarter; anything else is NaN.
        let sane = squared > 0.01;
        out[0][l] = if sane { w * unit } else { 1.0 };
        out[1][l] = if sane { x * unit } else { 0.0 };
        out[2][l] = if sane { y * unit } else { 0.0 };
        out[3][l] = if sane { z * unit } else { 0.0 };
    }
    out
}

#[inline(always)]
fn rotations_of(q: &[Lane; 4]) -> Matrices {
    let mut out = [[[0.0; LANES]; 3]; 3];
    for l in 0..LANES {
        let (w, x, y, z) = (q[0][l], q[1][l], q[2][l], q[3][l]);
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        out[0][0][l] = 1.0 - (yy + zz);
        out[0][1][l] = xy - wz;
        out[0][2][l] = xz + wy;
        out[1][0][l] = xy + wz;
        out[1][1][l] = 1.0 - (xx + zz);
        out[1][2][l] = yz - wx;
        out[2][0][l] = xz - wy;
        out[2][1][l] = yz + wx;
        out[2][2][l] = 1.0 - (xx + yy);
    }
    out
}

#[cfg(test)]
#[path = "nearest_rotation_tests.rs"]
mod tests;
