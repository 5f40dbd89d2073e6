//! Figures of an evaluation against pycocotools; the fixture is made by testdata/coco_ap/generate.py.

use serde::Deserialize;
use std::path::{Path, PathBuf};
use stonewise_core::raster::Raster;
use stonewise_io::masks::{LabelledPhoto, MaskSource};
use stonewise_segment::Segmentation;
use stonewise_segment::evaluation::{MaskScore, pair_masks};

#[derive(Deserialize)]
struct Expected {
    ap: f64,
    ap50: f64,
    right: usize,
    found: usize,
    references: usize,
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/coco_ap")
        .join(name)
}

#[test]
fn precision_and_average_precision_are_those_of_pycocotools() {
    let masks = |name: &str, photo: &str| -> LabelledPhoto {
        let source = MaskSource::open(&file(name)).unwrap();
        source.labels_for(photo, 96, 72).unwrap().unwrap()
    };
    let pairs: Vec<_> = ["1.png", "2.png", "3.png"]
        .into_iter()
        .map(|photo| {
            let found = masks("found.json", photo);
            let found = Segmentation {
                scores: found.instances.iter().map(|i| (i.id, i.score as f32)).collect(),
                labels: found.labels,
            };
            let reference = masks("reference.json", photo).labels;
            pair_masks(&found, &reference, &Raster::filled(96, 72, false))
        })
        .collect();
    let score = MaskScore::of(&pairs);
    let expected: Expected =
        serde_json::from_str(&std::fs::read_to_string(file("expected.json")).unwrap()).unwrap();
    assert_eq!(
        (score.right, score.found, score.references),
        (expected.right, expected.found, expected.references)
    );
    assert!((score.ap50.unwrap() - expected.ap50).abs() < 1e-9, "{score:?}");
    assert!((score.ap.unwrap() - expected.ap).abs() < 1e-9, "{score:?}");
}
