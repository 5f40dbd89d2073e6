//! Objects that this crate and torchvision find with equal weights in an equal image (testdata/mask_rcnn).
#![allow(clippy::unwrap_used)]

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use std::path::PathBuf;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_segment::model::{
    AnchorConfig, BackboneConfig, MaskRcnn, MaskRcnnConfig, Norm, Precision, ProposalConfig, Resize,
    ResnetDepth, RoiConfig, weights_from_bytes, weights_to_bytes,
};

/// Cells along a side of a mask.
const CELLS: usize = 28;
/// Values of the detections' own weights (formula.py).
const GAINS: [(&str, f64); 5] = [
    ("rpn.head.cls_logits.weight", 0.7),
    ("rpn.head.bbox_pred.weight", 0.3),
    ("roi_heads.box_predictor.cls_score.weight", 0.9),
    ("roi_heads.box_predictor.bbox_pred.weight", 0.7),
    ("roi_heads.mask_predictor.mask_fcn_logits.weight", 2.0),
];

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
        backbone: BackboneConfig {
            depth,
            width: 64,
            norm: Norm::FrozenBatch { epsilon: 1e-5 },
        },
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

fn fnv1a(text: &str) -> u32 {
    text.bytes().fold(2_166_136_261, |h, byte| {
        (h ^ u32::from(byte)).wrapping_mul(16_777_619)
    })
}

/// A number in [-1, 1) from a name and a place.
fn unit(key: u32, place: u32) -> f64 {
    let mut h = place.wrapping_mul(2_654_435_761).wrapping_add(key);
    for _ in 0..2 {
        h = (h ^ (h >> 16)).wrapping_mul(0x045D_9F3B);
    }
    f64::from((h ^ (h >> 16)) >> 8) / f64::from(1 << 23) - 1.0
}

fn parameter(key: &str, shape: &[usize]) -> Vec<f32> {
    let (offset, spread) = if key.ends_with("running_var") {
        (1.0, 0.5)
    } else if key.ends_with("running_mean") {
        (0.0, 0.1)
    } else if shape.len() == 1 && key.ends_with("weight") {
        (0.6, 0.2)
    } else if shape.len() == 1 {
        (0.0, 0.05)
    } else {
        let inputs: usize = if key.contains("conv5_mask") {
            4 * shape[0]
        } else {
            shape[1..].iter().product()
        };
        let gain = GAINS
            .iter()
            .find(|(name, _)| *name == key)
            .map_or(1.0, |(_, gain)| *gain);
        (0.0, gain * (6.0 / inputs as f64).sqrt())
    };
    let hash = fnv1a(key);
    let count: usize = shape.iter().product();
    (0..count)
        .map(|place| (offset + spread * unit(hash, place as u32)) as f32)
        .collect()
}

fn image(width: u32, height: u32) -> RgbImage {
    let pixel = |place: u32| {
        let (x, y) = (place % width, place / width);
        let shifted = y + 5 * (x / 23);
        let block = x / 23 * 7 + shifted / 17 * 13;
        [0, 1, 2].map(|c| {
            let value = if x % 23 < 2 || shifted % 17 < 2 {
                30 + (x + y) % 11
            } else {
                (block * 37 + c * 61) % 160 + (x * 7 + y * 3 + c * 5) % 29 + 20
            };
            value as u8
        })
    };
    Raster::from_vec(width, height, (0..width * height).map(pixel).collect()).unwrap()
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
            let values = parameter(&key, view.shape());
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
    let found = model.instances(&image(150, 110), None);
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
