//! The little dense algebra needed for switching constraints: matrices of about a hundred rows, in `f64`.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use crate::lanes::{Kernel, widest};

/// A dense matrix, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Dense {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) data: Vec<f64>,
}

impl Dense {
    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, data: vec![0.0; rows * columns] }
    }

    pub(crate) fn at(&self, row: usize, column: usize) -> f64 {
        self.data[row * self.columns + column]
    }

    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.data[row * self.columns..(row + 1) * self.columns]
    }

    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.data[row * self.columns..(row + 1) * self.columns]
    }

    /// The given rows and columns, in the given order.
    pub(crate) fn select(&self, rows: &[usize], columns: &[usize]) -> Self {
        let mut out = Self::zeros(rows.len(), columns.len());
        for (to, &row) in out.data.chunks_exact_mut(columns.len().max(1)).zip(rows) {
            let from = self.row(row);
            to.iter_mut().zip(columns).for_each(|(to, &column)| *to = from[column]);
        }
        out
    }

    pub(crate) fn transpose(&self) -> Self {
        let mut out = Self::zeros(self.columns, self.rows);
        for (column, row) in self.data.chunks_exact(self.columns.max(1)).enumerate() {
            for (entry, to) in row.iter().zip(out.data[column..].iter_mut().step_by(self.rows)) {
                *to = *entry;
            }
        }
        out
    }

    /// Writes `self · vector`.
    pub(crate) fn times_vector(&self, vector: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(self.data.chunks_exact(self.columns.max(1))) {
            *out = dot(row, vector);
        }
    }

    /// `self · other`.
    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut out = Self::zeros(self.rows, other.columns);
        widest(Product { a: self, b: other, out: &mut out });
        out
    }
}

struct Product<'a> {
    a: &'a Dense,
    b: &'a Dense,
    out: &'a mut Dense,
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (inner, width) = (self.a.columns, self.b.columns);
        if inner == 0 || width == 0 {
            return;
        }
        let tiles = width / TILE[1] * TILE[1];
        let mut a = self.a.data.chunks_exact(TILE[0] * inner);
        let mut out = self.out.data.chunks_exact_mut(TILE[0] * width);
        for (a, out) in a.by_ref().zip(out.by_ref()) {
            for first in (0..tiles).step_by(TILE[1]) {
                multiply_tile(a, &self.b.data, first, inner, width, out);
            }
            multiply_rest(a, &self.b.data, tiles, inner, width, out);
        }
        multiply_rest(a.remainder(), &self.b.data, 0, inner, width, out.into_remainder());
    }
}

/// Rows and columns of a product that stay in registers during the sums.
const TILE: [usize; 2] = [4, 8];

#[inline(always)]
fn multiply_tile(a: &[f64], b: &[f64], first: usize, inner: usize, width: usize, out: &mut [f64]) {
    let (mut s0, mut s1, mut s2, mut s3) = ([0.0; 8], [0.0; 8], [0.0; 8], [0.0; 8]);
    let (a01, a23) = a.split_at(2 * inner);
    let ((a0, a1), (a2, a3)) = (a01.split_at(inner), a23.split_at(inner));
    let rows = a0.iter().zip(a1).zip(a2).zip(a3).zip(b.chunks_exact(width));
    for ((((a0, a1), a2), a3), b) in rows {
        let Some(b) = b[first..].first_chunk::<8>() else { return };
        for c in 0..8 {
            s0[c] += a0 * b[c];
            s1[c] += a1 * b[c];
            s2[c] += a2 * b[c];
            s3[c] += a3 * b[c];
        }
    }
    for (sums, out) in [s0, s1, s2, s3].iter().zip(out.chunks_exact_mut(width)) {
        out[first..first + TILE[1]].copy_from_slice(sums);
    }
}

/// What the tiles leave over: columns from `first` on.
#[inline(always)]
fn multiply_rest(a: &[f64], b: &[f64], first: usize, inner: usize, width: usize, out: &mut [f64]) {
    for (a, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(width)) {
        for (factor, b) in a.iter().zip(b.chunks_exact(width)) {
            add_multiple(&mut out[first..], *factor, &b[first..]);
        }
    }
}

#[inline(always)]
pub(crate) fn add_multiple(to: &mut [f64], factor: f64, from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
}

/// A sum in four interleaved parts, which the compiler can keep in one register.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_fours, a_rest) = a.as_chunks::<4>();
    let (b_fours, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a_fours.iter().zip(b_fours) {
        for l in 0..4 {
            sums[l] += a[l] * b[l];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Three products with one row: three times the work for numbers that are read once. The same bits as [`dot`].
#[inline(always)]
pub(crate) fn dot_three(row: &[f64], columns: [&[f64]; 3]) -> [f64; 3] {
    let (fours, rest) = row.as_chunks::<4>();
    let [(a, a_rest), (b, b_rest), (c, c_rest)] = columns.map(|column| column.as_chunks::<4>());
    let (mut of_a, mut of_b, mut of_c) = ([0.0; 4], [0.0; 4], [0.0; 4]);
    for (((row, a), b), c) in fours.iter().zip(a).zip(b).zip(c) {
        for l in 0..4 {
            of_a[l] += row[l] * a[l];
            of_b[l] += row[l] * b[l];
            of_c[l] += row[l] * c[l];
        }
    }
    let mut out = [0.0; 3];
    for (out, (sums, column)) in out.iter_mut().zip([(of_a, a_rest), (of_b, b_rest), (of_c, c_rest)]) {
        let mut sum = 0.0;
        for (row, value) in rest.iter().zip(column) {
            sum += row * value;
        }
        *out = (sums[0] + sums[1]) + (sums[2] + sums[3]) + sum;
    }
    out
}

/// Equations `E x = p` split into what they fix and what they leave open.
#[derive(Debug)]
pub(crate) struct Elimination {
    /// n×c: `x = particular · p` satisfies the equations, in the least-squares sense if they contradict each other.
    pub(crate) particular: Dense,
    /// k×n, orthonormal rows: what can be added to `x` without affecting the equations.
    pub(crate) open: Dense,
}

/// Relative size below which an equation counts as a combination of the others.
const DEPENDENT: f64 = 1e-9;

/// Householder's QR decomposition of the transposed equations (c×n) with pivoting: finds the rank, a particular
/// solution and an orthonormal basis of the rest.
pub(crate) fn eliminate(equations: &Dense) -> Elimination {
    let (count, n) = (equations.rows, equations.columns);
    let mut rows = equations.clone();
    let mut order: Vec<usize> = (0..count).collect();
    let mut reflectors: Vec<Vec<f64>> = Vec::new();
    let mut largest = 0.0_f64;
    for k in 0..count.min(n) {
        let tails = (k..count).map(|r| dot(&rows.row(r)[k..], &rows.row(r)[k..]));
        let (offset, squared) =
            tails.enumerate().fold((0, -1.0), |best, (i, s)| if s > best.1 { (i, s) } else { best });
        largest = largest.max(squared.sqrt());
        if squared.sqrt() <= DEPENDENT * largest || squared <= 0.0 {
            break;
        }
        order.swap(k, k + offset);
        for c in 0..n {
            rows.data.swap(k * n + c, (k + offset) * n + c);
        }
        let mut v = rows.row(k)[k..].to_vec();
        v[0] += squared.sqrt().copysign(v[0]);
        let scale = (2.0 / dot(&v, &v)).sqrt();
        v.iter_mut().for_each(|c| *c *= scale);
        for r in k..count {
            reflect(&mut rows.row_mut(r)[k..], &v);
        }
        reflectors.push(v);
    }
    let rank = reflectors.len();
    let mut basis = Dense::zeros(n, n);
    for i in 0..n {
        basis.data[i * n + i] = 1.0;
        for (k, v) in reflectors.iter().enumerate().rev() {
            reflect(&mut basis.row_mut(i)[k..], v);
        }
    }
    let open = Dense { rows: n - rank, columns: n, data: basis.data.split_off(rank * n) };
    let fixed = Dense { rows: rank, columns: n, data: basis.data };
    Elimination { particular: particular_solution(&rows, &order, &fixed), open }
}

fn reflect(x: &mut [f64], v: &[f64]) {
    let along = dot(x, v);
    add_multiple(x, -along, v);
}

/// With `Eᵀ Π = Q R`: `x = Q (R Rᵀ)⁻¹ R Πᵀ p`, the shortest least-squares solution.
fn particular_solution(rows: &Dense, order: &[usize], fixed: &Dense) -> Dense {
    let (count, rank, n) = (rows.rows, fixed.rows, fixed.columns);
    let mut r = Dense::zeros(rank, count);
    for i in 0..rank {
        for j in i..count {
            r.data[i * count + j] = rows.at(j, i);
        }
    }
    let factor = pivoted_cholesky(&r.times(&r.transpose()), 0.0, 0.0);
    let mut solved = Dense::zeros(rank, count);
    let permuted = r.select(&factor.order, &(0..count).collect::<Vec<_>>());
    let whitened = factor.solve_lower(&permuted);
    let half = factor.solve_lower_transposed(&whitened);
    for (i, &place) in factor.order.iter().enumerate().take(factor.rank) {
        solved.row_mut(place).copy_from_slice(half.row(i));
    }
    let by_order = fixed.transpose().times(&solved);
    let mut out = Dense::zeros(n, count);
    for row in 0..n {
        for (j, &equation) in order.iter().enumerate() {
            out.data[row * count + equation] = by_order.at(row, j);
        }
    }
    out
}

/// `P A Pᵀ = L Lᵀ` up to the rank of a positive semidefinite matrix.
#[derive(Debug)]
pub(crate) struct PivotedCholesky {
    pub(crate) rank: usize,
    /// Row i of `L` belongs to row `order[i]` of the matrix.
    pub(crate) order: Vec<usize>,
    /// n×n, lower triangle in its first `rank` columns.
    lower: Dense,
}

/// Stops at the rank: when no pivot exceeds `tolerance` times its own original diagonal entry. Diagonal entries up to
/// `floor` count as zero.
pub(crate) fn pivoted_cholesky(matrix: &Dense, tolerance: f64, floor: f64) -> PivotedCholesky {
    let n = matrix.rows;
    let mut order: Vec<usize> = (0..n).collect();
    let mut lower = Dense::zeros(n, n);
    let original: Vec<f64> = (0..n).map(|i| matrix.at(i, i)).collect();
    let mut rest = original.clone();
    let mut rank = 0;
    while rank < n {
        let mut best = (rank, 0.0);
        for i in rank..n {
            let whole = original[order[i]];
            let share = if whole > floor { rest[order[i]] / whole } else { 0.0 };
            if share > best.1 {
                best = (i, share);
            }
        }
        if best.1 <= tolerance {
            break;
        }
        order.swap(rank, best.0);
        for c in 0..rank {
            lower.data.swap(rank * n + c, best.0 * n + c);
        }
        let pivot_row = order[rank];
        let pivot = rest[pivot_row].sqrt();
        lower.data[rank * n + rank] = pivot;
        let (above, below) = lower.data.split_at_mut((rank + 1) * n);
        let own = &above[rank * n..rank * n + rank];
        for (i, row) in below.chunks_exact_mut(n).enumerate() {
            let of_matrix = order[rank + 1 + i];
            let value = (matrix.at(of_matrix, pivot_row) - dot(&row[..rank], own)) / pivot;
            row[rank] = value;
            rest[of_matrix] -= value * value;
        }
        rank += 1;
    }
    PivotedCholesky { rank, order, lower }
}

impl PivotedCholesky {
    /// `L₁₁⁻¹ B`, with the rows of `B` in the factor's order; only the first `rank` rows count.
    pub(crate) fn solve_lower(&self, b: &Dense) -> Dense {
        let mut out = Dense { rows: self.rank, columns: b.columns, data: b.data[..self.rank * b.columns].to_vec() };
        let width = b.columns;
        for i in 0..self.rank {
            let (done, rest) = out.data.split_at_mut(i * width);
            let row = &mut rest[..width];
            for k in 0..i {
                add_multiple(row, -self.lower.at(i, k), &done[k * width..(k + 1) * width]);
            }
            let pivot = self.lower.at(i, i);
            row.iter_mut().for_each(|c| *c /= pivot);
        }
        out
    }

    /// `L₁₁⁻ᵀ B` for a `B` of `rank` rows.
    pub(crate) fn solve_lower_transposed(&self, b: &Dense) -> Dense {
        let mut out = b.clone();
        let width = b.columns;
        for i in (0..self.rank).rev() {
            let (head, tail) = out.data.split_at_mut((i + 1) * width);
            let row = &mut head[i * width..];
            for k in i + 1..self.rank {
                add_multiple(row, -self.lower.at(k, i), &tail[(k - i - 1) * width..(k - i) * width]);
            }
            let pivot = self.lower.at(i, i);
            row.iter_mut().for_each(|c| *c /= pivot);
        }
        out
    }

    /// (n-rank)×n: rows that span the null space, in the matrix's own order.
    pub(crate) fn null_space(&self) -> Dense {
        let n = self.order.len();
        let mut below = Dense::zeros(self.rank, n - self.rank);
        for k in self.rank..n {
            for i in 0..self.rank {
                below.data[i * (n - self.rank) + k - self.rank] = self.lower.at(k, i);
            }
        }
        let solved = self.solve_lower_transposed(&below);
        let mut out = Dense::zeros(n - self.rank, n);
        for k in 0..n - self.rank {
            for i in 0..self.rank {
                out.data[k * n + self.order[i]] = -solved.at(i, k);
            }
            out.data[k * n + self.order[self.rank + k]] = 1.0;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(rows: usize, columns: usize, seed: u64) -> Dense {
        let mut state = seed;
        let mut roll = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 52) as f64) - 1.0
        };
        Dense { rows, columns, data: (0..rows * columns).map(|_| roll()).collect() }
    }

    fn largest(m: &Dense) -> f64 {
        m.data.iter().fold(0.0, |a, b| a.max(b.abs()))
    }

    fn minus(a: &Dense, b: &Dense) -> Dense {
        Dense { data: a.data.iter().zip(&b.data).map(|(a, b)| a - b).collect(), ..*a }
    }

    #[test]
    fn elimination_solves_and_leaves_the_rest_open() {
        for (count, n) in [(0, 5), (3, 7), (6, 6), (20, 33)] {
            let equations = filled(count, n, 7);
            let split = eliminate(&equations);
            assert_eq!(split.open.rows, n - count);
            let identity = equations.times(&split.particular);
            for i in 0..count {
                for j in 0..count {
                    assert!((identity.at(i, j) - f64::from(u8::from(i == j))).abs() < 1e-10);
                }
            }
            assert!(largest(&equations.times(&split.open.transpose())) < 1e-12);
        }
    }

    #[test]
    fn contradictions_are_met_halfway() {
        let two = filled(2, 5, 3);
        let mut equations = Dense::zeros(4, 5);
        equations.data[..10].copy_from_slice(&two.data);
        equations.data[10..15].copy_from_slice(two.row(0));
        let split = eliminate(&equations);
        assert_eq!(split.open.rows, 3);
        let x = split.particular.times(&Dense { rows: 4, columns: 1, data: vec![1.0, 5.0, 3.0, 9.0] });
        let met = equations.times(&x);
        assert!((met.at(0, 0) - 2.0).abs() < 1e-9 && (met.at(1, 0) - 5.0).abs() < 1e-9);
    }

    #[test]
    fn cholesky_finds_rank_and_null_space() {
        let half = filled(9, 14, 11);
        let singular = half.transpose().times(&half);
        let factor = pivoted_cholesky(&singular, 1e-11, 0.0);
        assert_eq!(factor.rank, 9);
        let null = factor.null_space();
        assert_eq!(null.rows, 5);
        assert!(largest(&singular.times(&null.transpose())) < 1e-10 * largest(&null));
        let whole = half.times(&half.transpose());
        let factor = pivoted_cholesky(&whole, 1e-12, 0.0);
        assert_eq!(factor.rank, 9);
        let b = filled(9, 2, 5);
        let permuted = b.select(&factor.order, &[0, 1]);
        let x = factor.solve_lower_transposed(&factor.solve_lower(&permuted));
        let mut unpermuted = Dense::zeros(9, 2);
        for (i, &place) in factor.order.iter().enumerate() {
            unpermuted.row_mut(place).copy_from_slice(x.row(i));
        }
        assert!(largest(&minus(&whole.times(&unpermuted), &b)) < 1e-9);
    }
}
