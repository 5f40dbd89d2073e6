//! Coverage of intervals and false alarms on simulated walls.

use super::certificate::{CertifyOptions, Figure};
use crate::error::{Error, Result};
use crate::experiment::inner_work::InnerWork;
use crate::experiment::simulation::not_simulated;
use crate::pipeline::{Context, Until, run_in};
use crate::project::Project;
use crate::storage::step::Key;
use crate::storage::store::StepStore;
use crate::truth::evaluate_truth;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::evaluate::{Calibration, MotionScore};
use stonewise_core::progress::Progress;
use stonewise_simulate::{
    MaskFiles, PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, WallMotion, WallParams,
    write_survey,
};

const PART: &str = "walls";
/// Width and height of a wall, metres.
pub(super) const SIZE_M: [f64; 2] = [2.4, 1.6];
/// A pixel of the photos on the wall, metres: the paper's.
const PIXEL_M: f64 = 5.4e-3;
/// Least share of true motions inside intervals that are to hold 95 %: stones of a wall are tied to each other, so
/// that a few walls are few independent draws.
const LEAST_COVERAGE: f64 = 0.9;
/// Least share of stones found of those that moved by more than their own limit. At the limit, half are.
const LEAST_FOUND: f64 = 0.9;
/// What all stations of an epoch share, metres per axis: as much as is assumed of terrestrial scanners.
pub(super) const DATUM_M: f64 = 0.3e-3;
/// Chance of an alarm on a wall that stands still, and the chance below which a number of them is too large.
const ALARM: f64 = 0.05;
pub(super) const IMPROBABLE: f64 = 0.01;

/// What a wall came to.
struct Wall {
    is_still: bool,
    score: MotionScore,
    /// Stones that the verdict says moved.
    called: usize,
}

pub(super) fn figures(
    options: &CertifyOptions,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Vec<Figure>> {
    progress.begin("simulated walls", options.walls);
    let mut walls = Vec::new();
    for number in 0..options.walls {
        progress.check()?;
        walls.push(measured(options.seed, number, out, store, progress)?);
        progress.advance(1);
    }

    let stones: usize = walls.iter().map(|w| w.score.estimated).sum();
    let note = format!("{stones} stones of {} walls", walls.len());
    let mut figures = Vec::new();

    for (axis, name) in ["along the wall", "up the face", "out of the face"]
        .into_iter()
        .enumerate()
    {
        let pool = |of: fn(&MotionScore) -> Option<&Calibration>| {
            pooled(&walls, |w| {
                let coverage = &of(&w.score)?.coverage_95;
                [coverage.along, coverage.up, coverage.out][axis]
            })
        };
        let relative = pool(|s| s.calibration_without_datum.as_ref());
        let name = |of: &str| format!("motions in their 95 % intervals {name}, {of}");
        figures.push(
            Figure::at_least(
                PART,
                name("against the common motion"),
                relative.unwrap_or(f64::NAN),
                LEAST_COVERAGE,
            )
            .with(note.clone()),
        );
        let absolute = pool(|s| s.calibration.as_ref());
        figures.push(
            Figure::shown(PART, name("absolute"), absolute)
                .with("all stones of a wall share one error of registration, so that each wall is one draw"),
        );
    }

    let still: Vec<&Wall> = walls.iter().filter(|w| w.is_still).collect();
    let alarms = still.iter().filter(|w| w.called > 0).count();
    figures.push(
        Figure::at_most(
            PART,
            "still walls on which a stone is called moved",
            alarms as f64,
            most_alarms(still.len(), IMPROBABLE) as f64,
        )
        .with(format!("of {} still walls; the verdict allows 5 %", still.len())),
    );
    let count = |of: fn(&MotionScore) -> usize| walls.iter().map(|w| of(&w.score)).sum::<usize>();
    let (beyond, found) = (
        count(|s| s.significance.detectable),
        count(|s| s.significance.detectable_hits),
    );

    if beyond > 0 {
        figures.push(
            Figure::at_least(
                PART,
                "stones found of those that moved by more than their limit",
                found as f64 / beyond as f64,
                LEAST_FOUND,
            )
            .with(format!("{found} of {beyond}")),
        );
    }

    Ok(figures)
}

/// Mean over walls, weighted by their stones; `None` where no wall has the figure.
fn pooled(walls: &[Wall], of: impl Fn(&Wall) -> Option<f64>) -> Option<f64> {
    let all = walls
        .iter()
        .filter_map(|w| Some((of(w)?, w.score.estimated as f64)));
    let (sum, stones) = all.fold((0.0, 0.0), |(sum, n), (share, stones)| {
        (sum + share * stones, n + stones)
    });
    (stones > 0.0).then_some(sum / stones)
}

/// The largest number of alarms on this many still walls that is exceeded with at least the probability `improbable`.
pub(super) fn most_alarms(walls: usize, improbable: f64) -> usize {
    let n = walls as f64;
    let mut chance = (1.0 - ALARM).powf(n);
    let mut below = chance;
    let mut most = 0;
    while 1.0 - below >= improbable && most < walls {
        chance *= (n - most as f64) / (most as f64 + 1.0) * ALARM / (1.0 - ALARM);
        most += 1;
        below += chance;
    }
    most
}

fn measured(
    seed: u64,
    number: u64,
    out: &Path,
    store: &Arc<StepStore>,
    progress: &dyn Progress,
) -> Result<Wall> {
    let inner = InnerWork(progress);
    let is_still = number.is_multiple_of(2);
    let params = survey(seed.wrapping_mul(1000).wrapping_add(number), is_still);
    let key = Key::new("survey", &params, &[]);
    let (dir, _) = store.step("survey", key, &[], |dir| {
        let written = write_survey(&dir.file("survey"), &params, &inner);
        written.map(drop).map_err(not_simulated)
    })?;
    let survey = dir.file("survey");
    let project = Project::read(&survey.join("stonewise.toml"))?;
    let folder = out.join("walls").join((number + 1).to_string());
    let context = Context::with_store(&project, &folder, Arc::clone(store), &inner)?;
    let summary = run_in(&context, Until::Registered)?;
    let truth = survey.join("truth/stones.csv");
    let evaluation = evaluate_truth(&folder, &truth, &project.settings.evaluate)?;
    let score = evaluation.external.map(|e| e.motions);
    Ok(Wall {
        is_still,
        score: score.ok_or_else(|| Error::Survey("a simulated wall has no scores".to_owned()))?,
        called: summary.moved(),
    })
}

/// A terrestrial survey of a small wall that stands still or bulges by 10 mm.
fn survey(seed: u64, is_still: bool) -> SurveyParams {
    let bulge = WallMotion::Bulge {
        centre_m: [0.0, 0.5 * SIZE_M[1]],
        depth_m: 0.01,
        diameter_m: 1.5,
    };
    let params = SurveyParams {
        name: format!("Wall {seed}"),
        masks: MaskFiles::Png,
        scene: SceneParams {
            wall: WallParams::sized(SIZE_M),
            surroundings: SurroundingsParams::none(),
            motions: if is_still { Vec::new() } else { vec![bulge] },
            tls: Some(TlsParams {
                datum_m: DATUM_M,
                ..TlsParams::default()
            }),
            uav: None,
            ..SceneParams::default()
        },
        photos: photos(4),
        ..SurveyParams::dam(SIZE_M)
    };
    params.seeded(seed)
}

/// Two rows of photos that show where the stones of such a wall are, and nothing else.
pub(super) fn photos(columns: u32) -> PhotoParams {
    let side = |size_m: f64| ((size_m + 1.2) / PIXEL_M) as u32;
    PhotoParams {
        columns,
        rows: 2,
        width: side(SIZE_M[0]),
        height: side(SIZE_M[1]),
        rendered: false,
        ..SurveyParams::dam(SIZE_M).photos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alarms_are_too_many_by_the_binomial_distribution() {
        // P(more than 1 of 3) = 3 * 0.05^2 * 0.95 + 0.05^3 = 0.007; P(more than 4 of 20) = 0.0026, more than 3 0.016.
        assert_eq!([1, 3, 20].map(|walls| most_alarms(walls, IMPROBABLE)), [1, 1, 4]);
    }
}
