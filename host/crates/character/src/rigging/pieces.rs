//! Ways between pieces of an inside that do not touch: eyes in a head, a belt, a limb that is thin in one place.

use glam::DVec3;

/// Pieces beyond this many are not joined; soups have thousands.
const MOST_PIECES: usize = 40;
/// Smaller pieces are dust.
const LEAST_POINTS: usize = 4;

/// Pairs of points, each in another piece, that join all pieces whose gaps are at most `farthest` to the largest one.
pub(super) fn bridges(points: &[DVec3], neighbours: &[Vec<u32>], farthest: f64) -> Vec<[usize; 2]> {
    let mut pieces = pieces(neighbours);
    pieces.retain(|piece| piece.len() >= LEAST_POINTS);
    pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    pieces.truncate(MOST_PIECES);
    let rim = |piece: &Vec<usize>| -> Vec<usize> {
        let is_rim = |&&point: &&usize| neighbours[point].len() < 26;
        piece.iter().filter(is_rim).copied().collect()
    };
    let mut waiting: Vec<Vec<usize>> = pieces.iter().map(rim).collect();
    if waiting.len() < 2 {
        return Vec::new();
    }
    let mut joined = waiting.remove(0);
    let mut found = Vec::new();
    while !waiting.is_empty() {
        let gaps = waiting.iter().enumerate().filter_map(|(at, piece)| {
            let pair = closest(points, &joined, piece)?;
            Some((points[pair[0]].distance(points[pair[1]]), at, pair))
        });
        let Some((gap, at, pair)) = gaps.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if gap > farthest {
            break;
        }
        found.push(pair);
        joined.extend(waiting.remove(at));
    }
    found
}

/// The closest pair: every few points first, then all near the best.
fn closest(points: &[DVec3], from: &[usize], to: &[usize]) -> Option<[usize; 2]> {
    const LOOKED_AT: usize = 400;
    let few = |list: &[usize]| -> Vec<usize> { list.iter().step_by(1 + list.len() / LOOKED_AT).copied().collect() };
    let nearest = |list: &[usize], to: usize| {
        list.iter().copied().min_by(|&a, &b| {
            let away = |p: usize| points[p].distance_squared(points[to]);
            away(a).total_cmp(&away(b))
        })
    };
    let pairs = few(to).into_iter().filter_map(|b| Some([nearest(&few(from), b)?, b]));
    let [mut a, mut b] = pairs.min_by(|p, q| {
        let gap = |[a, b]: &[usize; 2]| points[*a].distance_squared(points[*b]);
        gap(p).total_cmp(&gap(q))
    })?;
    for _ in 0..4 {
        a = nearest(from, b)?;
        b = nearest(to, a)?;
    }
    Some([a, b])
}

fn pieces(neighbours: &[Vec<u32>]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; neighbours.len()];
    let mut found = Vec::new();
    for start in 0..neighbours.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            for &other in &neighbours[piece[next]] {
                if !std::mem::replace(&mut seen[other as usize], true) {
                    piece.push(other as usize);
                }
            }
            next += 1;
        }
        found.push(piece);
    }
    found
}
