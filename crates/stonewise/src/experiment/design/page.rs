//! The page of a prediction.

use super::expected::{Design, Foreseen};
use crate::experiment::baseline::Baseline;
use crate::experiment::predicted::in_table;
use crate::experiment::tables::TextTable;
use crate::figure::{Axis, GREY, Item, Page, Plot, Ramp, number};
use stonewise_core::registration::ZONE_EXTENTS_M;

/// Width of the map, pixels.
const MAP_PX: f64 = 900.0;

/// The page: what the next survey will see, then the wall as the first shows it.
pub(super) fn page(design: &Design, stones: &[Foreseen]) -> String {
    let mut page = Page::new("What the next survey will see");
    let [found, measured] = design.stones;
    page.note(&format!(
        "If the survey {:?} is repeated with as many stations and points: {measured} of {found} stones will be measured. \
         Registration: {}. Medians over these stones, millimetres, one standard deviation.",
        design.epoch, design.datum
    ));
    let sources = design.sources;
    let more = format!(
        "motion with {} instead of {sources} stations or strips",
        sources + 1
    );
    let rows = [
        ("motion", design.sd_mm),
        ("deformation", design.sd_deformation_mm),
        (&more, design.sd_with_one_more_mm),
        (
            "motion without any error of registration",
            design.sd_without_registration_mm,
        ),
    ];
    let rows = rows.map(|(name, values)| {
        let [along, up, out] = values.map(in_table);
        [name.to_owned(), along, up, out]
    });
    let deviations = TextTable::new(["standard deviation, mm", "along", "up", "out"], rows.into());
    page.html(&deviations.html(None));
    let zone = |i: usize| {
        let [out, in_face] = [design.zones_mm[i], design.zones_in_face_mm[i]].map(in_table);
        [format!("{} m", ZONE_EXTENTS_M[i]), out, in_face]
    };
    let zones = TextTable::new(
        ["extent", "out of the wall, mm", "in the face, mm"],
        [0, 1, 2].map(zone).into(),
    );
    page.heading("Smallest motion of a zone that is found in 95 of 100 cases")
        .html(&zones.html(None));
    page.heading("Stones").html(&map(stones));
    page.heading("The wall at the first survey")
        .html(&wall(&design.baseline).html(None));
    page.finish()
}

/// Every stone in the colour of its expected standard deviation. That of the deformation: what all stones share of the
/// registration would hide the differences.
fn map(stones: &[Foreseen]) -> String {
    let corners = || stones.iter().flat_map(|s| &s.stone.ring);
    let out_mm = |s: &Foreseen| { s.expected.as_ref() }.map(|e| 1e3 * e.deformation[2].unwrap_or(e.sd[2]));
    let largest = { stones.iter().filter_map(out_mm) }.fold(0.0, f64::max);
    let ramp = Ramp {
        range: [0.0, if largest > 0.0 { largest } else { 1.0 }],
    };
    let mut map = Plot::map(
        "standard deviation of the deformation out of the wall; grey: not measured",
        Axis::around("along the wall (m)", corners().map(|p| p.x), false),
        Axis::around("up the face (m)", corners().map(|p| p.y), false),
        MAP_PX,
        Some((ramp, "mm".to_owned())),
    );
    let area = |s: &Foreseen| {
        let colour = out_mm(s).map_or(GREY.to_owned(), |mm| ramp.colour(mm));
        (s.stone.ring.iter().map(|p| [p.x, p.y]).collect(), colour)
    };
    map.add(Item::Areas(stones.iter().map(area).collect()));
    map.svg()
}

fn wall(wall: &Baseline) -> TextTable {
    let range = |values: Option<[f64; 3]>, decimals: usize| {
        let [low, middle, high] = values.unwrap_or([f64::NAN; 3]).map(|v| number(v, decimals));
        format!("{middle} ({low} to {high})")
    };
    let extent = |size: Option<[f64; 2]>, decimals: usize| {
        let [width, height] = size.unwrap_or([f64::NAN; 2]).map(|v| number(v, decimals));
        format!("{width} x {height} m")
    };
    let coverage = &wall.coverage;
    let mut rows = vec![
        ("stones", wall.stones.to_string()),
        (
            "area of a stone's face, m\u{b2}: median (5 to 95 %)",
            range(wall.area_m2, 3),
        ),
        ("median stone, width x height", extent(wall.size_m, 2)),
        (
            "joints, width in mm: median (5 to 95 %)",
            format!("{}: {}", wall.joints, range(wall.joint_mm, 0)),
        ),
        (
            "face between the outermost stones",
            format!(
                "{}, {:.1} m\u{b2}",
                extent(Some(wall.extent_m), 1),
                coverage.face_m2
            ),
        ),
        (
            "covered by stones and their joints",
            format!("{:.1} %", 100.0 * coverage.covered),
        ),
        (
            "surveyed, but without stones",
            format!("{:.1} %", 100.0 * coverage.without_stones),
        ),
    ];
    if let Some(shape) = &wall.shape {
        let batter = format!("{:.3} \u{b1} {:.3}", shape.batter, 1.96 * shape.batter_sd);
        rows.push(("batter, horizontal for each metre of height", batter));
        let plan = match shape.radius_m {
            Some(radius) if radius > 0.0 => format!("hollow, radius {radius:.1} m"),
            Some(radius) => format!("vaulted, radius {:.1} m", -radius),
            None => "straight, as far as the stones show it".to_owned(),
        };
        rows.push(("plan", plan));
        let relief = format!("{} mm", number(wall.relief_mm.unwrap_or(f64::NAN), 0));
        rows.push(("middles of the stones about that face, rms", relief));
    }
    let rows = rows.into_iter().map(|(name, value)| [name.to_owned(), value]);
    TextTable::new(["", ""], rows.collect())
}
