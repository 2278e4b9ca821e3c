//! Sums of angles without an arctangent per term: the angles are multiplied up as complex numbers, and half turns
//! that the product cannot show are counted.
#![expect(
    clippy::inline_always,
    reason = "sums have to stay in registers; left to itself the compiler takes twice as long"
)]

/// Terms taken at once: a width that compilers turn into vector instructions.
pub(crate) const LANES: usize = 4;
pub(crate) type Lane = [f64; LANES];

/// Up to four triangles, `[corner][axis][lane]`; unused lanes are all zero and see nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TriangleBlock(pub(crate) [[Lane; 3]; 3]);

/// Up to four directed edges that form triangles with an apex kept elsewhere, `[end][axis][lane]`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FanBlock(pub(crate) [[Lane; 3]; 2]);

/// A running sum of angles in `(-π, π]`, four at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turns {
    re: Lane,
    im: Lane,
    /// Whole turns that the product has lost.
    whole: Lane,
}

impl Turns {
    pub(crate) const fn new() -> Self {
        Self { re: [1.0; LANES], im: [0.0; LANES], whole: [0.0; LANES] }
    }

    /// Adds half the solid angles of four triangles seen from `p` (van Oosterom and Strackee 1983; thesis eq. 8.6).
    #[inline]
    pub(crate) fn add_triangles(&mut self, block: &TriangleBlock, p: [f64; 3]) {
        let [a, b, c] = block.0.map(|corner| offset(corner, p));
        self.add_solid(&a, &b, &c, &lengths(&c));
    }

    /// Adds half the solid angles of the triangles from edges to an apex.
    #[inline]
    pub(crate) fn add_fan(&mut self, blocks: &[FanBlock], apex: [f64; 3], p: [f64; 3]) {
        let c = offset(apex.map(|c| [c; LANES]), p);
        let lc = lengths(&c);
        let mut turns = *self;
        for block in blocks {
            let [a, b] = block.0.map(|end| offset(end, p));
            turns.add_solid(&a, &b, &c, &lc);
        }
        *self = turns;
    }

    #[inline(always)]
    fn add_solid(&mut self, a: &[Lane; 3], b: &[Lane; 3], c: &[Lane; 3], lc: &Lane) {
        let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
        let (la, lb) = (lengths(a), lengths(b));
        for l in 0..LANES {
            let [ax, ay, az] = [a[0][l], a[1][l], a[2][l]];
            let [bx, by, bz] = [b[0][l], b[1][l], b[2][l]];
            let [cx, cy, cz] = [c[0][l], c[1][l], c[2][l]];
            let (ab, bc, ca) = (ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az);
            re[l] = (la[l] * lb[l] + ab) * lc[l] + bc * la[l] + ca * lb[l];
            im[l] = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
        }
        self.multiply(&re, &im);
    }

    /// Adds the angles of four complex numbers; a number on the real axis counts as no angle, which on a surface or
    /// curve gives the mean of both sides.
    #[inline(always)]
    pub(crate) fn multiply(&mut self, re: &Lane, im: &Lane) {
        for l in 0..LANES {
            let d = im[l];
            let c = if d == 0.0 { 1.0 } else { re[l] };
            let (a, b) = (self.re[l], self.im[l]);
            let (x, y) = (a * c - b * d, a * d + b * c);
            // Two angles of one sign whose sum lies past half a turn come out with the other sign.
            let up = if b.min(d) >= 0.0 && y < 0.0 { 1.0 } else { 0.0 };
            let down = if b.max(d) < 0.0 && y >= 0.0 { 1.0 } else { 0.0 };
            self.whole[l] += up - down;
            // A power of two that keeps the product near one: the exponent's bits mirrored.
            let scale = f64::from_bits(ONE_TWICE - ((x.abs() + y.abs()).to_bits() & EXPONENT));
            (self.re[l], self.im[l]) = (x * scale, y * scale);
        }
    }

    /// The sum of all angles in units of whole turns.
    pub(crate) fn total(&self) -> f64 {
        let mut turns = 0.0;
        for l in 0..LANES {
            // Adding zero turns -0 into 0, which lies on the upper side of the cut.
            turns += self.whole[l] + libm::atan2(self.im[l] + 0.0, self.re[l]) / std::f64::consts::TAU;
        }
        turns
    }
}

const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
/// The bits of 1 twice over: the exponents of a number and of the inverse of its power of two add up to this.
const ONE_TWICE: u64 = 0x7fe0_0000_0000_0000;

#[inline]
fn lengths([x, y, z]: &[Lane; 3]) -> Lane {
    std::array::from_fn(|l| (x[l] * x[l] + y[l] * y[l] + z[l] * z[l]).sqrt())
}

#[inline(always)]
fn offset(corner: [Lane; 3], p: [f64; 3]) -> [Lane; 3] {
    let mut out = corner;
    for axis in 0..3 {
        for l in 0..LANES {
            out[axis][l] -= p[axis];
        }
    }
    out
}

/// Packs triangles in order, four to a block.
pub(crate) fn triangle_blocks(triangles: &[[[f64; 3]; 3]]) -> Vec<TriangleBlock> {
    let chunks = triangles.chunks(LANES);
    chunks
        .map(|chunk| {
            let mut block = TriangleBlock::default();
            for (l, triangle) in chunk.iter().enumerate() {
                for corner in 0..3 {
                    for axis in 0..3 {
                        block.0[corner][axis][l] = triangle[corner][axis];
                    }
                }
            }
            block
        })
        .collect()
}

/// Further away than this no surface that passes validation turns by as much as rounding, and products of
/// three distances would overflow.
pub(crate) const FAR: f64 = 1e90;

/// Whether a query has to be answered without looking: not a number for one that is not finite, zero for one so far
/// away that distances overflow.
pub(crate) fn answer_without_looking(p: &[f64]) -> Option<f64> {
    if p.iter().any(|c| !c.is_finite()) {
        Some(f64::NAN)
    } else if p.iter().any(|c| c.abs() > FAR) {
        Some(0.0)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_add_up_as_angles_do() {
        let mut turns = Turns::new();
        let mut expected = 0.0;
        for step in 0..10_000 {
            let angle = 3.1 * (f64::from(step) * 0.7).sin() + 0.04;
            let size = 10.0_f64.powi(step % 200 - 100);
            turns.multiply(&[size * angle.cos(); LANES], &[size * angle.sin(); LANES]);
            expected += 4.0 * angle / std::f64::consts::TAU;
        }
        assert!((turns.total() - expected).abs() < 1e-9, "{} is not {expected}", turns.total());
    }

    #[test]
    fn the_real_axis_is_no_angle() {
        let mut turns = Turns::new();
        turns.multiply(&[-1.0, 0.0, 5.0, -0.0], &[0.0, -0.0, 0.0, 0.0]);
        assert!(turns.total().abs() < 1e-300);
        // Half a turn made of two quarters, both ways round, and then back.
        for sign in [1.0, -1.0] {
            let mut turns = Turns::new();
            turns.multiply(&[0.0; LANES], &[sign; LANES]);
            turns.multiply(&[0.0; LANES], &[sign; LANES]);
            assert!((turns.total() - 2.0 * sign).abs() < 1e-15);
            turns.multiply(&[0.0; LANES], &[-sign; LANES]);
            assert!((turns.total() - sign).abs() < 1e-15);
        }
    }
}
