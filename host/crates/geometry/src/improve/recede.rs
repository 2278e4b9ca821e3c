//! Operations that change a loose boundary: moving one of its vertices, contracting one of its edges, dropping a
//! tetrahedron. None takes it farther from where it was than its vertices may give way.

use glam::DVec3;

use super::candidate::{Candidate, LEAST_GAIN};
use super::complex::Complex;
use super::facets::NONE;
use super::place_vertex::place_vertex_within;
use super::vertex::move_if_sound;
use crate::facets::facet;
use crate::search::triangle_queries::closest_on_triangle;

/// Rounds of projecting a place onto the space between all planes in turn.
const ROUNDS: usize = 6;
/// Where between the ends of a boundary edge that is dropped its distance from what is left is measured.
const ALONG: [f64; 3] = [0.25, 0.5, 0.75];

/// Vertices with more tetrahedra stay: every step would cost too much.
const MOST_AROUND: usize = 128;

/// Where a vertex of the boundary may go.
struct Space {
    here: DVec3,
    /// Unit normals of the boundary's facets at the vertex, outwards.
    normals: Vec<DVec3>,
    recede: f64,
    bulge: f64,
}

impl Space {
    /// For a vertex that may move at all. With `except`, facets that have that vertex too do not count.
    fn of(complex: &Complex, vertex: u32, around: &[u32], except: Option<u32>) -> Option<Self> {
        let loose = complex.loose.as_ref()?;
        let facets = around.iter().flat_map(|&t| complex.boundary_facets(t));
        let facets = facets.filter(|f| f.contains(&vertex) && except.is_none_or(|other| !f.contains(&other)));
        let normals: Option<Vec<DVec3>> = facets.map(|f| normal(complex, f)).collect();
        let here = complex.at(vertex);
        Some(Self { here, normals: normals?, recede: loose.recede(vertex), bulge: loose.bulge(vertex) })
    }

    /// How far a place lies inside and outside the planes, at most.
    fn spent(&self, place: DVec3) -> [f64; 2] {
        let heights = self.normals.iter().map(|n| n.dot(place - self.here));
        heights.fold([0.0, 0.0], |[inside, outside]: [f64; 2], h| [inside.max(-h), outside.max(h)])
    }

    fn holds(&self, place: DVec3) -> bool {
        let [inside, outside] = self.spent(place);
        inside <= self.recede && outside <= self.bulge
    }

    /// A place in this space near the given one, if one is found.
    fn nearest(&self, mut place: DVec3) -> Option<DVec3> {
        // A little less than is allowed, so that projecting ends.
        let (least, most) = (-0.99 * self.recede, 0.99 * self.bulge);
        for _ in 0..ROUNDS {
            if self.holds(place) {
                return Some(place);
            }
            for normal in &self.normals {
                let height = normal.dot(place - self.here);
                place -= *normal * (height - height.clamp(least, most));
            }
        }
        self.holds(place).then_some(place)
    }
}

fn normal(complex: &Complex, corners: [u32; 3]) -> Option<DVec3> {
    let [a, b, c] = corners.map(|v| complex.at(v));
    (b - a).cross(c - a).try_normalize()
}

fn sorted_unique<T: Ord>(mut list: Vec<T>) -> Vec<T> {
    list.sort_unstable();
    list.dedup();
    list
}

fn hole(complex: &Complex, vertex: u32, star: &[u32]) -> Vec<[u32; 3]> {
    star.iter().filter_map(|&t| complex.slot_of(t, vertex).map(|k| facet(complex.corners(t), k))).collect()
}

/// Moves corners of a tetrahedron that are on the loose boundary to where their worst tetrahedron is best; returns how
/// many moved.
pub(super) fn smooth_boundary(complex: &mut Complex, tetrahedron: u32, enough: f64) -> usize {
    let mut moved = 0;
    for vertex in complex.corners(tetrahedron) {
        if !complex.may_give(vertex) {
            continue;
        }
        let star = complex.around(vertex);
        let before = complex.worst(&star);
        let worth_it = before < enough && star.len() <= MOST_AROUND;
        let Some(space) = Space::of(complex, vertex, &star, None).filter(|_| worth_it) else { continue };
        let places: Vec<[DVec3; 3]> = hole(complex, vertex, &star).iter().map(|f| f.map(|v| complex.at(v))).collect();
        let placed = place_vertex_within(space.here, &places, enough, &|place| space.nearest(place));
        if placed.worst <= before + LEAST_GAIN {
            continue;
        }
        if !move_if_sound(complex, vertex, &star, &placed) {
            continue;
        }
        let [inside, outside] = space.spent(placed.position);
        complex.give_way(vertex, space.recede - inside, space.bulge - outside);
        moved += 1;
    }
    moved
}

/// Contracts the edge of the boundary at a corner of `tetrahedron` that leaves the best tetrahedra, if it beats what is
/// there by enough.
pub(super) fn contract_boundary(complex: &mut Complex, tetrahedron: u32) -> bool {
    let mut best: Option<(u32, u32, [f64; 2])> = None;
    let mut candidate = Candidate::default();
    for vertex in complex.corners(tetrahedron) {
        if !complex.may_give(vertex) {
            continue;
        }
        let star = complex.around(vertex);
        if star.len() > MOST_AROUND {
            continue;
        }
        let mut worst_of_best = (complex.worst(&star) + LEAST_GAIN).max(candidate.worst);
        let facets = hole(complex, vertex, &star);
        let on_boundary = star.iter().flat_map(|&t| complex.boundary_facets(t)).filter(|f| f.contains(&vertex));
        let ends = sorted_unique(on_boundary.flatten().filter(|&v| v != vertex).collect());
        for end in ends {
            let Some(space) = Space::of(complex, vertex, &star, Some(end)) else { continue };
            if !space.holds(complex.at(end)) {
                continue;
            }
            let new = || facets.iter().filter(|f| !f.contains(&end)).map(|&[x, y, z]| [x, z, y, end]);
            let worst = new().map(|t| complex.sine(t)).fold(f64::INFINITY, f64::min);
            if worst > worst_of_best && worst < f64::INFINITY && keeps_shape(complex, vertex, end, &star) {
                worst_of_best = worst;
                let [inside, outside] = space.spent(complex.at(end));
                best = Some((vertex, end, [space.recede - inside, space.bulge - outside]));
                candidate = Candidate { worst, old: star.clone(), new: new().collect() };
            }
        }
    }
    let Some((vertex, end, [recede, bulge])) = best else { return false };
    if !complex.replace_at_boundary(&candidate.old, &candidate.new, false) {
        return false;
    }
    complex.merge(vertex, end, recede, bulge);
    true
}

/// Whether contracting a boundary edge leaves the topology as it is: what is next to both ends is next to the edge
/// (Dey, Edelsbrunner, Guha and Nekhayev 1999), with one more vertex joined to the whole boundary.
fn keeps_shape(complex: &Complex, vertex: u32, end: u32, star: &[u32]) -> bool {
    let other = complex.around(end);
    let shared = |t: &u32| complex.slot_of(*t, vertex).is_some() && complex.slot_of(*t, end).is_some();
    let joint: Vec<u32> = star.iter().copied().filter(shared).collect();
    let without = |list: &[u32]| -> Vec<u32> {
        sorted_unique(list.iter().flat_map(|&t| complex.corners(t)).filter(|&v| v != vertex && v != end).collect())
    };
    let edges = |list: &[u32]| -> Vec<[u32; 2]> {
        let pairs = list.iter().flat_map(|&t| {
            let rest: Vec<u32> = complex.corners(t).into_iter().filter(|&v| v != vertex && v != end).collect();
            let all = (0..rest.len()).flat_map(|i| (0..i).map(move |j| (i, j))).collect::<Vec<_>>();
            all.into_iter().map(move |(i, j)| [rest[i].min(rest[j]), rest[i].max(rest[j])])
        });
        sorted_unique(pairs.collect())
    };
    let facets = |list: &[u32], of: u32| -> Vec<[u32; 3]> {
        let opposite = list
            .iter()
            .filter(|t| !joint.contains(t))
            .filter_map(|&t| complex.slot_of(t, of).map(|k| crate::facets::sorted(facet(complex.corners(t), k)).0));
        sorted_unique(opposite.collect())
    };
    let rims = |list: &[u32], of: u32, not: u32| -> Vec<[u32; 2]> {
        let at = list.iter().flat_map(|&t| complex.boundary_facets(t)).filter(|f| f.contains(&of) && !f.contains(&not));
        let rim = at.map(|f| {
            let rest: Vec<u32> = f.into_iter().filter(|&v| v != of).collect();
            [rest[0].min(rest[1]), rest[0].max(rest[1])]
        });
        sorted_unique(rim.collect())
    };
    let bare = |list: &[u32], of: u32| -> Vec<u32> {
        let at = list.iter().flat_map(|&t| complex.boundary_facets(t)).filter(|f| f.contains(&of));
        sorted_unique(at.flatten().filter(|&v| v != vertex && v != end).collect())
    };
    let at_edge = |list: &[u32]| -> Vec<u32> {
        let at = list.iter().flat_map(|&t| complex.boundary_facets(t));
        let at = at.filter(|f| f.contains(&vertex) && f.contains(&end));
        sorted_unique(at.flatten().filter(|&v| v != vertex && v != end).collect())
    };
    common(&without(star), &without(&other)).all(|v| without(&joint).contains(v))
        && common(&edges(star), &edges(&other)).all(|e| edges(&joint).contains(e))
        && common(&facets(star, vertex), &facets(&other, end)).next().is_none()
        && common(&bare(star, vertex), &bare(&other, end)).all(|v| at_edge(&joint).contains(v))
        && common(&rims(star, vertex, end), &rims(&other, end, vertex)).next().is_none()
}

/// What is in both of two sorted lists.
fn common<'a, T: Ord>(one: &'a [T], other: &'a [T]) -> impl Iterator<Item = &'a T> {
    one.iter().filter(|item| other.binary_search(item).is_ok())
}

/// Drops a tetrahedron with facets on the boundary, if that takes the boundary no farther back than it may recede and
/// joins it nowhere to itself.
pub(super) fn drop_tetrahedron(complex: &mut Complex, tetrahedron: u32) -> bool {
    let corners = complex.corners(tetrahedron);
    let bare: Vec<usize> = (0..4).filter(|&k| complex.neighbour(tetrahedron, k) == NONE).collect();
    let lost = match bare[..] {
        // Its fourth corner would be a second sheet of the boundary if it is on it already.
        [k] if !complex.is_pinned(corners[k]) => None,
        [i, j] => {
            // Facets opposite i and j share the edge between the other two; i and j are its far edge.
            if is_bare_edge(complex, corners[i], corners[j]) {
                return false;
            }
            None
        }
        // The vertex of all three facets: the one that is opposite the fourth.
        [_, _, _] => (0..4).find(|k| !bare.contains(k)).map(|k| corners[k]),
        _ => return false,
    };
    if lost.is_some_and(|v| !complex.may_give(v)) {
        return false;
    }
    let depth = depth(complex, corners, &bare, lost);
    let Some(loose) = &complex.loose else { return false };
    let exposed = |v: &u32| complex.is_pinned(*v);
    let least = corners.iter().filter(|v| exposed(v)).fold(f64::INFINITY, |least, &v| least.min(loose.recede(v)));
    if depth > least || !complex.replace_at_boundary(&[tetrahedron], &[], true) {
        return false;
    }
    if let Some(lost) = lost {
        let beside = corners.into_iter().find(|&v| v != lost).unwrap_or(lost);
        complex.merge(lost, beside, f64::INFINITY, f64::INFINITY);
    }
    for vertex in corners {
        complex.expose(vertex, least - depth);
    }
    true
}

fn is_bare_edge(complex: &Complex, a: u32, b: u32) -> bool {
    complex.around(a).iter().flat_map(|&t| complex.boundary_facets(t)).any(|f| f.contains(&a) && f.contains(&b))
}

/// How far the boundary recedes when a tetrahedron with these `bare` facets is dropped.
fn depth(complex: &Complex, corners: [u32; 4], bare: &[usize], lost: Option<u32>) -> f64 {
    let at = |v: u32| complex.at(v);
    let kept = || (0..4).filter(|k| !bare.contains(k)).map(|k| facet(corners, k).map(at));
    let off = |p: DVec3| kept().map(|f| closest_on_triangle(p, &f).distance(p)).fold(f64::INFINITY, f64::min);
    match (bare, lost) {
        (_, Some(lost)) => off(at(lost)),
        (&[i, j], _) => {
            let ends: Vec<DVec3> = (0..4).filter(|&k| k != i && k != j).map(|k| at(corners[k])).collect();
            ALONG.iter().map(|&s| off(ends[0].lerp(ends[1], s))).fold(0.0, f64::max)
        }
        (&[k], _) => {
            let f = facet(corners, k).map(at);
            closest_on_triangle(at(corners[k]), &f).distance(at(corners[k]))
        }
        _ => f64::INFINITY,
    }
}
