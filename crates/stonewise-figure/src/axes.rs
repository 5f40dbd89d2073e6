//! Two axes around a rectangle of a picture: from data to pixels, grid, ticks and labels.

use super::Axis;
use super::text::escape;
use std::fmt::Write;

/// A rectangle of the picture with an axis on each side; y grows upwards.
///
/// Looks come from the classes `ground`, `grid`, `frame` and `label` of a style sheet.
#[derive(Clone, Debug)]
pub struct Axes {
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// Left, top, width, height, pixels.
    pub area: [f64; 4],
}

impl Axes {
    /// Pixels from the left edge of the picture.
    pub fn px(&self, x: f64) -> f64 {
        self.area[0] + self.x.share(x) * self.area[2]
    }

    /// Pixels from the upper edge of the picture.
    pub fn py(&self, y: f64) -> f64 {
        self.area[1] + (1.0 - self.y.share(y)) * self.area[3]
    }

    /// Ranges and area as the attribute `data-axes`, by which the page's program finds what lies under the
    /// pointer.
    pub fn attribute(&self) -> String {
        let [left, top, width, height] = self.area;
        format!(
            r#"data-axes="{:.6} {:.6} {:.6} {:.6} {left:.2} {top:.2} {width:.2} {height:.2}""#,
            self.x.range[0], self.x.range[1], self.y.range[0], self.y.range[1]
        )
    }

    /// Ground, grid lines, tick labels and axis labels. Draw before the data.
    pub fn draw(&self, out: &mut String) {
        let [left, top, width, height] = self.area;
        let (right, bottom) = (left + width, top + height);
        let _ = write!(
            out,
            r#"<rect class="ground" x="{left}" y="{top}" width="{width:.1}" height="{height:.1}"/>"#
        );

        for (tick, label) in self.x.ticks((width / 70.0) as usize) {
            let x = self.px(tick);
            let _ = write!(
                out,
                r#"<path class="grid" d="M{x:.1} {top}V{bottom:.1}"/><text x="{x:.1}" y="{:.1}" text-anchor="middle">{label}</text>"#,
                bottom + 15.0
            );
        }

        for (tick, label) in self.y.ticks(((height / 38.0) as usize).max(2)) {
            let y = self.py(tick);
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
            escape(&self.x.label)
        );

        let _ = write!(
            out,
            r#"<text class="label" transform="translate(12 {middle_y:.1})rotate(-90)" text-anchor="middle">{}</text>"#,
            escape(&self.y.label)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_lie_in_the_corners() {
        let axes = Axes {
            x: Axis::linear("x", [2.0, 4.0]),
            y: Axis::decades("<y>", [1.3, 10.0 / 1.3]),
            area: [10.0, 20.0, 100.0, 50.0],
        };
        assert_eq!((axes.px(2.0), axes.px(4.0)), (10.0, 110.0));
        assert!((axes.py(1.0) - 70.0).abs() < 1e-9 && (axes.py(10.0) - 20.0).abs() < 1e-9);
        let mut out = String::new();
        axes.draw(&mut out);
        assert!(out.contains("&lt;y&gt;") && out.contains(">2<"));
    }
}
