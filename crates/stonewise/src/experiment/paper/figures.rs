//! Figures 6 to 9 of the paper from our data.

use super::case::Case;
use crate::figure::{Axis, GREY, Item, PALETTE, Plot, Ramp};
use crate::results::{ResultSet, StoneRow};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// Width of a map, pixels.
const MAP_PX: f64 = 1180.0;
/// Cells across a map of M3C2 at most.
const CELLS: f64 = 240.0;
/// Stones whose centroid lies this near to the line of a profile belong to it, metres.
const PROFILE_M: f64 = 0.35;

/// Figures 6 and 8: stones coloured by the length of their displacement, unmatched ones grey.
pub(super) fn stone_map(case: &Case, title: &str) -> Plot {
    let results = &case.results;
    let limit_mm = 1.3e3 * case.motion.field.largest_m();
    let ramp = Ramp {
        range: [0.0, limit_mm],
    };
    let rings: Vec<Vec<[f64; 2]>> = results.stones.iter().map(|row| ring(results, row)).collect();
    let mut plot = map_around(title, rings.iter().flatten(), MAP_PX, ramp);
    let colour = |row: &StoneRow| {
        let motion = row.motion.as_ref();
        motion.map_or(GREY.to_owned(), |m| ramp.colour(1e3 * m.displacement.norm()))
    };
    let areas = rings
        .into_iter()
        .zip(&results.stones)
        .map(|(ring, row)| (ring, colour(row)));
    plot.add(Item::Areas(areas.collect()));
    plot
}

/// Figure 7: the displacements in the plane, of stones and of M3C2, with the truth.
pub(super) fn translation_scatter(case: &Case) -> [Plot; 2] {
    let results = &case.results;
    let in_plane = |d: &Vector3<f64>, at: &Point3<f64>| {
        let frame = results.facade.frame_at(at);
        [1e3 * d.dot(&frame.along), 1e3 * d.dot(&frame.up)]
    };
    let moved = results.stones.iter().filter_map(|row| {
        let motion = row.motion.as_ref()?;
        Some(in_plane(&motion.displacement, &row.centroid))
    });
    let core = results.distances.iter().filter_map(|p| {
        let displacement = p.normal? * p.distance_m;
        Some(in_plane(&displacement, &p.position))
    });
    let middle = results.stones.first().map_or(Point3::origin(), |s| s.centroid);

    let truth = in_plane(&case.motion.field.displacement_at(&middle), &middle);
    let reach = 1.6e3 * case.motion.field.largest_m();
    let plot = |title: &str, points: Vec<[f64; 2]>, radius_px: f64, colour: &str| {
        let axis = |label: &str| Axis::linear(label, [-0.5 * reach, reach]);
        let mut plot = Plot::new(
            title,
            axis("along the wall (mm)"),
            axis("up the face (mm)"),
            [470.0, 470.0],
        );
        plot.add(Item::Dots {
            points: thinned(points, &plot),
            colour: colour.to_owned(),
            radius_px,
            name: String::new(),
        });
        plot.add(Item::Cross(truth));
        plot
    };

    [
        plot(
            &format!("(a) stones, {}", case.survey),
            moved.collect(),
            2.0,
            PALETTE[0],
        ),
        plot(
            &format!("(b) M3C2, {}", case.survey),
            core.collect(),
            1.2,
            PALETTE[1],
        ),
    ]
}

/// Figure 9: the place that moves, as stones and as M3C2 see it.
pub(super) fn bulge_maps(case: &Case) -> Option<[Plot; 2]> {
    let (centre, diameter_m) = case.motion.region?;
    let results = &case.results;
    let ramp = Ramp {
        range: [0.0, 1.1e3 * case.motion.field.largest_m()],
    };
    let middle = results.facade.place(&centre);
    let half = 0.7 * diameter_m;

    let map = |title: String| {
        Plot::map(
            &title,
            Axis::linear("along the wall (m)", [middle.x - half, middle.x + half]),
            Axis::linear("up the face (m)", [middle.y - half, middle.y + half]),
            560.0,
            Some((ramp, "mm".to_owned())),
        )
    };

    let near = |p: &Point3<f64>| (p - centre).norm() < 1.2 * diameter_m;
    let mut stones = map(format!("(a) stones, {}: out of the face", case.survey));
    let areas = results
        .stones
        .iter()
        .filter(|row| near(&row.centroid))
        .map(|row| {
            let colour = match &row.motion {
                Some(motion) => ramp.colour(1e3 * motion.face.z),
                None => GREY.to_owned(),
            };
            (ring(results, row), colour)
        });
    stones.add(Item::Areas(areas.collect()));

    let mut core = map(format!("(b) M3C2, {}: distance", case.survey));
    core.add(Item::Areas(cells(results, &ramp, 2.0 * half, near)));
    Some([stones, core])
}

/// The profile through the bulge, along the wall.
pub(super) fn bulge_profile(case: &Case) -> Option<Plot> {
    let (centre, diameter_m) = case.motion.region?;
    let results = &case.results;
    let middle = results.facade.place(&centre);
    let out = results.facade.frame_at(&centre).out;
    let on_line = |p: &Point3<f64>| {
        let at = results.facade.place(p);
        let off = [at.x - middle.x, at.y - middle.y];
        (off[1].abs() < PROFILE_M && off[0].abs() < 0.7 * diameter_m).then_some(off[0])
    };
    let stones: Vec<[f64; 2]> = results
        .stones
        .iter()
        .filter_map(|row| Some([on_line(&row.centroid)?, 1e3 * row.motion.as_ref()?.face.z]))
        .collect();

    let core: Vec<[f64; 2]> = results
        .distances
        .iter()
        .filter_map(|p| Some([on_line(&p.position)?, 1e3 * p.distance_m]))
        .collect();
    let along = results.facade.frame_at(&centre).along;
    let truth: Vec<[f64; 2]> = (-70..=70)
        .map(|i| {
            let x = f64::from(i) / 100.0 * diameter_m;
            let moved = case.motion.field.displacement_at(&(centre + along * x));
            [x, 1e3 * moved.dot(&out)]
        })
        .collect();
    let heights = stones.iter().chain(&truth).map(|p| p[1]);

    let mut plot = Plot::new(
        &format!("Profile through the bulge, {}", case.survey),
        Axis::linear(
            "along the wall from the centre (m)",
            [-0.7 * diameter_m, 0.7 * diameter_m],
        ),
        Axis::around("out of the face (mm)", heights, true),
        [760.0, 320.0],
    );
    let core = thinned(core, &plot);
    plot.add(Item::Dots {
        points: core,
        colour: "#e8c39e".to_owned(),
        radius_px: 1.0,
        name: "M3C2".to_owned(),
    });

    plot.add(Item::Line {
        points: truth,
        colour: "#000".to_owned(),
        dashed: true,
        marks: false,
        name: "applied".to_owned(),
    });
    plot.add(Item::Dots {
        points: stones,
        colour: PALETTE[0].to_owned(),
        radius_px: 3.0,
        name: "stones".to_owned(),
    });
    Some(plot)
}

fn ring(results: &ResultSet, row: &StoneRow) -> Vec<[f64; 2]> {
    results.unrolled(row).iter().map(|p| [p.x, p.y]).collect()
}

fn map_around<'a>(
    title: &str,
    places: impl Iterator<Item = &'a [f64; 2]> + Clone,
    width: f64,
    ramp: Ramp,
) -> Plot {
    Plot::map(
        title,
        Axis::around("along the wall (m)", places.clone().map(|p| p[0]), false),
        Axis::around("up the face (m)", places.map(|p| p[1]), false),
        width,
        Some((ramp, "mm".to_owned())),
    )
}

/// M3C2 as squares, each with the mean of its core points; `extent_m`: width of what is shown.
fn cells(
    results: &ResultSet,
    ramp: &Ramp,
    extent_m: f64,
    keep: impl Fn(&Point3<f64>) -> bool,
) -> Vec<(Vec<[f64; 2]>, String)> {
    let size = (extent_m / CELLS).max(0.06);
    let mut sums: BTreeMap<[i64; 2], (f64, f64)> = BTreeMap::new();
    for point in results.distances.iter().filter(|p| keep(&p.position)) {
        let at = results.facade.place(&point.position);
        let sum = sums
            .entry([at.x, at.y].map(|v| (v / size).floor() as i64))
            .or_default();
        *sum = (sum.0 + point.distance_m, sum.1 + 1.0);
    }
    sums.into_iter()
        .map(|(cell, (sum, count))| {
            let [x, y] = cell.map(|c| c as f64 * size);
            let square = vec![[x, y], [x + size, y], [x + size, y + size], [x, y + size]];
            (square, ramp.colour(1e3 * sum / count))
        })
        .collect()
}

/// One of all points that would be drawn in the same half pixel.
fn thinned(points: Vec<[f64; 2]>, plot: &Plot) -> Vec<[f64; 2]> {
    let key = |p: &[f64; 2]| {
        let place = [
            plot.x.share(p[0]) * plot.size[0],
            plot.y.share(p[1]) * plot.size[1],
        ];
        place.map(|v| (2.0 * v).round() as i64)
    };
    let unique: BTreeMap<[i64; 2], [f64; 2]> = points.into_iter().map(|p| (key(&p), p)).collect();
    unique.into_values().collect()
}
