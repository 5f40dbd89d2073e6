//! The facts that the report states in words.

use crate::texts::Texts;
use crate::verdict::{Course, Pair, is_doubted, verdict_in};
use nalgebra::Point2;
use std::collections::BTreeMap;
use stonewise_base::profile::Profile;
use stonewise_base::report_params::ReportParams;
use stonewise_results::records::{EpochVerdict, StoneVerdict};
use stonewise_results::{ResultSet, RowMotion, Sorted, Status, StoneRow, component_limit_m, nice_scale_m};

/// Share of stones at rest whose motion the 95 % test finds above its limit.
pub(crate) const FALSE_ALARMS: f64 = 0.05;

/// Counts and order statistics of one run.
pub(crate) struct Summary<'a> {
    /// The texts in the language of the report.
    pub texts: &'static Texts,
    pub stones: usize,
    /// Stones of each status that occurs, in the order of [`Status::ALL`].
    pub by_status: Vec<(Status, Vec<&'a StoneRow>)>,
    /// Measured stones with their motion.
    pub measured: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// Number of stones above their own 95 % limit.
    pub above_limit: usize,
    /// Stones that moved, with the false discovery rate over all stones controlled; largest motion first.
    pub moved: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// The verdict on this pair of epochs.
    pub verdict: EpochVerdict,
    /// Order and words of the report.
    pub profile: Profile,
    /// What the first page says beside the results.
    pub cover: ReportParams,
    /// Loose ones, largest relative motion first.
    pub loose: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// Detection limits, metres.
    pub limits: Sorted,
    /// Components along, up, out of the measured stones, metres.
    pub components: [Sorted; 3],
    /// End of the colour scale that these components and the M3C2 distances share, metres.
    pub component_limit_m: f64,
    /// Where nine tenths of the stones that moved lie: (along, up) from and to, metres.
    pub region: Option<[Point2<f64>; 2]>,
    /// The least of the largest tenth of their motions, metres, and where nine tenths of those lie; `None`
    /// for few stones.
    pub strongest: Option<(f64, [Point2<f64>; 2])>,
}

impl<'a> Summary<'a> {
    /// The facts of these results, said in the language and the words of their project.
    pub(crate) fn new(results: &'a ResultSet) -> Self {
        let run = results.run.as_ref();
        let cover = run.map(|r| r.parameters.report.clone()).unwrap_or_default();
        // One of the program's, the user's that the run kept, or else the plain one.
        let profile = Profile::shipped(&cover.profile)
            .or_else(|| results.evidence.profile.clone())
            .unwrap_or_else(Profile::plain);
        let texts = Texts::with(cover.language, &profile);
        Self::of(results, cover, profile, texts)
    }

    pub(crate) fn of(
        results: &'a ResultSet,
        cover: ReportParams,
        profile: Profile,
        texts: &'static Texts,
    ) -> Self {
        let measured = results.measured();
        let verdict = verdict(results, texts);
        let judged: BTreeMap<u32, &StoneVerdict> = verdict.stones.iter().map(|s| (s.stone_id, s)).collect();
        let has_moved = |s: &StoneRow| judged.get(&s.stone_id).is_some_and(|j| j.moved);

        let pick = |keep: &dyn Fn(&StoneRow, &RowMotion) -> bool, size: fn(&RowMotion) -> f64| {
            let mut all: Vec<_> = measured.iter().copied().filter(|(s, m)| keep(s, m)).collect();
            all.sort_by(|a, b| {
                size(b.1)
                    .total_cmp(&size(a.1))
                    .then(a.0.stone_id.cmp(&b.0.stone_id))
            });
            all
        };

        let moved = pick(&|s, _| has_moved(s), |m| m.displacement.norm());
        let loose = pick(&|_, m| m.loose, |m| m.relative.norm());
        let of_status = |status| {
            results
                .stones
                .iter()
                .filter(|s| s.status == status)
                .collect::<Vec<_>>()
        };

        Self {
            stones: results.stones.len(),
            by_status: Status::ALL
                .map(|s| (s, of_status(s)))
                .into_iter()
                .filter(|(_, s)| !s.is_empty())
                .collect(),
            region: region(results, &moved),
            strongest: strongest(results, &moved),
            loose,
            limits: Sorted::new(measured.iter().map(|(_, m)| m.detection_limit_m)),
            components: [0, 1, 2].map(|k| Sorted::new(measured.iter().map(|(_, m)| m.face[k]))),
            component_limit_m: shared_scale_m(results, &measured),
            above_limit: measured.iter().filter(|(_, m)| m.significant).count(),
            profile,
            cover,
            moved,
            measured,
            verdict,
            texts,
        }
    }

    /// Number of stones without a motion.
    pub(crate) fn not_measured(&self) -> usize {
        self.stones - self.measured.len()
    }
}

/// Stones determine the scale; M3C2 distances do where no stone is measured.
fn shared_scale_m(results: &ResultSet, measured: &[(&StoneRow, &RowMotion)]) -> f64 {
    if measured.is_empty() {
        nice_scale_m(results.distances.iter().map(|d| d.distance_m.abs()))
    } else {
        component_limit_m(measured.iter().map(|(_, m)| *m), &results.thresholds())
    }
}

/// A tenth of the stones that moved must be at least this many to have a place of their own.
const LEAST_STRONGEST: usize = 5;

fn strongest(results: &ResultSet, moved: &[(&StoneRow, &RowMotion)]) -> Option<(f64, [Point2<f64>; 2])> {
    let tenth = &moved[..moved.len() / 10];
    let least = tenth.last().filter(|_| tenth.len() >= LEAST_STRONGEST)?;
    Some((least.1.displacement.norm(), region(results, tenth)?))
}

/// The verdict on the pair: from verdict.json; made from the tables where an earlier version wrote none.
fn verdict(results: &ResultSet, texts: &'static Texts) -> EpochVerdict {
    let written = results.verdict.as_ref();
    if let Some(verdict) = written.and_then(|v| v.epochs.get(results.pair - 1)) {
        return verdict.clone();
    }
    let run = results.run.as_ref();
    let epochs: Vec<(&str, Option<&str>)> = run
        .into_iter()
        .flat_map(|r| r.epochs.iter().map(|e| (e.name.as_str(), e.date.as_deref())))
        .collect();
    let course = Course {
        epochs: &epochs,
        trends: results.trends.as_ref(),
        stones: &results.courses,
    };
    let name = |epoch: usize| epochs.get(epoch).map_or("", |(name, _)| *name);
    let pair = Pair {
        epochs: [name(0), name(results.pair)],
        in_doubt: run.is_some_and(|r| is_doubted(&r.warnings, name(results.pair), course.later())),
        course: &course,
    };
    let thresholds = run.map(|r| r.parameters.thresholds.clone()).unwrap_or_default();
    verdict_in(results, &pair, &thresholds, texts)
}

fn region(results: &ResultSet, moved: &[(&StoneRow, &RowMotion)]) -> Option<[Point2<f64>; 2]> {
    let places: Vec<Point2<f64>> = moved
        .iter()
        .map(|(s, _)| results.facade.place(&s.centroid))
        .collect();
    let axis = |k: usize| Sorted::new(places.iter().map(|p| p[k]));
    let (along, up) = (axis(0), axis(1));
    Some([
        Point2::new(along.quantile(0.05)?, up.quantile(0.05)?),
        Point2::new(along.quantile(0.95)?, up.quantile(0.95)?),
    ])
}
