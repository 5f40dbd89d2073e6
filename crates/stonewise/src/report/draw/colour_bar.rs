//! Colour scales with their bar.

use super::axes::ticks;
use super::colour::{Rgb, diverging, sequential};
use super::text::number;
use crate::report::RowMotion;
use crate::report::statistics::{Sorted, nice_above};
use crate::report::summary::Summary;
use std::fmt::Write;

/// Steps of colour to either side of zero, or of a sequential scale.
const STEPS: i32 = 24;

/// From lengths to colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
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
    pub(crate) fn range_m(self) -> (f64, f64) {
        match self {
            Self::Diverging(limit) => (-limit, limit),
            Self::Sequential(limit) => (0.0, limit),
        }
    }

    /// Step of colour of a value; values beyond the scale have the end's.
    pub(crate) fn step(self, value_m: f64) -> i32 {
        let share = (value_m / self.limit_m() * f64::from(STEPS)).round();
        match self {
            Self::Diverging(_) => share.clamp(f64::from(-STEPS), f64::from(STEPS)) as i32,
            Self::Sequential(_) => share.clamp(0.0, f64::from(STEPS)) as i32,
        }
    }

    /// Colour of a step.
    pub(crate) fn colour(self, step: i32) -> Rgb {
        let share = f64::from(step) / f64::from(STEPS);
        match self {
            Self::Diverging(_) => diverging(share),
            Self::Sequential(_) => sequential(share),
        }
    }

    /// Whether a value lies beyond the scale.
    pub(crate) fn exceeds(self, value_m: f64) -> bool {
        value_m.abs() > self.limit_m()
    }

    /// An upright bar with ticks in millimetres; needs 55 pixels to the right.
    pub(crate) fn draw_bar(self, out: &mut String, left: f64, top: f64, height: f64) {
        let limit_mm = self.limit_m() * 1e3;
        let (first, low) = match self {
            Self::Diverging(_) => (-STEPS, -limit_mm),
            Self::Sequential(_) => (0, 0.0),
        };
        let n = f64::from(STEPS - first + 1);
        for step in first..=STEPS {
            let y = top + height * (1.0 - f64::from(step - first + 1) / n);
            let (colour, each) = (self.colour(step), height / n + 0.5);
            let _ = write!(
                out,
                r#"<path fill="{colour}" d="M{left:.1} {y:.2}h12v{each:.2}h-12z"/>"#
            );
        }
        let _ = write!(
            out,
            r#"<path class="frame" d="M{left:.1} {top:.1}h12v{height:.1}h-12z"/>"#
        );
        let (ticks, decimals) = ticks([low, limit_mm], ((height / 30.0) as usize).max(2));
        for tick in ticks {
            let y = top + height * (1.0 - (tick - low) / (limit_mm - low));
            let label = number(tick, decimals);
            let _ = write!(
                out,
                r#"<path class="frame" d="M{:.1} {y:.1}h4"/><text x="{:.1}" y="{:.1}">{label}</text>"#,
                left + 12.0,
                left + 19.0,
                y + 4.0
            );
        }
        let _ = write!(
            out,
            r#"<text class="label" x="{left:.1}" y="{:.1}">mm</text>"#,
            top + height + 15.0
        );
    }
}

/// A round length that 98 % of the values do not exceed, metres.
pub(crate) fn nice_scale_m(values: impl IntoIterator<Item = f64>) -> f64 {
    nice_above(Sorted::new(values).quantile(0.98).unwrap_or(0.0) * 1e3) / 1e3
}

/// End of the scale that components share, metres.
pub(crate) fn component_limit_m(facts: &Summary) -> f64 {
    component_limit_of(facts.measured.iter().map(|(_, m)| *m))
}

/// The same for any motions: covers 98 % of their components, and their typical detection limit.
pub(crate) fn component_limit_of<'a>(motions: impl Iterator<Item = &'a RowMotion> + Clone) -> f64 {
    let components = motions
        .clone()
        .flat_map(|m| [m.face.x, m.face.y, m.face.z])
        .map(f64::abs);
    let limits = Sorted::new(motions.map(|m| m.detection_limit_m));
    nice_scale_m(components).max(nice_above(limits.median().unwrap_or(0.0) * 1e3) / 1e3)
}

/// Colours of both kinds of scale, from the lowest to the highest step.
pub(crate) fn colours() -> [Vec<String>; 2] {
    let all = |scale: Scale, first: i32| (first..=STEPS).map(|s| scale.colour(s).to_string()).collect();
    [all(Scale::Diverging(1.0), -STEPS), all(Scale::Sequential(1.0), 0)]
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
