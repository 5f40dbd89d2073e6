//! Axes of a picture: from data to pixels, ticks and labels.

use super::text::{escape, number};
use crate::report::statistics::nice_above;
use std::fmt::Write;

/// A rectangle of the picture with a data range on each side; y grows upwards.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axes {
    pub x: [f64; 2],
    pub y: [f64; 2],
    /// Left, top, width, height, pixels.
    pub area: [f64; 4],
}

impl Axes {
    pub(crate) fn px(&self, x: f64) -> f64 {
        self.area[0] + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.area[2]
    }

    pub(crate) fn py(&self, y: f64) -> f64 {
        self.area[1] + self.area[3] - (y - self.y[0]) / (self.y[1] - self.y[0]) * self.area[3]
    }

    /// Ranges and area as the attribute `data-axes`, by which the page's program finds what lies under the pointer.
    pub(crate) fn attribute(&self) -> String {
        let [left, top, width, height] = self.area;
        format!(
            r#"data-axes="{:.6} {:.6} {:.6} {:.6} {left:.2} {top:.2} {width:.2} {height:.2}""#,
            self.x[0], self.x[1], self.y[0], self.y[1]
        )
    }

    /// Ground, grid lines, tick labels and axis labels. Draw before the data.
    pub(crate) fn draw(&self, out: &mut String, x_label: &str, y_label: &str) {
        let [left, top, width, height] = self.area;
        let (right, bottom) = (left + width, top + height);
        let _ = write!(
            out,
            r#"<rect class="ground" x="{left}" y="{top}" width="{width:.1}" height="{height:.1}"/>"#
        );
        let (ticks, decimals) = ticks(self.x, (width / 70.0) as usize);
        for tick in ticks {
            let x = self.px(tick);
            let label = number(tick, decimals);
            let _ = write!(
                out,
                r#"<path class="grid" d="M{x:.1} {top}V{bottom:.1}"/><text x="{x:.1}" y="{:.1}" text-anchor="middle">{label}</text>"#,
                bottom + 15.0
            );
        }
        let (ticks, decimals) = self::ticks(self.y, ((height / 38.0) as usize).max(2));
        for tick in ticks {
            let y = self.py(tick);
            let label = number(tick, decimals);
            let _ = write!(
                out,
                r#"<path class="grid" d="M{left} {y:.1}H{right:.1}"/><text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#,
                left - 6.0,
                y + 4.0
            );
        }
        let (middle_x, middle_y) = (left + width / 2.0, top + height / 2.0);
        let _ = write!(
            out,
            r#"<text class="label" x="{middle_x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            bottom + 32.0,
            escape(x_label)
        );
        let _ = write!(
            out,
            r#"<text class="label" transform="translate(12 {middle_y:.1})rotate(-90)" text-anchor="middle">{}</text>"#,
            escape(y_label)
        );
    }
}

/// Round values within a range, about `wanted` of them, and the decimals that they need.
pub(crate) fn ticks([low, high]: [f64; 2], wanted: usize) -> (Vec<f64>, usize) {
    let span = high - low;
    if !span.is_finite() || span <= 0.0 {
        return (vec![], 0);
    }
    let step = nice_above(span / wanted.max(1) as f64);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    let mut decimals = 0;
    while decimals < 6 && (step * 10f64.powi(decimals) - (step * 10f64.powi(decimals)).round()).abs() > 1e-6 {
        decimals += 1;
    }
    (
        (first..=last).map(|i| i as f64 * step).collect(),
        decimals as usize,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([-1.0, 4.2], 5), (vec![0.0, 2.0, 4.0], 0));
        assert_eq!(ticks([0.0, 0.5], 2), (vec![0.0, 0.25, 0.5], 2));
        assert_eq!(ticks([1.0, 1.0], 3).0.len(), 0);
        assert_eq!(ticks([f64::NAN, 1.0], 3).0.len(), 0);
    }
}
