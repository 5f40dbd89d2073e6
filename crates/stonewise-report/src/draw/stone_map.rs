//! The unrolled wall with its stones coloured by a quantity.

use crate::texts::{Texts, fill};
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use stonewise_figure::{Axes, Scale, escape, nice_above};
use stonewise_results::{ResultSet, RowMotion, Sorted, StoneRow};

/// Room beside the wall, pixels: left, top, right, bottom.
const MARGIN: [f64; 4] = [48.0, 8.0, 66.0, 40.0];
/// Tallest wall, pixels.
const MAX_HEIGHT: f64 = 640.0;
/// Shortest step of an outline, tenths of a pixel.
const MIN_STEP: i64 = 4;
/// Length of the longest arrow, and side of the squares that hold one arrow each, pixels: arrows of typical
/// length do not touch.
const ARROW_PX: f64 = 34.0;
const ARROW_SPACING_PX: f64 = 26.0;
/// Width of the outline of an area that changed its shape, tenths of a pixel; stones cover its inner half.
const AREA_PX: u32 = 70;
/// Size of stones from which on each has room for its number, pixels.
const NUMBERED_PX: f64 = 26.0;

/// Where everything lies in every map of one wall, and the path of every stone.
pub(crate) struct MapLayout<'a> {
    results: &'a ResultSet,
    texts: &'static Texts,
    /// Data: metres along and up.
    pub axes: Axes,
    pub width: f64,
    pub height: f64,
    /// One path a stone, tenths of a pixel.
    paths: Vec<String>,
    /// Typical size of a stone, pixels.
    stone_px: f64,
}

/// Width of the outlines of stones that were edited by hand or carried from another epoch, tenths of a pixel.
const MARKED_PX: u32 = 12;

/// What a map shows.
pub(crate) struct MapPicture<'a> {
    pub title: &'a str,
    /// Value of a stone, metres or radians; `None` where it has none.
    pub value: &'a dyn Fn(&StoneRow) -> Option<f64>,
    /// Name of a thousandth of it: "mm", "mrad".
    pub unit: &'a str,
    pub scale: Scale,
    /// Fade stones of which this does not hold.
    pub strong: Option<fn(&StoneRow) -> bool>,
    /// Draw in-plane arrows: of significant motions where the others are faded, else of all.
    pub arrows: bool,
    /// Draw a heavy outline around loose stones.
    pub loose: bool,
    /// Draw an outline around the areas that changed their shape.
    pub areas: bool,
    /// Write numbers on stones: on these, or on all where there is room.
    pub numbers: Option<&'a [u32]>,
}

impl<'a> MapLayout<'a> {
    /// Two walls stand beside each other on the page unless they are wide.
    pub(crate) fn new(results: &'a ResultSet, texts: &'static Texts) -> Self {
        let rings: Vec<Vec<Point2<f64>>> = results.stones.iter().map(|s| results.unrolled(s)).collect();
        let all = || {
            rings
                .iter()
                .flatten()
                .filter(|p| p.x.is_finite() && p.y.is_finite())
        };

        let low = all()
            .copied()
            .reduce(|a, b| a.inf(&b))
            .unwrap_or(Point2::origin());
        let high = all()
            .copied()
            .reduce(|a, b| a.sup(&b))
            .unwrap_or(Point2::new(1.0, 1.0));
        let size = (high - low).sup(&nalgebra::Vector2::repeat(0.1));
        let (low, size) = (low - size * 0.01, size * 1.02);
        let width = if size.x > 2.0 * size.y { 1240.0 } else { 620.0 };
        let scale = ((width - MARGIN[0] - MARGIN[2]) / size.x).min(MAX_HEIGHT / size.y);
        let area = [MARGIN[0], MARGIN[1], size.x * scale, size.y * scale];

        // A long label does not fit beside a low wall.
        let up = if area[3] < 110.0 {
            texts.maps.axis_up_short
        } else {
            texts.maps.axis_up
        };
        let axes = Axes {
            x: texts.axis(texts.maps.axis_along, [low.x, low.x + size.x]),
            y: texts.axis(up, [low.y, low.y + size.y]),
            area,
        };
        let (width, height) = (
            area[2] + MARGIN[0] + MARGIN[2],
            area[3].max(60.0) + MARGIN[1] + MARGIN[3],
        );

        let area_m2 = Sorted::new(results.stones.iter().map(|s| s.area_m2))
            .median()
            .unwrap_or(0.0);
        let stone_px = area_m2.max(0.0).sqrt() * scale;
        let paths = rings.iter().map(|ring| path(ring, &axes)).collect();
        Self {
            results,
            texts,
            axes,
            width,
            height,
            paths,
            stone_px,
        }
    }

    /// The texts of the page.
    pub(crate) fn texts(&self) -> &'static Texts {
        self.texts
    }

    /// Whether maps need the whole width of the page.
    pub(crate) fn is_wide(&self) -> bool {
        self.width > 700.0
    }

    /// Opening tag of a picture of this layout.
    pub(crate) fn open(&self, title: &str) -> String {
        format!(
            r#"<svg role="img" aria-label="{}" viewBox="0 0 {:.0} {:.0}" data-map {}>"#,
            escape(title),
            self.width,
            self.height,
            self.axes.attribute()
        )
    }

    /// Draws the colour bar to the right of the wall; `unit`: of a thousandth.
    pub(crate) fn draw_bar(&self, out: &mut String, scale: Scale, unit: &str) {
        let (low, high) = scale.range_m();
        scale.draw_bar(
            out,
            &self.texts.axis(unit, [low * 1e3, high * 1e3]),
            [
                self.axes.area[0] + self.axes.area[2] + 12.0,
                MARGIN[1],
                self.height - MARGIN[1] - MARGIN[3],
            ],
        );
    }
}

/// The joints, coloured by how much they open (metres), as one SVG element; `joints`: line, opening, whether
/// it is significant.
pub(crate) fn joint_map(
    layout: &MapLayout,
    title: &str,
    joints: &[([Point2<f64>; 2], f64, bool)],
    scale: Scale,
) -> String {
    let mut out = layout.open(title);
    layout.axes.draw(&mut out);
    let all = layout.paths.concat();
    let _ = write!(
        out,
        r#"<g transform="scale(.1)"><path class="plain" d="{all}"/></g>"#
    );
    let mut groups: BTreeMap<(bool, i32), String> = BTreeMap::new();

    for (line, opening, significant) in joints {
        let [x0, y0, x1, y1] = [
            layout.axes.px(line[0].x),
            layout.axes.py(line[0].y),
            layout.axes.px(line[1].x),
            layout.axes.py(line[1].y),
        ];
        let path = groups.entry((*significant, scale.step(*opening))).or_default();
        let _ = write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}");
    }

    let width = (layout.stone_px * 0.09).clamp(0.8, 4.0);
    for ((shown, step), path) in groups {
        let class = if shown { "joint" } else { "joint faded" };
        let _ = write!(
            out,
            r#"<path class="{class}" stroke="{}" stroke-width="{width:.1}" d="{path}"/>"#,
            scale.colour(step)
        );
    }

    layout.draw_bar(&mut out, scale, "mm");
    out.push_str("</svg>");
    out
}

/// The map as one SVG element.
pub(crate) fn stone_map(layout: &MapLayout, picture: &MapPicture) -> String {
    let mut out = layout.open(picture.title);
    layout.axes.draw(&mut out);
    out.push_str(r#"<g transform="scale(.1)">"#);
    // Stones of one colour are one path: fewer elements, smaller file.
    let mut groups: BTreeMap<(bool, i32), String> = BTreeMap::new();
    let (mut unknown, mut loose) = (String::new(), String::new());

    for (stone, path) in layout.results.stones.iter().zip(&layout.paths) {
        match (picture.value)(stone).filter(|v| v.is_finite()) {
            None => unknown.push_str(path),
            Some(value) => {
                let shown = picture.strong.is_none_or(|is_strong| is_strong(stone));
                groups
                    .entry((shown, picture.scale.step(value)))
                    .or_default()
                    .push_str(path);
            }
        }
        if picture.loose && stone.motion.as_ref().is_some_and(|m| m.loose) {
            loose.push_str(path);
        }
    }

    if picture.areas {
        let stones = layout.results.stones.iter().zip(&layout.paths);
        let within = stones.filter(|(stone, _)| stone.zone_id > 0);
        let areas: String = within.map(|(_, path)| path.as_str()).collect();
        let _ = write!(
            out,
            r#"<path class="area" stroke-width="{AREA_PX}" d="{areas}"/>"#
        );
    }
    if !unknown.is_empty() {
        let _ = write!(
            out,
            r#"<path class="unknown" d="{unknown}"/><path class="hatch" d="{unknown}"/>"#
        );
    }

    for ((shown, step), path) in groups {
        let class = if shown { "" } else { r#" class="faded""# };
        let _ = write!(
            out,
            r#"<path{class} fill="{}" d="{path}"/>"#,
            picture.scale.colour(step)
        );
    }

    let maps = &layout.texts.maps;
    mark(&mut out, layout, "carried", ["10 20", maps.carried], |stone| {
        stone.carried_from.is_some()
    });
    mark(&mut out, layout, "edited", ["40 30", maps.edited], |stone| {
        stone.edited.is_some()
    });

    if !loose.is_empty() {
        // Small stones get thin outlines.
        let width = (layout.stone_px * 0.8).clamp(4.0, 18.0);
        let _ = write!(
            out,
            r#"<path class="loose edge" stroke-width="{:.0}" d="{loose}"/><path class="loose" stroke-width="{width:.0}" d="{loose}"/>"#,
            2.2 * width
        );
    }

    out.push_str("</g>");
    if picture.arrows {
        draw_arrows(layout, picture.strong.is_some(), &mut out);
    }
    if let Some(named) = picture.numbers {
        write_numbers(layout, named, &mut out);
    }
    layout.draw_bar(&mut out, picture.scale, picture.unit);
    out.push_str("</svg>");
    out
}

/// Writes the numbers of stones on them.
fn write_numbers(layout: &MapLayout, named: &[u32], out: &mut String) {
    let has_room = layout.stone_px >= NUMBERED_PX;
    let numbered = |s: &&StoneRow| has_room || named.contains(&s.stone_id);
    for stone in layout.results.stones.iter().filter(numbered) {
        let at = layout.results.facade.place(&stone.centroid);
        let (x, y) = (layout.axes.px(at.x), layout.axes.py(at.y));
        if x.is_finite() && y.is_finite() {
            let _ = write!(
                out,
                r#"<text class="number" x="{x:.0}" y="{:.0}">{}</text>"#,
                y + 3.0,
                stone.stone_id
            );
        }
    }
}

/// Draws the outlines of some stones in dashes of this pattern, with a title; `class`: that of the path.
fn mark(
    out: &mut String,
    layout: &MapLayout,
    class: &str,
    [dashes, title]: [&str; 2],
    is_marked: impl Fn(&StoneRow) -> bool,
) {
    let stones = layout.results.stones.iter().zip(&layout.paths);
    let marked: String = stones
        .filter(|(stone, _)| is_marked(stone))
        .map(|(_, path)| path.as_str())
        .collect();
    if !marked.is_empty() {
        let _ = write!(
            out,
            r#"<path class="{class}" fill="none" stroke="currentColor" stroke-width="{MARKED_PX}" stroke-dasharray="{dashes}" d="{marked}"><title>{title}</title></path>"#
        );
    }
}

/// A closed polygon in tenths of a pixel, relative steps.
fn path(ring: &[Point2<f64>], axes: &Axes) -> String {
    let to_px = |p: &Point2<f64>| {
        (
            (axes.px(p.x) * 10.0).round() as i64,
            (axes.py(p.y) * 10.0).round() as i64,
        )
    };

    let mut out = String::new();
    let Some(first) = ring
        .first()
        .filter(|_| ring.iter().all(|p| p.x.is_finite() && p.y.is_finite()))
    else {
        return out;
    };
    let mut last = to_px(first);
    let _ = write!(out, "M{} {}l", last.0, last.1);
    let mut steps = 0;

    for p in &ring[1..] {
        let next = to_px(p);
        let (dx, dy) = (next.0 - last.0, next.1 - last.1);
        // Below what the eye or a printer resolves; walls of thousands of stones get lighter by a third.
        if dx * dx + dy * dy < MIN_STEP * MIN_STEP {
            continue;
        }
        let space = if steps > 0 && dx >= 0 { " " } else { "" };
        let comma = if dy >= 0 { " " } else { "" };
        let _ = write!(out, "{space}{dx}{comma}{dy}");
        (last, steps) = (next, steps + 1);
    }

    if steps < 2 {
        return String::new();
    }
    out.push('z');
    out
}

/// In-plane arrows of all or of significant motions, one to a square of the picture, and the reference arrow.
fn draw_arrows(layout: &MapLayout, only_significant: bool, out: &mut String) {
    let arrows: Vec<([f64; 2], [f64; 2])> = layout
        .results
        .stones
        .iter()
        .filter_map(|s| {
            let shown = |m: &&RowMotion| m.significant || !only_significant;
            let face = s.motion.as_ref().filter(shown)?.face;
            let at = layout.results.facade.place(&s.centroid);
            let arrow = ([layout.axes.px(at.x), layout.axes.py(at.y)], [face.x, face.y]);
            arrow
                .0
                .iter()
                .chain(&arrow.1)
                .all(|v| v.is_finite())
                .then_some(arrow)
        })
        .collect();

    let lengths = Sorted::new(arrows.iter().map(|a| a.1[0].hypot(a.1[1])));
    let Some(longest) = lengths.quantile(0.98).filter(|l| *l > 0.0) else {
        return;
    };
    let reference_m = nice_above(longest * 1e3) / 1e3;
    let px_per_m = ARROW_PX / reference_m;
    let (mut shafts, mut taken) = (String::new(), BTreeSet::new());

    for (at, d) in arrows {
        let cell = at.map(|v| (v / ARROW_SPACING_PX) as i64);
        if taken.insert(cell) {
            shafts.push_str(&arrow(at, [d[0] * px_per_m, -d[1] * px_per_m]));
        }
    }

    let left = layout.axes.area[0] + 4.0;
    let bottom = layout.height - 8.0;
    let reference = arrow([left, bottom], [ARROW_PX, 0.0]);
    let _ = write!(
        out,
        r#"<path class="arrow halo" d="{shafts}{reference}"/><path class="arrow" d="{shafts}{reference}"/><text x="{:.1}" y="{:.1}">{}</text>"#,
        left + ARROW_PX + 8.0,
        bottom + 4.0,
        fill(
            layout.texts.maps.in_plane,
            &[("length", &*layout.texts.mm(reference_m))]
        )
    );
}

/// Shaft and head of an arrow, pixels; long arrows are cut at twice the reference.
fn arrow([x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> String {
    let length = dx.hypot(dy);
    let cut = (2.0 * ARROW_PX / length.max(1e-9)).min(1.0);
    let (dx, dy) = (dx * cut, dy * cut);
    let head = 4.5f64.min(0.45 * length * cut) / (length * cut).max(1e-9);
    let (bx, by) = (dx * head, dy * head);
    let tip = (x + dx, y + dy);
    format!(
        "M{x:.1} {y:.1}L{:.1} {:.1}M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}",
        tip.0,
        tip.1,
        tip.0 - bx - 0.6 * by,
        tip.1 - by + 0.6 * bx,
        tip.0,
        tip.1,
        tip.0 - bx + 0.6 * by,
        tip.1 - by - 0.6 * bx
    )
}
