//! The widest registers of this machine, four double-precision numbers at a time. Results do not depend on the machine:
//! the same operations are done in the same order, only several at once.

use pulp::{Simd, WithSimd};

/// Double-precision terms processed at once.
pub(super) const LANES: usize = 4;
pub(super) type Lane = [f64; LANES];

/// Runs `work`, which is compiled once for AVX2 and once for any machine. Registers of both hold [`LANES`].
#[inline(always)]
pub(super) fn widest<W: WithSimd>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return Simd::vectorize(simd, work);
    }
    work.with_simd(pulp::Scalar256b)
}

/// Four numbers in a register.
#[inline(always)]
pub(super) fn load<S: Simd>(lane: &Lane) -> S::f64s {
    S::as_simd_f64s(lane).0[0]
}

/// A register's four numbers.
#[inline(always)]
pub(super) fn store<S: Simd>(register: S::f64s) -> Lane {
    let mut lane = [0.0; LANES];
    S::as_mut_simd_f64s(&mut lane).0[0] = register;
    lane
}
