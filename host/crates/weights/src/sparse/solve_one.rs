//! Solving with a Cholesky factor for one right-hand side. Four columns of a block are read side by side, so that each
//! value of the solution is read and written once for all of them.

#![expect(
    clippy::inline_always,
    reason = "code that is not inlined into the function compiled for wide registers does not use them"
)]

use pulp::{Simd, WithSimd};

use super::block::Block;

/// Columns read together.
const COLUMNS: usize = 4;

/// Replaces a right-hand side with `L⁻¹` times it; `blocks` are all of `L`, in its matrix's own order. Blocks that a
/// sparse right-hand side does not reach cost nothing.
pub(crate) fn solve_lower(blocks: &[Block<'_>], x: &mut [f64]) {
    widest(Lower { blocks, x });
}

/// The same with `L⁻ᵀ`.
pub(crate) fn solve_upper(blocks: &[Block<'_>], x: &mut [f64]) {
    widest(Upper { blocks, x });
}

fn widest<W: WithSimd>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return Simd::vectorize(simd, work);
    }
    work.with_simd(pulp::Scalar256b)
}

struct Lower<'a> {
    blocks: &'a [Block<'a>],
    x: &'a mut [f64],
}

impl WithSimd for Lower<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut rows = Vec::new();
        for block in self.blocks {
            let (head, height) = (block.start..block.start + block.width, block.width + block.pattern.len());
            if self.x[head.clone()].iter().all(|value| *value == 0.0) {
                continue;
            }
            rows.clear();
            rows.extend_from_slice(&self.x[head.clone()]);
            rows.resize(height, 0.0);
            for first in (0..block.width).step_by(COLUMNS) {
                let count = COLUMNS.min(block.width - first);
                let column = |k: usize| &block.values[(first + k) * height + first..(first + k + 1) * height];
                let (here, rest) = rows[first..].split_at_mut(count);
                for k in 0..count {
                    here[k] /= column(k)[k];
                    for row in k + 1..count {
                        here[row] -= column(k)[row] * here[k];
                    }
                }
                if let [a, b, c, d] = *here {
                    let columns = [&column(0)[4..], &column(1)[4..], &column(2)[4..], &column(3)[4..]];
                    subtract_four(simd, columns, [a, b, c, d], rest);
                } else {
                    for (k, value) in here.iter().enumerate() {
                        rest.iter_mut().zip(&column(k)[count..]).for_each(|(sum, entry)| *sum -= entry * value);
                    }
                }
            }
            self.x[head].copy_from_slice(&rows[..block.width]);
            block.pattern.iter().zip(&rows[block.width..]).for_each(|(&row, sum)| self.x[row] += sum);
        }
    }
}

struct Upper<'a> {
    blocks: &'a [Block<'a>],
    x: &'a mut [f64],
}

impl WithSimd for Upper<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut rows = Vec::new();
        for block in self.blocks.iter().rev() {
            let (head, height) = (block.start..block.start + block.width, block.width + block.pattern.len());
            rows.clear();
            rows.extend_from_slice(&self.x[head.clone()]);
            rows.extend(block.pattern.iter().map(|&row| self.x[row]));
            for first in (0..block.width).step_by(COLUMNS).rev() {
                let count = COLUMNS.min(block.width - first);
                let column = |k: usize| &block.values[(first + k) * height + first..(first + k + 1) * height];
                let (here, rest) = rows[first..].split_at_mut(count);
                let mut sums = [0.0; COLUMNS];
                if count == COLUMNS {
                    let columns = [&column(0)[4..], &column(1)[4..], &column(2)[4..], &column(3)[4..]];
                    sums = multiply_four(simd, columns, rest);
                } else {
                    for (k, sum) in sums[..count].iter_mut().enumerate() {
                        *sum = column(k)[count..].iter().zip(&*rest).map(|(entry, value)| entry * value).sum();
                    }
                }
                for k in (0..count).rev() {
                    let known: f64 = (k + 1..count).map(|row| column(k)[row] * here[row]).sum();
                    here[k] = (here[k] - sums[k] - known) / column(k)[k];
                }
            }
            self.x[head].copy_from_slice(&rows[..block.width]);
        }
    }
}

/// Takes four columns times a value each from `sums`.
#[inline(always)]
fn subtract_four<S: Simd>(simd: S, columns: [&[f64]; COLUMNS], values: [f64; COLUMNS], sums: &mut [f64]) {
    let [a, b, c, d] = values.map(|value| -value);
    let [in_a, in_b, in_c, in_d] = columns.map(S::as_simd_f64s);
    let (whole, rest) = S::as_mut_simd_f64s(sums);
    let (by_a, by_b) = (simd.splat_f64s(a), simd.splat_f64s(b));
    let (by_c, by_d) = (simd.splat_f64s(c), simd.splat_f64s(d));
    let entries = in_a.0.iter().zip(in_b.0).zip(in_c.0.iter().zip(in_d.0));
    for (sum, ((a, b), (c, d))) in whole.iter_mut().zip(entries) {
        let first = simd.mul_add_f64s(*b, by_b, simd.mul_add_f64s(*a, by_a, *sum));
        *sum = simd.mul_add_f64s(*d, by_d, simd.mul_add_f64s(*c, by_c, first));
    }
    for (k, sum) in rest.iter_mut().enumerate() {
        *sum += in_a.1[k] * a + in_b.1[k] * b + in_c.1[k] * c + in_d.1[k] * d;
    }
}

/// Each of four columns times `values`.
#[inline(always)]
fn multiply_four<S: Simd>(simd: S, columns: [&[f64]; COLUMNS], values: &[f64]) -> [f64; COLUMNS] {
    let [in_a, in_b, in_c, in_d] = columns.map(S::as_simd_f64s);
    let (whole, rest) = S::as_simd_f64s(values);
    let zero = simd.splat_f64s(0.0);
    let (mut sum_a, mut sum_b, mut sum_c, mut sum_d) = (zero, zero, zero, zero);
    let entries = in_a.0.iter().zip(in_b.0).zip(in_c.0.iter().zip(in_d.0));
    for (value, ((a, b), (c, d))) in whole.iter().zip(entries) {
        sum_a = simd.mul_add_f64s(*a, *value, sum_a);
        sum_b = simd.mul_add_f64s(*b, *value, sum_b);
        sum_c = simd.mul_add_f64s(*c, *value, sum_c);
        sum_d = simd.mul_add_f64s(*d, *value, sum_d);
    }
    let tail = |entries: &[f64]| entries.iter().zip(rest).map(|(entry, value)| entry * value).sum::<f64>();
    [
        simd.reduce_sum_f64s(sum_a) + tail(in_a.1),
        simd.reduce_sum_f64s(sum_b) + tail(in_b.1),
        simd.reduce_sum_f64s(sum_c) + tail(in_c.1),
        simd.reduce_sum_f64s(sum_d) + tail(in_d.1),
    ]
}
