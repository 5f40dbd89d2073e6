//! Objects that this crate and torchvision find with equal weights in an equal image (testdata/mask_rcnn).

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use std::path::PathBuf;
use stonewise_core::raster::Raster;
use stonewise_segment::model::{
    AnchorConfig, BackboneConfig, MaskRcnn, MaskRcnnConfig, Norm, Precision, ProposalConfig, Resize,
    ResnetConfig, ResnetDepth, RoiConfig, weights_from_bytes, weights_to_bytes,
};
use stonewise_testing::formula;

/// Cells along a side of a mask.
const CELLS: usize = 28;
#[derive(Deserialize)]
struct Expected {
    r18: Vec<Object>,
    r50: Vec<Object>,
}

#[derive(Deserialize)]
struct Object {
    bounds: [f32; 4],
    class: usize,
    score: f32,
    mask: Vec<f32>,
}

fn config(depth: ResnetDepth) -> MaskRcnnConfig {
    let torchvision = MaskRcnnConfig::torchvision_r50();
    MaskRcnnConfig {
        classes: 3,
        resize: Some(Resize {
            shorter: 180,
            longest: 240,
        }),
        backbone: BackboneConfig::Resnet(ResnetConfig {
            depth,
            width: 64,
            norm: Norm::FrozenBatch { epsilon: 1e-5 },
        }),
        fpn_channels: 24,
        anchors: AnchorConfig {
            sizes: [8.0, 16.0, 32.0, 64.0, 128.0].map(|size| vec![size]),
            aspect_ratios: vec![0.5, 1.0, 2.0],
        },
        proposals: ProposalConfig {
            before_nms: [200; 2],
            after_nms: [60; 2],
            nms_iou: 0.7,
        },
        roi: RoiConfig {
            box_hidden: 32,
            mask_channels: vec![16, 20],
            ..torchvision.roi.clone()
        },
        score_threshold: 0.3,
        detections: 25,
        ..torchvision
    }
}

/// A model whose every parameter follows from its name in torchvision.
fn model(depth: ResnetDepth) -> MaskRcnn {
    let model = MaskRcnn::zeros(&config(depth)).unwrap();
    let bytes = weights_to_bytes(&model, Precision::Single).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let tensors: Vec<(String, Vec<usize>, Vec<u8>)> = file
        .tensors()
        .into_iter()
        .map(|(key, view)| {
            let values = formula::parameter(&key, view.shape());
            let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (key, view.shape().to_vec(), bytes)
        })
        .collect();
    let views = tensors
        .iter()
        .map(|(key, shape, bytes)| (key, TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap()));
    let bytes = safetensors::serialize(views, None).unwrap();
    weights_from_bytes(model, &bytes, "formula").unwrap()
}

fn compare(model: &MaskRcnn, expected: &[Object]) {
    let image = Raster::from_vec(150, 110, formula::image(150, 110)).unwrap();
    let found = model.instances(&image, None);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.class, expected.class);
        assert!(
            (found.score - expected.score).abs() < 1e-3,
            "{} {}",
            found.score,
            expected.score
        );
        for (a, b) in found.bounds.iter().zip(expected.bounds) {
            assert!((a - b).abs() < 0.1, "{:?} {:?}", found.bounds, expected.bounds);
        }
        let every_third = |i: usize| i % 3 == 1;
        let cells = (0..CELLS * CELLS).filter(|i| every_third(i / CELLS) && every_third(i % CELLS));
        for (cell, b) in cells.zip(&expected.mask) {
            assert!(
                (found.mask[cell] - b).abs() < 1e-2,
                "{cell}: {} {b}",
                found.mask[cell]
            );
        }
    }
}

#[test]
fn objects_are_those_of_torchvision() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/mask_rcnn/expected.json");
    let expected: Expected = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    for (depth, expected) in [(ResnetDepth::R18, expected.r18), (ResnetDepth::R50, expected.r50)] {
        let model = model(depth);
        compare(&model, &expected);
        // Folding the normalisation into the convolutions changes nothing.
        compare(&model.for_inference(), &expected);
    }
}
