//! Fused multiplication and addition.

use pulp::Simd;

/// `a * b + c`, fused (rounded once) where the processor has an instruction for it; elsewhere rounded twice, because
/// emulated fusing is many times slower.
#[inline(always)]
pub(crate) fn mul_add<S: Simd>(a: f64, b: f64, c: f64) -> f64 {
    match S::IS_SCALAR {
        true => a * b + c,
        false => a.mul_add(b, c),
    }
}

/// Adds `factor * values` to a column.
#[inline(always)]
pub(crate) fn add_scaled<S: Simd, const N: usize>(column: &mut [f64; N], factor: f64, values: &[f64; N]) {
    // A loop, and no closure: closures are not always compiled for the vectors of the function around them.
    for (x, value) in column.iter_mut().zip(values) {
        *x = mul_add::<S>(factor, *value, *x);
    }
}
