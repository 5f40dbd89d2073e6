//! What a survey teaches its detector, against the true masks of the simulator.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise::{Adapted, OutputFolder, Owner, Project, adapt};
use stonewise_core::progress::Silent;
use stonewise_io::masks::{MaskSource, read_label_png};
use stonewise_simulate::{
    PhotoParams, SceneParams, SurroundingsParams, SurveyParams, TlsParams, WallParams, write_survey,
};

/// Four rendered photos an epoch of a small wall.
fn survey(folder: &Path) -> Project {
    let params = SurveyParams {
        scene: SceneParams {
            wall: WallParams::sized([1.8, 1.2]),
            surroundings: SurroundingsParams::none(),
            tls: Some(TlsParams {
                spacing_m: 0.006,
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
            rendered: true,
            ..PhotoParams::default()
        },
        ..SurveyParams::default()
    };
    let written = write_survey(folder, &params.seeded(3), &Silent).unwrap();
    Project::read(&written.project).unwrap()
}

fn adapted(project: &Project, out: &Path, minutes: f64) -> stonewise::Result<Adapted> {
    let owner = Owner::inputs("adapt", std::slice::from_ref(&project.path));
    let folder = OutputFolder::of_inputs(out, &owner, &project.inputs(), &[], false)?;
    adapt(project, minutes, &folder, &Silent)
}

/// The folders in another: of a step, one for each detector.
fn folders(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.filter(|p| p.is_dir()).collect()
}

/// The only folder in another.
fn only(folder: &Path) -> PathBuf {
    let folders = folders(folder);
    assert_eq!(folders.len(), 1, "{folders:?}");
    folders[0].clone()
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Overlap (intersection over union) of each mask that an epoch teaches with the true stone that it covers most.
fn overlaps(work: &Path, epoch: usize, truth: &MaskSource) -> Vec<f64> {
    let photos = json(&folders(&work.join(format!("segment-{epoch}")))[0].join("photos.json"));
    let lesson = only(&work.join(format!("lesson-{epoch}")));
    let mut all = Vec::new();
    for taught in json(&lesson.join("photos.json")).as_array().unwrap() {
        let photo = taught["photo"].as_u64().unwrap() as usize;
        let masks = read_label_png(&lesson.join(format!("{photo:05}.png"))).unwrap();
        let path = photos[photo]["path"].as_str().unwrap();
        let truth = truth
            .labels_for(path, masks.width(), masks.height())
            .unwrap()
            .unwrap()
            .labels;
        let (mut sizes, mut true_sizes): (BTreeMap<u32, f64>, BTreeMap<u32, f64>) = Default::default();
        let mut both: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        for (&mask, &stone) in masks.data().iter().zip(truth.data()) {
            *sizes.entry(mask).or_default() += 1.0;
            *true_sizes.entry(stone).or_default() += 1.0;
            *both.entry((mask, stone)).or_default() += 1.0;
        }
        for value in 1..=taught["stones"].as_array().unwrap().len() as u32 {
            let of_mask = both
                .iter()
                .filter(|((mask, stone), _)| *mask == value && *stone != 0);
            let iou = of_mask.map(|((_, stone), n)| n / (sizes[&value] + true_sizes[stone] - n));
            all.push(iou.fold(0.0, f64::max));
        }
    }
    all
}

#[test]
#[ignore = "a minute: .ci/nightly runs it"]
fn what_is_taught_is_true_and_a_step_of_training_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut project = survey(dir.path());
    let refused = adapted(&project, &dir.path().join("refused"), 0.0)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("every epoch has `masks`"), "{refused}");
    let truth: Vec<MaskSource> = project
        .epochs
        .iter()
        .map(|epoch| MaskSource::open(epoch.masks.as_ref().unwrap()).unwrap())
        .collect();
    project.epochs.iter_mut().for_each(|epoch| epoch.masks = None);
    let out = dir.path().join("adapted");
    let first = adapted(&project, &out, 0.001).unwrap();
    assert!(first.stones >= 40 && first.kept >= 4, "{first:?}");
    assert!(4 * first.kept < 3 * first.stones, "{first:?}");
    let all: Vec<f64> = (1..)
        .zip(&truth)
        .flat_map(|(n, truth)| overlaps(&out.join("work"), n, truth))
        .collect();
    assert_eq!(all.len(), first.masks);
    let right = all.iter().filter(|iou| **iou >= 0.7).count();
    assert!(
        right as f64 >= 0.95 * all.len() as f64,
        "{right} of {}",
        all.len()
    );
    // One step at a low learning rate gains nothing: there is no detector, and the record says so.
    assert_eq!((first.steps, &first.model), (1, &None));
    assert!(!out.join("model.safetensors").exists());
    let record = json(&out.join("adapt.json"));
    assert_eq!(record["before"]["references"], record["after"]["references"]);
    assert!(record["before"]["f1"].as_f64().unwrap() > 0.5, "{record}");
    // The same call again takes everything over.
    let again = adapted(&project, &out, 0.001).unwrap();
    assert_eq!((again.steps, again.after), (1, first.after));
}
