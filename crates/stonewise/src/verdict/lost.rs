//! Stones that the later epoch shows to be gone.

use crate::results::{ResultSet, Sorted, Squares, Status, StoneRow, compare};
use nalgebra::{Point2, Vector2, distance};
use stonewise_core::change::M3c2Params;
use stonewise_core::geometry::RingIndex;

/// A stone is well seen where so many photos and points show it and its points got this share of the votes.
const WELL_SEEN_PHOTOS: u32 = 2;
const WELL_SEEN_POINTS: u32 = 100;
const WELL_SEEN_CONFIDENCE: f64 = 0.6;
/// A surface that lies this much farther back than the neighbours' motion puts it, metres, is another one:
/// less than the depth of the hole that a lost stone leaves, more than the motion of most loose ones.
const GONE_M: f64 = 0.03;
/// A cylinder with less than this share of the later points that the wall around leads to expect sees no
/// surface of its own, only the neighbours'.
const POINT_SHARE: f64 = 0.5;
/// One with less than this share only holds stray points, and sees nothing behind the stone's place either.
const STRAY_SHARE: f64 = 0.1;
/// Width of the border around a stone whose coverage tells a deep hole from a gap in the later clouds, metres.
const AROUND_M: f64 = 0.15;
/// Least share of the core points in this border that see a surface where the clouds have no gap.
const COVERED_SHARE: f64 = 0.8;
/// Share of the core points on a stone behind which the later clouds show something: then they look through
/// its place, and a gap does not explain the others.
const SEEN_THROUGH_SHARE: f64 = 0.25;
/// The neighbours whose median distance is that of the wall around a stone.
const NEIGHBOURS: usize = 8;

/// For each stone, in the order of [`ResultSet::stones`], whether the first epoch shows it well, it has no
/// partner in the later one, and M3C2 shows that its surface is gone.
///
/// The surface is gone if half of the core points on the stone see it farther back than the wall around has
/// moved, or see none. If they see none, either the cloud shows something behind a part of the stone, or the
/// wall around it is covered: otherwise the cloud has a gap, which says nothing about the stone. A stone that
/// is too small for a cylinder is not called gone. Where M3C2 has no core points in or around it, its status
/// decides.
pub(super) fn lost_stones(results: &ResultSet) -> Vec<bool> {
    let mut lost = vec![false; results.stones.len()];
    let mut places: Vec<Place> = (0..lost.len())
        .filter(|&i| is_missed(&results.stones[i]))
        .map(|i| Place::new(results, i))
        .collect();
    if places.is_empty() {
        return lost;
    }
    let mut squares = Squares::default();
    for (number, place) in places.iter().enumerate() {
        squares.add(number, &place.low, &place.high);
    }
    let with = results.distances.iter().map(|p| {
        let seen = Seen {
            distance_m: p.distance_m,
            count_ratio: p.count_ratio.unwrap_or(1.0),
        };
        (p.position, Some(seen))
    });
    let without = results.without_distance.iter().map(|p| (*p, None));
    for (position, seen) in with.chain(without) {
        let at = results.facade.place(&position);
        for &number in squares.near(&at) {
            let place = &mut places[number];
            if results.is_at_face(&results.stones[place.stone], &position) {
                place.take(&at, seen);
            }
        }
    }
    let wall = Surroundings::new(results);
    let margin_m = margin_m(results);
    for place in places {
        lost[place.stone] = match place.inside.is_empty() && place.around.is_empty() {
            true => results.stones[place.stone].status == Status::UnmatchedLost,
            false => place.is_empty(wall.distance_m(&place.centre), margin_m),
        };
    }
    lost
}

/// Whether the first epoch shows the stone well and it has no partner in the later one.
fn is_missed(stone: &StoneRow) -> bool {
    let is_unmatched = matches!(
        stone.status,
        Status::UnmatchedLost | Status::UnmatchedUnseen | Status::UnmatchedArea | Status::UnmatchedAmbiguous
    );
    is_unmatched
        && stone.photos >= WELL_SEEN_PHOTOS
        && stone.points_1 >= WELL_SEEN_POINTS
        && stone.confidence >= WELL_SEEN_CONFIDENCE
}

/// Core points nearer to the outline than this also see the neighbours, metres.
fn margin_m(results: &ResultSet) -> f64 {
    match &results.run {
        Some(run) => run.parameters.m3c2.cylinder_radius_m,
        None => M3c2Params::default().cylinder_radius_m,
    }
}

/// What the cylinder of a core point holds of the later epoch.
#[derive(Clone, Copy)]
struct Seen {
    distance_m: f64,
    /// Points for each of the first epoch.
    count_ratio: f64,
}

/// A stone's outline in the unrolled wall and the core points in and around it; `None`: one without later
/// points.
struct Place {
    stone: usize,
    centre: Point2<f64>,
    /// Corners of the box that holds the outline and the border around it.
    low: Point2<f64>,
    high: Point2<f64>,
    outline: RingIndex,
    inside: Vec<(Point2<f64>, Option<Seen>)>,
    around: Vec<Option<Seen>>,
}

impl Place {
    fn new(results: &ResultSet, stone: usize) -> Self {
        let row = &results.stones[stone];
        let ring = results.unrolled(row);
        let centre = Point2::new(row.along_m, row.up_m);
        let corner = |of: fn(&Point2<f64>, &Point2<f64>) -> Point2<f64>| {
            ring.iter().fold(centre, |corner, p| of(&corner, p))
        };
        let border = Vector2::repeat(AROUND_M);
        Self {
            stone,
            centre,
            low: corner(Point2::inf) - border,
            high: corner(Point2::sup) + border,
            outline: RingIndex::new(&[ring]),
            inside: Vec::new(),
            around: Vec::new(),
        }
    }

    fn take(&mut self, at: &Point2<f64>, seen: Option<Seen>) {
        if self.outline.contains(at) {
            self.inside.push((*at, seen));
        } else if self.outline.passes_within(AROUND_M, at) {
            self.around.push(seen);
        }
    }

    /// `wall_m`: distance of the wall around; `margin_m`: core points so far inside the outline see the stone
    /// alone; those half as far see it for the most part.
    fn is_empty(&self, wall_m: f64, margin_m: f64) -> bool {
        // Not the median: a gap may take more than half of the border.
        let ratios = self.around.iter().flatten().map(|seen| seen.count_ratio);
        let expected = Sorted::new(ratios).quantile(0.75).unwrap_or(0.0);
        let holds = |seen: &Seen, share: f64| seen.count_ratio >= share * expected;
        let is_behind = |seen: &Seen| seen.distance_m < wall_m - GONE_M;

        let points = self.inner_points(margin_m);
        let count = |is: &dyn Fn(&Seen) -> bool| points.iter().flatten().filter(|seen| is(seen)).count();
        let all = points.len();
        let behind = count(&|seen| is_behind(seen) && holds(seen, STRAY_SHARE));
        let at_wall = count(&|seen| !is_behind(seen) && holds(seen, POINT_SHARE));
        let is_seen_through = behind as f64 >= SEEN_THROUGH_SHARE * all as f64;
        let covered = self.around.iter().flatten();
        let covered = covered.filter(|seen| holds(seen, POINT_SHARE)).count();
        let is_covered = covered > 0 && covered as f64 >= COVERED_SHARE * self.around.len() as f64;
        all > 0 && 2 * at_wall <= all && (is_seen_through || is_covered)
    }

    /// The core points that lie so far inside the outline, or at least half as far.
    fn inner_points(&self, margin_m: f64) -> Vec<Option<Seen>> {
        let within = |margin: f64| -> Vec<Option<Seen>> {
            let points = self.inside.iter();
            points
                .filter(|(at, _)| !self.outline.passes_within(margin, at))
                .map(|(_, seen)| *seen)
                .collect()
        };
        let points = within(margin_m);
        match points.is_empty() {
            true => within(margin_m / 2.0),
            false => points,
        }
    }
}

/// The measured stones and the M3C2 distances on them, metres.
struct Surroundings {
    distances: Vec<(Point2<f64>, f64)>,
}

impl Surroundings {
    fn new(results: &ResultSet) -> Self {
        let on_stone = compare(results).on_stone;
        let distance = |(stone, distance_m): (&StoneRow, &Option<f64>)| {
            let motion = stone.motion.as_ref().filter(|m| !m.loose);
            Some((Point2::new(stone.along_m, stone.up_m), motion.and(*distance_m)?))
        };
        let stones = results.stones.iter().zip(&on_stone);
        Self {
            distances: stones.filter_map(distance).collect(),
        }
    }

    /// Median distance of the nearest stones; zero where there is none.
    fn distance_m(&self, centre: &Point2<f64>) -> f64 {
        let mut nearest: Vec<(f64, f64)> = self
            .distances
            .iter()
            .map(|(place, distance_m)| (distance(place, centre), *distance_m))
            .collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = nearest.into_iter().take(NEIGHBOURS);
        Sorted::new(near.map(|(_, d)| d)).median().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::testing::{folder, rows};
    use std::fmt::Write;

    /// The stone of the wall in `testing` that has no partner.
    const LOST: usize = 2;

    /// Whether the stone is lost where M3C2 has this distance at (along, up) from its centroid; its outline
    /// reaches 0.19 m along and 0.115 m up. A railing that stays stands 1 m in front.
    fn is_lost(stones: &[StoneRow], distance_m: impl Fn(f64, f64) -> Option<f64>) -> bool {
        is_lost_with(stones, |along, up| distance_m(along, up).map(|d| (d, 100)))
    }

    /// The same with the number of later points, of 100 of the first epoch.
    fn is_lost_with(stones: &[StoneRow], seen: impl Fn(f64, f64) -> Option<(f64, u32)>) -> bool {
        let folder = folder(stones);
        let centre = stones[LOST].centroid;
        let mut csv = "x,y,z,m3c2_distance,m3c2_uncertainty,m3c2_count1,m3c2_count2\n".to_owned();
        for step in 0..60 * 25 {
            let (y, z) = (
                199.0 + 0.05 * f64::from(step % 60),
                49.5 + 0.05 * f64::from(step / 60),
            );
            writeln!(csv, "101,{y},{z},0,0.002,100,100\n101.01,{y},{z},0,0.002,100,100").unwrap();
            match seen(y - centre.y, z - centre.z) {
                Some((distance_m, later)) => {
                    writeln!(csv, "100,{y},{z},{distance_m},0.002,100,{later}").unwrap()
                }
                None => writeln!(csv, "100,{y},{z},,,100,0").unwrap(),
            }
        }
        std::fs::write(folder.path().join("m3c2.csv"), csv).unwrap();
        let lost = lost_stones(&ResultSet::read_measured(folder.path(), 1).unwrap());
        assert!(lost.iter().enumerate().all(|(i, lost)| i == LOST || !lost));
        lost[LOST]
    }

    /// Whether a place is so far inside the stone's outline, metres (negative: outside).
    fn is_inside(margin: f64, along: f64, up: f64) -> bool {
        along.abs() < 0.19 - margin && up.abs() < 0.115 - margin
    }

    #[test]
    fn a_stone_is_lost_where_the_later_cloud_shows_a_hole_of_its_shape() {
        let stones = rows();
        let hole = |wall: f64, depth: Option<f64>, margin: f64| {
            is_lost(&stones, |along, up| match is_inside(margin, along, up) {
                true => depth,
                false => Some(wall),
            })
        };
        assert!(hole(0.0, Some(-0.12), 0.0), "a hole of 12 cm");
        assert!(
            hole(-0.05, Some(-0.17), 0.0),
            "the same in a wall that moved back"
        );
        assert!(
            hole(0.0, None, 0.05),
            "deeper than M3C2 reaches; near the outline it sees the neighbours"
        );
        assert!(
            is_lost_with(&stones, |along, up| match is_inside(0.0, along, up) {
                true => Some((-0.002, 20)),
                false => Some((0.0, 60)),
            }),
            "a dark hole: there are only points of the neighbours"
        );
        assert!(
            is_lost(&stones, |along, up| {
                match (is_inside(0.0, along, up), along < -0.02) {
                    (true, true) => Some(-0.25),
                    (true, false) => None,
                    (false, _) => (along < 0.1).then_some(0.0),
                }
            }),
            "a hole beside a gap: the cloud shows what lies behind"
        );
        assert!(
            !is_lost_with(&stones, |along, _| match (-0.1..0.5).contains(&along) {
                true => Some((-0.04, 3)),
                false => Some((0.0, 100)),
            }),
            "a gap with stray points"
        );
        assert!(!hole(0.0, Some(0.004), 0.0), "its surface is there");
        assert!(
            !hole(-0.05, Some(-0.05), 0.0),
            "its surface moved back with the wall"
        );
        assert!(
            !hole(0.04, Some(0.038), 0.0),
            "its surface moved out with the wall"
        );
        assert!(!hole(0.0, Some(0.08), 0.0), "a plant in front");
        assert!(!hole(0.0, None, -0.2), "a gap that is larger than the stone");
        assert!(
            !is_lost(&stones, |along, _| (along < -0.15).then_some(0.0)),
            "the end of the cloud"
        );
    }

    #[test]
    fn only_stones_that_the_first_epoch_shows_well_are_lost() {
        let hole = |change: fn(&mut StoneRow)| {
            let mut stones = rows();
            change(&mut stones[LOST]);
            is_lost(&stones, |along, up| {
                Some(if is_inside(0.0, along, up) { -0.12 } else { 0.0 })
            })
        };
        assert!(hole(|_| {}));
        assert!(!hole(|stone| stone.photos = 1));
        assert!(!hole(|stone| stone.points_1 = 99));
        assert!(!hole(|stone| stone.confidence = 0.5));
        assert!(hole(|stone| stone.status = Status::UnmatchedArea));
        assert!(!hole(|stone| stone.status = Status::FailedDisagreement));
    }

    #[test]
    fn without_core_points_the_status_decides() {
        let mut stones = rows();
        let lost = |stones: &[StoneRow]| {
            let folder = folder(stones);
            lost_stones(&ResultSet::read_measured(folder.path(), 1).unwrap())
        };
        assert!(lost(&stones)[LOST]);
        stones[LOST].status = Status::UnmatchedUnseen;
        assert!(!lost(&stones)[LOST]);
    }
}
