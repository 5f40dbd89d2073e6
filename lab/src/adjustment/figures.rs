//! What is counted of one measured survey.

use super::trial::Trial;
use crate::figures::{CHI2_3_95, Z95, chi_square, median, rms, share};
use crate::survey::mean;
use crate::table::Figure;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use stonewise_core::geometry::{FaceFrame, lever};
use stonewise_core::registration::{Break, PairPoints};
use stonewise_core::stone::PairResult;

/// Errors beyond this are counted apart, metres.
const OUTLIER_M: f64 = 0.01;
/// Stones nearer to a crack are judged apart, metres.
const NEAR_CRACK_M: f64 = 0.4;

/// The columns of the table.
pub const COLUMNS: [Figure<Figures>; 30] = [
    ("share", 3, |f| f.measured),
    ("in 2D", 3, |f| f.in_plane),
    ("out", 3, |f| f.out),
    ("no datum: in 2D", 3, |f| f.no_datum_in),
    ("out", 3, |f| f.no_datum_out),
    ("% > 1 cm", 1, |f| 100.0 * f.beyond),
    ("loose: precision", 2, |f| f.precision),
    ("recall", 2, |f| f.recall),
    ("possible", 2, |f| f.possible),
    ("coverage: along", 3, |f| f.coverage[0]),
    ("up", 2, |f| f.coverage[1]),
    ("out", 2, |f| f.coverage[2]),
    ("chi-square: mean", 2, |f| f.normalised[0]),
    ("median", 2, |f| f.normalised[1]),
    ("interval / error", 2, |f| f.width),
    ("alarms", 3, |f| f.alarms[0]),
    ("called loose", 3, |f| f.alarms[1]),
    ("against neighbours", 2, |f| f.against[0]),
    ("> 95 %", 3, |f| f.against[1]),
    ("bound: in 2D", 3, |f| f.bounds[0]),
    ("out", 3, |f| f.bounds[1]),
    ("bound of a window: in 2D", 3, |f| f.bounds[2]),
    ("out", 3, |f| f.bounds[3]),
    ("at the crack: in 2D", 2, |f| f.crack[0]),
    ("breaks across", 0, |f| f.crack[1]),
    ("elsewhere", 0, |f| f.crack[2]),
    ("spanned", 2, |f| f.crack[3]),
    ("spoilt: no motion", 2, |f| f.spoilt[0]),
    ("wrong", 2, |f| f.spoilt[1]),
    ("s", 1, |f| f.seconds),
];

/// Figures of one run; NaN where a figure means nothing. Lengths in millimetres, shares 0..1.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    /// Countable stones that have a motion, share.
    pub measured: f64,
    pub in_plane: f64,
    pub out: f64,
    /// `in_plane` and `out` with the best rigid motion of all errors, which is the datum's, removed.
    pub no_datum_in: f64,
    pub no_datum_out: f64,
    pub beyond: f64,
    pub precision: f64,
    pub recall: f64,
    /// Recall that the bound of each loose stone alone would allow at the test's level, its neighbours'
    /// motion known.
    pub possible: f64,
    /// Coverage of 95 % intervals along, up and out, datum removed.
    pub coverage: [f64; 3],
    /// Normalised squared errors over their expectation, datum removed: mean, median.
    pub normalised: [f64; 2],
    /// Root mean square of the standard deviations over that of the errors, datum removed: median of the axes.
    pub width: f64,
    /// Tests of stones that are not loose with p below 0.05, and stones of these called loose.
    pub alarms: [f64; 2],
    /// Motion against the neighbours of stones that are not loose, in units of its covariance: mean square
    /// over its expectation, and share beyond the 95 % point.
    pub against: [f64; 2],
    /// Medians of the bounds: stone in the face, out of it, window in the face, out of it.
    pub bounds: [f64; 4],
    /// In-plane 2D error near the crack; breaks across it and elsewhere; share of its height that breaks
    /// span.
    pub crack: [f64; 4],
    /// Spoilt stones: share without a motion, share reported wrong by more than [`OUTLIER_M`].
    pub spoilt: [f64; 2],
    pub seconds: f64,
}

struct Row {
    centroid: Point3<f64>,
    face: Matrix3<f64>,
    /// World.
    error: Vector3<f64>,
    covariance: Matrix3<f64>,
    loose: bool,
    called: bool,
    p: f64,
    /// Square of the motion against the neighbours in units of its covariance.
    against: f64,
    spoilt: bool,
}

pub fn figures(trial: &Trial, results: &[PairResult], breaks: &[Break], seconds: f64) -> Figures {
    let countable = trial.truth.values().filter(|t| t.countable && !t.spoilt).count();
    let rows: Vec<Row> = results.iter().filter_map(|r| row(trial, r)).collect();
    let (spoilt, rows): (Vec<Row>, Vec<Row>) = rows.into_iter().partition(|r| r.spoilt);
    let spoilt_all = trial.truth.values().filter(|t| t.countable && t.spoilt).count();
    let n = rows.len() as f64;
    let plane = |e: &Vector3<f64>| 1e3 * e.x.hypot(e.y);
    let local: Vec<Vector3<f64>> = rows.iter().map(|r| r.face * r.error).collect();
    let free: Vec<Vector3<f64>> = without_datum(&rows);
    let called = rows.iter().filter(|r| r.called).count() as f64;
    let loose = rows.iter().filter(|r| r.loose).count() as f64;
    let right = rows.iter().filter(|r| r.called && r.loose).count() as f64;
    let covariance: Vec<Matrix3<f64>> = rows
        .iter()
        .map(|r| r.face * r.covariance * r.face.transpose())
        .collect();
    let coverage = std::array::from_fn(|a| {
        share(rows.len(), |i| {
            free[i][a].abs() <= Z95 * covariance[i][(a, a)].max(0.0).sqrt()
        })
    });
    let squares: Vec<f64> = free
        .iter()
        .zip(&covariance)
        .map(|(e, c)| chi_square(e, c))
        .filter(|square| square.is_finite())
        .collect();
    let normalised = [
        squares.iter().sum::<f64>() / squares.len() as f64 / 3.0,
        median(squares) / 2.366,
    ];
    let still: Vec<&Row> = rows.iter().filter(|r| !r.loose).collect();
    Figures {
        measured: n / countable as f64,
        in_plane: rms(local.iter().map(plane)),
        out: rms(local.iter().map(|e| 1e3 * e.z)),
        no_datum_in: rms(free.iter().map(plane)),
        no_datum_out: rms(free.iter().map(|e| 1e3 * e.z)),
        beyond: share(rows.len(), |i| local[i].norm() > OUTLIER_M),
        precision: right / called,
        recall: right / loose,
        possible: possible_recall(trial),
        coverage,
        normalised,
        width: median((0..3).map(|a| {
            let claimed = rms(covariance.iter().map(|c| c[(a, a)].max(0.0).sqrt()));
            claimed / rms(free.iter().map(|e| e[a]))
        })),
        alarms: [
            share(still.len(), |i| still[i].p < 0.05),
            share(still.len(), |i| still[i].called),
        ],
        against: [
            still.iter().map(|r| r.against).sum::<f64>() / still.len() as f64 / 3.0,
            share(still.len(), |i| still[i].against > CHI2_3_95),
        ],
        bounds: bounds(trial),
        crack: crack(trial, &rows, breaks),
        spoilt: [
            1.0 - spoilt.len() as f64 / spoilt_all as f64,
            spoilt.iter().filter(|r| r.error.norm() > OUTLIER_M).count() as f64 / spoilt_all as f64,
        ],
        seconds,
    }
}

/// Mean power of a chi-square test with three degrees of freedom of the loose stones, each measured as well
/// as its bound allows.
///
/// Level: about that at which control of a false discovery rate of 5 % ends where one stone in thirty is
/// loose. Normal approximation of the noncentral law (mean 3 + l, variance 2 (3 + 2 l)).
fn possible_recall(trial: &Trial) -> f64 {
    const LEVEL: f64 = 0.05 / 30.0;
    let (Ok(chi), Ok(normal)) = (ChiSquared::new(3.0), Normal::new(0.0, 1.0)) else {
        return f64::NAN;
    };
    let limit = chi.inverse_cdf(1.0 - LEVEL);
    let powers: Vec<f64> = trial
        .truth
        .iter()
        .filter(|(_, t)| t.countable && t.loose && !t.spoilt)
        .filter_map(|(id, t)| {
            let [inside, out] = trial.bounds.get(id)?[0];
            let face = FaceFrame::from_normal(&t.normal).face_from_world();
            let d = face * (t.displacement - t.shared);
            let l = 2.0 * d.xy().norm_squared() / (inside * inside) + (d.z / out).powi(2);
            Some(normal.cdf((3.0 + l - limit) / (2.0 * (3.0 + 2.0 * l)).sqrt()))
        })
        .collect();
    powers.iter().sum::<f64>() / powers.len() as f64
}

/// One line for each stone that is loose or called so.
pub fn print_loose(trial: &Trial, pairs: &[PairPoints], results: &[PairResult]) {
    for (result, pair) in results.iter().zip(pairs) {
        let Some(truth) = trial.truth.get(&result.first.0).filter(|t| t.countable) else {
            continue;
        };
        let called = result.motion.as_ref().is_ok_and(|m| m.loose);
        if !truth.loose && !called {
            continue;
        }
        let face = FaceFrame::from_normal(&truth.normal).face_from_world() * 1e3;
        let sds = |covariance: Matrix3<f64>| {
            let covariance = face * covariance * face.transpose();
            [0, 1, 2].map(|a| covariance[(a, a)].max(0.0).sqrt())
        };
        let bound = trial.bounds.get(&result.first.0).map_or([f64::NAN; 2], |b| b[0]);
        let head = format!(
            "      stone {:3} loose {:5} called {called:5}, {} points, bound {:.2?} mm, moved by itself {:5.1?}",
            result.first.0,
            truth.loose,
            pair.points_first.len(),
            bound.map(|b| b * 1e3),
            (face * (truth.displacement - truth.shared)).as_slice()
        );
        match &result.motion {
            Ok(m) => println!(
                "{head}, found {:5.1?} +- {:.1?}, p {:.1e}; error of the motion {:5.2?} +- {:.2?}",
                (face * m.relative).as_slice(),
                sds(m.relative_covariance),
                m.own_motion_p,
                (face * (m.displacement - truth.displacement)).as_slice(),
                sds(m.covariance.fixed_view::<3, 3>(0, 0).into_owned()),
            ),
            Err(e) => println!("{head}: {e}"),
        }
    }
}

fn row(trial: &Trial, result: &PairResult) -> Option<Row> {
    let truth = trial.truth.get(&result.first.0)?;
    let motion = result.motion.as_ref().ok()?;
    if !truth.countable {
        return None;
    }
    Some(Row {
        centroid: mean(&trial.stones[0][&result.first.0]),
        face: FaceFrame::from_normal(&truth.normal).face_from_world(),
        error: motion.displacement - truth.displacement,
        covariance: motion.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        loose: truth.loose,
        called: motion.loose,
        p: motion.own_motion_p,
        against: motion
            .relative
            .dot(&motion.relative_covariance.cholesky()?.solve(&motion.relative)),
        spoilt: truth.spoilt,
    })
}

/// Errors in face components after the rigid motion that explains most of them (least squares, loose stones
/// left out).
fn without_datum(rows: &[Row]) -> Vec<Vector3<f64>> {
    let middle = rows.iter().map(|r| r.centroid.coords).sum::<Vector3<f64>>() / rows.len().max(1) as f64;
    let design = |r: &Row| lever(&(r.centroid.coords - middle));
    let (mut h, mut g) = (Matrix6::identity() * 1e-9, Vector6::zeros());
    for r in rows.iter().filter(|r| !r.loose) {
        let j = design(r);
        h += j.transpose() * j;
        g += j.transpose() * r.error;
    }
    let datum = h.cholesky().map_or_else(Vector6::zeros, |c| c.solve(&g));
    rows.iter()
        .map(|r| r.face * (r.error - design(r) * datum))
        .collect()
}

fn bounds(trial: &Trial) -> [f64; 4] {
    std::array::from_fn(|k| {
        let counted = trial
            .bounds
            .iter()
            .filter(|(id, _)| trial.truth.get(id).is_some_and(|t| t.countable));
        median(counted.map(|(_, b)| 1e3 * b[k / 2][k % 2]))
    })
}

fn crack(trial: &Trial, rows: &[Row], breaks: &[Break]) -> [f64; 4] {
    let Some(crack) = trial.crack else {
        return [f64::NAN, f64::NAN, breaks.len() as f64, f64::NAN];
    };
    let place = |id: u32| mean(&trial.stones[0][&id]);
    let near = rows
        .iter()
        .filter(|r| crack.distance(&r.centroid).abs() < NEAR_CRACK_M)
        .map(|r| (r.face * r.error).xy().norm() * 1e3);
    let is_across = |b: &&Break| crack.distance(&place(b.from.0)) * crack.distance(&place(b.to.0)) < 0.0;
    let across = breaks.iter().filter(is_across).count() as f64;
    // Heights, in steps of 5 cm, that lie between the ends of a break that crosses the crack.
    let heights = || rows.iter().map(|r| r.centroid.z);
    let (low, high) = (
        heights().fold(f64::MAX, f64::min),
        heights().fold(f64::MIN, f64::max),
    );
    let steps = ((high - low) / 0.05) as usize;
    let spanned = share(steps, |k| {
        let z = low + 0.05 * (k as f64 + 0.5);
        breaks.iter().filter(is_across).any(|b| {
            let (a, c) = (place(b.from.0).z, place(b.to.0).z);
            z > a.min(c) - 0.1 && z < a.max(c) + 0.1
        })
    });
    [rms(near), across, breaks.len() as f64 - across, spanned]
}
