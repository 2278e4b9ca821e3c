//! Triangles of a closed polygon in space without inner vertices (Barequet and Sharir 1995, with the weights of Liepa
//! 2003): the largest angle between neighbouring triangles is as small as possible, and then the area.

use glam::DVec3;

/// A side of the polygon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// Unit normal of the surface beyond it; `None` where there is none.
    pub(super) beyond: Option<DVec3>,
}

/// A polygon: sides run from each corner to the next.
#[derive(Debug)]
pub(super) struct Polygon {
    pub(super) places: Vec<DVec3>,
    /// Vertices of the mesh; some polygons pass a vertex twice.
    pub(super) vertices: Vec<u32>,
    /// Which rim each corner is on.
    pub(super) rims: Vec<u32>,
    pub(super) sides: Vec<Side>,
}

/// Smaller is better: triangles within one rim where there are several, the largest angle, the area.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Weight(f64, f64, f64);

/// Angles within this of each other count as equal, so that flat places are cut by area.
const STEP: f64 = 0.1;

/// Triangles as corners of the polygon, `[i, j, k]` with i < j < k; `None` if every way uses a forbidden chord.
pub(super) fn triangulate(polygon: &Polygon, forbidden: impl Fn(u32, u32) -> bool) -> Option<Vec<[usize; 3]>> {
    let count = polygon.places.len();
    let many_rims = polygon.rims.iter().any(|&r| r != polygon.rims[0]);
    let never = Weight(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let mut weights = vec![never; count * count];
    let mut chosen = vec![0_usize; count * count];
    let at = |i: usize, k: usize| i * count + k;
    for i in 0..count - 1 {
        weights[at(i, i + 1)] = Weight(0.0, 0.0, 0.0);
    }
    let normal = |i: usize, j: usize, k: usize| {
        let [a, b, c] = [i, j, k].map(|v| polygon.places[v]);
        (b - a).cross(c - a)
    };
    let chord = |i: usize, k: usize| {
        let (a, b) = (polygon.vertices[i], polygon.vertices[k]);
        a != b && (k == i + 1 || (i == 0 && k == count - 1) || !forbidden(a, b))
    };
    for span in 2..count {
        for i in 0..count - span {
            let k = i + span;
            if !chord(i, k) {
                continue;
            }
            let mut best = (never, 0);
            for j in i + 1..k {
                let (left, right) = (weights[at(i, j)], weights[at(j, k)]);
                if left.0.is_infinite() || right.0.is_infinite() || polygon.vertices[j] == polygon.vertices[i] {
                    continue;
                }
                let cross = normal(i, j, k);
                let area = 0.5 * cross.length();
                let unit = cross.normalize_or_zero();
                // The triangle beyond the side from one corner to a later one.
                let beyond = |from: usize, to: usize| {
                    if to == from + 1 {
                        polygon.sides[from].beyond
                    } else {
                        Some(normal(from, chosen[at(from, to)], to).normalize_or_zero())
                    }
                };
                let mut bend = bend(unit, beyond(i, j)).max(self::bend(unit, beyond(j, k)));
                if i == 0 && k == count - 1 {
                    bend = bend.max(self::bend(unit, polygon.sides[k].beyond));
                }
                let [a, b, c] = [i, j, k].map(|v| polygon.rims[v]);
                let within = if many_rims && a == b && b == c { 1.0 } else { 0.0 };
                let worst = (bend / STEP).round().max(left.1).max(right.1);
                let weight = Weight(left.0 + right.0 + within, worst, left.2 + right.2 + area);
                if weight < best.0 {
                    best = (weight, j);
                }
            }
            (weights[at(i, k)], chosen[at(i, k)]) = best;
        }
    }
    if weights[at(0, count - 1)].0.is_infinite() {
        return None;
    }
    let mut triangles = Vec::with_capacity(count - 2);
    let mut open = vec![(0, count - 1)];
    while let Some((i, k)) = open.pop() {
        if k > i + 1 {
            let j = chosen[at(i, k)];
            triangles.push([i, j, k]);
            open.extend([(i, j), (j, k)]);
        }
    }
    Some(triangles)
}

/// The angle between a triangle's normal and its neighbour's; a triangle without area bends as much as anything can.
fn bend(unit: DVec3, beyond: Option<DVec3>) -> f64 {
    match beyond {
        None => 0.0,
        Some(_) if unit == DVec3::ZERO => std::f64::consts::PI,
        Some(other) => unit.dot(other).clamp(-1.0, 1.0).acos(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_that_turns_back_is_cut_without_leaving_it() {
        let flat = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let polygon = Polygon {
            places: flat.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec(),
            vertices: (0..8).collect(),
            rims: vec![0; 8],
            sides: vec![Side { beyond: Some(DVec3::Z) }; 8],
        };
        let triangles = triangulate(&polygon, |_, _| false).unwrap();
        assert_eq!(triangles.len(), 6);
        let area = |[i, j, k]: [usize; 3]| {
            0.5 * (polygon.places[j] - polygon.places[i]).cross(polygon.places[k] - polygon.places[i]).z
        };
        assert!(triangles.iter().all(|&t| area(t) > 0.0), "no triangle is turned over");
        assert!((triangles.iter().map(|&t| area(t)).sum::<f64>() - 8.0).abs() < 1e-12);
        assert!(triangulate(&polygon, |_, _| true).is_none());
    }
}
