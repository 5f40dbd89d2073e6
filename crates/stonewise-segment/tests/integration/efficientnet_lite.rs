//! A detector on EfficientNet-Lite learns everything but its backbone, with relief and without.

use safetensors::SafeTensors;
use stonewise_core::raster::{LabelImage, Raster, ReliefMap, RgbImage};
use stonewise_segment::Sample;
use stonewise_segment::model::{
    MaskRcnn, MaskRcnnConfig, Precision, WeightsError, config_from_bytes, model_from_bytes, weights_to_bytes,
};
use stonewise_segment::train::{AdamW, AdamWParams};

/// A stone on a wall, and relief of another size, neither that of the photo nor half of it.
fn sample() -> Sample {
    let mut labels: LabelImage = Raster::filled(95, 61, 0);
    let noise = |i: u32| [(90 + i.wrapping_mul(2_654_435_761) % 90) as u8; 3];
    let image: RgbImage = Raster::from_vec(95, 61, (0..95 * 61).map(noise).collect()).unwrap();
    for (x, y) in (10..40).flat_map(|x| (8..44).map(move |y| (x, y))) {
        *labels.get_mut(x, y).unwrap() = 1;
    }
    let height = |i: u32| [(i as f32 * 0.37).sin(), 0.2, -0.4, 1.0];
    let relief: ReliefMap = Raster::from_vec(31, 20, (0..620).map(height).collect()).unwrap();
    let sample = Sample::new(image, labels, Raster::filled(95, 61, false)).unwrap();
    sample.with_relief(Some(relief))
}

/// Names of parameters that differ between two models, and of those that do not.
fn compared(a: &MaskRcnn, b: &MaskRcnn) -> [Vec<String>; 2] {
    let [a, b] = [a, b].map(|model| weights_to_bytes(model, Precision::Single).unwrap());
    let [a, b] = [&a, &b].map(|bytes| SafeTensors::deserialize(bytes).unwrap());
    let is_changed = |name: &&str| a.tensor(name).unwrap().data() != b.tensor(name).unwrap().data();
    let (changed, kept): (Vec<&str>, Vec<&str>) = a.names().into_iter().partition(is_changed);
    [changed, kept].map(|names| names.into_iter().map(str::to_owned).collect())
}

#[test]
fn steps_change_everything_but_the_backbone() {
    let config = MaskRcnnConfig::efficientnet_lite(0).with_relief();
    let before = MaskRcnn::init(&config, 1).unwrap();
    let mut model = before.clone();
    let batch = [sample(), sample().with_relief(None)];
    let mut optimizer = AdamW::new(AdamWParams::default());
    // The derivatives of the relief stem are zero until the weights of its last layer are not.
    for step in 0..2 {
        let (losses, gradients) = model.gradients(&batch, step);
        assert!(losses.total().is_finite());
        assert!(gradients.get("backbone.body.stem.weight").is_none());
        if step == 1 {
            let of_first = gradients.get("backbone.relief.stages.0.0.weight").unwrap();
            assert!(of_first.iter().any(|value| *value != 0.0));
        }
        optimizer.step(&mut model, gradients, 1e-3);
    }
    let [changed, kept] = compared(&before, &model);
    assert!(
        changed.iter().all(|name| !name.starts_with("backbone.body.")),
        "{changed:?}"
    );
    assert!(
        kept.iter().all(|name| name.starts_with("backbone.body.")),
        "{kept:?}"
    );
    assert_eq!(kept.len(), 2 * (1 + 3 * 16 - 1));
}

#[test]
fn a_file_of_colour_alone_can_learn_relief() {
    let sample = sample();
    let colour = MaskRcnn::init(&MaskRcnnConfig::efficientnet_lite(0), 5).unwrap();
    let bytes = weights_to_bytes(&colour, Precision::Single).unwrap();
    assert_eq!(config_from_bytes(&bytes, "colour").unwrap(), *colour.config());
    let wider = model_from_bytes(&bytes, "colour", true).unwrap();
    assert!(wider.takes_relief() && !colour.takes_relief());
    let expected = colour.instances(sample.image(), sample.relief());
    assert!(!expected.is_empty());
    assert_eq!(wider.instances(sample.image(), sample.relief()), expected);
    assert_eq!(wider.instances(sample.image(), None), expected);
    let (_, gradients) = wider.gradients(&[sample], 1);
    let of_last = gradients.get("backbone.relief.laterals.0.weight").unwrap();
    assert!(of_last.iter().any(|value| *value != 0.0));

    // A file that lost a part of its relief stem is refused.
    let bytes = weights_to_bytes(&wider, Precision::Half).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let lost = "backbone.relief.laterals.2.weight";
    let tensors = file.tensors().into_iter().filter(|(name, _)| name != lost);
    let metadata = SafeTensors::read_metadata(&bytes).unwrap().1.metadata().clone();
    let bytes = safetensors::serialize(tensors, metadata).unwrap();
    let error = model_from_bytes(&bytes, "part", true).unwrap_err();
    assert!(
        matches!(&error, WeightsError::Missing { key, .. } if key == lost),
        "{error}"
    );
}
