//! What photos add to the motions of stones, on simulated walls.
//!
//! `cargo run --release -p stonewise-lab -- photo-curves CURVE DIR [SEEDS]` varies one property of the
//! photos: `light`, `moss`, `wet` (of the second epoch), `pixel` (metres on the wall), `pose` (pixels), `count`
//! (photos along x up), or `none` (photos unused). Each value is measured on SEEDS walls of 4 x 3 m (2) that
//! settle, bulge and have loose stones, seen by a lidar under a drone. DIR keeps the surveys: a second call
//! measures them again without making them.

use crate::Outcome;
use crate::figures::rms;
use crate::table::Table;
use crate::words::Words;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Display;
use std::path::Path;
use stonewise::{OutputFolder, Project, Until, evaluate_truth};
use stonewise_core::evaluate::{EvaluationParams, LooseDetection, MotionScore};
use stonewise_core::progress::Silent;
use stonewise_simulate::{
    LaterDays, LaterLight, PhotoParams, SceneParams, SurveyParams, UavParams, WallMotion, WallParams,
    write_survey,
};

type AnyError = Box<dyn std::error::Error>;

/// Photos of a value on a curve.
struct Case {
    value: String,
    photos: PhotoParams,
    is_used: bool,
}

pub fn run(words: &Words) -> Outcome {
    let [curve, dir, ..] = words.as_slice() else {
        return Err("usage: photo-curves CURVE DIR [SEEDS]".into());
    };
    let seeds: u64 = words.number_at(2).unwrap_or(2);
    let columns = [
        "stones",
        "NMAD along / up / out, mm",
        "RMSE per axis in the face, mm",
        "loose called / true / false",
        "coverage",
    ];
    let table = Table::begin(std::iter::once(curve.as_str()).chain(columns));
    for case in cases(curve)? {
        let folder = |seed| Path::new(dir).join(format!("{curve}-{}-{seed}", case.value));
        let scores = (1..=seeds).map(|seed| score(&case, seed, &folder(seed)));
        let scores = scores.collect::<Result<Vec<_>, _>>()?;
        table.row(std::iter::once(case.value.clone()).chain(cells(&scores)));
    }
    Ok(())
}

fn cases(curve: &str) -> Result<Vec<Case>, AnyError> {
    let case = |value: &dyn Display, change: &dyn Fn(&mut PhotoParams)| {
        let mut photos = same_day();
        change(&mut photos);
        Case {
            value: value.to_string(),
            photos,
            is_used: curve != "none",
        }
    };
    let lights = [
        ("same", LaterLight::Same),
        ("other", LaterLight::Other),
        ("overcast", LaterLight::Overcast),
    ];
    Ok(match curve {
        "none" => vec![case(&"clouds alone", &|_| ())],
        "light" => lights
            .iter()
            .map(|(name, light)| case(name, &|p| p.later.light = *light))
            .collect(),
        "moss" => [0.0, 0.2, 0.5]
            .iter()
            .map(|v| case(v, &|p| p.later.moss_change = Some(*v)))
            .collect(),
        "wet" => [0.0, 0.2, 0.5]
            .iter()
            .map(|v| case(v, &|p| p.later.wet_change = Some(*v)))
            .collect(),
        "pixel" => [0.002, 0.0033, 0.005, 0.008]
            .iter()
            .map(|v| case(v, &|p| *p = with_pixel(p, *v)))
            .collect(),
        "pose" => [0.0, 0.5, 1.0, 2.0]
            .iter()
            .map(|v| case(v, &|p| p.pose_noise_px = *v))
            .collect(),
        "count" => [[2, 1], [3, 1], [3, 2], [4, 3]]
            .iter()
            .map(|[x, y]| {
                case(&format!("{x} x {y}"), &|p| {
                    p.columns = *x;
                    p.rows = *y;
                })
            })
            .collect(),
        _ => return Err(format!("unknown curve {curve}").into()),
    })
}

/// Photos of 3.3 mm a pixel with poses off by half a pixel, on two days with other light that is alike in all
/// else.
fn same_day() -> PhotoParams {
    PhotoParams {
        pose_noise_px: 0.5,
        later: LaterDays {
            moss_change: Some(0.0),
            wet_change: Some(0.0),
            ..LaterDays::default()
        },
        ..PhotoParams::default()
    }
}

/// The parameters for the same view in pixels of this size on the wall, metres.
fn with_pixel(photos: &PhotoParams, pixel_m: f64) -> PhotoParams {
    let factor = photos.distance_m / photos.focal_px / pixel_m;
    let size = |pixels: u32| (f64::from(pixels) * factor).round() as u32;
    PhotoParams {
        width: size(photos.width),
        height: size(photos.height),
        focal_px: photos.focal_px * factor,
        center_offset_px: photos.center_offset_px.map(|c| c * factor),
        ..photos.clone()
    }
}

/// Makes the survey if it is not there, runs it, and scores its stones.
fn score(case: &Case, seed: u64, folder: &Path) -> Result<MotionScore, AnyError> {
    let survey = folder.join("survey");
    if !survey.join("stonewise.toml").exists() {
        let params = SurveyParams {
            scene: scene(seed),
            photos: case.photos.clone(),
            ..SurveyParams::default()
        };
        write_survey(&survey, &params, &Silent)?;
    }
    let mut project = Project::read(&survey.join("stonewise.toml"))?;
    project.settings.registration.photos.enabled = case.is_used;
    let out = OutputFolder::of_project(&folder.join("results"), &project, true)?;
    stonewise::run(&project, &out, Until::Compared, &Silent)?;
    let truth = survey.join("truth/stones.csv");
    let evaluation = evaluate_truth(&folder.join("results"), &truth, &EvaluationParams::default())?;
    Ok(evaluation.external.ok_or("no stones were scored")?.motions)
}

/// A wall that settles, slides, bulges and has loose stones; sizes by seed.
fn scene(seed: u64) -> SceneParams {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| rng.random_range(low..high);
    let motions = vec![
        WallMotion::Settlement {
            from_m: -2.0,
            to_m: 2.0,
            depth_m: draw(0.005, 0.015),
        },
        WallMotion::Translation {
            d_m: [0.0, draw(-0.006, 0.006), 0.0],
        },
        WallMotion::Bulge {
            centre_m: [draw(-1.0, 1.0), draw(1.0, 2.0)],
            depth_m: draw(0.01, 0.05),
            diameter_m: draw(1.8, 2.6),
        },
        WallMotion::Loose {
            share: 0.03,
            at_least: 5,
            shift_m: [0.005, 0.03],
            rotation_rad: 0.035,
        },
    ];
    SceneParams {
        wall: WallParams::sized([4.0, 3.0]),
        motions,
        tls: None,
        uav: Some(UavParams::default()),
        ..SceneParams::default()
    }
    .seeded(seed)
}

/// The figures of several walls together: NMAD and RMSE as the root mean square over the walls.
fn cells(scores: &[MotionScore]) -> [String; 5] {
    type Value<'a> = &'a dyn Fn(&MotionScore) -> Option<f64>;
    let rms_mm = |of: Value| format!("{:.2}", 1e3 * rms(scores.iter().map(|s| of(s).unwrap_or(0.0))));
    let mean = |of: Value| {
        let sum: f64 = scores.iter().filter_map(of).sum();
        format!("{:.2}", sum / scores.len() as f64)
    };
    let loose = |of: &dyn Fn(&LooseDetection) -> usize| -> String {
        let sum: usize = scores.iter().filter_map(|s| s.loose.as_ref()).map(of).sum();
        sum.to_string()
    };
    let coverage = |s: &MotionScore| Some(s.calibration_without_datum.as_ref()?.coverage_95.clone());
    [
        scores.iter().map(|s| s.estimated).sum::<usize>().to_string(),
        [
            rms_mm(&|s| Some(s.errors_without_datum.along.as_ref()?.nmad_m)),
            rms_mm(&|s| Some(s.errors_without_datum.up.as_ref()?.nmad_m)),
            rms_mm(&|s| Some(s.errors_without_datum.out_of_plane.as_ref()?.nmad_m)),
        ]
        .join(" / "),
        rms_mm(&|s| Some(s.errors_without_datum.in_plane_per_axis.as_ref()?.rmse_m)),
        [
            loose(&|l| l.right),
            loose(&|l| l.truly_loose),
            loose(&|l| l.reported - l.right),
        ]
        .join(" / "),
        [
            mean(&|s| coverage(s)?.along),
            mean(&|s| coverage(s)?.up),
            mean(&|s| coverage(s)?.out),
        ]
        .join(" / "),
    ]
}
