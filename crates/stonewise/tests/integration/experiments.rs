//! Experiments on a small simulated survey: what they find, against single runs and against what is known
//! beforehand.

use nalgebra::Vector3;
use std::fs;
use std::path::Path;
use stonewise::experiment::{PaperSurvey, TuneOptions, paper, tune};
use stonewise::{OutputFolder, Part, Project, Until, run};
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::MotionField;
use stonewise_core::progress::Silent;
use stonewise_simulate::{
    PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, WallParams, write_survey,
};
use tempfile::TempDir;

/// A wall of a few dozen stones and four photos an epoch, whose halves still have two.
fn survey() -> (TempDir, Project) {
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
            rendered: false,
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
#[ignore = "a minute: .ci/nightly runs it"]
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
    assert!((last.rmse_m().unwrap() / norm.rmse_m - 1.0).abs() < 1e-9);
    assert_eq!(last.measured, score.estimated as f64);
    assert!(last.measured >= 10.0 && norm.rmse_m < 0.003, "{last:?}");
    // Other points take part, so the errors are others.
    assert_ne!(
        borders_kept.rmse_m().unwrap(),
        last.rmse_m().unwrap(),
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
#[ignore = "a minute: .ci/nightly runs it"]
fn the_papers_experiment_splits_one_epoch_and_scores_every_method() {
    let (dir, project) = survey();
    let out = dir.path().join("paper");
    let part = Part::in_the_middle(&project.epochs.reference().clouds, [1.2, 0.8]).unwrap();
    let surveys = [PaperSurvey {
        name: "TLS".to_owned(),
        project,
        paper_part: Some(part),
    }];
    let tables = paper(&surveys, None, 1, &out, &Silent).unwrap();
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
    let details = &tables.details;
    let [methods, motions] = ["method", "motion"].map(|name| details.required::<String>(name).unwrap());
    let row = |method: &str, motion: &str| {
        let mut rows = methods.iter().zip(motions);
        rows.position(|(m, of)| m == method && of == motion).unwrap()
    };
    let rmse = |direction: &str, row: usize| {
        details.optional::<f64>(&format!("rmse_{direction}_m")).unwrap()[row].unwrap()
    };
    let expected = |row: usize| details.required::<u32>("expected").unwrap()[row];
    let estimated = |row: usize| details.required::<u32>("estimated").unwrap()[row];
    let ours = row("stones, stonewise", "translation");
    assert!(rmse("in_plane_per_axis", ours) < 0.002 && estimated(ours) >= 10);
    let theirs = expected(row("stones, the paper's estimator", "translation"));
    assert!(theirs > 5 && theirs < expected(ours), "{theirs}");
    assert!(rmse("in_plane_per_axis", row("M3C2", "translation")) > 0.02);
    assert!(rmse("out_of_plane", row("stones, stonewise", "bulge")) < 0.001);
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
    let unknown = paper(&surveys, Some("2031"), 1, &out, &Silent).unwrap_err();
    assert!(unknown.to_string().contains("epoch 1"), "{unknown}");
}
