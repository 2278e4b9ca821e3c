//! Flips and constrained insertion always leave a valid triangulation of all of space.

use std::ops::ControlFlow;

use proptest::prelude::*;

use super::triangulation::{INFINITE, Triangulation};
use super::{Crossing, Refusal, triangulate};
use crate::predicates::orientation;

fn random_points(seed: u64, count: usize, lattice: bool) -> Vec<[f64; 3]> {
    let mut state = seed | 1;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let share = (state >> 11) as f64 / (1_u64 << 53) as f64;
        if lattice { (share * 5.0).floor() } else { share }
    };
    (0..count).map(|_| [next(), next(), next()]).collect()
}

fn triangulation(seed: u64, count: usize, lattice: bool) -> Triangulation {
    let points = random_points(seed, count, lattice);
    let mut bulk = triangulate(&points, &mut |_| ControlFlow::Continue(())).unwrap();
    bulk.triangulation.track();
    bulk.triangulation
}

fn sorted_facet(t: &Triangulation, tet: u32, slot: usize) -> [u32; 3] {
    let corners = t.corners(tet);
    let mut facet = [corners[(slot + 1) % 4], corners[(slot + 2) % 4], corners[(slot + 3) % 4]];
    facet.sort_unstable();
    facet
}

/// Positive tetrahedra, neighbours that know each other, locks on both sides, a convex hull; their volume times six.
fn check(t: &Triangulation) -> f64 {
    let mut volume = 0.0;
    for tet in (0..t.slots()).filter(|&tet| t.is_alive(tet)) {
        for slot in 0..4 {
            let other = t.neighbour(tet, slot);
            assert!(t.is_alive(other));
            let back = t.neighbours(other).iter().position(|&n| n == tet).unwrap();
            assert_eq!(sorted_facet(t, tet, slot), sorted_facet(t, other, back));
            assert_eq!(t.is_locked(tet, slot), t.is_locked(other, back));
        }
        let corners = t.corners(tet);
        if let Some(infinite) = t.infinite_slot(tet) {
            for slot in (0..4).filter(|&slot| slot != infinite) {
                let beyond = t.apex_across(tet, slot);
                let at = *t.point(beyond);
                assert!(t.orientation_with(tet, infinite, &at) <= 0.0, "the hull turns inwards");
            }
        } else {
            let [a, b, c, d] = corners.map(|v| t.point(v));
            assert!(orientation(a, b, c, d) > 0.0);
            let [a, b, c, d] = [a, b, c, d].map(|p| glam::DVec3::from(*p) * 0.5_f64.powi(180));
            volume += (b - a).dot((c - a).cross(d - a));
        }
        for corner in corners.into_iter().filter(|&corner| corner != INFINITE) {
            assert!(t.corners(t.tet_at(corner)).contains(&corner));
        }
    }
    volume
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_flips_and_insertions_keep_it_valid(
        seed in any::<u64>(),
        lattice in any::<bool>(),
        actions in prop::collection::vec((0_u8..5, any::<u32>(), any::<u32>(), 0_usize..4), 1..120),
    ) {
        let mut t = triangulation(seed, 60, lattice);
        let before = check(&t);
        let mut star = Vec::new();
        let mut locked: Vec<[u32; 3]> = Vec::new();
        for (action, one, two, slot) in actions {
            let alive: Vec<u32> = (0..t.slots()).filter(|&tet| t.is_alive(tet)).collect();
            let tet = alive[one as usize % alive.len()];
            let corners = t.corners(tet);
            let finite: Vec<u32> = corners.into_iter().filter(|&c| c != INFINITE).collect();
            match action {
                0 => drop(t.flip_facet(tet, slot)),
                1 => drop(t.remove_edge(tet, [finite[0], finite[1]], &[])),
                2 => {
                    t.set_locked(tet, slot, true);
                    if corners[slot] == INFINITE || finite.len() == 4 {
                        locked.push(sorted_facet(&t, tet, slot));
                    } else {
                        t.set_locked(tet, slot, false);
                    }
                }
                3 => {
                    let ends = [finite[0], alive.len() as u32 % t.points().len() as u32];
                    match t.first_crossing(ends, &mut star) {
                        Crossing::Facet(tet, slot) => drop(t.flip_facet(tet, slot)),
                        Crossing::Edge(tet, edge) => drop(t.remove_edge(tet, edge, &[])),
                        _ => {}
                    }
                }
                _ => {
                    // A point inside, in a facet, on an edge, or a little beyond, up to rounding.
                    let share = f64::from(two) / f64::from(u32::MAX);
                    let of = |k: usize| glam::DVec3::from(*t.point(finite[k % finite.len()]));
                    let position = match slot {
                        0 => of(0).lerp(of(1), share),
                        1 => of(0).lerp(of(1), share).lerp(of(2), 0.3),
                        2 => of(0),
                        _ => (of(0) + of(1) + of(2) + of(3)) / 4.0,
                    };
                    let count = t.points().len();
                    match t.insert_constrained(position.to_array(), tet) {
                        Ok(vertex) => prop_assert_eq!(vertex as usize, count),
                        Err(Refusal::AtVertex(_) | Refusal::NoRoom | Refusal::Full) => {
                            prop_assert_eq!(t.points().len(), count);
                        }
                    }
                }
            }
        }
        let after = check(&t);
        // Points on the hull may lie beyond it by rounding.
        prop_assert!((after - before).abs() <= 1e-9 * before, "{before} became {after}");
        for facet in locked {
            let found = t.find_facet(facet, &mut star);
            prop_assert!(found.is_some_and(|(tet, slot)| t.is_locked(tet, slot)), "a locked facet is gone");
        }
    }
}

#[test]
fn an_edge_that_must_be_there_comes_by_one_flip() {
    // Two tetrahedra share a facet that the segment between their tips passes.
    let points = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-0.5, 0.8, 0.0], [-0.5, -0.8, 0.0], [0.0, 0.0, -1.0]];
    let mut bulk = triangulate(&points, &mut |_| ControlFlow::Continue(())).unwrap();
    let t = &mut bulk.triangulation;
    t.track();
    let name = |wanted: u32| bulk.name.iter().position(|&n| n == wanted).unwrap() as u32;
    let mut star = Vec::new();
    let ends = [name(0), name(4)];
    if let Crossing::Facet(tet, slot) = t.first_crossing(ends, &mut star) {
        assert!(t.flip_facet(tet, slot));
    }
    let Crossing::Present(tet) = t.first_crossing(ends, &mut star) else { panic!("the edge is not there") };
    let (vertices, tets) = t.ring(tet, ends).unwrap();
    assert_eq!((vertices.len(), tets.len()), (3, 3));
    assert!(t.remove_edge(tet, ends, &[]));
    assert!(matches!(t.first_crossing(ends, &mut star), Crossing::Facet(..)));
}
