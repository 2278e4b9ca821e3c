//! One point or many: what all winding number methods have in common.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::lanes::widest;

/// Further away than this, no valid surface turns by as much as rounding, and products of three distances would
/// overflow.
const FAR: f64 = 1e90;

/// Something that can evaluate a winding number in `D` dimensions.
pub(super) trait Field<const D: usize>: Sync {
    /// At a finite point that is not [`FAR`] away. The contents of `stack` before and after do not matter. Always
    /// inline.
    fn at<S: Simd>(&self, simd: S, point: [f64; D], stack: &mut Vec<u32>) -> f64;
}

/// The winding number at a point: NaN if the point is not finite.
pub(super) fn evaluate<const D: usize>(field: &impl Field<D>, point: [f64; D]) -> f64 {
    evaluate_with(field, point, &mut Vec::with_capacity(64))
}

/// [`evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
pub(super) fn evaluate_many<const D: usize>(field: &impl Field<D>, points: &[[f64; D]]) -> Vec<f64> {
    points.par_iter().map_init(|| Vec::with_capacity(64), |stack, &p| evaluate_with(field, p, stack)).collect()
}

fn evaluate_with<const D: usize>(field: &impl Field<D>, point: [f64; D], stack: &mut Vec<u32>) -> f64 {
    if point.iter().any(|c| !c.is_finite()) {
        f64::NAN
    } else if point.iter().any(|c| c.abs() > FAR) {
        0.0
    } else {
        widest(Query { field, point, stack })
    }
}

struct Query<'a, F, const D: usize> {
    field: &'a F,
    point: [f64; D],
    stack: &'a mut Vec<u32>,
}

impl<F: Field<D>, const D: usize> WithSimd for Query<'_, F, D> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        self.field.at(simd, self.point, self.stack)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support;
    use crate::winding::{FastWindingNumber, WindingNumberHierarchy};

    /// Wide registers give the same bits on this machine as narrow ones on any.
    #[test]
    fn wide_registers_change_no_bit() {
        let mesh = support::sphere(3);
        let fast = FastWindingNumber::precompute(&mesh).unwrap();
        let exact = WindingNumberHierarchy::precompute(&mesh).unwrap();
        let mut noise = support::noise();
        for _ in 0..500 {
            let p = [noise() * 1.5, noise() * 1.5, noise() * 1.5];
            let plain = |field: &dyn Fn(&mut Vec<u32>) -> f64| field(&mut Vec::new()).to_bits();
            let of_fast = plain(&|stack| fast.at(pulp::Scalar256b, p, stack));
            let of_exact = plain(&|stack| exact.at(pulp::Scalar256b, p, stack));
            assert_eq!((fast.evaluate(p).to_bits(), exact.evaluate(p).to_bits()), (of_fast, of_exact), "at {p:?}");
        }
    }
}
