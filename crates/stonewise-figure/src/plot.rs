//! One plot: axes and what lies between them, as an SVG element that needs nothing else.

use super::{Axes, Axis, Ramp, colour_bar, escape, number, sequential};
use std::fmt::Write;

/// A plot of a fixed size.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Above the axes.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// Width and height of the whole picture, pixels.
    pub size: [f64; 2],
    /// What lies between the axes, the lowest first.
    pub items: Vec<Item>,
    /// Colour scale to the right, with its label.
    pub bar: Option<(Ramp, String)>,
}

/// Something drawn in data coordinates; `name` puts it into the legend.
#[derive(Clone, Debug)]
pub enum Item {
    /// A line through points, with a mark at each where `marks` says so.
    Line {
        /// Its corners.
        points: Vec<[f64; 2]>,
        /// As SVG writes it.
        colour: String,
        /// Whether it is dashed.
        dashed: bool,
        /// Whether each corner has a mark.
        marks: bool,
        /// In the legend; empty: none.
        name: String,
    },
    /// Round dots.
    Dots {
        /// Their centres.
        points: Vec<[f64; 2]>,
        /// As SVG writes it.
        colour: String,
        /// Their radius.
        radius_px: f64,
        /// In the legend; empty: none.
        name: String,
    },
    /// Filled areas, each with its colour.
    Areas(Vec<(Vec<[f64; 2]>, String)>),
    /// A cross that marks a known truth, open in the middle so that points on it stay visible.
    Cross([f64; 2]),
}

/// Room around the axes, pixels: left, top, right, bottom.
const MARGIN: [f64; 4] = [58.0, 26.0, 14.0, 42.0];
/// Room for the colour scale, pixels.
const BAR_PX: f64 = 62.0;
/// Steps of the colour scale.
const BAR_STEPS: u32 = 40;
/// Looks of axes and bar, inside the picture so that it is a file of its own.
const STYLE: &str = "<style>text{fill:#444}.ground{fill:none;stroke:#888}.grid{stroke:#e2e2e2}.frame{fill:none;stroke:#888;\
                     stroke-width:.6}.label,.title{fill:#000}.title{font-weight:600}</style>";

impl Plot {
    /// An empty plot.
    pub fn new(title: &str, x: Axis, y: Axis, size: [f64; 2]) -> Self {
        Self {
            title: title.to_owned(),
            x,
            y,
            size,
            items: Vec::new(),
            bar: None,
        }
    }

    /// An empty map of a wall, with equal scales, `width` pixels wide where the wall is not too tall for
    /// that.
    pub fn map(title: &str, x: Axis, y: Axis, width: f64, bar: Option<(Ramp, String)>) -> Self {
        let right = MARGIN[2] + if bar.is_some() { BAR_PX } else { 0.0 };
        let (across, high) = (x.range[1] - x.range[0], y.range[1] - y.range[0]);
        let scale = ((width - MARGIN[0] - right) / across).min(560.0 / high);
        let size = [
            across * scale + MARGIN[0] + right,
            high * scale + MARGIN[1] + MARGIN[3],
        ];
        Self {
            bar,
            ..Self::new(title, x, y, size)
        }
    }

    /// Adds something.
    pub fn add(&mut self, item: Item) -> &mut Self {
        self.items.push(item);
        self
    }

    /// The SVG element, which is a file of its own too.
    pub fn svg(&self) -> String {
        let [width, height] = self.size;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"system-ui,sans-serif\" font-size=\"12\">\
             {STYLE}<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\
             <text class=\"title\" x=\"{:.1}\" y=\"{:.1}\">{0}</text>",
            escape(&self.title),
            MARGIN[0],
            MARGIN[1] - 9.0,
        );
        let axes = self.axes();
        axes.draw(&mut out);
        let [left, top, width, height] = axes.area;
        let clip = format!("c{:x}", fingerprint(&self.title));
        let _ = write!(
            out,
            "<clipPath id=\"{clip}\"><rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/></clipPath>\
             <g clip-path=\"url(#{clip})\">"
        );
        self.items.iter().for_each(|item| draw(&axes, &mut out, item));
        out.push_str("</g>");
        self.draw_legend(&axes, &mut out);
        self.draw_bar(&axes, &mut out);
        out.push_str("</svg>");
        out
    }

    /// The axes inside the margins, the bar and the legend.
    fn axes(&self) -> Axes {
        let bar = if self.bar.is_some() { BAR_PX } else { 0.0 };
        Axes {
            x: self.x.clone(),
            y: self.y.clone(),
            area: [
                MARGIN[0],
                MARGIN[1],
                self.size[0] - MARGIN[0] - MARGIN[2] - bar - self.legend_px(),
                self.size[1] - MARGIN[1] - MARGIN[3],
            ],
        }
    }

    /// Name, colour and dash of what belongs into the legend.
    fn named(&self) -> Vec<(&str, &str, bool)> {
        let entries = self.items.iter().filter_map(|item| match item {
            Item::Line {
                name, colour, dashed, ..
            } => Some((name.as_str(), colour.as_str(), *dashed)),
            Item::Dots { name, colour, .. } => Some((name.as_str(), colour.as_str(), false)),
            _ => None,
        });
        entries.filter(|(name, ..)| !name.is_empty()).collect()
    }

    /// Room for the legend to the right of the axes, pixels.
    fn legend_px(&self) -> f64 {
        let longest = self.named().iter().map(|(name, ..)| name.chars().count()).max();
        longest.map_or(0.0, |n| 36.0 + 6.6 * n as f64)
    }

    fn draw_legend(&self, axes: &Axes, out: &mut String) {
        let [left, top, width, _] = axes.area;
        let left = left + width + 12.0 + if self.bar.is_some() { BAR_PX } else { 0.0 };
        for (i, (name, colour, dashed)) in self.named().iter().enumerate() {
            let y = top + 16.0 * (i as f64 + 0.5);
            let dash = if *dashed { " stroke-dasharray=\"5 4\"" } else { "" };
            let _ = write!(
                out,
                "<path stroke=\"{colour}\" stroke-width=\"3\"{dash} d=\"M{left:.1} {y:.1}h18\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                left + 23.0,
                y + 4.0,
                escape(name)
            );
        }
    }

    fn draw_bar(&self, axes: &Axes, out: &mut String) {
        let Some((ramp, label)) = &self.bar else { return };
        let [left, top, width, height] = axes.area;
        let colour = |i: u32| sequential((f64::from(i) + 0.5) / f64::from(BAR_STEPS));
        let colours: Vec<_> = (0..BAR_STEPS).map(colour).collect();
        let axis = Axis::linear(label, ramp.range);
        colour_bar(out, [left + width + 12.0, top, height], &colours, &axis);
    }
}

/// Draws an item in the data's coordinates.
fn draw(axes: &Axes, out: &mut String, item: &Item) {
    let place = |p: &[f64; 2]| {
        let (x, y) = (axes.px(p[0]), axes.py(p[1]));
        (x.is_finite() && y.is_finite()).then_some((x, y))
    };

    match item {
        Item::Line {
            points,
            colour,
            dashed,
            marks,
            ..
        } => {
            let places: Vec<(f64, f64)> = points.iter().filter_map(place).collect();
            let dash = if *dashed { " stroke-dasharray=\"5 4\"" } else { "" };
            let _ = write!(
                out,
                "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"{dash} d=\"{}\"/>",
                path(&places)
            );
            if *marks {
                circles(out, &places, colour, 3.0);
            }
        }
        Item::Dots {
            points,
            colour,
            radius_px,
            ..
        } => {
            let places: Vec<(f64, f64)> = points.iter().filter_map(place).collect();
            circles(out, &places, colour, *radius_px);
        }
        Item::Areas(areas) => {
            for (ring, colour) in areas {
                let mut places: Vec<(f64, f64)> = ring.iter().filter_map(place).collect();
                // Corners nearer than a pixel make the file large and cannot be seen.
                places.dedup_by(|b, a| (a.0 - b.0).hypot(a.1 - b.1) < 1.0);
                let _ = write!(out, "<path fill=\"{colour}\" d=\"{}Z\"/>", path(&places));
            }
        }
        Item::Cross(p) => {
            if let Some((x, y)) = place(p) {
                let _ = write!(
                    out,
                    "<path stroke=\"#000\" stroke-width=\"1.6\" d=\"M{:.1} {y:.1}h10m12 0h10M{x:.1} {:.1}v10m0 12v10\"/>",
                    x - 16.0,
                    y - 16.0
                );
            }
        }
    }
}

fn path(places: &[(f64, f64)]) -> String {
    let mut d = String::new();
    for (i, (x, y)) in places.iter().enumerate() {
        let _ = write!(d, "{}{} {}", if i == 0 { "M" } else { "L" }, short(*x), short(*y));
    }
    d
}

fn circles(out: &mut String, places: &[(f64, f64)], colour: &str, radius_px: f64) {
    let mut d = String::new();
    for (x, y) in places {
        let _ = write!(d, "M{} {}h0", short(*x), short(*y));
    }
    let _ = write!(
        out,
        "<path stroke=\"{colour}\" stroke-width=\"{:.1}\" stroke-linecap=\"round\" d=\"{d}\"/>",
        2.0 * radius_px
    );
}

/// A coordinate with a tenth of a pixel, a plain minus sign, and no empty decimals.
fn short(v: f64) -> String {
    let text = number(v, 1).replace('\u{2212}', "-");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// A number that belongs to a text: pictures on one page need ids of their own (FNV-1a).
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        Plot::new(
            "t",
            Axis::linear("x", [0.0, 10.0]),
            Axis::linear("y", [0.0, 1.0]),
            // 472 and the room for a legend of two letters.
            [521.2, 268.0],
        )
    }

    #[test]
    fn data_lie_where_the_axes_say() {
        let mut p = plot();
        p.add(Item::Dots {
            points: vec![[0.0, 0.0], [10.0, 1.0], [f64::NAN, 0.5]],
            colour: "#123456".into(),
            radius_px: 2.0,
            name: "n<".into(),
        });
        // 400 by 200 pixels between the axes, from (58, 26) on; y grows upwards.
        let svg = p.svg();
        assert!(svg.contains("M58 226h0M458 26h0\""), "{svg}");
        assert!(svg.contains("n&lt;") && !svg.contains("NaN"));
    }

    #[test]
    fn maps_have_equal_scales() {
        let p = Plot::map(
            "m",
            Axis::linear("x", [0.0, 40.0]),
            Axis::linear("y", [0.0, 20.0]),
            900.0,
            None,
        );
        let scale_x = p.axes().px(1.0) - p.axes().px(0.0);
        let scale_y = p.axes().py(0.0) - p.axes().py(1.0);
        assert!((scale_x - scale_y).abs() < 1e-9 && p.size[0] <= 900.5);
    }
}
