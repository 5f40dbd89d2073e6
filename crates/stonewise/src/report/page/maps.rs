//! The maps.

use super::explorer::PLACE;
use super::html::{figure, section};
use crate::report::draw::{
    MapLayout, MapPicture, Scale, component_limit_m, distance_map, mm, nice_scale_m, stone_map,
};
use crate::report::summary::Summary;
use crate::report::{ResultSet, StoneRow};

/// What the marks in the maps mean.
const LEGEND: &str = "<p class=\"legend\"><span><i class=\"key solid\"></i>significant at 95 %</span>\
    <span><i class=\"key pale\"></i>below the detection limit (faded)</span>\
    <span><i class=\"key hatched\"></i>not measured</span><span><i class=\"key ring\"></i>moves unlike its neighbours</span></p>";

/// All maps of a run; one diverging scale is shared by the components and M3C2.
pub(super) fn maps(results: &ResultSet, facts: &Summary) -> String {
    let layout = MapLayout::new(results);
    let shared = Scale::Diverging(component_limit_m(facts));
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

fn magnitude_maps(layout: &MapLayout, facts: &Summary) -> String {
    let norm = |s: &StoneRow| s.motion.as_ref().map(|m| m.displacement.norm());
    let limit = |s: &StoneRow| s.motion.as_ref().map(|m| m.detection_limit_m);
    let relative = |s: &StoneRow| s.motion.as_ref().map(|m| m.relative.norm());
    let norms = facts.measured.iter().map(|(_, m)| m.displacement.norm());
    let relatives = facts.measured.iter().map(|(_, m)| m.relative.norm());
    let limits = facts.limits.values().iter().copied();
    let draw = |title: &str,
                note: &str,
                value: &dyn Fn(&StoneRow) -> Option<f64>,
                limit_m: f64,
                fade,
                arrows,
                loose| {
        let picture = MapPicture {
            title,
            value,
            scale: Scale::Sequential(limit_m),
            fade,
            arrows,
            loose,
        };
        figure(title, &stone_map(layout, &picture), note)
    };
    let mut out = String::new();
    out.push_str(&draw(
        "Length of the motion, with in-plane arrows",
        "Arrows: in-plane part of significant motions, thinned where they would touch.",
        &norm,
        nice_scale_m(norms),
        true,
        true,
        false,
    ));
    out.push_str(&draw(
        "Motion against the neighbours",
        "Length of the difference to what the neighbours predict.",
        &relative,
        nice_scale_m(relatives),
        false,
        false,
        true,
    ));
    let note = format!(
        "What a motion must exceed to be significant; median {} mm.",
        facts.limits.median().map_or("–".into(), mm)
    );
    out.push_str(&draw(
        "Detection limit (LoD95)",
        &note,
        &limit,
        nice_scale_m(limits),
        false,
        false,
        false,
    ));
    out
}
