//! What is known of time: years between two epochs, and what a series says of every stone.

use super::case::TimeCase;
use super::interval::Estimate;
use super::judged::{Compared, FALSE_DISCOVERY_RATE};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use stonewise_results::StoneCourse;
use stonewise_results::calendar::{DAYS_A_YEAR, day_of};
use stonewise_results::records::TrendsRecord;

/// The epochs of a run in time.
pub struct Course<'a> {
    /// Names and dates of all epochs, the reference first.
    pub epochs: &'a [(&'a str, Option<&'a str>)],
    /// What is found of a series; `None` with two epochs.
    pub trends: Option<&'a TrendsRecord>,
    /// What its stones do, by stone.
    pub stones: &'a BTreeMap<u32, StoneCourse>,
}

impl Course<'_> {
    /// Names of the later epochs.
    pub fn later(&self) -> impl Iterator<Item = &str> + Clone {
        self.epochs.iter().skip(1).map(|(name, _)| *name)
    }

    /// What is known of time for the pair of this later epoch. The velocities and departures of a series are judged
    /// with the newest later epoch that takes part in its model or, without a model, with the last one.
    pub(super) fn of_pair(&self, epoch: &str) -> TimeCase {
        let Some(trends) = self.trends else {
            return TimeCase::Pair(self.years());
        };
        let takes_part = |name: &&str| self.later().any(|later| later == *name);
        let newest = trends.epochs.iter().rev().map(String::as_str).find(takes_part);
        match newest.or(self.later().last()) == Some(epoch) {
            true => TimeCase::Newest,
            false => TimeCase::Earlier,
        }
    }

    fn years(&self) -> Option<f64> {
        let [(_, first), (_, later)] = self.epochs else {
            return None;
        };
        let days = day_of((*later)?)? - day_of((*first)?)?;
        (days != 0.0).then(|| days.abs() / DAYS_A_YEAR)
    }

    /// The velocity of a stone, millimetres a year.
    pub(super) fn rate(&self, stone: u32) -> Option<Compared> {
        let course = self.stones.get(&stone)?;
        let velocity = Estimate {
            vector: course.velocity,
            covariance: Matrix3::from_diagonal(&course.velocity_sd.map(|sd| sd * sd)),
        };
        Some(Compared {
            interval: velocity.length_interval().map(|m| 1e3 * m),
            moved: course.velocity_q <= FALSE_DISCOVERY_RATE,
        })
    }

    /// The departure of the newest epoch from what the others predict, in standard deviations, on the axis on which it
    /// is largest. It has no interval, because it is in standard deviations already; where chance explains it among so
    /// many stones, it is zero.
    pub(super) fn departure(&self, stone: u32) -> Option<Compared> {
        let [value, sd]: [Vector3<f64>; 2] = self.stones.get(&stone)?.departure?;
        let is_shown = self.trends?.answers.as_predicted.stones.contains(&stone);
        let size = if is_shown {
            value.component_div(&sd).amax()
        } else {
            0.0
        };
        size.is_finite().then_some(Compared {
            interval: [size, size],
            moved: is_shown,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::series::{Answer, SeriesAnswers};

    const DATED: [(&str, Option<&str>); 3] =
        [("A", Some("2020-01-01")), ("B", Some("2022-01-01")), ("C", None)];

    fn trends(epochs: &[&str], departing: &[u32]) -> TrendsRecord {
        let as_predicted = Answer {
            stones: departing.to_vec(),
            ..Answer::default()
        };
        TrendsRecord {
            version: 1,
            epochs: epochs.iter().map(|e| (*e).to_owned()).collect(),
            undated: Vec::new(),
            terms: Vec::new(),
            basis: None,
            not_separable: Vec::new(),
            conditions: Vec::new(),
            variance_factors: None,
            wall: None,
            zones: Vec::new(),
            answers: SeriesAnswers {
                as_predicted,
                ..SeriesAnswers::default()
            },
        }
    }

    #[test]
    fn a_pair_has_its_years_and_a_series_its_newest_epoch() {
        let none = BTreeMap::new();
        let of = |epochs: &[(&str, Option<&str>)], trends: Option<&TrendsRecord>, epoch: &str| {
            let stones = &none;
            let course = Course {
                epochs,
                trends,
                stones,
            };
            course.of_pair(epoch)
        };
        // 731 days, of which a mean year has 365.25.
        let TimeCase::Pair(Some(years)) = of(&DATED[..2], None, "B") else {
            panic!()
        };
        assert!((years - 731.0 / 365.25).abs() < 1e-12);
        assert_eq!(of(&DATED[1..], None, "C"), TimeCase::Pair(None));
        for (dated, newest) in [
            (&["A", "B"][..], "B"),
            (&["B", "C"], "C"),
            (&["A"], "C"),
            (&[], "C"),
        ] {
            let found = trends(dated, &[]);
            for epoch in ["B", "C"] {
                let is_newest = of(&DATED, Some(&found), epoch) == TimeCase::Newest;
                assert_eq!(is_newest, epoch == newest, "{dated:?} {epoch}");
            }
        }
    }

    #[test]
    fn departures_are_those_of_the_axis_that_departs_most() {
        let of_stone = |departure| StoneCourse {
            velocity: Vector3::new(0.0, 0.0, -0.1),
            velocity_sd: Vector3::repeat(0.001),
            velocity_q: 0.01,
            departure,
        };
        let departure = [
            Vector3::new(0.001, -0.009, 0.002),
            Vector3::new(0.001, 0.002, 0.001),
        ];
        let stones = [
            (1, of_stone(Some(departure))),
            (2, of_stone(None)),
            (3, of_stone(Some(departure))),
        ];
        let course = Course {
            epochs: &DATED,
            trends: Some(&trends(&["A"], &[1])),
            stones: &BTreeMap::from(stones),
        };
        let found = course.departure(1).unwrap();
        assert!((found.interval[0] - 4.5).abs() < 1e-12 && found.moved);
        assert_eq!((course.departure(2), course.departure(4)), (None, None));
        assert_eq!(course.departure(3).map(|c| c.interval), Some([0.0, 0.0]));
        // Far from zero the interval of a length is the first-order one.
        let rate = course.rate(1).unwrap();
        assert!((rate.interval[0] - 98.04).abs() < 0.03 && rate.moved, "{rate:?}");
        assert_eq!(course.rate(4), None);
    }
}
