//! Which neighbours have to be lower and higher (thesis eq. 5.14 and the end of 5.3.3), and values that are.

use super::error::MonotoneError;
use super::prescribed::Role;
use crate::extrema::{MonotoneOrder, Neighbours};

/// A rise along every edge together with those before and after it on any path, as a fraction of the function's range:
/// far above rounding, and too little to show in a certificate.
const STRICTNESS: f64 = 1e-11;

/// The margin is at least this many times the spacing of numbers at the largest value.
const ROUNDING: f64 = 16.0;

/// Bounds leave this much more than the margin, so that rounding in a sweep cannot pass them.
const ROOM: f64 = 1.001;

/// A vertex that is left out of the order.
const OUT: u32 = u32::MAX;

/// A fixed vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Given {
    pub(crate) value: f64,
    pub(crate) role: Role,
}

/// The edges along which a function has to rise, each from its lower to its higher vertex.
#[derive(Clone, Debug)]
pub(crate) struct DirectedEdges {
    pub(crate) edges: Vec<[u32; 2]>,
    /// How much it has to rise along each.
    pub(crate) margin: f64,
    /// Edges by higher vertex, in the order in which values are settled from below; by lower vertex, from above.
    upwards: Vec<[u32; 2]>,
    downwards: Vec<[u32; 2]>,
    /// Least and greatest possible value of each vertex.
    lower: Vec<f64>,
    upper: Vec<f64>,
    fixed: Vec<bool>,
}

impl DirectedEdges {
    /// For an order of the vertices, and what is given at some of them. `margin` is chosen if it is not given.
    pub(crate) fn new(
        neighbours: &Neighbours,
        order: &MonotoneOrder,
        given: &[Option<Given>],
        margin: Option<f64>,
    ) -> Result<Self, MonotoneError> {
        let ranks = &order.ranks;
        let mut edges = Vec::new();
        let mut put = |a: usize, b: usize| {
            edges.push(if ranks[a] < ranks[b] { [a as u32, b as u32] } else { [b as u32, a as u32] });
        };
        for vertex in (0..ranks.len()).filter(|&vertex| ranks[vertex] != OUT) {
            let extreme = given[vertex].filter(|given| given.role != Role::Between);
            let Some(extreme) = extreme else {
                let around = neighbours.of(vertex);
                let ends = around.clone().min_by_key(|&v| ranks[v]).zip(around.max_by_key(|&v| ranks[v]));
                if let Some((low, high)) = ends {
                    put(low, vertex);
                    put(vertex, high);
                }
                continue;
            };
            let of_one_set = |other: usize| given[other] == Some(extreme);
            neighbours.of(vertex).filter(|&other| !of_one_set(other)).for_each(|other| put(vertex, other));
        }
        // An extreme vertex is lower, or higher, than a fixed neighbour whatever the order says.
        for edge in &mut edges {
            let role = |v: u32| given[v as usize].map(|given| given.role);
            if role(edge[0]) == Some(Role::Maximum) || role(edge[1]) == Some(Role::Minimum) {
                edge.swap(0, 1);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let settled = |edges: &[[u32; 2]], at: usize, backwards: bool| {
            let mut sorted = edges.to_vec();
            sorted.sort_by_key(
                |edge| if backwards { u32::MAX - ranks[edge[at] as usize] } else { ranks[edge[at] as usize] },
            );
            sorted
        };
        let (upwards, downwards) = (settled(&edges, 1, false), settled(&edges, 0, true));
        let mut longest = vec![0_u32; ranks.len()];
        for &[low, high] in &upwards {
            longest[high as usize] = longest[high as usize].max(longest[low as usize] + 1);
        }
        let values = || given.iter().zip(ranks).filter(|(_, rank)| **rank != OUT).filter_map(|(given, _)| *given);
        let range = values().map(|g| g.value).fold(f64::NEG_INFINITY, f64::max)
            - values().map(|g| g.value).fold(f64::INFINITY, f64::min);
        let length = longest.into_iter().max().unwrap_or_default().max(1);
        let largest = values().map(|g| g.value.abs()).fold(0.0, f64::max);
        let chosen = (STRICTNESS * range.max(0.0) / f64::from(length)).max(ROUNDING * f64::EPSILON * largest);
        let fixed = given.iter().map(Option::is_some).collect();
        let (lower, upper, margin) = (Vec::new(), Vec::new(), margin.unwrap_or(chosen));
        let mut made = Self { edges, margin, upwards, downwards, lower, upper, fixed };
        (made.lower, made.upper) = made.bounds(given)?;
        Ok(made)
    }

    /// The bounds that fixed values put on all others.
    fn bounds(&self, given: &[Option<Given>]) -> Result<(Vec<f64>, Vec<f64>), MonotoneError> {
        let value = |vertex: usize| given[vertex].map(|given| given.value);
        let mut lower: Vec<f64> = (0..given.len()).map(|v| value(v).unwrap_or(f64::NEG_INFINITY)).collect();
        let mut upper: Vec<f64> = (0..given.len()).map(|v| value(v).unwrap_or(f64::INFINITY)).collect();
        let mut from: Vec<usize> = (0..given.len()).collect();
        for [low, high] in self.upwards.iter().map(|edge| edge.map(|v| v as usize)) {
            let least = lower[low] + ROOM * self.margin;
            if let Some(upper_value) = value(high) {
                if least > upper_value {
                    let below = from[low];
                    let lower_value = value(below).unwrap_or(least);
                    return Err(MonotoneError::Contradiction { below, lower_value, above: high, upper_value });
                }
            } else if least > lower[high] {
                (lower[high], from[high]) = (least, from[low]);
            }
        }
        for [low, high] in self.downwards.iter().map(|edge| edge.map(|v| v as usize)) {
            if value(low).is_none() {
                upper[low] = upper[low].min(upper[high] - ROOM * self.margin);
            }
        }
        Ok((lower, upper))
    }

    /// Moves values as little as a sweep can so that they rise along every edge by the margin; fixed ones stay. The mean of
    /// a sweep that only raises and one that only lowers, settled once more against rounding.
    pub(crate) fn repair(&self, values: &[f64]) -> Vec<f64> {
        let mut raised: Vec<f64> = values.iter().zip(&self.upper).map(|(v, upper)| v.min(*upper)).collect();
        self.raise(&mut raised);
        let mut lowered: Vec<f64> = values.iter().zip(&self.lower).map(|(v, lower)| v.max(*lower)).collect();
        for [low, high] in self.downwards.iter().map(|edge| edge.map(|v| v as usize)) {
            if !self.fixed[low] {
                lowered[low] = lowered[low].min(lowered[high] - self.margin);
            }
        }
        let mut mean: Vec<f64> = raised.iter().zip(&lowered).map(|(a, b)| 0.5 * (a + b)).collect();
        let bounds = self.lower.iter().zip(&self.upper);
        mean.iter_mut().zip(bounds).for_each(|(v, (lower, upper))| *v = v.max(*lower).min(*upper));
        self.raise(&mut mean);
        mean
    }

    fn raise(&self, values: &mut [f64]) {
        for [low, high] in self.upwards.iter().map(|edge| edge.map(|v| v as usize)) {
            if !self.fixed[high] {
                values[high] = values[high].max(values[low] + self.margin);
            }
        }
    }

    /// The smallest rise along an edge, less the margin: not negative if all inequalities hold.
    pub(crate) fn slack(&self, values: &[f64]) -> f64 {
        let rise = |[low, high]: [u32; 2]| values[high as usize] - (values[low as usize] + self.margin);
        self.edges.iter().map(|&edge| rise(edge)).fold(f64::INFINITY, f64::min)
    }
}
