//! Colours that readers with any kind of colour vision tell apart.

/// Colours of curves (Okabe & Ito 2008), black and yellow left out.
pub(crate) const PALETTE: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"];

/// What has no value.
pub(crate) const GREY: &str = "#b4b4b4";

/// From numbers to colours, from dark blue over green to yellow, lightness rising throughout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    pub range: [f64; 2],
}

/// Corners of the ramp, red, green, blue.
const CORNERS: [[f64; 3]; 6] = [
    [60.0, 10.0, 95.0],
    [58.0, 72.0, 142.0],
    [36.0, 125.0, 144.0],
    [45.0, 174.0, 122.0],
    [150.0, 212.0, 63.0],
    [250.0, 231.0, 60.0],
];

impl Ramp {
    /// Colour of a value; values beyond the range have the end's.
    pub(crate) fn colour(&self, value: f64) -> String {
        let [low, high] = self.range;
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let at = share * (CORNERS.len() - 1) as f64;
        let i = (at as usize).min(CORNERS.len() - 2);
        let f = at - i as f64;
        let channel = |k: usize| (CORNERS[i][k] + f * (CORNERS[i + 1][k] - CORNERS[i][k])).round() as u8;
        format!("#{:02x}{:02x}{:02x}", channel(0), channel(1), channel(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_rises_along_the_ramp() {
        let ramp = Ramp { range: [0.0, 1.0] };
        let luma = |t: f64| {
            let colour = ramp.colour(t);
            let channel =
                |k: usize| f64::from(u8::from_str_radix(&colour[1 + 2 * k..3 + 2 * k], 16).unwrap());
            0.2126 * channel(0) + 0.7152 * channel(1) + 0.0722 * channel(2)
        };
        let lumas: Vec<f64> = (0..=20).map(|i| luma(f64::from(i) / 20.0)).collect();
        assert!(lumas.windows(2).all(|w| w[1] > w[0] + 2.0), "{lumas:?}");
        assert_eq!(ramp.colour(-3.0), ramp.colour(0.0));
        assert_eq!(ramp.colour(7.0), ramp.colour(1.0));
    }
}
