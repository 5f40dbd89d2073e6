//! What the verdict needs, from result files.

use super::assess::assess;
use super::case::{Case, JointCase, StoneCase, StoneMeasured};
use super::interval::Estimate;
use crate::report_params::Language;
use crate::results::records::{DatumState, EpochVerdict};
use crate::results::{Joint, ResultSet, RowMotion, Status, StoneRow, compare, joints};
use crate::thresholds::Thresholds;
use nalgebra::{Point2, Vector3, center};
use stonewise_core::geometry::{DisplacementSample, SmallMotion};

/// A stone is well seen where so many photos and points show it and its points got this share of the votes.
const WELL_SEEN_PHOTOS: u32 = 2;
const WELL_SEEN_POINTS: u32 = 100;
const WELL_SEEN_CONFIDENCE: f64 = 0.6;
/// A stone whose surface is still within this distance, metres, is there: its mask is missing, not the stone.
const STILL_THERE_M: f64 = 0.02;

/// The verdict on the pair of epochs of these results. `in_doubt`: there is a doubt about the run as a whole;
/// `epochs`: their names.
pub(crate) fn verdict_on(
    results: &ResultSet,
    epochs: [String; 2],
    in_doubt: bool,
    thresholds: &Thresholds,
    language: Language,
) -> EpochVerdict {
    let converged = results
        .registration
        .as_ref()
        .is_none_or(|r| r.estimator.converged());
    let case = Case {
        epochs,
        datum: results.datum().map(|d| d.state),
        not_converged: !converged,
        in_doubt,
        stones: stones(results),
        joints: joints(results).iter().filter_map(|j| joint(results, j)).collect(),
    };
    assess(&case, thresholds, language)
}

fn stones(results: &ResultSet) -> Vec<StoneCase> {
    let on_stone = compare(results).on_stone;
    let tested = Tested::of(results);
    let stone = |(stone, distance): (&StoneRow, &Option<f64>)| StoneCase {
        stone_id: stone.stone_id,
        place: Point2::new(stone.along_m, stone.up_m),
        lost: is_lost(stone, *distance),
        measured: stone.motion.as_ref().map(|motion| StoneMeasured {
            motion: Estimate {
                vector: tested.motion(stone, motion),
                covariance: motion.covariance,
            },
            neighbours: Estimate {
                vector: motion.relative,
                covariance: motion.relative_covariance,
            },
            above_limit: motion.significant,
            loose: motion.loose,
            detection_limit_m: motion.detection_limit_m,
        }),
    };
    results.stones.iter().zip(&on_stone).map(stone).collect()
}

/// Whether the first epoch shows the stone well and the later one its place without it; `distance_m`: M3C2 on
/// the stone.
fn is_lost(stone: &StoneRow, distance_m: Option<f64>) -> bool {
    stone.status == Status::UnmatchedLost
        && stone.photos >= WELL_SEEN_PHOTOS
        && stone.points_1 >= WELL_SEEN_POINTS
        && stone.confidence >= WELL_SEEN_CONFIDENCE
        && distance_m.is_none_or(|d| d.abs() > STILL_THERE_M)
}

fn joint(results: &ResultSet, joint: &Joint) -> Option<JointCase> {
    let motion = joint.motion?;
    let [a, b] = joint.line;
    Some(JointCase {
        stones: joint.stones.map(|i| results.stones[i].stone_id),
        place: center(&a, &b),
        opening_m: motion.opening_m,
        sigma_m: motion.opening_sigma_m,
    })
}

/// What the motions are tested against.
enum Tested<'a> {
    /// The ground.
    Absolute,
    /// The common motion of the wall, from registration.json.
    Recorded(&'a ResultSet),
    /// The same from the stones, where the record of an earlier version does not have it.
    Fitted(Box<SmallMotion>),
}

impl<'a> Tested<'a> {
    fn of(results: &'a ResultSet) -> Self {
        let Some(datum) = results.datum().filter(|d| d.state == DatumState::Unknown) else {
            return Self::Absolute;
        };
        if datum.common_motion.is_some() {
            return Self::Recorded(results);
        }
        let sample = |(stone, motion): (&StoneRow, &RowMotion)| {
            (!motion.loose).then_some(DisplacementSample {
                place: stone.centroid,
                displacement: motion.displacement,
                covariance: motion.covariance,
            })
        };
        let samples: Vec<_> = results.measured().into_iter().filter_map(sample).collect();
        SmallMotion::fit(&samples).map_or(Self::Absolute, |common| Self::Fitted(Box::new(common)))
    }

    fn motion(&self, stone: &StoneRow, motion: &RowMotion) -> Vector3<f64> {
        let common = match self {
            Self::Absolute => None,
            Self::Recorded(results) => results.datum().and_then(|d| d.common_motion_at(&stone.centroid)),
            Self::Fitted(common) => Some(common.at(&stone.centroid)),
        };
        motion.displacement - common.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_json;
    use crate::results::records::{Datum, RegistrationRecord};
    use crate::results::testing::{folder, registration_record, rows};
    use nalgebra::Vector6;
    use stonewise_core::geometry::lever;

    fn judged(results: &ResultSet) -> EpochVerdict {
        let epochs = ["A".to_owned(), "B".to_owned()];
        verdict_on(results, epochs, false, &Thresholds::default(), Language::English)
    }

    #[test]
    fn a_stone_is_lost_only_where_it_was_well_seen_and_its_surface_is_gone() {
        let mut lost = StoneRow {
            status: Status::UnmatchedLost,
            photos: 3,
            points_1: 500,
            confidence: 0.9,
            ..StoneRow::default()
        };
        assert!(is_lost(&lost, None) && is_lost(&lost, Some(-0.12)));
        assert!(!is_lost(&lost, Some(0.004)));
        lost.photos = 1;
        assert!(!is_lost(&lost, None));
        (lost.photos, lost.status) = (3, Status::UnmatchedUnseen);
        assert!(!is_lost(&lost, None));
    }

    /// Results whose stones all made one more rigid motion, which the record tells or does not.
    fn swept(recorded: bool) -> EpochVerdict {
        let common = Vector6::new(0.01, -0.02, 0.005, 1e-4, 2e-4, -1e-4);
        let mut stones = rows();
        let centre = stones[0].centroid;
        for stone in &mut stones {
            let motion = lever(&(stone.centroid - centre)) * common;
            if let Some(own) = &mut stone.motion {
                own.displacement += motion;
            }
        }
        let folder = folder(&stones);
        let mut datum = Datum::unknown(&centre, "unknown".to_owned());
        datum.common_motion = recorded.then(|| common.into());
        let record = RegistrationRecord {
            datum,
            ..registration_record()
        };
        write_json(&folder.path().join("registration.json"), &record).unwrap();
        judged(&ResultSet::read_measured(folder.path(), 1).unwrap())
    }

    #[test]
    fn where_the_datum_is_unknown_motions_are_those_against_the_common_motion() {
        let folder = folder(&rows());
        let still = judged(&ResultSet::read_measured(folder.path(), 1).unwrap());
        let moved = |v: &EpochVerdict| -> Vec<u32> {
            v.stones.iter().filter(|s| s.moved).map(|s| s.stone_id).collect()
        };
        assert_eq!(moved(&still), [8, 15]);
        let recorded = swept(true);
        for (a, b) in still.stones.iter().zip(&recorded.stones) {
            let difference = a.length_mm.unwrap_or(0.0) - b.length_mm.unwrap_or(0.0);
            assert!(difference.abs() < 0.002, "{a:?} {b:?}");
        }
        assert_eq!(moved(&recorded), [8, 15]);
        // Records of earlier versions: the common motion is fitted to all stones but the loose one.
        assert!(moved(&swept(false)).contains(&8));
    }
}
