//! The page of a prediction.

use super::expected::{Design, Foreseen};
use crate::experiment::baseline::Baseline;
use crate::experiment::predicted::in_table;
use crate::figure::{Axis, GREY, Item, Page, Plot, Ramp, table};
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
    let row = |name: String, values: [Option<f64>; 3]| {
        std::iter::once(name)
            .chain(values.map(in_table))
            .collect::<Vec<_>>()
    };
    let rows = [
        row("motion".to_owned(), design.sd_mm),
        row("deformation".to_owned(), design.sd_deformation_mm),
        row(
            format!(
                "motion with {} instead of {} stations or strips",
                design.sources + 1,
                design.sources
            ),
            design.sd_with_one_more_mm,
        ),
        row(
            "motion without any error of registration".to_owned(),
            design.sd_without_registration_mm,
        ),
    ];

    page.html(&table(
        &["standard deviation, mm", "along", "up", "out"],
        &rows,
        None,
    ));
    let limits = design.zones_mm.iter().zip(design.zones_in_face_mm);
    let zones: Vec<Vec<String>> = { ZONE_EXTENTS_M.iter().zip(limits) }
        .map(|(extent, (out, in_face))| vec![format!("{extent} m"), in_table(*out), in_table(in_face)])
        .collect();
    page.heading("Smallest motion of a zone that is found in 95 of 100 cases")
        .html(&table(
            &["extent", "out of the wall, mm", "in the face, mm"],
            &zones,
            None,
        ));

    page.heading("Stones").html(&map(design, stones));
    show_wall(&mut page, &design.baseline);
    page.finish()
}

/// Every stone in the colour of its expected standard deviation, and the gaps. That of the deformation: what all stones
/// share of the registration would hide the differences.
fn map(design: &Design, stones: &[Foreseen]) -> String {
    let corners = |axis: usize| {
        stones
            .iter()
            .flat_map(move |s| s.stone.ring.iter().map(move |p| p[axis]))
    };
    let out_mm = |s: &Foreseen| { s.expected.as_ref() }.map(|e| 1e3 * e.deformation[2].unwrap_or(e.sd[2]));
    let largest = { stones.iter().filter_map(out_mm) }.fold(0.0, f64::max);
    let ramp = Ramp {
        range: [0.0, if largest > 0.0 { largest } else { 1.0 }],
    };
    let mut map = Plot::map(
        "standard deviation of the deformation out of the wall; grey: not measured; dashed: no stones",
        Axis::around("along the wall (m)", corners(0), false),
        Axis::around("up the face (m)", corners(1), false),
        MAP_PX,
        Some((ramp, "mm".to_owned())),
    );
    let area = |s: &Foreseen| {
        let colour = out_mm(s).map_or(GREY.to_owned(), |mm| ramp.colour(mm));
        (s.stone.ring.clone(), colour)
    };
    map.add(Item::Areas(stones.iter().map(area).collect()));
    for gap in &design.baseline.gaps {
        let corner = |i: f64, j: f64| {
            [
                gap.along_m + 0.5 * i * gap.width_m,
                gap.up_m + 0.5 * j * gap.height_m,
            ]
        };
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
        map.add(Item::Line {
            points: corners.map(|(i, j)| corner(i, j)).into(),
            colour: "#0072b2".to_owned(),
            dashed: true,
            marks: false,
            name: String::new(),
        });
    }
    map.svg()
}

fn show_wall(page: &mut Page, wall: &Baseline) {
    let range = |values: Option<[f64; 3]>, decimals: usize| {
        values.map_or("\u{2013}".to_owned(), |[low, middle, high]| {
            format!("{middle:.decimals$} ({low:.decimals$} to {high:.decimals$})")
        })
    };
    let mut rows = vec![
        vec!["stones".to_owned(), wall.stones.to_string()],
        vec![
            "area of a stone's face, m\u{b2}: median (5 to 95 %)".to_owned(),
            range(wall.area_m2, 3),
        ],
    ];
    if let Some([width, height]) = wall.size_m {
        let size = format!("{width:.2} x {height:.2} m");
        rows.push(vec!["median stone, width x height".to_owned(), size]);
    }
    rows.push(vec![
        "joints, width in mm: median (5 to 95 %)".to_owned(),
        format!("{}: {}", wall.joints, range(wall.joint_mm, 0)),
    ]);
    let [length, height] = wall.extent_m;
    rows.push(vec![
        "face between the outermost stones".to_owned(),
        format!(
            "{length:.1} m along, {height:.1} m up, {:.1} m\u{b2}",
            wall.face_m2
        ),
    ]);
    if let Some(shape) = &wall.shape {
        rows.push(vec![
            "batter, horizontal for each metre of height".to_owned(),
            format!("{:.3} \u{b1} {:.3}", shape.batter, 1.96 * shape.batter_sd),
        ]);
        let plan = match shape.radius_m {
            Some(radius) if radius > 0.0 => format!("hollow, radius {radius:.1} m"),
            Some(radius) => format!("vaulted, radius {:.1} m", -radius),
            None => "straight, as far as the stones show it".to_owned(),
        };
        rows.push(vec!["plan".to_owned(), plan]);
    }
    if let Some(relief) = wall.relief_mm {
        rows.push(vec![
            "middles of the stones about that face, rms".to_owned(),
            format!("{relief:.0} mm"),
        ]);
    }
    rows.push(vec![
        "covered by stones and their joints".to_owned(),
        format!("{:.1} %", 100.0 * wall.covered),
    ]);
    page.heading("The wall at the first survey")
        .html(&table(&["", ""], &rows, None));
    if wall.gaps.is_empty() {
        return;
    }
    let gaps: Vec<Vec<String>> = { wall.gaps.iter() }
        .map(|gap| {
            vec![
                format!("{:.1}, {:.1}", gap.along_m, gap.up_m),
                format!("{:.1} x {:.1}", gap.width_m, gap.height_m),
                format!("{:.2}", gap.area_m2),
                format!("{:.0} %", 100.0 * gap.share_with_points),
            ]
        })
        .collect();
    page.heading("Parts of the face without stones").html(&table(
        &[
            "along, up, m",
            "size, m",
            "area, m\u{b2}",
            "of it with points in the cloud",
        ],
        &gaps,
        None,
    ));
}
