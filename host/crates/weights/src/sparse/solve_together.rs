//! Solving with a Cholesky factor for a few right-hand sides at once. The values of one row lie side by side, so that
//! each entry of the factor is read once for all of them and meets them in two registers.

#![expect(
    clippy::inline_always,
    reason = "code that is not inlined into the function compiled for wide registers does not use them"
)]

use pulp::{Simd, WithSimd};

use super::block::Block;

/// Right-hand sides solved together.
pub(crate) const LANES: usize = 8;

/// One row's value of every right-hand side.
pub(crate) type Row = [f64; LANES];

/// The same in registers of four.
type Registers<S> = [<S as Simd>::f64s; 2];

/// Rows kept in registers together.
const ROWS: usize = 4;

/// Replaces right-hand sides with solutions of `L Lᵀ x = b`; `blocks` are all of `L`, in its matrix's own order.
pub(crate) fn solve_together(blocks: &[Block<'_>], x: &mut [Row]) {
    let work = Solve { blocks, x };
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return Simd::vectorize(simd, work);
    }
    work.with_simd(pulp::Scalar256b);
}

struct Solve<'a> {
    blocks: &'a [Block<'a>],
    x: &'a mut [Row],
}

impl WithSimd for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for block in self.blocks {
            forward(simd, block, self.x);
        }
        for block in self.blocks.iter().rev() {
            backward(simd, block, self.x);
        }
    }
}

/// `L x = b` for one block, and what it takes from the rows below.
#[inline(always)]
fn forward<S: Simd>(simd: S, block: &Block<'_>, x: &mut [Row]) {
    let height = block.width + block.pattern.len();
    let end = block.start + block.width;
    let (before, below) = x.split_at_mut(end);
    let head = &mut before[block.start..];
    for top in (0..block.width).step_by(ROWS) {
        let rows = ROWS.min(block.width - top);
        let (known, here) = head.split_at_mut(top);
        let mut sums = [[0.0; LANES]; ROWS];
        sums[..rows].copy_from_slice(&here[..rows]);
        subtract(simd, block.values, height, (top, rows), known, &mut sums);
        for row in 0..rows {
            for column in 0..row {
                let known = sums[column];
                take_one(&mut sums[row], block.values[(top + column) * height + top + row], &known);
            }
            let pivot = block.values[(top + row) * height + top + row];
            sums[row].iter_mut().for_each(|value| *value /= pivot);
        }
        here[..rows].copy_from_slice(&sums[..rows]);
    }
    for (chunk, pattern) in block.pattern.chunks(ROWS).enumerate() {
        let mut sums = [[0.0; LANES]; ROWS];
        sums.iter_mut().zip(pattern).for_each(|(sum, &row)| *sum = below[row - end]);
        subtract(simd, block.values, height, (block.width + chunk * ROWS, pattern.len()), head, &mut sums);
        sums.iter().zip(pattern).for_each(|(sum, &row)| below[row - end] = *sum);
    }
}

/// Takes `L x` from a few rows of sums, given by the first and their number; `known` is `x` at the first columns.
#[inline(always)]
fn subtract<S: Simd>(
    simd: S,
    values: &[f64],
    height: usize,
    (first, count): (usize, usize),
    known: &[Row],
    sums: &mut [Row; ROWS],
) {
    let columns = values.chunks_exact(height).zip(known);
    if count == ROWS {
        let mut four = [load::<S>(&sums[0]), load::<S>(&sums[1]), load::<S>(&sums[2]), load::<S>(&sums[3])];
        for (column, x) in columns {
            take_four(simd, &mut four, [column[first], column[first + 1], column[first + 2], column[first + 3]], x);
        }
        *sums = four.map(store::<S>);
    } else {
        for (column, x) in columns {
            for (sum, entry) in sums.iter_mut().zip(&column[first..first + count]) {
                take_one(sum, *entry, x);
            }
        }
    }
}

/// `Lᵀ x = b` for one block, whose rows below are solved.
#[inline(always)]
fn backward<S: Simd>(simd: S, block: &Block<'_>, x: &mut [Row]) {
    let height = block.width + block.pattern.len();
    let end = block.start + block.width;
    let (before, below) = x.split_at_mut(end);
    let head = &mut before[block.start..];
    for top in (0..block.width).step_by(ROWS).rev() {
        let columns = ROWS.min(block.width - top);
        let (here, known) = head[top..].split_at_mut(columns);
        let column = |k: usize| &block.values[(top + k) * height + top + columns..(top + k + 1) * height];
        let mut sums = [[0.0; LANES]; ROWS];
        sums[..columns].copy_from_slice(here);
        if columns == ROWS {
            let entries: [&[f64]; ROWS] = [0, 1, 2, 3].map(column);
            let mut four = [load::<S>(&sums[0]), load::<S>(&sums[1]), load::<S>(&sums[2]), load::<S>(&sums[3])];
            for (row, x) in known.iter().enumerate() {
                take_four(simd, &mut four, entries.map(|entries| entries[row]), x);
            }
            let below_head = entries.map(|entries| &entries[known.len()..]);
            for (row, &at) in block.pattern.iter().enumerate() {
                take_four(simd, &mut four, below_head.map(|entries| entries[row]), &below[at - end]);
            }
            sums = four.map(store::<S>);
        } else {
            let rows = known.iter().chain(block.pattern.iter().map(|&row| &below[row - end]));
            for (row, x) in rows.enumerate() {
                for (k, sum) in sums[..columns].iter_mut().enumerate() {
                    take_one(sum, column(k)[row], x);
                }
            }
        }
        for k in (0..columns).rev() {
            for row in k + 1..columns {
                let known = sums[row];
                take_one(&mut sums[k], block.values[(top + k) * height + top + row], &known);
            }
            let pivot = block.values[(top + k) * height + top + k];
            sums[k].iter_mut().for_each(|value| *value /= pivot);
        }
        here.copy_from_slice(&sums[..columns]);
    }
}

/// Takes `entries × x` from four rows of sums.
#[inline(always)]
fn take_four<S: Simd>(simd: S, sums: &mut [Registers<S>; ROWS], entries: [f64; ROWS], x: &Row) {
    let x = load::<S>(x);
    take(simd, &mut sums[0], entries[0], x);
    take(simd, &mut sums[1], entries[1], x);
    take(simd, &mut sums[2], entries[2], x);
    take(simd, &mut sums[3], entries[3], x);
}

/// `sum -= entry x`.
#[inline(always)]
fn take<S: Simd>(simd: S, sum: &mut Registers<S>, entry: f64, x: Registers<S>) {
    let entry = simd.splat_f64s(-entry);
    *sum = [simd.mul_add_f64s(entry, x[0], sum[0]), simd.mul_add_f64s(entry, x[1], sum[1])];
}

/// The same where few rows are left.
#[inline(always)]
fn take_one(sum: &mut Row, entry: f64, x: &Row) {
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum -= entry * x);
}

#[inline(always)]
fn load<S: Simd>(row: &Row) -> Registers<S> {
    let registers = S::as_simd_f64s(row).0;
    [registers[0], registers[1]]
}

#[inline(always)]
fn store<S: Simd>(registers: Registers<S>) -> Row {
    let mut row = [0.0; LANES];
    S::as_mut_simd_f64s(&mut row).0.copy_from_slice(&registers);
    row
}
