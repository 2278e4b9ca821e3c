//! `L D Lᵀ` of a sparse symmetric matrix whose unknowns come in small groups: four for a handle, one for an equation.
//!
//! The matrix is positive definite for some groups and negative definite for the others, multipliers of equations; such
//! factors exist in any order (Vanderbei 1995). A multiplier waits until a group that its equation concerns has been
//! eliminated, and is of ordinary size then. Otherwise the group with the fewest neighbours goes first: handles are
//! connected like the tree of their bones, of which that keeps nearly all zeros.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use std::collections::BTreeSet;

use super::blocks::BlockRows;

/// No place: not an unknown.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Which unknowns a group has, and whether it is a multiplier.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub(super) open: [bool; 4],
    pub(super) is_multiplier: bool,
}

/// A factor, ready to solve.
#[derive(Clone, Debug, Default)]
pub(super) struct BlockFactor {
    /// Place of each of the four unknowns of a group, in the order of elimination.
    places: Vec<[u32; 4]>,
    columns: Vec<Columns>,
    /// Below the blocks of the columns: places, ascending within each, and what each of the up to four columns has there.
    rows: Vec<u32>,
    panels: Vec<[f64; 4]>,
    size: usize,
}

/// The columns of a group.
#[derive(Clone, Debug)]
struct Columns {
    first: usize,
    width: usize,
    /// Strictly lower triangle of the block on the diagonal.
    lower: [[f64; 4]; 4],
    pivots: [f64; 4],
    /// Its part of the rows and panels.
    start: usize,
    end: usize,
}

impl BlockFactor {
    /// Factors a matrix of groups (each row of it complete, not only one triangle).
    pub(super) fn new(matrix: &BlockRows<4>, groups: &[Group]) -> Self {
        let order = Order::new(matrix, groups);
        let mut factor = Self { places: vec![[NOWHERE; 4]; groups.len()], ..Self::default() };
        for &group in &order.groups {
            for (place, _) in
                factor.places[group as usize].iter_mut().zip(groups[group as usize].open).filter(|(_, o)| *o)
            {
                *place = factor.size as u32;
                factor.size += 1;
            }
        }
        let mut owner = vec![0_u32; factor.size];
        for (number, (&group, below)) in order.groups.iter().zip(&order.below).enumerate() {
            factor.begin_columns(matrix, group, below);
            let Columns { first, width, .. } = factor.columns[number];
            owner[first..first + width].fill(number as u32);
        }
        for number in 0..factor.columns.len() {
            factor.eliminate(number, &owner);
        }
        factor
    }

    /// Number of unknowns.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// Where a group's four unknowns are; [`NOWHERE`] for one that is none.
    pub(super) fn places(&self, group: usize) -> [u32; 4] {
        self.places[group]
    }

    /// Stored entries below the diagonal: what an application of the factor costs.
    pub(super) fn stored(&self) -> usize {
        self.columns.iter().map(|c| c.width * (c.end - c.start) + c.width * (c.width - 1) / 2).sum()
    }

    /// The pivot of an unknown: what resists it once all before it have been eliminated.
    pub(super) fn pivot(&self, place: u32) -> f64 {
        let number = self.columns.partition_point(|columns| columns.first + columns.width <= place as usize);
        self.columns.get(number).map_or(0.0, |columns| columns.pivots[place as usize - columns.first])
    }

    fn begin_columns(&mut self, matrix: &BlockRows<4>, group: u32, below: &[u32]) {
        let own: Vec<(usize, u32)> =
            self.places[group as usize].into_iter().enumerate().filter(|(_, place)| *place != NOWHERE).collect();
        let start = self.rows.len();
        let places = below.iter().flat_map(|group| self.places[*group as usize]).filter(|place| *place != NOWHERE);
        let mut rows: Vec<u32> = places.collect();
        rows.sort_unstable();
        let mut panel = vec![[0.0; 4]; rows.len()];
        let mut lower = [[0.0; 4]; 4];
        for (other, block) in matrix.row(group as usize) {
            for (column, (part, _)) in own.iter().enumerate() {
                for (other_part, place) in self.places[*other as usize].into_iter().enumerate() {
                    let value = block[*part][other_part];
                    if *other == group {
                        if let Some(row) = own.iter().position(|(own_part, _)| *own_part == other_part) {
                            lower[row][column] = value;
                        }
                    } else if let Ok(row) = rows.binary_search(&place) {
                        panel[row][column] = value;
                    }
                }
            }
        }
        self.rows.extend(rows);
        self.panels.extend(panel);
        let first = own.first().map_or(0, |(_, place)| *place as usize);
        let end = self.rows.len();
        self.columns.push(Columns { first, width: own.len(), lower, pivots: [1.0; 4], start, end });
    }

    /// Eliminates a group from those after it.
    fn eliminate(&mut self, number: usize, owner: &[u32]) {
        let (done, after) = self.columns.split_at_mut(number + 1);
        let own = &mut done[number];
        own.factor_block();
        let width = own.width;
        let rows = &self.rows[own.start..own.end];
        let (panel, later) = self.panels.split_at_mut(own.end);
        let panel = &mut panel[own.start..];
        // Times the pivots, then without them.
        let mut scaled = panel.to_vec();
        for (scaled, row) in scaled.iter_mut().zip(&mut *panel) {
            for column in 0..width {
                for before in 0..column {
                    scaled[column] -= scaled[before] * own.lower[column][before];
                }
                row[column] = scaled[column] / own.pivots[column];
            }
        }
        let offset = own.end;
        let mut first = 0;
        while first < rows.len() {
            let target = &mut after[owner[rows[first] as usize] as usize - number - 1];
            let own_rows = rows[first..].partition_point(|row| (*row as usize) < target.first + target.width);
            let (inside, below) = rows[first..].split_at(own_rows);
            for (i, row) in inside.iter().enumerate() {
                for (j, column) in inside[..=i].iter().enumerate() {
                    let value = inner(&panel[first + i], &scaled[first + j]);
                    target.lower[*row as usize - target.first][*column as usize - target.first] -= value;
                }
            }
            let target_rows = &self.rows[target.start..target.end];
            let target_panel = &mut later[target.start - offset..target.end - offset];
            let mut place = 0;
            for (i, row) in below.iter().enumerate() {
                while place < target_rows.len() && target_rows[place] < *row {
                    place += 1;
                }
                for (j, column) in inside.iter().enumerate() {
                    let value = inner(&panel[first + own_rows + i], &scaled[first + j]);
                    target_panel[place][*column as usize - target.first] -= value;
                }
            }
            first += own_rows;
        }
    }

    /// Replaces right-hand sides, one in each of the first three numbers, with the solutions; by place.
    #[inline(always)]
    pub(super) fn solve(&self, x: &mut [[f64; 4]]) {
        for columns in &self.columns {
            let mut own = [[0.0; 4]; 4];
            own[..columns.width].copy_from_slice(&x[columns.first..columns.first + columns.width]);
            for row in 1..4 {
                for before in 0..row {
                    for axis in 0..4 {
                        own[row][axis] -= columns.lower[row][before] * own[before][axis];
                    }
                }
            }
            x[columns.first..columns.first + columns.width].copy_from_slice(&own[..columns.width]);
            let range = columns.start..columns.end;
            for (row, factors) in self.rows[range.clone()].iter().zip(&self.panels[range]) {
                let to = &mut x[*row as usize];
                for axis in 0..4 {
                    let pairs = [
                        factors[0] * own[0][axis] + factors[1] * own[1][axis],
                        factors[2] * own[2][axis] + factors[3] * own[3][axis],
                    ];
                    to[axis] -= pairs[0] + pairs[1];
                }
            }
        }
        for columns in self.columns.iter().rev() {
            let mut own = [[0.0; 4]; 4];
            for (column, own) in own.iter_mut().enumerate().take(columns.width) {
                let unit = 1.0 / columns.pivots[column];
                *own = x[columns.first + column].map(|value| value * unit);
            }
            let range = columns.start..columns.end;
            for (row, factors) in self.rows[range.clone()].iter().zip(&self.panels[range]) {
                let from = &x[*row as usize];
                for column in 0..4 {
                    for axis in 0..4 {
                        own[column][axis] -= factors[column] * from[axis];
                    }
                }
            }
            for row in (1..4).rev() {
                for before in 0..row {
                    for axis in 0..4 {
                        own[before][axis] -= columns.lower[row][before] * own[row][axis];
                    }
                }
            }
            x[columns.first..columns.first + columns.width].copy_from_slice(&own[..columns.width]);
        }
    }
}

impl Columns {
    /// `L D Lᵀ` of the block on the diagonal. A pivot of zero becomes one: its unknown is zero.
    fn factor_block(&mut self) {
        for column in 0..self.width {
            let mut pivot = self.lower[column][column];
            for before in 0..column {
                pivot -= self.lower[column][before] * self.lower[column][before] * self.pivots[before];
            }
            self.pivots[column] = if pivot == 0.0 || !pivot.is_finite() { 1.0 } else { pivot };
            for row in column + 1..self.width {
                let mut value = self.lower[row][column];
                for before in 0..column {
                    value -= self.lower[row][before] * self.lower[column][before] * self.pivots[before];
                }
                self.lower[row][column] = value / self.pivots[column];
            }
            self.lower[column][column] = 0.0;
        }
    }
}

#[inline(always)]
fn inner(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

/// The order of elimination, and for each group in this order those after it that it is connected with by then.
struct Order {
    groups: Vec<u32>,
    below: Vec<Vec<u32>>,
}

impl Order {
    fn new(matrix: &BlockRows<4>, groups: &[Group]) -> Self {
        let size = |group: u32| groups[group as usize].open.iter().filter(|open| **open).count();
        let mut neighbours: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); groups.len()];
        for group in (0..groups.len() as u32).filter(|group| size(*group) > 0) {
            let others = matrix.row(group as usize).iter().map(|(other, _)| *other);
            neighbours[group as usize] = others.filter(|other| *other != group && size(*other) > 0).collect();
        }
        let cost = |neighbours: &BTreeSet<u32>| neighbours.iter().map(|other| size(*other)).sum::<usize>();
        let mut waits: Vec<bool> = groups.iter().map(|group| group.is_multiplier).collect();
        let mut queue = BTreeSet::new();
        let sized = || (0..groups.len() as u32).filter(|group| size(*group) > 0);
        for group in sized().filter(|group| !waits[*group as usize]) {
            queue.insert((cost(&neighbours[group as usize]), group));
        }
        let mut out = Self { groups: Vec::new(), below: Vec::new() };
        while let Some((_, group)) = queue.pop_first() {
            let below = std::mem::take(&mut neighbours[group as usize]);
            for &other in &below {
                let own = &mut neighbours[other as usize];
                queue.remove(&(cost(own), other));
                own.remove(&group);
                own.extend(below.iter().filter(|third| **third != other));
                waits[other as usize] = false;
                queue.insert((cost(own), other));
            }
            out.groups.push(group);
            out.below.push(below.into_iter().collect());
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of handles with a hub, and an equation between each two; and what the factor makes of a right-hand side.
    #[test]
    fn solves_what_it_factored_and_fills_in_little() {
        for count in [1_usize, 2, 7, 40, 80] {
            let (mut matrix, mut groups) = (BlockRows::zeros(0), Vec::new());
            let mut seed = 7_u64;
            let mut roll = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
            };
            for number in 0..2 * count {
                matrix.push_row(Vec::new());
                let is_multiplier = number >= count;
                let open =
                    if is_multiplier { [true, false, false, false] } else { [true, number % 5 != 2, true, true] };
                groups.push(Group { open, is_multiplier });
            }
            let mut pair = |a: usize, b: usize, value: &dyn Fn(usize, usize, f64) -> f64| {
                for i in 0..4 {
                    for j in 0..4 {
                        let value = value(i, j, roll());
                        matrix.at_mut(a, b as u32)[i][j] += value;
                        matrix.at_mut(b, a as u32)[j][i] += value;
                    }
                }
            };
            for handle in 0..count {
                pair(handle, handle, &|i, j, roll| if i == j { 20.0 } else { 0.1 * roll });
                if handle > 0 {
                    let above = if handle % 6 == 0 { 0 } else { handle - 1 };
                    pair(above, handle, &|_, _, roll| roll);
                    pair(count + handle, handle, &|i, _, roll| if i == 0 { roll } else { 0.0 });
                    pair(count + handle, above, &|i, _, roll| if i == 0 { roll } else { 0.0 });
                }
                pair(count + handle, count + handle, &|i, j, _| if i + j == 0 { -1e-6 } else { 0.0 });
            }
            let factor = BlockFactor::new(&matrix, &groups);
            assert!(factor.stored() < 120 * count, "{} for {count} handles", factor.stored());
            let mut x = vec![[0.0; 4]; factor.size()];
            x.iter_mut().enumerate().for_each(|(i, x)| *x = [1.0 + i as f64, roll(), roll(), 0.0]);
            let right = x.clone();
            factor.solve(&mut x);
            for group in 0..groups.len() {
                for (part, place) in factor.places(group).into_iter().enumerate().filter(|(_, p)| *p != NOWHERE) {
                    let mut sum = [0.0; 3];
                    for (other, block) in matrix.row(group) {
                        let others = factor.places(*other as usize).into_iter().enumerate();
                        for (column, other) in others.filter(|(_, place)| *place != NOWHERE) {
                            (0..3).for_each(|axis| sum[axis] += block[part][column] * x[other as usize][axis]);
                        }
                    }
                    for axis in 0..3 {
                        let wanted = right[place as usize][axis];
                        assert!(
                            (sum[axis] - wanted).abs() < 1e-8 * (1.0 + wanted.abs()),
                            "{count} {group}: {sum:?} {wanted}"
                        );
                    }
                }
            }
        }
    }
}
