//! Sums of angles without an arctangent per term: the angles are multiplied up as complex numbers, and half turns that
//! the product cannot represent are counted.

use pulp::Simd;

use super::lanes::{LANES, Lane, load, store};

/// Up to four triangles, `[corner][axis][lane]`; unused lanes are all zero and span nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TriangleBlock([[Lane; 3]; 3]);

/// Up to four directed edges that form triangles with an apex kept elsewhere, `[end][axis][lane]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct FanBlock([[Lane; 3]; 2]);

/// A running sum of angles in `(-π, π]`, four at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turns<S: Simd> {
    pub(super) simd: S,
    re: S::f64s,
    im: S::f64s,
    /// Whole turns that the product has lost.
    whole: S::f64s,
}

/// From a point to corners.
type Offset<S> = [<S as Simd>::f64s; 3];

impl<S: Simd> Turns<S> {
    #[inline(always)]
    pub(super) fn new(simd: S) -> Self {
        let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
        Self { simd, re: one, im: zero, whole: zero }
    }

    /// Adds the angles of one complex number per lane.
    #[inline(always)]
    pub(super) fn add<B>(&mut self, blocks: &[B], number: impl Fn(&B) -> [S::f64s; 2]) {
        let mut turns = *self;
        for block in blocks {
            turns.multiply(number(block));
        }
        *self = turns;
    }

    /// Adds half the solid angles of triangles seen from `p` (van Oosterom and Strackee 1983; thesis eq. 8.6).
    #[inline(always)]
    pub(super) fn add_triangles(&mut self, blocks: &[TriangleBlock], p: [f64; 3]) {
        let s = self.simd;
        let p = [s.splat_f64s(p[0]), s.splat_f64s(p[1]), s.splat_f64s(p[2])];
        self.add(
            blocks,
            #[inline(always)]
            |TriangleBlock([a, b, c])| {
                let c = offset(s, c, p);
                solid(s, [offset(s, a, p), offset(s, b, p), c], length(s, c))
            },
        );
    }

    /// Adds half the solid angles of the triangles from edges to an apex.
    #[inline(always)]
    pub(super) fn add_fan(&mut self, blocks: &[FanBlock], apex: [f64; 3], p: [f64; 3]) {
        let s = self.simd;
        let p = [s.splat_f64s(p[0]), s.splat_f64s(p[1]), s.splat_f64s(p[2])];
        let c = offset(s, &[[apex[0]; LANES], [apex[1]; LANES], [apex[2]; LANES]], p);
        let lc = length(s, c);
        self.add(
            blocks,
            #[inline(always)]
            |FanBlock([a, b])| solid(s, [offset(s, a, p), offset(s, b, p), c], lc),
        );
    }

    /// Adds the angles of complex numbers; one on the real axis counts as no angle, which on a surface or curve gives
    /// the mean of both sides.
    #[inline(always)]
    fn multiply(&mut self, [c, d]: [S::f64s; 2]) {
        let s = self.simd;
        let (zero, one) = (s.splat_f64s(0.0), s.splat_f64s(1.0));
        let c = s.select_f64s(s.equal_f64s(d, zero), one, c);
        let (a, b) = (self.re, self.im);
        let x = s.sub_f64s(s.mul_f64s(a, c), s.mul_f64s(b, d));
        let y = s.add_f64s(s.mul_f64s(a, d), s.mul_f64s(b, c));
        // Two angles of one sign whose sum lies past half a turn come out with the other sign.
        let below = s.less_than_f64s(y, zero);
        let up = s.and_m64s(s.greater_than_or_equal_f64s(s.min_f64s(b, d), zero), below);
        let down = s.and_m64s(s.less_than_f64s(s.max_f64s(b, d), zero), s.not_m64s(below));
        let turned = s.select_f64s(up, one, s.select_f64s(down, s.splat_f64s(-1.0), zero));
        self.whole = s.add_f64s(self.whole, turned);
        // A power of two that keeps the product near one: the exponent's bits mirrored.
        let size = s.transmute_u64s_f64s(s.add_f64s(s.abs_f64s(x), s.abs_f64s(y)));
        let scale = s.sub_u64s(s.splat_u64s(ONE_TWICE), s.and_u64s(size, s.splat_u64s(EXPONENT)));
        let scale = s.transmute_f64s_u64s(scale);
        (self.re, self.im) = (s.mul_f64s(x, scale), s.mul_f64s(y, scale));
    }

    /// The sum of all angles in units of whole turns.
    #[inline(always)]
    pub(super) fn total(&self) -> f64 {
        let (re, im, whole) = (store::<S>(self.re), store::<S>(self.im), store::<S>(self.whole));
        let mut turns = 0.0;
        for l in 0..LANES {
            // Adding zero turns -0 into 0, which lies on the upper side of the cut.
            turns += whole[l] + libm::atan2(im[l] + 0.0, re[l]) / std::f64::consts::TAU;
        }
        turns
    }
}

const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
/// The bits of 1 twice over: the exponents of a number and of the inverse of its power of two add up to this.
const ONE_TWICE: u64 = 0x7fe0_0000_0000_0000;

/// The complex number whose angle is half the solid angle of a triangle; `lc` is the length of `c`.
#[inline(always)]
fn solid<S: Simd>(s: S, [a, b, c]: [Offset<S>; 3], lc: S::f64s) -> [S::f64s; 2] {
    let (la, lb) = (length(s, a), length(s, b));
    let (ab, bc, ca) = (dot(s, a, b), dot(s, b, c), dot(s, c, a));
    // (la lb + ab) lc + bc la + ca lb
    let re = s.mul_f64s(s.add_f64s(s.mul_f64s(la, lb), ab), lc);
    let re = s.add_f64s(s.add_f64s(re, s.mul_f64s(bc, la)), s.mul_f64s(ca, lb));
    [re, dot(s, a, cross(s, b, c))]
}

#[inline(always)]
fn offset<S: Simd>(s: S, corner: &[Lane; 3], p: [S::f64s; 3]) -> Offset<S> {
    [
        s.sub_f64s(load::<S>(&corner[0]), p[0]),
        s.sub_f64s(load::<S>(&corner[1]), p[1]),
        s.sub_f64s(load::<S>(&corner[2]), p[2]),
    ]
}

#[inline(always)]
fn dot<S: Simd>(s: S, a: Offset<S>, b: Offset<S>) -> S::f64s {
    s.add_f64s(s.add_f64s(s.mul_f64s(a[0], b[0]), s.mul_f64s(a[1], b[1])), s.mul_f64s(a[2], b[2]))
}

#[inline(always)]
fn cross<S: Simd>(s: S, a: Offset<S>, b: Offset<S>) -> Offset<S> {
    [
        s.sub_f64s(s.mul_f64s(a[1], b[2]), s.mul_f64s(a[2], b[1])),
        s.sub_f64s(s.mul_f64s(a[2], b[0]), s.mul_f64s(a[0], b[2])),
        s.sub_f64s(s.mul_f64s(a[0], b[1]), s.mul_f64s(a[1], b[0])),
    ]
}

#[inline(always)]
fn length<S: Simd>(s: S, a: Offset<S>) -> S::f64s {
    s.sqrt_f64s(dot(s, a, a))
}

/// Packs triangles in order, four to a block.
pub(super) fn triangle_blocks(triangles: &[[[f64; 3]; 3]]) -> Vec<TriangleBlock> {
    triangles.chunks(LANES).map(|chunk| TriangleBlock(lanes_of(chunk, [0.0; 3]))).collect()
}

/// Packs edges to an apex in order, four to a block; unused lanes repeat the apex, which spans nothing.
pub(super) fn fan_blocks(edges: &[[[f64; 3]; 2]], apex: [f64; 3]) -> Vec<FanBlock> {
    edges.chunks(LANES).map(|chunk| FanBlock(lanes_of(chunk, apex))).collect()
}

fn lanes_of<const K: usize>(items: &[[[f64; 3]; K]], unused: [f64; 3]) -> [[Lane; 3]; K] {
    let at = |k: usize, axis: usize, lane: usize| items.get(lane).map_or(unused, |item| item[k])[axis];
    std::array::from_fn(|k| std::array::from_fn(|axis| std::array::from_fn(|lane| at(k, axis, lane))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four complex numbers, `[re, im]`, in a block.
    fn sum_of(blocks: &[[Lane; 2]]) -> f64 {
        let mut turns = Turns::new(pulp::Scalar256b);
        turns.add(blocks, |block| [load::<pulp::Scalar256b>(&block[0]), load::<pulp::Scalar256b>(&block[1])]);
        turns.total()
    }

    #[test]
    fn turns_add_up_as_angles_do() {
        let mut blocks = Vec::new();
        let mut expected = 0.0;
        for step in 0..10_001 {
            let angle = 3.1 * (f64::from(step) * 0.7).sin() + 0.04;
            let size = 10.0_f64.powi(step % 200 - 100);
            blocks.push([[size * angle.cos(); LANES], [size * angle.sin(); LANES]]);
            expected += 4.0 * angle / std::f64::consts::TAU;
        }
        let sum = sum_of(&blocks);
        assert!((sum - expected).abs() < 1e-9, "{sum} is not {expected}");
    }

    #[test]
    fn the_real_axis_is_no_angle() {
        assert!(sum_of(&[[[-1.0, 0.0, 5.0, -0.0], [0.0, -0.0, 0.0, 0.0]]]).abs() < 1e-300);
        // Half a turn made of two quarters in each lane, both ways round, and then back.
        for sign in [1.0, -1.0] {
            let quarter = [[0.0; LANES], [sign; LANES]];
            let back = [[0.0; LANES], [-sign; LANES]];
            assert!((sum_of(&[quarter, quarter]) - 2.0 * sign).abs() < 1e-15);
            assert!((sum_of(&[quarter, quarter, back]) - sign).abs() < 1e-15);
        }
    }
}
