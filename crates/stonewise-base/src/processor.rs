//! What of a processor decides the last digits of results.

/// The class of this processor: its kind, and the vector instructions for which there is code.
///
/// Sums are formed in the lanes of the widest instructions that the processor has, and products are added without
/// rounding them first where it can, so that processors of one class give the same bytes, and others may differ in the
/// last digits.
pub fn processor_class() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        // All that the code for AVX2 and FMA requires; a virtual machine may hide some of it.
        let has_avx2 = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt");
        match (is_x86_feature_detected!("avx512f"), has_avx2) {
            (true, true) => "x86_64, AVX-512",
            (false, true) => "x86_64, AVX2 and FMA",
            _ => "x86_64, SSE2",
        }
    }
    #[cfg(target_arch = "aarch64")]
    return "aarch64, NEON";
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    std::env::consts::ARCH
}
