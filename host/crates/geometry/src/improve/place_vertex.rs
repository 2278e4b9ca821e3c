//! Optimisation-based smoothing: finds where inside a hole of facets a vertex makes the worst tetrahedron best.
//!
//! The worst quality is climbed along the shortest convex combination of the gradients of those that are nearly worst
//! (Freitag, Jones & Plassmann 1995; Klingner & Shewchuk 2008, section 3.2).

use glam::DVec3;

use super::quality::smallest_sine;

/// Steps of the ascent. After a few, the worst hardly rises: then other operations are needed.
const MOST_STEPS: usize = 8;
/// Halvings of one step.
const MOST_HALVINGS: usize = 6;
/// Tetrahedra this close to the worst (in sines) determine the direction.
const NEARLY_WORST: f64 = 0.03;
/// Steps of the search for the shortest combination.
const MOST_COMBINATIONS: usize = 30;
/// Differences for gradients, in units of the hole's size.
const DIFFERENCE: f64 = 1e-6;

/// The place found, and the smallest sine of the tetrahedra there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) position: DVec3,
    pub(super) worst: f64,
}

/// Moves a vertex from `position` inside `hole`, facets counter-clockwise seen from outside, until the worst is at
/// least `enough` or no step helps.
pub(super) fn place_vertex(position: DVec3, hole: &[[DVec3; 3]], enough: f64) -> Placed {
    place_vertex_within(position, hole, enough, &|place| Some(place))
}

/// Like [`place_vertex`], but every step goes to the place that `allowed` gives for it, if it gives one.
pub(super) fn place_vertex_within(
    mut position: DVec3,
    hole: &[[DVec3; 3]],
    enough: f64,
    allowed: &dyn Fn(DVec3) -> Option<DVec3>,
) -> Placed {
    let sine = |facet: &[DVec3; 3], p: DVec3| smallest_sine([facet[0], facet[2], facet[1], p]);
    let size = hole.iter().flatten().fold(0.0, |most: f64, v| most.max(v.distance_squared(position))).sqrt();
    let mut sines: Vec<f64> = hole.iter().map(|facet| sine(facet, position)).collect();
    let mut slopes: Vec<(f64, DVec3)> = Vec::new();
    let smallest = |sines: &[f64]| sines.iter().copied().fold(f64::INFINITY, f64::min);
    let mut worst = smallest(&sines);
    for _ in 0..MOST_STEPS {
        if worst >= enough {
            break;
        }
        slopes.clear();
        // Beyond four times the margin a tetrahedron is rarely the next worst along a step.
        for (facet, &value) in hole.iter().zip(&sines).filter(|(_, value)| **value < worst + 4.0 * NEARLY_WORST) {
            let step = DIFFERENCE * size;
            let slope = |axis: DVec3| (sine(facet, position + axis * step) - value) / step;
            slopes.push((value, DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))));
        }
        let direction = shortest_combination(&slopes, worst + NEARLY_WORST);
        let steepness = direction.length_squared();
        if steepness.is_nan() || steepness.sqrt() * size < 1e-3 {
            break;
        }
        let mut length = 0.3 * size / steepness.sqrt();
        for &(value, slope) in &slopes {
            let closing = steepness - slope.dot(direction);
            if value > worst + NEARLY_WORST && closing > 0.0 {
                length = length.min((value - worst) / closing);
            }
        }
        let mut improved = false;
        for _ in 0..MOST_HALVINGS {
            let there = allowed(position + direction * length);
            if let Some(there) = there.filter(|&there| hole.iter().all(|facet| sine(facet, there) > worst)) {
                position = there;
                sines.iter_mut().zip(hole).for_each(|(value, facet)| *value = sine(facet, there));
                improved = true;
                break;
            }
            length *= 0.5;
        }
        let before = worst;
        worst = smallest(&sines);
        if !improved || worst - before < 1e-4 {
            break;
        }
    }
    Placed { position, worst }
}

/// The shortest convex combination of the gradients of values up to `limit` (Gilbert's algorithm): along it all of them
/// rise, if it is not zero.
fn shortest_combination(slopes: &[(f64, DVec3)], limit: f64) -> DVec3 {
    let active = || slopes.iter().filter(|(value, _)| *value <= limit).map(|(_, slope)| *slope);
    let Some(mut shortest) = active().min_by(|a, b| a.length_squared().total_cmp(&b.length_squared())) else {
        return DVec3::ZERO;
    };
    for _ in 0..MOST_COMBINATIONS {
        let Some(least) = active().min_by(|a, b| a.dot(shortest).total_cmp(&b.dot(shortest))) else { break };
        let gap = shortest.length_squared() - least.dot(shortest);
        if gap.is_nan() || gap <= 1e-6 * shortest.length_squared() {
            break;
        }
        let towards = least - shortest;
        shortest += towards * (gap / towards.length_squared()).clamp(0.0, 1.0);
    }
    shortest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_near_a_corner_finds_the_middle() {
        let v = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from);
        let hole = [[v[1], v[2], v[3]], [v[0], v[3], v[2]], [v[0], v[1], v[3]], [v[0], v[2], v[1]]];
        let hole = if smallest_sine(v) > 0.0 { hole } else { hole.map(|[a, b, c]| [a, c, b]) };
        let start = DVec3::new(0.55, 0.5, 0.45);
        let sine_at = |p: DVec3| hole.iter().map(|f| smallest_sine([f[0], f[2], f[1], p])).fold(1.0, f64::min);
        let placed = place_vertex(start, &hole, 1.0);
        assert!((sine_at(placed.position) - placed.worst).abs() < 1e-15);
        assert!(placed.worst > 2.0 * sine_at(start) && placed.position.length() < 0.2, "{placed:?}");
    }
}
