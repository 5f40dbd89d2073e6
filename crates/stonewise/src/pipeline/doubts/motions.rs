//! Doubts about the motions of a pair of epochs.

use super::check::Check;
use super::fit::Fit;
use super::rules::{CONFIRMED, COVERED, MEASURED, SENSITIVE, SETTLED};
use crate::pipeline::steps::register::Registered;
use crate::results::records::EstimatorRecord;
use crate::results::{Status, StoneRow};
use crate::texts::Said;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::stone::StoneMotion;

/// Distance from a stone within which the wall should show others, and the size of the squares that are counted, metres.
const AROUND_M: f64 = 2.0;
const SQUARE_M: f64 = 0.5;
/// Half width of a 95 % interval, in standard deviations.
const SIGMAS_95: f64 = 1.96;

/// The adjustment stopped before its motions had settled.
pub(super) fn unsettled(registered: &Registered, fit: Fit) -> Option<Check> {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return None;
    };
    let unsettled = u8::from(!adjustment.converged);
    let iterations = adjustment.iterations.to_string();
    Some(SETTLED.check(f64::from(unsettled), || {
        [("iterations", iterations.into()), ("cause", fit.cause())]
    }))
}

/// Most of the stones that were found in both epochs could not be measured.
pub(super) fn few_measured(rows: &[StoneRow], fit: Fit) -> Option<Check> {
    let matched = rows.iter().filter(|r| r.matched_id.is_some()).count();
    let measured = rows.iter().filter(|r| r.status == Status::Ok).count();
    let values = || {
        let counts = Status::ALL.iter().filter_map(|status| {
            let n = rows
                .iter()
                .filter(|r| r.status == *status && r.matched_id.is_some() && *status != Status::Ok)
                .count();
            (n > 0).then(|| format!("{n} {}", status.word()))
        });
        [
            ("measured", measured.to_string().into()),
            ("matched", matched.to_string().into()),
            ("reasons", counts.collect::<Vec<_>>().join(", ").into()),
            ("cause", fit.cause()),
        ]
    };
    (matched > 0).then(|| MEASURED.check(measured as f64 / matched as f64, values))
}

/// The measured stones cover little of the walls that the clouds show around them; `walls_m2`: area of all walls. Farther
/// away there may be rock or other buildings.
pub(super) fn uncovered(rows: &[StoneRow], walls_m2: f64) -> Option<Check> {
    let measured: Vec<&StoneRow> = rows.iter().filter(|r| r.status == Status::Ok).collect();
    let area_m2: f64 = measured.iter().map(|r| r.area_m2).sum();
    let walls_m2 = walls_m2.min(around_m2(&measured));
    let values = || {
        [
            ("measured", measured.len().to_string().into()),
            ("area", Said::numbers(format!("{area_m2:.1}"))),
            ("walls", Said::numbers(format!("{walls_m2:.1}"))),
        ]
    };
    (walls_m2 > 0.0).then(|| COVERED.check(area_m2 / walls_m2, values))
}

/// Area of the face around stones.
fn around_m2(stones: &[&StoneRow]) -> f64 {
    let squares = |stone: &&StoneRow| {
        let (along, up) = (stone.along_m / SQUARE_M, stone.up_m / SQUARE_M);
        let reach = (AROUND_M / SQUARE_M) as i64;
        let near = (-reach..=reach).flat_map(move |x| (-reach..=reach).map(move |y| [x, y]));
        near.filter(move |[x, y]| x * x + y * y <= reach * reach)
            .map(move |[x, y]| [along as i64 + x, up as i64 + y])
    };
    let all: BTreeSet<[i64; 2]> = stones.iter().flat_map(squares).collect();
    SQUARE_M * SQUARE_M * all.len() as f64
}

/// A part of the wall that is too large to be a mistake of some masks has no motion because nothing confirms it.
pub(super) fn refused(rows: &[StoneRow]) -> Check {
    let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for row in rows.iter().filter(|r| r.status == Status::FailedDisagreement) {
        if let Some(body) = row.body_id.filter(|body| *body > 1) {
            parts.entry(body).or_default().push(row.stone_id);
        }
    }
    let largest = parts.into_values().max_by_key(Vec::len).unwrap_or_default();
    CONFIRMED.check(largest.len() as f64, || {
        [
            ("stones", largest.len().to_string().into()),
            ("stone", largest[0].to_string().into()),
        ]
    })
}

/// Motions are far less certain than the points allow.
pub(super) fn blind(registered: &Registered, rows: &[StoneRow], fit: Fit) -> Option<Check> {
    let points: BTreeMap<u32, [f64; 2]> = rows
        .iter()
        .filter_map(|r| Some((r.stone_id, [f64::from(r.points_1), f64::from(r.points_2?)])))
        .collect();
    let ratio = |(stone, motion): (u32, &StoneMotion)| {
        let [one, two] = points.get(&stone)?.map(|n| n.max(1.0));
        let allowed = motion.rmse_m * (1.0 / one + 1.0 / two).sqrt();
        let covariance = motion.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let sd = covariance.symmetric_eigenvalues().max().max(0.0).sqrt();
        (allowed > 0.0).then_some((sd / allowed, sd))
    };
    let measured = registered.results.iter();
    let measured = measured.filter_map(|r| Some((r.first.0, r.motion.as_ref().ok()?)));
    let mut all: Vec<(f64, f64)> = measured.filter_map(ratio).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &(excess, sd) = all.get(all.len() / 2)?;
    Some(SENSITIVE.check(excess, || {
        [
            ("limit", format!("{:.0}", 1e3 * SIGMAS_95 * sd).into()),
            ("excess", format!("{excess:.0}").into()),
            ("cause", fit.cause()),
        ]
    }))
}

#[cfg(test)]
mod tests {
    use super::super::check::said;
    use super::*;
    use crate::testing::{registration_record, rows};
    use nalgebra::{Matrix3, Matrix6, Vector3};
    use stonewise_core::geometry::Rigid3;
    use stonewise_core::id::StoneId;
    use stonewise_core::stone::{MotionFailure, PairResult, SharedParts};

    /// Motions of the stones that have one in `rows`, with these standard deviations and residuals.
    fn registered(rows: &[StoneRow], sd_m: f64, rmse_m: f64) -> Registered {
        let motion = StoneMotion {
            second_from_first: Rigid3::identity(),
            displacement: Vector3::zeros(),
            rotation: Vector3::zeros(),
            covariance: Matrix6::identity() * sd_m.powi(2),
            shared: SharedParts::default(),
            relative: Vector3::zeros(),
            relative_covariance: Matrix3::identity(),
            loose: false,
            p_loose: None,
            observability: 1.0,
            rmse_m,
        };
        let pair = |row: &StoneRow| PairResult {
            body: 1,
            first: StoneId(row.stone_id),
            second: StoneId(row.stone_id),
            motion: match row.status {
                Status::Ok => Ok(motion.clone()),
                _ => Err(MotionFailure::NotConverged),
            },
        };
        Registered {
            results: rows.iter().map(pair).collect(),
            neighbours: Vec::new(),
            estimator: registration_record().estimator,
            epoch_errors: None,
            error_stones: Vec::new(),
            deformation: None,
            off_wall: Vec::new(),
            folder: std::path::PathBuf::new(),
        }
    }

    #[test]
    fn an_adjustment_that_did_not_converge_is_a_doubt() {
        let mut registered = registered(&rows(), 0.001, 0.001);
        let message = said(unsettled(&registered, Fit::default())).unwrap();
        assert!(
            message.english.contains("did not converge in 32 iterations"),
            "{message}"
        );
        if let EstimatorRecord::Adjustment(adjustment) = &mut registered.estimator {
            adjustment.converged = true;
        }
        assert_eq!(said(unsettled(&registered, Fit::default())), None);
    }

    #[test]
    fn less_than_half_of_the_matched_stones_measured_is_a_doubt() {
        // 22 of 24 stones are matched and 20 measured.
        let mut rows = rows();
        assert_eq!(said(few_measured(&rows, Fit::default())), None);
        let measured = rows.iter_mut().filter(|r| r.status == Status::Ok);
        measured
            .take(9)
            .for_each(|r| r.status = Status::FailedConvergence);
        // 11 of 22 are half.
        assert_eq!(said(few_measured(&rows, Fit::default())), None);
        let mut measured = rows.iter_mut().filter(|r| r.status == Status::Ok);
        measured.next().unwrap().status = Status::FailedDisagreement;
        let message = said(few_measured(&rows, Fit::default())).unwrap();
        for part in [
            "only 10 of the 22 stones",
            "1 failed_points",
            "9 failed_convergence",
            "1 failed_disagreement",
            "1 unobservable",
        ] {
            assert!(message.english.contains(part), "{part}: {message}");
        }
        assert!(!message.english.contains("unmatched"), "{message}");
    }

    #[test]
    fn stones_that_cover_less_than_a_tenth_of_the_walls_are_a_doubt() {
        // Twenty stones at one place, with two metres of the face around them: 12.25 m2 in squares of half a metre.
        let with_area = |area_m2: f64| -> Vec<StoneRow> {
            let place = |row: StoneRow| StoneRow {
                area_m2: area_m2 / 20.0,
                along_m: 5.2,
                up_m: 1.3,
                ..row
            };
            rows().into_iter().map(place).collect()
        };
        assert_eq!(said(uncovered(&with_area(1.01), 10.0)), None);
        let message = said(uncovered(&with_area(0.99), 10.0)).unwrap();
        for part in ["the 20 measured stones", "1.0 m2 of the 10.0 m2"] {
            assert!(message.english.contains(part), "{part}: {message}");
        }
        // Of the walls of a valley, those around the stones count.
        assert_eq!(said(uncovered(&with_area(1.23), 1000.0)), None);
        assert!(said(uncovered(&with_area(1.22), 1000.0)).is_some());
    }

    #[test]
    fn a_part_of_ten_stones_that_nothing_confirms_is_a_doubt() {
        let mut rows = rows();
        for row in &mut rows[..10] {
            row.status = Status::FailedDisagreement;
            row.body_id = Some(2);
        }
        let message = said(Some(refused(&rows))).unwrap();
        let first = rows[0].stone_id;
        let part = format!("10 neighbouring stones of a part of the wall, around stone {first},");
        assert!(message.english.contains(&part), "{message}");
        // Scans alone have no photos that could contradict it.
        assert!(!message.english.contains("photo"), "{message}");
        rows[0].status = Status::Ok;
        assert_eq!(said(Some(refused(&rows))), None);
    }

    #[test]
    fn limits_a_hundred_times_what_the_points_allow_are_a_doubt() {
        // About 2,000 and 1,900 points with residuals of 1 mm allow 0.032 mm.
        let rows = rows();
        assert_eq!(
            said(blind(&registered(&rows, 0.0031, 0.001), &rows, Fit::default())),
            None
        );
        let message = said(blind(&registered(&rows, 0.0033, 0.001), &rows, Fit::default())).unwrap();
        assert!(
            message.english.contains("below about 6 mm") && message.english.contains("103 times"),
            "{message}"
        );
        // A wall without measured stones, and stones whose residuals are zero, show no limit.
        assert_eq!(
            said(blind(&registered(&[], 1.0, 0.001), &rows, Fit::default())),
            None
        );
        assert_eq!(
            said(blind(&registered(&rows, 1.0, 0.0), &rows, Fit::default())),
            None
        );
    }
}
