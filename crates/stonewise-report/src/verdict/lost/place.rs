//! What M3C2 shows in a stone's place.

use super::wall::{Seen, Wall};
use nalgebra::{Point2, Vector2};
use stonewise_core::geometry::RingIndex;
use stonewise_results::{ResultSet, Sorted};

/// A surface that lies this much farther back than the neighbours' motion puts it, metres, is another one:
/// less than the depth of the hole that a lost stone leaves, more than the motion of most loose ones.
const GONE_M: f64 = 0.03;
/// A cylinder with less than this share of the later points that the wall around leads to expect sees no
/// surface of its own, only the neighbours'.
const POINT_SHARE: f64 = 0.5;
/// One with less than this share only holds stray points, and sees nothing behind the stone's place either.
const STRAY_SHARE: f64 = 0.1;
/// Width of the border around a stone whose coverage distinguishes a hole from a gap in the later clouds, metres.
const AROUND_M: f64 = 0.15;
/// Share of the core points on a stone behind which the later clouds show something: then they look through
/// its place, and a gap does not explain the others.
const SEEN_THROUGH_SHARE: f64 = 0.25;
/// Largest share of the core points on a stone that see its surface if the clouds show nothing in its place.
const EMPTY_SHARE: f64 = 0.2;
/// Least share of the core points in the border that hold later points where these tell what to expect.
const LEAST_AROUND: f64 = 0.25;

/// What became of a stone's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum State {
    /// M3C2 has no core points in or around its outline.
    Unknown,
    /// It is there, in part or as a whole, or something hides it, or the stone is too small to tell.
    Present,
    /// The clouds show what lies behind its place.
    SeenThrough,
    /// The clouds show nothing in its place: a deep hole or a gap.
    Empty,
}

/// A stone's outline in the unrolled wall and the core points in and around it; `None`: one without later
/// points.
pub(super) struct Place {
    /// Number in [`ResultSet::stones`].
    pub stone: usize,
    pub state: State,
    /// Corners of the box that holds the outline and the border around it.
    pub low: Point2<f64>,
    pub high: Point2<f64>,
    pub around: Vec<(Point2<f64>, Option<Seen>)>,
    centre: Point2<f64>,
    outline: RingIndex,
    inside: Vec<(Point2<f64>, Option<Seen>)>,
    /// Later points in a cylinder that the wall around leads to expect, for each of the first epoch.
    expected_ratio: f64,
}

impl Place {
    pub(super) fn new(results: &ResultSet, stone: usize) -> Self {
        let row = &results.stones[stone];
        let ring = results.unrolled(row);
        let centre = Point2::new(row.along_m, row.up_m);
        let corner = |of: fn(&Point2<f64>, &Point2<f64>) -> Point2<f64>| {
            ring.iter().fold(centre, |corner, p| of(&corner, p))
        };
        let border = Vector2::repeat(AROUND_M);
        Self {
            stone,
            state: State::Unknown,
            low: corner(Point2::inf) - border,
            high: corner(Point2::sup) + border,
            around: Vec::new(),
            centre,
            outline: RingIndex::new(&[ring]),
            inside: Vec::new(),
            expected_ratio: 0.0,
        }
    }

    /// Takes a core point that lies here in the unrolled wall.
    pub(super) fn take(&mut self, at: &Point2<f64>, seen: Option<Seen>) {
        if self.outline.contains(at) {
            self.inside.push((*at, seen));
        } else if self.reaches(AROUND_M, at) {
            self.around.push((*at, seen));
        }
    }

    /// Whether a point lies in the outline or nearer to it than this.
    pub(super) fn reaches(&self, border_m: f64, at: &Point2<f64>) -> bool {
        self.outline.contains(at) || self.outline.passes_within(border_m, at)
    }

    /// Whether a cylinder around or on the stone sees a surface of its own.
    pub(super) fn sees_surface(&self, seen: &Seen) -> bool {
        seen.count_ratio >= POINT_SHARE * self.expected_ratio
    }

    /// Sets the state by the core points that were taken. `margin_m`: those so far inside the outline see the
    /// stone alone; those half as far see it for the most part.
    pub(super) fn judge(&mut self, wall: &Wall, margin_m: f64) {
        self.expected_ratio = self.ratio_around().unwrap_or(wall.count_ratio);
        let wall_m = wall.distance_m(&self.centre);
        let is_behind = |seen: &Seen| seen.distance_m < wall_m - GONE_M;
        let is_stray = |seen: &Seen| seen.count_ratio < STRAY_SHARE * self.expected_ratio;

        let points = self.inner_points(margin_m);
        let count = |is: &dyn Fn(&Seen) -> bool| points.iter().flatten().filter(|seen| is(seen)).count();
        let behind = count(&|seen| is_behind(seen) && !is_stray(seen));
        let at_wall = count(&|seen| !is_behind(seen) && self.sees_surface(seen));
        self.state = if self.inside.is_empty() && self.around.is_empty() {
            State::Unknown
        } else if points.is_empty() || 2 * at_wall > points.len() {
            State::Present
        } else if behind as f64 >= SEEN_THROUGH_SHARE * points.len() as f64 {
            State::SeenThrough
        } else if at_wall as f64 <= EMPTY_SHARE * points.len() as f64 {
            State::Empty
        } else {
            State::Present
        };
    }

    /// Later points in the cylinders around the stone, for each of the first epoch; `None` where too few of
    /// them hold any.
    fn ratio_around(&self) -> Option<f64> {
        let ratios = self
            .around
            .iter()
            .filter_map(|(_, seen)| Some((*seen)?.count_ratio));
        let ratios = Sorted::new(ratios);
        let is_enough = ratios.values().len() as f64 >= LEAST_AROUND * self.around.len() as f64;
        // Not the median: a gap may take more than half of the border.
        ratios.quantile(0.75).filter(|_| is_enough)
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
