//! What a wall shows of the intervals, and rows of many walls.

use super::small_wall::Survey;
use crate::figures::{CHI2_3_95, Z95, chi_square, share};
use crate::sharpness::Sharpness;
use crate::table::{Figure, Table};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stonewise_core::geometry::{DisplacementSample, FaceFrame, SmallMotion, lever};
use stonewise_core::registration::moved_stones;
use stonewise_core::registration::observers::{Datum, EpochErrors};

/// Figures of one wall; shares are of its stones, axes (along, up, out).
#[derive(Clone, Copy, Default)]
pub struct Wall {
    pub datum: Option<Datum>,
    /// Stones whose interval holds the truth, along each axis and jointly.
    inside: [f64; 4],
    /// Scores of the stones' errors along each axis, millimetres.
    sharpness: [Sharpness; 3],
    /// Stones whose interval holds the truth along each axis, the rigid part of the errors removed.
    inside_relative: [f64; 3],
    chi_square: f64,
    /// Squared errors before and after the datum's correction, and claims, mm^2, summed over axes.
    square: [f64; 3],
    /// Squared error of the common motion over its claim, mean of the axes.
    common: f64,
    /// Whether a stone of the wall, which stands still, is called moved: stone by stone, and with the false
    /// discovery rate controlled.
    called: [bool; 2],
    /// Whether stable areas made the common error larger along an axis, by more than is claimed of it.
    is_worse: bool,
}

impl Wall {
    /// `without`: the same without stable areas.
    pub fn new(survey: &Survey, found: &EpochErrors, without: Option<&EpochErrors>) -> Self {
        let is_known = found.datum != Datum::Unknown;
        let stones = || survey.stones.iter().zip(&survey.measured).enumerate();
        let samples: Vec<DisplacementSample> = stones()
            .map(|(k, (stone, measured))| DisplacementSample {
                place: stone.centroid,
                displacement: *measured,
                covariance: survey.noise[k],
            })
            .collect();
        let common = SmallMotion::fit(&samples);
        let mut wall = Self {
            datum: Some(found.datum),
            ..Self::default()
        };
        let n = survey.stones.len() as f64;
        let mut motions = Vec::new();
        for (k, (stone, measured)) in stones() {
            let (rest, covariance) = match (&common, is_known) {
                (Some(common), false) => (
                    measured - common.at(&stone.centroid),
                    survey.noise[k] + common.covariance_at(&stone.centroid) + found.relative[k],
                ),
                _ => (
                    measured - found.at[k].mean,
                    survey.noise[k] + found.at[k].covariance,
                ),
            };
            let face = FaceFrame::from_normal(&stone.normal).face_from_world();
            let (error, spread) = (face * rest, face * covariance * face.transpose());
            for axis in 0..3 {
                let holds = error[axis].abs() < Z95 * spread[(axis, axis)].sqrt();
                wall.inside[axis] += f64::from(u8::from(holds)) / n;
                wall.sharpness[axis].add(1e3 * error[axis], 1e3 * spread[(axis, axis)].sqrt());
            }
            let chi = chi_square(&rest, &covariance);
            wall.inside[3] += f64::from(u8::from(chi < CHI2_3_95)) / n;
            wall.chi_square += chi / n;
            wall.square[0] += 1e6 * measured.norm_squared() / n;
            wall.square[1] += 1e6 * rest.norm_squared() / n;
            wall.square[2] += 1e6 * covariance.trace() / n;
            wall.called[0] |= chi > CHI2_3_95;
            motions.push(Some((rest, covariance)));
        }
        wall.called[1] = moved_stones(&motions, 0.05).contains(&true);
        wall.inside_relative = match is_known {
            true => inside_relative(survey, found),
            false => [0, 1, 2].map(|axis| wall.inside[axis]),
        };
        let mean = survey.seeming.iter().sum::<Vector3<f64>>() / n;
        let claimed = found.rigid.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let off_by = |of: &EpochErrors| mean - of.rigid.error.fixed_rows::<3>(0);
        let off = off_by(found);
        wall.is_worse = without.is_some_and(|without| {
            let before = off_by(without);
            (0..3).any(|a| off[a].abs() > before[a].abs() + claimed[(a, a)].sqrt())
        });
        wall.common = (0..3).map(|a| off[a].powi(2) / claimed[(a, a)]).sum::<f64>() / 3.0;
        wall
    }
}

/// Shares of stones whose intervals hold the truth along, up and out once the closest rigid motion is taken off
/// the errors, with covariances that leave the rigid part of the sources' errors out.
fn inside_relative(survey: &Survey, found: &EpochErrors) -> [f64; 3] {
    let left: Vec<DisplacementSample> = (0..survey.stones.len())
        .map(|k| {
            let lever = lever(&(survey.stones[k].centroid - found.rigid.centre));
            let rigid = lever * found.rigid.covariance * lever.transpose();
            DisplacementSample {
                place: survey.stones[k].centroid,
                displacement: survey.measured[k] - found.at[k].mean,
                covariance: survey.noise[k] + found.at[k].covariance - rigid,
            }
        })
        .collect();
    let Some(common) = SmallMotion::fit(&left) else {
        return [0.0; 3];
    };
    let mut inside = [0.0; 3];
    for (stone, sample) in survey.stones.iter().zip(&left) {
        let face = FaceFrame::from_normal(&stone.normal).face_from_world();
        let error = face * (sample.displacement - common.at(&sample.place));
        let spread = face * sample.covariance * face.transpose();
        for axis in 0..3 {
            let holds = error[axis].abs() < Z95 * spread[(axis, axis)].max(0.0).sqrt();
            inside[axis] += f64::from(u8::from(holds)) / left.len() as f64;
        }
    }
    inside
}

/// The walls of a row, and the figures of those that count.
struct Row {
    walls: Vec<Wall>,
    /// Walls with a datum; all, against their common rigid motion, if none has one.
    known: Vec<Wall>,
    /// 95 % range of the coverage, mean of the axes.
    range: [f64; 2],
    seconds: f64,
}

impl Row {
    fn mean(&self, of: impl Fn(&Wall) -> f64) -> f64 {
        self.known.iter().map(of).sum::<f64>() / self.known.len() as f64
    }

    fn rms_mm(&self, k: usize) -> f64 {
        (self.mean(|w| w.square[k]) / 3.0).sqrt()
    }

    /// A score's mean over the axes.
    fn score(&self, of: impl Fn(&Sharpness) -> f64) -> f64 {
        (0..3).map(|axis| of(&self.sharpness(axis))).sum::<f64>() / 3.0
    }

    fn sharpness(&self, axis: usize) -> Sharpness {
        let of_walls = self.known.iter().map(|w| w.sharpness[axis]);
        of_walls.fold(Sharpness::default(), |a, b| a.with(&b))
    }

    fn share(&self, holds: impl Fn(&Wall) -> bool) -> f64 {
        share(self.walls.len(), |i| holds(&self.walls[i]))
    }
}

const COLUMNS: [Figure<Row>; 25] = [
    ("unknown", 2, |r| r.share(|w| w.datum == Some(Datum::Unknown))),
    ("along", 3, |r| r.mean(|w| w.inside[0])),
    ("up", 3, |r| r.mean(|w| w.inside[1])),
    ("out", 3, |r| r.mean(|w| w.inside[2])),
    ("joint", 3, |r| r.mean(|w| w.inside[3])),
    ("mean of the axes, from", 3, |r| r.range[0]),
    ("to", 3, |r| r.range[1]),
    ("chi-square", 2, |r| r.mean(|w| w.chi_square)),
    ("rms before, mm", 2, |r| r.rms_mm(0)),
    ("after", 2, |r| r.rms_mm(1)),
    ("claimed", 2, |r| r.rms_mm(2)),
    ("common error / claim", 2, |r| r.mean(|w| w.common).sqrt()),
    ("without the rigid part: along", 3, |r| {
        r.mean(|w| w.inside_relative[0])
    }),
    ("up", 3, |r| r.mean(|w| w.inside_relative[1])),
    ("out", 3, |r| r.mean(|w| w.inside_relative[2])),
    ("called stone by stone", 3, |r| r.share(|w| w.called[0])),
    ("FDR", 3, |r| r.share(|w| w.called[1])),
    ("made worse by stable areas", 3, |r| r.share(|w| w.is_worse)),
    ("CRPS, mm", 3, |r| r.score(Sharpness::crps)),
    ("over calibrated: along", 2, |r| r.sharpness(0).crps_ratio()),
    ("up", 2, |r| r.sharpness(1).crps_ratio()),
    ("out", 2, |r| r.sharpness(2).crps_ratio()),
    ("interval score, mm", 2, |r| r.score(Sharpness::interval)),
    ("over calibrated", 2, |r| r.score(Sharpness::interval_ratio)),
    ("s", 0, |r| r.seconds),
];

/// The head of the table, after the range in which the coverage of a perfect method would lie.
pub fn begin(walls: u64) -> Table {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut shares: Vec<f64> = (0..4000)
        .map(|_| (0..walls).filter(|_| rng.random_bool(0.95)).count() as f64 / walls as f64)
        .collect();
    shares.sort_by(f64::total_cmp);
    println!(
        "a perfect method, all stones of a wall sharing one error: {:.3} to {:.3}\n",
        shares[100], shares[3900]
    );
    Table::begin(std::iter::once("survey").chain(COLUMNS.map(|c| c.0)))
}

/// The row of some walls.
pub fn cells(label: &str, walls: Vec<Wall>, seconds: f64) -> Vec<String> {
    let is_known = |w: &&Wall| w.datum != Some(Datum::Unknown);
    let mut known: Vec<Wall> = walls.iter().filter(is_known).copied().collect();
    if known.is_empty() {
        known.clone_from(&walls);
    }
    let row = Row {
        range: bootstrap(&known),
        walls,
        known,
        seconds,
    };
    let figures = COLUMNS.map(|(_, digits, of)| format!("{:.digits$}", of(&row)));
    std::iter::once(label.to_owned()).chain(figures).collect()
}

/// 95 % range of the coverage, mean of the axes, over walls drawn anew.
fn bootstrap(walls: &[Wall]) -> [f64; 2] {
    if walls.is_empty() {
        return [f64::NAN; 2];
    }
    let of: Vec<f64> = walls
        .iter()
        .map(|w| w.inside[..3].iter().sum::<f64>() / 3.0)
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut means: Vec<f64> = (0..2000)
        .map(|_| {
            (0..of.len())
                .map(|_| of[rng.random_range(0..of.len())])
                .sum::<f64>()
                / of.len() as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [means[50], means[1950]]
}
