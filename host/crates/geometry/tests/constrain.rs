//! Constrained segmentations of cubes cut into tetrahedra: checked against the boundary's topology and by trying all
//! flips.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use armature_geometry::segmentation::{
    Constrained, ConstraintInput, ConstraintOutcome, ConstraintSettings, HardConstraint, Label, SegmentationError,
    SegmentationSettings, graph_cut_with_forced_labels, make_manifold, satisfy_facets,
};
use armature_geometry::surface::edges;
use armature_geometry::winding::winding_number;
use glam::DVec3;
use proptest::prelude::*;

const HULL: u32 = u32::MAX;

/// Whether a cell is inside.
type Shape = fn([i32; 3]) -> bool;

fn go(_: &str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The input of the constraints, owned.
#[derive(Clone)]
struct Case<const K: usize> {
    vertices: Vec<DVec3>,
    elements: Vec<[u32; K]>,
    neighbours: Vec<[u32; K]>,
    sizes: Vec<[f64; K]>,
    winding: Vec<f64>,
    inside: Vec<bool>,
    forced: Vec<Label>,
    facets: Vec<[u32; 2]>,
}

impl<const K: usize> Case<K> {
    /// Cubes (or, of one layer, squares) cut along their diagonals, all outside.
    fn grid(cells: [u32; 3]) -> Self {
        let [x, y, z] = cells.map(|n| n + 1);
        let vertex = |at: [u32; 3]| at[0] + x * (at[1] + y * at[2]);
        let mut elements = Vec::new();
        let orders: &[[usize; 3]] = &[[0, 1, 2], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        for cell in (0..cells[0] * cells[1] * cells[2].max(1)).map(|c| Self::place(c, cells)) {
            for order in &orders[..if K == 3 { 2 } else { 6 }] {
                let mut at = cell;
                elements.push(std::array::from_fn(|k| {
                    if k > 0 {
                        at[order[k - 1]] += 1;
                    }
                    vertex(at)
                }));
            }
        }
        let vertices: Vec<DVec3> =
            (0..x * y * z).map(|v| Self::place(v, [x, y, z])).map(|p| DVec3::from(p.map(f64::from))).collect();
        let count = elements.len();
        let mut owners: BTreeMap<Vec<u32>, Vec<u32>> = BTreeMap::new();
        for (t, row) in elements.iter().enumerate() {
            (0..K).for_each(|k| owners.entry(facet(row, k)).or_default().push(t as u32));
        }
        let across = |t: usize, k: usize| {
            owners[&facet(&elements[t], k)].iter().copied().find(|&o| o != t as u32).unwrap_or(HULL)
        };
        let size = |t: usize, k: usize| {
            let corners: Vec<DVec3> = facet(&elements[t], k).iter().map(|&v| vertices[v as usize]).collect();
            let [a, b] = [corners[1] - corners[0], corners[K - 2] - corners[0]];
            if K == 3 { a.length() } else { 0.5 * a.cross(b).length() }
        };
        Self {
            neighbours: (0..count).map(|t| std::array::from_fn(|k| across(t, k))).collect(),
            sizes: (0..count).map(|t| std::array::from_fn(|k| size(t, k))).collect(),
            winding: vec![0.0; count],
            inside: vec![false; count],
            forced: vec![Label::Free; count],
            facets: Vec::new(),
            vertices,
            elements,
        }
    }

    fn place(index: u32, [x, y, _]: [u32; 3]) -> [u32; 3] {
        [index % x, index / x % y, index / (x * y)]
    }

    fn centre(&self, t: usize) -> DVec3 {
        self.elements[t].iter().map(|&v| self.vertices[v as usize]).sum::<DVec3>() / K as f64
    }

    /// Fills the chosen cells, with winding numbers that agree.
    fn fill(mut self, is_in: impl Fn([i32; 3]) -> bool) -> Self {
        self.inside = (0..self.elements.len()).map(|t| is_in(self.centre(t).floor().as_ivec3().to_array())).collect();
        self.winding = self.inside.iter().map(|&x| f64::from(u8::from(x))).collect();
        self
    }

    fn input(&self) -> ConstraintInput<'_, K> {
        ConstraintInput {
            winding: &self.winding,
            neighbours: &self.neighbours,
            facet_sizes: &self.sizes,
            inside: &self.inside,
            forced: &self.forced,
            facets: &self.facets,
        }
    }

    fn satisfied(&self) -> Constrained {
        self.checked(satisfy_facets(&self.input(), &ConstraintSettings::default(), &mut go).unwrap())
    }

    fn manifold(&self) -> Constrained {
        let settings = ConstraintSettings::default();
        self.checked(make_manifold(&self.input(), &self.elements, &settings, &mut go).unwrap())
    }

    /// Energies are those of equation 8.8, and improvement never raised them.
    fn checked(&self, found: Constrained) -> Constrained {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + a.abs() + b.abs()), "{a} is not {b}");
        close(found.energy_before, self.energy(&self.inside));
        close(found.energy_after, self.energy(&found.inside));
        close(found.energy_after - found.energy_before, found.change_by_constraints + found.change_by_improvement);
        assert!(found.change_by_improvement <= 0.0 && (found.flips == 0) == (found.change_by_improvement == 0.0));
        found
    }

    /// Equation 8.8 written down as it stands.
    fn energy(&self, x: &[bool]) -> f64 {
        let SegmentationSettings { gamma, sigma } = SegmentationSettings::default();
        let mean = |t: usize| self.sizes[t].iter().sum::<f64>() / K as f64;
        let mut energy = 0.0;
        for t in 0..x.len() {
            let w = self.winding[t];
            energy += if x[t] { (1.0 - w).max(0.0) } else { w.max(0.0) };
            for k in 0..K {
                let o = self.neighbours[t][k] as usize;
                let (other, label, o, share) =
                    if o < x.len() { (self.winding[o], x[o], o, 0.5) } else { (0.0, false, t, 1.0) };
                if x[t] != label {
                    let size = 2.0 * self.sizes[t][k] / (mean(t) + mean(o));
                    energy += share * gamma * size * (-(w - other).powi(2) / (2.0 * sigma * sigma)).exp();
                }
            }
        }
        energy
    }

    /// The constraints that labels violate, seen from corners alone.
    fn unsatisfied(&self, x: &[bool]) -> Vec<HardConstraint> {
        let label = |t: u32| t != HULL && x[t as usize];
        let lost = (0..).zip(&self.facets).filter(|(_, sides)| !sides.iter().any(|&t| label(t)));
        let mut found: Vec<_> = lost.map(|(f, _)| HardConstraint::Facet(f)).collect();
        let vertices = 0..self.vertices.len() as u32;
        let edges = vertices.clone().flat_map(|a| (a + 1..self.vertices.len() as u32).map(move |b| [a, b]));
        found.extend(edges.filter(|e| K == 4 && !self.is_manifold(x, e)).map(HardConstraint::Edge));
        found.extend(vertices.filter(|&v| !self.is_manifold(x, &[v])).map(HardConstraint::Vertex));
        found
    }

    fn is_manifold(&self, x: &[bool], place: &[u32]) -> bool {
        let star: Vec<usize> = (0..x.len()).filter(|&t| place.iter().all(|v| self.elements[t].contains(v))).collect();
        let at_hull = |t: usize| (0..K).any(|k| self.neighbours[t][k] == HULL && !place.contains(&self.elements[t][k]));
        // The last node is everything beyond the hull.
        let mut piece: Vec<usize> = (0..=star.len()).collect();
        let labels: Vec<bool> = star.iter().map(|&t| x[t]).chain([false]).collect();
        let touch = |i: usize, j: usize| match star.get(j) {
            None => at_hull(star[i]),
            Some(&b) => self.elements[star[i]].iter().filter(|v| self.elements[b].contains(v)).count() == K - 1,
        };
        for i in 0..star.len() {
            for j in (i + 1..=star.len()).filter(|&j| labels[i] == labels[j] && touch(i, j)) {
                let (from, to) = (piece[i], piece[j]);
                piece.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
            }
        }
        let any_hull = star.iter().any(|&t| at_hull(t));
        let nodes = 0..star.len() + usize::from(any_hull);
        let pieces: BTreeSet<(bool, usize)> = nodes.map(|i| (labels[i], piece[i])).collect();
        let count = |label: bool| pieces.iter().filter(|p| p.0 == label).count();
        count(true) == 0 || (count(true) == 1 && count(false) <= 1)
    }
}

fn facet<const K: usize>(corners: &[u32; K], k: usize) -> Vec<u32> {
    let mut facet: Vec<u32> = (0..K).filter(|&l| l != k).map(|l| corners[l]).collect();
    facet.sort_unstable();
    facet
}

impl Case<4> {
    fn boundary(&self, x: &[bool]) -> Vec<[u32; 3]> {
        let all = (0..x.len()).filter(|&t| x[t]).flat_map(|t| (0..4).map(move |k| (t, k)));
        let open = all.filter(|&(t, k)| self.neighbours[t][k] == HULL || !x[self.neighbours[t][k] as usize]);
        open.map(|(t, k)| facet(&self.elements[t], k).try_into().unwrap()).collect()
    }

    /// The boundary is a closed manifold: two triangles at each edge, one fan around each vertex.
    fn has_manifold_boundary(&self, found: &Constrained) {
        assert_eq!((found.outcome, &found.unsatisfied[..]), (ConstraintOutcome::Satisfied, &[][..]));
        let triangles = self.boundary(&found.inside);
        assert!(!triangles.is_empty());
        assert!(edges(&triangles).iter().all(|edge| edge.triangles == 2));
        let corners: BTreeSet<u32> = triangles.iter().flatten().copied().collect();
        for v in corners {
            // Vertices opposite v, joined by the triangles' far sides, form one connected cycle.
            let link: Vec<Vec<u32>> = triangles
                .iter()
                .filter(|t| t.contains(&v))
                .map(|t| t.iter().copied().filter(|&c| c != v).collect())
                .collect();
            let mut reached: BTreeSet<u32> = link[0].iter().copied().collect();
            for _ in 0..link.len() {
                let near: Vec<u32> =
                    link.iter().filter(|s| s.iter().any(|c| reached.contains(c))).flatten().copied().collect();
                reached.extend(near);
            }
            assert!(link.iter().flatten().all(|c| reached.contains(c)), "the fan of {v} is not in one piece");
        }
    }
}

#[test]
fn cubes_that_touch_become_manifold() {
    let shapes: [(&str, Shape); 4] = [
        ("at an edge", |c| c == [1, 1, 1] || c == [2, 2, 1]),
        ("at the other kind of edge", |c| c == [2, 1, 1] || c == [1, 2, 1]),
        ("at a vertex", |c| c == [1, 1, 1] || c == [2, 2, 2]),
        ("as hollows", |c| c != [1, 1, 1] && c != [2, 2, 1]),
    ];
    for (what, shape) in shapes {
        let case = Case::<4>::grid([4, 4, 4]).fill(shape);
        assert!(!case.unsatisfied(&case.inside).is_empty(), "{what}");
        let found = case.manifold();
        assert_eq!(case.unsatisfied(&found.inside), [], "{what}");
        case.has_manifold_boundary(&found);
        assert!(found.added > 0 && case.inside.iter().zip(&found.inside).all(|(&before, &after)| after || !before));
    }
}

#[test]
fn a_manifold_stays_as_it_is() {
    let case = Case::<4>::grid([4, 4, 4]).fill(|c| c[2] == 1 && c != [1, 1, 1]);
    let found = case.manifold();
    case.has_manifold_boundary(&found);
    assert_eq!((found.added, found.flips, &found.inside), (0, 0, &case.inside));
}

#[test]
fn squares_that_touch_become_manifold() {
    let case = Case::<3>::grid([4, 4, 0]).fill(|c| c[..2] == [1, 1] || c[..2] == [2, 2] || c[..2] == [3, 1]);
    let broken = case.unsatisfied(&case.inside);
    assert_eq!(broken.len(), 2);
    let found = case.manifold();
    assert_eq!((found.outcome, case.unsatisfied(&found.inside)), (ConstraintOutcome::Satisfied, vec![]));
    assert!(found.added > 0);
}

/// A ball with a sheet of zero thickness attached, and the sheet's facets.
fn ball_with_sheet() -> Case<4> {
    let mut case = Case::<4>::grid([9, 6, 6])
        .fill(|c| DVec3::new(f64::from(c[0]) - 2.5, f64::from(c[1]) - 2.5, f64::from(c[2]) - 2.5).length() < 2.3);
    let mut surface = TriangleMesh { vertices: case.vertices.iter().map(DVec3::to_array).collect(), ..<_>::default() };
    let outward = |case: &Case<4>, t: usize, k: usize| {
        let [a, b, c]: [u32; 3] = facet(&case.elements[t], k).try_into().unwrap();
        let [p, q, r] = [a, b, c].map(|v| case.vertices[v as usize]);
        if (q - p).cross(r - p).dot(case.centre(t) - p) < 0.0 { [a, b, c] } else { [a, c, b] }
    };
    for t in 0..case.elements.len() {
        for k in 0..4 {
            let across = case.neighbours[t][k];
            let centre = facet(&case.elements[t], k).iter().map(|&v| case.vertices[v as usize]).sum::<DVec3>() / 3.0;
            let on_sheet =
                (centre.z - 3.0).abs() < 1e-9 && (1.0..5.0).contains(&centre.y) && (3.0..8.0).contains(&centre.x);
            let outside = across != HULL && !case.inside[t] && !case.inside[across as usize];
            if case.inside[t] && !case.inside[across as usize] {
                surface.triangles.push(outward(&case, t, k));
            } else if on_sheet && outside && case.centre(t).z < 3.0 {
                surface.triangles.push(outward(&case, t, k));
                case.facets.push([t as u32, across]);
            }
        }
    }
    let centres: Vec<[f64; 3]> = (0..case.elements.len()).map(|t| case.centre(t).to_array()).collect();
    case.winding = winding_number(&surface, &centres).unwrap();
    let settings = SegmentationSettings::default();
    case.inside =
        graph_cut_with_forced_labels(&case.winding, &case.neighbours, &case.sizes, &case.forced, &settings, &mut go)
            .unwrap()
            .inside;
    case
}

#[test]
fn thin_sheet_on_a_ball_keeps_its_facets() {
    let mut case = ball_with_sheet();
    let lost =
        |case: &Case<4>, x: &[bool]| case.facets.iter().filter(|sides| !sides.iter().any(|&t| x[t as usize])).count();
    assert!(case.facets.len() > 20 && lost(&case, &case.inside) > case.facets.len() / 2);
    let found = case.satisfied();
    assert_eq!((found.outcome, lost(&case, &found.inside)), (ConstraintOutcome::Satisfied, 0));
    assert!(found.added > 0 && found.added <= case.facets.len());
    case.inside = found.inside;
    let manifold = case.manifold();
    case.has_manifold_boundary(&manifold);
    assert_eq!(lost(&case, &manifold.inside), 0);
}

#[test]
fn limit_is_named_and_constraints_still_hold() {
    let mut case = Case::<4>::grid([3, 3, 3]);
    case.winding.fill(0.45);
    // Everything around one element is added, so that only improvement includes it.
    let middle = (0..case.winding.len()).find(|&t| !case.neighbours[t].contains(&HULL)).unwrap();
    case.facets = case.neighbours[middle].iter().map(|&t| [t, HULL]).collect();
    let settings = ConstraintSettings { flips_per_element: 0, ..ConstraintSettings::default() };
    let limited = case.checked(satisfy_facets(&case.input(), &settings, &mut go).unwrap());
    let free = case.satisfied();
    assert!(!limited.inside[middle] && free.inside[middle] && limited.unsatisfied.is_empty());
    assert_eq!((limited.outcome, limited.flips), (ConstraintOutcome::LimitReached, 0));
    assert!(free.flips > 0 && free.energy_after < limited.energy_after);
    assert_eq!(free.outcome, ConstraintOutcome::Satisfied);
}

#[test]
fn what_cannot_be_is_listed() {
    let mut case = Case::<4>::grid([4, 4, 4]).fill(|c| c == [1, 1, 1] || c == [2, 2, 1]);
    case.facets = vec![[HULL, HULL], [0, 1], [3, HULL]];
    for t in (0..case.forced.len()).filter(|&t| !case.inside[t] && t != 3) {
        case.forced[t] = Label::Outside;
    }
    let found = case.satisfied();
    assert_eq!(found.outcome, ConstraintOutcome::PartlyUnsatisfied);
    assert_eq!(found.unsatisfied, [HardConstraint::Facet(0), HardConstraint::Facet(1)]);
    assert!(found.inside[3]);
    case.inside = found.inside;
    let found = case.manifold();
    assert_eq!((found.outcome, found.added), (ConstraintOutcome::PartlyUnsatisfied, 0));
    assert_eq!(found.unsatisfied, case.unsatisfied(&case.inside));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_allowed_flip_is_an_improvement(
        values in prop::collection::vec((0.0..1.0_f64, 0..12_u8), 18),
        facets in prop::collection::vec((0..18_usize, 0..4_usize), 0..6),
    ) {
        let mut case = Case::<4>::grid([3, 1, 1]);
        case.winding = values.iter().map(|v| v.0).collect();
        case.forced = values.iter().map(|v| [Label::Inside, Label::Outside].get(v.1 as usize).copied().unwrap_or_default())
            .collect();
        case.facets = facets.iter().map(|&(t, k)| [t as u32, case.neighbours[t][k]]).collect();
        let settings = SegmentationSettings::default();
        case.inside = graph_cut_with_forced_labels(
            &case.winding, &case.neighbours, &case.sizes, &case.forced, &settings, &mut go).unwrap().inside;
        // Of all labellings that keep the forced ones, as the cut is exact.
        let lowest = case.energy(&case.inside);
        let free = |case: &Case<4>, t: usize, x: &[bool]| {
            case.forced[t] != if x[t] { Label::Inside } else { Label::Outside }
        };
        let is_facet = |c: &HardConstraint| matches!(c, HardConstraint::Facet(_));
        for with_manifold in [false, true] {
            let found = if with_manifold { case.manifold() } else { case.satisfied() };
            let mut before = case.unsatisfied(&found.inside);
            before.retain(|c| with_manifold || is_facet(c));
            prop_assert_eq!(&found.unsatisfied, &before);
            prop_assert!(found.energy_after >= lowest - 1e-9);
            prop_assert!(with_manifold || found.energy_after >= found.energy_before - 1e-9, "facets only");
            for t in (0..18).filter(|&t| free(&case, t, &found.inside)) {
                let mut x = found.inside.clone();
                x[t] = !x[t];
                let mut after = case.unsatisfied(&x);
                after.retain(|c| with_manifold || is_facet(c));
                let better = case.energy(&x) < found.energy_after - 1e-9;
                prop_assert!(!better || after.iter().any(|c| !before.contains(c)), "flipping {} is better", t);
            }
            case.inside = found.inside;
        }
    }
}

#[test]
fn constraints_cannot_be_cheaper_than_the_best_labels() {
    // Trying all labels of two cubes: none that satisfy the facets have less energy than the bound, and the greedy ones
    // cost at most one more element.
    let mut case = Case::<4>::grid([2, 1, 1]);
    case.winding = (0..12).map(|t| f64::from(t * 7 % 12) / 20.0).collect();
    case.facets = vec![[0, case.neighbours[0][0]], [7, HULL], [4, HULL]];
    let found = case.satisfied();
    let labels = (0..1_u32 << 12).map(|bits| (0..12).map(|t| bits >> t & 1 == 1).collect::<Vec<bool>>());
    let holds = |x: &[bool]| case.facets.iter().all(|s| s.iter().any(|&t| t != HULL && x[t as usize]));
    let best = labels.filter(|x| holds(x)).map(|x| case.energy(&x)).fold(f64::INFINITY, f64::min);
    assert!((best - 1e-9..best + 1.0).contains(&found.energy_after), "{best} {}", found.energy_after);
}

#[test]
fn bad_input_is_named() {
    let good = Case::<4>::grid([2, 2, 1]).fill(|c| c == [0, 0, 0] || c == [1, 1, 0]);
    let error = |change: &dyn Fn(&mut Case<4>)| {
        let mut case = good.clone();
        change(&mut case);
        make_manifold(&case.input(), &case.elements, &ConstraintSettings::default(), &mut go).unwrap_err()
    };
    assert!(matches!(error(&|c| c.winding[3] = f64::NAN), SegmentationError::BadWinding { element: 3, .. }));
    assert!(matches!(error(&|c| c.sizes[2][1] = -1.0), SegmentationError::BadFacetSize { element: 2 }));
    assert!(matches!(error(&|c| c.facets = vec![[1, 24]]), SegmentationError::BadFacet { facet: 0, element: 24, .. }));
    assert!(matches!(error(&|c| c.neighbours[0][0] = 0), SegmentationError::BadNeighbour { element: 0, .. }));
    assert!(matches!(error(&|c| c.neighbours[1][2] = 99), SegmentationError::BadNeighbour { element: 1, .. }));
    assert!(matches!(error(&|c| c.elements[5][1] = 7777), SegmentationError::BadNeighbour { .. }));
    assert!(matches!(
        error(&|c| c.elements[0][1] = c.elements[0][0]),
        SegmentationError::RepeatedCorner { element: 0, .. }
    ));
    let shorten: [&dyn Fn(&mut Case<4>); 4] =
        [&|c| c.inside.truncate(2), &|c| c.forced.truncate(2), &|c| c.elements.truncate(2), &|c| c.winding.truncate(2)];
    for change in shorten {
        assert!(matches!(error(change), SegmentationError::WrongLength { found: 2, elements: 24, .. }));
    }
    let settings = ConstraintSettings::default();
    let mut stop = |_: &str, _: f64| ControlFlow::Break(());
    let cancelled = make_manifold(&good.input(), &good.elements, &settings, &mut stop);
    assert_eq!(cancelled, Err(SegmentationError::Cancelled));
    let mut facets = good.clone();
    facets.facets = vec![[0, 1]];
    assert_eq!(satisfy_facets(&facets.input(), &settings, &mut stop), Err(SegmentationError::Cancelled));
    let empty = Case::<4>::grid([0, 0, 0]);
    let nothing = make_manifold(&empty.input(), &empty.elements, &settings, &mut go).unwrap();
    assert_eq!((nothing.inside.len(), nothing.outcome), (0, ConstraintOutcome::Satisfied));
}
