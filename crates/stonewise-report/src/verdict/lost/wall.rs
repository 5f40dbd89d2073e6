//! What M3C2 shows of the wall as a whole.

use nalgebra::{Point2, Point3};
use stonewise_core::cloud::GridIndex;
use stonewise_results::{ResultSet, Sorted, StoneRow, compare};

/// The stones whose median distance is that of the wall around a place.
const NEIGHBOURS: usize = 8;
/// Stones farther away than this say nothing about the wall around a place, metres.
const REACH_M: f64 = 100.0;

/// What the cylinder of a core point holds of the later epoch.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    pub distance_m: f64,
    /// Points for each of the first epoch.
    pub count_ratio: f64,
}

/// The core points of M3C2, world; `None`: one whose cylinder holds nothing of the later epoch.
pub(super) fn core_points(results: &ResultSet) -> impl Iterator<Item = (Point3<f64>, Option<Seen>)> + '_ {
    let with = results.distances.iter().map(|p| {
        let seen = Seen {
            distance_m: p.distance_m,
            count_ratio: p.count_ratio.unwrap_or(1.0),
        };
        (p.position, Some(seen))
    });
    with.chain(results.without_distance.iter().map(|p| (*p, None)))
}

/// The measured stones with the M3C2 distances on them, and the usual number of later points.
pub(super) struct Wall {
    /// Where the stones lie in the unrolled wall, with zero as the third coordinate.
    places: GridIndex,
    /// M3C2 distance on each stone of `places`, metres.
    distances_m: Vec<f64>,
    /// Median number of later points in a cylinder for each of the first epoch.
    pub count_ratio: f64,
}

impl Wall {
    pub(super) fn new(results: &ResultSet) -> Self {
        let on_stone = compare(results).on_stone;
        let distance = |(stone, distance_m): (&StoneRow, &Option<f64>)| {
            let motion = stone.motion.as_ref().filter(|m| !m.loose);
            let place = Point3::new(stone.along_m, stone.up_m, 0.0);
            let is_finite = place.iter().all(|v| v.is_finite());
            Some((place, motion.and(*distance_m)?)).filter(|_| is_finite)
        };
        let stones = results.stones.iter().zip(&on_stone);
        let (places, distances_m): (Vec<_>, Vec<_>) = stones.filter_map(distance).unzip();
        let ratios = core_points(results).filter_map(|(_, seen)| Some(seen?.count_ratio));
        Self {
            places: GridIndex::for_nearest(&places),
            distances_m,
            count_ratio: Sorted::new(ratios).median().unwrap_or(0.0),
        }
    }

    /// Median distance of the nearest stones, metres; zero where there is none.
    pub(super) fn distance_m(&self, centre: &Point2<f64>) -> f64 {
        let centre = Point3::new(centre.x, centre.y, 0.0);
        let nearest = self.places.nearest_k(&centre, NEIGHBOURS, REACH_M);
        let distances = nearest.into_iter().map(|(stone, _)| self.distances_m[stone]);
        Sorted::new(distances).median().unwrap_or(0.0)
    }
}
