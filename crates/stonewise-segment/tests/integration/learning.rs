//! A detector learns, repeats itself, and goes to a file and back.

use stonewise_core::raster::{LabelImage, Raster, RgbImage};
use stonewise_segment::model::{
    BackboneConfig, MaskRcnn, MaskRcnnConfig, Norm, Precision, ResnetConfig, ResnetDepth, RoiConfig,
    SamplingConfig, WeightsError, load_weights, save_weights, weights_from_bytes,
};
use stonewise_segment::train::{AdamW, AdamWParams};
use stonewise_segment::{Detector, Sample, StoneFinder};

/// Left, top, right, bottom of the stones of a picture of 128 x 96 pixels.
const STONES: [[u32; 4]; 5] = [
    [6, 8, 38, 36],
    [48, 4, 92, 30],
    [98, 20, 122, 60],
    [10, 48, 52, 88],
    [60, 42, 90, 84],
];

fn resnet(depth: ResnetDepth) -> BackboneConfig {
    BackboneConfig::Resnet(ResnetConfig {
        depth,
        width: 16,
        norm: Norm::Group { groups: 4 },
    })
}

fn small() -> MaskRcnnConfig {
    let light = MaskRcnnConfig::light();
    MaskRcnnConfig {
        backbone: resnet(ResnetDepth::R18),
        fpn_channels: 16,
        head_groups: Some(4),
        roi: RoiConfig {
            box_hidden: 64,
            mask_channels: vec![16, 16],
            sampling: SamplingConfig {
                count: 64,
                ..light.roi.sampling
            },
            ..light.roi.clone()
        },
        ..light
    }
}

fn model(seed: u64) -> MaskRcnn {
    MaskRcnn::init(&small(), seed).unwrap()
}

fn picture() -> Sample {
    let mut labels: LabelImage = Raster::filled(128, 96, 0);
    let mut image: RgbImage = Raster::filled(128, 96, [70, 60, 50]);
    for (stone, [left, top, right, bottom]) in STONES.into_iter().enumerate() {
        for (y, x) in (top..bottom).flat_map(|y| (left..right).map(move |x| (y, x))) {
            *labels.get_mut(x, y).unwrap() = stone as u32 + 1;
            *image.get_mut(x, y).unwrap() = [180 - 10 * stone as u8, 170, 160 + (x * y % 19) as u8];
        }
    }
    Sample::new(image, labels, Raster::filled(128, 96, false)).unwrap()
}

#[test]
fn a_picture_is_learnt_by_heart() {
    let sample = [picture()];
    let mut model = model(1);
    let mut optimizer = AdamW::new(AdamWParams::default());
    let mut totals = Vec::new();
    for step in 0..120 {
        let (losses, gradients) = model.gradients(&sample, step);
        totals.push(losses.total());
        optimizer.step(&mut model, gradients, 3e-3);
    }
    assert!(totals[119] < 0.2 * totals[0], "{totals:?}");
    let found = StoneFinder::new(model).detect(sample[0].image(), None).unwrap();
    for (stone, bounds) in STONES.iter().enumerate() {
        let overlap = |patch: &stonewise_segment::Patch| {
            let mut both = 0;
            for (place, _) in patch
                .pixels
                .data()
                .iter()
                .enumerate()
                .filter(|(_, inside)| **inside)
            {
                let (x, y) = (
                    place as u32 % patch.pixels.width(),
                    place as u32 / patch.pixels.width(),
                );
                let label = sample[0].labels().get(patch.left + x, patch.top + y);
                both += u32::from(label == Some(&(stone as u32 + 1)));
            }
            let area = patch.pixels.data().iter().filter(|&&inside| inside).count() as u32;
            let truth = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]);
            f64::from(both) / f64::from(area + truth - both)
        };
        let sure = found.iter().filter(|found| found.score > 0.5);
        let best = sure.map(|found| overlap(&found.mask)).fold(0.0, f64::max);
        assert!(best > 0.7, "stone {stone}: {best}");
    }
}

#[test]
fn the_same_seed_gives_the_same_losses_and_the_same_gradients() {
    let sample = [picture()];
    let run = || {
        let mut model = model(3);
        let (losses, gradients) = model.gradients(&sample, 5);
        AdamW::new(AdamWParams::default()).step(&mut model, gradients, 1e-3);
        (losses, model.losses(&sample, 6))
    };
    assert_eq!(stonewise_testing::on_threads(1, run), run());
}

#[test]
fn where_nothing_is_known_there_is_no_background() {
    let picture = picture();
    let all = Raster::filled(128, 96, true);
    let nothing = Raster::filled(128, 96, 0);
    let unknown = Sample::new(picture.image().clone(), nothing.clone(), all.clone()).unwrap();
    let losses = model(1).losses(&[unknown], 1);
    assert_eq!(losses.rpn_objectness, 0.0);
    assert_eq!(losses.class, 0.0);
    let bare = Sample::new(picture.image().clone(), nothing, Raster::filled(128, 96, false)).unwrap();
    assert!(model(1).losses(&[bare], 1).rpn_objectness > 0.1);
    // Known stones count within, too.
    let known = Sample::new(picture.image().clone(), picture.labels().clone(), all).unwrap();
    assert!(model(1).losses(&[known], 1).mask > 0.1);
}

#[test]
fn weights_come_back_from_a_file() {
    let (trained, other) = (model(1), || model(2));
    let folder = tempfile::tempdir().unwrap();
    let picture = picture();
    for (precision, tolerance) in [(Precision::Single, 0.0), (Precision::Half, 0.02)] {
        let path = folder.path().join("model.safetensors");
        save_weights(&trained, &path, precision).unwrap();
        let again = load_weights(other(), &path).unwrap();
        let [a, b] = [&trained, &again].map(|model| model.instances(picture.image(), None));
        assert_eq!(a.len(), b.len());
        assert!((a[0].score - b[0].score).abs() <= tolerance);
    }
}

#[test]
fn weights_of_another_network_are_refused_by_name() {
    let init = |config: &MaskRcnnConfig| MaskRcnn::init(config, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.safetensors");
    save_weights(&init(&small()), &path, Precision::Half).unwrap();
    let refusal = |config: MaskRcnnConfig| load_weights(init(&config), &path).unwrap_err();
    let wider = refusal(MaskRcnnConfig {
        fpn_channels: 32,
        ..small()
    });
    assert!(
        matches!(&wider, WeightsError::Shape { key, .. } if key == "backbone.fpn.inner_blocks.0.0.weight"),
        "{wider}"
    );
    let deeper = MaskRcnnConfig {
        backbone: resnet(ResnetDepth::R34),
        ..small()
    };
    let deeper = refusal(deeper);
    assert!(
        matches!(&deeper, WeightsError::Missing { key, .. } if key == "backbone.body.layer1.2.conv1.weight"),
        "{deeper}"
    );
    let plain = refusal(MaskRcnnConfig {
        head_groups: None,
        ..small()
    });
    assert!(
        matches!(&plain, WeightsError::Missing { key, .. } if key.ends_with(".0.bias")),
        "{plain}"
    );
    let garbage = weights_from_bytes(init(&small()), b"not safetensors", "here").unwrap_err();
    assert!(garbage.to_string().starts_with("here"), "{garbage}");
    assert!(
        load_weights(init(&small()), &folder.path().join("none"))
            .unwrap_err()
            .to_string()
            .contains("none")
    );
}
