//! Runs a kernel with the widest registers the processor has.
//!
//! Kernels that are loops over lanes use no fused multiply-add: every width computes the same bits. Those that use
//! registers explicitly may fuse (see [`Eight`]).

use super::eight::{Eight, Plain};

/// A kernel together with its data. `run` and everything hot below it must be `#[inline(always)]`: only what is inlined
/// is compiled for the wide registers.
pub(crate) trait Kernel {
    /// What the kernel returns.
    type Output;
    /// The work itself.
    fn run(self) -> Self::Output;
}

/// A kernel that uses registers explicitly, under the same rule.
pub(crate) trait EightKernel {
    /// What the kernel returns.
    type Output;
    /// The work itself.
    fn run<E: Eight>(self) -> Self::Output;
}

/// Runs a kernel, compiled for AVX2 where the processor has it and for the build's own target elsewhere.
#[inline]
pub(crate) fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has just been found to have AVX2.
        return unsafe { with_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Runs a kernel with AVX2 and FMA instructions where the processor has them, and with plain loops elsewhere.
#[inline]
pub(crate) fn with_eight<K: EightKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the processor has just been found to have both.
        return unsafe { eight_with_avx2(kernel) };
    }
    kernel.run::<Plain>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn eight_with_avx2<K: EightKernel>(kernel: K) -> K::Output {
    kernel.run::<super::eight::Avx2>()
}
