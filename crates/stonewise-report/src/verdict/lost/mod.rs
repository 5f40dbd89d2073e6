//! Stones that the later epoch shows to be gone.

mod place;
mod wall;

use place::{Place, State};
use stonewise_core::change::M3c2Params;
use stonewise_core::components::components;
use stonewise_results::{ResultSet, Squares, Status, StoneRow};
use wall::Wall;

/// A stone is well seen where at least this number of photos and of points show it, and its points got at least this
/// share of the votes.
const WELL_SEEN_PHOTOS: u32 = 2;
const WELL_SEEN_POINTS: u32 = 100;
const WELL_SEEN_CONFIDENCE: f64 = 0.6;
/// Least share of the core points around a hole that see a surface; around a gap in the clouds fewer do.
const COVERED_SHARE: f64 = 0.9;
/// Core points this near to another stone that is gone belong to the same hole, metres: the joint between.
const JOINT_M: f64 = 0.06;

/// For each stone, in the order of [`ResultSet::stones`], whether the first epoch shows it well, it has no
/// partner in the later one, and M3C2 shows that its surface is gone.
///
/// The surface is gone if half of the core points on the stone see it farther back than the wall around has
/// moved, or see none. If they see none, either the cloud shows something behind a part of the stone, or the
/// wall is covered all around the hole that it makes with other stones of this kind: otherwise the cloud has a
/// gap, which says nothing about the stone. A stone that is too small for a cylinder is not called gone. Where
/// M3C2 has no core points in or around it, its status decides.
pub(super) fn lost_stones(results: &ResultSet) -> Vec<bool> {
    let mut lost = vec![false; results.stones.len()];
    let is_candidate = |i: &usize| is_unmatched(&results.stones[*i]);
    let mut places: Vec<Place> = (0..lost.len())
        .filter(is_candidate)
        .map(|i| Place::new(results, i))
        .collect();
    if places.is_empty() {
        return lost;
    }
    let squares = squares(&places);

    for (position, seen) in wall::core_points(results) {
        let at = results.facade.place(&position);
        for &number in squares.near(&at) {
            let place = &mut places[number];
            if results.is_at_face(&results.stones[place.stone], &position) {
                place.take(&at, seen);
            }
        }
    }

    let wall = Wall::new(results);
    let margin_m = margin_m(results);
    for place in &mut places {
        place.judge(&wall, margin_m);
    }
    let covered = covered_holes(&places, &squares);

    for (place, is_covered) in places.iter().zip(covered) {
        let stone = &results.stones[place.stone];
        let is_gone = match place.state {
            State::Present => false,
            State::SeenThrough => true,
            State::Empty => is_covered,
            State::Unknown => stone.status == Status::UnmatchedLost,
        };
        lost[place.stone] = is_gone && is_well_seen(stone);
    }

    lost
}

fn squares(places: &[Place]) -> Squares {
    let mut squares = Squares::default();
    for (number, place) in places.iter().enumerate() {
        squares.add(number, &place.low, &place.high);
    }
    squares
}

/// For each place whether it belongs to a hole, of one stone or of several, around which the wall is covered.
fn covered_holes(places: &[Place], squares: &Squares) -> Vec<bool> {
    let is_gone = |place: &Place| matches!(place.state, State::SeenThrough | State::Empty);
    // Places that make one hole with each other.
    let mut next = vec![Vec::new(); places.len()];
    // Of the core points around each place, outside its hole: those that see a surface, and all.
    let mut around = vec![[0usize; 2]; places.len()];
    for (number, place) in places.iter().enumerate().filter(|(_, p)| is_gone(p)) {
        for (at, seen) in &place.around {
            let others = squares.near(at).iter().copied().filter(|&other| other != number);
            let inside: Vec<usize> = others
                .filter(|&other| is_gone(&places[other]) && places[other].reaches(JOINT_M, at))
                .collect();
            if inside.is_empty() {
                around[number][0] += usize::from(seen.is_some_and(|seen| place.sees_surface(&seen)));
                around[number][1] += 1;
            }
            for other in inside {
                next[number].push(other);
                next[other].push(number);
            }
        }
    }
    let mut is_covered = vec![false; places.len()];
    for hole in components(places.len(), |place| next[place].iter().copied()) {
        let sum = |k: usize| hole.iter().map(|&i| around[i][k]).sum::<usize>();
        let [covered, all] = [sum(0), sum(1)];
        for place in hole {
            is_covered[place] = covered > 0 && covered as f64 >= COVERED_SHARE * all as f64;
        }
    }
    is_covered
}

fn is_unmatched(stone: &StoneRow) -> bool {
    matches!(
        stone.status,
        Status::UnmatchedLost | Status::UnmatchedUnseen | Status::UnmatchedArea | Status::UnmatchedAmbiguous
    )
}

fn is_well_seen(stone: &StoneRow) -> bool {
    stone.photos >= WELL_SEEN_PHOTOS
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, rows};
    use std::fmt::Write;

    /// The stone of the wall in `testing` that has no partner.
    const LOST: usize = 2;

    /// Whether the stone is lost where M3C2 has this distance at (along, up) from its centroid; its outline
    /// reaches 0.19 m along and 0.115 m up. A railing that stays stands 1 m in front.
    fn is_lost(stones: &[StoneRow], distance_m: impl Fn(f64, f64) -> Option<f64>) -> bool {
        is_lost_with(stones, |along, up| distance_m(along, up).map(|d| (d, 100)))
    }

    /// [`is_lost`] with the number of later points, of 100 of the first epoch.
    fn is_lost_with(stones: &[StoneRow], seen: impl Fn(f64, f64) -> Option<(f64, u32)>) -> bool {
        match lost_with(stones, seen)[..] {
            [] => false,
            [only] => only == LOST,
            _ => panic!("other stones are lost"),
        }
    }

    /// Numbers of the stones that are lost.
    fn lost_with(stones: &[StoneRow], seen: impl Fn(f64, f64) -> Option<(f64, u32)>) -> Vec<usize> {
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
        std::fs::write(folder.path().join("data/m3c2.csv"), csv).unwrap();
        let lost = lost_stones(&ResultSet::read_measured(folder.path(), 1).unwrap());
        (0..lost.len()).filter(|&i| lost[i]).collect()
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
    fn adjacent_stones_are_lost_where_the_cloud_shows_one_hole_of_their_shape() {
        let stones = rows();
        // The stone and its neighbour to the right, which has no partner either; 2 cm between them.
        let hole = |border: f64| {
            lost_with(&stones, |along, up| {
                let is_in_hole = (along - 0.2).abs() < 0.39 + border && up.abs() < 0.115 + border;
                (!is_in_hole).then_some((0.0, 100))
            })
        };
        assert_eq!(hole(0.0), [LOST, LOST + 1]);
        assert!(hole(0.08).is_empty(), "a gap that reaches into the stones around");
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
