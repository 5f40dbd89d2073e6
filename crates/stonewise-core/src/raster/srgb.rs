//! The transfer curve of sRGB (IEC 61966-2-1).

use nalgebra::{RealField, convert};

/// sRGB value of a linear value, both 0 to 1.
pub fn srgb_from_linear<T: RealField + Copy>(linear: T) -> T {
    if linear <= convert(0.003_130_8) {
        convert::<f64, T>(12.92) * linear
    } else {
        let power = linear.powf(T::one() / convert(2.4));
        convert::<f64, T>(1.055) * power - convert(0.055)
    }
}

/// Linear value of an sRGB value, both 0 to 1.
pub fn linear_from_srgb<T: RealField + Copy>(srgb: T) -> T {
    if srgb <= convert(0.04045) {
        srgb / convert(12.92)
    } else {
        ((srgb + convert(0.055)) / convert(1.055)).powf(convert(2.4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_its_known_values_and_turns_back() {
        // Middle grey of 18 % is 118 of 255, and half of the range is 21.4 % of the light.
        assert!((255.0 * srgb_from_linear(0.18f64) - 117.7).abs() < 0.1);
        assert!((linear_from_srgb(0.5f64) - 0.2140).abs() < 1e-4);
        for k in 0..=1000 {
            let value = f64::from(k) / 1000.0;
            assert!((linear_from_srgb(srgb_from_linear(value)) - value).abs() < 1e-7);
            let single = srgb_from_linear(value as f32);
            assert!((f64::from(single) - srgb_from_linear(value)).abs() < 1e-6);
        }
    }
}
