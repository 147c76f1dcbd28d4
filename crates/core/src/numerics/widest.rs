//! The widest instructions of the machine at hand. (Python side: none)

#[cfg(target_arch = "x86_64")]
use fearless_simd::{Level, Simd};

/// Run work compiled for the widest instructions that this machine has; work must be inlined all the
/// way down. No product and sum are joined, so results have the same bits on all machines.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    // Others have their vectors in every processor.
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = Level::new().as_avx2() {
        return avx2.vectorize(work);
    }
    work()
}

/// As `widest`, in registers of eight doubles where there are such: for work on rows of eight.
#[inline(always)]
pub fn eight_wide<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx512) = Level::new().as_avx512() {
        return avx512.vectorize(work);
    }
    widest(work)
}
