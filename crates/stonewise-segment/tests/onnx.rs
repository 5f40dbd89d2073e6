//! A model in ONNX with a known answer (testdata/onnx).
#![cfg(feature = "onnx")]
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_segment::Detector;
use stonewise_segment::onnx::{OnnxDetector, OnnxError};

#[test]
fn bright_pixels_in_given_boxes_are_found() {
    let Some(library) = std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from) else {
        println!("skipped: ORT_DYLIB_PATH does not name an ONNX Runtime library");
        return;
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/onnx");
    let detector = OnnxDetector::open(&library, &folder.join("bright.onnx")).unwrap();
    // Green from column 6 on; red and blue say the opposite.
    let pixel = |place: u32| {
        if place % 10 >= 6 {
            [0, 200, 0]
        } else {
            [255, 100, 255]
        }
    };
    let image: RgbImage = Raster::from_vec(10, 8, (0..80).map(pixel).collect()).unwrap();
    let found = detector.detect(&image, None).unwrap();
    assert_eq!(
        found.iter().map(|found| found.score).collect::<Vec<_>>(),
        [0.75, 0.25]
    );
    assert_eq!(found[0].bounds, [5.0, 2.0, 9.0, 6.0]);
    let patch = &found[0].mask;
    for (place, &inside) in patch.pixels.data().iter().enumerate() {
        let x = patch.left + place as u32 % patch.pixels.width();
        assert_eq!(inside, x >= 6, "column {x}");
    }
    assert!(found[1].mask.pixels.data().iter().all(|inside| !inside));
    let missing = OnnxDetector::open(&library, &folder.join("none.onnx"));
    assert!(matches!(missing, Err(OnnxError::Model { .. })));
}
