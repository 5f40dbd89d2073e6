//! Points by their true stone, and what the estimators take of them.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::{Bounds, Plane};
use stonewise_core::id::StoneId;
use stonewise_core::registration::observers::{SeenStone, SourcePoints};
use stonewise_core::registration::{NearPoint, PairPoints, local_shifts, stone_points};

/// Points that a stone needs in each epoch.
const LEAST_POINTS: usize = 10;
/// Around a stone, metres: points of others at its border.
const AROUND_M: f64 = 0.02;

/// A measured point.
#[derive(Clone, Copy)]
pub struct SurveyPoint {
    pub place: Point3<f64>,
    /// Station or strip, as the survey numbers them.
    pub source: usize,
    pub time_s: f64,
}

/// Points by stone; 0 holds what is no stone.
pub type Points = BTreeMap<u32, Vec<SurveyPoint>>;

/// Centre of gravity.
pub fn mean(points: &[SurveyPoint]) -> Point3<f64> {
    (points.iter().map(|p| p.place.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64).into()
}

/// Normal of the plane through points, on the side of `outward`.
fn face_normal(points: &[SurveyPoint], outward: &Vector3<f64>) -> Option<Vector3<f64>> {
    let places: Vec<Point3<f64>> = points.iter().map(|p| p.place).collect();
    let normal = Plane::fit(&places)?.normal;
    Some(normal * normal.dot(outward).signum())
}

/// Pairs of the same stone in both epochs, for the estimators.
///
/// `outward`: roughly the normal of a stone; `None` leaves it out. Near the border of a stone points are chosen
/// as in a run, within `border_noises` noise levels.
pub fn pairs(
    epochs: &[Points; 2],
    outward: impl Fn(u32) -> Option<Vector3<f64>> + Sync,
    border_noises: f64,
) -> Vec<PairPoints> {
    let [first, second] = epochs;
    let is_shown = |id: &u32| {
        let has_points = |e: &Points| e.get(id).is_some_and(|p| p.len() >= LEAST_POINTS);
        *id > 0 && epochs.iter().all(has_points)
    };
    let ids: Vec<u32> = first.keys().copied().filter(is_shown).collect();
    let moved: Vec<(Point3<f64>, Vector3<f64>)> = ids
        .iter()
        .map(|id| (mean(&first[id]), mean(&second[id]) - mean(&first[id])))
        .collect();
    let bounds = epochs.each_ref().map(|stones| {
        let of = |(id, own): (&u32, &Vec<SurveyPoint>)| Some((*id, Bounds::of(own.iter().map(|p| p.place))?));
        stones.iter().filter_map(of).collect::<BTreeMap<u32, Bounds>>()
    });
    // A stone's points, and those of others at its place, moved by `shift`.
    let near = |epoch: usize, id: u32, centroid: &Point3<f64>, shift: &Vector3<f64>| -> Vec<NearPoint> {
        let place = bounds[0][&id].grown(AROUND_M).moved(shift);
        bounds[epoch]
            .iter()
            .filter(|(k, of_stone)| **k == id || of_stone.intersects(&place))
            .flat_map(|(k, _)| epochs[epoch][k].iter().map(move |p| (*k == id, p)))
            .filter(|(labelled, p)| *labelled || place.contains(&p.place))
            .map(|(labelled, p)| NearPoint {
                offset: (p.place - centroid).cast::<f32>().into(),
                labelled,
                source: p.source as u32,
            })
            .collect()
    };
    let pair = |(k, shift): (usize, &Vector3<f64>)| {
        let (id, centroid) = (ids[k], moved[k].0);
        let normal = face_normal(&first[&id], &outward(id)?)?;
        let one = near(0, id, &centroid, &Vector3::zeros());
        let two = near(1, id, &centroid, shift);
        let chosen = stone_points([&one, &two], &normal, shift, border_noises);
        Some(PairPoints {
            first: StoneId(id),
            second: StoneId(id),
            centroid,
            centroid_second: mean(&second[&id]),
            normal,
            points_first: Cloud::new(centroid, chosen.first),
            points_second: Cloud::new(centroid, chosen.second),
            nearby_second: Cloud::new(centroid, chosen.nearby_second),
            window: chosen.window.map(Arc::new),
        })
    };
    local_shifts(&moved)
        .par_iter()
        .enumerate()
        .filter_map(pair)
        .collect()
}

/// A stone as the sources of both epochs show it. `number`: of a source among all, from its epoch and its own.
pub fn seen_stone(
    epochs: &[Points; 2],
    id: u32,
    outward: &Vector3<f64>,
    number: impl Fn(usize, usize) -> usize,
) -> Option<SeenStone> {
    let first = &epochs[0][&id];
    let centroid = mean(first);
    let mut sights: BTreeMap<usize, Vec<&SurveyPoint>> = BTreeMap::new();
    for (epoch, points) in epochs.iter().enumerate() {
        for p in &points[&id] {
            sights.entry(number(epoch, p.source)).or_default().push(p);
        }
    }
    let sight = |(source, points): (usize, Vec<&SurveyPoint>)| SourcePoints {
        source,
        count: points.len() as u64,
        time_s: points.iter().map(|p| p.time_s).sum::<f64>() / points.len() as f64,
        points: Cloud::from_world(centroid, points.iter().map(|p| p.place)),
    };
    Some(SeenStone {
        centroid,
        normal: face_normal(first, outward)?,
        sights: sights.into_iter().map(sight).collect(),
    })
}
