//! The least costly embedding of a template: branch and bound over stances and over the ends of limbs.

use std::ops::ControlFlow;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::costs::{Choice, Costs, Stance, worth};
use super::error::RigError;
use super::interior::Interior;
use super::landmarks::Landmarks;
use super::template::Template;
use crate::progress::Progress;

/// Sizes of the template that are tried, relative to that with the mesh's longest way.
const SCALES: [f64; 7] = [0.6, 0.7, 0.82, 0.95, 1.1, 1.28, 1.5];
/// Finer ones around the best.
const FINE_SCALES: [f64; 5] = [0.92, 0.96, 1.0, 1.04, 1.08];
/// Where hubs can be in the end: inner points this near to the first choice, as a share of the longest way ...
const NEAR_HUB: f64 = 0.07;
/// ... and at most this many for each hub.
const FINE_CENTRES: usize = 110;
/// Other stances are searched through if they could cost at most this much more than the best.
const WORTH_KNOWING: f64 = 0.4;
/// Partial embeddings that are looked at for one stance, and in all.
const MOST_STEPS: usize = 3000;
const MOST_STEPS_IN_ALL: usize = 15_000;

/// Where the template is in the mesh.
#[derive(Clone, Debug)]
pub(super) struct Embedding {
    pub(super) stance: Stance,
    /// The inner point of each hub.
    pub(super) hubs: Vec<usize>,
    /// The end of each limb; `None` where there is none.
    pub(super) ends: Vec<Option<usize>>,
    pub(super) cost: f64,
}

impl Embedding {
    /// What of the cost says how badly the template fits: all but the limbs of the mesh that it uses or leaves.
    pub(super) fn misfit(&self, landmarks: &Landmarks) -> f64 {
        let used = self.ends.iter().flatten().map(|&end| worth(landmarks, &landmarks.ends[end]));
        (self.cost + used.sum::<f64>()).max(0.0)
    }
}

/// The best embedding, and how the search went.
pub(super) struct Found {
    pub(super) best: Embedding,
    /// The best ones of other turns, where they are not much worse.
    pub(super) others: Vec<Embedding>,
    /// Whether any stance was left before all that could be better was looked at.
    pub(super) limit_reached: bool,
}

/// Finds it. `turns` and their symmetry: how the template may stand in the mesh, the preferred one first.
pub(super) fn search(
    template: &Template,
    interior: &Interior,
    landmarks: &Landmarks,
    turns: &[(DMat3, f64)],
    progress: Progress<'_>,
) -> Result<Found, RigError> {
    const STAGE: &str = "searching for the limbs";
    let base = landmarks.diameter / longest_way(template);
    let stances: Vec<Stance> = turns
        .iter()
        .flat_map(|&(turn, symmetry)| SCALES.map(|scale| Stance { turn, scale: base * scale, symmetry }))
        .collect();
    let open = vec![Choice::Open; template.limbs.len()];
    let costs = |stance: Stance| Costs::new(template, landmarks, interior, &landmarks.centres, stance);
    let mut bounds: Vec<(f64, usize)> = stances
        .par_iter()
        .enumerate()
        .map(|(at, stance)| (costs(*stance).least(&open).cost + dislike(template, &turns[0].0, stance), at))
        .collect();
    bounds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut best_of: Vec<Option<Embedding>> = vec![None; turns.len()];
    let mut limit_reached = false;
    let mut steps = 0;
    for (done, &(bound, at)) in bounds.iter().enumerate() {
        if progress(STAGE, done as f64 / bounds.len() as f64) == ControlFlow::Break(()) {
            return Err(RigError::Cancelled { stage: STAGE });
        }
        let turn = at / SCALES.len();
        let best = best_of.iter().flatten().map(|found| found.cost).fold(f64::INFINITY, f64::min);
        let own = best_of[turn].as_ref().map_or(f64::INFINITY, |found| found.cost);
        let worse_than = own.min(best + WORTH_KNOWING);
        if bound >= worse_than {
            continue;
        }
        if steps >= MOST_STEPS_IN_ALL {
            limit_reached = true;
            break;
        }
        let mut descent = Descent {
            template,
            costs: costs(stances[at]),
            order: order(template),
            ends: landmarks.ends.len(),
            dislike: dislike(template, &turns[0].0, &stances[at]),
            best: worse_than,
            found: None,
            steps: 0,
        };
        descent.descend(&mut open.clone(), 0, 0.0);
        limit_reached |= descent.steps >= MOST_STEPS;
        steps += descent.steps;
        if let Some((cost, choices)) = descent.found {
            let hubs = descent.costs.least(&choices).hubs;
            best_of[turn] = Some(Embedding { stance: stances[at], hubs, ends: ends(&choices), cost });
        }
    }
    let mut found: Vec<Embedding> = best_of.into_iter().flatten().collect();
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // All limbs may be absent, so every stance has an embedding; the first searched is always kept.
    let mut found = found.into_iter();
    let Some(best) = found.next() else { return Err(RigError::NoBones) };
    let best = refine(template, interior, landmarks, best);
    Ok(Found { best, others: found.collect(), limit_reached })
}

/// Of stances that fit about equally well, the usual ones are preferred, +Y up, else +Z, looking along +Z, and those that
/// use the mesh's symmetry.
fn dislike(template: &Template, usual: &DMat3, stance: &Stance) -> f64 {
    const ASYMMETRY: f64 = 0.4;
    const OTHER_FRONT: f64 = 0.04;
    const OTHER_UP: f64 = 0.4;
    const Z_UP: f64 = 0.15;
    let asymmetry = if template.is_symmetric() { ASYMMETRY * (1.0 - stance.symmetry) } else { 0.0 };
    let is_same = |a: DVec3, b: DVec3| a.dot(b) > 0.99;
    let front = if is_same(stance.turn.z_axis, usual.z_axis) { 0.0 } else { OTHER_FRONT };
    let up = match stance.turn.y_axis {
        up if is_same(up, usual.y_axis) => 0.0,
        up if is_same(up, DVec3::Z) => Z_UP,
        _ => OTHER_UP,
    };
    asymmetry + front + up
}

fn ends(choices: &[Choice]) -> Vec<Option<usize>> {
    let end = |choice: &Choice| if let Choice::End(end) = choice { Some(*end) } else { None };
    choices.iter().map(end).collect()
}

/// Limbs in the order in which they are assigned: images follow each other, so that sides are told apart early.
fn order(template: &Template) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::new();
    for (at, limb) in template.limbs.iter().enumerate() {
        for limb in std::iter::once(at).chain(limb.mirror) {
            if !order.contains(&limb) {
                order.push(limb);
            }
        }
    }
    order
}

struct Descent<'a> {
    template: &'a Template,
    costs: Costs<'a>,
    order: Vec<usize>,
    ends: usize,
    dislike: f64,
    best: f64,
    found: Option<(f64, Vec<Choice>)>,
    steps: usize,
}

impl Descent<'_> {
    /// Assigns the limbs from `depth` on; `pairs` is what those before cost in pairs. The first way down takes far fewer
    /// steps than the limit, so that something is always found.
    fn descend(&mut self, choices: &mut Vec<Choice>, depth: usize, pairs: f64) {
        let Some(&limb) = self.order.get(depth) else {
            let cost = self.costs.least(choices).cost + pairs + self.dislike;
            if cost < self.best {
                self.best = cost;
                self.found = Some((cost, choices.clone()));
            }
            return;
        };
        let is_free = |end: &usize| !choices.contains(&Choice::End(*end));
        let free: Vec<usize> = (0..self.ends).filter(is_free).collect();
        let mut next: Vec<(f64, f64, Choice)> = Vec::new();
        for choice in free.into_iter().map(Choice::End).chain([Choice::Absent]) {
            let with_pairs = pairs + self.pairs(choices, limb, choice);
            choices[limb] = choice;
            let bound = self.costs.least(choices).cost + with_pairs + self.dislike;
            self.steps += 1;
            next.push((bound, with_pairs, choice));
        }
        next.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (bound, with_pairs, choice) in next {
            if bound >= self.best || self.steps >= MOST_STEPS {
                break;
            }
            choices[limb] = choice;
            self.descend(choices, depth + 1, with_pairs);
        }
        choices[limb] = Choice::Open;
    }

    fn pairs(&self, choices: &[Choice], limb: usize, choice: Choice) -> f64 {
        let Choice::End(own) = choice else { return 0.0 };
        let others = self.template.limbs.iter().enumerate().zip(choices);
        let cost = |((other, _), chosen): ((usize, _), &Choice)| match *chosen {
            Choice::End(end) if other != limb => self.costs.pair([limb, other], [own, end]),
            _ => 0.0,
        };
        others.map(cost).sum()
    }
}

/// The best hubs and scale with these ends, on all points around the first choice.
fn refine(template: &Template, interior: &Interior, landmarks: &Landmarks, best: Embedding) -> Embedding {
    let choice = |end: &Option<usize>| end.map_or(Choice::Absent, Choice::End);
    let choices: Vec<Choice> = best.ends.iter().map(choice).collect();
    let mut centres: Vec<usize> = Vec::new();
    for &hub in &best.hubs {
        let near = |&p: &usize| {
            interior.points[p].distance(interior.points[hub]) <= NEAR_HUB * landmarks.diameter
                && interior.depth[p] >= 0.5 * interior.depth[hub]
        };
        let around: Vec<usize> = (0..interior.points.len()).filter(near).collect();
        centres.extend(around.iter().step_by(1 + around.len() / FINE_CENTRES));
        centres.push(hub);
    }
    centres.sort_unstable();
    centres.dedup();
    let tried = FINE_SCALES.iter().map(|fine| {
        let stance = Stance { scale: best.stance.scale * fine, ..best.stance };
        let least = Costs::new(template, landmarks, interior, &centres, stance).least(&choices);
        (stance, least)
    });
    match tried.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) {
        Some((stance, least)) => Embedding { stance, hubs: least.hubs, ..best },
        None => best,
    }
}

/// The longest way between two ends of the template, or the length of its only chain.
fn longest_way(template: &Template) -> f64 {
    // From the first hub to each hub.
    let mut to_hub: Vec<Vec<(usize, f64)>> = vec![vec![(0, 0.0)]];
    for hub in template.hubs.iter().skip(1) {
        let Some((before, chain)) = &hub.before else { continue };
        let mut way = to_hub[*before].clone();
        let length = way.last().map_or(0.0, |last| last.1) + chain.length;
        way.push((to_hub.len(), length));
        to_hub.push(way);
    }
    let end = |limb: &super::template::Limb| {
        let way = &to_hub[limb.hub];
        (way, way.last().map_or(0.0, |last| last.1) + limb.chain.length)
    };
    let mut longest: f64 = template.limbs.iter().map(|limb| end(limb).1).fold(0.0, f64::max);
    for a in &template.limbs {
        for b in template.limbs.iter().filter(|b| b.chain.joints != a.chain.joints) {
            let ((way_a, length_a), (way_b, length_b)) = (end(a), end(b));
            let common = way_a.iter().zip(way_b).take_while(|(a, b)| a.0 == b.0).last().map_or(0.0, |(a, _)| a.1);
            longest = longest.max(length_a + length_b - 2.0 * common);
        }
    }
    longest
}
