//! A wall that is scanned again and again: velocities and steps against the truth.

use super::figures::{Figures, LEVELS, coverage, interval_score};
use super::measure::{Failure, Pair};
use super::plan::Plan;
use crate::figures::rms;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::registration::AdjustmentParams;
use stonewise_core::series::{
    PairLook, SeriesEpoch, SeriesPlace, StoneSeries, Word, analyse, keep_congruent,
};
use stonewise_simulate::WallMotion;

/// Epochs, the reference among them, and years from one to the next.
const EPOCHS: usize = 6;
const APART: f64 = 0.5;
/// The first epoch after the step.
const STEP_EPOCH: usize = 3;
/// The part of a pair's variance that the reference brings in: both epochs are scanned alike.
const REFERENCE_SHARE: f64 = 0.5;

/// What a wall does over the years.
#[derive(Clone, Debug)]
pub struct Series {
    /// The wall; its motions are those of the series.
    pub plan: Plan,
    /// Of the middle of a bulge, metres a year.
    pub creep_m: f64,
    /// Settlement of the right sixth, metres.
    pub step_m: f64,
}

/// A stone in all epochs: its face, and its true displacements.
struct Course {
    place: SeriesPlace,
    face: Matrix3<f64>,
    truth: Vec<Vector3<f64>>,
}

impl Series {
    /// The pair of the reference and a later epoch.
    fn at(&self, epoch: usize) -> Plan {
        let [width_m, height_m] = self.plan.size_m;
        let mut motions = Vec::new();
        if self.creep_m != 0.0 {
            motions.push(WallMotion::Bulge {
                centre_m: [0.07 * width_m, 0.5 * height_m],
                depth_m: self.creep_m * APART * epoch as f64,
                diameter_m: 1.2,
            });
        }
        if self.step_m != 0.0 && epoch >= STEP_EPOCH {
            motions.push(WallMotion::Settlement {
                from_m: width_m / 6.0,
                to_m: width_m / 6.0 + 0.1,
                depth_m: self.step_m,
            });
        }
        Plan {
            motions,
            ..self.plan.clone()
        }
    }

    /// Measures the series.
    pub fn figures(&self, seed: u64, params: &AdjustmentParams) -> Result<Figures, Failure> {
        let mut courses: BTreeMap<StoneId, Course> = BTreeMap::new();
        let mut zones: Vec<BTreeSet<StoneId>> = Vec::new();
        for epoch in 1..EPOCHS {
            let wall = self.at(epoch).make_later(seed, epoch);
            let pair = Pair::new(&wall, params)?;
            zones.extend(
                pair.deformation
                    .zones
                    .iter()
                    .map(|z| z.stones.iter().copied().collect()),
            );
            for stone in &pair.deformation.stones {
                let (place, truth) = (pair.places[&stone.stone], &wall.truth[&stone.stone.0]);
                let course = courses.entry(stone.stone).or_insert_with(|| Course {
                    place: SeriesPlace {
                        place,
                        deformations: vec![None; EPOCHS],
                    },
                    face: FaceFrame::from_normal(&truth.normal).face_from_world(),
                    truth: vec![Vector3::zeros(); EPOCHS],
                });
                course.place.deformations[epoch] = Some((stone.deformation, stone.covariance));
                course.truth[epoch] = truth.displacement(&place);
            }
        }
        // Where an epoch misses a stone its true place is not known here, and the stone is left out.
        courses.retain(|_, c| c.place.deformations[1..].iter().all(Option::is_some));
        let mut places: Vec<SeriesPlace> = courses.values().map(|c| c.place.clone()).collect();
        keep_congruent(&mut places);
        for (course, place) in courses.values_mut().zip(places) {
            course.place = place;
        }
        let stones: Vec<StoneSeries> = courses.iter().map(|(id, c)| c.looks(*id)).collect();
        let found = analyse(&epochs(), &stones, &zones);

        let years = APART * (EPOCHS - 1) as f64;
        let (mut errors, mut lengths) = (Vec::new(), Vec::new());
        let (mut creeping, mut stepped) = (Vec::new(), Vec::new());
        for stone in &found.stones {
            let course = &courses[&stone.stone];
            let last = course.face * course.truth[EPOCHS - 1];
            let velocity = if self.creep_m != 0.0 {
                last / years
            } else {
                Vector3::zeros()
            };
            let error = stone.velocity.value - velocity;
            if self.step_m == 0.0 {
                errors.extend((0..3).map(|axis| [error[axis], stone.velocity.sd[axis]]));
                lengths.push(1e3 * error.norm());
            }
            if velocity.norm() > 0.5 * self.creep_m && self.creep_m != 0.0 {
                creeping.push(found.answers.trend.stones.contains(&stone.stone.0));
            }
            if self.step_m != 0.0 && last.norm() > 0.5 * self.step_m {
                stepped.push(stone.step.as_ref().is_some_and(|s| s.epoch == STEP_EPOCH));
            }
        }
        let share = |list: &[bool]| list.iter().filter(|is| **is).count() as f64 / list.len() as f64;
        let mut figures = Figures::new();
        if !errors.is_empty() {
            for (level, text) in LEVELS {
                figures.insert(format!("velocity_{text}"), coverage(&errors, level));
            }
            let score = errors
                .iter()
                .map(|[e, sd]| interval_score(*e, *sd, 0.95))
                .sum::<f64>();
            figures.insert("velocity_score".to_owned(), 1e3 * score / errors.len() as f64);
            figures.insert("velocity_rmse".to_owned(), rms(lengths));
        }
        if !creeping.is_empty() {
            figures.insert("creep_named".to_owned(), share(&creeping));
        }
        if !stepped.is_empty() {
            figures.insert("steps_named".to_owned(), share(&stepped));
        }
        if self.creep_m == 0.0 && self.step_m == 0.0 {
            let answers = [&found.answers.trend, &found.answers.anomaly];
            let is_false = answers.iter().any(|a| a.answer == Word::Yes);
            figures.insert("false_verdict".to_owned(), f64::from(u8::from(is_false)));
        }
        Ok(figures)
    }
}

impl Course {
    fn looks(&self, id: StoneId) -> StoneSeries {
        let look = |found: &Option<(Vector3<f64>, Matrix3<f64>)>| {
            let (deformation, covariance) = (*found)?;
            Some(PairLook {
                value: self.face * deformation,
                variance: (self.face * covariance * self.face.transpose()).diagonal(),
                reference_share: REFERENCE_SHARE,
            })
        };
        let pairs: Vec<Option<PairLook>> = self.place.deformations.iter().map(look).collect();
        StoneSeries::of_pairs(id, 0, &pairs)
    }
}

fn epochs() -> Vec<SeriesEpoch> {
    let epoch = |k: usize| {
        let years = 2019.27 + APART * k as f64;
        SeriesEpoch {
            name: k.to_string(),
            years: Some(years),
            of_year: years.rem_euclid(1.0),
            level: None,
            temperature: None,
        }
    };
    (0..EPOCHS).map(epoch).collect()
}
