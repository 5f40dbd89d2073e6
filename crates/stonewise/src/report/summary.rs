//! The facts that the report states in words.

use crate::figure::number;
use crate::results::{ResultSet, RowMotion, Sorted, Status, StoneRow, component_limit_m};
use nalgebra::Point2;

/// Share of stones at rest that the 95 % test calls significant.
pub(crate) const FALSE_ALARMS: f64 = 0.05;

/// Counts and order statistics of one run.
pub(crate) struct Summary<'a> {
    pub stones: usize,
    /// Stones of each status that occurs, in the order of [`Status::ALL`].
    pub by_status: Vec<(Status, Vec<&'a StoneRow>)>,
    /// Measured stones with their motion.
    pub measured: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// Those that moved significantly, largest motion first.
    pub significant: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// Loose ones, largest relative motion first.
    pub loose: Vec<(&'a StoneRow, &'a RowMotion)>,
    /// Detection limits, metres.
    pub limits: Sorted,
    /// Components along, up, out of the measured stones, metres.
    pub components: [Sorted; 3],
    /// Where nine tenths of the significant stones lie: (along, up) from and to, metres.
    pub region: Option<[Point2<f64>; 2]>,
    /// The least of the largest tenth of the significant motions, metres, and where nine tenths of those lie; `None` for
    /// few stones.
    pub strongest: Option<(f64, [Point2<f64>; 2])>,
}

impl<'a> Summary<'a> {
    pub(crate) fn new(results: &'a ResultSet) -> Self {
        let measured = results.measured();
        let pick = |keep: fn(&RowMotion) -> bool, size: fn(&RowMotion) -> f64| {
            let mut all: Vec<_> = measured.iter().copied().filter(|(_, m)| keep(m)).collect();
            all.sort_by(|a, b| {
                size(b.1)
                    .total_cmp(&size(a.1))
                    .then(a.0.stone_id.cmp(&b.0.stone_id))
            });
            all
        };
        let significant = pick(|m| m.significant, |m| m.displacement.norm());
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
            region: region(results, &significant),
            strongest: strongest(results, &significant),
            loose: pick(|m| m.loose, |m| m.relative.norm()),
            limits: Sorted::new(measured.iter().map(|(_, m)| m.detection_limit_m)),
            components: [0, 1, 2].map(|k| Sorted::new(measured.iter().map(|(_, m)| m.face[k]))),
            significant,
            measured,
        }
    }

    /// Whether more stones moved significantly than the test's false alarms explain (three standard deviations).
    pub(crate) fn motion_is_proven(&self) -> bool {
        let n = self.measured.len() as f64;
        let expected = FALSE_ALARMS * n;
        self.significant.len() as f64 > expected + 3.0 * (expected * (1.0 - FALSE_ALARMS)).sqrt().max(1.0)
    }

    /// Decimals of a millimetre in tables: one, two where the typical detection limit is below 1 mm.
    pub(crate) fn decimals(&self) -> usize {
        if self.limits.median().is_some_and(|l| l < 1e-3) {
            2
        } else {
            1
        }
    }

    /// Millimetres for tables.
    pub(crate) fn mm(&self, metres: f64) -> String {
        number(metres * 1e3, self.decimals())
    }

    /// End of the colour scale that the components share, metres.
    pub(crate) fn component_limit_m(&self) -> f64 {
        component_limit_m(self.measured.iter().map(|(_, m)| *m))
    }

    /// Number of stones without a motion.
    pub(crate) fn not_measured(&self) -> usize {
        self.stones - self.measured.len()
    }
}

/// A tenth of the significant stones must be at least so many to have a place of their own.
const LEAST_STRONGEST: usize = 5;

fn strongest(
    results: &ResultSet,
    significant: &[(&StoneRow, &RowMotion)],
) -> Option<(f64, [Point2<f64>; 2])> {
    let tenth = &significant[..significant.len() / 10];
    let least = tenth.last().filter(|_| tenth.len() >= LEAST_STRONGEST)?;
    Some((least.1.displacement.norm(), region(results, tenth)?))
}

fn region(results: &ResultSet, significant: &[(&StoneRow, &RowMotion)]) -> Option<[Point2<f64>; 2]> {
    let places: Vec<Point2<f64>> = significant
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
