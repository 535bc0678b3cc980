//! The instruction sets ([`Isa`]) that a [`Kernel`] over samples is compiled for.
//!
//! Kernels are plain loops over arrays, which the compiler turns into vector instructions. They use only operations of
//! IEEE 754 (no fused multiply-add, no reordering) and of integers. So each instruction set gives the same bits, which
//! tests check.

/// A computation that is compiled separately for each [`Isa`].
pub trait Kernel {
    /// Runs the computation. This method and all functions that it calls must be `#[inline(always)]`: only inlined code
    /// is compiled for the caller's instruction set.
    fn run(self);
}

/// Instruction set that kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// Instructions that every machine of the architecture has.
    Baseline,
    /// x86-64 with 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// x86-64 with 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Instruction sets of this machine, the best last. For tests.
    #[must_use]
    pub fn available() -> Vec<Self> {
        [
            Some(Self::Baseline),
            #[cfg(target_arch = "x86_64")]
            is_x86_feature_detected!("avx2").then_some(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            has_avx512().then_some(Self::Avx512),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Best instruction set of this machine.
    #[must_use]
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            return Self::Avx512;
        } else if is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Baseline
    }

    /// Runs a kernel with this instruction set, or with the baseline if the machine does not have it.
    #[expect(unsafe_code, reason = "the match guards check the CPU feature before each call")]
    pub fn run(self, kernel: impl Kernel) {
        match self {
            // SAFETY: the machine has the instructions that the function is compiled for.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if is_x86_feature_detected!("avx2") => unsafe { avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if has_avx512() => unsafe { avx512(kernel) },
            _ => kernel.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512(kernel: impl Kernel) {
    kernel.run();
}
