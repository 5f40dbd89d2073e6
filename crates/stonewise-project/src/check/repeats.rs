//! Points that occur twice: within one epoch, where they count twice and make intervals of motions too small,
//! or in two epochs, between which they seem to show that nothing moved.

use std::cmp::Ordering;
use std::collections::HashMap;

use super::clouds::read;
use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::Project;
use nalgebra::{Point3, Vector3};
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{CLOUDS, ROUGH, ROUNDED, SAME_POINTS, TWICE};
use stonewise_core::geometry::cell_of;
use stonewise_core::statistics::{split_mix, upper_median};

/// Edge of the cells, metres; points in the same cell count as the same point. A tenth of what scanners
/// resolve. Points of two epochs are compared in steps of the coarser coordinates, if those are larger.
const SAME_M: f64 = 1e-4;
/// About how many points of an epoch are compared.
const COMPARED: usize = 400_000;
/// Share of repeated points in an epoch above which chance does not explain them. A cloud that is named twice
/// gives 1; three stations, one of which is named twice, give a half.
const TOO_MANY: f64 = 0.3;
/// Steps of the coordinates, as a share of the point spacing, above which many points of two surveys coincide
/// by chance; below it, fewer than one in sixteen do.
const CHANCE_STEP: f64 = 0.25;
/// Steps of the coordinates, as a multiple of the point spacing, above which the errors of motions exceed
/// their intervals: on a cloud of 7.5 mm spacing, steps of 20 mm gave errors of 1.4 standard deviations, and
/// steps of 10 mm gave errors of 0.3.
const COARSE_STEP: f64 = 2.0;
/// Steps of the coordinates, metres, above which they add more than a millimetre to the noise of the points (a
/// step is 3.5 standard deviations of its rounding): more than a terrestrial scanner's own.
const ROUGH_STEP_M: f64 = 3.5e-3;
/// Standard deviations of its rounding in a step: the root of twelve.
const STEP_SDS: f64 = 3.464;

/// Looks for repeated points and for coarse steps of the coordinates.
pub(super) fn look(project: &Project, surveys: &[Option<Sample>]) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut earlier: Vec<(&str, &[Point3<f64>], Cells)> = Vec::new();
    for (epoch, survey) in read(project, surveys) {
        let mut say =
            |verdict: Verdict, text: Said| found.push(Finding::new(&epoch.name, &CLOUDS, verdict, text));
        let (step_m, spacing_m) = (step(&survey.points), survey.spacing_m.unwrap_or(0.0));
        let is_coarse = survey.spacing_m.is_some() && step_m > spacing_m * COARSE_STEP;
        let [step, spacing, noise] =
            [step_m, spacing_m, step_m / STEP_SDS].map(|m| Said::numbers(format!("{:.1}", 1e3 * m)));
        match step_m > ROUGH_STEP_M {
            _ if is_coarse => say(
                Verdict::Doubt,
                ROUNDED.say(&[("step", step), ("spacing", spacing)]),
            ),
            true => say(Verdict::Note, ROUGH.say(&[("step", step), ("noise", noise)])),
            false => {}
        }
        if step_m > spacing_m * CHANCE_STEP {
            continue;
        }
        let twice = Cells::of(&survey.points, SAME_M).share_of_repeats();
        if twice > TOO_MANY {
            say(Verdict::Doubt, TWICE.say(&[("share", percent(twice).into())]));
        }
        // A known motion moves the points after this look.
        let is_moved = epoch.motion.is_some();
        let cells = Cells::of(&survey.points, cell_of_step(step_m));
        for (name, points, other) in earlier.iter().filter(|_| !is_moved) {
            let same = match cells.cell_m.total_cmp(&other.cell_m) {
                Ordering::Equal => cells.share_in(other),
                Ordering::Less => Cells::of(&survey.points, other.cell_m).share_in(other),
                Ordering::Greater => cells.share_in(&Cells::of(points, cells.cell_m)),
            };
            if same > TOO_MANY {
                say(
                    Verdict::Doubt,
                    SAME_POINTS.say(&[("share", percent(same).into()), ("first", (*name).into())]),
                );
            }
        }
        earlier.push((&epoch.name, &survey.points, cells));
    }

    found
}

fn percent(share: f64) -> String {
    format!("{:.0}", 100.0 * share)
}

/// Edge of the cells in which points of coordinates with this step are compared with those of another epoch: the step to
/// a micrometre. In coordinates of millions of metres its last digits are those of the numbers, and cells of such an edge
/// would not begin where the steps do.
fn cell_of_step(step_m: f64) -> f64 {
    SAME_M.max((1e6 * step_m).round() / 1e6)
}

/// How many points lie in each of some cells: the same cells for every epoch.
struct Cells {
    cell_m: f64,
    /// One cell in this many is counted.
    thinning: u64,
    counts: HashMap<[i64; 3], u32>,
}

impl Cells {
    /// Cells of this edge, in whose middles the points of coordinates with this step lie.
    fn of(points: &[Point3<f64>], cell_m: f64) -> Self {
        // A power of two, so that the cells of one epoch are among those of another.
        let thinning = (points.len() / COMPARED + 1).next_power_of_two() as u64;
        let mut counts: HashMap<[i64; 3], u32> = HashMap::new();
        let middle = Vector3::repeat(0.5 * cell_m);
        let cells = points.iter().map(|p| cell_of(&(p + middle), cell_m));
        for cell in cells.filter(|cell| is_counted(cell, thinning)) {
            *counts.entry(cell).or_default() += 1;
        }
        Self {
            cell_m,
            thinning,
            counts,
        }
    }

    fn share_of_repeats(&self) -> f64 {
        self.share(self.thinning, |_, count| count > 1)
    }

    fn share_in(&self, other: &Self) -> f64 {
        let thinning = self.thinning.max(other.thinning);
        self.share(thinning, |cell, _| other.counts.contains_key(cell))
    }

    /// Share of the points that lie in cells for which `is_true` holds.
    fn share(&self, thinning: u64, is_true: impl Fn(&[i64; 3], u32) -> bool) -> f64 {
        let (mut all, mut some) = (0, 0);
        for (cell, &count) in self.counts.iter().filter(|(cell, _)| is_counted(cell, thinning)) {
            all += u64::from(count);
            some += u64::from(count) * u64::from(is_true(cell, count));
        }
        some as f64 / all.max(1) as f64
    }
}

/// Whether a cell is counted; a hash of its position decides.
fn is_counted(cell: &[i64; 3], thinning: u64) -> bool {
    let hash = cell.iter().fold(0, |hash, i| split_mix(hash ^ i.cast_unsigned()));
    hash % thinning == 0
}

/// The step of the coordinates, metres: the median difference between successive values of an axis, the
/// largest of the three axes.
fn step(points: &[Point3<f64>]) -> f64 {
    let axis = |axis: usize| {
        let mut values: Vec<f64> = points.iter().take(COMPARED).map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        let steps = values.windows(2).map(|pair| pair[1] - pair[0]);
        // Large coordinates that differ only in their last bits are equal.
        let mut steps: Vec<f64> = steps.filter(|s| *s > SAME_M / 100.0).collect();
        upper_median(&mut steps).unwrap_or(0.0)
    };
    // Among few points no two coordinates need be one step apart.
    match points.len() {
        0..LEAST_POINTS => 0.0,
        _ => axis(0).max(axis(1)).max(axis(2)),
    }
}

/// Least number of points for which the median difference between successive values is the step.
const LEAST_POINTS: usize = 10_000;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A wall of 2 x 2 m with a spacing of 6 mm and a relief of 2 cm.
    fn wall(seed: u64) -> Vec<Point3<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut up_to = |end: f64| random.random_range(0.0..end);
        (0..110_000)
            .map(|_| Point3::new(5e5 + up_to(0.02), 5e6 + up_to(2.0), up_to(2.0)))
            .collect()
    }

    fn in_steps(points: &[Point3<f64>], step_m: f64) -> Vec<Point3<f64>> {
        points
            .iter()
            .map(|p| p.map(|c| (c / step_m).round() * step_m))
            .collect()
    }

    #[test]
    fn shares_of_repeated_points_are_those_that_were_repeated() {
        let (one, other) = (wall(1), wall(2));
        let cells = Cells::of(&one, SAME_M);
        assert!(cells.share_of_repeats() < 0.01);
        assert!(Cells::of(&other, SAME_M).share_in(&cells) < 0.01);
        assert!((Cells::of(&one[..40_000], SAME_M).share_in(&cells) - 1.0).abs() < 1e-9);
        let half: Vec<_> = one[..55_000].iter().chain(&other[..55_000]).copied().collect();
        assert!((Cells::of(&half, SAME_M).share_in(&cells) - 0.5).abs() < 0.02);
        let twice: Vec<_> = one.iter().chain(&one).copied().collect();
        assert!((Cells::of(&twice, SAME_M).share_of_repeats() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_survey_is_known_again_in_coarser_coordinates() {
        let (one, other) = (wall(5), wall(6));
        // The wall lies millions of metres from the origin.
        let cell_m = cell_of_step(step(&in_steps(&one, 1e-3)));
        let coarse = |points: &[Point3<f64>]| Cells::of(&in_steps(points, 1e-3), cell_m);
        let cells = Cells::of(&one, cell_m);
        assert!(coarse(&one).share_in(&cells) > 0.99);
        assert!(coarse(&other).share_in(&cells) < 0.05);
    }

    #[test]
    fn thinned_cells_give_the_same_shares() {
        let (one, other) = (wall(3), wall(4));
        let many: Vec<_> = (0..8)
            .flat_map(|i| wall(10 + i))
            .chain(one.iter().copied())
            .collect();
        let cells = Cells::of(&many, SAME_M);
        assert!(cells.thinning > 1, "{}", cells.thinning);
        assert!((Cells::of(&one, SAME_M).share_in(&cells) - 1.0).abs() < 1e-9);
        assert!(Cells::of(&other, SAME_M).share_in(&cells) < 0.02);
        assert!(cells.share_of_repeats() < 0.03);
    }

    #[test]
    fn steps_of_coordinates_are_found() {
        let points = wall(5);
        assert!(step(&points) < 5e-4);
        for step_m in [0.001, 0.004, 0.01, 0.0625] {
            let found = step(&in_steps(&points, step_m));
            assert!((found / step_m - 1.0).abs() < 1e-4, "{step_m}: {found}");
        }
        // Steps of one axis, as of coordinates of single precision far from the origin.
        let one_axis = points
            .iter()
            .map(|p| Point3::new(p.x, (2.0 * p.y).round() / 2.0, p.z));
        assert!((step(&one_axis.collect::<Vec<_>>()) - 0.5).abs() < 1e-9);
        assert_eq!(step(&points[..100]), 0.0);
    }
}
