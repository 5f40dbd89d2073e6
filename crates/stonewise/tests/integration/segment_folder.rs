//! A folder of photos through a small detector with random weights: what it finds is nonsense, but files,
//! resuming and threads can be seen.

use std::fs;
use std::path::{Path, PathBuf};
use stonewise::segmentation::{FolderJob, FolderSummary, segment_folder};
use stonewise_core::progress::Silent;
use stonewise_io::image_io::write_png_rgb;
use stonewise_io::masks::{MaskSource, read_label_png};
use stonewise_segment::Weights;
use stonewise_segment::dataset::Reference;
use stonewise_segment::model::{MaskRcnn, Precision, save_model};
use stonewise_segment::tiling::TilingOptions;
use stonewise_segment::train::synth::masonry_photo;

fn weights(path: &Path) -> Weights {
    let model = MaskRcnn::init(&crate::narrow_model::narrow(8), 3).unwrap();
    save_model(&model, path, Precision::Half).unwrap();
    Weights::File(path.to_owned())
}

/// Two photos in folders of their own, and a detector.
fn input(dir: &Path) -> (PathBuf, Weights) {
    let photos = dir.join("photos");
    for (seed, name) in [(1, "a/one.png"), (2, "b/two.png")] {
        let path = photos.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_png_rgb(&path, masonry_photo(seed, 150, 110).image()).unwrap();
    }
    (photos, weights(&dir.join("weights.safetensors")))
}

fn segment(photos: &Path, out: &Path, weights: &Weights, reference: Option<&Reference>) -> FolderSummary {
    let tiling = TilingOptions {
        tile_px: 96,
        overlap_px: 32,
        scales: vec![1.0, 0.5],
        min_score: 0.1,
        min_area_px: 10,
        ..TilingOptions::default()
    };
    let job = FolderJob {
        photos,
        out,
        weights,
        tiling: &tiling,
        reference,
        boxes: None,
    };
    segment_folder(&job, &Silent).unwrap()
}

#[test]
fn masks_come_back_as_written_and_score_fully_against_themselves() {
    let dir = tempfile::tempdir().unwrap();
    let (photos, weights) = input(dir.path());
    let out = dir.path().join("out");
    let summary = segment(&photos, &out, &weights, None);
    assert!(summary.photos == 2 && summary.stones > 4, "{summary:?}");
    let coco = MaskSource::open(&out.join("masks.json")).unwrap();
    for name in ["a/one", "b/two"] {
        let labels = read_label_png(&out.join(format!("labels/{name}.png"))).unwrap();
        let read = coco
            .labels_for(&format!("{name}.png"), 150, 110)
            .unwrap()
            .unwrap();
        assert!(out.join(format!("overlays/{name}.jpg")).exists());
        let is_stone = |l: &u32| *l != 0;
        assert!(
            labels
                .data()
                .iter()
                .map(is_stone)
                .eq(read.labels.data().iter().map(is_stone))
        );
    }
    let reference = Reference::open(&out.join("masks.json"), None).unwrap();
    let score = segment(&photos, &out, &weights, Some(&reference))
        .evaluation
        .unwrap()
        .total;
    assert_eq!(score.references, summary.stones);
    assert_eq!((score.f1, score.mean_iou), (Some(1.0), Some(1.0)));
}

#[test]
fn photos_of_one_stem_keep_files_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let (photos, weights) = input(dir.path());
    write_png_rgb(&photos.join("a/one.tif"), masonry_photo(5, 150, 110).image()).unwrap();
    let out = dir.path().join("out");
    assert_eq!(segment(&photos, &out, &weights, None).photos, 3);
    for name in ["a/one.png", "a/one.tif", "b/two"] {
        assert!(out.join(format!("overlays/{name}.jpg")).exists(), "{name}");
    }
    let labels = MaskSource::open(&out.join("labels")).unwrap();
    let coco = MaskSource::open(&out.join("masks.json")).unwrap();
    for name in ["a/one.png", "a/one.tif", "b/two.png"] {
        let is_stone = |source: &MaskSource| {
            let photo = source.labels_for(name, 150, 110).unwrap().unwrap();
            photo.labels.data().iter().map(|l| *l != 0).collect::<Vec<_>>()
        };
        assert_eq!(is_stone(&labels), is_stone(&coco), "{name}");
    }
}

#[test]
fn photos_that_are_done_are_not_done_again_unless_the_detector_is_another() {
    let dir = tempfile::tempdir().unwrap();
    let (photos, weights) = input(dir.path());
    let out = dir.path().join("out");
    let first = segment(&photos, &out, &weights, None);
    let overlay = out.join("overlays/a/one.jpg");
    fs::remove_file(&overlay).unwrap();
    assert_eq!(segment(&photos, &out, &weights, None).stones, first.stones);
    assert!(!overlay.exists());
    let Weights::File(path) = &weights else {
        unreachable!()
    };
    let mut bytes = fs::read(path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(path, bytes).unwrap();
    segment(&photos, &out, &weights, None);
    assert!(overlay.exists());
}

#[test]
fn the_result_is_the_same_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let (photos, weights) = input(dir.path());
    let labels = |threads: usize| {
        let out = dir.path().join(format!("out{threads}"));
        stonewise_testing::on_threads(threads, || segment(&photos, &out, &weights, None));
        fs::read(out.join("masks.json")).unwrap()
    };
    assert!(labels(1) == labels(4));
}
