//! From polygons to triangles.

/// Most corners of a concave polygon: finding ears takes up to cubic time.
pub(crate) const MAX_CONCAVE_CORNERS: usize = 1024;

/// Splits a polygon, given by its corners' positions in order, into triangles over corner numbers, which keep its
/// orientation. Convex polygons become fans; others are ear-clipped, in the plane of the polygon's mean normal
/// (Newell). `None` if a concave polygon has more than [`MAX_CONCAVE_CORNERS`] corners.
pub(crate) fn triangulate(corners: &[[f64; 3]]) -> Option<Vec<[usize; 3]>> {
    let n = corners.len();
    if n <= 3 {
        return Some(if n == 3 { vec![[0, 1, 2]] } else { Vec::new() });
    }
    let flat = flatten(corners);
    let fan = || (1..n - 1).map(|i| [0, i, i + 1]).collect();
    if is_convex(&flat) {
        return Some(fan());
    }
    if n > MAX_CONCAVE_CORNERS {
        return None;
    }
    Some(clip_ears(&flat).unwrap_or_else(fan))
}

/// Positions in the plane perpendicular to the polygon's normal, seen so that the polygon runs counter-clockwise.
fn flatten(corners: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let mut normal = [0.0_f64; 3];
    let mut previous = corners[corners.len() - 1];
    for &p in corners {
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            normal[k] += (previous[i] - p[i]) * (previous[j] + p[j]);
        }
        previous = p;
    }
    let k = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (i, j) = if normal[k] >= 0.0 { ((k + 1) % 3, (k + 2) % 3) } else { ((k + 2) % 3, (k + 1) % 3) };
    corners.iter().map(|p| [p[i], p[j]]).collect()
}

fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Every turn goes left, and together they go round once.
fn is_convex(points: &[[f64; 2]]) -> bool {
    let n = points.len();
    let at = |i: usize| points[i % n];
    let left = (0..n).all(|i| cross(at(i), at(i + 1), at(i + 2)) >= 0.0);
    // A pentagram also turns left everywhere; round once means that x runs up once and down once.
    let runs: Vec<bool> = (0..n).map(|i| at(i + 1)[0] - at(i)[0]).filter(|d| *d != 0.0).map(|d| d > 0.0).collect();
    let changes = (0..runs.len()).filter(|&i| runs[i] != runs[(i + 1) % runs.len()]).count();
    left && changes <= 2
}

/// Ear clipping; `None` if no ear is left because the polygon crosses itself.
fn clip_ears(points: &[[f64; 2]]) -> Option<Vec<[usize; 3]>> {
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    let mut start = 0;
    while ring.len() > 3 {
        let n = ring.len();
        // Continuing after the last ear keeps one corner from becoming the tip of a fan of slivers.
        let ear = (0..n).map(|step| (start + step) % n).find(|&i| is_ear(points, &ring, i))?;
        triangles.push([ring[(ear + n - 1) % n], ring[ear], ring[(ear + 1) % n]]);
        ring.remove(ear);
        start = ear;
    }
    triangles.push([ring[0], ring[1], ring[2]]);
    Some(triangles)
}

#[expect(clippy::float_cmp, reason = "equal corners are one point of the file, bit for bit")]
fn is_ear(points: &[[f64; 2]], ring: &[usize], i: usize) -> bool {
    let n = ring.len();
    let (before, tip, after) = (ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]);
    let (a, b, c) = (points[before], points[tip], points[after]);
    if cross(a, b, c) <= 0.0 {
        return false;
    }
    ring.iter().filter(|&&v| v != before && v != tip && v != after).all(|&v| {
        let p = points[v];
        // A corner exactly at one of the ear's own corners (a bridge to a hole) does not block it.
        p == a || p == b || p == c || cross(a, b, p) < 0.0 || cross(b, c, p) < 0.0 || cross(c, a, p) < 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f64; 3]], t: [usize; 3]) -> f64 {
        let p = |i: usize| [corners[t[i]][0], corners[t[i]][1]];
        0.5 * cross(p(0), p(1), p(2))
    }

    #[test]
    fn an_l_is_cut_without_overlap() {
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]].map(|[x, y]| [x, y, 3.0]);
        for shift in 0..6 {
            let corners: Vec<[f64; 3]> = (0..6).map(|i| l[(i + shift) % 6]).collect();
            let triangles = triangulate(&corners).unwrap();
            assert_eq!(triangles.len(), 4);
            assert!(triangles.iter().all(|&t| area(&corners, t) > 0.0), "{shift}: {triangles:?}");
            assert!((triangles.iter().map(|&t| area(&corners, t)).sum::<f64>() - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn orientation_is_kept_in_every_plane() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.2, 0.0, 0.1]];
        let triangles = triangulate(&square).unwrap();
        let normal_y = |t: [usize; 3]| {
            let [a, b, c] = t.map(|i| square[i]);
            (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        };
        assert!(triangles.iter().all(|&t| normal_y(t) < 0.0), "{triangles:?}");
    }

    #[test]
    fn a_comb_keeps_its_area() {
        // Teeth between y = 1 and y = 3 on a bar of height one.
        let mut corners = vec![[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]];
        for tooth in (0..10).rev() {
            let x = f64::from(tooth) * 2.0;
            corners.extend([[x + 2.0, 1.0, 0.0], [x + 1.0, 3.0, 0.0]]);
        }
        corners.push([0.0, 1.0, 0.0]);
        let triangles = triangulate(&corners).unwrap();
        assert_eq!(triangles.len(), corners.len() - 2);
        let total: f64 = triangles.iter().map(|&t| area(&corners, t)).sum();
        assert!((total - 40.0).abs() < 1e-9, "{total}");
        assert!(triangles.iter().all(|&t| area(&corners, t) > 0.0));
    }

    #[test]
    fn degenerate_and_crossing_polygons_end() {
        assert_eq!(triangulate(&[[1.0; 3]; 5]).unwrap().len(), 3);
        let bow = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 3.0, 0.0]];
        assert_eq!(triangulate(&bow).unwrap().len(), 3);
        assert!(triangulate(&[[0.0; 3]; 2]).unwrap().is_empty());
    }
}
