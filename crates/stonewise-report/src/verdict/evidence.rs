//! What the verdict needs, from result files.

use super::assess::assess;
use super::case::{Case, JointCase, StoneCase, StoneMeasured};
use super::interval::Estimate;
use super::judged::millimetres;
use super::lost::lost_stones;
use super::time::Course;
use crate::texts::Texts;
use nalgebra::{Point2, Vector3, center};
use stonewise_base::report_params::Language;
use stonewise_base::thresholds::Thresholds;
use stonewise_core::geometry::{DisplacementSample, SmallMotion};
use stonewise_core::registration::DeformationZone;
use stonewise_results::records::{DatumState, DeformationVerdict, DeformedZone, EpochVerdict, State};
use stonewise_results::{Joint, ResultSet, RowMotion, Status, StoneRow, ZonePlace, joints};

/// What the verdict on a pair of epochs is drawn from beside the results of the pair.
pub struct Pair<'a> {
    /// Names of the two epochs.
    pub epochs: [&'a str; 2],
    /// There is a doubt about the run as a whole.
    pub in_doubt: bool,
    /// All epochs in time.
    pub course: &'a Course<'a>,
}

/// The verdict on the pair of epochs of these results.
pub fn verdict_on(
    results: &ResultSet,
    pair: &Pair,
    thresholds: &Thresholds,
    language: Language,
) -> EpochVerdict {
    verdict_in(results, pair, thresholds, Texts::of(language))
}

/// The same in these texts.
pub(crate) fn verdict_in(
    results: &ResultSet,
    pair: &Pair,
    thresholds: &Thresholds,
    texts: &'static Texts,
) -> EpochVerdict {
    let converged = results
        .registration
        .as_ref()
        .is_none_or(|r| r.estimator.converged());
    let case = Case {
        epochs: pair.epochs.map(str::to_owned),
        datum: results.datum().map(|d| d.state),
        not_converged: !converged,
        in_doubt: pair.in_doubt,
        time: pair.course.of_pair(pair.epochs[1]),
        stones: stones(results, pair.course),
        joints: joints(results).iter().filter_map(|j| joint(results, j)).collect(),
        deformation: deformation(results),
    };
    assess(&case, thresholds, texts)
}

fn stones(results: &ResultSet, course: &Course) -> Vec<StoneCase> {
    let tested = Tested::of(results);
    let stone = |(stone, lost): (&StoneRow, bool)| StoneCase {
        stone_id: stone.stone_id,
        place: Point2::new(stone.along_m, stone.up_m),
        lost,
        is_masonry: stone.status != Status::NotMasonry,
        rate: course.rate(stone.stone_id),
        departure: course.departure(stone.stone_id),
        measured: stone.motion.as_ref().map(|motion| StoneMeasured {
            motion: Estimate {
                vector: results.world_from_face(stone).transpose() * tested.motion(stone, motion),
                covariance: results.face_covariance(stone, motion),
            },
            neighbours: Estimate {
                vector: motion.relative,
                covariance: motion.relative_covariance,
            },
            above_limit: motion.significant,
            loose: motion.loose,
            shape_tested: stone.body_id == Some(1) && motion.deformation_sd[0].is_some(),
            detection_limit_m: motion.detection_limit_m,
        }),
    };
    results
        .stones
        .iter()
        .zip(lost_stones(results))
        .map(stone)
        .collect()
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

/// Whether and where the wall changed its shape.
fn deformation(results: &ResultSet) -> Option<DeformationVerdict> {
    let record = results.registration.as_ref()?.deformation.as_ref()?;
    let zone = |zone: &DeformationZone| {
        let place = ZonePlace::of(zone, &results.stones);
        let metres = |m: f64| millimetres(m) / 1e3;
        if place.area_m2 <= 0.0 {
            return None;
        }
        Some(DeformedZone {
            zone_id: zone.number,
            state: State::default(),
            decided_by: None,
            kind: zone.kind,
            against: zone.against,
            along_m: metres(place.middle_m[0]),
            up_m: metres(place.middle_m[1]),
            diameter_m: zone.diameter_m.map(metres),
            length_m: metres(zone.length_m),
            width_m: metres(zone.width_m),
            area_m2: (1e4 * place.area_m2).round() / 1e4,
            mean_mm: zone.mean_m.map(millimetres).into(),
            largest_mm: millimetres(zone.largest_m),
            interval_mm: zone.interval_m.map(millimetres),
        })
    };

    let zones: Vec<DeformedZone> = record.zones.iter().filter_map(zone).collect();
    Some(DeformationVerdict {
        shown: !zones.is_empty(),
        p: record.p,
        largest_mm: zones.first().map(|z| z.largest_mm),
        interval_mm: zones.first().map(|z| z.interval_mm),
        detection_limit_mm: record.detection_limits_m.map(|limit| limit.map(millimetres)),
        detection_limit_in_face_mm: record.limits_in_face_m.map(|limit| limit.map(millimetres)),
        zones,
    })
}

/// What the motions are tested against.
enum Tested<'a> {
    /// The ground.
    Absolute,
    /// The common motion of the wall, from registration.json.
    Recorded(&'a ResultSet),
    /// The common motion fitted to the stones, where the record of an earlier version does not have it.
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
    use crate::testing::{folder, registration_record, rows};
    use nalgebra::Vector6;
    use std::collections::BTreeMap;
    use stonewise_base::files::write_json;
    use stonewise_core::geometry::lever;
    use stonewise_results::records::{Datum, EstimatorRecord, RegistrationRecord};

    fn judged(results: &ResultSet) -> EpochVerdict {
        let course = Course {
            epochs: &[("A", None), ("B", None)],
            trends: None,
            stones: &BTreeMap::new(),
        };
        let pair = Pair {
            epochs: ["A", "B"],
            in_doubt: false,
            course: &course,
        };
        verdict_on(results, &pair, &Thresholds::default(), Language::English)
    }

    /// Results whose stones all made one more rigid motion; `recorded`: whether the record contains it.
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
        let mut record = RegistrationRecord {
            datum,
            ..registration_record()
        };
        if let EstimatorRecord::Adjustment(adjustment) = &mut record.estimator {
            adjustment.converged = true;
        }
        write_json(&folder.path().join("data/registration.json"), &record).unwrap();
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
