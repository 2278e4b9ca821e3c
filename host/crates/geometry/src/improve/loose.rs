//! A boundary that may give way: how far each of its vertices may, and which tetrahedra are at it.

use std::collections::HashMap;

use super::facets::NONE;

/// How far vertices of the boundary may give way, where a boundary that has to stay leaves slivers. One number for each
/// vertex, in the mesh's unit; those of interior vertices do not matter.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryGive<'a> {
    /// How far the boundary may recede around the vertex.
    pub recede: &'a [f64],
    /// How far it may bulge: less than the space to whatever else is there.
    pub bulge: &'a [f64],
}

/// What is left of [`BoundaryGive`], and what is needed to change a boundary.
pub(super) struct Loose {
    recede: Vec<f64>,
    bulge: Vec<f64>,
    /// Vertices of the boundary that may move or vanish.
    may_give: Vec<bool>,
    /// For each vertex, tetrahedra that have or had it as a corner.
    at: Vec<Vec<u32>>,
    /// Vertices that vanished, each with one that is in its place, in the order in which it happened.
    into: Vec<[u32; 2]>,
}

impl Loose {
    /// `scale` converts lengths; `may_give`: vertices of the boundary that are not fixed.
    pub(super) fn new(give: &BoundaryGive<'_>, may_give: Vec<bool>, scale: impl Fn(f64) -> f64) -> Self {
        let scaled = |of: &[f64]| of.iter().map(|&far| scale(far.max(0.0))).collect::<Vec<f64>>();
        let at = vec![Vec::new(); may_give.len()];
        Self { recede: scaled(give.recede), bulge: scaled(give.bulge), may_give, at, into: Vec::new() }
    }

    pub(super) fn enter(&mut self, tetrahedron: u32, corners: [u32; 4]) {
        corners.iter().filter(|&&v| v != NONE).for_each(|&v| self.at[v as usize].push(tetrahedron));
    }

    pub(super) fn listed(&self, vertex: u32) -> &[u32] {
        &self.at[vertex as usize]
    }

    pub(super) fn push_vertex(&mut self) {
        self.recede.push(0.0);
        self.bulge.push(0.0);
        self.may_give.push(false);
        self.at.push(Vec::new());
    }

    pub(super) fn pop_vertex(&mut self) {
        self.recede.pop();
        self.bulge.pop();
        self.may_give.pop();
        self.at.pop();
    }

    pub(super) fn may_give(&self, vertex: u32) -> bool {
        self.may_give[vertex as usize]
    }

    pub(super) fn recede(&self, vertex: u32) -> f64 {
        self.recede[vertex as usize]
    }

    pub(super) fn bulge(&self, vertex: u32) -> f64 {
        self.bulge[vertex as usize]
    }

    pub(super) fn set(&mut self, vertex: u32, recede: f64, bulge: f64) {
        self.recede[vertex as usize] = recede.max(0.0);
        self.bulge[vertex as usize] = bulge.max(0.0);
    }

    /// Vertices of the boundary keep the least of what they have; new ones may give from now on.
    pub(super) fn expose(&mut self, vertex: u32, is_new: bool, recede: f64) {
        if is_new {
            self.may_give[vertex as usize] = true;
            self.set(vertex, recede, 0.0);
        } else {
            self.set(vertex, recede.min(self.recede(vertex)), self.bulge(vertex));
        }
    }

    pub(super) fn merge(&mut self, vertex: u32, end: u32, recede: f64, bulge: f64) {
        self.into.push([vertex, end]);
        self.set(end, recede.min(self.recede(end)), bulge.min(self.bulge(end)));
    }

    /// Vertices that vanished, each with one that is still there.
    pub(super) fn merged(&self) -> Vec<[u32; 2]> {
        let mut place_of: HashMap<u32, u32> = HashMap::new();
        let mut merged: Vec<[u32; 2]> = self
            .into
            .iter()
            .rev()
            .map(|&[vertex, end]| {
                // What came later is known already.
                let place = place_of.get(&end).copied().unwrap_or(end);
                place_of.insert(vertex, place);
                [vertex, place]
            })
            .collect();
        merged.reverse();
        merged
    }
}
