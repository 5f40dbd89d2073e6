//! The maps.

use super::explorer::PLACE;
use super::html::{figure, section};
use super::look_first::named;
use crate::draw::{MapLayout, MapPicture, distance_map, joint_map, stone_map};
use crate::summary::Summary;
use crate::texts::{MapTexts, fill};
use stonewise_figure::{Scale, count};
use stonewise_results::{Joint, ResultSet, StoneRow, nice_scale_m};

/// What the marks in the maps mean. A run in doubt has no limits, and cannot tell which stones are loose.
fn legend(names: &MapTexts, is_sound: bool) -> String {
    let key = |class: &str, words: &str| format!("<span><i class=\"key {class}\"></i>{words}</span>");
    let unmeasured = key("hatched", names.unmeasured);
    let keys = match is_sound {
        true => [
            key("solid", names.above),
            key("pale", names.below),
            unmeasured,
            key("ring", names.loose),
        ]
        .concat(),
        false => unmeasured,
    };
    format!("<p class=\"legend\">{keys}</p>")
}

/// All maps of a run; one diverging scale is shared by the components and M3C2.
pub(super) fn maps(results: &ResultSet, facts: &Summary, joints: &[Joint]) -> String {
    let texts = facts.texts;
    let names = &texts.maps;
    let layout = MapLayout::new(results, texts);
    let shared = Scale::Diverging(facts.component_limit_m);
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
            strong: facts.verdict.is_sound().then_some(is_significant),
            arrows: false,
            loose: facts.verdict.is_sound(),
            areas: false,
            numbers: None,
        };
        figure(title, &stone_map(&layout, &picture), note)
    };

    let mut grid = String::new();
    grid.push_str(&shape_map(&layout, facts, None));
    grid.push_str(&component(names.along, names.along_note, 0));
    grid.push_str(&component(names.up, names.up_note, 1));
    grid.push_str(&component(names.out, names.out_note, 2));
    if let Some(picture) = distance_map(&layout, results, shared) {
        grid.push_str(&figure(names.m3c2, &picture, names.m3c2_note));
    }
    grid.push_str(&opening_map(&layout, joints, facts));
    grid.push_str(&magnitude_maps(&layout, facts));
    let wide = if layout.is_wide() { " wide" } else { "" };
    let note = if beyond > 0 {
        fill(names.beyond, &[("n", &*count(beyond))])
    } else {
        String::new()
    };

    let body = format!(
        "<p>{}{note}</p>{PLACE}{}<div class=\"maps{wide}\">{grid}</div>",
        names.intro,
        legend(names, facts.verdict.is_sound())
    );
    section("maps", texts.sections.maps, &body)
}

fn is_significant(stone: &StoneRow) -> bool {
    stone.motion.as_ref().is_some_and(|m| m.significant)
}

/// How far stones moved besides the rigid motion of the part of the wall that kept its shape; empty where that is not
/// known of any stone.
fn shape_map(layout: &MapLayout, facts: &Summary, numbers: Option<&[u32]>) -> String {
    let length = |s: &StoneRow| Some(s.motion.as_ref()?.deformation()?.norm());
    let lengths = || {
        facts
            .measured
            .iter()
            .filter_map(|(_, m)| Some(m.deformation()?.norm()))
    };

    if lengths().next().is_none() {
        return String::new();
    }
    let (names, is_sound) = (&facts.texts.maps, facts.verdict.is_sound());
    let picture = MapPicture {
        title: names.shape,
        value: &length,
        unit: "mm",
        scale: Scale::Sequential(nice_scale_m(lengths())),
        strong: is_sound.then_some(|s| s.zone_id > 0),
        arrows: false,
        loose: false,
        areas: is_sound,
        numbers,
    };
    let marks = if is_sound { names.shape_faded } else { "" };

    figure(
        names.shape,
        &stone_map(layout, &picture),
        &format!("{}{marks}", names.shape_note),
    )
}

/// The first picture: how far stones moved, or, where the datum is unknown, how the wall changed its shape.
pub(super) fn lead_map(results: &ResultSet, facts: &Summary) -> String {
    if facts.verdict.has_datum() {
        return motion_map(results, facts);
    }
    let layout = MapLayout::new(results, facts.texts);
    let class = if layout.is_wide() { "lead wide" } else { "lead" };
    match shape_map(&layout, facts, Some(&named(&facts.verdict))) {
        shape if shape.is_empty() => motion_map(results, facts),
        shape => format!("<div class=\"{class}\">{shape}</div>"),
    }
}

/// How joints open and close; empty where no joint has both its stones measured.
fn opening_map(layout: &MapLayout, joints: &[Joint], facts: &Summary) -> String {
    let names = &facts.texts.maps;
    let is_sound = facts.verdict.is_sound();
    let moved: Vec<_> = joints
        .iter()
        .filter_map(|j| {
            j.motion
                .map(|m| (j.line, m.opening_m, !is_sound || m.is_significant()))
        })
        .collect();
    if moved.is_empty() {
        return String::new();
    }
    let scale = Scale::Diverging(nice_scale_m(moved.iter().map(|(_, opening, _)| opening.abs())));
    let title = names.opening;
    let faded = if is_sound { names.opening_faded } else { "" };
    figure(
        title,
        &joint_map(layout, title, &moved, scale),
        &format!("{}{faded}", names.opening_note),
    )
}

/// How far the stones moved, for the summary: lengths and in-plane arrows.
fn motion_map(results: &ResultSet, facts: &Summary) -> String {
    let layout = MapLayout::new(results, facts.texts);
    let norm = |s: &StoneRow| s.motion.as_ref().map(|m| m.displacement.norm());
    let norms = facts.measured.iter().map(|(_, m)| m.displacement.norm());
    let page = &facts.texts.page;
    let title = page.map_title;
    let is_sound = facts.verdict.is_sound();
    let end_m = nice_scale_m(norms);
    let numbers = named(&facts.verdict);
    let picture = MapPicture {
        title,
        value: &norm,
        unit: "mm",
        scale: Scale::Sequential(end_m),
        strong: is_sound.then_some(is_significant),
        arrows: true,
        loose: false,
        areas: is_sound,
        numbers: Some(&numbers),
    };

    let class = if layout.is_wide() { "lead wide" } else { "lead" };
    let as_measured = match facts.verdict.has_datum() {
        true => "",
        false => page.map_as_measured,
    };
    let marks = if is_sound {
        page.map_note
    } else {
        page.map_note_in_doubt
    };
    let colours = fill(page.map_colours, &[("end", &*facts.texts.threshold(end_m * 1e3))]);

    let areas = match is_sound && facts.measured.iter().any(|(s, _)| s.zone_id > 0) {
        true => page.map_zones,
        false => "",
    };
    let note = format!("{colours}{marks}{areas}{as_measured}");
    format!(
        "<div class=\"{class}\">{}</div>",
        figure(title, &stone_map(&layout, &picture), &note)
    )
}

fn magnitude_maps(layout: &MapLayout, facts: &Summary) -> String {
    let texts = facts.texts;
    let names = &texts.maps;
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
            strong: None,
            arrows: false,
            loose: loose && facts.verdict.is_sound(),
            areas: false,
            numbers: None,
        };
        figure(title, &stone_map(layout, &picture), note)
    };

    let mut out = String::new();
    out.push_str(&draw(
        names.relative,
        names.relative_note,
        &relative,
        "mm",
        nice_scale_m(relatives),
        true,
    ));

    if facts.verdict.is_sound() {
        let median = texts.mm_or_dash(facts.limits.median());
        let note = fill(names.limit_note, &[("median", &*median)]);
        out.push_str(&draw(
            names.limit,
            &note,
            &limit,
            "mm",
            nice_scale_m(limits),
            false,
        ));
    }

    out.push_str(&draw(
        names.rotation,
        names.rotation_note,
        &turn,
        "mrad",
        nice_scale_m(turns),
        true,
    ));
    out
}
