//! The order in which points are inserted: random rounds, along a space-filling curve within each.
//!
//! Rounds of growing size (Amenta, Choi, Rote 2003) keep the work near-linear whatever order the points come in; the
//! curve makes the next point a neighbour of the last one, in space and in memory.

use rayon::prelude::*;

/// Bits of the curve along each axis.
const BITS: u32 = 20;
/// A round has about eight times as many points as all earlier rounds together.
const BITS_A_ROUND: u32 = 3;
/// Approximate number of points in the first round.
const FIRST_ROUND: usize = 64;

/// A permutation of the points' indices, the same for the same points on any number of threads.
pub(super) fn insertion_order(points: &[[f64; 3]]) -> Vec<u32> {
    let Some(&first) = points.first() else { return Vec::new() };
    let (low, high) = points.iter().fold((first, first), |(low, high), p| {
        (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
    });
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let cells = f64::from((1_u32 << BITS) - 1);
    let last_round = (points.len() / FIRST_ROUND).checked_ilog2().unwrap_or(0) / BITS_A_ROUND;
    let mut order: Vec<(u32, u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(index, p)| {
            let cell = std::array::from_fn(|k| ((p[k] - low[k]) / extent * cells) as u32);
            let early = scramble(index as u64).trailing_zeros() / BITS_A_ROUND;
            (last_round - early.min(last_round), along_hilbert_curve(cell), index as u32)
        })
        .collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, _, index)| index).collect()
}

/// The finaliser of splitmix64: bits that look random.
fn scramble(index: u64) -> u64 {
    let mut z = index.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// How far along the Hilbert curve a cell lies (Skilling, *Programming the Hilbert curve*, 2004).
fn along_hilbert_curve(mut cell: [u32; 3]) -> u64 {
    for shift in (1..BITS).rev() {
        let (bit, below) = (1 << shift, (1 << shift) - 1);
        for k in 0..3 {
            if cell[k] & bit == 0 {
                let swap = (cell[0] ^ cell[k]) & below;
                cell[0] ^= swap;
                cell[k] ^= swap;
            } else {
                cell[0] ^= below;
            }
        }
    }
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    let turn = (1..BITS).filter(|shift| cell[2] >> shift & 1 == 1).fold(0, |turn, shift| turn ^ ((1 << shift) - 1));
    let cell = cell.map(|c| c ^ turn);
    (0..BITS).rev().fold(0, |key, shift| cell.iter().fold(key, |key, c| key << 1 | u64::from(c >> shift & 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_each_cell_once_and_only_steps_to_neighbours() {
        let mut cells: Vec<[u32; 3]> = (0..512).map(|i| [i & 7, i >> 3 & 7, i >> 6]).collect();
        cells.sort_unstable_by_key(|&cell| along_hilbert_curve(cell));
        for pair in cells.windows(2) {
            assert_eq!((0..3).map(|k| pair[0][k].abs_diff(pair[1][k])).sum::<u32>(), 1, "{pair:?}");
        }
    }

    #[test]
    fn every_point_comes_once() {
        let mut order = insertion_order(&vec![[1.0, 2.0, 3.0]; 5000]);
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(i, &index)| i == index as usize));
    }
}
