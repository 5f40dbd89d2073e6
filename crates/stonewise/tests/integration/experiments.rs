//! Experiments on a small simulated survey: what they find, against single runs and against what is known
//! beforehand.

use nalgebra::Vector3;
use std::fs;
use std::path::Path;
use stonewise::experiment::{PaperOptions, PaperSurvey, TuneOptions, paper, tune};
use stonewise::{OutputFolder, Part, Project, Until, run};
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::MotionField;
use stonewise_core::progress::Silent;
use stonewise_simulate::{
    PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, WallParams, write_survey,
};
use tempfile::TempDir;

fn survey() -> (TempDir, Project) {
    survey_with_photos(false)
}

/// A wall of a few dozen stones and four photos an epoch, whose halves still have two. `rendered`: the photos
/// show the wall.
fn survey_with_photos(rendered: bool) -> (TempDir, Project) {
    let params = SurveyParams {
        scene: SceneParams {
            wall: WallParams::sized([1.6, 1.0]),
            surroundings: SurroundingsParams::none(),
            tls: Some(TlsParams {
                spacing_m: 0.008,
                ..TlsParams::default()
            }),
            ..SceneParams::default()
        },
        photos: PhotoParams {
            columns: 2,
            rows: 2,
            width: 500,
            height: 400,
            focal_px: 900.0,
            distance_m: 5.0,
            rendered,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    };
    let dir = tempfile::tempdir().unwrap();
    let written = write_survey(dir.path(), &params.seeded(3), &Silent).unwrap();
    let project = Project::read(&written.project).unwrap();
    (dir, project)
}

/// Cells of a column of a CSV file.
fn column(path: &Path, name: &str) -> Vec<String> {
    let all = fs::read_to_string(path).unwrap();
    let mut lines = all.lines();
    let at = lines.next().unwrap().split(',').position(|c| c == name).unwrap();
    lines.map(|l| l.split(',').nth(at).unwrap().to_owned()).collect()
}

#[test]
fn a_grid_finds_what_single_runs_find_and_resumes() {
    let (dir, mut project) = survey();
    project.epochs[EpochId::at(1)].motion =
        Some(MotionField::translation(Vector3::new(0.0, 0.01, 0.02)).unwrap());
    project.settings.r#match.min_overlap = Some(1.0);
    let options = TuneOptions {
        grid: [
            "match.min_area_ratio=0.9999,0.5",
            "registration.border_noises=0..3..3",
        ]
        .map(|d| d.parse().unwrap())
        .to_vec(),
        ..TuneOptions::default()
    };
    let out = dir.path().join("tuned");
    let tuned = tune(&project, &options, &out, &Silent).unwrap();
    assert_eq!(tuned.points.len(), 4);
    let table = out.join("tune.csv");
    assert_eq!(
        column(&table, "match.min_area_ratio"),
        ["0.9999", "0.9999", "0.5", "0.5"]
    );
    assert!(tuned.lines.contains("min_area_ratio = 0.5"), "{}", tuned.lines);
    assert_eq!(
        tuned.lines,
        fs::read_to_string(out.join("recommended.toml")).unwrap()
    );

    // The last combination is the project's own: a run by itself must come to the same.
    let folder = OutputFolder::of_project(&dir.path().join("alone"), &project, false).unwrap();
    let alone = run(&project, &folder, Until::Registered, &Silent).unwrap();
    let score = alone.pairs[0]
        .evaluation
        .as_ref()
        .unwrap()
        .stones
        .as_ref()
        .unwrap();
    let (last, borders_kept) = (&tuned.points[3], &tuned.points[2]);
    let norm = score.errors.norm_3d.as_ref().unwrap();
    assert!((last.errors.unwrap().rmse_m / norm.rmse_m - 1.0).abs() < 1e-9);
    assert_eq!(last.measured, score.estimated as f64);
    assert!(last.measured >= 10.0 && norm.rmse_m < 0.003, "{last:?}");
    // Other points take part, so the errors are others.
    assert_ne!(
        borders_kept.errors.unwrap().rmse_m,
        last.errors.unwrap().rmse_m,
        "{borders_kept:?}"
    );

    let (first, versions) = (fs::read(&table).unwrap(), out.join("work/register-2"));
    let count = || fs::read_dir(&versions).unwrap().count();
    let before = count();
    tune(&project, &options, &out, &Silent).unwrap();
    assert_eq!((fs::read(&table).unwrap(), count()), (first, before));
}

#[test]
fn a_grid_says_what_cannot_be() {
    let (dir, project) = survey();
    let fail = |options: TuneOptions| {
        let out = dir.path().join("tuned");
        tune(&project, &options, &out, &Silent).unwrap_err().to_string()
    };
    let unknown = fail(TuneOptions {
        grid: vec!["max_ratio=0.4".parse().unwrap()],
        ..TuneOptions::default()
    });
    assert!(unknown.contains("match.max_ratio"), "{unknown}");
    let far = fail(TuneOptions {
        part: Some(Part::between([100.0; 3], [101.0; 3])),
        ..TuneOptions::default()
    });
    assert!(far.contains("no points in the part"), "{far}");
}

#[test]
fn the_papers_experiment_splits_one_epoch_and_scores_every_method() {
    let (dir, project) = survey();
    let out = dir.path().join("paper");
    let part = Part::in_the_middle(&project.epochs.reference().clouds, [1.2, 0.8]).unwrap();
    let surveys = [PaperSurvey {
        name: "TLS".to_owned(),
        project,
        paper_part: Some(part),
    }];
    let options = PaperOptions {
        seed: 1,
        ..PaperOptions::default()
    };
    let tables = paper(&surveys, &options, &out, &Silent).unwrap();
    let text = tables.markdown();
    assert_eq!(text, fs::read_to_string(out.join("tables.md")).unwrap());
    // The paper's own figures stand beside ours.
    let row = text.lines().find(|l| l.starts_with("| M3C2 | TLS")).unwrap();
    assert!(row.ends_with("| 3.8 | 0.6 |"), "{row}");
    // The zero predictor of 2 cm and 5 cm, per axis: sqrt((2^2 + 5^2) / 2).
    let zero = text
        .lines()
        .find(|l| l.starts_with("| zero predictor | TLS"))
        .unwrap();
    assert!(zero.contains(" | 3.808 | "), "{zero}");
    let find = |method: &str, motion: &str| {
        let found = tables
            .details
            .iter()
            .find(|d| d.method == method && d.motion == motion);
        found.unwrap().clone()
    };
    let ours = find("stones, stonewise", "translation");
    assert!(ours.rmse_m[0] < 0.002 && ours.count[1] >= 10, "{ours:?}");
    let theirs = find("stones, the paper's estimator", "translation");
    assert!(
        theirs.count[0] > 5 && theirs.count[0] < ours.count[0],
        "{theirs:?}"
    );
    assert!(find("M3C2", "translation").rmse_m[0] > 0.02);
    assert!(find("stones, stonewise", "bulge").rmse_m[2] < 0.001);
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    for piece in [
        "Table 1", "Table 2", "Figure 5", "Figure 6", "Figure 7", "Figure 8", "Figure 9",
    ] {
        assert!(page.contains(piece), "{piece} is missing");
    }
    assert!(
        !page.contains("src=\"http") && !page.contains("href="),
        "the page needs other files"
    );
    assert!(out.join("figures/figure_6-tls-stonewise.svg").exists());
    assert!(page.contains("TLS: in all tables and figures the stones are given as masks"));
    assert!(tables.segmentation.is_empty() && !out.join("segmentation.csv").exists());
    let later = PaperOptions {
        epoch: Some("2031".to_owned()),
        ..options
    };
    let unknown = paper(&surveys, &later, &out, &Silent).unwrap_err().to_string();
    assert!(unknown.contains("epoch 1"), "{unknown}");
}

#[test]
fn a_detector_learns_some_stones_is_measured_on_the_others_and_finds_all() {
    let (dir, project) = survey_with_photos(true);
    let masks = fs::read_to_string(project.epochs.reference().masks.as_ref().unwrap()).unwrap();
    let masks: serde_json::Value = serde_json::from_str(&masks).unwrap();
    let labelled = masks["annotations"].as_array().unwrap().len();
    let out = dir.path().join("paper");
    let surveys = ["TLS", "again"].map(|name| PaperSurvey {
        name: name.to_owned(),
        project: project.clone(),
        paper_part: None,
    });
    let options = PaperOptions {
        train_minutes: Some(0.001),
        ..PaperOptions::default()
    };
    let tables = paper(&surveys, &options, &out, &Silent).unwrap();
    // Both surveys have the same photos: one training, of a single step.
    let [trained, before] = &tables.segmentation[..] else {
        panic!("{:?}", tables.segmentation)
    };
    assert!(trained.detector.contains("(1 step"), "{}", trained.detector);
    assert_eq!((before.surveys.as_str(), before.photos), ("TLS, again", 4));
    let held_out = trained.score.references;
    assert_eq!(before.score.references, held_out);
    let share = held_out as f64 / labelled as f64;
    assert!((0.02..0.3).contains(&share), "{held_out} of {labelled}");
    assert!(before.score.f1.unwrap() > 0.5, "{:?}", before.score);
    let text = tables.markdown();
    assert!(
        text.contains("| the paper's network, on its own dam | – | – | – | – | 0.92 | 0.72 | 0.81 | 0.84 |")
    );
    let csv = fs::read_to_string(out.join("segmentation.csv")).unwrap();
    let counts = format!("\"TLS, again\",4,{held_out},");
    assert!(csv.lines().skip(1).all(|row| row.contains(&counts)), "{csv}");
    // The masks that were given took no part in the runs.
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("instances), found by the detector that was trained"));
    assert!(!page.contains("given as masks"));
    let repeated = paper(&surveys, &options, &out, &Silent).unwrap();
    assert_eq!(repeated, tables);
    let mut unlabelled = project;
    unlabelled.epochs[EpochId::REFERENCE].masks = None;
    let surveys = [PaperSurvey {
        name: "TLS".to_owned(),
        project: unlabelled,
        paper_part: None,
    }];
    let error = paper(&surveys, &options, &out, &Silent).unwrap_err().to_string();
    assert!(
        error.contains("epoch 1") && error.contains("--train-minutes"),
        "{error}"
    );
}
