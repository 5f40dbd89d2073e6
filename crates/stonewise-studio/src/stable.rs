//! Stable areas that a person draws on the face of the wall, as the project file holds them.

use crate::wall::wall_of;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;
use stonewise::nalgebra::{Point2, Point3, Vector3};
use stonewise::results::{Facade, ResultSet};
use stonewise::{Error, Result, StableArea};

/// What lies within this much of each other, out of the face, is one surface, metres: more than the relief of
/// rubble masonry.
const SURFACE_M: f64 = 0.6;
/// Places of a surface from which an area can be made.
const LEAST_PLACES: usize = 10;
/// Margins in front of the surface and behind it, metres.
const MARGINS: [f64; 2] = [0.01, 10.0];
/// Longest name, characters.
const LONGEST_NAME: usize = 200;
/// Lengths are written to a millimetre.
const PER_METRE: f64 = 1e3;

/// `POST /stable`: a rectangle on the face whose surface did not move.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewStable {
    /// What people call it; may be empty.
    pub name: String,
    /// Two opposite corners on the unrolled wall, `[along_m, up_m]`.
    pub corners: [[f64; 2]; 2],
    /// How far the area reaches in front of the surface and behind it, metres.
    pub margin_m: f64,
}

/// A stable area of the project file.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct StableShown {
    /// What people call it; may be empty.
    pub name: String,
    /// The rectangle that it fills on the unrolled wall, two opposite corners, metres; absent without results.
    pub corners: Option<[[f64; 2]; 2]>,
    /// Its edges along x, y and z of the world, metres.
    pub size_m: [f64; 3],
}

/// The stable areas of a project file's values, on the wall of these results.
pub fn shown(values: &Value, results: &Path) -> Vec<StableShown> {
    let areas = values.pointer("/registration/stable").and_then(Value::as_array);
    let Some(areas) = areas.filter(|areas| !areas.is_empty()) else {
        return Vec::new();
    };
    let wall = wall_of(results).ok();
    areas.iter().map(|area| shown_area(area, wall.as_ref())).collect()
}

fn shown_area(area: &Value, wall: Option<&Facade>) -> StableShown {
    let area: Option<StableArea> = StableArea::deserialize(area).ok();
    let corners: Vec<Point3<f64>> = area.iter().flat_map(StableArea::corners).collect();
    let edge = |axis: usize| {
        let [low, high] = span(corners.iter().map(|corner| corner[axis])).unwrap_or_default();
        high - low
    };
    let on_wall: Vec<Point2<f64>> = wall.map_or(Vec::new(), |w| corners.iter().map(|c| w.place(c)).collect());
    let along = span(on_wall.iter().map(|p| p.x));
    let up = span(on_wall.iter().map(|p| p.y));
    let name = area.as_ref().and_then(StableArea::name);
    StableShown {
        name: name.unwrap_or_default().to_owned(),
        corners: along
            .zip(up)
            .map(|([left, right], [low, high])| [[left, low], [right, high]]),
        size_m: [0, 1, 2].map(edge),
    }
}

/// The area as the project file holds it: seen from above a rectangle along the wall, around the surface that the
/// results show within the rectangle of the face.
///
/// # Errors
/// Nothing that can be an area was drawn, there are no results, or they show too little of a surface there.
pub fn area(results: &Path, new: &NewStable) -> Result<Value> {
    let [least, most] = MARGINS;
    if !(least..=most).contains(&new.margin_m) {
        let message = format!("the margin must lie between {least} m and {most} m");
        return Err(Error::Parameters(message));
    }
    if new.name.chars().count() > LONGEST_NAME {
        let message = format!("the name is longer than {LONGEST_NAME} characters");
        return Err(Error::Parameters(message));
    }
    let set = ResultSet::read_measured(results, 1)?;
    let core = set.distances.iter().map(|d| d.position);
    let places = core.chain(set.without_distance.iter().copied());
    let outlines = set.outlines.values().flat_map(|o| o.ring.iter().copied());
    around(&set.facade, places.chain(outlines), new)
}

fn around(wall: &Facade, places: impl Iterator<Item = Point3<f64>>, new: &NewStable) -> Result<Value> {
    let few = || {
        Error::Parameters(
            "the survey shows too little of a surface there: draw a larger rectangle on what both epochs show"
                .to_owned(),
        )
    };

    let [first, second] = new.corners.map(Point2::from);
    let (low, high) = (first.inf(&second), first.sup(&second));
    let is_inside = |p: &Point3<f64>| {
        let at = wall.place(p);
        (low.x..=high.x).contains(&at.x) && (low.y..=high.y).contains(&at.y)
    };
    let inside: Vec<Point3<f64>> = places.filter(is_inside).collect();
    let from_middle = |p: &Point3<f64>| (wall.place(p) - (low + (high - low) / 2.0)).norm();
    let middle = inside
        .iter()
        .min_by(|a, b| from_middle(a).total_cmp(&from_middle(b)));
    let middle = *middle.ok_or_else(few)?;
    let frame = wall.frame_at(&middle);
    let surface = densest(inside, |p| (p - middle).dot(&frame.out));

    if surface.len() < LEAST_PLACES {
        return Err(few());
    }
    let ahead = Vector3::new(frame.out.x, frame.out.y, 0.0).normalize();
    let across = |direction: Vector3<f64>| span(surface.iter().map(|p| (p - middle).dot(&direction)));
    let (Some([left, right]), Some([back, front])) = (across(frame.along), across(ahead)) else {
        return Err(few());
    };
    let Some([bottom, top]) = span(surface.iter().map(|p| p.z)) else {
        return Err(few());
    };

    // Rounding must not leave a place outside.
    let (left, right) = (left - 1.0 / PER_METRE, right + 1.0 / PER_METRE);
    let (back, front) = (back - new.margin_m, front + new.margin_m);
    let corner = |(a, o): (f64, f64)| {
        let p = middle + frame.along * a + ahead * o;
        [p.x, p.y].map(|v| (v * PER_METRE).round() / PER_METRE)
    };
    let polygon = [(left, back), (right, back), (right, front), (left, front)].map(corner);
    let z = [
        (bottom * PER_METRE).floor() / PER_METRE,
        (top * PER_METRE).ceil() / PER_METRE,
    ];
    let name = Some(new.name.trim()).filter(|name| !name.is_empty());
    Ok(json!({ "name": name, "polygon": polygon, "z": z }))
}

/// The places of the surface at which most of them lie.
fn densest(places: Vec<Point3<f64>>, depth: impl Fn(&Point3<f64>) -> f64) -> Vec<Point3<f64>> {
    let mut by_depth: Vec<(f64, Point3<f64>)> = places.into_iter().map(|p| (depth(&p), p)).collect();
    by_depth.sort_by(|a, b| a.0.total_cmp(&b.0));
    let end =
        |start: usize| start + by_depth[start..].partition_point(|p| p.0 <= by_depth[start].0 + SURFACE_M);
    let starts = 0..by_depth.len();
    let best = starts
        .map(|start| start..end(start))
        .max_by_key(ExactSizeIterator::len);
    best.map_or(Vec::new(), |range| by_depth[range].iter().map(|p| p.1).collect())
}

/// The smallest and the largest value.
fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |span, v| match span {
        Some([low, high]) => Some([f64::min(low, v), f64::max(high, v)]),
        None => Some([v, v]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall that turns by 60 degrees on a radius of 20 m and leans by 0.1, and the ground before it.
    fn wall() -> (Facade, Vec<Point3<f64>>, Vec<Point3<f64>>) {
        let normal = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.1).normalize();
        let place = |angle: f64, z: f64, out: f64| {
            let level = Vector3::new(angle.cos(), angle.sin(), 0.0);
            Point3::new(500.0, 700.0, 40.0) + level * (20.0 - 0.1 * z + out) + Vector3::z() * z
        };
        let grid = |rows: u32, step: f64| {
            (0..400).flat_map(move |i| (0..rows).map(move |k| (f64::from(i) / 400.0, f64::from(k) * step)))
        };
        // Relief of up to 10 cm.
        let face = |(i, z): (f64, f64)| place(i, z, 0.1 * (37.0 * i + 5.0 * z).sin());
        let stones: Vec<_> = grid(10, 0.4).map(|at| (face(at), normal(at.0))).collect();
        let places = grid(80, 0.05).map(face).collect();
        let ground = grid(80, 0.05).map(|(i, far)| place(i, 0.3, 1.0 + far)).collect();
        (Facade::new(&stones), places, ground)
    }

    #[test]
    fn an_area_holds_the_surface_in_the_rectangle_and_neither_ground_nor_what_lies_beside_it() {
        let (wall, places, ground) = wall();
        let new = NewStable {
            name: " gate ".to_owned(),
            corners: [[6.0, 2.0], [4.0, 0.2]],
            margin_m: 0.2,
        };
        let all = || places.iter().chain(&ground).copied();
        let made = around(&wall, all(), &new).unwrap();
        assert_eq!(made["name"], "gate");
        let read: StableArea = serde_json::from_value(made.clone()).unwrap();
        let is_drawn = |p: &&Point3<f64>| {
            let at = wall.place(p);
            (4.0..=6.0).contains(&at.x) && (0.2..=2.0).contains(&at.y)
        };
        assert!(places.iter().filter(is_drawn).count() > 500);
        assert!(places.iter().filter(is_drawn).all(|p| read.contains(p)));
        assert!(!ground.iter().any(|p| read.contains(p)));
        let beside = |p: &Point3<f64>| {
            let at = wall.place(p);
            at.x < 3.8 || at.x > 6.2 || at.y < 0.1 || at.y > 2.1
        };
        assert!(!places.iter().any(|p| beside(p) && read.contains(p)));
        // What is drawn comes back.
        let [[left, low], [right, high]] = shown_area(&made, Some(&wall)).corners.unwrap();
        for (found, drawn) in [(left, 4.0), (right, 6.0), (low, 0.2), (high, 2.0)] {
            assert!((found - drawn).abs() < 0.15, "{found} {drawn}");
        }
    }

    #[test]
    fn where_nothing_is_no_area_can_be_made() {
        let (wall, places, _) = wall();
        let new = |corners, margin_m| NewStable {
            name: String::new(),
            corners,
            margin_m,
        };
        let beyond = around(&wall, places.into_iter(), &new([[90.0, 0.0], [95.0, 2.0]], 0.2));
        assert!(
            beyond
                .unwrap_err()
                .to_string()
                .contains("too little of a surface")
        );
        let nowhere = Path::new("no such results");
        for margin_m in [0.0, -1.0, f64::NAN, 11.0] {
            let error = area(nowhere, &new([[0.0; 2], [1.0; 2]], margin_m)).unwrap_err();
            assert!(error.to_string().contains("margin"), "{margin_m}");
        }
    }

    #[test]
    fn boxes_and_polygons_have_their_size_without_a_wall() {
        let values = json!({ "registration": { "stable": [
            { "corners": [[2.0, -3.0, -0.2], [4.5, 1.0, 2.6]] },
            { "name": "ramp", "polygon": [[6.0, -2.0], [9.0, -2.0], [9.0, 2.5]], "z": [-0.5, 0.5] },
        ] } });
        let areas = shown(&values, Path::new("no such results"));
        assert_eq!(
            areas.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(),
            ["", "ramp"]
        );
        for (area, size) in areas.iter().zip([[2.5, 4.0, 2.8], [3.0, 4.5, 1.0]]) {
            assert!(
                (0..3).all(|i| (area.size_m[i] - size[i]).abs() < 1e-12),
                "{area:?}"
            );
            assert_eq!(area.corners, None);
        }
    }
}
