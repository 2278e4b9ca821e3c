//! Groups of edge sets that share a rotation: k-means clustering in weight space (thesis 7.3.2).

use std::collections::HashMap;

use rayon::prelude::*;

use crate::dense::add_multiple;

/// Rounds of Lloyd's algorithm; assigning 90k points to 34 clusters converges in 20 to 60, and the last rounds move few
/// points.
const ROUNDS: usize = 60;

/// Assigns each of the n points (n×`dimension`, row by row) to one of at most `wanted` clusters.
///
/// Starts from seeded k-means++, so equal input gives equal clusters on any number of threads. Returns the cluster of
/// each point and the number of clusters: fewer than wanted if there are fewer distinct points.
pub(super) fn rotation_clusters(points: &[f64], dimension: usize, wanted: usize, seed: u64) -> (Vec<u32>, usize) {
    let count = points.len() / dimension;
    if wanted >= count {
        return ((0..count as u32).collect(), count);
    }
    let Distinct { points, times, of_point } = distinct(points, dimension);
    let mut centres = spread_centres(&points, &times, dimension, wanted, seed);
    let mut cluster_of = vec![u32::MAX; times.len()];
    for _ in 0..ROUNDS {
        let moved: usize = cluster_of
            .par_iter_mut()
            .zip(points.par_chunks_exact(dimension))
            .with_min_len(1024)
            .map(|(own, point)| {
                let nearest = nearest_centre(point, &centres, dimension);
                usize::from(std::mem::replace(own, nearest) != nearest)
            })
            .sum();
        if moved == 0 {
            break;
        }
        move_to_means(&points, &times, &cluster_of, &mut centres, dimension);
    }
    let (cluster_of, used) = without_gaps(cluster_of, centres.len() / dimension);
    (of_point.into_iter().map(|own| cluster_of[own as usize]).collect(), used)
}

/// Points without repetitions, and how often each occurs. Wherever a single bone moves the shape, which is most of it,
/// all points are the same.
struct Distinct {
    points: Vec<f64>,
    times: Vec<f64>,
    of_point: Vec<u32>,
}

fn distinct(all: &[f64], dimension: usize) -> Distinct {
    let mut numbers: HashMap<Vec<u64>, u32> = HashMap::new();
    let mut distinct = Distinct { points: Vec::new(), times: Vec::new(), of_point: Vec::new() };
    let mut key = Vec::with_capacity(dimension);
    for point in all.chunks_exact(dimension) {
        key.clear();
        // Zeros of either sign are the same number.
        key.extend(point.iter().map(|c| (c + 0.0).to_bits()));
        let number = numbers.get(&key).copied().unwrap_or_else(|| {
            let number = distinct.times.len() as u32;
            numbers.insert(key.clone(), number);
            distinct.points.extend_from_slice(point);
            distinct.times.push(0.0);
            number
        });
        distinct.times[number as usize] += 1.0;
        distinct.of_point.push(number);
    }
    distinct
}

fn nearest_centre(point: &[f64], centres: &[f64], dimension: usize) -> u32 {
    let distances = centres.chunks_exact(dimension).map(|centre| squared_distance(point, centre));
    let best = distances.enumerate().fold((0, f64::INFINITY), |best, (i, d)| if d < best.1 { (i, d) } else { best });
    best.0 as u32
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Centres drawn one by one with probability proportional to the squared distance from those already chosen (Arthur and
/// Vassilvitskii 2007).
fn spread_centres(points: &[f64], times: &[f64], dimension: usize, wanted: usize, seed: u64) -> Vec<f64> {
    let count = points.len() / dimension;
    let mut state = seed;
    let mut first = (split_mix(&mut state) % count as u64) as usize;
    let mut centres = Vec::with_capacity(wanted * dimension);
    let mut distances = vec![f64::INFINITY; count];
    loop {
        let centre = &points[first * dimension..(first + 1) * dimension];
        centres.extend_from_slice(centre);
        for (distance, point) in distances.iter_mut().zip(points.chunks_exact(dimension)) {
            *distance = distance.min(squared_distance(point, centre));
        }
        let total: f64 = distances.iter().zip(times).map(|(distance, times)| distance * times).sum();
        if centres.len() == wanted * dimension || total <= 0.0 {
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

/// A cluster that has lost all its points stays where it was.
fn move_to_means(points: &[f64], times: &[f64], cluster_of: &[u32], centres: &mut [f64], dimension: usize) {
    let mut sums = vec![0.0; centres.len()];
    let mut sizes = vec![0.0; centres.len() / dimension];
    for ((point, &times), &cluster) in points.chunks_exact(dimension).zip(times).zip(cluster_of) {
        let cluster = cluster as usize;
        sizes[cluster] += times;
        add_multiple(&mut sums[cluster * dimension..(cluster + 1) * dimension], times, point);
    }
    for (cluster, &size) in sizes.iter().enumerate().filter(|(_, size)| **size > 0.0) {
        for c in cluster * dimension..(cluster + 1) * dimension {
            centres[c] = sums[c] / size;
        }
    }
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

    #[test]
    fn clumps_are_found_whatever_the_seed() {
        let mut points = Vec::new();
        for i in 0..400_u32 {
            let jitter = f64::from(i * 37 % 101) * 1e-4;
            points.extend([f64::from(i % 4) + jitter, f64::from(i % 2) - jitter]);
        }
        for seed in 0..20 {
            let (cluster_of, count) = rotation_clusters(&points, 2, 4, seed);
            assert_eq!(count, 4);
            assert!((0..400).all(|i| cluster_of[i] == cluster_of[i % 4]));
            assert_eq!((cluster_of, count), rotation_clusters(&points, 2, 4, seed));
        }
    }

    #[test]
    fn no_more_clusters_than_different_points() {
        let points: Vec<f64> = (0..300).map(|i| f64::from(i % 3)).collect();
        assert_eq!(rotation_clusters(&points, 1, 10, 5).1, 3);
        assert_eq!(rotation_clusters(&points, 1, 300, 5).1, 300);
        assert_eq!(rotation_clusters(&[1.0], 1, 4, 5), (vec![0], 1));
    }
}
