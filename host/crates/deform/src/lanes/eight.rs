//! Eight numbers in one register, by the processor's own instructions.
//!
//! Skinning spends half its time moving numbers between layouts, which compilers do badly on their own. No operation is
//! approximate. Both implementations compute the same bits except for [`Eight::plus_product`], which rounds only once
//! if the processor can.
#![expect(
    clippy::inline_always,
    reason = "an instruction is one only where it is inlined into code compiled for its processor"
)]

use std::ops::{Add, Div, Mul, Sub};

use super::width::{LANES, Lane};

/// Eight `f32`, lane by lane.
pub(crate) trait Eight:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn splat(value: f32) -> Self;
    fn load(lanes: &Lane) -> Self;
    fn store(self, lanes: &mut Lane);
    /// `self + a · b`.
    fn plus_product(self, a: Self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    /// To the nearest integer, halves to even.
    fn round(self) -> Self;
    fn abs(self) -> Self;
    /// The larger one; the second where either is NaN.
    fn max(self, other: Self) -> Self;
    /// `yes` where `self > limit`, elsewhere `no`; NaN is not greater.
    fn if_above(self, limit: Self, yes: Self, no: Self) -> Self;
    /// With the sign flipped where `other` has its sign bit set.
    fn turned_by_sign_of(self, other: Self) -> Self;
    /// Four lanes from each.
    fn halves(low: &[f32; 4], high: &[f32; 4]) -> Self;
    /// The first and the second number of each lane's row.
    fn gather_twos(table: &[[f32; 2]], rows: &[u16; LANES]) -> [Self; 2];
    /// Copies lane i of each half over that half, for i from 0 to 3.
    fn spread(self) -> [Self; 4];
    /// Rows to columns.
    fn transpose(rows: [Self; LANES]) -> [Self; LANES];
    /// Rows to columns within each half: lane l of column c is lane c of the half l / 4 of row l % 4.
    fn transpose_halves(rows: [Self; 4]) -> [Self; 4];
    /// Eight points.
    fn interleave(coordinates: [Self; 3], points: &mut [[f32; 3]; LANES]);
    /// The low half of one next to the high half of the other.
    fn joined(low: Self, high: Self) -> Self;
    /// The low halves of both.
    fn lows(a: Self, b: Self) -> Self;
    /// The high halves of both.
    fn highs(a: Self, b: Self) -> Self;

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    /// `[a.low + a.high, b.low + b.high]`.
    #[inline(always)]
    fn fold(a: Self, b: Self) -> Self {
        Self::lows(a, b) + Self::highs(a, b)
    }
}

/// For every processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain(Lane);

impl Plain {
    #[inline(always)]
    fn each(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|l| operation(self.0[l], other.0[l])))
    }
}

macro_rules! plain_operator {
    ($operator:ident, $name:ident, $symbol:tt) => {
        impl $operator for Plain {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.each(other, |a, b| a $symbol b)
            }
        }
    };
}

plain_operator!(Add, add, +);
plain_operator!(Sub, sub, -);
plain_operator!(Mul, mul, *);
plain_operator!(Div, div, /);

impl Eight for Plain {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(lanes: &Lane) -> Self {
        Self(*lanes)
    }

    #[inline(always)]
    fn store(self, lanes: &mut Lane) {
        *lanes = self.0;
    }

    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn round(self) -> Self {
        Self(self.0.map(f32::round_ties_even))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.each(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn if_above(self, limit: Self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|l| if self.0[l] > limit.0[l] { yes.0[l] } else { no.0[l] }))
    }

    #[inline(always)]
    fn turned_by_sign_of(self, other: Self) -> Self {
        self.each(other, |a, b| f32::from_bits(a.to_bits() ^ (b.to_bits() & 0x8000_0000)))
    }

    #[inline(always)]
    fn halves(low: &[f32; 4], high: &[f32; 4]) -> Self {
        Self(std::array::from_fn(|l| if l < 4 { low[l] } else { high[l - 4] }))
    }

    #[inline(always)]
    fn gather_twos(table: &[[f32; 2]], rows: &[u16; LANES]) -> [Self; 2] {
        std::array::from_fn(|i| Self(rows.map(|row| table[usize::from(row)][i])))
    }

    #[inline(always)]
    fn spread(self) -> [Self; 4] {
        std::array::from_fn(|i| Self(std::array::from_fn(|l| self.0[l / 4 * 4 + i])))
    }

    #[inline(always)]
    fn transpose(rows: [Self; LANES]) -> [Self; LANES] {
        std::array::from_fn(|c| Self(std::array::from_fn(|l| rows[l].0[c])))
    }

    #[inline(always)]
    fn transpose_halves(rows: [Self; 4]) -> [Self; 4] {
        std::array::from_fn(|c| Self(std::array::from_fn(|l| rows[l % 4].0[l / 4 * 4 + c])))
    }

    #[inline(always)]
    fn interleave([x, y, z]: [Self; 3], points: &mut [[f32; 3]; LANES]) {
        for (l, point) in points.iter_mut().enumerate() {
            *point = [x.0[l], y.0[l], z.0[l]];
        }
    }

    #[inline(always)]
    fn joined(low: Self, high: Self) -> Self {
        Self(std::array::from_fn(|l| if l < 4 { low.0[l] } else { high.0[l] }))
    }

    #[inline(always)]
    fn lows(a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|l| if l < 4 { a.0[l] } else { b.0[l - 4] }))
    }

    #[inline(always)]
    fn highs(a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|l| if l < 4 { a.0[l + 4] } else { b.0[l] }))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64 as x86;
    use std::ops::{Add, Div, Mul, Sub};

    use super::{Eight, LANES, Lane};

    /// For processors with AVX2 and fused multiply-add. Only [`with_eight`](crate::lanes::with_eight) uses it, after
    /// checking that the processor is one of them: every `SAFETY` below rests on that.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Avx2(x86::__m256);

    macro_rules! operator {
        ($operator:ident, $name:ident, $instruction:ident) => {
            impl $operator for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: see the type.
                    Self(unsafe { x86::$instruction(self.0, other.0) })
                }
            }
        };
    }

    operator!(Add, add, _mm256_add_ps);
    operator!(Sub, sub, _mm256_sub_ps);
    operator!(Mul, mul, _mm256_mul_ps);
    operator!(Div, div, _mm256_div_ps);

    impl Eight for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_set1_ps(value) })
        }

        #[inline(always)]
        fn load(lanes: &Lane) -> Self {
            // SAFETY: see the type; the pointer is to eight numbers.
            Self(unsafe { x86::_mm256_loadu_ps(lanes.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, lanes: &mut Lane) {
            // SAFETY: see the type; the pointer is to space for eight numbers.
            unsafe { x86::_mm256_storeu_ps(lanes.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn plus_product(self, a: Self, b: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_fmadd_ps(a.0, b.0, self.0) })
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_sqrt_ps(self.0) })
        }

        #[inline(always)]
        fn round(self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_round_ps::<{ x86::_MM_FROUND_TO_NEAREST_INT | x86::_MM_FROUND_NO_EXC }>(self.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_andnot_ps(x86::_mm256_set1_ps(-0.0), self.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn if_above(self, limit: Self, yes: Self, no: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe {
                let above = x86::_mm256_cmp_ps::<{ x86::_CMP_GT_OQ }>(self.0, limit.0);
                x86::_mm256_blendv_ps(no.0, yes.0, above)
            })
        }

        #[inline(always)]
        fn turned_by_sign_of(self, other: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_xor_ps(self.0, x86::_mm256_and_ps(other.0, x86::_mm256_set1_ps(-0.0))) })
        }

        #[inline(always)]
        fn halves(low: &[f32; 4], high: &[f32; 4]) -> Self {
            // SAFETY: see the type; both pointers are to four numbers.
            Self(unsafe {
                let low = x86::_mm256_castps128_ps256(x86::_mm_loadu_ps(low.as_ptr()));
                x86::_mm256_insertf128_ps::<1>(low, x86::_mm_loadu_ps(high.as_ptr()))
            })
        }

        #[inline(always)]
        fn gather_twos(table: &[[f32; 2]], rows: &[u16; LANES]) -> [Self; 2] {
            let two = |lane: usize| table[usize::from(rows[lane])].as_ptr().cast::<u8>();
            // SAFETY: see the type; each pointer is to two numbers, eight bytes.
            unsafe {
                let four = |a: usize, b: usize| {
                    x86::_mm_unpacklo_epi64(x86::_mm_loadu_si64(two(a)), x86::_mm_loadu_si64(two(b)))
                };
                let near = x86::_mm256_castsi256_ps(x86::_mm256_set_m128i(four(4, 5), four(0, 1)));
                let far = x86::_mm256_castsi256_ps(x86::_mm256_set_m128i(four(6, 7), four(2, 3)));
                [
                    Self(x86::_mm256_shuffle_ps::<0b10_00_10_00>(near, far)),
                    Self(x86::_mm256_shuffle_ps::<0b11_01_11_01>(near, far)),
                ]
            }
        }

        #[inline(always)]
        fn spread(self) -> [Self; 4] {
            // SAFETY: see the type.
            unsafe {
                [
                    Self(x86::_mm256_permute_ps::<0b00_00_00_00>(self.0)),
                    Self(x86::_mm256_permute_ps::<0b01_01_01_01>(self.0)),
                    Self(x86::_mm256_permute_ps::<0b10_10_10_10>(self.0)),
                    Self(x86::_mm256_permute_ps::<0b11_11_11_11>(self.0)),
                ]
            }
        }

        #[inline(always)]
        fn transpose(r: [Self; LANES]) -> [Self; LANES] {
            let lows = [Self::lows(r[0], r[4]), Self::lows(r[1], r[5]), Self::lows(r[2], r[6]), Self::lows(r[3], r[7])];
            let highs =
                [Self::highs(r[0], r[4]), Self::highs(r[1], r[5]), Self::highs(r[2], r[6]), Self::highs(r[3], r[7])];
            let [c0, c1, c2, c3] = Self::transpose_halves(lows);
            let [c4, c5, c6, c7] = Self::transpose_halves(highs);
            [c0, c1, c2, c3, c4, c5, c6, c7]
        }

        #[inline(always)]
        fn transpose_halves([a, b, c, d]: [Self; 4]) -> [Self; 4] {
            // SAFETY: see the type.
            unsafe {
                let (ab0, ab2) = (x86::_mm256_unpacklo_ps(a.0, b.0), x86::_mm256_unpackhi_ps(a.0, b.0));
                let (cd0, cd2) = (x86::_mm256_unpacklo_ps(c.0, d.0), x86::_mm256_unpackhi_ps(c.0, d.0));
                [
                    Self(x86::_mm256_shuffle_ps::<0b01_00_01_00>(ab0, cd0)),
                    Self(x86::_mm256_shuffle_ps::<0b11_10_11_10>(ab0, cd0)),
                    Self(x86::_mm256_shuffle_ps::<0b01_00_01_00>(ab2, cd2)),
                    Self(x86::_mm256_shuffle_ps::<0b11_10_11_10>(ab2, cd2)),
                ]
            }
        }

        #[inline(always)]
        fn interleave([x, y, z]: [Self; 3], points: &mut [[f32; 3]; LANES]) {
            let to = points.as_flattened_mut().as_mut_ptr();
            // SAFETY: see the type; `to` has room for the 24 numbers that six stores of four write.
            unsafe {
                let xy = x86::_mm256_shuffle_ps::<0b10_00_10_00>(x.0, y.0);
                let yz = x86::_mm256_shuffle_ps::<0b11_01_11_01>(y.0, z.0);
                let zx = x86::_mm256_shuffle_ps::<0b11_01_10_00>(z.0, x.0);
                let first = x86::_mm256_shuffle_ps::<0b10_00_10_00>(xy, zx);
                let second = x86::_mm256_shuffle_ps::<0b11_01_10_00>(yz, xy);
                let third = x86::_mm256_shuffle_ps::<0b11_01_11_01>(zx, yz);
                x86::_mm_storeu_ps(to, x86::_mm256_castps256_ps128(first));
                x86::_mm_storeu_ps(to.add(4), x86::_mm256_castps256_ps128(second));
                x86::_mm_storeu_ps(to.add(8), x86::_mm256_castps256_ps128(third));
                x86::_mm_storeu_ps(to.add(12), x86::_mm256_extractf128_ps::<1>(first));
                x86::_mm_storeu_ps(to.add(16), x86::_mm256_extractf128_ps::<1>(second));
                x86::_mm_storeu_ps(to.add(20), x86::_mm256_extractf128_ps::<1>(third));
            }
        }

        #[inline(always)]
        fn joined(low: Self, high: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_blend_ps::<0b1111_0000>(low.0, high.0) })
        }

        #[inline(always)]
        fn lows(a: Self, b: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_permute2f128_ps::<0x20>(a.0, b.0) })
        }

        #[inline(always)]
        fn highs(a: Self, b: Self) -> Self {
            // SAFETY: see the type.
            Self(unsafe { x86::_mm256_permute2f128_ps::<0x31>(a.0, b.0) })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{EightKernel, with_eight};

    /// Every operation, on numbers that show where they came from.
    struct Everything;

    impl EightKernel for Everything {
        type Output = Vec<Lane>;

        #[inline(always)]
        fn run<E: Eight>(self) -> Vec<Lane> {
            let rows: [Lane; LANES] = std::array::from_fn(|r| {
                std::array::from_fn(|l| (r * 8 + l) as f32 * if l % 3 == 1 { -1.5 } else { 1.0 })
            });
            let r = rows.map(|row| E::load(&row));
            let four = |from: usize| [rows[from][0], rows[from][1], rows[from][2], rows[from][3]];
            let nan = E::splat(f32::NAN);
            let mut out = vec![
                r[0] + r[1],
                r[2] - r[3],
                r[4] * r[5],
                r[6] / r[7],
                r[1].abs().sqrt(),
                r[2].max(r[3]),
                r[1].round(),
                r[1].plus_product(r[2], r[3]),
            ];
            out.extend([E::zero().if_above(r[1], r[2], r[3]), nan.if_above(r[1], r[2], r[3]), nan.max(r[1])]);
            out.extend([r[1].turned_by_sign_of(r[2]), E::halves(&four(3), &four(5)), E::fold(r[0], r[1])]);
            out.extend(E::lows(r[3], r[4]).spread());
            let table: Vec<[f32; 2]> = (0..20_u16).map(|i| [f32::from(i), -f32::from(i)]).collect();
            out.extend(E::gather_twos(&table, &[3, 19, 0, 7, 7, 11, 2, 5]));
            out.extend([E::highs(r[3], r[4]), E::joined(r[5], r[6])]);
            out.extend(E::transpose_halves([r[0], r[1], r[2], r[3]]));
            out.extend(E::transpose(r));
            let mut points = [[0.0; 3]; LANES];
            E::interleave([r[0], r[1], r[2]], &mut points);
            let mut lanes: Vec<Lane> =
                points.as_flattened().chunks_exact(8).map(|c| std::array::from_fn(|l| c[l])).collect();
            lanes.extend(out.into_iter().map(|e| {
                let mut lane = [0.0; LANES];
                e.store(&mut lane);
                lane
            }));
            lanes
        }
    }

    #[test]
    fn the_processors_instructions_do_what_the_loops_do() {
        let bits = |lanes: Vec<Lane>| -> Vec<[u32; LANES]> { lanes.iter().map(|l| l.map(f32::to_bits)).collect() };
        let plain = Everything.run::<Plain>();
        // Three rows of the interleaved points, then the first sum: 0 + 8 and -1.5 (1 + 9).
        assert_eq!(plain[0][..4], [0.0, 8.0, 16.0, -1.5]);
        assert_eq!(plain[3][..2], [8.0, -15.0]);
        assert_eq!(bits(plain), bits(with_eight(Everything)));
    }
}
