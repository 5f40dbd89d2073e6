//! Colour scales of lengths, with their bar.

use super::{Axis, Rgb, colour_bar, diverging, sequential};

/// Steps of colour to either side of zero, or of a sequential scale.
const STEPS: i32 = 24;

/// From lengths to colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// From minus to plus this length, metres.
    Diverging(f64),
    /// From zero to this length, metres.
    Sequential(f64),
}

impl Scale {
    fn limit_m(self) -> f64 {
        match self {
            Self::Diverging(limit) | Self::Sequential(limit) => limit,
        }
    }

    /// Lowest and highest length of the scale, metres.
    pub fn range_m(self) -> (f64, f64) {
        match self {
            Self::Diverging(limit) => (-limit, limit),
            Self::Sequential(limit) => (0.0, limit),
        }
    }

    /// Step of colour of a value; values beyond the scale have the end's.
    pub fn step(self, value_m: f64) -> i32 {
        let share = (value_m / self.limit_m() * f64::from(STEPS)).round();
        match self {
            Self::Diverging(_) => share.clamp(f64::from(-STEPS), f64::from(STEPS)) as i32,
            Self::Sequential(_) => share.clamp(0.0, f64::from(STEPS)) as i32,
        }
    }

    /// Colour of a step.
    pub fn colour(self, step: i32) -> Rgb {
        let share = f64::from(step) / f64::from(STEPS);
        match self {
            Self::Diverging(_) => diverging(share),
            Self::Sequential(_) => sequential(share),
        }
    }

    /// Whether a value lies beyond the scale.
    pub fn exceeds(self, value_m: f64) -> bool {
        value_m.abs() > self.limit_m()
    }

    /// Colours from the lowest to the highest step.
    fn colours(self) -> Vec<Rgb> {
        let first = match self {
            Self::Diverging(_) => -STEPS,
            Self::Sequential(_) => 0,
        };
        (first..=STEPS).map(|step| self.colour(step)).collect()
    }

    /// An upright bar whose `axis` runs over [`Self::range_m`] in any unit, see [`colour_bar`].
    pub fn draw_bar(self, out: &mut String, axis: &Axis, place: [f64; 3]) {
        colour_bar(out, place, &self.colours(), axis);
    }
}

/// Colours of both kinds of scale, from the lowest to the highest step.
pub fn colours() -> [Vec<String>; 2] {
    [Scale::Diverging(1.0), Scale::Sequential(1.0)]
        .map(|scale| scale.colours().iter().map(Rgb::to_string).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_symmetric_and_end_at_the_limit() {
        let scale = Scale::Diverging(0.02);
        assert_eq!(
            (scale.step(0.0), scale.step(0.01), scale.step(-0.5)),
            (0, 12, -24)
        );
        assert_eq!(Scale::Sequential(0.02).step(-0.5), 0);
        assert_eq!(scale.step(f64::NAN), 0);
        assert!(scale.exceeds(-0.021) && !scale.exceeds(0.02));
    }
}
