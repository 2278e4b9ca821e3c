//! Weights of all handles that sum to one exactly and have extrema only where vertices are fixed: a point that meets all
//! conditions of the partition of unity, and the order in which each handle's weights rise.
//!
//! Harmonic weights sum to one and have no other extrema, but in long appendages all are equal to the last digit, and
//! rounding decides what is higher. So they are counted in quanta here, and vertices between which some handle's weights
//! neither rise nor fall by one are put together into a class until none is left that would be an extremum.

use armature_geometry::operators::SparseMatrix;

use super::error::MonotoneError;
use super::problem::MonotoneProblem;
use crate::extrema::Neighbours;
use crate::handles::HandleBoundary;
use crate::harmonic::{HarmonicProblem, harmonic_function, positive_conductances};

/// Quanta in one: each is 1e-12, thousands of times the rounding of harmonic weights.
const ONE: f64 = (1_u64 << 40) as f64;

/// A quantum, as a weight.
pub(super) const QUANTUM: f64 = 1.0 / ONE;

/// No class, or no row.
pub(super) const NONE: u32 = u32::MAX;

/// Weights in quanta on classes of vertices.
#[derive(Clone, Debug)]
pub(super) struct SharedLevels {
    /// Class of each vertex, or [`NONE`] in pieces without a fixed vertex.
    pub(super) class_of: Vec<u32>,
    /// The row of the fixed vertex that a class contains, or [`NONE`].
    pub(super) fixed_row: Vec<u32>,
    /// Neighbours of each class, ascending.
    pub(super) around: Vec<Vec<u32>>,
    /// m for each class, one after another.
    pub(super) levels: Vec<i64>,
    /// For each of them, the row of the fixed vertex whose plateau it is on, or [`NONE`].
    pub(super) pinned_row: Vec<u32>,
    /// Handles.
    pub(super) handles: usize,
    /// Vertices that were put together with another one.
    pub(super) flattened: usize,
    /// Vertices at conductances that were raised.
    pub(super) raised: usize,
}

/// Those of harmonic weights.
pub(super) fn harmonic_levels(
    problem: &MonotoneProblem<'_>,
    held: &HandleBoundary,
) -> Result<SharedLevels, MonotoneError> {
    let start = |laplacian: &SparseMatrix| -> Result<SharedLevels, MonotoneError> {
        let columns = held.fixed_weights.chunks(held.fixed.len()).map(|given| {
            let harmonic = HarmonicProblem { laplacian, fixed: &held.fixed, values: given, flux: &[] };
            Ok(harmonic_function(&harmonic)?.values)
        });
        let columns: Vec<Vec<f64>> = columns.collect::<Result<_, MonotoneError>>()?;
        Ok(SharedLevels::of(problem.neighbours, held, &columns))
    };
    // Obtuse elements give harmonic weights extrema of their own, or cannot be factorised.
    let is_good = |levels: &SharedLevels| !(0..levels.classes()).any(|class| levels.is_wrong(class));
    let mut levels = if let Some(levels) = start(problem.laplacian).ok().filter(is_good) {
        levels
    } else {
        let positive = positive_conductances(problem.laplacian);
        SharedLevels { raised: positive.vertices, ..start(&positive.matrix)? }
    };
    levels.put_together();
    Ok(levels)
}

impl SharedLevels {
    /// Those of any weights that sum to one: one list of n for each handle.
    pub(super) fn of_weights(neighbours: &Neighbours, held: &HandleBoundary, columns: &[Vec<f64>]) -> Self {
        let mut levels = Self::of(neighbours, held, columns);
        levels.put_together();
        levels
    }

    /// Every vertex a class of its own.
    fn of(neighbours: &Neighbours, held: &HandleBoundary, columns: &[Vec<f64>]) -> Self {
        let (n, m) = (neighbours.vertices(), columns.len());
        let mut fixed_row = vec![NONE; n];
        held.fixed.iter().enumerate().for_each(|(row, &vertex)| fixed_row[vertex] = row as u32);
        let mut class_of = vec![NONE; n];
        for piece in neighbours.pieces() {
            if piece.iter().any(|&vertex| fixed_row[vertex] != NONE) {
                piece.into_iter().for_each(|vertex| class_of[vertex] = vertex as u32);
            }
        }
        let around = (0..n).map(|vertex| neighbours.of(vertex).map(|other| other as u32).collect()).collect();
        let mut levels = vec![0; n * m];
        for (vertex, levels) in levels.chunks_mut(m.max(1)).enumerate().filter(|(v, _)| class_of[*v] != NONE) {
            levels.iter_mut().zip(columns).for_each(|(level, column)| *level = (column[vertex] * ONE).round() as i64);
            // Rounding must not change the sum; the largest bears it best.
            let missing = ONE as i64 - levels.iter().sum::<i64>();
            if let Some(largest) = levels.iter_mut().max() {
                *largest += missing;
            }
        }
        let pinned_row = vec![NONE; n * m];
        let mut made = Self { class_of, fixed_row, around, pinned_row, levels, handles: m, flattened: 0, raised: 0 };
        made.pin();
        made
    }

    pub(super) fn classes(&self) -> usize {
        self.fixed_row.len()
    }

    fn level(&self, class: usize, handle: usize) -> i64 {
        self.levels[class * self.handles + handle]
    }

    /// Marks the plateaus of fixed vertices.
    fn pin(&mut self) {
        self.pinned_row.fill(NONE);
        for handle in 0..self.handles {
            let mut open: Vec<usize> = (0..self.classes()).filter(|&class| self.fixed_row[class] != NONE).collect();
            for &class in &open {
                self.pinned_row[class * self.handles + handle] = self.fixed_row[class];
            }
            while let Some(class) = open.pop() {
                let row = self.pinned_row[class * self.handles + handle];
                for &other in &self.around[class] {
                    let other = other as usize;
                    let place = other * self.handles + handle;
                    if self.pinned_row[place] == NONE && self.levels[place] == self.level(class, handle) {
                        self.pinned_row[place] = row;
                        open.push(other);
                    }
                }
            }
        }
    }

    /// Whether some handle's weights have an extremum in a class, or a flat place that may become one. Before classes are
    /// renumbered.
    fn is_wrong(&self, class: usize) -> bool {
        self.class_of[class] != NONE
            && self.fixed_row[class] == NONE
            && (0..self.handles).any(|handle| {
                let own = self.level(class, handle);
                let any = |is: fn(&i64, &i64) -> bool| {
                    self.around[class].iter().any(|&other| is(&self.level(other as usize, handle), &own))
                };
                self.pinned_row[class * self.handles + handle] == NONE && !(any(i64::lt) && any(i64::gt))
            })
    }

    /// Joins wrong classes with the neighbours whose weights are nearest to theirs until there are none, and numbers
    /// classes without gaps.
    fn put_together(&mut self) {
        let mut joined: Vec<u32> = (0..self.classes() as u32).collect();
        loop {
            self.pin();
            let mut any = false;
            for class in 0..self.classes() {
                if joined[class] as usize != class || !self.is_wrong(class) {
                    continue;
                }
                let apart = |other: usize| {
                    (0..self.handles).map(|j| (self.level(class, j) - self.level(other, j)).abs()).max().unwrap_or(0)
                };
                let Some(&nearest) = self.around[class].iter().min_by_key(|&&other| (apart(other as usize), other))
                else {
                    continue;
                };
                joined[class] = nearest;
                any = true;
                self.flattened += 1;
                let others = std::mem::take(&mut self.around[class]);
                for &other in &others {
                    let list = &mut self.around[other as usize];
                    list.retain(|&one| one as usize != class);
                    if other != nearest && !list.contains(&nearest) {
                        list.push(nearest);
                    }
                }
                let list = &mut self.around[nearest as usize];
                list.extend(others.into_iter().filter(|&other| other != nearest));
                list.sort_unstable();
                list.dedup();
            }
            if !any {
                break;
            }
        }
        self.renumber(&joined);
    }

    fn renumber(&mut self, joined: &[u32]) {
        let root = |mut class: u32| {
            while joined[class as usize] != class {
                class = joined[class as usize];
            }
            class
        };
        let stays = |class: usize| joined[class] as usize == class && self.class_of[class] != NONE;
        let kept: Vec<usize> = (0..joined.len()).filter(|&class| stays(class)).collect();
        let mut number = vec![NONE; joined.len()];
        kept.iter().enumerate().for_each(|(k, &class)| number[class] = k as u32);
        let class_of = |class: u32| if class == NONE { NONE } else { number[root(class) as usize] };
        self.class_of = self.class_of.iter().map(|&class| class_of(class)).collect();
        let of_class = |&class: &usize| {
            let mut around: Vec<u32> = self.around[class].iter().map(|&other| class_of(other)).collect();
            around.sort_unstable();
            around.dedup();
            around
        };
        let m = self.handles;
        let rows = |all: &[i64]| kept.iter().flat_map(|&class| all[class * m..(class + 1) * m].to_vec()).collect();
        let around = kept.iter().map(of_class).collect();
        self.levels = rows(&self.levels);
        self.fixed_row = kept.iter().map(|&class| self.fixed_row[class]).collect();
        self.around = around;
        self.pinned_row = vec![NONE; kept.len() * m];
        self.pin();
    }

    /// Pairs of classes, lower and higher, between which a handle's weights have to rise: from each class's lowest
    /// neighbour to it and from it to its highest, except on plateaus of fixed vertices.
    pub(super) fn rising(&self, handle: usize) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for class in (0..self.classes()).filter(|&class| self.pinned_row[class * self.handles + handle] == NONE) {
            let key = |&&other: &&u32| self.level(other as usize, handle);
            let around = &self.around[class];
            let (low, high) = (around.iter().min_by_key(key), around.iter().max_by_key(key));
            pairs.extend(low.map(|&low| [low, class as u32]).into_iter().chain(high.map(|&high| [class as u32, high])));
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_flat_or_an_extremum_is_put_together_and_sums_stay() {
        // A path between two fixed vertices, with a dead end at its middle where weights are flat.
        let edges = [[0, 1], [1, 2], [2, 3], [2, 4], [4, 5]];
        let path = Neighbours::of_elements(6, &edges).unwrap();
        let held = HandleBoundary { fixed: vec![0, 3], fixed_weights: vec![1.0, 0.0, 0.0, 1.0], handles: 2 };
        let columns = [vec![1.0, 0.7, 0.4, 0.0, 0.4, 0.4 + 1e-16], vec![0.0, 0.3, 0.6, 1.0, 0.6, 0.6 - 1e-16]];
        let levels = SharedLevels::of_weights(&path, &held, &columns);
        assert_eq!((levels.class_of.as_slice(), levels.flattened), (&[0, 1, 2, 3, 2, 2][..], 2));
        assert_eq!(levels.rising(0), [[1, 0], [2, 1], [3, 2]]);
        assert_eq!(levels.rising(1), [[0, 1], [1, 2], [2, 3]]);
        for class in levels.levels.chunks(2) {
            assert_eq!(class.iter().sum::<i64>(), ONE as i64);
        }
        assert_eq!(levels.pinned_row, [0, 0, NONE, NONE, NONE, NONE, 1, 1]);
    }
}
