//! What an embedding of a template costs: penalties for lengths, directions, asymmetry and limbs that are missing or
//! merged (as in Baran and Popović 2007, section 3.4), and their least sum for given ends.
//!
//! With the ends of limbs given, what remains is a sum over the edges of the tree of hubs, whose minimum is found exactly
//! from the leaves to the first hub. With some ends open, the same pass gives a bound from below.

use glam::{DMat3, DVec3};

use super::interior::Interior;
use super::landmarks::{End, Landmarks};
use super::template::{Chain, Limb, Template};

/// Penalties, in units of a length that is wrong by a factor of e.
const DIRECTION: f64 = 0.6;
const LAST_DIRECTION: f64 = 0.35;
const MIDDLE: f64 = 0.8;
const MIRROR: f64 = 0.4;
const SIDE: f64 = 0.6;
/// Relative to [`SIDE`], for limbs that are no mirror images.
const NEIGHBOUR: f64 = 0.3;
const OVERLAP: f64 = 0.3;
/// For a limb of the mesh as long as its longest way, if it counted whole ...
const UNUSED: f64 = 0.6;
/// ... but no more of it than this counts.
const LONG_LIMB: f64 = 0.2;
/// For each foot.
const OFF_GROUND: f64 = 0.4;
/// For each hub.
const SHALLOW: f64 = 0.6;

/// Distances, as shares of the diameter, from which on something is as wrong as it can be.
const FAR_FROM_MIDDLE: f64 = 0.06;
const FAR_FROM_MIRROR: f64 = 0.15;
const FAR_FROM_GROUND: f64 = 0.15;
/// The same, as a share of the limb.
const FAR_OVERLAP: f64 = 0.12;
/// Hubs are in the deepest places within this distance, as a share of the diameter.
const AROUND_HUB: f64 = 0.1;

/// How a template stands in the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    /// `mesh_from_template`, without scale.
    pub(super) turn: DMat3,
    /// Mesh units per unit of the template.
    pub(super) scale: f64,
    /// How symmetric the mesh is to the plane between left and right, 0 to 1.
    pub(super) symmetry: f64,
}

/// What the ends of limbs are assigned to: not yet, to none, or to an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Choice {
    Open,
    Absent,
    End(usize),
}

/// All costs of one stance.
pub(super) struct Costs<'a> {
    template: &'a Template,
    landmarks: &'a Landmarks,
    interior: &'a Interior,
    stance: Stance,
    middle: DVec3,
    /// Where hubs can be: inner points.
    centres: &'a [usize],
    /// For each limb, `[centre][end]`.
    limbs: Vec<Vec<f64>>,
    /// For each hub after the first, `[centre of the hub before][centre]`.
    hubs: Vec<Vec<f64>>,
    /// For each hub, of each centre.
    alone: Vec<Vec<f64>>,
}

/// A least sum and the centre of each hub.
pub(super) struct Least {
    pub(super) cost: f64,
    /// Indices of inner points.
    pub(super) hubs: Vec<usize>,
}

impl<'a> Costs<'a> {
    pub(super) fn new(
        template: &'a Template,
        landmarks: &'a Landmarks,
        interior: &'a Interior,
        centres: &'a [usize],
        stance: Stance,
    ) -> Self {
        let middle = interior.centroid();
        let mut costs = Self {
            template,
            landmarks,
            interior,
            stance,
            middle,
            centres,
            limbs: Vec::new(),
            hubs: Vec::new(),
            alone: Vec::new(),
        };
        costs.limbs = (0..template.limbs.len()).map(|limb| costs.of_limb(limb)).collect();
        costs.hubs = template.hubs.iter().map(|hub| costs.of_chain(hub.before.as_ref().map(|b| &b.1))).collect();
        let is_middle = |joint: usize| template.joints[joint].mirror == Some(joint);
        let shallow: &Vec<f64> = &centres.iter().map(|&centre| costs.shallow(centre)).collect();
        costs.alone = template
            .hubs
            .iter()
            .map(|hub| {
                let off = |&c: &usize| costs.off_middle(interior.points[c], is_middle(hub.joint));
                centres.iter().zip(shallow).map(|(c, shallow)| off(c) + shallow).collect()
            })
            .collect();
        costs
    }

    fn off_middle(&self, at: DVec3, is_middle: bool) -> f64 {
        let off = (at - self.middle).dot(self.stance.turn.x_axis) / (FAR_FROM_MIDDLE * self.landmarks.diameter);
        if is_middle { MIDDLE * self.stance.symmetry * (off * off).min(1.0) } else { 0.0 }
    }

    /// Hubs are in the middle of a body, not of a limb beside it.
    fn shallow(&self, centre: usize) -> f64 {
        let at = self.interior.points[centre];
        let near = |&&other: &&usize| self.interior.points[other].distance(at) <= AROUND_HUB * self.landmarks.diameter;
        let depths = self.landmarks.centres.iter().filter(near).map(|&other| self.interior.depth[other]);
        let lack = 1.0 - self.interior.depth[centre] / depths.fold(self.interior.depth[centre], f64::max);
        SHALLOW * lack * lack
    }

    /// A figure stands on its feet; one of them may be lifted.
    fn off_ground(&self, at: DVec3) -> f64 {
        let up = self.stance.turn.y_axis;
        let low = self.landmarks.ends.iter().map(|end| end.at.dot(up)).fold(f64::INFINITY, f64::min);
        let height = (at.dot(up) - low) / (FAR_FROM_GROUND * self.landmarks.diameter);
        OFF_GROUND * (height * height).min(1.0)
    }

    fn length(&self, length: f64, chain: &Chain) -> f64 {
        // Two joints of a puppet may be in one place.
        let wanted = (self.stance.scale * chain.length).max(0.02 * self.landmarks.diameter);
        let ratio = (length.max(0.02 * self.landmarks.diameter) / wanted).ln();
        (ratio * ratio).min(1.0)
    }

    fn off_direction(&self, way: DVec3, wanted: DVec3) -> f64 {
        let (way, wanted) = (way.normalize_or_zero(), self.stance.turn * wanted.normalize_or_zero());
        if way == DVec3::ZERO || wanted == DVec3::ZERO { 0.0 } else { 0.5 * (1.0 - way.dot(wanted)) }
    }

    fn of_limb(&self, limb: usize) -> Vec<f64> {
        let limb = &self.template.limbs[limb];
        let end_joint = limb.chain.joints.last().copied().unwrap_or_default();
        let is_middle = self.template.joints[end_joint].mirror == Some(end_joint);
        let of_end: Vec<f64> = self
            .landmarks
            .ends
            .iter()
            .map(|end| {
                let last = LAST_DIRECTION * limb.manner.aim * self.off_direction(end.way, limb.chain.last);
                let ground = if limb.is_foot { self.off_ground(end.at) } else { 0.0 };
                last + ground + self.off_middle(end.at, is_middle) - worth(self.landmarks, end)
            })
            .collect();
        let mut costs = Vec::with_capacity(self.centres.len() * of_end.len());
        for &centre in self.centres {
            let from = self.interior.points[centre];
            for (end, own) in self.landmarks.ends.iter().zip(&of_end) {
                let aim = DIRECTION * limb.manner.aim * self.off_direction(end.at - from, limb.chain.way);
                let length = limb.manner.length * self.length(end.ways.length[centre], &limb.chain);
                costs.push(own + aim + length);
            }
        }
        costs
    }

    fn of_chain(&self, chain: Option<&Chain>) -> Vec<f64> {
        let Some(chain) = chain else { return Vec::new() };
        let mut costs = Vec::with_capacity(self.centres.len() * self.centres.len());
        for &from in self.centres {
            for &to in self.centres {
                let way = self.interior.points[to] - self.interior.points[from];
                // The ways of the ends bound the way between two centres from below, and the straight line does.
                let between = |end: &End| (end.ways.length[from] - end.ways.length[to]).abs();
                let bound = self.landmarks.ends.iter().map(between).fold(way.length(), f64::max);
                costs.push(self.length(bound, chain) + DIRECTION * self.off_direction(way, chain.way));
            }
        }
        costs
    }

    /// What two ends cost together, wherever their hub is.
    pub(super) fn pair(&self, [a, b]: [usize; 2], [end_a, end_b]: [usize; 2]) -> f64 {
        let (limb_a, limb_b) = (&self.template.limbs[a], &self.template.limbs[b]);
        if limb_a.hub != limb_b.hub {
            return 0.0;
        }
        let tip = |limb: &Limb| limb.chain.joints.last().map_or(DVec3::ZERO, |&joint| self.template.joints[joint].at);
        let (at_a, at_b) = (self.landmarks.ends[end_a].at, self.landmarks.ends[end_b].at);
        let side = SIDE * self.off_direction(at_a - at_b, tip(limb_a) - tip(limb_b));
        if limb_a.mirror != Some(b) {
            return NEIGHBOUR * side * limb_a.manner.aim.min(limb_b.manner.aim);
        }
        let normal = self.stance.turn.x_axis;
        let image = at_a - 2.0 * (at_a - self.middle).dot(normal) * normal;
        let away = image.distance(at_b) / (FAR_FROM_MIRROR * self.landmarks.diameter);
        side + MIRROR * self.stance.symmetry * (away * away).min(1.0)
    }

    /// Two limbs leave each other within about a radius of the middle of their hub: where legs part, not in one of them.
    fn overlap(&self, [a, b]: [usize; 2], [end_a, end_b]: [usize; 2], centre: usize) -> f64 {
        let chains = [a, b].map(|limb| self.stance.scale * self.template.limbs[limb].chain.length);
        let (a, b) = (&self.landmarks.ends[end_a], &self.landmarks.ends[end_b]);
        let common = 0.5 * (a.ways.length[centre] + b.ways.length[centre] - a.ways.length[b.point]);
        let depth = self.interior.depth[centre];
        let off = (common - common.clamp(0.3 * depth, 1.2 * depth)) / (FAR_OVERLAP * chains[0].min(chains[1]));
        OVERLAP * (off * off).min(1.0)
    }

    /// The least cost with these choices, apart from [`Self::pair`]; open limbs may take any end that is not taken.
    pub(super) fn least(&self, choices: &[Choice]) -> Least {
        let (ends, count) = (self.landmarks.ends.len(), self.centres.len());
        let is_taken = |end: usize| choices.contains(&Choice::End(end));
        let free: Vec<usize> = (0..ends).filter(|&end| !is_taken(end)).collect();
        let mut below: Vec<Vec<f64>> = self.alone.clone();
        for (limb, choice) in choices.iter().enumerate() {
            let (costs, absence) = (&self.limbs[limb], self.template.limbs[limb].manner.absence);
            let sums = &mut below[self.template.limbs[limb].hub];
            for (centre, sum) in sums.iter_mut().enumerate() {
                let of = |end: usize| costs[centre * ends + end];
                *sum += match *choice {
                    Choice::Absent => absence,
                    Choice::End(end) => of(end),
                    Choice::Open => free.iter().map(|&end| of(end)).fold(absence, f64::min),
                };
            }
        }
        for (a, b) in self.template.limbs.iter().enumerate().filter_map(|(a, limb)| Some((a, limb.mirror?))) {
            if let (Choice::End(end_a), Choice::End(end_b)) = (choices[a], choices[b])
                && a < b
            {
                for (sum, &centre) in below[self.template.limbs[a].hub].iter_mut().zip(self.centres) {
                    *sum += self.overlap([a, b], [end_a, end_b], centre);
                }
            }
        }
        let mut best_of: Vec<Vec<usize>> = vec![Vec::new(); below.len()];
        for hub in (1..below.len()).rev() {
            let Some((before, _)) = self.template.hubs[hub].before else { continue };
            let own = std::mem::take(&mut below[hub]);
            for from in 0..count {
                let row = &self.hubs[hub][from * count..(from + 1) * count];
                let sums = row.iter().zip(&own).map(|(edge, own)| edge + own);
                let (best, cost) = least_of(sums);
                below[before][from] += cost;
                best_of[hub].push(best);
            }
        }
        let (first, cost) = least_of(below[0].iter().copied());
        let mut chosen = vec![first; below.len()];
        for hub in 1..below.len() {
            if let Some((before, _)) = self.template.hubs[hub].before {
                chosen[hub] = best_of[hub][chosen[before]];
            }
        }
        Least { cost, hubs: chosen.into_iter().map(|centre| self.centres[centre]).collect() }
    }
}

/// What an end without bones costs; all costs are relative to those of a mesh in which all have none.
pub(super) fn worth(landmarks: &Landmarks, end: &End) -> f64 {
    // How long the longest limb is says little: it has the whole way from the middle.
    UNUSED * (end.persistence / landmarks.diameter).min(LONG_LIMB)
}

fn least_of(values: impl Iterator<Item = f64>) -> (usize, f64) {
    values.enumerate().fold((0, f64::INFINITY), |best, (at, value)| if value < best.1 { (at, value) } else { best })
}
