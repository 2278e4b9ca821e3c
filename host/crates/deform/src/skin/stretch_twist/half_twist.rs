//! Sine and cosine of half the twist at a vertex's place along its bone.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use crate::lanes::Eight;
use crate::skin::blocks::Layer;

/// Sine and cosine of half the twist at the vertices of a layer, `ends` along its bones.
#[inline(always)]
pub(super) fn half_twist<E: Eight>(half_twists: &[[f32; 2]], layer: &Layer, ends: E) -> (E, E) {
    let [first, slope] = E::gather_twos(half_twists, &layer.bones);
    sine_and_cosine(first.plus_product(ends, slope))
}

/// The same on one bone.
#[inline(always)]
pub(super) fn half_twist_of<E: Eight>(half_twist: [f32; 2], ends: E) -> (E, E) {
    let [first, slope] = half_twist;
    let angle = E::splat(first).plus_product(ends, E::splat(slope));
    if first.abs().max((first + slope).abs()) < QUARTER_TURN {
        sine_and_cosine_within_a_quarter(angle)
    } else {
        sine_and_cosine(angle)
    }
}

/// A little less than one: rounds to zero in [`sine_and_cosine`].
const QUARTER_TURN: f32 = 1.57;

/// Sine and cosine, or both negated: for half an angle that is the same rotation. Errors below 4e-7 for some tens of
/// turns, and exactly 0 and 1 at 0.
#[inline(always)]
fn sine_and_cosine<E: Eight>(angle: E) -> (E, E) {
    let halves = (angle * E::splat(std::f32::consts::FRAC_1_PI)).round();
    // π in two parts, the first with so few bits that its product is exact.
    sine_and_cosine_within_a_quarter((angle - halves * E::splat(3.140_625)) - halves * E::splat(9.676_536e-4))
}

#[inline(always)]
fn sine_and_cosine_within_a_quarter<E: Eight>(x: E) -> (E, E) {
    let s = x * x;
    // Minimax polynomials for both within a quarter turn to either side.
    let sine = E::splat(-1.981_829e-4).plus_product(s, E::splat(2.622_532e-6));
    let sine = E::splat(-1.666_666_7e-1).plus_product(s, E::splat(8.333_206e-3).plus_product(s, sine));
    let cosine = E::splat(-1.385_414_2e-3).plus_product(s, E::splat(2.315_384_2e-5));
    let cosine = E::splat(-4.999_992_8e-1).plus_product(s, E::splat(4.166_377_7e-2).plus_product(s, cosine));
    (x.plus_product(x, s * sine), E::splat(1.0).plus_product(s, cosine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{EightKernel, LANES, with_eight};

    struct SineAndCosine(f32);

    impl EightKernel for SineAndCosine {
        type Output = [f32; 2];

        #[inline(always)]
        fn run<E: Eight>(self) -> [f32; 2] {
            let (sine, cosine) = sine_and_cosine(E::splat(self.0));
            let mut lanes = [[0.0; LANES]; 2];
            sine.store(&mut lanes[0]);
            cosine.store(&mut lanes[1]);
            lanes.map(|lane| lane[3])
        }
    }

    #[test]
    fn angles_of_any_size_turn_as_they_should() {
        for step in -4000..4000 {
            let angle = step as f32 * 0.01;
            let [sine, cosine] = with_eight(SineAndCosine(angle)).map(f64::from);
            let (s, c) = f64::from(angle).sin_cos();
            let sign = (s * sine + c * cosine).signum();
            assert!((sign * sine - s).abs() < 4e-7 && (sign * cosine - c).abs() < 4e-7, "{angle}: {sine} {cosine}");
        }
        assert_eq!(with_eight(SineAndCosine(0.0)).map(f32::to_bits), [0.0_f32, 1.0].map(f32::to_bits));
    }
}
