//! The page of a planned survey.

use super::planned::PlannedSurvey;
use super::squares::Squares;
use crate::experiment::predicted::in_table;
use crate::experiment::tables::TextTable;
use crate::figure::{Axis, GREY, Item, Page, Plot, Ramp};
use stonewise_core::registration::ZONE_EXTENTS_M;

/// Width of a map, pixels.
const MAP_PX: f64 = 700.0;

/// The survey as planned first, then with each candidate, the best first.
pub(super) fn page(surveys: &[(PlannedSurvey, Squares)]) -> String {
    let mut page = Page::new("What the planned survey will see");
    page.note(
        "Medians over the stones of a simulated wall that stands still, one standard deviation, millimetres. The weakest \
         square is the one whose stones are measured worst; its figure is the standard deviation of their deformation in \
         space. In squares that are not seen, most stones are not measured.",
    );
    let three = |values: [Option<f64>; 3]| values.map(in_table).join(" / ");
    let zones = ZONE_EXTENTS_M.map(|m| m.to_string()).join(" / ");
    let row = |(survey, _): &(PlannedSurvey, Squares)| {
        let ([stones, measured], [squares, unseen]) = (survey.stones, survey.squares);
        let weakest =
            { survey.weakest }.map(|w| format!("{:.2} at {:.1}, {:.1} m", w.sd_mm, w.along_m, w.up_m));
        [
            { survey.added.as_ref() }.map_or("as planned".to_owned(), |name| format!("with {name}")),
            format!("{measured} of {stones}"),
            weakest.unwrap_or("\u{2013}".to_owned()),
            format!("{unseen} of {squares}"),
            three(survey.sd_mm),
            three(survey.sd_deformation_mm),
            three(survey.zones_mm),
            three(survey.zones_in_face_mm),
        ]
    };
    let head = [
        "survey",
        "stones measured",
        "weakest square",
        "squares not seen",
        "motion, along / up / out",
        "deformation, along / up / out",
        &format!("bulge of {zones} m that is found"),
        &format!("motion in the face of a zone of {zones} m"),
    ];
    page.html(&TextTable::new(head, surveys.iter().map(row).collect()).html(None));
    let all = surveys.iter().flat_map(|(_, squares)| &squares.sd_m).flatten();
    let largest = { all.filter(|sd| sd.is_finite()) }.fold(0.0, |a: f64, sd| a.max(1e3 * sd));
    let ramp = Ramp {
        range: [0.0, if largest > 0.0 { largest } else { 1.0 }],
    };
    for (survey, squares) in surveys {
        page.heading(&sources(survey)).html(&map(squares, ramp));
    }
    page.finish()
}

/// What measures, such as `Stations A, B; drone; 6 photos`.
fn sources(survey: &PlannedSurvey) -> String {
    let stations = (!survey.stations.is_empty()).then(|| format!("Stations {}", survey.stations.join(", ")));
    let drone = survey.drone.then(|| "drone".to_owned());
    let photos = (survey.photos > 0).then(|| format!("{} photos", survey.photos));
    let targets = survey.targets.then(|| "targets".to_owned());
    let all: Vec<String> = [stations, drone, photos, targets].into_iter().flatten().collect();
    all.join("; ")
}

fn map(squares: &Squares, ramp: Ramp) -> String {
    let edge = squares.edge_m;
    let end = |axis: usize| squares.size[axis] as f64 * edge;
    let mut map = Plot::map(
        "standard deviation of the deformation in space; grey: not seen",
        Axis::around("along the wall (m)", [0.0, end(0)], false),
        Axis::around("up the face (m)", [0.0, end(1)], false),
        MAP_PX,
        Some((ramp, "mm".to_owned())),
    );
    let area = |(i, sd_m): (usize, &Option<f64>)| {
        let sd_m = (*sd_m)?;
        let corner = |dx: usize, dy: usize| {
            [i % squares.size[0] + dx, i / squares.size[0] + dy].map(|v| v as f64 * edge)
        };
        let colour = if sd_m.is_finite() {
            ramp.colour(1e3 * sd_m)
        } else {
            GREY.to_owned()
        };
        Some((
            vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)],
            colour,
        ))
    };
    map.add(Item::Areas(
        squares.sd_m.iter().enumerate().filter_map(area).collect(),
    ));
    map.svg()
}
