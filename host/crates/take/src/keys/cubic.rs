//! Few keys for cubic splines between them.

use glam::DVec4;

use super::curve::Curve;
use super::path::fewest_steps;

/// After this many frames in a row that one spline does not reach, the longest step so far is taken.
const PATIENCE: usize = 12;

/// How often the largest errors are given more weight before a spline is given up.
const ROUNDS: usize = 4;

/// A spline that is further off than this many times the bound is not improved.
const HOPELESS: f64 = 3.0;

/// A cubic Hermite spline from one frame to another, as glTF defines it: the value is normalised afterwards where it is
/// a rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spline {
    /// The change of the value a second, at the start and at the end, in single precision.
    pub(super) tangents: [DVec4; 2],
}

/// The frames that become keys, and the spline after each but the last. Tangents are fitted to the frames between two
/// keys, first by least squares, then towards the smallest largest error (Lawson's weights). Fewest among the splines
/// tried: not every step is, because what one spline cannot reach a longer one may.
pub(super) fn few_cubic_keys(curve: &impl Curve, bound: f64) -> (Vec<usize>, Vec<Spline>) {
    let keys = fewest_steps(curve.len(), &mut |steps| {
        let mut missed = 0;
        for to in steps.candidates() {
            if !steps.is_new(to) {
                continue;
            }
            if fit(curve, steps.from, to, bound).is_some() {
                steps.reach(to);
                missed = 0;
            } else {
                missed += 1;
            }
            if missed > PATIENCE {
                return;
            }
        }
    });
    let spline = |pair: &[usize]| fit(curve, pair[0], pair[1], bound).unwrap_or_else(|| chord(curve, pair[0], pair[1]));
    let splines = keys.windows(2).map(spline).collect();
    (keys, splines)
}

impl Spline {
    /// The value of the spline between two frames at a third.
    pub(super) fn at(&self, curve: &impl Curve, from: usize, to: usize, frame: usize) -> DVec4 {
        let span = curve.times()[to] - curve.times()[from];
        let [start, start_slope, end, end_slope] = hermite(curve.part(from, to, frame));
        curve.value(from) * start
            + self.tangents[0] * (span * start_slope)
            + curve.value(to) * end
            + self.tangents[1] * (span * end_slope)
    }
}

/// The four weights of a cubic Hermite spline: start, slope at the start, end, slope at the end.
fn hermite(s: f64) -> [f64; 4] {
    let (s2, s3) = (s * s, s * s * s);
    [2.0 * s3 - 3.0 * s2 + 1.0, s3 - 2.0 * s2 + s, 3.0 * s2 - 2.0 * s3, s3 - s2]
}

/// A straight line.
fn chord(curve: &impl Curve, from: usize, to: usize) -> Spline {
    let span = curve.times()[to] - curve.times()[from];
    let slope = single((curve.value(to) - curve.value(from)) / span);
    Spline { tangents: [slope; 2] }
}

fn single(value: DVec4) -> DVec4 {
    value.as_vec4().as_dvec4()
}

/// A spline that is within the bound of every frame between two.
fn fit(curve: &impl Curve, from: usize, to: usize, bound: f64) -> Option<Spline> {
    let mut spline = chord(curve, from, to);
    if to - from < 2 {
        return Some(spline);
    }
    let mut weights = vec![1.0; to - from - 1];
    for _ in 0..ROUNDS {
        spline = fitted(curve, from, to, &weights);
        let errors: Vec<f64> =
            (from + 1..to).map(|frame| curve.distance(spline.at(curve, from, to, frame), frame)).collect();
        let (largest, sum) = errors.iter().fold((0.0, 0.0), |(most, sum), error| (f64::max(most, *error), sum + error));
        if largest <= bound {
            return Some(spline);
        }
        if largest > HOPELESS * bound || !sum.is_finite() || errors.len() < 3 {
            return None;
        }
        let mean = sum / errors.len() as f64;
        weights.iter_mut().zip(&errors).for_each(|(weight, error)| *weight *= error / mean);
    }
    None
}

/// The tangents with the least weighted squares of errors; towards the straight line where the frames leave them open.
fn fitted(curve: &impl Curve, from: usize, to: usize, weights: &[f64]) -> Spline {
    let span = curve.times()[to] - curve.times()[from];
    let line = curve.value(to) - curve.value(from);
    let [mut aa, mut ab, mut bb] = [0.0; 3];
    let [mut av, mut bv] = [DVec4::ZERO; 2];
    for (frame, weight) in (from + 1..to).zip(weights) {
        let [start, a, end, b] = hermite(curve.part(from, to, frame));
        let left = curve.value(frame) - curve.value(from) * start - curve.value(to) * end - line * (a + b);
        (aa, ab, bb) = (aa + weight * a * a, ab + weight * a * b, bb + weight * b * b);
        (av, bv) = (av + left * (weight * a), bv + left * (weight * b));
    }
    let ridge = 1e-9 * (aa + bb) + f64::MIN_POSITIVE;
    let (aa, bb) = (aa + ridge, bb + ridge);
    let determinant = aa * bb - ab * ab;
    let start = line + (av * bb - bv * ab) / determinant;
    let end = line + (bv * aa - av * ab) / determinant;
    Spline { tangents: [single(start / span), single(end / span)] }
}
