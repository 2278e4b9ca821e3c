//! A curve through which endpoint weights can be filtered (thesis section 6.2.2, figure 6.9): it says how much of a
//! bone's twist and stretch has happened by each place along it, so that a twisted spine can turn in the abdomen and
//! leave the chest alone.

use crate::weight_matrix::WeightMatrix;

/// A smooth curve over 0..=1 with values in 0..=1, 0 at 0 and 1 at 1 (so that ends still meet their targets).
///
/// A piecewise cubic spline with slopes bounded as in Fritsch and Carlson (1980): between two of its points it is
/// monotone and never leaves the range between their values. With no points but the ends it is the identity.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineFilter {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
}

/// Why points do not make a filter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplineFilterError {
    /// A point is not within 0..=1, or its place is not between that of the previous point and 1.
    #[error("point {point} of a filter must be within 0..=1 and further along than the point before it")]
    Point {
        /// Zero-based point.
        point: usize,
    },
}

impl SplineFilter {
    /// Takes the points between the ends: `[place, value]`, both within 0..=1, places rising from above 0 to below 1.
    pub fn through(points: &[[f64; 2]]) -> Result<Self, SplineFilterError> {
        let mut all = vec![[0.0, 0.0]];
        for (number, &[place, value]) in points.iter().enumerate() {
            let rises = place > all[number][0] && place < 1.0;
            if !(rises && (0.0..=1.0).contains(&value)) {
                return Err(SplineFilterError::Point { point: number });
            }
            all.push([place, value]);
        }
        all.push([1.0, 1.0]);
        Ok(Self { slopes: slopes(&all), points: all })
    }

    /// All of its points, `[place, value]`, the ends among them.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// The filtered weight; weights outside 0..=1 are clamped.
    pub fn at(&self, weight: f64) -> f64 {
        let weight = if weight.is_nan() { 0.0 } else { weight.clamp(0.0, 1.0) };
        let after = self.points.partition_point(|[place, _]| *place <= weight).clamp(1, self.points.len() - 1);
        let ([from, low], [to, high]) = (self.points[after - 1], self.points[after]);
        let width = to - from;
        let t = (weight - from) / width;
        // The Hermite basis.
        let (s, squared) = (1.0 - t, t * t);
        let value = low * s * s * (1.0 + 2.0 * t)
            + high * squared * (3.0 - 2.0 * t)
            + width * (self.slopes[after - 1] * t * s * s - self.slopes[after] * squared * s);
        value.clamp(low.min(high), low.max(high))
    }

    /// The same for one bone of a chain that the curve runs along, from `start` to `end` of the chain's length: goes
    /// from 0 to 1 as the curve goes from its value at `start` to that at `end`. When the whole chain is twisted by an
    /// angle, each joint turns by [`at`](Self::at) times that angle. A bone over which the curve is level keeps its
    /// weights.
    pub fn at_in_chain(&self, start: f64, end: f64, weight: f64) -> f64 {
        let (first, last) = (self.at(start), self.at(end));
        if (last - first).abs() < 1e-9 {
            return weight.clamp(0.0, 1.0);
        }
        ((self.at(start + (end - start) * weight) - first) / (last - first)).clamp(0.0, 1.0)
    }

    /// Filters the endpoint weights of one bone (a column of n vertices × m bones); `false` if there is no such bone.
    pub fn apply(&self, endpoints: &mut WeightMatrix, bone: usize) -> bool {
        // Zero must stay zero.
        endpoints.column_mut(bone).is_some_and(|column| {
            column.iter_mut().for_each(|weight| *weight = self.at(*weight));
            true
        })
    }
}

fn slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let widths: Vec<f64> = points.windows(2).map(|p| p[1][0] - p[0][0]).collect();
    let rises: Vec<f64> = points.windows(2).zip(&widths).map(|(p, width)| (p[1][1] - p[0][1]) / width).collect();
    let last = rises.len() - 1;
    (0..points.len())
        .map(|point| match point {
            0 => rises[0],
            _ if point == points.len() - 1 => rises[last],
            _ => {
                let (before, after) = (rises[point - 1], rises[point]);
                if before * after <= 0.0 {
                    return 0.0;
                }
                // The harmonic mean of the neighbouring slopes, weighted by their widths (Fritsch and Butland 1984):
                // never more than three times the smaller one, which is what keeps a piece within its ends.
                let (a, b) = (2.0 * widths[point] + widths[point - 1], widths[point] + 2.0 * widths[point - 1]);
                (a + b) / (a / before + b / after)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_points_nothing_changes() {
        let identity = SplineFilter::through(&[]).unwrap();
        for step in 0..=100 {
            let weight = f64::from(step) / 100.0;
            assert!((identity.at(weight) - weight).abs() < 1e-15);
            assert!((identity.at_in_chain(0.3, 0.7, weight) - weight).abs() < 1e-12);
        }
        assert!(identity.at(-1.0) <= 0.0 && identity.at(2.0) >= 1.0 && identity.at(f64::NAN) <= 0.0);
    }

    #[test]
    fn a_filter_meets_its_points_stays_between_them_and_has_no_kinks() {
        let points = [[0.2, 0.05], [0.3, 0.7], [0.31, 0.71], [0.6, 0.72], [0.8, 0.4], [0.9, 0.4]];
        let filter = SplineFilter::through(&points).unwrap();
        let all: Vec<[f64; 2]> = [[0.0, 0.0]].into_iter().chain(points).chain([[1.0, 1.0]]).collect();
        for pair in all.windows(2) {
            let ([from, low], [to, high]) = (pair[0], pair[1]);
            let mut before = filter.at(from);
            assert!((before - low).abs() < 1e-12 && (filter.at(to) - high).abs() < 1e-12);
            for step in 1..=50 {
                let value = filter.at(from + (to - from) * f64::from(step) / 50.0);
                assert!(if high >= low { value >= before - 1e-12 } else { value <= before + 1e-12 });
                assert!((low.min(high)..=low.max(high)).contains(&value));
                before = value;
            }
        }
        let step = 1e-6;
        for &[place, value] in &points {
            let left = (value - filter.at(place - step)) / step;
            let right = (filter.at(place + step) - value) / step;
            assert!((left - right).abs() < 1e-2, "{place}: {left} {right}");
        }
    }

    #[test]
    fn a_chain_is_one_curve() {
        let filter = SplineFilter::through(&[[0.4, 0.8]]).unwrap();
        let joints = [0.0, 0.25, 0.7, 1.0];
        for (bone, ends) in joints.windows(2).enumerate() {
            for step in 0..=20 {
                let weight = f64::from(step) / 20.0;
                let [first, last] = [filter.at(ends[0]), filter.at(ends[1])];
                let twist = first + (last - first) * filter.at_in_chain(ends[0], ends[1], weight);
                let whole = filter.at(ends[0] + (ends[1] - ends[0]) * weight);
                assert!((twist - whole).abs() < 1e-12, "{bone} {weight}");
            }
        }
        let level = SplineFilter::through(&[[0.2, 0.5], [0.8, 0.5]]).unwrap();
        assert!((level.at_in_chain(0.3, 0.6, 0.4) - 0.4).abs() < 1e-12);
    }

    #[test]
    fn one_bone_is_filtered_and_nonsense_is_named() {
        let mut endpoints = WeightMatrix::from_columns(3, 2, &[0.0, 0.5, 1.0, 0.2, 0.5, 0.9]).unwrap();
        let filter = SplineFilter::through(&[[0.5, 0.25]]).unwrap();
        assert!(filter.apply(&mut endpoints, 0));
        assert_eq!(endpoints.to_columns().unwrap(), [0.0, 0.25, 1.0, 0.2, 0.5, 0.9]);
        assert!(!filter.apply(&mut endpoints, 2));
        for points in [&[[0.0, 0.5]][..], &[[1.0, 0.5]], &[[0.5, f64::NAN]], &[[0.5, 1.1]], &[[0.5, 0.1], [0.5, 0.2]]] {
            let point = points.len() - 1;
            assert_eq!(SplineFilter::through(points), Err(SplineFilterError::Point { point }));
        }
    }
}
