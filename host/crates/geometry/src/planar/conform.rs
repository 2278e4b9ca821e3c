//! Segments that pass through the vertices on them.

use glam::DVec2;

/// A vertex closer to a segment than this, where the outline is about 1 across, counts as on it. Between the two there
/// would be nothing but slivers.
pub(super) const ON: f64 = 1e-9;

/// Cuts segments wherever one of `places` is on them; each part occurs once, in either direction, and none has zero
/// length.
pub(super) fn conform(places: &[[f64; 2]], segments: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut by_x: Vec<u32> = (0..places.len() as u32).collect();
    by_x.sort_by(|&a, &b| places[a as usize][0].total_cmp(&places[b as usize][0]));
    let at = |v: u32| DVec2::from(places[v as usize]);
    let mut parts: Vec<[u32; 2]> = Vec::with_capacity(segments.len());
    for &[from, to] in segments.iter().filter(|[from, to]| from != to) {
        let (a, b) = (at(from), at(to));
        let (low, high) = (a.min(b) - ON, a.max(b) + ON);
        let first = by_x.partition_point(|&v| at(v).x < low.x);
        let near = by_x[first..].iter().copied().take_while(|&v| at(v).x <= high.x);
        let length = a.distance(b);
        let along = (b - a) / length;
        let mut stops: Vec<(f64, u32)> = near
            .filter(|&v| v != from && v != to && at(v).y >= low.y && at(v).y <= high.y)
            .filter(|&v| along.perp_dot(at(v) - a).abs() <= ON)
            .map(|v| (along.dot(at(v) - a), v))
            .filter(|&(t, _)| t > 0.0 && t < length)
            .collect();
        stops.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        let mut start = from;
        for stop in stops.into_iter().map(|(_, v)| v).chain([to]) {
            parts.push([start.min(stop), start.max(stop)]);
            start = stop;
        }
    }
    parts.sort_unstable();
    parts.dedup();
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_cut_where_vertices_are() {
        let places = [[1.0, 1.0], [3.0, 1.0], [2.0, 1.0 + 1e-12], [2.5, 1.0], [2.2, 1.1], [0.5, 1.0]];
        assert_eq!(conform(&places, &[[1, 0], [4, 4], [3, 2]]), [[0, 2], [1, 3], [2, 3]]);
    }
}
