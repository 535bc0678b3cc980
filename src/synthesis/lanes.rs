//! Many samples at once: [`Lanes`], and the instruction set that a [`Kernel`] over them is compiled for.
//!
//! Kernels are plain loops over arrays, which the compiler turns into vector instructions. Every operation in them is one
//! of IEEE 754's (no fused multiplication and addition, no reordering) or one on integers, so that each instruction set
//! gives the same bits; tests hold them to it.

/// The number of samples that a kernel works on at once.
pub(crate) const LANES: usize = 64;

/// One number a sample.
pub(crate) type Lanes<T> = [T; LANES];

/// Work that is compiled once for each [`Isa`].
pub(crate) trait Kernel {
    /// Does it. Must be `#[inline(always)]`, as must be all that it calls: inlined code takes the caller's instructions.
    fn run(self);
}

/// An instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Isa {
    /// What every machine of the architecture has.
    Baseline,
    /// x86-64 with 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// x86-64 with 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Those that this machine has, the best last.
    #[cfg(test)]
    #[must_use]
    pub(crate) fn present() -> Vec<Self> {
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

    /// The best that this machine has.
    #[must_use]
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            return Self::Avx512;
        } else if is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Baseline
    }

    /// Runs a kernel with these instructions, or with the baseline's where the machine lacks them.
    #[expect(unsafe_code, reason = "only the check before it makes the call sound")]
    pub(crate) fn run(self, kernel: impl Kernel) {
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
