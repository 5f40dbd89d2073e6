//! The maps.

use super::explorer::PLACE;
use super::html::{figure, section};
use crate::figure::{Scale, mm};
use crate::report::draw::{MapLayout, MapPicture, distance_map, joint_map, stone_map};
use crate::report::summary::Summary;
use crate::results::{Joint, ResultSet, StoneRow, nice_scale_m};

/// What the marks in the maps mean.
const LEGEND: &str = "<p class=\"legend\"><span><i class=\"key solid\"></i>above its own 95 % limit</span>\
    <span><i class=\"key pale\"></i>below its own limit (faded)</span>\
    <span><i class=\"key hatched\"></i>not measured</span><span><i class=\"key ring\"></i>loose</span></p>";

/// All maps of a run; one diverging scale is shared by the components and M3C2.
pub(super) fn maps(results: &ResultSet, facts: &Summary, joints: &[Joint]) -> String {
    let layout = MapLayout::new(results);
    let shared = Scale::Diverging(facts.component_limit_m());
    let beyond = facts
        .components
        .iter()
        .flat_map(|c| c.values())
        .filter(|v| shared.exceeds(**v))
        .count();
    let component = |title: &str, note: &str, k: usize| {
        let value = move |s: &StoneRow| s.motion.as_ref().map(|m| m.face[k]);
        let picture = MapPicture {
            title,
            value: &value,
            unit: "mm",
            scale: shared,
            fade: true,
            arrows: false,
            loose: true,
        };
        figure(title, &stone_map(&layout, &picture), note)
    };
    let mut grid = String::new();
    grid.push_str(&component(
        "Along the wall",
        "Positive to the right of a viewer who faces the wall.",
        0,
    ));
    grid.push_str(&component("Up the face", "Positive upwards along the batter.", 1));
    grid.push_str(&component(
        "Out of the wall",
        "Positive towards the viewer (downstream).",
        2,
    ));
    if let Some(picture) = distance_map(&layout, results, shared) {
        grid.push_str(&figure(
            "M3C2 distance, for comparison",
            &picture,
            "Core points, along the normal; same scale. Faded: below its LoD95.",
        ));
    }
    grid.push_str(&opening_map(&layout, joints));
    grid.push_str(&magnitude_maps(&layout, facts));
    let wide = if layout.is_wide() { " wide" } else { "" };
    let note = if beyond > 0 {
        format!(" {beyond} components exceed the scale and have its end colours.")
    } else {
        String::new()
    };
    let body = format!(
        "<p>The wall seen from the front, unrolled. Components share one scale; millimetres, second epoch minus first.{note}</p>\
         {PLACE}{LEGEND}<div class=\"maps{wide}\">{grid}</div>"
    );
    section("maps", "Maps", &body)
}

/// How joints open and close; empty where no joint has both its stones measured.
fn opening_map(layout: &MapLayout, joints: &[Joint]) -> String {
    let moved: Vec<_> = joints
        .iter()
        .filter_map(|j| j.motion.map(|m| (j.line, m.opening_m, m.is_significant())))
        .collect();
    if moved.is_empty() {
        return String::new();
    }
    let scale = Scale::Diverging(nice_scale_m(moved.iter().map(|(_, opening, _)| opening.abs())));
    let title = "Joint opening";
    let note = "Motion of neighbouring stones apart, across their joint: red opens, blue closes; a scale of its own. Faded: less \
                than its 95 % uncertainty.";
    figure(title, &joint_map(layout, title, &moved, scale), note)
}

/// How far the stones moved, for the summary: lengths and in-plane arrows.
pub(super) fn motion_map(results: &ResultSet, facts: &Summary) -> String {
    let layout = MapLayout::new(results);
    let norm = |s: &StoneRow| s.motion.as_ref().map(|m| m.displacement.norm());
    let norms = facts.measured.iter().map(|(_, m)| m.displacement.norm());
    let page = &facts.texts().page;
    let title = page.map_title;
    let picture = MapPicture {
        title,
        value: &norm,
        unit: "mm",
        scale: Scale::Sequential(nice_scale_m(norms)),
        fade: true,
        arrows: true,
        loose: false,
    };
    let class = if layout.is_wide() { "lead wide" } else { "lead" };
    format!(
        "<div class=\"{class}\">{}</div>",
        figure(title, &stone_map(&layout, &picture), page.map_note)
    )
}

fn magnitude_maps(layout: &MapLayout, facts: &Summary) -> String {
    let limit = |s: &StoneRow| s.motion.as_ref().map(|m| m.detection_limit_m);
    let relative = |s: &StoneRow| s.motion.as_ref().map(|m| m.relative.norm());
    let relatives = facts.measured.iter().map(|(_, m)| m.relative.norm());
    let limits = facts.limits.values().iter().copied();
    let turn = |s: &StoneRow| s.motion.as_ref().map(|m| m.rotation.norm());
    let turns = facts.measured.iter().map(|(_, m)| m.rotation.norm());
    let draw = |title: &str, note: &str, value: &dyn Fn(&StoneRow) -> Option<f64>, unit, limit, loose| {
        let picture = MapPicture {
            title,
            value,
            unit,
            scale: Scale::Sequential(limit),
            fade: false,
            arrows: false,
            loose,
        };
        figure(title, &stone_map(layout, &picture), note)
    };
    let mut out = String::new();
    out.push_str(&draw(
        "Motion against the neighbours",
        "Length of the difference to what the neighbours predict.",
        &relative,
        "mm",
        nice_scale_m(relatives),
        true,
    ));
    let note = format!(
        "What a motion must exceed to be above its 95 % limit; median {} mm.",
        facts.limits.median().map_or("–".into(), mm)
    );
    out.push_str(&draw(
        "Detection limit (LoD95)",
        &note,
        &limit,
        "mm",
        nice_scale_m(limits),
        false,
    ));
    out.push_str(&draw(
        "Rotation",
        "Angle of the stone's turn.",
        &turn,
        "mrad",
        nice_scale_m(turns),
        true,
    ));
    out
}
