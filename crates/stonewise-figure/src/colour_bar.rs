//! The bar that says what colours mean.

use super::{Axis, Rgb};
use std::fmt::Write;

/// An upright bar of colours from the lowest value to the highest, with ticks; needs 55 pixels to the right.
///
/// `at`: left, top, height in pixels; the range and the unit below the bar are those of `axis`.
pub fn colour_bar(out: &mut String, [left, top, height]: [f64; 3], colours: &[Rgb], axis: &Axis) {
    let each = height / colours.len() as f64;
    for (step, colour) in colours.iter().enumerate() {
        let y = top + height - (step + 1) as f64 * each;
        let _ = write!(
            out,
            r#"<path fill="{colour}" d="M{left:.1} {y:.2}h12v{:.2}h-12z"/>"#,
            each + 0.5
        );
    }

    let _ = write!(
        out,
        r#"<path class="frame" d="M{left:.1} {top:.1}h12v{height:.1}h-12z"/>"#
    );

    for (tick, label) in axis.ticks(((height / 30.0) as usize).max(2)) {
        let y = top + height * (1.0 - axis.share(tick));
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
        r#"<text class="label" x="{left:.1}" y="{:.1}">{}</text>"#,
        top + height + 19.0,
        super::escape(&axis.label)
    );
}
