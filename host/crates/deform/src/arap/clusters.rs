//! Groups of edge sets that share a rotation: k-means clustering in weight space (thesis 7.3.2).
//!
//! Points have as many coordinates as there are handles, nearly all of them zero. A centre that shares no coordinate with
//! a point is as far away as their lengths say, so that only the few others are compared coordinate by coordinate: the
//! time grows with the number of points, not with points × centres × handles. What is found is what comparing all would
//! find, bit for bit.

use std::collections::HashMap;

use rayon::prelude::*;

/// Rounds of Lloyd's algorithm; assigning 90k points to 34 clusters converges in 20 to 60, and the last rounds move few
/// points.
const ROUNDS: usize = 60;
/// What rounding can make of a squared distance, relative.
const ROUNDING: f64 = 1e-12;

/// A point or centre: its coordinates that are not zero, ascending.
pub(super) type Sparse = [(u32, f64)];

/// Points one after the other.
#[derive(Clone, Debug)]
pub(super) struct SparsePoints {
    starts: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Default for SparsePoints {
    fn default() -> Self {
        Self { starts: vec![0], entries: Vec::new() }
    }
}

impl SparsePoints {
    pub(super) fn push(&mut self, point: impl IntoIterator<Item = (u32, f64)>) {
        self.entries.extend(point.into_iter().filter(|(_, value)| *value != 0.0));
        self.starts.push(self.entries.len());
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn of(&self, point: usize) -> &Sparse {
        &self.entries[self.starts[point]..self.starts[point + 1]]
    }

    fn squared_lengths(&self) -> Vec<f64> {
        (0..self.len()).map(|point| squared_distance(self.of(point), &[])).collect()
    }

    /// For every coordinate, the points in which it is not zero, ascending.
    fn by_coordinate(&self, dimension: usize) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); dimension];
        for point in 0..self.len() {
            self.of(point).iter().for_each(|(coordinate, _)| lists[*coordinate as usize].push(point as u32));
        }
        lists
    }
}

/// Assigns each of the points (of this many coordinates) to one of at most `wanted` clusters.
///
/// Starts from seeded k-means++, so equal input gives equal clusters on any number of threads. Returns the cluster of
/// each point and the number of clusters: fewer than wanted if there are fewer distinct points.
pub(super) fn rotation_clusters(
    points: &SparsePoints,
    dimension: usize,
    wanted: usize,
    seed: u64,
) -> (Vec<u32>, usize) {
    let count = points.len();
    if wanted >= count {
        return ((0..count as u32).collect(), count);
    }
    let Distinct { points, times, of_point } = distinct(points);
    let mut centres = spread_centres(&points, &times, dimension, wanted, seed);
    let mut cluster_of = vec![u32::MAX; times.len()];
    for _ in 0..ROUNDS {
        let search = Search::new(&centres, dimension);
        let moved: usize = cluster_of
            .par_iter_mut()
            .enumerate()
            .with_min_len(1024)
            .map_init(
                || vec![u32::MAX; centres.len()],
                |seen, (point, own)| {
                    let nearest = search.nearest(points.of(point), point as u32, seen);
                    usize::from(std::mem::replace(own, nearest) != nearest)
                },
            )
            .sum();
        if moved == 0 {
            break;
        }
        centres = means(&points, &times, &cluster_of, &centres, dimension);
    }
    let (cluster_of, used) = without_gaps(cluster_of, centres.len());
    (of_point.into_iter().map(|own| cluster_of[own as usize]).collect(), used)
}

/// Points without repetitions, and how often each occurs. Wherever a single bone moves the shape, which is most of it,
/// all points are the same.
struct Distinct {
    points: SparsePoints,
    times: Vec<f64>,
    of_point: Vec<u32>,
}

fn distinct(all: &SparsePoints) -> Distinct {
    let mut numbers: HashMap<Vec<(u32, u64)>, u32> = HashMap::new();
    let mut distinct = Distinct { points: SparsePoints::default(), times: Vec::new(), of_point: Vec::new() };
    let mut key = Vec::new();
    for point in 0..all.len() {
        key.clear();
        key.extend(all.of(point).iter().map(|(coordinate, value)| (*coordinate, value.to_bits())));
        let number = numbers.get(&key).copied().unwrap_or_else(|| {
            let number = distinct.times.len() as u32;
            numbers.insert(key.clone(), number);
            distinct.points.push(all.of(point).iter().copied());
            distinct.times.push(0.0);
            number
        });
        distinct.times[number as usize] += 1.0;
        distinct.of_point.push(number);
    }
    distinct
}

/// Centres, arranged to find the nearest one.
struct Search<'a> {
    centres: &'a SparsePoints,
    squared: Vec<f64>,
    by_coordinate: Vec<Vec<u32>>,
    /// From the one nearest to the origin outwards.
    outwards: Vec<u32>,
}

impl<'a> Search<'a> {
    fn new(centres: &'a SparsePoints, dimension: usize) -> Self {
        let squared = centres.squared_lengths();
        let mut outwards: Vec<u32> = (0..centres.len() as u32).collect();
        outwards.sort_by(|a, b| squared[*a as usize].total_cmp(&squared[*b as usize]));
        Self { centres, squared, by_coordinate: centres.by_coordinate(dimension), outwards }
    }

    /// The nearest centre, of several the first. `seen` holds for each centre the last point it was compared with.
    fn nearest(&self, point: &Sparse, number: u32, seen: &mut [u32]) -> u32 {
        let mut best = (0, f64::INFINITY);
        let mut compare = |centre: u32| {
            let distance = squared_distance(point, self.centres.of(centre as usize));
            if distance.total_cmp(&best.1).then(centre.cmp(&best.0)).is_lt() {
                best = (centre, distance);
            }
            best.1
        };
        let mut nearest = f64::INFINITY;
        for (coordinate, _) in point {
            for &centre in &self.by_coordinate[*coordinate as usize] {
                if std::mem::replace(&mut seen[centre as usize], number) != number {
                    nearest = compare(centre);
                }
            }
        }
        let own = squared_distance(point, &[]);
        for &centre in &self.outwards {
            if (own + self.squared[centre as usize]) * (1.0 - ROUNDING) > nearest {
                break;
            }
            if seen[centre as usize] != number {
                nearest = compare(centre);
            }
        }
        best.0
    }
}

/// Summed in the order of the coordinates.
fn squared_distance(a: &Sparse, b: &Sparse) -> f64 {
    let (mut i, mut j, mut sum) = (0, 0, 0.0);
    while i < a.len() || j < b.len() {
        let at = |list: &Sparse, place: usize| list.get(place).map_or(u32::MAX, |(coordinate, _)| *coordinate);
        let (of_a, of_b) = (at(a, i), at(b, j));
        let mut difference = 0.0;
        if of_a <= of_b {
            difference += a[i].1;
            i += 1;
        }
        if of_b <= of_a {
            difference -= b[j].1;
            j += 1;
        }
        sum += difference * difference;
    }
    sum
}

/// Centres drawn one by one with probability proportional to the squared distance from those already chosen (Arthur and
/// Vassilvitskii 2007).
fn spread_centres(points: &SparsePoints, times: &[f64], dimension: usize, wanted: usize, seed: u64) -> SparsePoints {
    let count = points.len();
    let (squared, by_coordinate) = (points.squared_lengths(), points.by_coordinate(dimension));
    let mut state = seed;
    let mut first = (split_mix(&mut state) % count as u64) as usize;
    let mut centres = SparsePoints::default();
    let mut distances = vec![f64::INFINITY; count];
    let mut shares = vec![false; count];
    loop {
        let centre = points.of(first);
        centres.push(centre.iter().copied());
        let near = || centre.iter().flat_map(|(coordinate, _)| &by_coordinate[*coordinate as usize]);
        near().for_each(|point| shares[*point as usize] = true);
        let mut total = 0.0;
        for point in 0..count {
            let apart = (squared[point] + squared[first]) * (1.0 - ROUNDING);
            if shares[point] || apart < distances[point] {
                distances[point] = distances[point].min(squared_distance(points.of(point), centre));
            }
            total += distances[point] * times[point];
        }
        near().for_each(|point| shares[*point as usize] = false);
        if centres.len() == wanted || total <= 0.0 {
            return centres;
        }
        let mut left = total * (split_mix(&mut state) >> 11) as f64 / (1_u64 << 53) as f64;
        first = count - 1;
        for (i, (distance, times)) in distances.iter().zip(times).enumerate() {
            left -= distance * times;
            if left < 0.0 {
                first = i;
                break;
            }
        }
    }
}

/// The means of the clusters; one that has lost all its points stays where it was.
fn means(
    points: &SparsePoints,
    times: &[f64],
    cluster_of: &[u32],
    before: &SparsePoints,
    dimension: usize,
) -> SparsePoints {
    let mut starts = vec![0_usize; before.len() + 1];
    cluster_of.iter().for_each(|cluster| starts[*cluster as usize + 1] += 1);
    (0..before.len()).for_each(|cluster| starts[cluster + 1] += starts[cluster]);
    let mut next = starts.clone();
    let mut members = vec![0_u32; cluster_of.len()];
    for (point, cluster) in cluster_of.iter().enumerate() {
        let place = &mut next[*cluster as usize];
        members[*place] = point as u32;
        *place += 1;
    }
    let mut sums = vec![0.0; dimension];
    let mut used = Vec::new();
    let mut out = SparsePoints::default();
    for cluster in 0..before.len() {
        let members = &members[starts[cluster]..starts[cluster + 1]];
        if members.is_empty() {
            out.push(before.of(cluster).iter().copied());
            continue;
        }
        let mut size = 0.0;
        for &point in members {
            let times = times[point as usize];
            size += times;
            for (coordinate, value) in points.of(point as usize) {
                used.push(*coordinate);
                sums[*coordinate as usize] += times * value;
            }
        }
        used.sort_unstable();
        used.dedup();
        out.push(used.drain(..).map(|coordinate| (coordinate, std::mem::take(&mut sums[coordinate as usize]) / size)));
    }
    out
}

fn without_gaps(mut cluster_of: Vec<u32>, count: usize) -> (Vec<u32>, usize) {
    let mut used = vec![false; count];
    cluster_of.iter().for_each(|&c| used[c as usize] = true);
    let mut next = 0;
    let renamed: Vec<u32> = used
        .iter()
        .map(|&used| {
            next += u32::from(used);
            next.saturating_sub(1)
        })
        .collect();
    cluster_of.iter_mut().for_each(|c| *c = renamed[*c as usize]);
    (cluster_of, next as usize)
}

/// `SplitMix64` (Steele, Lea and Flood 2014).
fn split_mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sparse(rows: &[Vec<f64>]) -> SparsePoints {
        let mut points = SparsePoints::default();
        rows.iter().for_each(|row| points.push((0..).zip(row.iter().copied())));
        points
    }

    #[test]
    fn clumps_are_found_whatever_the_seed() {
        let jitter = |i: u32| f64::from(i * 37 % 101) * 1e-4;
        let points: Vec<Vec<f64>> =
            (0..400_u32).map(|i| vec![f64::from(i % 4) + jitter(i), f64::from(i % 2) - jitter(i)]).collect();
        let points = sparse(&points);
        for seed in 0..20 {
            let (cluster_of, count) = rotation_clusters(&points, 2, 4, seed);
            assert_eq!(count, 4);
            assert!((0..400).all(|i| cluster_of[i] == cluster_of[i % 4]));
            assert_eq!((cluster_of, count), rotation_clusters(&points, 2, 4, seed));
        }
    }

    #[test]
    fn no_more_clusters_than_different_points() {
        let points: Vec<Vec<f64>> = (0..300).map(|i| vec![f64::from(i % 3)]).collect();
        assert_eq!(rotation_clusters(&sparse(&points), 1, 10, 5).1, 3);
        assert_eq!(rotation_clusters(&sparse(&points), 1, 300, 5).1, 300);
        assert_eq!(rotation_clusters(&sparse(&[vec![1.0]]), 1, 4, 5), (vec![0], 1));
    }

    /// The same algorithm on all coordinates of all points and centres.
    fn by_brute_force(points: &[Vec<f64>], wanted: usize, seed: u64) -> Vec<u32> {
        let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let mut state = seed;
        let mut first = (split_mix(&mut state) % points.len() as u64) as usize;
        let mut centres: Vec<Vec<f64>> = Vec::new();
        let mut distances = vec![f64::INFINITY; points.len()];
        loop {
            centres.push(points[first].clone());
            for (own, point) in distances.iter_mut().zip(points) {
                *own = own.min(distance(point, &points[first]));
            }
            if centres.len() == wanted {
                break;
            }
            let total: f64 = distances.iter().sum();
            let mut left = total * (split_mix(&mut state) >> 11) as f64 / (1_u64 << 53) as f64;
            let passed = distances.iter().position(|distance| {
                left -= distance;
                left < 0.0
            });
            first = passed.unwrap_or(points.len() - 1);
        }
        let mut cluster_of = vec![u32::MAX; points.len()];
        for _ in 0..ROUNDS {
            let before = cluster_of.clone();
            for (own, point) in cluster_of.iter_mut().zip(points) {
                let all = centres.iter().map(|centre| distance(point, centre)).enumerate();
                *own = all.fold((0, f64::INFINITY), |best, (i, d)| if d < best.1 { (i, d) } else { best }).0 as u32;
            }
            if before == cluster_of {
                break;
            }
            for (cluster, centre) in centres.iter_mut().enumerate() {
                let mut sum = vec![0.0; centre.len()];
                let mut size = 0.0;
                for (point, _) in points.iter().zip(&cluster_of).filter(|(_, own)| **own as usize == cluster) {
                    size += 1.0;
                    sum.iter_mut().zip(point).for_each(|(sum, value)| *sum += value);
                }
                if size > 0.0 {
                    *centre = sum.iter().map(|sum| sum / size).collect();
                }
            }
        }
        without_gaps(cluster_of, centres.len()).0
    }

    #[test]
    fn comparing_with_few_centres_finds_what_comparing_with_all_finds() {
        let mut state = 3;
        let mut roll = |most: u64| split_mix(&mut state) % most;
        // Two to four coordinates of thirty, in sums of sixteenths, so that many distances are equal.
        let points: Vec<Vec<f64>> = (0..700)
            .map(|number| {
                let mut point = vec![0.0; 30];
                let near = roll(28) as usize;
                (0..16).for_each(|_| point[near + roll(3) as usize] += 1.0 / 16.0);
                point[29] += f64::from(number) * 1e-9;
                point
            })
            .collect();
        for (wanted, seed) in [(3, 1), (30, 2), (60, 3), (200, 4)] {
            let found = rotation_clusters(&sparse(&points), 30, wanted, seed).0;
            assert_eq!(found, by_brute_force(&points, wanted, seed), "{wanted} clusters");
        }
    }
}
