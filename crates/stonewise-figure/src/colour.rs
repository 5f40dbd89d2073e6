//! Colours that readers with any kind of colour vision tell apart; scales are perceptually uniform.

use std::fmt;

/// Colours of curves (Okabe & Ito 2008), black and yellow left out.
pub const PALETTE: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"];

/// What has no value.
pub const GREY: &str = "#b4b4b4";

/// An sRGB colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub [u8; 3]);

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

/// Corners (lightness, chroma) of one half of the diverging scale, from its middle to its end.
const HALF: [[f64; 2]; 3] = [[0.97, 0.0], [0.67, 0.135], [0.38, 0.1]];
/// Hue of the negative half, degrees: blue.
const NEGATIVE_HUE: f64 = 252.0;
/// Hue of the positive half, degrees: red.
const POSITIVE_HUE: f64 = 33.0;
/// Corners (lightness, chroma, hue in degrees) of the sequential scale.
const RAMP: [[f64; 3]; 5] = [
    [0.965, 0.03, 100.0],
    [0.82, 0.105, 75.0],
    [0.64, 0.14, 30.0],
    [0.44, 0.135, 345.0],
    [0.25, 0.09, 300.0],
];

/// Blue (-1) over near white (0) to red (1); equal steps look equally large. Values beyond are the end
/// colours.
///
/// Straight lines in Oklab (Ottosson 2020), walked at constant speed; both halves have the same lightness.
pub fn diverging(value: f64) -> Rgb {
    let hue = if value < 0.0 { NEGATIVE_HUE } else { POSITIVE_HUE };
    let corners = HALF.map(|[l, c]| lab(l, c, hue));
    srgb(walk(&corners, value.abs()))
}

/// Pale yellow (0) over red to dark violet (1), lightness falling throughout; equal steps look equally large.
pub fn sequential(value: f64) -> Rgb {
    srgb(walk(&RAMP.map(|[l, c, h]| lab(l, c, h)), value))
}

/// From numbers to the colours of [`sequential`].
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    /// Numbers of the first and the last colour.
    pub range: [f64; 2],
}

impl Ramp {
    /// Colour of a value; values beyond the range have the end's.
    pub fn colour(&self, value: f64) -> String {
        let [low, high] = self.range;
        sequential((value - low) / (high - low)).to_string()
    }
}

fn lab(lightness: f64, chroma: f64, hue_deg: f64) -> [f64; 3] {
    let (sin, cos) = hue_deg.to_radians().sin_cos();
    [lightness, chroma * cos, chroma * sin]
}

/// The point at this share of the length of a line through corners.
fn walk<const N: usize>(corners: &[[f64; 3]; N], share: f64) -> [f64; 3] {
    let step = |i: usize| -> f64 {
        (0..3)
            .map(|k| (corners[i + 1][k] - corners[i][k]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let total: f64 = (0..N - 1).map(step).sum();
    let mut left = if share.is_finite() {
        share.clamp(0.0, 1.0) * total
    } else {
        0.0
    };
    for i in 0..N - 1 {
        let length = step(i);
        if left <= length || i == N - 2 {
            let t = (left / length).min(1.0);
            return std::array::from_fn(|k| corners[i][k] + t * (corners[i + 1][k] - corners[i][k]));
        }
        left -= length;
    }
    corners[0]
}

/// Oklab to sRGB (Ottosson 2020).
fn srgb([l, a, b]: [f64; 3]) -> Rgb {
    let cone = [
        l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        l - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
    ]
    .map(|c| c.powi(3));
    let linear = [
        4.076_741_662_1 * cone[0] - 3.307_711_591_3 * cone[1] + 0.230_969_929_2 * cone[2],
        -1.268_438_004_6 * cone[0] + 2.609_757_401_1 * cone[1] - 0.341_319_396_5 * cone[2],
        -0.004_196_086_3 * cone[0] - 0.703_418_614_7 * cone[1] + 1.707_614_701_0 * cone[2],
    ];
    Rgb(linear.map(|c| {
        let c = c.clamp(0.0, 1.0);
        let encoded = if c <= 0.003_130_8 {
            12.92 * c
        } else {
            1.055 * c.powf(1.0 / 2.4) - 0.055
        };
        (encoded * 255.0).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(c: Rgb) -> [f64; 3] {
        c.0.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// CIELAB (D65), an independent measure of how far colours look apart.
    fn cielab([r, g, b]: [f64; 3]) -> [f64; 3] {
        let xyz = [
            (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505,
            0.2126 * r + 0.7152 * g + 0.0722 * b,
            (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089,
        ];
        let f = xyz.map(|t| {
            if t > 0.008_856 {
                t.cbrt()
            } else {
                7.787 * t + 16.0 / 116.0
            }
        });
        [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])]
    }

    fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// Deuteranopia, full severity (Machado, Oliveira & Fernandes 2009).
    fn without_green([r, g, b]: [f64; 3]) -> [f64; 3] {
        [
            0.367_322 * r + 0.860_646 * g - 0.227_968 * b,
            0.280_085 * r + 0.672_501 * g + 0.047_413 * b,
            -0.011_820 * r + 0.042_940 * g + 0.968_881 * b,
        ]
        .map(|v| v.clamp(0.0, 1.0))
    }

    #[test]
    fn lightness_falls_steadily_and_is_symmetric() {
        let l = |c: Rgb| cielab(linear(c))[0];
        for i in 0..20 {
            let (t, next) = (f64::from(i) / 20.0, f64::from(i + 1) / 20.0);
            for drop in [
                l(diverging(t)) - l(diverging(next)),
                l(diverging(-t)) - l(diverging(-next)),
            ] {
                assert!((1.5..5.0).contains(&drop), "{t}: {drop}");
            }
            assert!((l(diverging(t)) - l(diverging(-t))).abs() < 5.0);
            assert!(
                (1.8..7.0).contains(&(l(sequential(t)) - l(sequential(next)))),
                "{t}"
            );
        }
        assert_eq!(diverging(-3.0), diverging(-1.0));
        assert_eq!(diverging(f64::NAN), diverging(0.0));
    }

    #[test]
    fn signs_stay_apart_for_readers_without_green_cones() {
        for t in [0.3, 0.6, 1.0] {
            let [minus, plus] = [-t, t].map(|t| cielab(without_green(linear(diverging(t)))));
            assert!(apart(minus, plus) > 40.0 * t, "{t}: {}", apart(minus, plus));
        }
    }

    #[test]
    fn ramps_end_at_their_range() {
        let ramp = Ramp { range: [2.0, 4.0] };
        assert_eq!(ramp.colour(3.0), sequential(0.5).to_string());
        assert_eq!(ramp.colour(-3.0), ramp.colour(2.0));
        assert_eq!(ramp.colour(7.0), sequential(1.0).to_string());
    }

    #[test]
    fn no_colour_is_clipped() {
        // Clipping would show as a channel at 0 or 255 away from the light end.
        for i in -20i32..=20 {
            let Rgb(c) = diverging(f64::from(i) / 20.0);
            assert!(c.iter().all(|v| (1..255).contains(v)), "{i} {c:?}");
            let Rgb(c) = sequential(f64::from(i.abs()) / 20.0);
            assert!(c.iter().all(|v| (1..255).contains(v)), "{i} {c:?}");
        }
    }
}
