//! Figures 6 to 9 of the paper from our data.

use super::case::{Case, Method, file_name};
use crate::figure::{Axis, GREY, Item, PALETTE, Plot, Ramp};
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeMap;

/// Width of a map, pixels.
const MAP_PX: f64 = 1180.0;
/// Edge of the squares of a map of M3C2, metres.
const CELL_M: f64 = 0.06;
/// Stones whose centroid lies this near to the line of a profile belong to it, metres.
const PROFILE_M: f64 = 0.35;

/// The figures of one run: name of the file, caption, picture.
pub(super) fn figures(case: &Case) -> Vec<(String, String, Plot)> {
    let with_m3c2 = case.method == Method::Ours;
    let plots: Vec<(&str, &str, Plot)> = match case.motion.region {
        None => {
            let frame = |at: &Point3<f64>| case.results.facade.frame_at(at);
            let in_plane = |d: &Vector3<f64>, at: &Point3<f64>| {
                let frame = frame(at);
                [1e3 * d.dot(&frame.along), 1e3 * d.dot(&frame.up)]
            };
            let stones = { case.results.measured().into_iter() }
                .map(|(row, motion)| in_plane(&motion.displacement, &row.centroid));
            let core = { case.results.distances.iter() }
                .filter_map(|p| Some(in_plane(&(p.normal? * p.distance_m), &p.position)));
            let middle = case
                .results
                .stones
                .first()
                .map_or(Point3::origin(), |s| s.centroid);
            let truth = in_plane(&case.motion.field.displacement_at(&middle), &middle);
            let reach = 1.6e3 * case.motion.field.largest_m();
            let scatter = |title: &str, points: Vec<[f64; 2]>, colour: &str| {
                let axis = |label: &str| Axis::linear(label, [-0.5 * reach, reach]);
                let mut plot = Plot::new(
                    title,
                    axis("along the wall (mm)"),
                    axis("up the face (mm)"),
                    [470.0, 470.0],
                );
                let points = thinned(points, &plot);
                plot.add(dots(points, colour, 1.5, "")).add(Item::Cross(truth));
                plot
            };
            let mut plots = vec![
                ("6", "translation", stone_map(case, None)),
                (
                    "7a",
                    "translation",
                    scatter("(a) stones", stones.collect(), PALETTE[0]),
                ),
            ];
            if with_m3c2 {
                plots.push((
                    "7b",
                    "translation",
                    scatter("(b) M3C2", core.collect(), PALETTE[1]),
                ));
            }
            plots
        }
        Some(region) => {
            let mut plots = vec![
                ("8", "bulge", stone_map(case, None)),
                ("9a", "bulge", stone_map(case, Some(region))),
            ];
            if with_m3c2 {
                plots.push(("9b", "bulge", m3c2_map(case, region)));
            }
            plots.push(("9c", "profile through the bulge", profile(case, region)));
            plots
        }
    };
    let who = format!("{}, {}", case.survey, case.method.name());
    let key = file_name(&format!("{}-{}", case.survey, case.method.folder()));
    let named = |(number, what, plot): (&str, &str, Plot)| {
        let caption = format!("Figure {}: {what}, {who}", &number[..1]);
        (format!("figure_{number}-{key}"), caption, plot)
    };
    plots.into_iter().map(named).collect()
}

fn dots(points: Vec<[f64; 2]>, colour: &str, radius_px: f64, name: &str) -> Item {
    Item::Dots {
        points,
        colour: colour.to_owned(),
        radius_px,
        name: name.to_owned(),
    }
}

/// An empty map of all of the wall, or of a place and its surroundings, and its colours.
fn map(case: &Case, title: &str, region: Option<(Point3<f64>, f64)>) -> (Plot, Ramp) {
    let ramp = Ramp {
        range: [0.0, 1.2e3 * case.motion.field.largest_m()],
    };
    let axes = ["along the wall (m)", "up the face (m)"];
    let [x, y] = match region {
        Some((centre, diameter_m)) => {
            let (middle, half) = (case.results.facade.place(&centre), 0.7 * diameter_m);
            [0, 1].map(|i| Axis::linear(axes[i], [middle[i] - half, middle[i] + half]))
        }
        None => {
            let corners: Vec<Point2<f64>> = { case.results.stones.iter() }
                .flat_map(|row| case.results.unrolled(row))
                .collect();
            [0, 1].map(|i| Axis::around(axes[i], corners.iter().map(|p| p[i]), false))
        }
    };
    let width_px = if region.is_some() { 560.0 } else { MAP_PX };
    (
        Plot::map(title, x, y, width_px, Some((ramp, "mm".to_owned()))),
        ramp,
    )
}

/// Figures 6, 8 and 9: stones coloured by the length of their displacement, unmatched ones grey.
fn stone_map(case: &Case, region: Option<(Point3<f64>, f64)>) -> Plot {
    let (mut plot, ramp) = map(case, "displacement of every stone; grey: no match", region);
    let area = |row| {
        let ring = case.results.unrolled(row).iter().map(|p| [p.x, p.y]).collect();
        let motion = row.motion.as_ref();
        (
            ring,
            motion.map_or(GREY.to_owned(), |m| ramp.colour(1e3 * m.displacement.norm())),
        )
    };
    plot.add(Item::Areas(case.results.stones.iter().map(area).collect()));
    plot
}

/// Figure 9: M3C2 as squares around a place, each with the mean of its core points.
fn m3c2_map(case: &Case, region: (Point3<f64>, f64)) -> Plot {
    let (mut plot, ramp) = map(case, "distances of M3C2", Some(region));
    let mut sums: BTreeMap<[i64; 2], (f64, f64)> = BTreeMap::new();
    let near = { case.results.distances.iter() }.filter(|p| (p.position - region.0).norm() < 1.2 * region.1);
    for point in near {
        let at = case.results.facade.place(&point.position);
        let (sum, count) = sums
            .entry([at.x, at.y].map(|v| (v / CELL_M).floor() as i64))
            .or_default();
        *sum += point.distance_m;
        *count += 1.0;
    }
    let square = |([i, j], (sum, count)): ([i64; 2], (f64, f64))| {
        let corner = |di: i64, dj: i64| [(i + di) as f64, (j + dj) as f64].map(|v| v * CELL_M);
        (
            vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)],
            ramp.colour(1e3 * sum / count),
        )
    };
    plot.add(Item::Areas(sums.into_iter().map(square).collect()));
    plot
}

/// The profile through the bulge, along the wall.
fn profile(case: &Case, (centre, diameter_m): (Point3<f64>, f64)) -> Plot {
    let results = &case.results;
    let (middle, frame) = (results.facade.place(&centre), results.facade.frame_at(&centre));
    let on_line = |p: &Point3<f64>| {
        let off = results.facade.place(p) - middle;
        (off.y.abs() < PROFILE_M && off.x.abs() < 0.7 * diameter_m).then_some(off.x)
    };
    let stones: Vec<[f64; 2]> = { results.measured().into_iter() }
        .filter_map(|(row, motion)| Some([on_line(&row.centroid)?, 1e3 * motion.face.z]))
        .collect();
    let core = { results.distances.iter() }
        .filter_map(|p| Some([on_line(&p.position)?, 1e3 * p.distance_m]))
        .collect();
    let truth: Vec<[f64; 2]> = (-70..=70)
        .map(|i| f64::from(i) / 100.0 * diameter_m)
        .map(|x| {
            [
                x,
                1e3 * case
                    .motion
                    .field
                    .displacement_at(&(centre + frame.along * x))
                    .dot(&frame.out),
            ]
        })
        .collect();
    let mut plot = Plot::new(
        "out of the face",
        Axis::linear(
            "along the wall from the centre (m)",
            [-0.7 * diameter_m, 0.7 * diameter_m],
        ),
        Axis::around(
            "out of the face (mm)",
            stones.iter().chain(&truth).map(|p| p[1]),
            true,
        ),
        [760.0, 320.0],
    );
    let core = thinned(core, &plot);
    plot.add(dots(core, "#e8c39e", 1.0, "M3C2"));
    plot.add(Item::Line {
        points: truth,
        colour: "#000".to_owned(),
        dashed: true,
        marks: false,
        name: "applied".to_owned(),
    });
    plot.add(dots(stones, PALETTE[0], 3.0, "stones"));
    plot
}

/// One of all points that would be drawn in the same half pixel.
fn thinned(points: Vec<[f64; 2]>, plot: &Plot) -> Vec<[f64; 2]> {
    let half_pixel = |p: &[f64; 2]| {
        let place = [
            plot.x.share(p[0]) * plot.size[0],
            plot.y.share(p[1]) * plot.size[1],
        ];
        place.map(|v| (2.0 * v).round() as i64)
    };
    let unique: BTreeMap<[i64; 2], [f64; 2]> = points.into_iter().map(|p| (half_pixel(&p), p)).collect();
    unique.into_values().collect()
}
