//! Photos of a project are looked at together with its clouds, where the detector takes relief.

use std::fs;
use std::path::{Path, PathBuf};
use stonewise::segmentation::{FolderJob, segment_folder};
use stonewise::{OutputFolder, Project, Until, run};
use stonewise_core::progress::Silent;
use stonewise_core::raster::LabelImage;
use stonewise_io::masks::read_label_png;
use stonewise_segment::Weights;
use stonewise_segment::tiling::TilingOptions;
use stonewise_segment::train::{
    Rendered, Run, Schedule, Start, Total, TrainParams, model_path, open_training,
};
use stonewise_simulate::{PhotoParams, SceneParams, SurveyParams, TlsParams, WallParams, write_survey};

/// One photo an epoch of a wall of 1.2 x 0.9 m, without masks.
fn survey(folder: &Path) -> PathBuf {
    let params = SurveyParams {
        scene: SceneParams {
            wall: WallParams::sized([1.2, 0.9]),
            tls: Some(TlsParams {
                spacing_m: 0.008,
                ..TlsParams::default()
            }),
            uav: None,
            ..SceneParams::default()
        },
        photos: PhotoParams {
            columns: 1,
            rows: 1,
            width: 320,
            height: 240,
            focal_px: 700.0,
            distance_m: 4.0,
            last_unaligned: false,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    };
    let project = write_survey(folder, &params, &Silent).unwrap().project;
    let text = fs::read_to_string(&project).unwrap();
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("masks")).collect();
    fs::write(&project, without.join("\n")).unwrap();
    project
}

/// The built-in weights with zeros for relief.
fn blind(folder: &Path) -> PathBuf {
    let mut bytes = Weights::BuiltIn.bytes().unwrap();
    let tensors = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[8..tensors]).unwrap();
    for (name, tensor) in header.as_object().unwrap() {
        if name.starts_with("backbone.relief.laterals.") {
            let offset = |end: usize| tensors + tensor["data_offsets"][end].as_u64().unwrap() as usize;
            bytes[offset(0)..offset(1)].fill(0);
        }
    }
    let path = folder.join("blind.safetensors");
    fs::write(&path, bytes).unwrap();
    path
}

/// Trains the weights of [`blind`] with relief for this number of steps; returns the path of the model.
fn model(folder: &Path, steps: u64) -> PathBuf {
    let out = folder.join(format!("model-{steps}"));
    fs::create_dir_all(&out).unwrap();
    let params = TrainParams {
        relief: true,
        crop_px: 96,
        evaluate_steps: 0,
        schedule: Schedule {
            learning_rate: 3e-4,
            warmup_steps: 1,
            decay_share: 0.1,
        },
        ..TrainParams::fine_tuning()
    };
    let start = Start::Weights(Weights::File(blind(folder)));
    let mut trainer = open_training(&out, &start, Some(params), Some(Total::Steps(steps)), None).unwrap();
    let source = Rendered {
        seed: 1,
        size_px: 96,
        relief: true,
    };
    let run = Run {
        source: &source,
        validation: &[],
        out: &out,
        minutes: None,
        threads: 1,
        progress: &Silent,
    };
    run.train(&mut trainer).unwrap();
    model_path(&out)
}

/// Stones of the first epoch's photo, found in a run.
fn in_a_run(project: &Path, model: &Path, out: &Path) -> LabelImage {
    let text = fs::read_to_string(project).unwrap();
    let with_model = project.with_file_name("with_model.toml");
    let table = format!("\n[segment]\nmodel = {:?}\n", model.to_str().unwrap());
    fs::write(&with_model, text + &table).unwrap();
    let project = Project::read(&with_model).unwrap();
    let folder = OutputFolder::of_project(out, &project, false).unwrap();
    run(&project, &folder, Until::Segmented, &Silent).unwrap();
    // The one version of the step.
    let mut versions = fs::read_dir(out.join("work/segment-1")).unwrap();
    let version = versions.next().unwrap().unwrap().path();
    read_label_png(&version.join("00000.png")).unwrap()
}

/// Stones of the same photo by itself.
fn alone(project: &Path, model: &Path, out: &Path) -> LabelImage {
    let job = FolderJob {
        photos: &project.with_file_name("epoch1/images"),
        out,
        weights: &Weights::named(model),
        tiling: &TilingOptions::default(),
        reference: None,
        boxes: None,
    };
    segment_folder(&job, &Silent).unwrap();
    let labels = fs::read_dir(out.join("labels")).unwrap().next().unwrap().unwrap();
    read_label_png(&labels.path()).unwrap()
}

#[test]
#[ignore = "a minute: .ci/nightly runs it"]
fn a_run_looks_at_clouds_where_its_detector_has_learnt_relief() {
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name);
    let project = survey(&out("survey"));
    let (unlearnt, learnt) = (model(folder.path(), 0), model(folder.path(), 4));
    let stones = |labels: &LabelImage| labels.data().iter().max().copied().unwrap_or(0);
    // Zeros for relief: clouds make no difference.
    let plain = alone(&project, &unlearnt, &out("a"));
    assert!(stones(&plain) > 3, "{}", stones(&plain));
    assert_eq!(in_a_run(&project, &unlearnt, &out("b")), plain);
    // A few steps later they do.
    let plain = alone(&project, &learnt, &out("c"));
    assert!(stones(&plain) > 3, "{}", stones(&plain));
    assert_ne!(in_a_run(&project, &learnt, &out("d")), plain);
    // The built-in weights, too, give other stones with clouds than without.
    let built_in = Path::new("built-in");
    let plain = alone(&project, built_in, &out("e"));
    assert_ne!(in_a_run(&project, built_in, &out("f")), plain);
}
