//! Additional weight functions, which let a reduced deformation do more than its few handles can (thesis 7.3.3): smooth
//! bumps in weight space, centred as far from each other and from the handles as possible, so that they keep the
//! character of the weights they are added to.
//!
//! ```
//! use armature_weights::{WeightMatrix, additional::{AdditionalSettings, additional_weights}};
//!
//! // Two handles at the ends of a line of 101 vertices.
//! let along: Vec<f64> = (0..=100).map(|k| f64::from(k) / 100.0).collect();
//! let columns: Vec<f64> = along.iter().map(|t| 1.0 - t).chain(along.iter().copied()).collect();
//! let weights = WeightMatrix::from_columns(101, 2, &columns).ok_or("sizes differ")?;
//! let more = additional_weights(&weights, &AdditionalSettings { count: 3, ..AdditionalSettings::default() })?;
//! assert_eq!((more.centres.len(), more.weights.weight(0, 0)), (3, 0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use rayon::prelude::*;

use crate::weight_matrix::WeightMatrix;

/// How many functions to add, and how long to move their centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdditionalSettings {
    /// Number of functions wanted. The thesis adds 15 to five handles and 30 to two.
    pub count: usize,
    /// Maximum rounds; each round moves every centre once.
    pub max_rounds: usize,
}

impl Default for AdditionalSettings {
    /// Fifteen as in thesis figure 7.9; centres usually settle within five to twenty rounds.
    fn default() -> Self {
        Self { count: 15, max_rounds: 50 }
    }
}

/// How the search for centres ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdditionalOutcome {
    /// No centre can be moved farther from the others.
    Settled,
    /// The limit on rounds was reached. The functions are still usable.
    RoundLimit,
}

/// Additional weight functions.
#[derive(Clone, Debug, PartialEq)]
pub struct AdditionalWeights {
    /// n vertices × p functions, each within 0..=1: 1 at its centre, and exactly 0 where a handle has weight 1. They do
    /// not sum to one and need not: the handles' weights do.
    pub weights: WeightMatrix,
    /// The vertex at each function's centre. Fewer than wanted if the weights have too few distinct values.
    pub centres: Vec<usize>,
    /// The distance from its centre, in weight space, at which each function reaches zero.
    pub radii: Vec<f64>,
    /// Rounds done.
    pub rounds: usize,
    /// How the search ended.
    pub outcome: AdditionalOutcome,
}

/// Why additional weights could not be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AdditionalError {
    /// There are no vertices or no handles.
    #[error("the weights are for {vertices} vertices and {handles} handles; at least one of each is needed")]
    Empty {
        /// Vertices.
        vertices: usize,
        /// Handles.
        handles: usize,
    },
    /// A weight is NaN or infinite.
    #[error("vertex {vertex} has weight {weight} on handle {handle}; weights must be finite")]
    NotFinite {
        /// Zero-based vertex.
        vertex: usize,
        /// Zero-based handle.
        handle: usize,
        /// The value.
        weight: f64,
    },
    /// The functions do not fit in memory.
    #[error("not enough memory for {count} functions on {vertices} vertices")]
    OutOfMemory {
        /// Vertices.
        vertices: usize,
        /// Functions wanted.
        count: usize,
    },
}

/// Points in weight space closer than this to each other or to a corner count as one: no function fits between them.
const SAME: f64 = 1e-3;
/// A centre is moved only if that takes it farther from the others by this fraction, so that the search terminates.
const FARTHER: f64 = 1e-9;

/// Computes functions to add to the weights of m handles on n vertices, which sum to one at every vertex.
///
/// Centres are vertices. The search considers every vertex instead of the thesis's random sample, so equal input gives
/// equal functions whatever the number of threads. Each round takes O(n · p · (m + p)) time.
pub fn additional_weights(
    weights: &WeightMatrix,
    settings: &AdditionalSettings,
) -> Result<AdditionalWeights, AdditionalError> {
    let (n, handles) = (weights.vertices(), weights.bones());
    if n == 0 || handles == 0 {
        return Err(AdditionalError::Empty { vertices: n, handles });
    }
    for handle in 0..handles {
        if let Some((vertex, weight)) = weights.column(handle).find(|(_, weight)| !weight.is_finite()) {
            return Err(AdditionalError::NotFinite { vertex, handle, weight });
        }
    }
    let count = settings.count.min(n);
    let out_of_memory = AdditionalError::OutOfMemory { vertices: n, count };
    let mut distances: Vec<f64> = Vec::new();
    let entries = n.checked_mul(count).ok_or(out_of_memory)?;
    distances.try_reserve_exact(entries).map_err(|_| out_of_memory)?;
    let mut seeds = Seeds { space: WeightSpace::new(weights), centres: Vec::new(), distances };
    seeds.spread(count);
    let mut rounds = 0;
    let mut outcome = AdditionalOutcome::Settled;
    while seeds.improve() {
        rounds += 1;
        if rounds >= settings.max_rounds {
            outcome = AdditionalOutcome::RoundLimit;
            break;
        }
    }
    let radii: Vec<f64> =
        (0..seeds.centres.len()).map(|seed| 2.0 * seeds.clearance(seeds.centres[seed], Some(seed))).collect();
    let mut values = seeds.distances;
    for (column, radius) in values.chunks_exact_mut(n).zip(&radii) {
        column.iter_mut().for_each(|distance| *distance = bump(*distance / radius));
    }
    let weights = WeightMatrix::from_columns(n, radii.len(), &values).ok_or(out_of_memory)?;
    Ok(AdditionalWeights { weights, centres: seeds.centres, radii, rounds, outcome })
}

/// The cubic B-spline as a function of the distance from its centre, scaled to 1 there and to reach 0 at `t = 1`.
fn bump(t: f64) -> f64 {
    let u = 2.0 * t;
    match u {
        u if u < 1.0 => 1.0 - 0.75 * u * u * (2.0 - u),
        u if u < 2.0 => 0.25 * (2.0 - u).powi(3),
        _ => 0.0,
    }
}

/// Each vertex as a point in weight space.
struct WeightSpace {
    /// n×m, row by row.
    points: Vec<f64>,
    dimension: usize,
    /// Half of each point's distance to the nearest corner (where one handle has weight 1).
    half_to_corner: Vec<f64>,
}

impl WeightSpace {
    fn new(weights: &WeightMatrix) -> Self {
        let (n, dimension) = (weights.vertices(), weights.bones());
        let mut points = vec![0.0; n * dimension];
        for handle in 0..dimension {
            weights.column(handle).for_each(|(vertex, weight)| points[vertex * dimension + handle] = weight);
        }
        let half_to_corner = points
            .par_chunks_exact(dimension)
            .map(|point| {
                let corner = (0..dimension).map(|k| {
                    let square = |(j, w): (usize, &f64)| (w - f64::from(u8::from(j == k))).powi(2);
                    point.iter().enumerate().map(square).sum::<f64>()
                });
                0.5 * corner.fold(f64::INFINITY, f64::min).sqrt()
            })
            .collect();
        Self { points, dimension, half_to_corner }
    }

    fn point(&self, vertex: usize) -> &[f64] {
        &self.points[vertex * self.dimension..(vertex + 1) * self.dimension]
    }

    fn vertices(&self) -> usize {
        self.half_to_corner.len()
    }
}

/// The centres, and how far every vertex is from each of them.
struct Seeds {
    space: WeightSpace,
    centres: Vec<usize>,
    /// p×n, row by row.
    distances: Vec<f64>,
}

impl Seeds {
    /// Adds centres one by one, each as far as possible from those before it.
    fn spread(&mut self, count: usize) {
        while self.centres.len() < count {
            let (farthest, clearance) = self.farthest(None);
            if clearance < SAME {
                break;
            }
            self.centres.push(farthest);
            let row = self.distances_from(farthest);
            self.distances.extend(row);
        }
    }

    /// Moves every centre once to where it is farthest from the others (thesis eq. 7.20). Returns whether any moved.
    fn improve(&mut self) -> bool {
        let n = self.space.vertices();
        let mut moved = false;
        for seed in 0..self.centres.len() {
            let (farthest, clearance) = self.farthest(Some(seed));
            if clearance > (1.0 + FARTHER) * self.clearance(self.centres[seed], Some(seed)) {
                self.centres[seed] = farthest;
                let row = self.distances_from(farthest);
                self.distances[seed * n..(seed + 1) * n].copy_from_slice(&row);
                moved = true;
            }
        }
        moved
    }

    /// The vertex farthest from all centres but one (the first of several), and its distance.
    fn farthest(&self, except: Option<usize>) -> (usize, f64) {
        let better = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 || (b.1 >= a.1 && b.0 < a.0) { b } else { a };
        (0..self.space.vertices())
            .into_par_iter()
            .with_min_len(1024)
            .map(|vertex| (vertex, self.clearance(vertex, except)))
            .reduce(|| (usize::MAX, f64::NEG_INFINITY), better)
    }

    /// `d_i` (thesis eq. 7.21) of a vertex: its distance from all centres but the i-th, or half its distance from the
    /// nearest corner, whichever is less.
    fn clearance(&self, vertex: usize, except: Option<usize>) -> f64 {
        let n = self.space.vertices();
        let others = (0..self.centres.len()).filter(|seed| Some(*seed) != except);
        others.map(|seed| self.distances[seed * n + vertex]).fold(self.space.half_to_corner[vertex], f64::min)
    }

    fn distances_from(&self, centre: usize) -> Vec<f64> {
        let centre = self.space.point(centre);
        let apart = |point: &[f64]| point.iter().zip(centre).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        self.space.points.par_chunks_exact(self.space.dimension).with_min_len(1024).map(apart).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two handles at the ends of a line, and a third beside its middle.
    fn line(vertices: usize) -> WeightMatrix {
        let along = |k: usize| k as f64 / (vertices - 1) as f64;
        let third = |k: usize| 0.5 * (1.0 - (2.0 * along(k) - 1.0).powi(2));
        let columns: [Vec<f64>; 3] = [
            (0..vertices).map(|k| (1.0 - third(k)) * (1.0 - along(k))).collect(),
            (0..vertices).map(|k| (1.0 - third(k)) * along(k)).collect(),
            (0..vertices).map(third).collect(),
        ];
        WeightMatrix::from_columns(vertices, 3, &columns.concat()).unwrap()
    }

    #[test]
    fn functions_are_bumps_that_vanish_at_handles() {
        let found = additional_weights(&line(400), &AdditionalSettings { count: 6, max_rounds: 100 }).unwrap();
        assert_eq!((found.outcome, found.centres.len()), (AdditionalOutcome::Settled, 6));
        for (seed, &centre) in found.centres.iter().enumerate() {
            let column = found.weights.bone(seed);
            assert!(column.iter().all(|w| (0.0..=1.0).contains(w)) && (column[centre] - 1.0).abs() < 1e-12);
            assert_eq!((column[0], column[399]), (0.0, 0.0), "at the handles");
            let steepest = column.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
            assert!(steepest < 0.1, "{steepest}");
            assert!(column.iter().filter(|w| **w > 0.0).count() < 390, "local");
        }
    }

    #[test]
    fn moving_centres_spreads_them() {
        let weights = line(997);
        let narrowest = |max_rounds: usize| {
            let found = additional_weights(&weights, &AdditionalSettings { count: 7, max_rounds }).unwrap();
            found.radii.iter().copied().fold(f64::INFINITY, f64::min)
        };
        let rounds: Vec<f64> = [1, 2, 4, 8, 100].map(narrowest).to_vec();
        assert!(rounds.is_sorted() && rounds[4] > 1.02 * rounds[0], "{rounds:?}");
    }

    #[test]
    fn the_bump_is_the_cubic_spline() {
        for (t, wanted) in [(0.0, 1.0), (0.5, 0.25), (1.0, 0.0), (3.0, 0.0)] {
            assert!((bump(t) - wanted).abs() < 1e-15, "{t}");
        }
        // Copies half a radius apart sum to a constant.
        for t in [0.0, 0.1, 0.37, 0.49] {
            let sum: f64 = (-2..=2).map(|shift| bump((t + 0.5 * f64::from(shift)).abs())).sum();
            assert!((sum - 1.5).abs() < 1e-12, "{sum} at {t}");
        }
    }

    #[test]
    fn few_different_weights_give_few_functions() {
        let rigid = WeightMatrix::from_columns(4, 2, &[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]).unwrap();
        let found = additional_weights(&rigid, &AdditionalSettings::default()).unwrap();
        assert!(found.centres.is_empty() && found.weights.bones() == 0);
        let one_between = WeightMatrix::from_columns(3, 2, &[1.0, 0.5, 0.0, 0.0, 0.5, 1.0]).unwrap();
        assert_eq!(additional_weights(&one_between, &AdditionalSettings::default()).unwrap().centres, [1]);
    }

    #[test]
    fn threads_change_no_bit() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| additional_weights(&line(5000), &AdditionalSettings::default()).unwrap())
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn nonsense_is_named() {
        let settings = AdditionalSettings::default();
        let none = additional_weights(&WeightMatrix::default(), &settings);
        assert_eq!(none, Err(AdditionalError::Empty { vertices: 0, handles: 0 }));
        let bad = WeightMatrix::from_columns(2, 2, &[1.0, 0.0, 0.0, f64::NAN]).unwrap();
        assert!(matches!(
            additional_weights(&bad, &settings),
            Err(AdditionalError::NotFinite { vertex: 1, handle: 1, .. })
        ));
        let none = AdditionalSettings { count: 0, ..settings };
        assert!(additional_weights(&line(9), &none).unwrap().centres.is_empty());
    }
}
