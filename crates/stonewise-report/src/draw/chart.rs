//! Scatter plots and histograms.

use std::collections::BTreeSet;
use std::fmt::Write;
use stonewise_figure::{Axes, Axis, escape, number};

/// Points of a chart with their class in the style sheet.
pub(crate) struct Series<'a> {
    pub class: &'a str,
    pub points: Vec<[f64; 2]>,
}

/// What a scatter plot shows beside its points.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Guide {
    /// Nothing.
    None,
    /// A cross at a known truth, millimetres.
    Cross([f64; 2]),
    /// The line y = x.
    Diagonal,
}

/// A square scatter plot.
///
/// `key`: what the page's program calls the plot; empty where its points are no stones.
pub(crate) fn scatter(key: &str, title: &str, [x, y]: [Axis; 2], series: &[Series], guide: Guide) -> String {
    let axes = Axes {
        x,
        y,
        area: [52.0, 8.0, 320.0, 320.0],
    };
    let live = if key.is_empty() {
        String::new()
    } else {
        format!(r#" data-chart="{key}" {}"#, axes.attribute())
    };
    let mut out = format!(
        r#"<svg role="img" aria-label="{}" viewBox="0 0 384 370"{live}>"#,
        escape(title)
    );

    axes.draw(&mut out);
    if let Some(zero) = zero_lines(&axes) {
        let _ = write!(out, r#"<path class="zero" d="{zero}"/>"#);
    }

    if matches!(guide, Guide::Diagonal) {
        let ([x0, x1], [y0, y1]) = (axes.x.range, axes.y.range);
        let (low, high) = (x0.max(y0), x1.min(y1));
        let [x0, y0, x1, y1] = [axes.px(low), axes.py(low), axes.px(high), axes.py(high)];
        let _ = write!(
            out,
            r#"<path class="diagonal" d="M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}"/>"#
        );
    }

    for s in series {
        let _ = write!(
            out,
            r#"<path class="dots {}" d="{}"/>"#,
            s.class,
            dots(&s.points, &axes)
        );
    }

    if let Guide::Cross([x, y]) = guide {
        let (x, y) = (axes.px(x), axes.py(y));
        // Open in the middle, so that points on the truth stay visible.
        let d = format!("M{:.1} {y:.1}h8m10 0h8M{x:.1} {:.1}v8m0 10v8", x - 13.0, y - 13.0);
        let _ = write!(
            out,
            r#"<path class="cross halo" d="{d}"/><path class="cross" d="{d}"/>"#
        );
    }

    out.push_str("</svg>");
    out
}

/// A histogram of values between the ends of the axis `x`; values beyond are counted in the end bars. `counted`:
/// what is counted.
pub(crate) fn histogram(title: &str, x: Axis, counted: &str, values: &[f64]) -> String {
    const BARS: usize = 40;
    let [low, high] = x.range;
    let span = high - low;
    let mut bars = [0usize; BARS];

    for v in values.iter().filter(|v| v.is_finite()) {
        let place = (v - low) / span * BARS as f64;
        bars[(place.max(0.0) as usize).min(BARS - 1)] += 1;
    }

    let highest = bars.iter().copied().max().unwrap_or(0).max(1) as f64;
    let axes = Axes {
        y: Axis {
            decimal: x.decimal,
            ..Axis::linear(counted, [0.0, highest * 1.08])
        },
        x,
        area: [52.0, 8.0, 320.0, 150.0],
    };
    let mut out = format!(
        r#"<svg role="img" aria-label="{}" viewBox="0 0 384 200">"#,
        escape(title)
    );
    axes.draw(&mut out);

    let mut path = String::new();
    for (i, n) in bars.iter().enumerate().filter(|(_, n)| **n > 0) {
        let [a, b] = [i, i + 1].map(|i| axes.px(low + span * i as f64 / BARS as f64));
        let y = axes.py(*n as f64);
        let _ = write!(
            path,
            "M{:.1} {:.1}V{y:.1}H{:.1}V{:.1}z",
            a + 0.5,
            axes.py(0.0),
            b - 0.5,
            axes.py(0.0)
        );
    }

    let _ = write!(out, r#"<path class="bars" d="{path}"/>"#);
    if let Some(zero) = zero_lines(&axes) {
        let _ = write!(out, r#"<path class="zero" d="{zero}"/>"#);
    }
    out.push_str("</svg>");
    out
}

/// Lines through zero where zero lies inside.
fn zero_lines(axes: &Axes) -> Option<String> {
    let [left, top, width, height] = axes.area;
    let mut d = String::new();
    if axes.x.holds(0.0) {
        let _ = write!(d, "M{:.1} {top}v{height}", axes.px(0.0));
    }
    if axes.y.holds(0.0) {
        let _ = write!(d, "M{left} {:.1}h{width}", axes.py(0.0));
    }
    (!d.is_empty()).then_some(d)
}

/// Points inside the axes as round dots, one to half a pixel.
fn dots(points: &[[f64; 2]], axes: &Axes) -> String {
    let mut seen = BTreeSet::new();
    for [x, y] in points {
        if axes.x.holds(*x) && axes.y.holds(*y) {
            seen.insert((
                (axes.px(*x) * 2.0).round() as i64,
                (axes.py(*y) * 2.0).round() as i64,
            ));
        }
    }
    let half = |v: i64| number(v as f64 / 2.0, usize::from(v % 2 != 0));
    seen.into_iter().fold(String::new(), |mut d, (x, y)| {
        let _ = write!(d, "M{} {}h0", half(x), half(y));
        d
    })
}
