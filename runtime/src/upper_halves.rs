//! Clears the upper halves of the vector registers before guest code runs. The one file with unsafe code.
#![allow(unsafe_code, reason = "an intrinsic that exists on x86-64 with AVX only")]

/// Clears the upper halves of the vector registers, where there are any.
///
/// wasmtime's code uses 128-bit instructions without VEX prefix in places. If AVX code that ran before left the upper
/// halves dirty, each of them merges with the old upper half, which was measured to cost up to 160 times.
pub fn clear() {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the processor has AVX. The instruction changes upper halves only, which no live Rust value occupies
        // across a call: they are caller-saved in every x86-64 calling convention that Rust uses, and this function is
        // never inlined into AVX code.
        unsafe { zeroupper() }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx")]
#[inline(never)]
fn zeroupper() {
    std::arch::x86_64::_mm256_zeroupper();
}
