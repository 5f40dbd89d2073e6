//! The detector on EfficientNet-Lite0 computes what PyTorch computes (testdata/lite_detector), and its configuration is
//! the one that lab/detector/export.py writes.

use super::boxes::Bounds;
use super::config::{BackboneConfig, MaskRcnnConfig, Norm, ResnetConfig, ResnetDepth};
use super::mask_rcnn::MaskRcnn;
use super::preprocess::{Seen, batch};
use super::roi_align::FeatureRows;
use crate::engine::Tensor;
use serde::Deserialize;
use stonewise_core::raster::{Raster, ReliefMap, RgbImage};
use stonewise_testing::formula;

#[derive(Deserialize)]
struct Expected {
    config: MaskRcnnConfig,
    boxes: Vec<Bounds>,
    outputs: Vec<Output>,
}

#[derive(Deserialize)]
struct Output {
    name: String,
    shape: Vec<usize>,
    rms: f32,
    places: Vec<usize>,
    values: Vec<f32>,
}

fn expected() -> Expected {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../testdata/lite_detector/expected.json"
    );
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn outputs(model: &MaskRcnn, boxes: &[Bounds]) -> Vec<Tensor> {
    let image: RgbImage = Raster::from_vec(128, 96, formula::image(128, 96)).unwrap();
    let seen = [Seen::new(&image, None); 2];
    let values = formula::unit("relief", 4 * 48 * 64);
    let pixel = |place: usize| [0, 1, 2, 3].map(|channel| values[channel * 48 * 64 + place]);
    let relief: ReliefMap = Raster::from_vec(64, 48, (0..48 * 64).map(pixel).collect()).unwrap();
    let images = batch(&[&image, &image], &seen, &model.config);
    let reliefs = [Some(&relief), None];
    let mut found = model.levels(&images, &reliefs, &seen);
    let rows = FeatureRows::new(&found);
    let scores = model.look(&images, &reliefs, &seen).scores;
    found.extend([scores.objectness, scores.offsets]);
    let regions: Vec<_> = [0, 1]
        .iter()
        .flat_map(|&i| boxes.iter().map(move |&b| (i, b)))
        .collect();
    let (classes, offsets) = model.roi_heads.boxes(rows.cut(&regions, &model.align(7)));
    let masks = model.roi_heads.masks(rows.cut(&regions, &model.align(14)));
    found.extend([classes, offsets, masks]);
    found
}

#[test]
fn the_detector_gives_what_pytorch_gives_with_relief_and_without() {
    let expected = expected();
    let mut model = MaskRcnn::zeros(&expected.config).unwrap();
    for (name, param) in model.parameters() {
        let shape = param.tensor.shape().to_vec();
        let values = formula::parameter(&name, &shape);
        param.tensor = Tensor::new(shape, values);
    }
    for model in [model.clone(), model.for_inference()] {
        let found = outputs(&model, &expected.boxes);
        assert_eq!(found.len(), expected.outputs.len());
        for (found, expected) in found.iter().zip(&expected.outputs) {
            assert_eq!(found.shape(), expected.shape, "{}", expected.name);
            for (&place, value) in expected.places.iter().zip(&expected.values) {
                let found = found.values()[place];
                let is_close = (found - value).abs() < 1e-4 * expected.rms;
                assert!(is_close, "{}, {place}: {found} {value}", expected.name);
            }
        }
    }
}

#[test]
fn configurations_name_their_backbone() {
    let exported = expected().config;
    assert_eq!(exported, MaskRcnnConfig::efficientnet_lite(0).with_relief());
    let text = serde_json::to_string(&exported).unwrap();
    assert_eq!(serde_json::from_str::<MaskRcnnConfig>(&text).unwrap(), exported);
    // As files of residual networks have it.
    let today = r#"{"depth":"R18","width":64,"norm":{"group":{"groups":16}}}"#;
    let backbone: BackboneConfig = serde_json::from_str(today).unwrap();
    let resnet = ResnetConfig {
        depth: ResnetDepth::R18,
        width: 64,
        norm: Norm::Group { groups: 16 },
    };
    assert_eq!(backbone, BackboneConfig::Resnet(resnet));
    assert_eq!(serde_json::to_string(&backbone).unwrap(), today);
    let light = serde_json::to_string(&MaskRcnnConfig::light()).unwrap();
    assert!(!light.contains("plain_proposals"), "{light}");

    for unknown in [
        r#"{"depth":"R19","width":64,"norm":{"group":{"groups":16}}}"#,
        "{}",
    ] {
        let error = serde_json::from_str::<BackboneConfig>(unknown).unwrap_err();
        assert!(error.to_string().contains("R18, R34 or R50"), "{error}");
    }
    let refused = |config: MaskRcnnConfig| MaskRcnn::zeros(&config).unwrap_err().to_string();
    let fourth = refused(MaskRcnnConfig::efficientnet_lite(3));
    assert!(fourth.contains("efficientnet_lite must be 0, 1 or 2"), "{fourth}");
    let uneven = refused(MaskRcnnConfig {
        head_groups: Some(36),
        ..exported
    });
    assert!(uneven.contains("head_groups"), "{uneven}");
}
