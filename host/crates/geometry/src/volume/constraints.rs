//! The facets that should be facets of the tetrahedra, and the smaller ones they are split into.

use std::collections::HashMap;

const NONE: u32 = u32::MAX;

/// The state of a facet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Not yet a facet of a tetrahedron, or not checked.
    Missing,
    /// Present, and locked.
    Locked,
    /// Split into smaller ones.
    Split,
    /// Given up.
    GivenUp,
}

/// A surface that is split more finely where the tetrahedra require it. Two triangles that share an edge also share its
/// parts.
#[derive(Debug)]
pub(super) struct Constraints {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) state: Vec<State>,
    /// Which of the original triangles each belongs to.
    pub(super) parent: Vec<u32>,
    /// How often each was cut.
    pub(super) depth: Vec<u8>,
    /// A corner, `3·triangle + k`, whose edge to the next corner this is.
    first_at: HashMap<[u32; 2], u32>,
    next_at: Vec<u32>,
}

impl Constraints {
    pub(super) fn new(triangles: impl Iterator<Item = [u32; 3]>) -> Self {
        let mut all = Self {
            triangles: Vec::new(),
            state: Vec::new(),
            parent: Vec::new(),
            depth: Vec::new(),
            first_at: HashMap::new(),
            next_at: Vec::new(),
        };
        for (index, triangle) in triangles.enumerate() {
            all.add(triangle, index as u32, 0);
        }
        all
    }

    fn add(&mut self, triangle: [u32; 3], parent: u32, depth: u8) -> u32 {
        let index = self.triangles.len() as u32;
        self.triangles.push(triangle);
        self.state.push(State::Missing);
        self.parent.push(parent);
        self.depth.push(depth);
        for k in 0..3 {
            let corner = 3 * index + k as u32;
            let before = self.first_at.insert(key(triangle[k], triangle[(k + 1) % 3]), corner);
            self.next_at.push(before.unwrap_or(NONE));
        }
        index
    }

    /// The triangles that share an edge and are neither split nor given up.
    pub(super) fn around(&self, a: u32, b: u32) -> Vec<u32> {
        let mut found = Vec::new();
        let mut corner = self.first_at.get(&key(a, b)).copied().unwrap_or(NONE);
        while corner != NONE {
            let triangle = corner / 3;
            if matches!(self.state[triangle as usize], State::Missing | State::Locked) {
                found.push(triangle);
            }
            corner = self.next_at[corner as usize];
        }
        found
    }

    /// Whether some triangle still needs this edge.
    pub(super) fn needs_edge(&self, a: u32, b: u32) -> bool {
        !self.around(a, b).is_empty()
    }

    /// The triangle on these three vertices, if it is neither split nor given up.
    pub(super) fn find(&self, [a, b, c]: [u32; 3]) -> Option<u32> {
        self.around(a, b).into_iter().find(|&t| self.triangles[t as usize].contains(&c))
    }

    /// Cuts every triangle on an edge in two at `vertex`; the new ones are appended to `open`.
    pub(super) fn split_edge(&mut self, [a, b]: [u32; 2], vertex: u32, open: &mut Vec<u32>) {
        for triangle in self.around(a, b) {
            let corners = self.triangles[triangle as usize];
            self.state[triangle as usize] = State::Split;
            if corners.contains(&vertex) {
                continue;
            }
            for end in [a, b] {
                let part = corners.map(|v| if v == end { vertex } else { v });
                open.push(self.add(part, self.parent[triangle as usize], self.depth[triangle as usize] + 1));
            }
        }
    }

    /// Cuts a triangle in three at `vertex`; the new ones are appended to `open`.
    pub(super) fn split_triangle(&mut self, triangle: u32, vertex: u32, open: &mut Vec<u32>) {
        let corners = self.triangles[triangle as usize];
        self.state[triangle as usize] = State::Split;
        for k in 0..3 {
            let mut part = corners;
            part[k] = vertex;
            open.push(self.add(part, self.parent[triangle as usize], self.depth[triangle as usize] + 1));
        }
    }
}

fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
