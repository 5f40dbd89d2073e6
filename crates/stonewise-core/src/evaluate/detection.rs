//! Whether alarms are right.

use crate::evaluate::MotionSample;
use serde::{Deserialize, Serialize};

/// Alarms ("moved, significant at 95 %") against truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Samples that truly stayed.
    pub still: usize,
    /// Samples that truly stayed and raised an alarm.
    pub false_alarms: usize,
    /// `false_alarms` / `still`; about 0.05 is right.
    pub false_alarm_rate: Option<f64>,
    /// Samples that truly moved.
    pub moved: usize,
    /// Samples that truly moved and raised an alarm.
    pub hits: usize,
    /// `hits` / `moved`.
    pub hit_rate: Option<f64>,
    /// Samples that truly moved by more than their own detection limit.
    pub detectable: usize,
    /// Samples that truly moved by more than their own detection limit and raised an alarm.
    pub detectable_hits: usize,
    /// `detectable_hits` / `detectable`.
    pub detectable_hit_rate: Option<f64>,
}

impl Detection {
    /// Counts alarms among samples that say whether they are significant; still is what moves at most
    /// `still_m`.
    pub(super) fn of(samples: &[MotionSample], still_m: f64) -> Self {
        let mut d = Self::default();
        for (sample, alarm) in samples.iter().filter_map(|s| Some((s, s.significant?))) {
            let truth_m = sample.truth.norm();
            if truth_m <= still_m {
                d.still += 1;
                d.false_alarms += usize::from(alarm);
            } else {
                d.moved += 1;
                d.hits += usize::from(alarm);
                if sample.detection_limit_m.is_some_and(|limit| truth_m > limit) {
                    d.detectable += 1;
                    d.detectable_hits += usize::from(alarm);
                }
            }
        }
        d.false_alarm_rate = share(d.false_alarms, d.still);
        d.hit_rate = share(d.hits, d.moved);
        d.detectable_hit_rate = share(d.detectable_hits, d.detectable);
        d
    }
}

/// Stones reported as loose against stones that are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LooseDetection {
    /// Truly loose stones with an estimate.
    pub truly_loose: usize,
    /// Stones reported as loose.
    pub reported: usize,
    /// Stones that are both.
    pub right: usize,
    /// `right` / `reported`.
    pub precision: Option<f64>,
    /// `right` / `truly_loose`.
    pub recall: Option<f64>,
}

impl LooseDetection {
    /// `None` where no sample has both flags.
    pub(super) fn of(samples: &[MotionSample]) -> Option<Self> {
        let flags: Vec<(bool, bool)> = samples.iter().filter_map(|s| s.loose).collect();
        let count = |f: fn(&(bool, bool)) -> bool| flags.iter().filter(|x| f(x)).count();
        let (reported, truly_loose) = (count(|x| x.0), count(|x| x.1));
        let right = count(|x| x.0 && x.1);
        (!flags.is_empty()).then(|| Self {
            truly_loose,
            reported,
            right,
            precision: share(right, reported),
            recall: share(right, truly_loose),
        })
    }
}

/// `None` of nothing.
pub(super) fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}
