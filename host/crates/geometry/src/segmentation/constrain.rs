//! Segmentations that satisfy what a graph cut cannot enforce: facets with an inside element, and a manifold boundary
//! (thesis 8.5.2).

use std::collections::{BTreeSet, VecDeque};
use std::ops::ControlFlow;

use super::energy::{Energy, OUTSIDE, SegmentationSettings};
use super::error::SegmentationError;
use super::graph_cut::Label;
use crate::progress::{Progress, stage};
/// Elements tested, or facets checked, between two progress reports.
const REPORT_EVERY: usize = 1024;

/// A segmentation and its constraints.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintInput<'a, const K: usize> {
    /// n integral means of the winding number.
    pub winding: &'a [f64],
    /// n×K, the element across each facet, `u32::MAX` beyond the hull, where everything is outside.
    pub neighbours: &'a [[u32; K]],
    /// n×K lengths (K = 3) or areas (K = 4) of those facets, in any unit.
    pub facet_sizes: &'a [[f64; K]],
    /// n labels to start from, such as those of [`graph_cut`](super::graph_cut::graph_cut).
    pub inside: &'a [bool],
    /// n labels that no flip may change, such as [`Label::Inside`] for chains that join what belongs together.
    pub forced: &'a [Label],
    /// m facets that should be part of the inside: the elements on their two sides, `u32::MAX` beyond the hull.
    pub facets: &'a [[u32; 2]],
}

/// How constraints are enforced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintSettings {
    /// The energy of the graph cut that gave the labels.
    pub segmentation: SegmentationSettings,
    /// Improvement stops after this many flips per element of the mesh. This is a safeguard, not tuned: the energy
    /// falls with every flip, but the only known bound on their number is the number of labellings.
    pub flips_per_element: usize,
}

impl Default for ConstraintSettings {
    fn default() -> Self {
        Self { segmentation: SegmentationSettings::default(), flips_per_element: 16 }
    }
}

/// A constraint on the inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum HardConstraint {
    /// This facet, zero-based, has an inside element.
    Facet(u32),
    /// Around the edge between these vertices, the smaller first, the inside is one fan.
    Edge([u32; 2]),
    /// Around this vertex inside and outside are one piece each.
    Vertex(u32),
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConstraintOutcome {
    /// Every constraint is satisfied.
    Satisfied,
    /// Everything that could be satisfied is; the rest is listed.
    PartlyUnsatisfied,
    /// The limit of flips was reached: constraints were still enforced, but some flips that would improve the labels
    /// were not made. Unsatisfied constraints are listed.
    LimitReached,
}

/// Labels that satisfy constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Constrained {
    /// For each element, whether it is inside.
    pub inside: Vec<bool>,
    /// Equation 8.8 for the given labels.
    pub energy_before: f64,
    /// Equation 8.8 for these labels.
    pub energy_after: f64,
    /// How much the elements added for constraints changed the energy, at the time they were added.
    pub change_by_constraints: f64,
    /// How much improvement changed the energy, never above 0.
    pub change_by_improvement: f64,
    /// How many elements were labelled inside for constraints, whatever improvement did to them later.
    pub added: usize,
    /// How many labels improvement flipped, counting repeated flips.
    pub flips: usize,
    /// Unsatisfied constraints, in order.
    pub unsatisfied: Vec<HardConstraint>,
    /// How it ended.
    pub outcome: ConstraintOutcome,
}

/// Gives each facet an inside element, by the heuristic of thesis 8.5.2; the best such labels cannot be found
/// efficiently.
///
/// Marches over the facets; where neither side is inside, the one with the larger winding number becomes inside, and
/// the energy is improved greedily around it: elements next to just-flipped ones are flipped if that lowers the energy
/// and breaks no facet that has its element. If the given labels are a local minimum, as those of a graph cut are, the
/// result is a local minimum among labels that satisfy the same constraints. `forced` takes precedence over facets.
///
/// Arrays that do not match, values a mesh cannot have, and facets of elements that do not exist are errors. `progress`
/// receives the fraction of facets done; see [`Progress`].
pub fn satisfy_facets<const K: usize>(
    input: &ConstraintInput<K>,
    settings: &ConstraintSettings,
    progress: Progress<'_>,
) -> Result<Constrained, SegmentationError> {
    let mut labels = Labels::new(input, settings, None)?;
    let count = input.facets.len();
    let mut told = stage(progress, "keeping facets");
    for (facet, &sides) in input.facets.iter().enumerate() {
        let mut report = || told(facet as f64 / count as f64);
        if facet % REPORT_EVERY == 0 && report().is_break() {
            return Err(SegmentationError::Cancelled);
        }
        if labels.holds(sides) {
            continue;
        }
        let can_be_inside = |&t: &u32| t != OUTSIDE && input.forced[t as usize] != Label::Outside;
        let winding = |t: u32| input.winding[t as usize];
        let best = sides.into_iter().filter(can_be_inside).reduce(|a, b| if winding(b) > winding(a) { b } else { a });
        if let Some(best) = best {
            labels.add(best as usize);
            labels.improve(&[best], &mut report)?;
        }
    }
    Ok(labels.finish())
}

/// Makes the boundary of the inside a manifold, by the heuristic of thesis 8.5.2: triangles with K = 3, tetrahedra
/// with K = 4.
///
/// `elements`: n×K corners, the facet k of an element opposite its corner k. The boundary is a manifold if, around each
/// of its edges (K = 4) and vertices, the inside elements are connected through facets there, and so are the outside
/// ones; everything beyond the hull counts as one outside element. Marches over edges and vertices; where the boundary
/// is not manifold, outside elements are labelled inside in order of decreasing winding number until it is. Then the
/// energy is improved greedily around them by flips that break no edge, vertex or facet that is in order. The thesis
/// improves after each step, but then what is not yet in order is not protected, and on a truck of overlapping parts
/// improvement and repair had not finished after minutes. Facets are protected, not added: see [`satisfy_facets`] for
/// that.
///
/// Errors and `progress` as there, plus errors for elements that repeat a corner or do not share a neighbour's facet.
pub fn make_manifold<const K: usize>(
    input: &ConstraintInput<K>,
    elements: &[[u32; K]],
    settings: &ConstraintSettings,
    progress: Progress<'_>,
) -> Result<Constrained, SegmentationError> {
    let mut labels = Labels::new(input, settings, Some(elements))?;
    let mut waiting: BTreeSet<_> = labels.boundary_places().into_iter().map(edges_first).collect();
    let (mut done, mut added) = (0_usize, Vec::new());
    let mut told = stage(progress, "making the boundary manifold");
    while let Some((_, place)) = waiting.pop_first() {
        let part = done as f64 / (done + waiting.len() + 1) as f64;
        if done.is_multiple_of(REPORT_EVERY) && told(part).is_break() {
            return Err(SegmentationError::Cancelled);
        }
        done += 1;
        let filled = labels.fill(place);
        waiting.extend(filled.iter().flat_map(|&t| places(&elements[t as usize])).map(edges_first));
        added.extend(filled);
    }
    labels.improve(&added, &mut || told(1.0))?;
    Ok(labels.finish())
}

/// An edge by its vertices, the smaller first, or a vertex, twice.
type Place = [u32; 2];

/// Edges go first: fixing them fixes most vertices.
fn edges_first(place: Place) -> (bool, Place) {
    (place[0] == place[1], place)
}

/// The vertices of an element and, of a tetrahedron, its edges.
fn places<const K: usize>(corners: &[u32; K]) -> impl Iterator<Item = Place> {
    let pairs = (0..K).flat_map(|a| (a..K).map(move |b| (a, b))).filter(|&(a, b)| a == b || K > 3);
    pairs.map(|(a, b)| [corners[a].min(corners[b]), corners[a].max(corners[b])])
}

/// Labels while constraints are enforced.
struct Labels<'a, const K: usize> {
    input: &'a ConstraintInput<'a, K>,
    energy: Energy<'a, K>,
    /// Elements of facets and their neighbours beyond, sorted.
    sides: Vec<[u32; 2]>,
    stars: Option<Stars<'a, K>>,
    inside: Vec<bool>,
    queue: VecDeque<u32>,
    queued: Vec<bool>,
    tested: usize,
    most_flips: usize,
    flips: usize,
    limited: bool,
    added: usize,
    change_by_constraints: f64,
    change_by_improvement: f64,
}

impl<'a, const K: usize> Labels<'a, K> {
    fn new(
        input: &'a ConstraintInput<'a, K>,
        settings: &ConstraintSettings,
        elements: Option<&'a [[u32; K]]>,
    ) -> Result<Self, SegmentationError> {
        let energy = Energy::new(input.winding, input.neighbours, input.facet_sizes, &settings.segmentation)?;
        let count = input.neighbours.len();
        let corners = elements.map_or(count, <[_]>::len);
        let lengths = [("labels", input.inside.len()), ("forced labels", input.forced.len()), ("corners", corners)];
        if let Some(&(what, found)) = lengths.iter().find(|(_, found)| *found != count) {
            return Err(SegmentationError::WrongLength { what, found, elements: count });
        }
        for (facet, &element) in
            input.facets.iter().enumerate().flat_map(|(f, sides)| sides.iter().map(move |t| (f, t)))
        {
            if element != OUTSIDE && element as usize >= count {
                return Err(SegmentationError::BadFacet { facet, element, elements: count });
            }
        }
        let both = input.facets.iter().flat_map(|&[a, b]| [[a, b], [b, a]]);
        let mut sides: Vec<[u32; 2]> = both.filter(|side| side[0] != OUTSIDE).collect();
        sides.sort_unstable();
        Ok(Self {
            input,
            energy,
            sides,
            stars: elements.map(|elements| Stars::new(elements, input.neighbours)).transpose()?,
            inside: input.inside.to_vec(),
            queue: VecDeque::new(),
            queued: vec![false; count],
            tested: 0,
            most_flips: settings.flips_per_element.saturating_mul(count),
            flips: 0,
            limited: false,
            added: 0,
            change_by_constraints: 0.0,
            change_by_improvement: 0.0,
        })
    }

    fn is_inside(&self, element: u32) -> bool {
        element != OUTSIDE && self.inside[element as usize]
    }

    fn holds(&self, sides: [u32; 2]) -> bool {
        sides.into_iter().any(|t| self.is_inside(t))
    }

    /// The elements beyond those facets of an element that must hold.
    fn beyond(&self, element: u32) -> impl Iterator<Item = u32> {
        let first = self.sides.partition_point(|side| side[0] < element);
        self.sides[first..].iter().take_while(move |side| side[0] == element).map(|side| side[1])
    }

    /// Labels an element inside for a constraint.
    fn add(&mut self, element: usize) {
        self.change_by_constraints += self.energy.change(&self.inside, element).0;
        self.inside[element] = true;
        self.added += 1;
    }

    /// Whether a flip respects the forced label and breaks nothing that holds.
    fn may_flip(&mut self, element: u32) -> bool {
        let t = element as usize;
        let forced = if self.inside[t] { Label::Inside } else { Label::Outside };
        if self.input.forced[t] == forced {
            return false;
        }
        if self.inside[t] && self.beyond(element).any(|other| other == element || !self.is_inside(other)) {
            return false;
        }
        let Some(stars) = &mut self.stars else { return true };
        places(&stars.elements[t]).all(|place| {
            self.inside[t] = !self.inside[t];
            let after = stars.is_manifold(place, &self.inside);
            self.inside[t] = !self.inside[t];
            after || !stars.is_manifold(place, &self.inside)
        })
    }

    /// Flips whatever lowers the energy, starting around some elements, until nothing does or the limit is reached.
    fn improve(
        &mut self,
        flipped: &[u32],
        report: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<(), SegmentationError> {
        flipped.iter().for_each(|&t| self.wake(t));
        while let Some(element) = self.queue.pop_front() {
            let t = element as usize;
            self.queued[t] = false;
            self.tested += 1;
            if self.tested.is_multiple_of(REPORT_EVERY) && report().is_break() {
                return Err(SegmentationError::Cancelled);
            }
            let (change, rounding) = self.energy.change(&self.inside, t);
            if change >= -rounding || !self.may_flip(element) {
                continue;
            }
            if self.flips >= self.most_flips {
                self.limited = true;
                continue;
            }
            self.inside[t] = !self.inside[t];
            self.flips += 1;
            self.change_by_improvement += change;
            self.wake(element);
        }
        Ok(())
    }

    /// Queues the elements whose flip may have become better or allowed by this element's flip.
    fn wake(&mut self, element: u32) {
        let t = element as usize;
        let stars = self.stars.iter().flat_map(|stars| stars.elements[t].iter().flat_map(|&v| stars.around(v)));
        let near = self.input.neighbours[t].iter().copied().chain(stars).chain(self.beyond(element));
        let near: Vec<u32> = near.chain([element]).filter(|&t| t != OUTSIDE).collect();
        for t in near {
            if !std::mem::replace(&mut self.queued[t as usize], true) {
                self.queue.push_back(t);
            }
        }
    }

    /// Labels elements around a place inside until the boundary is manifold there; none if it already is or cannot be.
    fn fill(&mut self, place: Place) -> Vec<u32> {
        let Some(stars) = &mut self.stars else { return Vec::new() };
        if stars.is_manifold(place, &self.inside) {
            return Vec::new();
        }
        let can = |&t: &u32| !self.inside[t as usize] && self.input.forced[t as usize] != Label::Outside;
        let mut outside: Vec<u32> = stars.around_place(place).filter(can).collect();
        let winding = |t: u32| self.input.winding[t as usize];
        outside.sort_by(|&a, &b| winding(b).total_cmp(&winding(a)).then(a.cmp(&b)));
        let mut labelled = 0;
        while !stars.is_manifold(place, &self.inside) {
            let Some(&next) = outside.get(labelled) else {
                outside.iter().for_each(|&t| self.inside[t as usize] = false);
                return Vec::new();
            };
            self.inside[next as usize] = true;
            labelled += 1;
        }
        outside.truncate(labelled);
        // Revert, to add them one by one and measure each change.
        outside.iter().for_each(|&t| self.inside[t as usize] = false);
        outside.iter().for_each(|&t| self.add(t as usize));
        outside
    }

    /// The edges and vertices of the boundary of the inside.
    fn boundary_places(&self) -> BTreeSet<Place> {
        let elements = self.stars.as_ref().map_or(&[][..], |stars| stars.elements);
        let mut found = BTreeSet::new();
        for (corners, row) in elements.iter().zip(self.input.neighbours).zip(&self.inside).filter(|x| *x.1).map(|x| x.0)
        {
            for k in (0..K).filter(|&k| !self.is_inside(row[k])) {
                found.extend(places(corners).filter(|place| !place.contains(&corners[k])));
            }
        }
        found
    }

    fn finish(mut self) -> Constrained {
        let facets = (0..).zip(self.input.facets).filter(|&(_, &sides)| !self.holds(sides));
        let mut unsatisfied: Vec<_> = facets.map(|(facet, _)| HardConstraint::Facet(facet)).collect();
        let boundary = self.boundary_places();
        if let Some(stars) = &mut self.stars {
            let broken = boundary.into_iter().filter(|&place| !stars.is_manifold(place, &self.inside));
            unsatisfied.extend(
                broken.map(|[a, b]| if a == b { HardConstraint::Vertex(a) } else { HardConstraint::Edge([a, b]) }),
            );
        }
        unsatisfied.sort_unstable();
        let outcome = match (self.limited, unsatisfied.is_empty()) {
            (true, _) => ConstraintOutcome::LimitReached,
            (false, true) => ConstraintOutcome::Satisfied,
            (false, false) => ConstraintOutcome::PartlyUnsatisfied,
        };
        Constrained {
            energy_before: self.energy.of(self.input.inside),
            energy_after: self.energy.of(&self.inside),
            inside: self.inside,
            change_by_constraints: self.change_by_constraints,
            change_by_improvement: self.change_by_improvement,
            added: self.added,
            flips: self.flips,
            unsatisfied,
            outcome,
        }
    }
}

/// The elements around vertices and edges.
struct Stars<'a, const K: usize> {
    elements: &'a [[u32; K]],
    neighbours: &'a [[u32; K]],
    /// Vertices and their elements, sorted.
    incident: Vec<[u32; 2]>,
    /// For each element the last search that has seen it.
    seen: Vec<u64>,
    search: u64,
}

impl<'a, const K: usize> Stars<'a, K> {
    fn new(elements: &'a [[u32; K]], neighbours: &'a [[u32; K]]) -> Result<Self, SegmentationError> {
        for (element, (corners, row)) in elements.iter().zip(neighbours).enumerate() {
            if let Some(k) = (1..K).find(|&k| corners[..k].contains(&corners[k])) {
                return Err(SegmentationError::RepeatedCorner { element, vertex: corners[k] });
            }
            let shared = |k: usize| {
                let across = elements.get(row[k] as usize);
                across.is_none_or(|other| (0..K).all(|l| l == k || other.contains(&corners[l])))
            };
            if let Some(k) = (0..K).find(|&k| !shared(k)) {
                return Err(SegmentationError::BadNeighbour { element, neighbour: row[k] });
            }
        }
        let rows = (0_u32..).zip(elements);
        let mut incident: Vec<[u32; 2]> = rows.flat_map(|(t, corners)| corners.map(|v| [v, t])).collect();
        incident.sort_unstable();
        Ok(Self { elements, neighbours, incident, seen: vec![0; elements.len()], search: 0 })
    }

    fn around(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let first = self.incident.partition_point(|pair| pair[0] < vertex);
        self.incident[first..].iter().take_while(move |pair| pair[0] == vertex).map(|pair| pair[1])
    }

    fn around_place(&self, [a, b]: Place) -> impl Iterator<Item = u32> {
        self.around(a).filter(move |&t| self.elements[t as usize].contains(&b))
    }

    /// Whether inside and outside are at most one piece each around an edge or vertex, or all is outside.
    fn is_manifold(&mut self, place: Place, inside: &[bool]) -> bool {
        self.search += 1;
        let star: Vec<u32> = self.around_place(place).collect();
        let (mut inside_pieces, mut outside_pieces, mut beyond_hull) = (0, 0, false);
        let mut stack = Vec::new();
        for &seed in &star {
            if self.seen[seed as usize] == self.search {
                continue;
            }
            let label = inside[seed as usize];
            let mut at_hull = false;
            self.seen[seed as usize] = self.search;
            stack.push(seed as usize);
            while let Some(t) = stack.pop() {
                for k in (0..K).filter(|&k| !place.contains(&self.elements[t][k])) {
                    let next = self.neighbours[t][k];
                    at_hull |= next == OUTSIDE;
                    if next != OUTSIDE && inside[next as usize] == label && self.seen[next as usize] != self.search {
                        self.seen[next as usize] = self.search;
                        stack.push(next as usize);
                    }
                }
            }
            inside_pieces += usize::from(label);
            outside_pieces += usize::from(!label && !at_hull);
            beyond_hull |= at_hull;
        }
        inside_pieces == 0 || (inside_pieces == 1 && outside_pieces + usize::from(beyond_hull) <= 1)
    }
}
